//! A text whose brackets close: what an editor reads while somebody writes.
//!
//! Deliberately does not know: items, expressions, what a file says.

use crate::spec::tokens::{Kind, tokens};

/// Texts in quotes that are looked at again because one of them does not end.
const MAX_OPEN_TEXTS: usize = 8;

/// The text with blanks in the place of brackets that nothing closes or opens, and with the braces at its end that it
/// lacks. What stands in the text keeps its place.
///
/// No item has a `;` or a brace within parentheses or brackets, so that `(` and `[` which are open there are taken for
/// those that somebody has not closed yet.
pub(super) fn balanced(text: &str) -> String {
    let mut text = without_open_texts(text.to_owned());
    let (mut blanked, mut open): (Vec<usize>, Vec<(&str, usize)>) = (Vec::new(), Vec::new());
    let mut n_braces = 0_usize;
    for token in tokens(&text).iter().filter(|token| token.kind == Kind::Mark) {
        match token.text {
            "(" | "[" => open.push((token.text, token.start)),
            "{" => {
                blanked.extend(round_brackets(&mut open));
                open.push(("{", token.start));
                n_braces += 1;
            }
            ";" => blanked.extend(round_brackets(&mut open)),
            ")" | "]" => {
                let opening = if token.text == ")" { "(" } else { "[" };
                match open.last() {
                    Some((mark, _)) if *mark == opening => _ = open.pop(),
                    _ => blanked.push(token.start),
                }
            }
            "}" => {
                blanked.extend(round_brackets(&mut open));
                match open.pop() {
                    Some(_) => n_braces -= 1,
                    None => blanked.push(token.start),
                }
            }
            _ => {}
        }
    }
    blanked.extend(round_brackets(&mut open));
    for at in blanked {
        text.replace_range(at..at + 1, " ");
    }
    text.push('\n');
    text.push_str(&"}".repeat(n_braces));
    text
}

/// Where the parentheses and brackets stand that are open since the last brace; they are open no longer.
fn round_brackets(open: &mut Vec<(&str, usize)>) -> Vec<usize> {
    let kept = open.iter().rposition(|(mark, _)| *mark == "{").map_or(0, |at| at + 1);
    open.drain(kept..).map(|(_, at)| at).collect()
}

/// Blanks in the place of a text in quotes that does not end, and of a comment that does not; both end with their line
/// then.
fn without_open_texts(mut text: String) -> String {
    for _ in 0..MAX_OPEN_TEXTS {
        let open = tokens(&text).into_iter().find_map(|token| {
            let is_open = match token.kind {
                Kind::BlockComment => !(token.text.len() >= 4 && token.text.ends_with("*/")),
                Kind::Word if token.text.starts_with('"') => {
                    token.start + token.text.len() == text.len() && !is_closed(token.text)
                }
                _ => false,
            };
            let line = token.text.find('\n').unwrap_or(token.text.len());
            is_open.then_some(token.start..token.start + line)
        });
        let Some(range) = open else { break };
        let n = range.len();
        text.replace_range(range, &" ".repeat(n));
    }
    text
}

/// Whether a text in quotes has its second one.
fn is_closed(text: &str) -> bool {
    // The first quote closes nothing.
    let (mut is_escaped, mut is_closed) = (true, false);
    for c in text.chars() {
        is_closed = c == '"' && !is_escaped;
        is_escaped = c == '\\' && !is_escaped;
    }
    is_closed
}

#[cfg(test)]
mod tests {
    use super::balanced;

    #[test]
    fn brackets_close_and_everything_keeps_its_place() {
        let same = |text: &str| assert_eq!(balanced(text).strip_suffix('\n'), Some(text));
        same("model m { param a = (1 + [2, 3]); }");
        same("model m { source \"(\"; } // (");
        let cases = [
            ("model m { let a = (1; let b = 2; }", "model m { let a =  1; let b = 2; }\n"),
            ("model m { let a = 1); let b = [2]; }", "model m { let a = 1 ; let b = [2]; }\n"),
            ("model m { scene s { want x;", "model m { scene s { want x;\n}}"),
            ("model m { let a = [dot(b, c; }", "model m { let a =  dot b, c; }\n"),
            ("model m { source \"x; }\nlet", "model m { source      \nlet\n}"),
            ("model m { } }", "model m { }  \n"),
            ("model m { /* é", "model m {      \n}"),
        ];
        for (text, expected) in cases {
            assert_eq!(balanced(text), expected, "{text}");
        }
    }
}
