//! Loops over items and over entries of blocks, and lists and sums that are written once for all their entries.
//!
//! Deliberately does not know: which items there are, what an entry means.

use proc_macro2::{Delimiter, TokenTree};
use syn::buffer::Cursor;

use super::cursor::Parser;
use super::lexer::Parsed;
use super::scope::Loops;
use crate::spec::ast::*;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::names;

/// `k in 1..n`: an index and what it runs through, both ends included.
pub(super) struct Turns {
    name: Name,
    first: i64,
    last: i64,
    span: Span,
}

impl<'a> Parser<'a> {
    /// `k in 1..n`, behind the word `for`.
    pub(super) fn turns(&mut self) -> Parsed<Turns> {
        let name = self.ident("the index of a loop")?;
        if let Some(reason) = names::refusal(&name.text) {
            let message = format!("`{}` cannot be used as a name", name.text);
            return Err(Box::new(Diagnostic::new(Some(name.span), message).with_help(reason)));
        }
        if self.number_of(&name.text).is_some() {
            let message = format!("`{}` stands for a number already", name.text);
            let problem = Diagnostic::new(Some(name.span), message);
            return Err(Box::new(problem.with_help("give the index another name")));
        }
        self.require_word("in")?;
        let (first, start) = self.whole("a range such as `1..n`")?;
        if self.punct("..=").is_some() {
            let span = Span::new(start.end, self.last);
            let problem = Diagnostic::new(Some(span), "expected `..`, found `..=`");
            return Err(Box::new(problem.with_help("both ends of `1..n` belong to it")));
        }
        self.require_punct("..")?;
        let (last, end) = self.whole("the end of the range")?;
        Ok(Turns { name, first, last, span: start.to(end) })
    }

    /// The values of the index.
    fn values(&self, turns: &Turns) -> std::ops::RangeInclusive<i64> {
        match self.shared.loops {
            Loops::WrittenOut => turns.first..=turns.last,
            Loops::Once => turns.first..=turns.first,
        }
    }

    /// This parser in the turn of a loop.
    pub(super) fn in_turn(&self, name: &Name, value: i64) -> Parser<'a> {
        let mut inside = self.clone();
        inside.turns.push((name.text.clone(), value));
        inside
    }

    /// A loop over items, `for k in 1..n { .. }`: each turn of it, given to `items`, until one says that it is enough.
    pub(super) fn for_items(&mut self, mut turn: impl FnMut(&mut Parser<'a>) -> bool) -> Parsed<()> {
        self.require_word("for")?;
        let turns = self.turns()?;
        let (body, span) = self.require_group(Delimiter::Brace, "`{` with the items of the loop")?;
        self.note_index(&turns.name, span);
        for value in self.values(&turns) {
            self.charge(span.end - span.start, turns.span)?;
            if !turn(&mut body.in_turn(&turns.name, value)) {
                break;
            }
        }
        Ok(())
    }

    /// The entries of a block up to its end, `entry;` and loops over such, `for k in 1..n { entry; }`.
    pub(super) fn entries(&mut self, entry: &mut dyn FnMut(&mut Parser<'a>) -> Parsed<()>) -> Parsed<()> {
        while !self.at_end() {
            if self.peek_ident().as_deref() != Some("for") {
                entry(self)?;
                continue;
            }
            let mut outcome = Ok(());
            self.for_items(|inside| {
                outcome = inside.entries(entry);
                outcome.is_ok()
            })?;
            outcome?;
        }
        Ok(())
    }

    /// The entries of `expr for k in 1..n`, where that is what a bracket holds.
    pub(super) fn comprehension(&mut self) -> Parsed<Option<Vec<Expr>>> {
        let Some(behind) = behind_for(self.cursor) else { return Ok(None) };
        let start = self.here();
        let mut clause = self.clone();
        clause.cursor = behind;
        let turns = clause.turns()?;
        clause.finish("the end of the list")?;
        self.note_index(&turns.name, Span::new(start.start, self.end));
        let mut entries = Vec::new();
        for value in self.values(&turns) {
            self.charge(self.end - start.start, turns.span)?;
            let mut inside = self.in_turn(&turns.name, value);
            entries.push(inside.expr()?);
            inside.require_word("for")?;
        }
        (self.cursor, self.last) = (clause.cursor, clause.last);
        Ok(Some(entries))
    }

    fn note_index(&self, name: &Name, scope: Span) {
        let mut indices = self.shared.indices.borrow_mut();
        if !indices.iter().any(|(own, _)| own.span == name.span) {
            indices.push((name.clone(), scope));
        }
    }
}

/// Where the clause of a list that is written once begins, behind its `for`.
fn behind_for(mut cursor: Cursor<'_>) -> Option<Cursor<'_>> {
    let mut is_operand = false;
    while let Some((tree, rest)) = cursor.token_tree() {
        match &tree {
            TokenTree::Ident(word) if is_operand && word == "for" => return Some(rest),
            TokenTree::Punct(_) => is_operand = false,
            _ => is_operand = true,
        }
        cursor = rest;
    }
    None
}
