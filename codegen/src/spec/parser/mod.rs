//! Text to syntax tree.
//!
//! The tokens are syn's: `proc_macro2` lexes, a `syn::buffer::Cursor` walks. An item that does not parse is reported
//! and skipped, so one run reports the problems of all items. Nothing here recurses deeper than
//! [`MAX_DEPTH`](super::limits::MAX_DEPTH).
//!
//! Deliberately does not know: what names stand for, shapes, values.

mod cursor;
mod expressions;
mod file;
mod frames;
mod items;
mod lexer;
mod recovery;

pub(super) use self::file::Outcome;

use std::collections::BTreeSet;

use syn::buffer::TokenBuffer;

use self::cursor::Parser;
use self::lexer::{check_brackets, check_nesting, lex, without_hash_comments};
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::limits::MAX_BYTES;

/// As [`parse_file`], and also what can be understood of a text whose brackets do not close; its problems are those of
/// the text in which they do.
pub(super) fn parse_leniently(text: &str) -> Outcome {
    let outcome = parse_file(text);
    if outcome.file.is_some() || text.len() > MAX_BYTES {
        return outcome;
    }
    parse_file(&recovery::balanced(text))
}

/// Parses a text of at most [`MAX_BYTES`].
pub(super) fn parse_file(text: &str) -> Outcome {
    let mut outcome = Outcome { file: None, problems: Vec::new(), poisoned: BTreeSet::new() };
    if text.len() > MAX_BYTES {
        let message = format!("the file has {} bytes, the limit is {MAX_BYTES}", text.len());
        let start = Some(Span::new(0, 0));
        outcome.problems.push(Diagnostic::new(start, message).with_help("put one model in a file"));
        return outcome;
    }
    let blanked = without_hash_comments(text, &mut outcome.problems);
    let text = blanked.as_str();
    if let Err(problem) = check_brackets(text) {
        outcome.problems.push(*problem);
        return outcome;
    }
    let Some(tokens) = lex(text, &mut outcome.problems) else { return outcome };
    if let Err(problem) = check_nesting(&tokens) {
        outcome.problems.push(*problem);
        return outcome;
    }
    let buffer = TokenBuffer::new2(tokens);
    let mut parser = Parser { text, cursor: buffer.begin(), end: text.len(), last: 0, depth: 0 };
    parser.file(&mut outcome);
    outcome
}
