//! The pages of the documentation and their code blocks.

use std::path::{Path, PathBuf};

/// A page of the documentation.
pub(crate) struct Page {
    pub(crate) path: PathBuf,
    pub(crate) text: String,
}

/// A fenced code block.
#[allow(dead_code, reason = "not every test looks at everything")]
pub(crate) struct Block<'a> {
    /// What stands after the backticks.
    pub(crate) language: &'a str,
    /// The last line before it that is not empty.
    pub(crate) before: &'a str,
    pub(crate) text: &'a str,
}

/// The workspace's root directory.
pub(crate) fn root() -> PathBuf {
    // The package is a folder of the workspace.
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// All Markdown files in `docs` and those in the root that are about the source, sorted.
pub(crate) fn pages() -> Vec<Page> {
    let mut folders = vec![root().join("docs")];
    let mut paths =
        ["README.md", "CONTRIBUTING.md", "ARCHITECTURE.md"].map(|name| root().join(name)).to_vec();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                paths.push(path);
            }
        }
    }
    paths.sort();
    paths.into_iter().map(|path| Page { text: std::fs::read_to_string(&path).unwrap(), path }).collect()
}

/// The code blocks of a text.
pub(crate) fn blocks(text: &str) -> Vec<Block<'_>> {
    let mut found = Vec::new();
    let (mut before, mut open) = ("", None);
    let mut offset = 0;
    for line in text.split_inclusive('\n') {
        let start = offset;
        offset += line.len();
        let line = line.trim_end();
        match (open, line.strip_prefix("```")) {
            (None, Some(language)) => open = Some((language, offset)),
            (Some((language, from)), Some("")) => {
                found.push(Block { language, before, text: &text[from..start] });
                open = None;
            }
            (None, None) if !line.is_empty() => before = line,
            _ => {}
        }
    }
    assert!(open.is_none(), "a code block is not closed");
    found
}

/// The arguments of each call of a program in lines of a shell, without what the shell does with input and output.
#[allow(dead_code, reason = "not every test looks at everything")]
pub(crate) fn commands(text: &str, program: &str) -> Vec<Vec<String>> {
    let text = text.replace("\\\n", " ");
    let found = text.lines().filter_map(|line| {
        let (before, rest) = line.split_once(program)?;
        let before = before.trim_end();
        // At the start of a command, so that `cargo install hamel` is none of `hamel`.
        let is_start = before.is_empty() || before.ends_with(['|', '$', '(', '{', ';']);
        if !is_start || !rest.starts_with([' ', '\n']) && !rest.is_empty() {
            return None;
        }
        Some(words(rest))
    });
    found.collect()
}

/// Words up to the end of a command; a quoted text is one word.
fn words(text: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for c in text.chars() {
        match quote {
            Some(open) if c == open => quote = None,
            Some(_) => word.get_or_insert_default().push(c),
            None if c == '"' || c == '\'' => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            None if c.is_whitespace() => words.extend(word.take()),
            None if ['|', '<', '>', '#', ')', ';', '}'].contains(&c) => break,
            None => word.get_or_insert_default().push(c),
        }
    }
    words.extend(word);
    words
}

/// Calls `check` with every call of a program in the shell blocks of the documentation.
#[allow(dead_code, reason = "not every test looks at everything")]
pub(crate) fn each_command(program: &str, mut check: impl FnMut(&Page, &[String])) {
    let mut n = 0;
    for page in pages() {
        for block in blocks(&page.text).into_iter().filter(|b| ["sh", "console"].contains(&b.language)) {
            for words in commands(block.text, program) {
                // `xtask() { cargo xtask "$@"; }`
                if words.iter().all(|word| !word.starts_with("$@")) {
                    check(&page, &words);
                    n += 1;
                }
            }
        }
    }
    assert!(n > 5, "only {n} commands found");
}
