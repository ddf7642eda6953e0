//! `new`: a commented model to start from.
//!
//! Does not know: what is in the model.

use std::io::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::Program;
use hamel_run::error::Error;
use hamel_run::model;
use hamel_run::repository::Repository;
use hamel_run::session::Session;

/// Write a commented model to start from
///
/// The model can be explained, simulated and generated as it is. A name is written to the current folder, inside
/// hamel's repository to models/specs; a file that is there already is never touched.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel new my_model              my_model.hamel
  hamel new ../robot/arm.hamel    a file of another crate, for its build script"
)]
pub struct Arguments {
    /// Name of the model, or a path that ends in .hamel
    pub model: String,
}

/// A model to start from, with `NAME` for its name.
const STARTER: &str = include_str!("starter.hamel");

/// Writes a model to start from, and says what to do with it.
///
/// # Errors
/// [`Error::BadName`] for a name that a model cannot have; [`Error::NoFolder`]; [`Error::Exists`]; [`Error::Io`].
pub fn run(session: &Session, program: &Program, arguments: &Arguments) -> Result<String, Error> {
    let model = arguments.model.as_str();
    let specs = session.repository().map(Repository::specs_folder);
    // Without the ending, all of it is the name, also what looks like a folder.
    let (name, path) = match model.strip_suffix(".hamel") {
        Some(_) => {
            let path = PathBuf::from(model);
            (path.file_stem().and_then(|s| s.to_str()).unwrap_or_default().to_owned(), path)
        }
        None => (model.to_owned(), specs.clone().unwrap_or_default().join(format!("{model}.hamel"))),
    };
    if let Some(reason) = model::name_refusal(&name) {
        let instead: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let instead = Some(instead).filter(|instead| model::name_refusal(instead).is_none());
        return Err(Error::BadName { name, reason, instead });
    }
    let text = STARTER.replace("NAME", &name);
    let shown = session.shown(&path);
    session.parse(&shown, &text)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir());
    if let Some(folder) = folder {
        return Err(Error::NoFolder { file: shown, folder: session.shown(folder) });
    }
    let fail = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::AlreadyExists => Error::Exists { file: shown.clone() },
        _ => Error::io(shown.clone(), e),
    };
    let mut file = std::fs::File::create_new(&path).map_err(fail)?;
    file.write_all(text.as_bytes()).map_err(fail)?;
    let program = program.name;
    let is_of_repository = specs.is_some() && path.parent() == specs.as_deref();
    let argument = if is_of_repository { name.clone() } else { path.display().to_string() };
    let last = match is_of_repository {
        true => "  cargo xtask generate".to_owned(),
        false => format!(
            "A build script generates it in a crate of its own (docs/build-rs.md), or, to check the module in:\n  hamel generate \
             {argument} --out-dir src/generated"
        ),
    };
    let lines = [
        format!("{shown} is a model to start from. Look at it, change it, and try:"),
        format!("  {program} explain {argument}"),
        format!("  {program} simulate {argument} --reconstruct -o {name}.svg"),
        last,
    ];
    Ok(lines.join("\n"))
}
