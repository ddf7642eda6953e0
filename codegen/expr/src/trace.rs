//! What the generator takes, told on standard error while it works: `HAMEL_TRACE=derive,lower`. What it is at, told to
//! whoever [`watch`]es.
//!
//! `derive` has the stages from a model to its equations, each with its time, the expressions that it made and its
//! steps of work; `lower` has the functions of a program and the passes over it, with their operations. Nothing is
//! measured where the variable is not set. Does not know: what the stages are.

use std::fmt;
use std::sync::OnceLock;
use std::time::Instant;

/// What can be traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Stages from a model to its equations.
    Derive,
    /// Functions of a program, and passes.
    Lower,
}

/// The topics that the environment asks for.
fn topics() -> &'static [Topic] {
    static TOPICS: OnceLock<Vec<Topic>> = OnceLock::new();
    TOPICS.get_or_init(|| asked(&std::env::var("HAMEL_TRACE").unwrap_or_default()))
}

/// The topics of a list of words; a word that is none is told.
fn asked(words: &str) -> Vec<Topic> {
    let mut topics = Vec::new();
    for word in words.split(',').map(str::trim).filter(|word| !word.is_empty()) {
        match word {
            "derive" => topics.push(Topic::Derive),
            "lower" => topics.push(Topic::Lower),
            _ => eprintln!("HAMEL_TRACE knows derive and lower, not {word:?}"),
        }
    }
    topics
}

/// Whoever watches.
static WATCHER: OnceLock<fn(&str)> = OnceLock::new();

/// Has the generator tell what it begins with, on any of its threads, from now on; the first watcher stays.
pub fn watch(watcher: fn(&str)) {
    // A second one would take the place of the first in the middle of its work.
    let _ = WATCHER.set(watcher);
}

/// Tells the watcher what begins, where there is one.
pub fn at(what: impl fmt::Display) {
    if let Some(watcher) = WATCHER.get() {
        watcher(&what.to_string());
    }
}

/// The time from now on, if the topic is traced.
pub fn start(topic: Topic) -> Option<Instant> {
    topics().contains(&topic).then(Instant::now)
}

/// Tells what took the time since the start.
pub fn tell(since: Instant, name: impl fmt::Display, size: impl fmt::Display) {
    eprintln!("{}", line(since.elapsed().as_secs_f64(), &name.to_string(), &size.to_string()));
}

fn line(seconds: f64, name: &str, size: &str) -> String {
    format!("trace: {:>9.3} ms  {name:<36} {size}", 1e3 * seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_are_read_from_words() {
        assert_eq!(asked(""), []);
        assert_eq!(asked("lower, derive"), [Topic::Lower, Topic::Derive]);
        assert_eq!(asked("derive,everything"), [Topic::Derive]);
        let told = line(0.0125, "reduction", "40 expressions");
        assert_eq!(told, "trace:    12.500 ms  reduction                            40 expressions");
    }
}
