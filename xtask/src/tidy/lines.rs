//! Lengths of files and of lines, and how long lines of comments and Markdown are broken.
//!
//! Excepted are tests and what programs write; in Markdown tables and blocks of code, which cannot be broken, and the
//! targets of links; in Rust texts, which are shown as they are.
//!
//! Does not know: Rust, besides where comments and tests begin.

use std::collections::BTreeSet;

use proc_macro2::{TokenStream, TokenTree};

use super::known;
use super::source::{MAX_COLUMNS, MAX_LINES, Problem, Source};

pub(super) fn problems(sources: &[Source]) -> Vec<Problem> {
    let mut problems = Vec::new();
    for source in sources {
        problems.extend(length_of_file(source));
        if known::NOT_WRAPPED.iter().any(|place| source.is_in(place)) {
            continue;
        }
        problems.extend(long_lines(source).into_iter().map(|line| {
            let message = format!(
                "longer than {MAX_COLUMNS} columns; `cargo xtask tidy --wrap` breaks comments and text"
            );
            Problem::new(&source.path, line, message)
        }));
    }
    for place in known::NOT_WRAPPED {
        if !sources.iter().any(|s| s.is_in(place) && !long_lines(s).is_empty()) {
            let message = "no long lines any more; remove it from xtask/src/tidy/known.rs";
            problems.push(Problem::new(place.as_ref(), 1, message));
        }
    }
    for (file, _) in known::LONG_FILES {
        let is_needed =
            sources.iter().any(|s| s.path.to_string_lossy() == *file && n_lines(&s.text) > MAX_LINES);
        if !is_needed {
            let message = "not too long any more; remove it from xtask/src/tidy/known.rs";
            problems.push(Problem::new(file.as_ref(), 1, message));
        }
    }
    problems
}

/// Lines before the tests that a file ends with.
fn n_lines(text: &str) -> usize {
    let code = text.find("\n#[cfg(test)]\nmod tests {").map_or(text, |end| &text[..end]);
    code.lines().count()
}

fn length_of_file(source: &Source) -> Option<Problem> {
    let n = n_lines(&source.text);
    let name = source.path.to_string_lossy();
    let is_excepted = !source.has_extension("rs")
        || source.is_test()
        || known::LONG_FILES.iter().any(|(file, _)| *file == name);
    (n > MAX_LINES && !is_excepted).then(|| {
        Problem::new(&source.path, n, format!("{n} lines, the limit is {MAX_LINES}; cut it along its seams"))
    })
}

/// What a line is, for breaking it.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// Prose, after so many bytes of indentation and marks of a comment.
    Prose(usize),
    /// Code outside of texts.
    Code,
    /// What cannot be broken.
    Fixed,
}

/// Kinds of all lines.
fn kinds(source: &Source) -> Vec<Kind> {
    let is_markdown = source.has_extension("md");
    let texts = if is_markdown { BTreeSet::new() } else { lines_of_texts(&source.text) };
    let mut is_code = false;
    let mut kinds = Vec::new();
    for (k, line) in source.text.lines().enumerate() {
        let start = if is_markdown { Some(0) } else { comment_start(line) };
        let kind = match start {
            _ if texts.contains(&(k + 1)) => Kind::Fixed,
            None => {
                is_code = false;
                Kind::Code
            }
            Some(start) => {
                let text = line[start..].trim_start();
                let is_fence = text.starts_with("```") || text.starts_with("~~~");
                let fixed = is_code || is_fence || text.starts_with(['|', '#', '<']);
                is_code ^= is_fence;
                if fixed { Kind::Fixed } else { Kind::Prose(start) }
            }
        };
        kinds.push(kind);
    }
    kinds
}

/// Where the text of a line that is a comment begins.
fn comment_start(line: &str) -> Option<usize> {
    let indent = line.len() - line.trim_start().len();
    let rest = &line[indent..];
    let mark = ["///", "//!", "//"].into_iter().find(|mark| rest.starts_with(mark))?;
    Some(indent + mark.len())
}

