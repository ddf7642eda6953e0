//! Signs of life on a terminal: what the generator is at, bars of progress, and whether any of it is wanted.
//!
//! A line appears once work takes more than a second, and goes away before anything else is written. Does not know:
//! what the work is.

use std::io::IsTerminal as _;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

/// What takes less time has no sign.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often the line moves.
const TICK: Duration = Duration::from_millis(120);

/// Bars that are shown in the place of the line.
static N_BARS: AtomicUsize = AtomicUsize::new(0);

/// Whether only errors are told.
static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// The line.
struct Line {
    /// When the work began, while there is some.
    since: Option<Instant>,
    /// What there is to do, and what the generator is at.
    whole: String,
    stage: String,
    bar: Option<ProgressBar>,
}

static LINE: Mutex<Line> =
    Mutex::new(Line { since: None, whole: String::new(), stage: String::new(), bar: None });

fn line() -> MutexGuard<'static, Line> {
    LINE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on nothing but errors is told on standard error.
pub fn be_quiet() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

/// Whether only errors are told.
pub fn is_quiet() -> bool {
    IS_QUIET.load(Ordering::Relaxed)
}

/// Whether bars and lines of progress are shown: on a terminal, unless nothing but errors is wanted.
pub fn are_shown() -> bool {
    !is_quiet() && std::io::stderr().is_terminal()
}

/// Shows what the generator is at, from now on.
pub fn watch() {
    if !are_shown() {
        return;
    }
    hamel_expr::trace::watch(at);
    // Without the thread there is no line, and the work is done all the same.
    let moving = || {
        loop {
            std::thread::sleep(TICK);
            line().show();
        }
    };
    let _ = std::thread::Builder::new().name("signs of life".into()).spawn(moving);
}

/// The generator begins with something.
fn at(stage: &str) {
    let mut line = line();
    line.since.get_or_insert_with(Instant::now);
    stage.clone_into(&mut line.stage);
}

/// Says how much of the whole is done, before what the generator is at.
pub fn whole(text: String) {
    if are_shown() {
        line().whole = text;
    }
}

/// Takes the line away until the generator begins with something.
pub fn rest() {
    let mut line = line();
    line.since = None;
    if let Some(bar) = line.bar.take() {
        bar.finish_and_clear();
    }
}

/// A bar takes the place of the line, as long as this value lives.
#[derive(Debug)]
pub struct Instead(());

impl Instead {
    /// Takes the line away.
    pub fn of_line() -> Instead {
        N_BARS.fetch_add(1, Ordering::Relaxed);
        rest();
        Instead(())
    }
}

impl Drop for Instead {
    fn drop(&mut self) {
        N_BARS.fetch_sub(1, Ordering::Relaxed);
        rest();
    }
}

impl Line {
    /// Shows the line where work takes long, and moves it.
    fn show(&mut self) {
        if N_BARS.load(Ordering::Relaxed) > 0 {
            return;
        }
        if self.since.is_none_or(|since| since.elapsed() < PATIENCE) {
            return;
        }
        let text = self.text();
        let bar = self.bar.get_or_insert_with(|| {
            let bar = ProgressBar::new_spinner();
            // The template is a constant that indicatif accepts.
            bar.set_style(
                ProgressStyle::with_template("  {spinner} {msg}  {elapsed}").expect("valid template"),
            );
            bar
        });
        bar.set_message(text);
        bar.tick();
    }

    fn text(&self) -> String {
        if self.whole.is_empty() { self.stage.clone() } else { format!("{}: {}", self.whole, self.stage) }
    }
}

#[cfg(test)]
mod tests {
    use super::Line;

    #[test]
    fn a_line_has_the_whole_before_the_stage() {
        let line =
            |whole: &str| Line { since: None, whole: whole.into(), stage: "reduction".into(), bar: None };
        assert_eq!(line("").text(), "reduction");
        assert_eq!(line("model 2 of 5, heavy_top").text(), "model 2 of 5, heavy_top: reduction");
    }
}
