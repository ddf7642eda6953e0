//! Exceptions from the rules, each with its reason.
//!
//! Does not know: how the rules are checked.

use std::path::Path;

/// Files of a folder that use each other: the folder, the files, why.
pub(super) const CIRCLES: &[(&str, &[&str], &str)] = &[];

/// Files that are too long: the file, why.
pub(super) const LONG_FILES: &[(&str, &str)] = &[];

/// Whether a program writes a file, which then has the lines that the program makes.
pub(super) fn written_by_programs(file: &Path) -> bool {
    // Reports of measurements.
    file.starts_with("docs/benchmarks") || file == Path::new("docs/stress.md")
}
