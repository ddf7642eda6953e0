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
    (
        "codegen/src/emit",
        &["dialect", "expression"],
        "a dialect spells texts, and a text knows how tightly the dialect's operators bind",
    ),
    ("codegen/src/emit/rust", &["mod", "series"], "the top has what all items of a module share"),
    (
        "codegen/src/lower",
        &["check", "classes", "form", "mod", "pivots", "source", "values"],
        "the top defines what is asked of a program, which every pass reads",
    ),
    (
        "codegen/src/mechanics",
        &["derive", "ignorable"],
        "results are evaluated at the origin of coordinates while they are derived",
    ),
    (
        "codegen/src/reduction",
        &["circle", "connection", "front_end"],
        "a derived connection reduces the model it is derived from",
    ),
    ("codegen/src/scene", &["defaults", "invariants", "mod"], "the top defines the scene that both look at"),
    (
        "runtime/src/integrator",
        &["dense", "mod"],
        "dense output is a part of the integrator in a file of its own",
    ),
];

/// Files that are too long: the file, why.
pub(super) const LONG_FILES: &[(&str, &str)] = &[
    ("codegen/src/explain.rs", "not cut yet: sections, columns of text and marks of a page"),
    (
        "codegen/src/mechanics/derive.rs",
        "not cut yet: data, momenta, constrained equations, multipliers, results",
    ),
    ("codegen/src/program/series.rs", "not cut yet: recurrences and their checks"),
    ("codegen/src/reduction/front_end.rs", "not cut yet: rewrites and the algebroid"),
    ("codegen/src/scene.rs", "not cut yet: plan, build, wants, requests, interpreter"),
];

/// Files whose long lines have not been broken yet: `cargo xtask tidy --wrap` breaks them.
pub(super) const NOT_WRAPPED: &[&str] = &[];

/// Whether a program writes a file, which then has the lines that the program makes.
pub(super) fn written_by_programs(file: &Path) -> bool {
    // Reports of measurements.
    file.starts_with("docs/benchmarks") || file == Path::new("docs/stress.md")
}
