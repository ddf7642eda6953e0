//! `lsp`: the language server, for editors.
//!
//! Does not know: what editors ask.

use clap::Args;

use crate::editor;
use hamel_run::error::Error;

/// Speak the Language Server Protocol over standard input and output, for editors
///
/// Problems with their repairs while a model is written, what a name stands for with its unit and its equation, what
/// may be written next, definitions, references, other names, the form of a file, colours of words.
#[derive(Clone, Copy, Debug, Args)]
#[command(after_help = "\
Examples:
  hamel lsp                                 started by an editor: see the page about editors in the book")]
pub struct Arguments {
    /// Accepted for editors that pass it: standard input and output are all there is
    #[arg(long)]
    pub stdio: bool,
}

/// Talks to an editor until it says that this is all; prints nothing else.
///
/// # Errors
/// [`Error::Io`] when the editor ends without saying so.
pub fn run(_: &Arguments) -> Result<String, Error> {
    editor::serve()?;
    Ok(String::new())
}
