//! The program as tests run it, with a cache of their own.

use std::io::Write as _;
use std::process::{Command, Output, Stdio};

/// A call of the program with arguments.
pub(crate) fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hamel"));
    command.env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache")).args(arguments);
    command
}

/// What comes of a call with an input.
#[allow(dead_code, reason = "not every test talks this way")]
pub(crate) fn output(command: &mut Command, input: &str) -> Output {
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // The program may end before it reads.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}
