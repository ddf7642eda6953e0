//! The program `hamel`: models of mechanics with symmetry listed, explained, evaluated, integrated and generated.
//!
//! Does not know: how scenes are evaluated and integrated, which `hamel-run` does.

pub mod commands;
#[cfg(feature = "lsp")]
pub mod editor;
pub mod output;

use std::process::ExitCode;

use hamel_run::Error;
use hamel_run::streams::{self, print, printed, tell};

/// The arguments of the program, or how it ends where they are wrong or ask for help.
///
/// # Errors
/// The exit status, after the message or the help was printed.
pub fn arguments<T: clap::Parser>() -> Result<T, ExitCode> {
    T::try_parse().map_err(|wrong| {
        let shown = wrong.print();
        if wrong.use_stderr() {
            return ExitCode::from(BAD_INPUT);
        }
        printed(shown).map_or_else(|error| failed(&error), |()| ExitCode::SUCCESS)
    })
}

/// Prints what a command answers, or its error, and says how the program ends.
pub fn finish(result: Result<String, Error>) -> ExitCode {
    let printed = result.and_then(|text| if text.is_empty() { Ok(()) } else { print(&text) });
    printed.map_or_else(|error| failed(&error), |()| ExitCode::SUCCESS)
}

/// Exit status of a call whose arguments are wrong.
const BAD_INPUT: u8 = 2;

fn failed(error: &Error) -> ExitCode {
    tell(error.render(streams::is_coloured()));
    ExitCode::from(error.exit_code())
}
