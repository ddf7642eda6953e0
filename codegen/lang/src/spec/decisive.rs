//! What of a text decides about the program of a scene, for those who keep programs by the text that they come from.
//!
//! Views are expressions of a graph of their own. Numbers in other scenes and in initial values are constants of the
//! model's graph that its equations do not contain; only the order of factors that are roots of the same numbers could
//! be another one. Equations between coordinates are told apart next to the initial values: for models that have such
//! equations, initial values decide. A default of a parameter decides: signs that are not known are told
//! apart there, and conditions are made of them. Deliberately does not know: what items mean, programs.

use super::tokens::{Kind, Token, tokens};

/// Results of a model, by the parts of its text that decide about them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Made<'a> {
    /// What all scenes have in common, as it is written down: comments, views and scenes decide about nothing.
    Common,
    /// A scene as it is written down, with its initial values: comments, views and other scenes decide about nothing.
    Scene(&'a str),
    /// The program of a scene, or of what no scene is called: nor do numbers as initial values.
    Program(&'a str),
}

/// The words and marks of a text that decide about a result of its model, in their order, with documentation and a
/// blank for any number of these. Equal lists make equal programs.
///
/// ```
/// use hamel_lang::spec::{Made, decisive};
///
/// let text = |k: &str, start: &str| {
///     format!("model spring {{ param k = {k}; coordinate x in real; initial x = {start};
///         lagrangian = 1/2*x_dot^2 - k*x^2; }}")
/// };
/// let program = |k, start| decisive(&text(k, start), Made::Program("default"));
/// assert_eq!(program("2", "0.3"), program("2", "-1/2"));
/// assert_ne!(program("2", "0.3"), program("7", "0.3"));
/// // The square root of a number is an expression of its own.
/// assert_ne!(program("2", "0.3"), program("2", "2^0.5"));
/// let scene = |k, start| decisive(&text(k, start), Made::Scene("default"));
/// assert_ne!(scene("2", "0.3"), scene("2", "0.4"));
/// ```
pub fn decisive(text: &str, of: Made<'_>) -> Vec<String> {
    // Conditions are told as they are written, on one line: with blanks, and with comments between `/*` and `*/`.
    let is_said = |token: &Token<'_>| token.kind != Kind::LineComment || token.text.starts_with("///");
    let all: Vec<Token<'_>> = tokens(text).into_iter().filter(is_said).collect();
    let decides = |item: &&[Token<'_>]| match (word(item, 0), of) {
        ("view", _) | ("scene", Made::Common) => false,
        ("scene", Made::Scene(own) | Made::Program(own)) => word(item, 1) == own,
        ("initial", Made::Program(_)) => !is_of_numbers(item),
        _ => true,
    };
    let is_apart = |token: &Token<'_>| token.has_blanks || token.n_breaks > 0;
    let written = |(place, token): (usize, &Token<'_>)| {
        if place > 0 && is_apart(token) { format!(" {}", token.text) } else { token.text.to_owned() }
    };
    let items = items(&all).into_iter().filter(decides);
    items.flat_map(|item| item.iter().enumerate().map(written)).collect()
}

/// The tokens outside the braces of the model, and each item in them: up to a semicolon, or a brace that is closed.
fn items<'a, 't>(all: &'a [Token<'t>]) -> Vec<&'a [Token<'t>]> {
    let (mut items, mut depth, mut start) = (Vec::new(), 0_usize, 0);
    for (place, token) in all.iter().enumerate() {
        let ends = match token {
            _ if token.opens() => {
                depth += 1;
                depth == 1 && token.is("{")
            }
            _ if token.closes() => {
                depth = depth.saturating_sub(1);
                depth == 1 && token.is("}")
            }
            _ => depth == 1 && token.is(";"),
        };
        if ends {
            items.push(&all[start..=place]);
            start = place + 1;
        }
    }
    items.push(&all[start..]);
    items
}

/// A word of an item, counted behind its documentation; empty where there is none.
fn word<'t>(item: &[Token<'t>], n: usize) -> &'t str {
    let mut said = item.iter().filter(|token| !token.is_comment());
    said.nth(n).filter(|token| token.kind == Kind::Word).map_or("", |token| token.text)
}

