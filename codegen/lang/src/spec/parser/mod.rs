//! Text to syntax tree.
//!
//! The tokens are syn's: `proc_macro2` lexes, a `syn::buffer::Cursor` walks. An item that does not parse is reported
//! and skipped, so one run reports the problems of all items. Nothing here recurses deeper than
//! [`MAX_DEPTH`](super::limits::MAX_DEPTH).
//!
//! Deliberately does not know: what names stand for, shapes, values.

mod bodies;
mod cursor;
mod expressions;
mod file;
mod frames;
mod items;
mod lexer;
mod loops;
mod modes;
mod recovery;
mod scope;
mod sizes;

pub(super) use self::file::Outcome;

use proc_macro2::Delimiter;
use syn::buffer::{Cursor, TokenBuffer};

use self::cursor::Parser;
use self::lexer::{check_brackets, check_nesting, lex, without_hash_comments, without_hidden};
use self::scope::{Loops, Shared};
use self::sizes::read_sizes;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::limits::MAX_BYTES;
use hamel_expr::parallel::with_own_tokens;

/// As [`parse_file`] with each loop read once, and also what can be understood of a text whose brackets do not close;
/// its problems are those of the text in which they do.
pub(super) fn parse_leniently(text: &str) -> Outcome {
    with_own_tokens(|| {
        let outcome = parse_with(text, Loops::Once);
        if outcome.file.is_some() || text.len() > MAX_BYTES {
            return outcome;
        }
        parse_with(&recovery::balanced(text), Loops::Once)
    })
}

/// Parses a text of at most [`MAX_BYTES`].
pub(super) fn parse_file(text: &str) -> Outcome {
    with_own_tokens(|| parse_with(text, Loops::WrittenOut))
}

fn parse_with(text: &str, loops: Loops) -> Outcome {
    let mut outcome = Outcome::default();
    if text.len() > MAX_BYTES {
        let message = format!("the file has {} bytes, the limit is {MAX_BYTES}", text.len());
        let start = Some(Span::new(0, 0));
        outcome.problems.push(Diagnostic::new(start, message).with_help("put one model in a file"));
        return outcome;
    }
    let seen = without_hidden(text, &mut outcome.problems);
    let blanked = without_hash_comments(&seen, &mut outcome.problems);
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
    let sizes = model_body(buffer.begin()).map_or_else(Vec::new, |body| read_sizes(text, body, loops));
    let read = |shared: &Shared, mut outcome: Outcome| {
        Parser::new(text, buffer.begin(), shared).file(&mut outcome);
        outcome
    };
    let shared = Shared::new(loops, sizes);
    let first = read(&shared, outcome.clone());
    // Which names have an index is known once the file has been read: order of items is free.
    match shared.again() {
        Some(shared) => read(&shared, outcome),
        None => first,
    }
}

/// What stands between the braces of the model.
fn model_body(cursor: Cursor<'_>) -> Option<Cursor<'_>> {
    let mut at = cursor;
    loop {
        if let Some((body, _, _)) = at.group(Delimiter::Brace) {
            return Some(body);
        }
        at = at.token_tree()?.1;
    }
}
