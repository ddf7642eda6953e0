//! Requests as JSON and in words of the command line, and answers as JSON.
//!
//! Does not know: how anything is computed.

mod eval;
pub mod fit;
pub mod fluid;
pub mod json;
pub mod share;
mod sheet;
pub mod simulate;
pub mod sizes;
pub mod table;
pub mod variation;

use std::io::{IsTerminal as _, Read as _};

use crate::error::Error;
use crate::streams::tell;

/// Reads a request from standard input, and says so when nobody seems to know.
///
/// # Errors
/// [`Error::Io`].
pub fn read_request(example: &str) -> Result<String, Error> {
    let stdin = std::io::stdin();
    if stdin.is_terminal() {
        tell(format_args!("reading a JSON request such as {example} from the terminal; end it with Ctrl-D"));
    }
    let mut text = String::new();
    stdin.lock().read_to_string(&mut text).map_err(|e| Error::io("standard input", e))?;
    Ok(text)
}