fn long_lines(source: &Source) -> Vec<usize> {
    if known::written_by_programs(&source.path) {
        return Vec::new();
    }
    let kinds = kinds(source);
    let too_long = |(k, line): &(usize, &str)| {
        line.chars().count() > MAX_COLUMNS
            && match kinds[*k] {
                Kind::Prose(start) => break_at(line, start).is_some(),
                Kind::Code => !is_text(line),
                Kind::Fixed => false,
            }
    };
    source.text.lines().enumerate().filter(too_long).map(|(k, _)| k + 1).collect()
}

/// The lines of texts that have more than one.
fn lines_of_texts(text: &str) -> BTreeSet<usize> {
    let mut lines = BTreeSet::new();
    // What rustc cannot read, rustc reports.
    let mut pending: Vec<TokenStream> = text.parse().into_iter().collect();
    while let Some(tokens) = pending.pop() {
        for tree in tokens {
            match tree {
                TokenTree::Group(group) => pending.push(group.stream()),
                TokenTree::Literal(literal) => {
                    let (start, end) = (literal.span().start().line, literal.span().end().line);
                    lines.extend((start..=end).filter(|_| start < end));
                }
                _ => {}
            }
        }
    }
    lines
}

/// Whether a line of code is long because of a text in it.
fn is_text(line: &str) -> bool {
    let outside: usize = line.split('"').step_by(2).map(|part| part.chars().count()).sum();
    line.contains('"') && outside <= MAX_COLUMNS
}

/// The last blank at which a line can be broken: within the limit, but not within code or a link.
fn break_at(line: &str, start: usize) -> Option<usize> {
    let (mut is_code, mut depth) = (false, 0_usize);
    let mut last = None;
    let text = line[start..].trim_start();
    let first = line.len() - text.len() + marker(text);
    for (column, (at, c)) in line.char_indices().enumerate() {
        match c {
            '`' => is_code = !is_code,
            '[' | '(' if !is_code => depth += 1,
            ']' | ')' if !is_code => depth = depth.saturating_sub(1),
            // What would begin a line with the mark of a list, a heading or a quotation stays where it is.
            ' ' if !is_code && at > first && !begins_block(&line[at + 1..]) => {
                let is_link =
                    depth > 0 && line[at..].find("](").is_some_and(|end| !line[at..at + end].contains('['));
                if column <= MAX_COLUMNS || last.is_none() {
                    last = if is_link { last } else { Some(at) };
                }
            }
            _ => {}
        }
        if column >= MAX_COLUMNS && last.is_some() {
            break;
        }
    }
    last
}

/// Length of the mark of a list item that a text begins with.
fn marker(text: &str) -> usize {
    let digits = text.bytes().take_while(u8::is_ascii_digit).count();
    match text.as_bytes() {
        [b'-' | b'*' | b'+', b' ', ..] => 2,
        bytes if digits > 0 && bytes[digits..].starts_with(b". ") => digits + 2,
        _ => 0,
    }
}

fn begins_block(text: &str) -> bool {
    marker(text) > 0
        || text.starts_with(['#', '|', '>', '='])
        || text.starts_with("```")
        || text.starts_with("---")
}

/// The text with long lines of prose broken; what is left over joins the next line of the same paragraph.
pub(super) fn wrapped(source: &Source) -> String {
    if known::written_by_programs(&source.path) {
        return source.text.clone();
    }
    let kinds = kinds(source);
    let mut out: Vec<String> = Vec::new();
    let lines: Vec<&str> = source.text.lines().collect();
    // What is left over of the line before, with the indentation that its continuation has.
    let mut left: Option<(String, String)> = None;
    for (k, line) in lines.iter().enumerate() {
        let mut line = (*line).to_owned();
        let kind = kinds[k];
        if let Some((prefix, rest)) = left.take() {
            let own = match kind {
                Kind::Prose(start) => line[start..].trim_start().to_owned(),
                Kind::Code | Kind::Fixed => String::new(),
            };
            let is_same = !own.is_empty() && !begins_block(&own) && line[..line.len() - own.len()] == prefix;
            if is_same {
                line = format!("{prefix}{rest} {own}");
            } else {
                push_broken(&mut out, &prefix, &rest);
            }
        }
        if let Kind::Prose(start) = kind {
            let text = line[start..].trim_start();
            let (blank, mark) = (line.len() - text.len(), marker(text));
            let prefix = format!("{}{}", &line[..blank], " ".repeat(mark));
            if let Some(at) = over(&line, start) {
                let rest = line.split_off(at).trim_start().to_owned();
                left = Some((prefix, rest));
            }
        }
        out.push(line);
    }
    if let Some((prefix, rest)) = left {
        push_broken(&mut out, &prefix, &rest);
    }
    let mut text = out.join("\n");
    if source.text.ends_with('\n') {
        text.push('\n');
    }
    text
}

