//! The files that rules are about, and how a broken rule is shown.
//!
//! Does not know: the rules.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use hamel_run::Error;

/// Longest file, tests and tables excepted.
pub(super) const MAX_LINES: usize = 700;
/// Longest line.
pub(super) const MAX_COLUMNS: usize = 120;

/// One broken rule: where, and what to change.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Problem {
    pub(super) file: PathBuf,
    pub(super) line: usize,
    pub(super) message: String,
}

impl Problem {
    pub(super) fn new(file: &Path, line: usize, message: impl Into<String>) -> Problem {
        Problem { file: file.to_owned(), line, message: message.into() }
    }
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}: {}", self.file.display(), self.line, self.message)
    }
}

/// A source file by its path from the root of the repository.
pub(super) struct Source {
    pub(super) path: PathBuf,
    pub(super) text: String,
}

impl Source {
    /// Whether everything in the file is a test, or serves tests.
    pub(super) fn is_test(&self) -> bool {
        let name = self.path.file_stem().unwrap_or_default().to_string_lossy();
        self.path.iter().any(|part| part == "tests") || name == "tests" || name.ends_with("_tests")
    }

    pub(super) fn is_in(&self, folder: &str) -> bool {
        self.path.starts_with(folder)
    }

    pub(super) fn has_extension(&self, extension: &str) -> bool {
        self.path.extension().is_some_and(|found| found == extension)
    }
}

/// All Rust and Markdown files that git knows or would add, without generated modules.
pub(super) fn sources(root: &Path) -> Result<Vec<Source>, Error> {
    let listed = Command::new("git")
        .args(["ls-files", "--cached", "--others", "--exclude-standard", "--", "*.rs", "*.md"])
        .current_dir(root)
        .output()
        .map_err(|e| Error::io("git could not be started", e))?;
    let names: BTreeSet<&Path> =
        std::str::from_utf8(&listed.stdout).unwrap_or_default().lines().map(Path::new).collect();
    let mut sources = Vec::new();
    let generated = ["models/src/generated", "xtask/bench/src/generated"];
    for name in names.into_iter().filter(|name| !generated.iter().any(|folder| name.starts_with(folder))) {
        // A file that was removed is listed until that is committed.
        if let Ok(text) = std::fs::read_to_string(root.join(name)) {
            sources.push(Source { path: name.to_owned(), text });
        }
    }
    Ok(sources)
}
