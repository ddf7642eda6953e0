//! Exceptions from the rules, each with its reason.
//!
//! Does not know: how the rules are checked.

use std::path::Path;

/// Files of a folder that use each other: the folder, the files, why.
pub(super) const CIRCLES: &[(&str, &[&str], &str)] = &[
    (
        "cli/src/commands",
        &["completions", "man", "mod", "new"],
        "three commands are about the program whose arguments the top defines",
    ),
    ("codegen/src/emit/rust", &["mod", "series"], "the top has what all items of a module share"),
    (
        "codegen/src/lower",
        &["check", "classes", "form", "mod", "pivots", "source", "values"],
        "the top defines what is asked of a program, which every pass reads",
    ),
    (
        "codegen/src/mechanics",
        &["constrained", "derive"],
        "constrained systems are a step of the derivation, in a file of its own",
    ),
    (
        "codegen/src/reduction",
        &["circle", "constraint", "domain", "system"],
        "a system has what its rewrites leave in it",
    ),
    (
        "codegen/src/scene",
        &["build", "defaults", "interpreter", "invariants", "mod", "pivots", "plan"],
        "the top defines the scene that all parts look at",
    ),
    (
        "runtime/src/integrator",
        &["dense", "mod"],
        "dense output is a part of the integrator in a file of its own",
    ),
];

/// Files that are too long: the file, why.
pub(super) const LONG_FILES: &[(&str, &str)] = &[
    ("codegen/src/explain.rs", "not cut yet: sections, columns of text and marks of a page"),
    ("codegen/src/program/series.rs", "not cut yet: recurrences and their checks"),
];

/// Files and folders whose long lines have not been broken yet: `cargo xtask tidy --wrap` breaks them.
pub(super) const NOT_WRAPPED: &[&str] = &[
    "CHANGELOG.md",
    "README.md",
    "adapters",
    "cli",
    "codegen/build.rs",
    "codegen/src/config",
    "codegen/src/explain.rs",
    "codegen/src/lower",
    "codegen/src/mechanics",
    "codegen/src/program",
    "codegen/src/reduction",
    "codegen/src/scene",
    "docs/README.md",
    "docs/book",
    "docs/build-rs.md",
    "docs/command-line.md",
    "docs/ensembles.md",
    "docs/errata.md",
    "ensemble",
    "fuzz",
    "models",
    "runtime",
    "tests",
    "xtask/bench",
    "xtask/compiled",
    "xtask/src/bench",
    "xtask/src/main.rs",
    "xtask/stress",
];

/// Whether a program writes a file, which then has the lines that the program makes.
pub(super) fn written_by_programs(file: &Path) -> bool {
    // Reports of measurements, and what is put into one as it is.
    let reports = ["docs/stress.md", "xtask/stress/src/findings.md"];
    file.starts_with("docs/benchmarks") || reports.iter().any(|report| file == Path::new(report))
}
