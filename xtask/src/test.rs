//! `test`: the whole test suite, then crates outside the workspace that use hamel as others do.
//!
//! Does not know: what the tests look at.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use hamel::Error;
use hamel::output::terminal::bold;
use hamel::repository::Repository;

/// Runs the whole test suite, then crates outside the workspace that use hamel as others do.
///
/// # Errors
/// [`Error::Failed`] with the step that failed; later steps are not run.
pub(crate) fn test(repository: &Repository) -> Result<String, Error> {
    let downstream = repository.root().join("tests/downstream");
    // They share one directory for what they compile: the generator above all.
    let compiled = repository.root().join("target/downstream");
    let steps: [(&str, &Path, &[&str], Option<&Path>); 4] = [
        ("cargo test --workspace", repository.root(), &["test", "--workspace"], None),
        // Apart, because the solvers of others bring much to compile.
        (
            "cargo test of the adapters",
            repository.root(),
            &["test", "--package", "hamel-adapters", "--all-features"],
            None,
        ),
        ("cargo test in tests/downstream", &downstream, &["test", "--locked"], Some(&compiled)),
        (
            "cargo run in tests/downstream_no_std",
            &downstream,
            &["run", "--locked", "--package", "hamel-downstream-no-std"],
            Some(&compiled),
        ),
    ];
    let mut lines = Vec::new();
    for (name, folder, arguments, target) in steps {
        eprintln!("{}", bold(&format!("running {name}")));
        let clock = Instant::now();
        let mut command = Command::new(Repository::cargo());
        command.args(arguments).current_dir(folder);
        command.envs(target.map(|target| ("CARGO_TARGET_DIR", target)));
        let status = command.status().map_err(|e| Error::io("cargo could not be started", e))?;
        if !status.success() {
            let status = format!("{status}; the steps before it passed, later ones were not run");
            return Err(Error::Failed { step: name.into(), status });
        }
        lines.push(format!("passed  {name}  ({:.1} s)", clock.elapsed().as_secs_f64()));
    }
    Ok(lines.join("\n"))
}
