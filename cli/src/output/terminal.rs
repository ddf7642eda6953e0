//! What a terminal can show: its width and bold text.
//!
//! Does not know: what is shown.

use std::io::IsTerminal as _;

/// Columns of the terminal, as far as lines of text should use them.
pub(crate) fn width() -> usize {
    let columns = std::env::var("COLUMNS").ok().and_then(|c| c.parse().ok());
    columns.unwrap_or(100_usize).clamp(60, 140)
}

/// Bold text on a terminal, otherwise the text.
pub fn bold(text: &str) -> String {
    if colours_on_stdout() { format!("\u{1b}[1m{text}\u{1b}[0m") } else { text.to_owned() }
}

fn colours_on_stdout() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}
