//! Tools of this machine, as a release needs them.
//!
//! Does not know: what a release has.

use std::process::Command;

use hamel::output::terminal::bold;
use hamel_run::Error;

/// A failed step.
pub(super) fn failed(step: &str, status: impl Into<String>) -> Error {
    Error::Failed { step: step.to_owned(), status: status.into() }
}

/// Runs a tool to its end.
pub(super) fn step(command: &mut Command) -> Result<(), Error> {
    let name = command.get_program().to_string_lossy().into_owned();
    eprintln!("{}", bold(&format!("running {name}")));
    let status = command.status().map_err(|e| failed(&name, format!("could not be started: {e}")))?;
    if status.success() { Ok(()) } else { Err(failed(&name, status.to_string())) }
}

/// The output of a tool, where it is there and succeeds.
pub(super) fn tool(name: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(name).args(arguments).output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The target that the compiler compiles for unless told otherwise.
pub(super) fn host() -> Result<String, Error> {
    let told = tool("rustc", &["-vV"]).ok_or_else(|| failed("rustc -vV", "is not there"))?;
    let host = told.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).ok_or_else(|| failed("rustc -vV", "names no host"))
}
