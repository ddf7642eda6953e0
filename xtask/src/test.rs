//! `test`: the whole test suite, then crates outside the workspace that use hamel as others do.
//!
//! Does not know: what the tests look at.

use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::time::Instant;

use hamel::output::terminal::bold;
use hamel_run::Error;
use hamel_run::repository::Repository;
use serde::Deserialize;

/// So many programs of tests run at a time: the last test of one, which is often its longest, leaves no core idle.
const SIDE_BY_SIDE: usize = 2;

/// One step of the suite.
struct Step<'a> {
    name: &'a str,
    folder: &'a Path,
    /// What cargo is told.
    arguments: &'a [&'a str],
    /// Where what is compiled goes, if not to the folder of the workspace.
    target: Option<&'a Path>,
}

/// Runs the whole test suite, then crates outside the workspace that use hamel as others do.
///
/// # Errors
/// [`Error::Failed`] with the step that failed; later steps are not run.
pub(crate) fn test(repository: &Repository) -> Result<String, Error> {
    let downstream = repository.root().join("tests/downstream");
    // They share one directory for what they compile: the generator above all.
    let compiled = repository.root().join("target/downstream");
    let (root, target) = (repository.root(), Some(compiled.as_path()));
    let programs = "tests of the workspace";
    let mut passed = vec![timed(programs, || run_side_by_side(root, programs))?];
    let steps = [
        Step {
            name: "cargo test --workspace --doc",
            folder: root,
            arguments: &["test", "--workspace", "--doc"],
            target: None,
        },
        // Apart, because the solvers of others bring much to compile; none of them has to be fast here.
        Step {
            name: "cargo test of the adapters",
            folder: root,
            arguments: &[
                "test",
                "--package",
                "hamel-adapters",
                "--all-features",
                "--config",
                "profile.dev.package.\"*\".opt-level=0",
            ],
            target: None,
        },
        Step {
            name: "cargo test in tests/downstream",
            folder: &downstream,
            arguments: &["test", "--locked"],
            target,
        },
        Step {
            name: "cargo run in tests/downstream_no_std",
            folder: &downstream,
            arguments: &["run", "--locked", "--package", "hamel-downstream-no-std"],
            target,
        },
    ];
    for step in &steps {
        passed.push(timed(step.name, || {
            let mut command = Command::new(Repository::cargo());
            command.args(step.arguments).current_dir(step.folder);
            command.envs(step.target.map(|target| ("CARGO_TARGET_DIR", target)));
            let status = command.status().map_err(|e| Error::io("cargo could not be started", e))?;
            succeeded(step.name, status)
        })?);
    }
    Ok(passed.join("\n"))
}

/// Runs a step; a line that tells how long it took.
fn timed(name: &str, step: impl FnOnce() -> Result<(), Error>) -> Result<String, Error> {
    eprintln!("{}", bold(&format!("running {name}")));
    let clock = Instant::now();
    step()?;
    Ok(format!("passed  {name}  ({:.1} s)", clock.elapsed().as_secs_f64()))
}

fn succeeded(step: &str, status: ExitStatus) -> Result<(), Error> {
    if status.success() { Ok(()) } else { Err(failed(step, &status.to_string())) }
}

fn failed(step: &str, status: &str) -> Error {
    let status = format!("{status}; the steps before it passed, later ones were not run");
    Error::Failed { step: step.into(), status }
}

/// What cargo says about something that it has compiled.
#[derive(Deserialize)]
struct Artifact {
    manifest_path: PathBuf,
    target: Target,
    profile: ArtifactProfile,
    executable: Option<PathBuf>,
}

#[derive(Deserialize)]
struct Target {
    name: String,
}

#[derive(Deserialize)]
struct ArtifactProfile {
    test: bool,
}

/// A program made of tests.
#[derive(Debug, PartialEq)]
struct Tests {
    /// Of the package and the program.
    name: String,
    /// Of the package: where cargo runs its tests.
    folder: PathBuf,
    executable: PathBuf,
}

impl Tests {
    /// From a line of `cargo test --message-format json`; nothing where it tells something else.
    fn told(line: &[u8]) -> Option<Tests> {
        let artifact: Artifact = serde_json::from_slice(line).ok()?;
        let executable = artifact.executable.filter(|_| artifact.profile.test)?;
        let folder = artifact.manifest_path.parent()?.to_path_buf();
        let package = folder.file_name()?.to_string_lossy().into_owned();
        Some(Tests { name: format!("{package} {}", artifact.target.name), folder, executable })
    }

