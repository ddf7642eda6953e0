//! Standard output and standard error.
//!
//! Nothing else of the program writes to either, but for bars of progress and for the conversations of `lsp` and of
//! compiled models.
//!
//! Does not know: what is written.

use std::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal as _, Write as _};

use crate::error::Error;

/// Prints lines to standard output.
///
/// # Errors
/// [`Error::Io`] where they do not arrive, such as on a full disk. A reader that has seen enough, such as `head`, is no
/// failure.
pub fn print(text: &str) -> Result<(), Error> {
    printed(writeln!(io::stdout(), "{}", text.trim_end_matches('\n')))
}

/// What became of a text that was written to standard output.
///
/// # Errors
/// As [`print()`].
pub fn printed(written: io::Result<()>) -> Result<(), Error> {
    match written.and_then(|()| io::stdout().flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Error::io("standard output", error)),
        _ => Ok(()),
    }
}

/// Tells a line on standard error. Where that cannot be written, nobody can be told.
pub fn tell(text: impl Display) {
    let _ = writeln!(io::stderr(), "{text}");
}

/// Whether standard error shows colours.
pub fn is_coloured() -> bool {
    io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}
