//! A file: the model, its items one by one, and where to go on after an item that does not parse.
//!
//! Deliberately does not know: what an item consists of.

use std::collections::BTreeSet;

use proc_macro2::{Delimiter, TokenTree};
use syn::buffer::Cursor;

use super::cursor::Parser;
use super::lexer::span_of;
use super::scope::Loops;
use crate::spec::ast::*;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::names;

/// What the parser understood, and which names it could not.
#[derive(Clone, Debug, Default)]
pub(in crate::spec) struct Outcome {
    pub(in crate::spec) file: Option<File>,
    pub(in crate::spec) problems: Vec<Diagnostic>,
    /// Names that occur in items that did not parse: nothing is said about them later.
    pub(in crate::spec) poisoned: BTreeSet<String>,
    /// Whether the text is read as a part of another model.
    pub(in crate::spec) is_part: bool,
}

impl<'a> Parser<'a> {
    pub(super) fn file(&mut self, outcome: &mut Outcome) {
        let doc = match self.docs() {
            Ok(doc) => doc,
            Err(problem) => return outcome.problems.push(*problem),
        };
        if self.at_end() {
            outcome.problems.push(
                Diagnostic::new(Some(self.here()), "the file contains no model")
                    .with_help("begin with `model name { .. }`"),
            );
            return;
        }
        let header = (|| {
            if self.word("model").is_none() {
                return self.expected("`model name { .. }`");
            }
            let name = self.ident("the name of the model")?;
            let (body, _) = self.require_group(Delimiter::Brace, "`{`")?;
            Ok((name, body))
        })();
        let (name, mut body) = match header {
            Ok(header) => header,
            Err(problem) => return outcome.problems.push(*problem),
        };
        let mut items = Vec::new();
        body.items(outcome, &mut items);
        let families = self.shared.families();
        if !self.at_end() {
            let found = self.found();
            let problem = Diagnostic::new(Some(self.here()), format!("{found} after the end of the model"));
            outcome.problems.push(problem.with_help("a file holds one model: `model name { .. }`"));
        }
        let wrong = self.shared.size_problems.take();
        if !wrong.is_empty() && self.shared.loops == Loops::WrittenOut {
            // Everything else depends on sizes.
            outcome.problems = wrong;
            return;
        }
        let indices = self.shared.indices.take();
        outcome.file = Some(File { doc, name, items, indices, families });
    }