    /// Runs the program as cargo would, and shows what it says when it is through: one line if its tests pass.
    fn run(&self) -> Result<bool, Error> {
        let clock = Instant::now();
        let mut command = Command::new(&self.executable);
        command.current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder);
        command.env("CARGO", Repository::cargo()).stdin(Stdio::null());
        let output = command.output().map_err(|e| Error::io(self.executable.display().to_string(), e))?;
        let said = String::from_utf8_lossy(&output.stdout);
        if output.status.success() {
            let result = said.lines().rfind(|line| line.starts_with("test result: ")).unwrap_or("no tests");
            let result = result.split_once("; finished").map_or(result, |(counts, _)| counts);
            eprintln!("{}: {result} ({:.1} s)", self.name, clock.elapsed().as_secs_f64());
        } else {
            let errors = String::from_utf8_lossy(&output.stderr);
            eprintln!("{}\n{said}{errors}{}: {}", bold(&self.name), self.name, output.status);
        }
        Ok(output.status.success())
    }
}

/// Builds the tests of the workspace and runs their programs, [`SIDE_BY_SIDE`] at a time, where cargo runs one after
/// the other. All of them are run, whichever fail.
fn run_side_by_side(root: &Path, step: &str) -> Result<(), Error> {
    let mut command = Command::new(Repository::cargo());
    command.args(["test", "--workspace", "--no-run", "--message-format", "json-render-diagnostics"]);
    let mut build = (command.current_dir(root).stdout(Stdio::piped()).spawn())
        .map_err(|e| Error::io("cargo could not be started", e))?;
    let lines = BufReader::new(build.stdout.take().expect("a pipe"));
    let lines: Result<Vec<Vec<u8>>, _> = std::io::BufRead::split(lines, b'\n').collect();
    let lines = lines.map_err(|e| Error::io("what cargo says", e))?;
    succeeded(step, build.wait().map_err(|e| Error::io("cargo", e))?)?;
    let mut programs: Vec<Tests> = lines.iter().filter_map(|line| Tests::told(line)).collect();
    programs.sort_by(|a, b| b.name.cmp(&a.name));
    if programs.is_empty() {
        return Err(failed(step, "cargo tells of no tests"));
    }
    let (waiting, broken) = (Mutex::new(programs), Mutex::new(Vec::new()));
    let next = || waiting.lock().ok().and_then(|mut waiting| waiting.pop());
    let work = || -> Result<(), Error> {
        while let Some(tests) = next() {
            if !tests.run()?
                && let Ok(mut broken) = broken.lock()
            {
                broken.push(tests.name);
            }
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let workers = [(); SIDE_BY_SIDE].map(|()| scope.spawn(work));
        workers.into_iter().try_for_each(|worker| worker.join().expect("a thread without panics"))
    })?;
    let broken = broken.into_inner().unwrap_or_default();
    if broken.is_empty() { Ok(()) } else { Err(failed(step, &format!("failed: {}", broken.join(", ")))) }
}

#[cfg(test)]
mod tests {
    use super::Tests;

    #[test]
    fn programs_of_tests_are_told_from_others() {
        let line = |executable: &str, test: bool| {
            format!(
                "{{\"reason\":\"compiler-artifact\",\"manifest_path\":\"/hamel/jit/Cargo.toml\",\
                 \"target\":{{\"kind\":[\"test\"],\"name\":\"inputs\"}},\"profile\":{{\"test\":{test}}},\
                 \"executable\":{executable}}}"
            )
        };
        let found = Tests::told(line("\"/hamel/target/inputs\"", true).as_bytes()).expect("tests");
        assert_eq!(found.name, "jit inputs");
        assert_eq!(found.folder, std::path::Path::new("/hamel/jit"));
        assert_eq!(found.executable, std::path::Path::new("/hamel/target/inputs"));
        // A library, an example, and the last line.
        assert_eq!(Tests::told(line("null", true).as_bytes()), None);
        assert_eq!(Tests::told(line("\"/hamel/target/example\"", false).as_bytes()), None);
        assert_eq!(Tests::told(b"{\"reason\":\"build-finished\",\"success\":true}"), None);
    }
}
