//! `tidy`: rules about the source that neither rustc nor clippy knows.
//!
//! * A module of the generator uses only modules of its crate above it in the list of ARCHITECTURE.md.
//! * Files of one folder do not use each other in a circle.
//! * No file is longer than [`MAX_LINES`](source::MAX_LINES) lines.
//! * Every file of a program of tests is a module of its `main.rs`.
//! * Phrases of comments that readers stumble over become fewer, never more.
//! * Lock files beside the workspace agree with the manifests.
//! * Builds of single packages turn on the features of the whole workspace.
//! * No line is longer than [`MAX_COLUMNS`](source::MAX_COLUMNS) columns.
//!
//! Exceptions are lists in [`known`], each with its reason. An exception that nothing needs any more is a problem, too.
//!
//! Does not know: what a module does.

mod english;
mod features;
mod imports;
mod known;
mod layers;
mod lines;
mod locks;
mod programs;
mod source;

use hamel_run::Error;
use hamel_run::repository::Repository;

use source::{Problem, Source, sources};

fn problems(sources: &[Source]) -> Vec<Problem> {
    let mut problems = layers::problems(sources);
    problems.extend(lines::problems(sources));
    problems.extend(english::problems(sources));
    problems.extend(programs::problems(sources));
    problems.sort();
    problems.dedup();
    problems
}

/// Checks the rules; with `wrap`, long lines of comments and of Markdown are broken first.
///
/// # Errors
/// [`Error::Failed`] with the number of problems, which are printed.
pub(crate) fn tidy(repository: &Repository, wrap: bool) -> Result<String, Error> {
    let mut sources = sources(repository.root())?;
    let mut n_wrapped = 0;
    for source in sources.iter_mut().filter(|_| wrap) {
        let text = lines::wrapped(source);
        if text != source.text {
            let path = repository.root().join(&source.path);
            std::fs::write(&path, &text).map_err(|e| Error::io(path.display().to_string(), e))?;
            source.text = text;
            n_wrapped += 1;
        }
    }
    let mut problems = problems(&sources);
    problems.extend(locks::problems(repository.root())?);
    problems.extend(features::problems(repository.root())?);
    if problems.is_empty() {
        let wrapped = if wrap { format!(", {n_wrapped} rewritten") } else { String::new() };
        return Ok(format!("{} files are tidy{wrapped}", sources.len()));
    }
    for problem in &problems {
        eprintln!("{problem}");
    }
    Err(Error::Failed { step: "tidy".into(), status: format!("{} problems", problems.len()) })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn the_repository_is_tidy() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let sources = sources(&root).unwrap();
        assert!(sources.len() > 100, "only {} files found", sources.len());
        let problems = problems(&sources);
        let shown: Vec<String> = problems.iter().map(Problem::to_string).collect();
        assert!(problems.is_empty(), "{}\n`cargo xtask tidy` shows this", shown.join("\n"));
    }
}
