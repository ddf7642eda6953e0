//! The structure of any text, whether or not it is a model: what editors fold, and the call that a place is in.
//!
//! Deliberately does not know: items, what a name stands for.

use super::diagnostic::Span;
use super::tokens::{Kind, Token, tokens};

/// A part of a text of several lines that editors may hide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fold {
    /// From the bracket that opens to the one that closes, or the comments of lines that follow each other.
    pub span: Span,
    /// Whether it consists of comments.
    pub is_comment: bool,
}

/// Brackets with their contents and runs of comments, of several lines each, in the order of their beginnings. A
/// bracket that nothing closes has none.
pub fn folds(text: &str) -> Vec<Fold> {
    let (mut found, mut open) = (Vec::new(), Vec::<Token<'_>>::new());
    let mut comments: Option<Span> = None;
    let has_lines = |span: Span| text[span.start..span.end].trim_end().contains('\n');
    let end_of = |token: &Token<'_>| token.start + token.text.len();
    for token in tokens(text) {
        if token.is_comment() {
            // A comment behind other text of its line belongs to that.
            let begins_line =
                text[..token.start].rsplit('\n').next().is_none_or(|line| line.trim().is_empty());
            let goes_on = comments.filter(|_| begins_line && token.n_breaks <= 1);
            found.extend(comments.filter(|_| goes_on.is_none()));
            let start = goes_on.map_or(token.start, |run| run.start);
            comments = (begins_line || goes_on.is_some()).then_some(Span::new(start, end_of(&token)));
            continue;
        }
        found.extend(comments.take());
        if token.opens() {
            open.push(token);
        } else if token.closes() {
            let of = |mark: &str| matches!((mark, token.text), ("(", ")") | ("[", "]") | ("{", "}"));
            // Brackets within that nothing closes are left out.
            if let Some(at) = open.iter().rposition(|opening| of(opening.text)) {
                found.push(Span::new(open[at].start, end_of(&token)));
                open.truncate(at);
            }
        }
    }
    found.extend(comments);
    let mut found: Vec<Fold> = found
        .into_iter()
        .filter(|span| has_lines(*span))
        .map(|span| Fold { span, is_comment: text[span.start..].starts_with('/') })
        .collect();
    found.sort_by_key(|fold| (fold.span.start, fold.span.end));
    found
}

/// A call of a function around a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Call {
    /// The name of the function.
    pub name: Span,
    /// Which argument the place is in, from zero on.
    pub argument: usize,
}

/// The innermost call whose parentheses a byte of a text is in, closed or not.
pub fn call_at(text: &str, offset: usize) -> Option<Call> {
    // For each open bracket the name before it, where it is a call, and the arguments so far.
    let mut open: Vec<(Option<Span>, usize)> = Vec::new();
    let mut before: Option<Token<'_>> = None;
    for token in tokens(text) {
        let end = token.start + token.text.len();
        if token.start >= offset {
            break;
        }
        if token.is_comment() {
            // Within a comment nothing is called; one of a line ends where the line does.
            if offset < end || (token.kind == Kind::LineComment && offset == end) {
                return None;
            }
            continue;
        }
        match token.text {
            "(" | "[" | "{" if token.opens() => {
                let name = before.filter(|name| {
                    let is_name = name.text.starts_with(|c: char| c.is_alphabetic() || c == '_');
                    token.text == "("
                        && name.kind == Kind::Word
                        && is_name
                        && !token.has_blanks
                        && token.n_breaks == 0
                });
                open.push((name.map(|name| Span::new(name.start, name.start + name.text.len())), 0));
            }
            ")" | "]" | "}" if token.closes() => _ = open.pop(),
            "," => {
                if let Some((_, argument)) = open.last_mut() {
                    *argument += 1;
                }
            }
            // An item ends, and with it every open call.
            ";" => open.retain(|(name, _)| name.is_none()),
            _ => {}
        }
        before = Some(token);
    }
    // A vector within an argument is part of it.
    open.into_iter().rev().find_map(|(name, argument)| Some(Call { name: name?, argument }))
}

#[cfg(test)]
mod tests {
    use super::{call_at, folds};

    #[test]
    fn brackets_and_runs_of_comments_are_folded() {
        let text = "/// A rod\n/// of two lines\nmodel rod { // here\n    let a = [1, 2];\n    // one line\n    let b = \
                    [\n        1,\n    ];\n    /* of\n       lines */\n    scene s { want (\n}\n";
        let found: Vec<(&str, bool)> = folds(text)
            .into_iter()
            .map(|fold| (text[fold.span.start..fold.span.end].lines().next().unwrap(), fold.is_comment))
            .collect();
        assert_eq!(
            found,
            [("/// A rod", true), ("[", false), ("/* of", true), ("{ want (", false)],
            "{text}"
        );
        assert_eq!(folds("model m {\n}\n").len(), 1);
        assert_eq!(folds("model m { \"{\n}\" }").len(), 1);
    }

    #[test]
    fn a_place_is_in_the_innermost_call() {
        let text = "let a = cross(b, dot([c, d], rate(e, f) // x(\n ), g); let (h";
        let of = |place: &str| {
            let at = text.find(place).unwrap();
            call_at(text, at).map(|call| (&text[call.name.start..call.name.end], call.argument))
        };
        assert_eq!(of("b,"), Some(("cross", 0)));
        assert_eq!(of("dot"), Some(("cross", 1)));
        assert_eq!(of("d]"), Some(("dot", 0)));
        assert_eq!(of("rate"), Some(("dot", 1)));
        assert_eq!(of("f)"), Some(("rate", 1)));
        assert_eq!(of("x("), None);
        assert_eq!(of("g);"), Some(("cross", 2)));
        assert_eq!((of("let"), of("h")), (None, None));
        let open = "let a = cross(b, ";
        assert_eq!(call_at(open, open.len()).map(|call| call.argument), Some(1));
        // What an item leaves open ends with it.
        let next = "let a = cross(b; let c = d";
        assert_eq!(call_at(next, next.len()), None);
    }
}