/// Whether the value of an item, behind `=`, is made of numbers alone, by sums, products and ratios.
fn is_of_numbers(item: &[Token<'_>]) -> bool {
    let Some(start) = item.iter().position(|token| token.is("=")) else { return false };
    item[start + 1..].iter().all(|token| match token.kind {
        Kind::Word => token.text.starts_with(|c: char| c.is_ascii_digit()),
        Kind::Mark => ["[", "]", "(", ")", ",", "+", "-", "*", "/", ";"].contains(&token.text),
        Kind::LineComment | Kind::BlockComment => false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "/// A pendulum.
        model pendulum {
            param m = 2 where m > 0; // a mass
            coordinate x in angle;
            initial x = 0.3;
            lagrangian = 1/2*m*x_dot^2 + m*cos(x);
            output height = -cos(x);
            view bob = point([sin(x), -cos(x), 0]);
            /// One.
            scene one { fix m = 3; want rhs; }
            scene two { fix m = 4; want rhs, energy; }
            /* the end */
        }";

    #[test]
    fn every_word_and_mark_decides_but_those_of_views_numbers_and_other_scenes() {
        let before = decisive(TEXT, Made::Program("one"));
        let silent = [
            "view bob = point([sin(x), -cos(x), 0]);",
            "scene two { fix m = 4; want rhs, energy; }",
            "initial x = 0.3;",
            "// a mass",
        ];
        let places: Vec<_> = silent
            .iter()
            .map(|part| (TEXT.find(part).unwrap(), TEXT.find(part).unwrap() + part.len()))
            .collect();
        let (mut n_silent, mut n_decisive) = (0, 0);
        for token in tokens(TEXT) {
            let end = token.start + token.text.len();
            let is_silent = places.iter().any(|(from, to)| (*from..*to).contains(&token.start));
            // In the place of each one a word that no item begins with, or another number.
            let other = if token.text.parse::<f64>().is_ok() { "77" } else { "other" };
            // The word that an item begins with, and the marks that it ends with, make it one that does not decide.
            if is_silent && !token.is_comment() && other != "77" {
                continue;
            }
            let other = match token.kind {
                Kind::LineComment if token.text.starts_with("///") => "/// Another.",
                Kind::LineComment => "// another",
                Kind::BlockComment => "/* another */",
                _ => other,
            };
            let changed = [&TEXT[..token.start], other, &TEXT[end..]].concat();
            let is_equal = decisive(&changed, Made::Program("one")) == before;
            assert_eq!(is_equal, is_silent, "{token:?}");
            if is_silent { n_silent += 1 } else { n_decisive += 1 }
        }
        assert!(n_silent == 4 && n_decisive > 60, "{n_silent} {n_decisive}");
        // Blanks, and the items that do not decide.
        assert_eq!(decisive(&TEXT.replace('\n', "\n\n  "), Made::Program("one")), before);
        assert_ne!(decisive(&TEXT.replace("m > 0", "m>0"), Made::Program("one")), before);
        for part in silent {
            assert_eq!(decisive(&TEXT.replace(part, ""), Made::Program("one")), before, "{part}");
        }
    }

    #[test]
    fn a_scene_depends_on_itself_and_on_how_it_is_written_down() {
        let other = TEXT.replace("fix m = 4", "fix m = 5");
        let of = |text: &str, made: Made<'_>| decisive(text, made);
        assert_ne!(of(TEXT, Made::Program("two")), of(&other, Made::Program("two")));
        assert_eq!(of(TEXT, Made::Program("one")), of(&other, Made::Program("one")));
        assert_eq!(of(TEXT, Made::Common), of(&other, Made::Common));
        let start = TEXT.replace("0.3", "0.4");
        assert_ne!(of(TEXT, Made::Scene("one")), of(&start, Made::Scene("one")));
        assert_eq!(of(TEXT, Made::Program("")), of(&start, Made::Program("")));
        // Braces inside an item end none that goes on.
        let event = TEXT.replace("output", "event e = x { then x_dot = -x_dot; } output");
        assert_ne!(of(&event, Made::Common), of(TEXT, Made::Common));
    }
}
