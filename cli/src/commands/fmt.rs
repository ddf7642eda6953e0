//! `fmt`: model files in one form.
//!
//! Does not know: what the form is ([`spec::format`]).

use std::io::Read as _;
use std::path::PathBuf;

use clap::Args;
use hamel_codegen::config::write_atomically;
use hamel_codegen::spec;

use hamel_run::error::Error;

/// Write model files in one form: indentation, blanks and blank lines
///
/// Lines stay lines, comments stay, and every token stays what it is. A file with a syntax error is left as it is; when
/// one of several files has one, nothing is written.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel fmt my_model.hamel
  hamel fmt models/*.hamel --check          fail and name the files that are not in form
  hamel fmt - < my_model.hamel              from standard input to standard output"
)]
pub struct Arguments {
    /// Files to format; `-` reads standard input and writes standard output
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// Write nothing; fail and name the files that are not in form
    #[arg(long)]
    pub check: bool,
}

/// Formats the files, or compares them; a line about what was done, or the formatted standard input.
///
/// # Errors
/// The problems of all files together; [`Error::NotInForm`] when checking. On an error nothing has been written.
pub fn run(arguments: &Arguments) -> Result<String, Error> {
    let (mut changed, mut errors, mut out) = (Vec::new(), Vec::new(), String::new());
    for path in &arguments.files {
        let is_input = path.as_os_str() == "-";
        let shown = if is_input { "standard input".to_owned() } else { path.display().to_string() };
        let read = || {
            if !is_input {
                return std::fs::read_to_string(path);
            }
            let mut text = String::new();
            std::io::stdin().read_to_string(&mut text).map(|_| text)
        };
        let formatted = read().map_err(|e| Error::io(shown.clone(), e)).and_then(|text| {
            let formatted = spec::format(&shown, &text)?;
            Ok((formatted != text, formatted))
        });
        match formatted {
            Ok((_, text)) if is_input && !arguments.check => out.push_str(&text),
            Ok((true, text)) => changed.push((path, text)),
            Ok((false, _)) => {}
            Err(error) => errors.push(error),
        }
    }
    Error::all_of(errors)?;
    if arguments.check && !changed.is_empty() {
        let files = changed.into_iter().map(|(path, _)| path.clone()).collect();
        return Err(Error::NotInForm { files });
    }
    for (path, text) in &changed {
        write_atomically(path, text.as_bytes()).map_err(|e| Error::io(path.display().to_string(), e))?;
    }
    if !out.is_empty() {
        return Ok(out);
    }
    let n = arguments.files.len();
    Ok(match (arguments.check, changed.len()) {
        (true, _) => format!("{n} in form"),
        (false, n_changed) => format!("{n_changed} of {n} changed"),
    })
}
