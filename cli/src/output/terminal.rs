//! What a terminal can show: its width, bold text, and how far a search is.
//!
//! Does not know: what is shown.

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use hamel_run::signs::{self, Instead};
use hamel_run::streams;
use indicatif::{ProgressBar, ProgressStyle};

/// What takes less time gets no bar.
const PATIENCE: Duration = Duration::from_millis(400);

/// A bar on a terminal for work whose amount may still grow; it appears when the work takes long.
pub struct Bar {
    start: Instant,
    bar: Option<OnceLock<ProgressBar>>,
    _instead: Instead,
}

impl Bar {
    /// No bar yet.
    pub fn new() -> Bar {
        Bar {
            start: Instant::now(),
            bar: signs::are_shown().then(OnceLock::new),
            _instead: Instead::of_line(),
        }
    }

    /// Shows how much is done of what is known by now.
    pub fn show(&self, done: usize, total: usize) {
        let Some(bar) = self.bar.as_ref().filter(|_| self.start.elapsed() >= PATIENCE) else { return };
        let bar = bar.get_or_init(|| {
            let bar = ProgressBar::new(total as u64);
            let template = "  {bar:40} {pos}/{len}";
            // The template is a constant that indicatif accepts.
            bar.set_style(ProgressStyle::with_template(template).expect("valid template"));
            bar
        });
        bar.set_length(total as u64);
        bar.set_position(done as u64);
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.bar.as_ref().and_then(OnceLock::get).iter().for_each(|bar| bar.finish_and_clear());
    }
}

impl Default for Bar {
    fn default() -> Bar {
        Bar::new()
    }
}

/// Columns of the terminal, as far as lines of text should use them.
pub(crate) fn width() -> usize {
    let columns = std::env::var("COLUMNS").ok().and_then(|c| c.parse().ok());
    columns.unwrap_or(100_usize).clamp(60, 140)
}

/// Bold text on a terminal, otherwise the text.
pub fn bold(text: &str) -> String {
    if streams::is_output_coloured() { format!("\u{1b}[1m{text}\u{1b}[0m") } else { text.to_owned() }
}
