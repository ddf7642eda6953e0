//! Text to syntax tree. Knows no names and no shapes.
//!
//! The tokens are syn's: `proc_macro2` lexes, a `syn::buffer::Cursor` walks. An item that does not parse is reported
//! and skipped, so one run reports the problems of all items. Nothing here recurses deeper than [`MAX_DEPTH`].

use std::collections::BTreeSet;

use num_bigint::BigInt;
use num_traits::{One, Zero};
use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};
use syn::buffer::{Cursor, TokenBuffer};

use super::ast::*;
use super::diagnostic::{Diagnostic, Span};
use super::model::ConnectionKind;
use super::names;
use crate::expr::Rational;

/// Largest model file in bytes.
pub(super) const MAX_BYTES: usize = 1 << 20;
/// Deepest nesting of an expression.
pub(super) const MAX_DEPTH: usize = 64;
/// Deepest nesting of brackets of any kind, checked before anything recursive sees the tokens.
const MAX_BRACKETS: usize = MAX_DEPTH + 8;
/// Largest dimension of a vector, matrix or algebra.
pub(super) const MAX_DIM: usize = 200;
/// Most digits of a number and largest absolute decimal exponent.
const MAX_DIGITS: usize = 400;
/// Bad characters reported before the lexer gives up.
const MAX_BAD_CHARACTERS: usize = 20;

type Parsed<T> = Result<T, Box<Diagnostic>>;

