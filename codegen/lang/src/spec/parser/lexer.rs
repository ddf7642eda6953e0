//! Text to tokens: `proc_macro2` lexes; what it would report badly is found before.
//!
//! Deliberately does not know: items, expressions, names.

use proc_macro2::{TokenStream, TokenTree};

use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::limits::{MAX_BAD_CHARACTERS, MAX_BRACKETS, MAX_DEPTH};

pub(super) type Parsed<T> = Result<T, Box<Diagnostic>>;

/// Whether a character has no place in a text that people read: a control character, or one that changes the order in
/// which a line is shown, so that it reads as what it is not. XML and Rust refuse both.
fn is_hidden(c: char) -> bool {
    let is_direction =
        matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let is_no_character = matches!(c, '\u{fffe}' | '\u{ffff}');
    (c.is_control() && !matches!(c, '\n' | '\t')) || is_direction || is_no_character
}

/// What is wrong with the first character of a text that [`is_hidden`], which stands at a place.
pub(super) fn hidden(text: &str, span: Span) -> Option<Diagnostic> {
    let c = text.chars().find(|c| is_hidden(*c))?;
    let problem =
        Diagnostic::new(Some(span), format!("the character U+{:04X} is not part of the language", c as u32));
    Some(problem.with_help(match c {
        '\r' => "end lines with a line feed, or with a carriage return and a line feed",
        c if c.is_control() => "remove this control character",
        _ => "remove this character: it is not seen, and changes how the line reads",
    }))
}

/// The text with blanks in the place of hidden characters, each of which is reported, up to a number of them. Lines may
/// end with a carriage return before the line feed.
pub(super) fn without_hidden(text: &str, problems: &mut Vec<Diagnostic>) -> String {
    let mut result = text.to_owned();
    let ends_line = |at: usize| text[at..].starts_with("\r\n");
    let all = text.char_indices().filter(|(at, c)| is_hidden(*c) && !ends_line(*at));
    for (n, (at, c)) in all.enumerate() {
        let n_bytes = c.len_utf8();
        if n < MAX_BAD_CHARACTERS {
            problems.extend(hidden(&text[at..at + n_bytes], Span::new(at, at + n_bytes)));
        }
        result.replace_range(at..at + n_bytes, &" ".repeat(n_bytes));
    }
    result
}

/// The text without what other languages would take for comments, `# to the end of the line`: the first one is
/// reported.
///
/// Texts and comments are skipped as the lexer does; `#[` and `#!` are left to the parser.
pub(super) fn without_hash_comments(text: &str, problems: &mut Vec<Diagnostic>) -> String {
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
pub(super) fn lex(text: &str, problems: &mut Vec<Diagnostic>) -> Option<TokenStream> {
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
pub(super) fn check_brackets(text: &str) -> Parsed<()> {
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
pub(super) fn check_nesting(tokens: &TokenStream) -> Parsed<()> {
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

pub(super) fn too_deep(span: Span) -> Box<Diagnostic> {
    let message = format!("expression is nested more than {MAX_DEPTH} levels deep");
    Box::new(Diagnostic::new(Some(span), message).with_help("name a part of it with `let`"))
}

pub(super) fn span_of(span: proc_macro2::Span) -> Span {
    let range = span.byte_range();
    Span::new(range.start, range.end)
}