/// Appends what is left over of a paragraph, in as many lines as it takes.
fn push_broken(out: &mut Vec<String>, prefix: &str, rest: &str) {
    let mut pending = format!("{prefix}{rest}");
    while let Some(at) = over(&pending, prefix.len()) {
        let rest = pending.split_off(at);
        out.push(pending);
        pending = format!("{prefix}{}", rest.trim_start());
    }
    out.push(pending);
}

/// Where a line that is too long is broken.
fn over(line: &str, start: usize) -> Option<usize> {
    if line.chars().count() > MAX_COLUMNS { break_at(line, start) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(path: &str, text: &str) -> Source {
        Source { path: path.into(), text: text.into() }
    }

    #[test]
    fn prose_is_wrapped_and_nothing_else() {
        let words = "word ".repeat(30);
        let long = words.trim_end();
        let text = format!(
            "    /// {long}\n    /// and more.\n    ///\n    /// ```\n    /// {long}\n    /// ```\nfn f() {{}}\n"
        );
        let before = source("a.rs", &text);
        assert_eq!(long_lines(&before), [1]);
        let after = source("a.rs", &wrapped(&before));
        assert!(long_lines(&after).is_empty(), "{}", after.text);
        let joined =
            |text: &str| text.split_whitespace().filter(|w| *w != "///").collect::<Vec<_>>().join(" ");
        assert_eq!(joined(&after.text), joined(&before.text));
        assert_eq!(wrapped(&after), after.text);
        let list = source("a.md", &format!("- {long}\n- other\n\n| {long} |\n\n```\n{long}\n```\n"));
        let wrapped = wrapped(&list);
        assert_eq!(wrapped.lines().nth(1).unwrap().find("word"), Some(2), "{wrapped}");
        assert!(long_lines(&source("a.md", &wrapped)).is_empty());
        assert_eq!(wrapped.lines().count(), list.text.lines().count() + 1);
    }

    #[test]
    fn code_links_and_texts_stay_whole() {
        let target = "x".repeat(130);
        assert!(long_lines(&source("a.md", &format!("[name]({target})\n"))).is_empty());
        let line = format!("{} `{}` end\n", "a".repeat(60), "b c ".repeat(30));
        let wrapped = wrapped(&source("a.md", &line));
        assert_eq!(wrapped.lines().next().unwrap(), "a".repeat(60), "{wrapped}");
        assert!(long_lines(&source("a.rs", &format!("    f(\"{target}\");\n"))).is_empty());
        assert_eq!(long_lines(&source("a.rs", &format!("    f({target});\n"))), [1]);
        let text = format!("const A: &str = \"\n/// {}\n\";\n", "b c ".repeat(40));
        let text = source("a.rs", &text);
        assert!(long_lines(&text).is_empty());
        assert_eq!(super::wrapped(&text), text.text);
    }

    #[test]
    fn tests_do_not_count_as_lines() {
        let lines = "x\n".repeat(699);
        assert!(
            length_of_file(&source("a.rs", &format!("{lines}\n#[cfg(test)]\nmod tests {{\n{lines}}}\n")))
                .is_none()
        );
        assert!(length_of_file(&source("a.rs", &format!("{lines}{lines}"))).is_some());
        assert!(length_of_file(&source("tests/a.rs", &format!("{lines}{lines}"))).is_none());
    }
}
