//! Measures the models for `cargo xtask stress`; started by it, not by hand.

use std::process::ExitCode;

use clap::Parser as _;
use hamel_run::Error;
use hamel_stress::request::{Arguments, StressRequest};
use hamel_stress::run;

fn stress() -> Result<(), Error> {
    run::run(StressRequest::new(Arguments::parse())?)
}

fn main() -> ExitCode {
    match stress() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("hamel-stress: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}
