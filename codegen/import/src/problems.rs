//! Everything that is said about a file: problems that refuse it, and notes on contents that the model lacks.
//!
//! Deliberately does not know: formats, robots.

use std::ops::Range;

use hamel_lang::spec::{Diagnostic, Span};

/// Problems and notes of one file.
#[derive(Debug, Default)]
pub(crate) struct Problems {
    pub(crate) errors: Vec<Diagnostic>,
    pub(crate) notes: Vec<Diagnostic>,
}

fn span(place: &Range<usize>) -> Option<Span> {
    Some(Span::new(place.start, place.end))
}

impl Problems {
    pub(crate) fn error(&mut self, place: &Range<usize>, message: impl Into<String>, help: &str) {
        self.errors.push(Diagnostic::new(span(place), message).with_help(help));
    }

    /// What the model lacks, or has otherwise than the file.
    pub(crate) fn note(&mut self, place: &Range<usize>, message: impl Into<String>) {
        self.notes.push(Diagnostic::warning(span(place), message));
    }

    /// The notes, each text once, at its first place and with how often it is said.
    pub(crate) fn take_notes(&mut self) -> Vec<Diagnostic> {
        let mut grouped: Vec<(Diagnostic, usize)> = Vec::new();
        for note in std::mem::take(&mut self.notes) {
            match grouped.iter_mut().find(|(first, _)| first.message == note.message) {
                Some((_, n)) => *n += 1,
                None => grouped.push((note, 1)),
            }
        }
        let told = grouped.into_iter().map(|(mut note, n)| {
            if n > 1 {
                note.message.push_str(&format!(", {n} times"));
            }
            note
        });
        told.collect()
    }

    pub(crate) fn note_with_help(&mut self, place: &Range<usize>, message: impl Into<String>, help: &str) {
        self.notes.push(Diagnostic::warning(span(place), message).with_help(help));
    }
}
