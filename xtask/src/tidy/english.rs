//! Phrases of comments that readers stumble over: their number may fall, and never rises.
//!
//! A comment names the thing: `The state at the start.` in the place of `What is there at the start.`
//!
//! Does not know: the language of code.

use std::path::Path;

use super::known;
use super::source::{Problem, Source};

/// Where the numbers stand.
const KNOWN: &str = "xtask/src/tidy/known.rs";

pub(super) fn problems(sources: &[Source]) -> Vec<Problem> {
    let rust: Vec<&Source> = sources.iter().filter(|source| source.has_extension("rs")).collect();
    known::PHRASES.iter().filter_map(|(phrases, most)| problem(&rust, phrases, *most)).collect()
}

fn problem(sources: &[&Source], phrases: &[&str], most: usize) -> Option<Problem> {
    let n: usize = sources.iter().map(|source| n_in_comments(&source.text, phrases)).sum();
    let message = if n > most {
        let all = phrases.join("`, `");
        format!("`{all}` stand {n} times in comments, {most} times before: name the thing instead")
    } else if n < most {
        format!("`{}` and its like stand {n} times in comments: lower {most} to that", phrases[0])
    } else {
        return None;
    };
    Some(Problem::new(Path::new(KNOWN), 1, message))
}

/// How often the phrases stand in lines of comments.
fn n_in_comments(text: &str, phrases: &[&str]) -> usize {
    let comments = text.lines().filter_map(|line| line.trim_start().strip_prefix("//"));
    comments.map(|line| phrases.iter().map(|phrase| n_in(line, phrase)).sum::<usize>()).sum()
}

/// How often a phrase stands in a line, whole words alone.
fn n_in(line: &str, phrase: &str) -> usize {
    let line = line.to_lowercase();
    let is_apart = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric());
    let ends = |at: usize| is_apart(line[at + phrase.len()..].chars().next());
    let begins = |at: usize| is_apart(phrase.chars().next()) || is_apart(line[..at].chars().next_back());
    line.match_indices(phrase).filter(|(at, _)| begins(*at) && ends(*at)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phrases_are_counted_in_comments_alone_and_only_fall() {
        let text = "//! What is left.\n/// those that; none whatsis\nlet x = \"what is\"; // what is\n";
        assert_eq!(n_in_comments(text, &["what is"]), 1);
        assert_eq!(n_in_comments(text, &["what is", "those that", "; none"]), 3);
        let source = Source { path: "a.rs".into(), text: text.into() };
        let told = |most| problem(&[&source], &["what is"], most).map(|problem| problem.message);
        assert_eq!(told(1), None);
        let more = "`what is` stand 1 times in comments, 0 times before: name the thing instead";
        assert_eq!(told(0).as_deref(), Some(more));
        let fewer = "`what is` and its like stand 1 times in comments: lower 2 to that";
        assert_eq!(told(2).as_deref(), Some(fewer));
    }
}
