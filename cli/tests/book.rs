//! What the documentation shows is true: output of commands, excerpts of generated code, links.
//!
//! Rust in it is tested by `hamel-tests`, models by `hamel-codegen`, arguments of commands next to their definition.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};
use std::process::Command;

use crate::common::pages::{Block, blocks, commands, pages, root};

/// Whether a line is `pattern`, in which `[..]` stands for any text.
fn line_matches(pattern: &str, line: &str) -> bool {
    let mut parts = pattern.split("[..]");
    // `split` yields at least one part.
    let Some(mut rest) = line.strip_prefix(parts.next().unwrap()) else { return false };
    let parts: Vec<&str> = parts.collect();
    let Some((last, middle)) = parts.split_last() else { return rest.is_empty() };
    for part in middle {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

/// Whether lines are those of a pattern, in which the line `...` stands for any number of them.
fn matches(pattern: &[&str], lines: &[&str]) -> bool {
    match (pattern.split_first(), lines.split_first()) {
        (None, None) => true,
        (Some((&"...", rest)), _) => (0..=lines.len()).any(|skipped| matches(rest, &lines[skipped..])),
        (Some((wanted, rest)), Some((line, lines))) => line_matches(wanted, line) && matches(rest, lines),
        _ => false,
    }
}

fn lines(text: &str) -> Vec<&str> {
    text.trim_end().lines().map(str::trim_end).collect()
}

#[test]
fn patterns_match_what_they_should_and_nothing_else() {
    assert!(line_matches("a[..]c[..]", "abcd") && line_matches("[..]", "") && line_matches("a", "a"));
    assert!(!line_matches("a[..]c", "ab") && !line_matches("a", "ab") && !line_matches("ab[..]b", "ab"));
    assert!(matches(&["a", "...", "d"], &["a", "b", "c", "d"]) && matches(&["...", "a"], &["a"]));
    assert!(
        !matches(&["a", "...", "d"], &["a", "b"]) && !matches(&["a"], &["a", "b"]) && !matches(&["a"], &[])
    );
}

/// Where commands run: a folder with the files of the repository, in which they may write others.
#[cfg(unix)]
fn place() -> PathBuf {
    let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join("book");
    std::fs::create_dir_all(&place).unwrap();
    for name in ["docs", "models"] {
        // It may be there from an earlier run, or another test.
        let _ = std::os::unix::fs::symlink(root().join(name), place.join(name));
    }
    place
}

/// Where commands run.
#[cfg(not(unix))]
fn place() -> PathBuf {
    root().to_owned()
}

fn run(arguments: &[String]) -> String {
    let out = Command::new(env!("CARGO_BIN_EXE_hamel"))
        .env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
        .args(arguments)
        .current_dir(place())
        .output()
        .unwrap();
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

/// With `UPDATE_EXPECT` set, output that is shown in full is written anew.
#[test]
fn transcripts_show_what_commands_print() {
    let update = std::env::var_os("UPDATE_EXPECT").is_some();
    let mut n = 0;
    for page in pages() {
        let mut text = page.text.clone();
        for block in blocks(&page.text).into_iter().filter(|block| block.language == "console") {
            let mut now = String::new();
            for part in block.text.split("$ ").skip(1) {
                let (command, shown) = part.split_once('\n').unwrap_or((part, ""));
                let arguments =
                    commands(command, "hamel").pop().unwrap_or_else(|| panic!("no call of hamel: {command}"));
                let printed = run(&arguments);
                n += 1;
                let is_partial = shown.contains("[..]") || lines(shown).contains(&"...");
                if update && !is_partial {
                    now.push_str(&format!("$ {command}\n{}\n", lines(&printed).join("\n")));
                    continue;
                }
                now.push_str(&format!("$ {part}"));
                let page = page.path.display();
                assert!(
                    matches(&lines(shown), &lines(&printed)),
                    "{page}: {command} prints\n{printed}\nnot\n{shown}"
                );
            }
            text = text.replacen(block.text, &now, 1);
        }
        if update && text != page.text {
            std::fs::write(&page.path, text).unwrap();
        }
    }
    assert!(n > 8, "only {n} commands found");
}

/// Parts of an excerpt, separated by lines `...`, follow one another in the file; indentation is free.
#[test]
fn excerpts_are_in_the_generated_files() {
    let mut n = 0;
    for page in pages() {
        for Block { before, text, .. } in blocks(&page.text) {
            let name = before.strip_prefix("<!-- from ").and_then(|rest| rest.strip_suffix(" -->"));
            let Some(name) = name else { continue };
            let file = std::fs::read_to_string(root().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
            let file: Vec<&str> = file.lines().map(str::trim).collect();
            let excerpt: Vec<&str> = lines(text).into_iter().map(str::trim).collect();
            let mut from = 0;
            for part in excerpt.split(|line| *line == "...") {
                let found = file[from..].windows(part.len()).position(|window| window == part);
                let at = found.unwrap_or_else(|| panic!("{name} does not have\n{}", part.join("\n")));
                from += at + part.len();
            }
            n += 1;
        }
    }
    assert!(n > 6, "only {n} excerpts found");
}

/// Every block of the book is of a kind that some test looks at; formulas are `text`.
#[test]
fn every_code_block_of_the_book_is_tested() {
    for page in pages().iter().filter(|page| page.path.parent() == Some(&root().join("docs/book"))) {
        for Block { language, before, text } in blocks(&page.text) {
            let is_known = match language {
                "rust,ignore" => before.starts_with("<!-- from "),
                "sh" | "console" | "rust" | "hamel" | "text" | "toml" => true,
                // Compiled by tests/tests/c.rs, run by tests/peers/interfaces.py.
                "c" | "cpp" => page.path.ends_with("c.md"),
                // Run by tests/tests/wasm.rs.
                "js" => page.path.ends_with("wasm.md"),
                // By `python/tests/test_package.py`; of C, by tests/peers/interfaces.py.
                // And of formulas, by tests/peers/formulas.py.
                "python" => {
                    ["docs/book/python.md", "c.md", "formulas.md"].iter().any(|p| page.path.ends_with(p))
                }
                "julia" | "matlab" => page.path.ends_with("formulas.md"),
                _ => false,
            };
            assert!(is_known, "{}: no test for this block `{language}`\n{text}", page.path.display());
        }
    }
}

/// Text without code.
fn prose(text: &str) -> String {
    let mut text = text.to_owned();
    for block in blocks(&text.clone()) {
        text = text.replacen(block.text, "", 1);
    }
    // What is left between backticks on one line is code as well.
    text.lines().map(|line| line.split('`').step_by(2).collect::<String>() + "\n").collect()
}

/// Targets of the links of a text.
fn targets(text: &str) -> Vec<String> {
    let prose = prose(text);
    prose.split("](").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())).collect()
}

/// Names of the headings of a page in addresses; GitHub and mdBook make them alike.
fn anchors(text: &str) -> BTreeSet<String> {
    let mut text = text.to_owned();
    for block in blocks(&text.clone()) {
        text = text.replacen(block.text, "", 1);
    }
    let headings =
        text.lines().filter_map(|line| Some(line.strip_prefix('#')?.trim_start_matches('#').trim()));
    let mut seen = BTreeMap::new();
    let mut found = BTreeSet::new();
    for heading in headings {
        let lower = heading.to_lowercase();
        let kept = lower.chars().filter(|c| c.is_alphanumeric() || [' ', '-', '_'].contains(c));
        let name: String = kept.map(|c| if c == ' ' { '-' } else { c }).collect();
        let n = seen.entry(name.clone()).or_insert(0);
        found.insert(if *n == 0 { name } else { format!("{name}-{n}") });
        *n += 1;
    }
    found
}

/// A path without `..`.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(plain.pop()),
            other => plain.push(other),
        }
    }
    plain
}

