//! A walk over tokens: what comes next, what was expected, lists and brackets.
//!
//! Deliberately does not know: which items and expressions there are.

use proc_macro2::{Delimiter, Spacing};
use syn::buffer::Cursor;

use super::lexer::{Parsed, hidden, span_of, too_deep};
use super::scope::Shared;
use crate::spec::ast::*;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::limits::MAX_DEPTH;

#[derive(Clone)]
pub(super) struct Parser<'a> {
    pub(super) text: &'a str,
    pub(super) cursor: Cursor<'a>,
    /// Where the enclosing bracket ends.
    pub(super) end: usize,
    /// Where the last consumed token ends.
    pub(super) last: usize,
    pub(super) depth: usize,
    /// What the loops and sizes of the file say.
    pub(super) shared: &'a Shared,
    /// Indices of the loops around with their values, the innermost last.
    pub(super) turns: Vec<(String, i64)>,
}

impl<'a> Parser<'a> {
    pub(super) fn new(text: &'a str, cursor: Cursor<'a>, shared: &'a Shared) -> Parser<'a> {
        Parser { text, cursor, end: text.len(), last: 0, depth: 0, shared, turns: Vec::new() }
    }

    pub(super) fn at_end(&self) -> bool {
        self.cursor.eof()
    }

    /// The next token, or the place after the last one.
    pub(super) fn here(&self) -> Span {
        if self.at_end() {
            Span::new(self.end, (self.end + 1).min(self.text.len()))
        } else {
            span_of(self.cursor.span())
        }
    }

    pub(super) fn found(&self) -> String {
        if self.at_end() {
            return match self.text.as_bytes().get(self.end) {
                Some(closing) => format!("`{}`", *closing as char),
                None => "the end of the file".to_owned(),
            };
        }
        match self.cursor.any_group() {
            Some((_, Delimiter::Parenthesis, ..)) => "`(`".to_owned(),
            Some((_, Delimiter::Bracket, ..)) => "`[`".to_owned(),
            Some((_, Delimiter::Brace, ..)) => "`{`".to_owned(),
            _ => {
                let span = self.here();
                let token: String =
                    self.text.get(span.start..span.end).unwrap_or("").chars().take(40).collect();
                format!("`{token}`")
            }
        }
    }

    /// What was expected here, and what is here instead.
    pub(super) fn unexpected(&self, what: &str) -> Diagnostic {
        let mut span = self.here();
        if let Some((_, _, group, _)) = self.cursor.any_group() {
            span = span_of(group.open());
        }
        Diagnostic::new(Some(span), format!("expected {what}, found {}", self.found()))
    }

    pub(super) fn expected<T>(&self, what: &str) -> Parsed<T> {
        Err(Box::new(self.unexpected(what)))
    }

    pub(super) fn advance(&mut self, span: Span, rest: Cursor<'a>) {
        self.last = span.end;
        self.cursor = rest;
    }

    pub(super) fn peek_ident(&self) -> Option<String> {
        self.cursor.ident().map(|(ident, _)| ident.to_string())
    }

    pub(super) fn ident(&mut self, what: &str) -> Parsed<Name> {
        match self.cursor.ident() {
            Some((ident, rest)) => {
                let span = span_of(ident.span());
                self.advance(span, rest);
                Ok(Name { text: ident.to_string(), span })
            }
            None => self.expected(what),
        }
    }

    /// Consumes the word if it is next.
    pub(super) fn word(&mut self, word: &str) -> Option<Span> {
        let (ident, rest) = self.cursor.ident()?;
        if ident != word {
            return None;
        }
        let span = span_of(ident.span());
        self.advance(span, rest);
        Some(span)
    }

    /// Consumes the operator if it is next.
    pub(super) fn punct(&mut self, operator: &str) -> Option<Span> {
        let mut cursor = self.cursor;
        let mut span: Option<Span> = None;
        let n = operator.len();
        for (k, c) in operator.chars().enumerate() {
            let (punct, rest) = cursor.punct()?;
            if punct.as_char() != c || (k + 1 < n && punct.spacing() != Spacing::Joint) {
                return None;
            }
            let here = span_of(punct.span());
            span = Some(span.map_or(here, |s| s.to(here)));
            cursor = rest;
        }
        let span = span?;
        self.advance(span, cursor);
        Some(span)
    }

    pub(super) fn peek_punct(&self, c: char) -> bool {
        self.cursor.punct().is_some_and(|(punct, _)| punct.as_char() == c)
    }

    pub(super) fn require_punct(&mut self, operator: &str) -> Parsed<Span> {
        match self.punct(operator) {
            Some(span) => Ok(span),
            None => self.expected(&format!("`{operator}`")),
        }
    }

    /// Steps over a bracket and returns a parser for its inside.
    pub(super) fn group(&mut self, delimiter: Delimiter) -> Option<(Parser<'a>, Span)> {
        let (inside, spans, rest) = self.cursor.group(delimiter)?;
        let span = span_of(spans.join());
        self.advance(span, rest);
        let (start, end) = (span.start + 1, span.end.saturating_sub(1));
        let parser = Parser {
            text: self.text,
            cursor: inside,
            end,
            last: start,
            depth: self.depth,
            shared: self.shared,
            turns: self.turns.clone(),
        };
        Some((parser, span))
    }

    pub(super) fn require_group(&mut self, delimiter: Delimiter, what: &str) -> Parsed<(Parser<'a>, Span)> {
        match self.group(delimiter) {
            Some(group) => Ok(group),
            None => self.expected(what),
        }
    }

    pub(super) fn finish(&self, what: &str) -> Parsed<()> {
        if self.at_end() { Ok(()) } else { self.expected(what) }
    }

    /// `a, b, c` up to the end of the bracket; a trailing comma is fine.
    pub(super) fn comma_list<T>(
        &mut self,
        mut element: impl FnMut(&mut Self) -> Parsed<T>,
    ) -> Parsed<Vec<T>> {
        let mut list = Vec::new();
        while !self.at_end() {
            list.push(element(self)?);
            if self.punct(",").is_none() {
                self.finish("`,`")?;
            }
        }
        Ok(list)
    }

    /// `a, b, c` outside a bracket.
    pub(super) fn comma_separated<T>(
        &mut self,
        mut element: impl FnMut(&mut Self) -> Parsed<T>,
    ) -> Parsed<Vec<T>> {
        let mut list = vec![element(self)?];
        while self.punct(",").is_some() {
            list.push(element(self)?);
        }
        Ok(list)
    }

    pub(super) fn require_word(&mut self, word: &str) -> Parsed<Span> {
        match self.word(word) {
            Some(span) => Ok(span),
            None => self.expected(&format!("`{word}`")),
        }
    }

    /// `=`, with a hint for the usual slips.
    pub(super) fn equals(&mut self) -> Parsed<()> {
        let span = self.here();
        for (wrong, help) in [("==", "write `=`"), (":=", "write `=`")] {
            if self.punct(wrong).is_some() {
                let span = Span::new(span.start, self.last);
                let problem = Diagnostic::new(Some(span), format!("expected `=`, found `{wrong}`"));
                return Err(Box::new(problem.with_help(help)));
            }
        }
        self.require_punct("=").map(|_| ())
    }

    pub(super) fn deeper<T>(&mut self, parse: impl FnOnce(&mut Self) -> Parsed<T>) -> Parsed<T> {
        if self.depth >= MAX_DEPTH {
            return Err(too_deep(self.here()));
        }
        self.depth += 1;
        let result = parse(self);
        self.depth -= 1;
        result
    }

    pub(super) fn begins_line(&self, offset: usize) -> bool {
        let before = self.text.get(..offset).unwrap_or("");
        let line = before.rfind('\n').map_or(before, |at| &before[at + 1..]);
        line.trim().is_empty()
    }

    /// A text in quotes if it is next.
    ///
    /// # Errors
    /// Where an escape stands for a character that no text may have.
    pub(super) fn string(&mut self) -> Parsed<Option<String>> {
        let Some((literal, rest)) = self.cursor.literal() else { return Ok(None) };
        let repr = literal.to_string();
        if !repr.starts_with('"') && !repr.starts_with("r\"") && !repr.starts_with("r#") {
            return Ok(None);
        }
        let span = span_of(literal.span());
        let value = match syn::Lit::new(literal) {
            syn::Lit::Str(text) => text.value(),
            _ => return Ok(None),
        };
        if let Some(problem) = hidden(&value, span) {
            return Err(Box::new(problem));
        }
        self.advance(span, rest);
        Ok(Some(value))
    }

    pub(super) fn docs(&mut self) -> Parsed<Vec<String>> {
        let mut lines = Vec::new();
        while self.peek_punct('#') {
            let span = self.here();
            self.punct("#");
            if self.punct("!").is_some() {
                let problem = Diagnostic::new(Some(span), "inner doc comments are not part of the language");
                return Err(Box::new(problem.with_help("write `///` before the model or the item")));
            }
            let attribute = || {
                let problem = Diagnostic::new(Some(span), "attributes are not part of the language");
                Box::new(problem.with_help("documentation is written as `/// text`"))
            };
            let (mut inside, _) = self.group(Delimiter::Bracket).ok_or_else(attribute)?;
            let is_doc = inside.word("doc").is_some() && inside.punct("=").is_some();
            let text = inside.string()?.filter(|_| is_doc).ok_or_else(attribute)?;
            for line in text.lines() {
                lines.push(line.strip_prefix(' ').unwrap_or(line).trim_end().to_owned());
            }
            if text.is_empty() {
                lines.push(String::new());
            }
        }
        Ok(lines)
    }
}
