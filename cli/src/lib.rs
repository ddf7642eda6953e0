//! The program `hamel`: models of mechanics with symmetry listed, explained, evaluated, integrated and generated.
//!
//! Everything that evaluates a scene does so through [`run::dynamics::Dynamics`], so that the interpreter here and
//! compiled models in another process share one implementation of every command.
//!
//! Does not know: generated code. Compiled models are reached through another process ([`run::remote`]).

pub mod cache;
pub mod commands;
pub mod editor;
pub mod error;
mod hash;
pub mod model;
pub mod names;
pub mod output;
pub mod repository;
pub mod request;
pub mod run;
pub mod session;

pub use error::Error;

use std::io::{IsTerminal as _, Write as _};
use std::process::ExitCode;

/// Prints what a command answers, or its error, and says how the program ends.
pub fn finish(result: Result<String, Error>) -> ExitCode {
    match result {
        Ok(text) if text.is_empty() => ExitCode::SUCCESS,
        Ok(text) => {
            // A reader that has seen enough, such as `head`, is no failure.
            let _ = writeln!(std::io::stdout(), "{}", text.trim_end_matches('\n'));
            ExitCode::SUCCESS
        }
        Err(error) => {
            let color = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
            eprintln!("{}", error.render(color));
            ExitCode::from(error.exit_code())
        }
    }
}