/// What the parser understood, and which names it could not.
pub(super) struct Outcome {
    pub(super) file: Option<File>,
    pub(super) problems: Vec<Diagnostic>,
    /// Names that occur in items that did not parse: nothing is said about them later.
    pub(super) poisoned: BTreeSet<String>,
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

/// The text without what other languages would take for comments, `# to the end of the line`: the first one is reported.
///
/// Texts and comments are skipped as the lexer does; `#[` and `#!` are left to the parser.
fn without_hash_comments(text: &str, problems: &mut Vec<Diagnostic>) -> String {
    let bytes = text.as_bytes();
    let mut result = text.to_owned();
    let mut is_first = true;
    let line_end = |at: usize| text[at..].find('\n').map_or(text.len(), |length| at + length);
    let mut at = 0;
    while let Some(byte) = bytes.get(at) {
        let next = bytes.get(at + 1);
        at = match byte {
            b'/' if next == Some(&b'/') => line_end(at),
            b'/' if next == Some(&b'*') => {
                let (mut depth, mut end) = (1_usize, at + 2);
                while depth > 0 && end < bytes.len() {
                    let step = match (bytes[end], bytes.get(end + 1)) {
                        (b'/', Some(b'*')) => (depth + 1, 2),
                        (b'*', Some(b'/')) => (depth - 1, 2),
                        _ => (depth, 1),
                    };
                    (depth, end) = (step.0, end + step.1);
                }
                end
            }
            b'"' => {
                let mut end = at + 1;
                while end < bytes.len() && bytes[end] != b'"' {
                    end += if bytes[end] == b'\\' { 2 } else { 1 };
                }
                end + 1
            }
            // What is written right after a word is a raw text: `r#".."#`.
            b'#' if !matches!(next, Some(b'[' | b'!' | b'"'))
                && !at
                    .checked_sub(1)
                    .is_some_and(|k| bytes[k].is_ascii_alphanumeric() || bytes[k] == b'"') =>
            {
                if std::mem::take(&mut is_first) {
                    let span = Some(Span::new(at, at + 1));
                    let problem = Diagnostic::new(span, "`#` does not begin a comment");
                    problems
                        .push(problem.with_help("comments are written `// text`, documentation `/// text`"));
                }
                let end = line_end(at);
                result.replace_range(at..end, &" ".repeat(end - at));
                end
            }
            _ => at + 1,
        };
    }
    result
}

/// Lexes; a character that begins no token is reported, blanked out, and the lexer starts again.
fn lex(text: &str, problems: &mut Vec<Diagnostic>) -> Option<TokenStream> {
    let mut patched = text.to_owned();
    for _ in 0..MAX_BAD_CHARACTERS {
        let error = match patched.parse::<TokenStream>() {
            Ok(tokens) => return Some(tokens),
            Err(error) => error,
        };
        let mut at = error.span().byte_range().start.min(patched.len());
        while !patched.is_char_boundary(at) {
            at -= 1;
        }
        // Rust reads `b'`, `c'` and the like as prefixes; the quote is what does not belong there.
        let prefix = patched[at..].bytes().take_while(u8::is_ascii_alphanumeric).count();
        if patched[at + prefix..].starts_with('\'') {
            at += prefix;
        }
        let found = patched[at..].chars().next();
        let span = Span::new(at, at + found.map_or(0, char::len_utf8));
        let problem = |message: String, help: &str| Diagnostic::new(Some(span), message).with_help(help);
        match found {
            Some(c @ ('(' | '[' | '{')) => {
                problems.push(problem(format!("`{c}` is never closed"), "add the closing bracket"));
                return None;
            }
            Some(c @ (')' | ']' | '}')) => {
                problems.push(problem(
                    format!("`{c}` does not close the bracket that is open here"),
                    "every bracket is closed by its own kind",
                ));
                return None;
            }
            Some('"') => {
                problems.push(open_text(at));
                return None;
            }
            Some('/') if patched[at..].starts_with("/*") => {
                problems.push(problem("comment is not closed".into(), "end it with `*/`"));
                return None;
            }
            Some(c) => {
                let help = match c {
                    '\'' => "primes are not part of names: write `Omega_bar` or another name",
                    '·' | '×' | '⋅' => "write `*`, `dot(a, b)` or `cross(a, b)`",
                    '−' => "write `-`",
                    '\\' => "names are plain words such as `Omega`",
                    '“' | '”' | '„' | '‟' => "write plain quotes: `\"`",
                    _ if c.is_ascii_digit() => "numbers look like `3`, `0.25` or `1e-3`",
                    _ => "names are ASCII letters, digits and underscores",
                };
                let shown = if c.is_control() { format!("\\u{{{:x}}}", c as u32) } else { c.to_string() };
                problems.push(problem(format!("`{shown}` is not part of the language"), help));
                // Obvious replacements avoid a second complaint about the same place.
                let stand_in = match c {
                    '·' | '×' | '⋅' => '*',
                    '−' => '-',
                    '“' | '”' | '„' | '‟' => '"',
                    // Keeps `Omega'` apart from `Omega`.
                    '\'' => '_',
                    _ => ' ',
                };
                patched.replace_range(
                    at..at + c.len_utf8(),
                    &format!("{stand_in}{}", " ".repeat(c.len_utf8() - 1)),
                );
            }
            None => {
                problems.push(problem("the text ends inside a token".into(), ""));
                return None;
            }
        }
    }
    None
}

fn open_text(start: usize) -> Diagnostic {
    let span = Span::new(start, start + 1);
    Diagnostic::new(Some(span), "text is not closed").with_help("end it with `\"`; inner quotes are `\\\"`")
}

/// Finds the bracket that is not closed or not opened; the lexer would only name the place where it noticed.
///
/// Texts and comments are skipped as the lexer does; what it would reject (a stray quote) ends the search.
fn check_brackets(text: &str) -> Parsed<()> {
    let bytes = text.as_bytes();
    let mut stack: Vec<(u8, usize)> = Vec::new();
    // The first pair of braces that are not indented alike: where one of them is missing, most likely.
    let mut crooked: Option<(usize, usize)> = None;
    let mut at = 0;
    while let Some(byte) = bytes.get(at) {
        match byte {
            b'/' if bytes.get(at + 1) == Some(&b'/') => {
                at += text[at..].find('\n').unwrap_or(text.len() - at);
                continue;
            }
            b'/' if bytes.get(at + 1) == Some(&b'*') => {
                let mut depth = 0_usize;
                loop {
                    match (bytes.get(at), bytes.get(at + 1)) {
                        (Some(b'/'), Some(b'*')) => (depth, at) = (depth + 1, at + 2),
                        (Some(b'*'), Some(b'/')) => (depth, at) = (depth - 1, at + 2),
                        (Some(_), _) => at += 1,
                        (None, _) => return Ok(()),
                    }
                    if depth == 0 {
                        break;
                    }
                }
                continue;
            }
            b'"' => {
                let start = at;
                at += 1;
                loop {
                    match bytes.get(at) {
                        Some(b'\\') => at += 2,
                        Some(b'"') => break,
                        Some(_) => at += 1,
                        None => return Err(Box::new(open_text(start))),
                    }
                }
            }
            b'\'' | b'#' => return Ok(()),
            b'(' | b'[' | b'{' => stack.push((*byte, at)),
            b')' | b']' | b'}' => {
                let here = Span::new(at, at + 1);
                let closing = char::from(*byte);
                let problem = match stack.pop() {
                    Some((b'(', _)) if *byte == b')' => None,
                    Some((b'[', _)) if *byte == b']' => None,
                    Some((b'{', start)) if *byte == b'}' => {
                        let (open, close) = (indent(text, start), indent(text, at));
                        // Only a brace that begins its line is indented on purpose.
                        let begins_line = text[..at].trim_end_matches([' ', '\t']).ends_with('\n');
                        if crooked.is_none() && begins_line && open != close {
                            crooked = Some((start, at));
                        }
                        None
                    }
                    Some((open, start)) => {
                        let place = Span::new(start, start + 1);
                        let message = format!("`{}` is not closed", char::from(open));
                        let problem = Diagnostic::new(Some(place), message);
                        let label = format!("`{closing}` comes first");
                        Some(problem.with_place(Some(here), label).with_help("add the closing bracket"))
                    }
                    None => Some(
                        Diagnostic::new(Some(here), format!("`{closing}` closes nothing"))
                            .with_help("remove it"),
                    ),
                };
                if let Some(problem) = problem {
                    return Err(Box::new(problem));
                }
            }
            _ => {}
        }
        at += 1;
    }
    match stack.pop() {
        Some((open, start)) => {
            let message = format!("`{}` is not closed", char::from(open));
            let (start, other) = crooked.map_or((start, None), |(start, end)| (start, Some(end)));
            let place = other.map(|end| Span::new(end, end + 1));
            let problem = Diagnostic::new(Some(Span::new(start, start + 1)), message)
                .with_place(place, "by its indentation, this closes another one");
            Err(Box::new(problem.with_help("add the closing bracket")))
        }
        None => Ok(()),
    }
}

/// The blanks before the line that contains an offset.
fn indent(text: &str, offset: usize) -> &str {
    let line = text[..offset].rfind('\n').map_or(0, |newline| newline + 1);
    let rest = &text[line..];
    &rest[..rest.len() - rest.trim_start_matches([' ', '\t']).len()]
}

/// The lexer does not recurse but everything after it would.
fn check_nesting(tokens: &TokenStream) -> Parsed<()> {
    let mut stack = vec![tokens.clone().into_iter()];
    while let Some(top) = stack.last_mut() {
        match top.next() {
            Some(TokenTree::Group(group)) => {
                if stack.len() > MAX_BRACKETS {
                    return Err(too_deep(span_of(group.span_open())));
                }
                stack.push(group.stream().into_iter());
            }
            Some(_) => {}
            None => {
                stack.pop();
            }
        }
    }
    Ok(())
}

fn too_deep(span: Span) -> Box<Diagnostic> {
    let message = format!("expression is nested more than {MAX_DEPTH} levels deep");
    Box::new(Diagnostic::new(Some(span), message).with_help("name a part of it with `let`"))
}

fn span_of(span: proc_macro2::Span) -> Span {
    let range = span.byte_range();
    Span::new(range.start, range.end)
}

struct Parser<'a> {
    text: &'a str,
    cursor: Cursor<'a>,
    /// Where the enclosing bracket ends.
    end: usize,
    /// Where the last consumed token ends.
    last: usize,
    depth: usize,
}