    pub(super) fn items(&mut self, outcome: &mut Outcome, items: &mut Vec<Item>) {
        loop {
            let start = self.cursor;
            let first = self.here();
            let doc = self.docs();
            if self.at_end() {
                if doc.as_ref().is_ok_and(|doc| !doc.is_empty()) {
                    let problem = Diagnostic::new(Some(first), "doc comment belongs to no item");
                    outcome.problems.push(problem.with_help("write a plain comment with `//`"));
                }
                if let Err(problem) = doc {
                    outcome.problems.push(*problem);
                }
                return;
            }
            if self.punct(";").is_some() {
                continue;
            }
            if self.peek_ident().as_deref() == Some("for") {
                if doc.is_ok_and(|doc| !doc.is_empty()) {
                    let problem = Diagnostic::new(Some(first), "doc comment belongs to no item");
                    outcome.problems.push(problem.with_help("write it within the loop, before an item"));
                }
                let read = self.for_items(|inside| {
                    let before = outcome.problems.len();
                    inside.items(outcome, items);
                    // What is wrong with one turn is most often wrong with all.
                    outcome.problems.len() == before
                });
                if let Err(mut problem) = read {
                    problem.help = problem.help.or(names::item_form("for"));
                    outcome.problems.push(*problem);
                    self.skip_item();
                    poison(start, self.cursor, &mut outcome.poisoned);
                }
                continue;
            }
            if self.peek_ident().as_deref() == Some("mode") {
                let read = doc.and_then(|doc| self.mode(doc, outcome, items));
                if let Err(mut problem) = read {
                    problem.help = problem.help.or(names::item_form("mode"));
                    outcome.problems.push(*problem);
                    self.skip_item();
                    poison(start, self.cursor, &mut outcome.poisoned);
                }
                continue;
            }
            if self.peek_ident().as_deref() == Some("part") {
                let read = doc.and_then(|_| self.part(outcome, items));
                if let Err(problem) = read {
                    outcome.problems.push(*problem);
                    self.skip_item();
                    poison(start, self.cursor, &mut outcome.poisoned);
                }
                continue;
            }
            let keyword = self.here();
            let word = self.peek_ident();
            let form = word.as_ref().and_then(|word| names::item_form(word));
            let parsed = doc.and_then(|doc| Ok((doc, self.item()?)));
            match parsed {
                Ok((doc, (kind, block))) => {
                    let span = Span::new(keyword.start, self.last);
                    let extent = Span::new(first.start, self.last);
                    items.push(Item { doc, extent, span, kind, mode: None });
                    if !block && self.punct(";").is_none() {
                        let at = Span::new(self.last, self.last);
                        let found = self.found();
                        let problem = Diagnostic::new(Some(at), format!("expected `;`, found {found}"));
                        outcome.problems.push(problem.with_help(self.after_item(form)));
                        // Before another item only the `;` is missing.
                        if !self.peek_ident().is_some_and(|word| names::is_item(&word)) {
                            self.skip_item();
                        }
                    }
                }
                Err(mut problem) => {
                    problem.help = problem.help.or(form);
                    if word.as_deref() == Some("size") {
                        self.shared.size_problems.borrow_mut().push((*problem).clone());
                    }
                    outcome.problems.push(*problem);
                    // Always step over at least one token.
                    if self.cursor == start
                        && let Some((_, rest)) = self.cursor.token_tree()
                    {
                        let span = self.here();
                        self.advance(span, rest);
                    }
                    self.skip_item();
                    poison(start, self.cursor, &mut outcome.poisoned);
                }
            }
        }
    }

    /// What to change when an item goes on where it should end.
    fn after_item(&self, form: Option<String>) -> String {
        match (self.cursor.punct(), self.peek_ident()) {
            (Some((punct, _)), _) if matches!(punct.as_char(), '<' | '>' | '=' | '!') => {
                "conditions stand after `where` or in `require`, equations in `constraint`".into()
            }
            (Some((punct, _)), _) if punct.as_char() == '?' => names::not_smooth("if").unwrap_or_default(),
            // A doc comment begins the next item.
            (Some((punct, _)), _) if punct.as_char() == '#' => "every item ends with `;`".into(),
            (Some((punct, _)), _) if punct.as_char() == '.' => {
                "a number has one point, before its decimals: `9.81`".into()
            }
            (Some(_), _) => "the operators are `+`, `-`, `*`, `/` and `^`".into(),
            (None, Some(word)) if !names::is_item(&word) => form.unwrap_or_default(),
            _ => "every item ends with `;`".into(),
        }
    }

    /// Skips to the end of a broken item: past `;`, or before a word that begins an item and a line.
    fn skip_item(&mut self) {
        while let Some((tree, rest)) = self.cursor.token_tree() {
            let span = span_of(tree.span());
            match &tree {
                TokenTree::Ident(word)
                    if self.begins_line(span.start) && names::is_item(&word.to_string()) =>
                {
                    return;
                }
                // A doc comment begins the next item.
                TokenTree::Punct(p) if p.as_char() == '#' && self.begins_line(span.start) => return,
                _ => {}
            }
            self.advance(span, rest);
            if matches!(&tree, TokenTree::Punct(p) if p.as_char() == ';') {
                return;
            }
        }
    }
}

/// All names between two cursors.
fn poison(from: Cursor<'_>, to: Cursor<'_>, names: &mut BTreeSet<String>) {
    let mut cursor = from;
    let mut stack: Vec<TokenTree> = Vec::new();
    while cursor != to {
        let Some((tree, rest)) = cursor.token_tree() else { break };
        stack.push(tree);
        cursor = rest;
    }
    while let Some(tree) = stack.pop() {
        match tree {
            TokenTree::Ident(ident) => {
                names.insert(ident.to_string());
            }
            TokenTree::Group(group) => stack.extend(group.stream()),
            _ => {}
        }
    }
}