#[test]
fn links_lead_to_files_and_headings() {
    let (mut n, mut problems) = (0, Vec::new());
    for page in pages() {
        for target in targets(&page.text) {
            if target.starts_with("http") {
                continue;
            }
            n += 1;
            let (file, anchor) = target.split_once('#').unwrap_or((&target, ""));
            let folder = page.path.parent().unwrap();
            let path = if file.is_empty() { page.path.clone() } else { plain(&folder.join(file)) };
            let shown = page.path.strip_prefix(root()).unwrap().display();
            if !path.starts_with(root()) || !path.exists() {
                problems.push(format!("{shown}: {target} leads nowhere"));
            } else if !anchor.is_empty()
                && !anchors(&std::fs::read_to_string(&path).unwrap()).contains(anchor)
            {
                problems.push(format!("{shown}: {target} is no heading there"));
            }
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    assert!(n > 50, "only {n} links found");
}

#[test]
fn every_chapter_is_in_the_summary() {
    let docs = root().join("docs");
    let listed = targets(&std::fs::read_to_string(docs.join("SUMMARY.md")).unwrap());
    let listed: BTreeSet<PathBuf> = listed.iter().map(|target| docs.join(target)).collect();
    for page in pages() {
        let is_chapter = page.path.parent() == Some(&docs) || page.path.parent() == Some(&docs.join("book"));
        if is_chapter && !page.path.ends_with("SUMMARY.md") {
            assert!(listed.contains(&page.path), "{} is not in docs/SUMMARY.md", page.path.display());
        }
    }
}
