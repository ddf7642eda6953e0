//! The program `hamel`: models of mechanics with symmetry listed, explained, evaluated, integrated and generated.
//!
//! Does not know: how scenes are evaluated and integrated, which `hamel-run` does.

pub mod commands;
#[cfg(feature = "lsp")]
pub mod editor;
pub mod output;

use std::process::ExitCode;

use hamel_run::Error;
use hamel_run::signs;
use hamel_run::streams::{self, Color, print, printed, tell};

/// The arguments of the program, or how it ends where they are wrong or ask for help.
///
/// # Errors
/// The exit status, after the message or the help was printed.
pub fn arguments<T: clap::Parser>() -> Result<T, ExitCode> {
    let command = T::command().color(match color_asked(std::env::args()) {
        Color::Auto => clap::ColorChoice::Auto,
        Color::Always => clap::ColorChoice::Always,
        Color::Never => clap::ColorChoice::Never,
    });
    command.try_get_matches().and_then(|matches| T::from_arg_matches(&matches)).map_err(|wrong| {
        let shown = wrong.print();
        if wrong.use_stderr() {
            return ExitCode::from(BAD_INPUT);
        }
        printed(shown).map_or_else(|error| failed(&error), |()| ExitCode::SUCCESS)
    })
}

/// The colours that arguments ask for, before they are read: help and messages about them have colours, too.
fn color_asked(arguments: impl Iterator<Item = String>) -> Color {
    let arguments: Vec<String> = arguments.take_while(|argument| argument != "--").collect();
    let pairs = arguments.iter().zip(arguments.iter().skip(1).map(Some).chain([None]));
    let values = pairs.filter_map(|(argument, next)| match argument.strip_prefix("--color") {
        Some("") => next.map(String::as_str),
        Some(rest) => rest.strip_prefix('='),
        None => None,
    });
    let last = values.last().and_then(|value| <Color as clap::ValueEnum>::from_str(value, false).ok());
    last.unwrap_or_default()
}

/// Messages besides answers, and their colours.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Telling {
    /// Tell nothing but errors on standard error: no warnings, no progress
    #[arg(short, long, global = true)]
    pub quiet: bool,
    /// Which texts have colours
    #[arg(long, global = true, value_enum, value_name = "WHEN", default_value_t = Color::Auto)]
    #[arg(hide_default_value = true)]
    pub color: Color,
}

impl Telling {
    /// Does so from now on.
    pub fn begin(self) {
        streams::set_color(self.color);
        if self.quiet {
            signs::be_quiet();
        }
    }
}

/// Prints what a command answers, or its error, and says how the program ends.
pub fn finish(result: Result<String, Error>) -> ExitCode {
    signs::rest();
    let printed = result.and_then(|text| if text.is_empty() { Ok(()) } else { print(&text) });
    printed.map_or_else(|error| failed(&error), |()| ExitCode::SUCCESS)
}

/// Exit status of a call whose arguments are wrong.
const BAD_INPUT: u8 = 2;

fn failed(error: &Error) -> ExitCode {
    tell(error.render(streams::is_coloured()));
    ExitCode::from(error.exit_code())
}
