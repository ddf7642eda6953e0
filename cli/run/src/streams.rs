//! Standard output and standard error.
//!
//! Nothing else of the program writes to either, but for bars of progress and for the conversations of `lsp` and of
//! compiled models.
//!
//! Does not know: what is written.

use std::fmt::Display;
use std::io::{self, ErrorKind, IsTerminal, Write as _};
use std::sync::atomic::{AtomicU8, Ordering};

use crate::error::Error;
use crate::signs;

/// Prints lines to standard output.
///
/// # Errors
/// [`Error::Io`] where they do not arrive, such as on a full disk. A reader that has seen enough, such as `head`, is no
/// failure.
pub fn print(text: &str) -> Result<(), Error> {
    signs::rest();
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

/// Tells a warning or a note on standard error, unless only errors are told.
pub fn note(text: impl Display) {
    if !signs::is_quiet() {
        tell(text);
    }
}

/// Tells a line on standard error. Where that cannot be written, nobody can be told.
pub fn tell(text: impl Display) {
    signs::rest();
    let _ = writeln!(io::stderr(), "{text}");
}

/// Which texts have colours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Color {
    /// Texts on a terminal, unless `NO_COLOR` is set
    #[default]
    Auto,
    /// All
    Always,
    /// None
    Never,
}

const AUTO: u8 = 0;
const ALWAYS: u8 = 1;
const NEVER: u8 = 2;

static COLOR: AtomicU8 = AtomicU8::new(AUTO);

/// Says which texts have colours, from now on.
pub fn set_color(color: Color) {
    let code = match color {
        Color::Auto => AUTO,
        Color::Always => ALWAYS,
        Color::Never => NEVER,
    };
    COLOR.store(code, Ordering::Relaxed);
}

fn is_coloured_on(stream: &impl IsTerminal) -> bool {
    match COLOR.load(Ordering::Relaxed) {
        ALWAYS => true,
        NEVER => false,
        _ => stream.is_terminal() && std::env::var_os("NO_COLOR").is_none(),
    }
}

/// Whether standard error shows colours.
pub fn is_coloured() -> bool {
    is_coloured_on(&io::stderr())
}

/// Whether standard output shows colours.
pub fn is_output_coloured() -> bool {
    is_coloured_on(&io::stdout())
}
