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
        "codegen/program/src/emit/rust",
        &["loops", "mod", "series"],
        "the top has what all items of a module share",
    ),
    (
        "codegen/src/symmetry",
        &["angles", "group", "marked", "search", "setting"],
        "parts of one `Setting`: its ansatz has fields that the other files define and search among",
    ),
    (
        "codegen/src/symmetry",
        &["check", "mod", "total"],
        "momenta are told in the words of the top and held to the motion where rates are",
    ),
    (
        "codegen/program/src/lower",
        &["check", "classes", "form", "mod", "pivots", "roll", "source", "values"],
        "the top defines what is asked of a program, which every pass reads",
    ),
    (
        "python/src",
        &["ensemble", "fit", "fluid", "linear", "mod", "motion", "scene", "stepper", "written"],
        "the class `Scene` has its methods in one file, and motions, fits and ensembles take a `Scene`",
    ),
    (
        "runtime/src/integrator",
        &["dense", "mod", "rest"],
        "dense output and the storage between integrations are parts of the integrator in files of their own",
    ),
    (
        "runtime/src/integrator",
        &["sampling", "telling"],
        "samples end at events, and events are told between samples",
    ),
    (
        "xtask/bench/src",
        &["mod", "naive", "wp"],
        "the list of opponents, kernels by hand, and work against precision use each other: not cut yet",
    ),
    (
        "xtask/stress/src",
        &["bounds", "report", "run"],
        "not cut yet: the results stand beside what makes them",
    ),
    (
        "runtime/src",
        &["real", "stumpff", "turn"],
        "the default of a function of scalars is computed with any scalar",
    ),
];

/// Phrases of comments, and how often they stand there.
pub(super) const PHRASES: &[(&[&str], usize)] = &[
    (&["what is", "what has", "what was", "what are", "what were"], 650),
    (&["those that", "those of"], 420),
    (&["; none"], 261),
];

/// Files that are too long: the file, why.
pub(super) const LONG_FILES: &[(&str, &str)] =
    &[("codegen/src/explain.rs", "not cut yet: sections, columns of text and marks of a page")];

/// Files and folders whose long lines have not been broken yet: `cargo xtask tidy --wrap` breaks them.
pub(super) const NOT_WRAPPED: &[&str] = &[];

/// Whether a program writes a file, which then has the lines that the program makes.
pub(super) fn written_by_programs(file: &Path) -> bool {
    // Reports of measurements, and what is put into one as it is.
    let files = ["docs/stress.md", "xtask/stress/src/findings.md"];
    file.starts_with("docs/benchmarks") || files.iter().any(|written| file == Path::new(written))
}

/// Files of tests that are programs of their own, beside the one of their crate.
pub(super) const PROGRAMS: [(&str, &str); 1] =
    [("runtime/tests/allocation.rs", "its allocator counts for a whole program")];

/// Sources whose crates have no tests in them, by their `Cargo.toml`: cargo does not compile them for that.
pub(super) const WITHOUT_TESTS: [&str; 5] =
    ["adapters/src", "ensemble/src", "models/src", "xtask/bench/src/main.rs", "xtask/stress/src"];
