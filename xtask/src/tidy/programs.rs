//! Every test is in a program: a file of a folder `tests` is one of the modules that its `main.rs` lists, and crates
//! that cargo does not compile for their tests have none.
//!
//! Does not know: what is tested.

use super::known;
use super::source::{Problem, Source};

pub(super) fn problems(sources: &[Source]) -> Vec<Problem> {
    let mut problems = Vec::new();
    for main in sources.iter().filter(|source| source.path.ends_with("tests/main.rs")) {
        let folder = main.path.parent();
        for other in sources.iter().filter(|other| other.path.parent() == folder && other.path != main.path) {
            let name = other.path.file_stem().unwrap_or_default().to_string_lossy();
            let is_listed = main.text.lines().any(|line| line.trim() == format!("mod {name};"));
            let is_apart = known::PROGRAMS.iter().any(|(file, _)| other.path.ends_with(file));
            if other.has_extension("rs") && !is_listed && !is_apart {
                let message = format!("is compiled by nobody: add `mod {name};` to {}", main.path.display());
                problems.push(Problem::new(&other.path, 1, message));
            }
        }
    }
    for source in sources.iter().filter(|source| known::WITHOUT_TESTS.iter().any(|place| source.is_in(place)))
    {
        if let Some(line) = source.text.lines().position(|line| line.trim() == "#[test]") {
            let message = "is run by nobody: remove `test = false` from the crate's Cargo.toml, and its folder from \
                           xtask/src/tidy/known.rs";
            problems.push(Problem::new(&source.path, line + 1, message));
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tests_that_no_program_has_are_found() {
        let file = |path: &str, text: &str| Source { path: path.into(), text: text.into() };
        let sources = [
            file("jit/tests/main.rs", "//! Tests.\n\nmod inputs;\n"),
            file("jit/tests/inputs.rs", ""),
            file("jit/tests/forgotten.rs", ""),
            file("jit/tests/notes.md", ""),
            file("jit/tests/cases/deeper.rs", ""),
            file("runtime/tests/main.rs", ""),
            file("runtime/tests/allocation.rs", ""),
            file("adapters/tests/solvers.rs", ""),
            file(
                "models/src/lib.rs",
                "//! Models.\n\n#[cfg(test)]\nmod tests {\n    #[test]\n    fn t() {}\n}\n",
            ),
        ];
        let found = problems(&sources);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[1].to_string().contains("models/src/lib.rs:5: is run by nobody"), "{}", found[1]);
        assert!(
            found[0].to_string().contains("jit/tests/forgotten.rs:1: is compiled by nobody"),
            "{}",
            found[0]
        );
    }
}