impl<'a> Parser<'a> {
    // Tokens.

    fn at_end(&self) -> bool {
        self.cursor.eof()
    }

    /// The next token, or the place after the last one.
    fn here(&self) -> Span {
        if self.at_end() {
            Span::new(self.end, (self.end + 1).min(self.text.len()))
        } else {
            span_of(self.cursor.span())
        }
    }

    fn found(&self) -> String {
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

    fn expected<T>(&self, what: &str) -> Parsed<T> {
        let mut span = self.here();
        if let Some((_, _, group, _)) = self.cursor.any_group() {
            span = span_of(group.open());
        }
        Err(Box::new(Diagnostic::new(Some(span), format!("expected {what}, found {}", self.found()))))
    }

    fn advance(&mut self, span: Span, rest: Cursor<'a>) {
        self.last = span.end;
        self.cursor = rest;
    }

    fn peek_ident(&self) -> Option<String> {
        self.cursor.ident().map(|(ident, _)| ident.to_string())
    }

    fn ident(&mut self, what: &str) -> Parsed<Name> {
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
    fn word(&mut self, word: &str) -> Option<Span> {
        let (ident, rest) = self.cursor.ident()?;
        if ident != word {
            return None;
        }
        let span = span_of(ident.span());
        self.advance(span, rest);
        Some(span)
    }

    /// Consumes the operator if it is next.
    fn punct(&mut self, operator: &str) -> Option<Span> {
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

    fn peek_punct(&self, c: char) -> bool {
        self.cursor.punct().is_some_and(|(punct, _)| punct.as_char() == c)
    }

    fn require_punct(&mut self, operator: &str) -> Parsed<Span> {
        match self.punct(operator) {
            Some(span) => Ok(span),
            None => self.expected(&format!("`{operator}`")),
        }
    }

    /// Steps over a bracket and returns a parser for its inside.
    fn group(&mut self, delimiter: Delimiter) -> Option<(Parser<'a>, Span)> {
        let (inside, spans, rest) = self.cursor.group(delimiter)?;
        let span = span_of(spans.join());
        self.advance(span, rest);
        let (start, end) = (span.start + 1, span.end.saturating_sub(1));
        Some((Parser { text: self.text, cursor: inside, end, last: start, depth: self.depth }, span))
    }

    fn require_group(&mut self, delimiter: Delimiter, what: &str) -> Parsed<(Parser<'a>, Span)> {
        match self.group(delimiter) {
            Some(group) => Ok(group),
            None => self.expected(what),
        }
    }

    fn finish(&self, what: &str) -> Parsed<()> {
        if self.at_end() { Ok(()) } else { self.expected(what) }
    }

    /// `a, b, c` up to the end of the bracket; a trailing comma is fine.
    fn comma_list<T>(&mut self, mut element: impl FnMut(&mut Self) -> Parsed<T>) -> Parsed<Vec<T>> {
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
    fn comma_separated<T>(&mut self, mut element: impl FnMut(&mut Self) -> Parsed<T>) -> Parsed<Vec<T>> {
        let mut list = vec![element(self)?];
        while self.punct(",").is_some() {
            list.push(element(self)?);
        }
        Ok(list)
    }

    // The file.

    fn file(&mut self, outcome: &mut Outcome) {
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
        let items = body.items(outcome);
        if !self.at_end() {
            let found = self.found();
            let problem = Diagnostic::new(Some(self.here()), format!("{found} after the end of the model"));
            outcome.problems.push(problem.with_help("a file holds one model: `model name { .. }`"));
        }
        outcome.file = Some(File { doc, name, items });
    }

    fn items(&mut self, outcome: &mut Outcome) -> Vec<Item> {
        let mut items = Vec::new();
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
                return items;
            }
            if self.punct(";").is_some() {
                continue;
            }
            let keyword = self.here();
            let form = self.peek_ident().and_then(|word| names::item_form(&word));
            let parsed = doc.and_then(|doc| Ok((doc, self.item()?)));
            match parsed {
                Ok((doc, (kind, block))) => {
                    let span = Span::new(keyword.start, self.last);
                    items.push(Item { doc, span, kind });
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
                    if problem.message.starts_with("expected") {
                        problem.help = problem.help.or(form);
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

    fn begins_line(&self, offset: usize) -> bool {
        let before = self.text.get(..offset).unwrap_or("");
        let line = before.rfind('\n').map_or(before, |at| &before[at + 1..]);
        line.trim().is_empty()
    }

    fn docs(&mut self) -> Parsed<Vec<String>> {
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
            let text = inside.string().filter(|_| is_doc).ok_or_else(attribute)?;
            for line in text.lines() {
                lines.push(line.strip_prefix(' ').unwrap_or(line).trim_end().to_owned());
            }
            if text.is_empty() {
                lines.push(String::new());
            }
        }
        Ok(lines)
    }

    fn string(&mut self) -> Option<String> {
        let (literal, rest) = self.cursor.literal()?;
        let repr = literal.to_string();
        if !repr.starts_with('"') && !repr.starts_with("r\"") && !repr.starts_with("r#") {
            return None;
        }
        let span = span_of(literal.span());
        let value = match syn::Lit::new(literal) {
            syn::Lit::Str(text) => text.value(),
            _ => return None,
        };
        self.advance(span, rest);
        Some(value)
    }

    /// One item without its final `;`; true when it ends with a block and has none.
    fn item(&mut self) -> Parsed<(ItemKind, bool)> {
        let keyword = self.ident("an item such as `param`, `velocity` or `lagrangian`")?;
        let kind = match keyword.text.as_str() {
            "source" => match self.string() {
                Some(text) => ItemKind::Source(text),
                None => return self.expected("a text in quotes"),
            },
            "param" => self.param()?,
            "require" => ItemKind::Require(self.comparisons()?),
            "let" => {
                let name = self.ident("a name")?;
                self.equals()?;
                ItemKind::Let { name, value: self.expr()? }
            }
            "algebra" => return self.algebra(),
            "representation" => return self.representation().map(|kind| (kind, true)),
            "velocity" => {
                let names = self.comma_separated(|p| p.ident("the name of a velocity"))?;
                self.require_word("in")?;
                ItemKind::Velocity { names, algebra: self.algebra_expr()? }
            }
            "quasi_velocity" => {
                ItemKind::QuasiVelocity(self.comma_separated(|p| p.ident("the name of a quasi-velocity"))?)
            }
            "connection" => {
                let name = self.ident("the velocity whose connection is given")?;
                if ConnectionKind::from_name(&name.text).is_some() {
                    ItemKind::DerivedConnection(name)
                } else {
                    self.equals()?;
                    ItemKind::Connection { name, value: self.expr()? }
                }
            }
            "action" => ItemKind::Action(self.ident("`left` or `right`")?),
            "stage" => self.stage()?,
            "inner_product" => {
                self.equals()?;
                ItemKind::InnerProduct(self.expr()?)
            }
            "coordinate" => self.coordinate()?,
            "advected" => self.advected()?,
            "lagrangian" => {
                self.equals()?;
                ItemKind::Lagrangian(self.expr()?)
            }
            "constraint" => {
                let (name, left, right) = self.equation("a constraint", "dot(Omega, Gamma) = 0")?;
                ItemKind::Constraint { name, left, right }
            }
            "virtual" => {
                let (name, left, right) =
                    self.equation("a condition on displacements", "delta(v1) + delta(v2) = 0")?;
                ItemKind::Virtual { name, left, right }
            }
            "independent" => {
                ItemKind::Independent(self.comma_separated(|p| p.ident("the name of a velocity"))?)
            }
            "multipliers" => ItemKind::Multipliers,
            "force" => {
                let name = self.ident("the velocity the force is paired with")?;
                self.equals()?;
                ItemKind::Force { name, value: self.expr()? }
            }
            "casimir" | "output" => {
                let name = self.ident("a name")?;
                self.equals()?;
                let value = self.expr()?;
                if keyword.text == "casimir" {
                    ItemKind::Casimir { name, value }
                } else {
                    ItemKind::Output { name, value }
                }
            }
            "reconstruct" => self.reconstruct()?,
            "initial" => {
                let name = self.ident("the name of a state variable")?;
                self.equals()?;
                ItemKind::Initial { name, value: self.expr()? }
            }
            "view" => self.view()?,
            "scene" => return self.scene().map(|kind| (kind, true)),
            "model" => {
                let problem = Diagnostic::new(Some(keyword.span), "`model` inside a model");
                return Err(Box::new(problem.with_help("put each model in a file of its own")));
            }
            other => {
                let problem = Diagnostic::new(Some(keyword.span), format!("`{other}` begins no item"));
                return Err(Box::new(problem.with_help(names::item_meant_by(other))));
            }
        };
        Ok((kind, false))
    }

    fn require_word(&mut self, word: &str) -> Parsed<Span> {
        match self.word(word) {
            Some(span) => Ok(span),
            None => self.expected(&format!("`{word}`")),
        }
    }

    /// `=`, with a hint for the usual slips.
    fn equals(&mut self) -> Parsed<()> {
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

    fn size(&mut self) -> Parsed<Size> {
        let span = self.here();
        let Some((literal, rest)) = self.cursor.literal() else { return self.expected("a whole number") };
        let text = literal.to_string();
        let value = text.parse::<usize>().ok().filter(|_| text.bytes().all(|b| b.is_ascii_digit()));
        if value.is_none() && !text.bytes().all(|b| b.is_ascii_digit()) {
            return self.expected("a whole number");
        }
        self.advance(span, rest);
        match value {
            Some(value @ 1..=MAX_DIM) => Ok(Size { value, span }),
            _ => {
                let problem =
                    Diagnostic::new(Some(span), format!("dimension `{text}` is not between 1 and {MAX_DIM}"));
                Err(Box::new(problem))
            }
        }
    }

    /// `: vector(3)` and its like, or nothing.
    fn shape(&mut self) -> Parsed<Shape> {
        if self.punct(":").is_none() {
            return Ok(Shape::Scalar);
        }
        let kind = self.ident("`vector(n)`, `diagonal(n)`, `symmetric(n)` or `matrix(n, m)`")?;
        if kind.text == "scalar" {
            return Ok(Shape::Scalar);
        }
        let known = ["scalar", "vector", "diagonal", "symmetric", "matrix"];
        if !known.contains(&kind.text.as_str()) {
            let problem = Diagnostic::new(Some(kind.span), format!("unknown shape `{}`", kind.text));
            return Err(Box::new(problem.with_help(names::suggest(&kind.text, known))));
        }
        let (mut inside, span) = self.require_group(Delimiter::Parenthesis, "`(` with the dimension")?;
        let sizes = inside.comma_list(|p| p.size())?;
        match (kind.text.as_str(), sizes.as_slice()) {
            ("vector", [n]) => Ok(Shape::Vector(*n)),
            ("diagonal", [n]) => Ok(Shape::Diagonal(*n)),
            ("symmetric", [n]) => Ok(Shape::Symmetric(*n)),
            ("matrix", [n, m]) => Ok(Shape::Matrix(*n, *m)),
            (name, _) => {
                let (count, example) =
                    if name == "matrix" { ("two dimensions", "(3, 3)") } else { ("one dimension", "(3)") };
                let problem =
                    Diagnostic::new(Some(span), format!("`{name}` has {count}, found {}", sizes.len()));
                Err(Box::new(problem.with_help(format!("write `{name}{example}`"))))
            }
        }
    }

    fn param(&mut self) -> Parsed<ItemKind> {
        let name = self.ident("the name of a parameter")?;
        let shape = self.shape()?;
        let default = if self.peek_punct('=') {
            self.equals()?;
            Some(self.expr()?)
        } else {
            None
        };
        let conditions = if self.word("where").is_some() { self.comparisons()? } else { Vec::new() };
        Ok(ItemKind::Param { name, shape, default, conditions })
    }

    fn comparisons(&mut self) -> Parsed<Vec<Comparison>> {
        self.comma_separated(|p| {
            let first = p.expr()?;
            let mut rest = Vec::new();
            loop {
                let start = p.here();
                let compare = if p.punct(">=").is_some() {
                    Compare::GreaterEqual
                } else if p.punct("<=").is_some() {
                    Compare::LessEqual
                } else if p.punct("!=").is_some() {
                    Compare::NotEqual
                } else if p.punct(">").is_some() {
                    Compare::Greater
                } else if p.punct("<").is_some() {
                    Compare::Less
                } else if rest.is_empty() {
                    if p.punct("==").is_some() || p.punct("=").is_some() {
                        let problem =
                            Diagnostic::new(Some(start), "an equation is not a condition on parameters");
                        return Err(Box::new(
                            problem.with_help("conditions use `>`, `>=`, `<`, `<=` or `!=`"),
                        ));
                    }
                    return p.expected("`>`, `>=`, `<`, `<=` or `!=`");
                } else {
                    return Ok(Comparison { first, rest });
                };
                rest.push((compare, p.expr()?));
            }
        })
    }

    fn algebra(&mut self) -> Parsed<(ItemKind, bool)> {
        let name = self.ident("the name of the algebra")?;
        if self.peek_punct('=') {
            self.equals()?;
            return Ok((ItemKind::AlgebraName { name, value: self.algebra_expr()? }, false));
        }
        let (mut body, _) = self.require_group(Delimiter::Brace, "`=` or `{`")?;
        if body.word("basis").is_none() {
            return body.expected("`basis e1, e2, ..;`");
        }
        let basis = body.comma_separated(|p| p.ident("the name of a basis element"))?;
        body.require_punct(";")?;
        let mut rules = Vec::new();
        while !body.at_end() {
            let (mut pair, bracket) =
                body.require_group(Delimiter::Bracket, "a bracket such as `[a, b] = c;`")?;
            let left = pair.ident("the name of a basis element")?;
            pair.require_punct(",")?;
            let right = pair.ident("the name of a basis element")?;
            pair.finish("`]`")?;
            body.equals()?;
            let value = body.expr()?;
            body.require_punct(";")?;
            let span = bracket.to(value.span);
            rules.push(BracketRule { left, right, value, span });
        }
        Ok((ItemKind::AlgebraBrackets { name, basis, rules }, true))
    }

    fn representation(&mut self) -> Parsed<ItemKind> {
        let name = self.ident("the name of the representation")?;
        self.require_word("of")?;
        let algebra = self.algebra_expr()?;
        self.require_word("on")?;
        let dim = match self.space()? {
            Some(dim) => dim,
            None => Size { value: 1, span: Span::new(self.last, self.last) },
        };
        let (mut body, _) = self.require_group(Delimiter::Brace, "`{`")?;
        let mut matrices = Vec::new();
        while !body.at_end() {
            let element = body.ident("the name of a basis element")?;
            body.equals()?;
            matrices.push((element, body.expr()?));
            body.require_punct(";")?;
        }
        Ok(ItemKind::Representation { name, algebra, dim, matrices })
    }

    /// `R^n`, or `R` for a single number.
    fn space(&mut self) -> Parsed<Option<Size>> {
        if self.word("R").is_none() {
            return self.expected("`R^n`");
        }
        if self.punct("^").is_none() {
            return Ok(None);
        }
        self.size().map(Some)
    }

    fn algebra_expr(&mut self) -> Parsed<AlgebraExpr> {
        if self.depth >= MAX_DEPTH {
            return Err(too_deep(self.here()));
        }
        self.depth += 1;
        let result = self.algebra_expr_inner();
        self.depth -= 1;
        result
    }

    fn algebra_expr_inner(&mut self) -> Parsed<AlgebraExpr> {
        let start = self.here();
        if self.cursor.literal().is_some() {
            let size = self.size()?;
            return Ok(AlgebraExpr { node: AlgebraNode::Number(size.value), span: size.span });
        }
        let name = self.ident("an algebra such as `so(3)`")?;
        let node = if name.text == "R" && self.punct("^").is_some() {
            AlgebraNode::Power(self.size()?.value)
        } else if let Some((mut inside, _)) = self.group(Delimiter::Parenthesis) {
            AlgebraNode::Call(name, inside.comma_list(|p| p.algebra_expr())?)
        } else {
            AlgebraNode::Name(name.text)
        };
        Ok(AlgebraExpr { node, span: Span::new(start.start, self.last) })
    }

    fn stage(&mut self) -> Parsed<ItemKind> {
        let name = self.ident("the name of the stage")?;
        if !self.peek_punct('=') {
            return Ok(ItemKind::Stage { name, ideal: None });
        }
        self.equals()?;
        self.require_word("ideal")?;
        let (mut inside, _) =
            self.require_group(Delimiter::Parenthesis, "`(` with the velocities of the ideal")?;
        let ideal = inside.comma_list(|p| p.expr())?;
        if ideal.is_empty() {
            return inside.expected("the velocities that span the ideal");
        }
        Ok(ItemKind::Stage { name, ideal: Some(ideal) })
    }

    fn coordinate(&mut self) -> Parsed<ItemKind> {
        let names = self.comma_separated(|p| p.ident("the name of a coordinate"))?;
        let shape = self.shape()?;
        self.require_word("in")?;
        if let Some((mut inside, _)) = self.group(Delimiter::Parenthesis) {
            let low = inside.expr()?;
            inside.require_punct(",")?;
            let high = inside.expr()?;
            inside.finish("`)`")?;
            return Ok(ItemKind::Coordinate { names, shape, domain: DomainExpr::Interval(low, high) });
        }
        let domain = match self.peek_ident().as_deref() {
            Some("angle") => DomainExpr::Angle,
            Some("real") => DomainExpr::Real,
            _ => return self.expected("a domain: `(low, high)`, `angle` or `real`"),
        };
        self.ident("")?;
        Ok(ItemKind::Coordinate { names, shape, domain })
    }

    fn advected(&mut self) -> Parsed<ItemKind> {
        let name = self.ident("the name of the advected parameter")?;
        self.require_word("in")?;
        let dim = self.space()?;
        if self.word("by").is_none() {
            let problem = self.expected::<()>("`by` and the infinitesimal action").err();
            return Err(problem.map_or_else(
                || Box::new(Diagnostic::new(None, "expected `by`")),
                |p| Box::new(p.with_help("for example `by cross(Omega, Gamma)`")),
            ));
        }
        Ok(ItemKind::Advected { name, dim, action: self.expr()? })
    }

    /// `[name:] left = right`.
    fn equation(&mut self, what: &str, example: &str) -> Parsed<(Option<Name>, Expr, Expr)> {
        let named = self
            .cursor
            .ident()
            .is_some_and(|(_, rest)| rest.punct().is_some_and(|(p, _)| p.as_char() == ':'));
        let name = if named {
            let name = self.ident("a name")?;
            self.require_punct(":")?;
            Some(name)
        } else {
            None
        };
        let left = self.expr()?;
        if !self.peek_punct('=') {
            let mut problem = *self.expected::<()>("`=`").err().unwrap_or_else(|| too_deep(left.span));
            problem.help = Some(format!("{what} is an equation such as `{example}`"));
            return Err(Box::new(problem));
        }
        self.equals()?;
        Ok((name, left, self.expr()?))
    }

    fn reconstruct(&mut self) -> Parsed<ItemKind> {
        let names = self.comma_separated(|p| p.ident("the name of a reconstructed coordinate"))?;
        if self.word("by").is_some() {
            return Ok(ItemKind::Reconstruct { names, way: ReconstructWay::Rate(self.expr()?) });
        }
        if self.word("in").is_none() {
            return self.expected("`in` and a group, or `by` and the rate");
        }
        let group = self.algebra_expr()?;
        let from = match self.word("from") {
            Some(_) => self.comma_separated(|p| p.ident("the name of a velocity"))?,
            None => Vec::new(),
        };
        Ok(ItemKind::Reconstruct { names, way: ReconstructWay::Group { group, from } })
    }

    fn view(&mut self) -> Parsed<ItemKind> {
        let name = self.ident("the name of the view")?;
        self.equals()?;
        let shape = self.ident("a shape such as `ball`")?;
        let (mut inside, _) = self.require_group(Delimiter::Parenthesis, "`(` with the sizes or places")?;
        let arguments = inside.comma_list(|p| p.expr())?;
        let mut placement: [(&str, Option<Expr>); 3] = [("around", None), ("at", None), ("attitude", None)];
        loop {
            let span = self.here();
            let Some((word, place)) = placement.iter_mut().find(|(word, _)| self.word(word).is_some()) else {
                break;
            };
            if place.is_some() {
                return Err(Box::new(Diagnostic::new(Some(span), format!("`{word}` is written twice"))));
            }
            *place = Some(self.expr()?);
        }
        if !self.at_end() && !self.peek_punct(';') {
            return self.expected("`around`, `at`, `attitude` or `;`");
        }
        let [around, at, attitude] = placement.map(|(_, expr)| expr);
        Ok(ItemKind::View { name, shape, arguments, around, at, attitude })
    }

    fn scene(&mut self) -> Parsed<ItemKind> {
        let name = self.ident("the name of the scene")?;
        let (mut body, _) = self.require_group(Delimiter::Brace, "`{`")?;
        let (mut fixed, mut wants) = (Vec::new(), Vec::new());
        let (mut drops, mut circles) = (Vec::new(), Vec::new());
        while !body.at_end() {
            if body.word("fix").is_some() {
                fixed.extend(body.comma_separated(|p| {
                    let name = p.ident("the name of a parameter")?;
                    p.equals()?;
                    Ok((name, p.expr()?))
                })?);
            } else if body.word("want").is_some() {
                wants.extend(body.comma_separated(|p| p.ident("the name of an output"))?);
            } else if body.word("drop").is_some() {
                drops.extend(body.comma_separated(|p| p.ident("the name of a coordinate"))?);
            } else if body.word("circle").is_some() {
                circles.extend(body.comma_separated(|p| p.ident("the name of an angle"))?);
            } else {
                return body.expected("`fix`, `want`, `drop` or `circle`");
            }
            body.require_punct(";")?;
        }
        Ok(ItemKind::Scene { name, fixed, wants, drops, circles })
    }

    // Expressions, by precedence: sum, product, sign, power, index, atom.

    fn expr(&mut self) -> Parsed<Expr> {
        self.deeper(|p| {
            let first = p.product()?;
            let mut list = vec![(false, first)];
            loop {
                let negative = if p.punct("+").is_some() {
                    false
                } else if p.punct("-").is_some() {
                    true
                } else {
                    break;
                };
                list.push((negative, p.product()?));
            }
            Ok(fold_chain(list, Node::Sum))
        })
    }

    fn deeper<T>(&mut self, parse: impl FnOnce(&mut Self) -> Parsed<T>) -> Parsed<T> {
        if self.depth >= MAX_DEPTH {
            return Err(too_deep(self.here()));
        }
        self.depth += 1;
        let result = parse(self);
        self.depth -= 1;
        result
    }

    fn product(&mut self) -> Parsed<Expr> {
        let mut list = vec![(false, self.signed()?)];
        loop {
            let divide = if let Some(star) = self.punct("*") {
                if let Some(second) = self.punct("*") {
                    let problem = Diagnostic::new(Some(star.to(second)), "`**` is not an operator");
                    return Err(Box::new(problem.with_help("powers are written `x^2`")));
                }
                false
            } else if self.punct("/").is_some() {
                true
            } else {
                break;
            };
            list.push((divide, self.signed()?));
        }
        Ok(fold_chain(list, Node::Product))
    }

    fn signed(&mut self) -> Parsed<Expr> {
        let start = self.here();
        if self.punct("-").is_some() {
            let inside = self.deeper(Self::signed)?;
            let span = Span::new(start.start, inside.span.end);
            return Ok(Expr { node: Node::Neg(Box::new(inside)), span });
        }
        if self.punct("+").is_some() {
            return self.deeper(Self::signed);
        }
        self.power()
    }

    fn power(&mut self) -> Parsed<Expr> {
        let base = self.indexed()?;
        if self.punct("^").is_none() {
            return Ok(base);
        }
        // Right associative, and the exponent may carry a sign: `x^-2`, `2^3^2 = 2^9`.
        let exponent = self.deeper(Self::signed)?;
        let span = base.span.to(exponent.span);
        Ok(Expr { node: Node::Power(Box::new(base), Box::new(exponent)), span })
    }

    fn indexed(&mut self) -> Parsed<Expr> {
        let base = self.atom()?;
        let Some((mut inside, span)) = self.group(Delimiter::Bracket) else { return Ok(base) };
        let indices = inside.comma_list(|p| p.expr())?;
        if let Some((_, second)) = self.group(Delimiter::Bracket) {
            let problem = Diagnostic::new(Some(second), "a second index needs no bracket of its own");
            return Err(Box::new(problem.with_help("write `C[1, 2]`")));
        }
        let span = base.span.to(span);
        Ok(Expr { node: Node::Index(Box::new(base), indices), span })
    }

    fn atom(&mut self) -> Parsed<Expr> {
        let start = self.here();
        if let Some((literal, rest)) = self.cursor.literal() {
            let value = number(&literal.to_string(), start)?;
            self.advance(start, rest);
            return Ok(Expr { node: Node::Number(value), span: start });
        }
        if let Some((mut inside, span)) = self.group(Delimiter::Parenthesis) {
            if inside.at_end() {
                return inside.expected("an expression");
            }
            let mut expr = inside.expr()?;
            if inside.peek_punct(',') {
                let problem = Diagnostic::new(Some(inside.here()), "expected `)`, found `,`");
                return Err(Box::new(problem.with_help("vectors are written `[a, b, c]`")));
            }
            inside.finish("`)` or an operator")?;
            expr.span = span;
            return Ok(expr);
        }
        if let Some((mut inside, span)) = self.group(Delimiter::Bracket) {
            let list = inside.comma_list(|p| p.expr())?;
            if list.is_empty() {
                return Err(Box::new(
                    Diagnostic::new(Some(span), "empty vector").with_help("write its entries: `[a, b]`"),
                ));
            }
            return Ok(Expr { node: Node::List(list), span });
        }
        if self.peek_punct('|') {
            let problem = Diagnostic::new(Some(start), "expected an expression, found `|`");
            return Err(Box::new(problem.with_help("write `abs(x)` for a number, `norm(v)` for a vector")));
        }
        if let Some(word) = self.peek_ident().filter(|word| matches!(word.as_str(), "if" | "else" | "match"))
        {
            let problem = Diagnostic::new(Some(start), format!("expected an expression, found `{word}`"));
            let help = names::not_smooth(&word).unwrap_or_default();
            return Err(Box::new(problem.with_help(help)));
        }
        let name = self.ident("an expression")?;
        if let Some((mut inside, span)) = self.group(Delimiter::Parenthesis) {
            let arguments = inside.comma_list(|p| p.expr())?;
            let span = name.span.to(span);
            return Ok(Expr { node: Node::Call(name, arguments), span });
        }
        Ok(Expr { span: name.span, node: Node::Name(name.text) })
    }
}

fn fold_chain(mut list: Vec<(bool, Expr)>, make: fn(Vec<(bool, Expr)>) -> Node) -> Expr {
    if list.len() == 1
        && let Some((_, only)) = list.pop()
    {
        return only;
    }
    let span = match (list.first(), list.last()) {
        (Some((_, first)), Some((_, last))) => first.span.to(last.span),
        _ => Span::new(0, 0),
    };
    Expr { node: make(list), span }
}

/// The exact value of decimal text.
fn number(text: &str, span: Span) -> Parsed<Rational> {
    let problem =
        |message: String, help: &str| Err(Box::new(Diagnostic::new(Some(span), message).with_help(help)));
    if !text.starts_with(|c: char| c.is_ascii_digit()) {
        let shown: String = text.chars().take(40).collect();
        return problem(format!("expected an expression, found {shown}"), "texts are only used in `source`");
    }
    let clean: String = text.chars().filter(|c| *c != '_').collect();
    let (mantissa, exponent) = match clean.find(['e', 'E']) {
        Some(at) if !clean.starts_with("0x") => (&clean[..at], &clean[at + 1..]),
        _ => (clean.as_str(), "0"),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = format!("{whole}{fraction}");
    if let Some(at) = digits.find(|c: char| !c.is_ascii_digit()) {
        let suffix: String = digits[at..].chars().take(40).collect();
        return problem(
            format!("`{suffix}` directly after a number"),
            "write products with `*`, and numbers in decimals: `2*x`",
        );
    }
    let magnitude = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
    if let Some(at) = magnitude.find(|c: char| !c.is_ascii_digit()) {
        let suffix: String = magnitude[at..].chars().take(40).collect();
        return problem(
            format!("`{suffix}` directly after a number"),
            "write products with `*`, and numbers in decimals: `2*x`",
        );
    }
    if digits.len() > MAX_DIGITS {
        let message = format!("number has {} digits, the limit is {MAX_DIGITS}", digits.len());
        return problem(message, "round it: generated code computes with 16 digits");
    }
    let exponent: i64 = match exponent.parse::<i64>() {
        Ok(e) if e.unsigned_abs() <= MAX_DIGITS as u64 => e,
        _ => {
            return problem(
                format!("exponent of the number is not between -{MAX_DIGITS} and {MAX_DIGITS}"),
                "choose units in which the value is moderate",
            );
        }
    };
    let integer: BigInt = digits.parse().unwrap_or_else(|_| BigInt::zero());
    // The digits after the point shift the exponent; both are at most MAX_DIGITS.
    let shift = exponent - fraction.len() as i64;
    let power = num_traits::pow(BigInt::from(10), shift.unsigned_abs() as usize);
    Ok(if shift < 0 { Rational::new(integer, power) } else { Rational::new(integer * power, BigInt::one()) })
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
