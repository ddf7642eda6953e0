//! `test`: the whole test suite, then crates outside the workspace that use hamel as others do.
//!
//! Does not know: what the tests look at.

use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitStatus, Output, Stdio};
use std::sync::Mutex;
use std::time::Instant;

use clap::Args;
use hamel::output::terminal::bold;
use hamel_run::Error;
use hamel_run::repository::Repository;
use serde::Deserialize;

/// So many processes of tests run at a time: the last test of one, which is often its longest, leaves no core idle.
const SIDE_BY_SIDE: usize = 2;

/// So many tests are told with their times.
const N_SLOWEST: usize = 10;

/// What tests look for in their environment: more random draws, and whether every model is taken where a few stand for
/// all. Tests that are long as a whole are marked `ignore`.
const ALL: [(&str, &str); 4] = [
    ("HAMEL_TEST_ALL", "1"),
    ("HAMEL_RANDOM_MODELS", "200"),
    ("HAMEL_CHAINS", "200"),
    ("PROPTEST_CASES", "1000"),
];

/// What cargo builds of the workspace: everything that has tests. Examples take 90 s of CPU to compile, and no test
/// runs them: `cargo clippy --all-targets` checks their types, and they are built at length alone.
const TARGETS: &str = "--tests";

/// Where cargo-nextest writes its report, by `.config/nextest.toml`.
const REPORT: &str = "target/nextest/default/junit.xml";

/// Run the whole test suite: the workspace, then crates that use hamel as others do
///
/// cargo-nextest runs the tests of the workspace where it is installed; otherwise their programs run two at a time.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  cargo xtask test
  cargo xtask test --timings
  cargo xtask test --all          what .ci/nightly runs")]
pub(crate) struct Arguments {
    /// Also what takes long: more random draws, every model where a few stand for all, and the examples
    #[arg(long)]
    all: bool,
    /// Print the ten slowest tests of the workspace; without cargo-nextest every test is a process of its own then
    #[arg(long)]
    timings: bool,
}

impl Arguments {
    /// What tests are told; what the environment has already stays.
    fn environment(&self) -> impl Iterator<Item = (&'static str, &'static str)> {
        let is_free = |(name, _): &(&str, &str)| std::env::var_os(name).is_none();
        ALL.into_iter().filter(move |_| self.all).filter(is_free)
    }
}

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
pub(crate) fn test(repository: &Repository, arguments: &Arguments) -> Result<String, Error> {
    let downstream = repository.root().join("tests/downstream");
    // The last two share one directory for what they compile: the generator above all. The adapters share nothing with
    // the workspace, and `.ci/run` compiles them beside it.
    let compiled = repository.root().join("target/downstream");
    let adapters = repository.root().join("target/adapters");
    let (root, target) = (repository.root(), Some(compiled.as_path()));
    let programs = "tests of the workspace";
    let mut slowest = Vec::new();
    let mut passed = vec![timed(programs, || {
        slowest = match has_nextest() {
            true => by_nextest(root, programs, arguments)?,
            false => side_by_side(root, programs, arguments)?,
        };
        Ok(())
    })?];
    let examples = Step {
        name: "cargo build --workspace --examples",
        folder: root,
        arguments: &["build", "--workspace", "--examples"],
        target: None,
    };
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
            target: Some(&adapters),
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
    for step in arguments.all.then_some(&examples).into_iter().chain(&steps) {
        passed.push(timed(step.name, || {
            let mut command = cargo(arguments);
            command.args(step.arguments).current_dir(step.folder);
            command.envs(step.target.map(|target| ("CARGO_TARGET_DIR", target)));
            let status = command.status().map_err(|e| Error::io("cargo could not be started", e))?;
            succeeded(step.name, status)
        })?);
    }
    if arguments.timings {
        passed.push(told(slowest));
    }
    Ok(passed.join("\n"))
}

/// A call of cargo whose tests know what was asked for.
fn cargo(arguments: &Arguments) -> Command {
    let mut command = Command::new(Repository::cargo());
    command.envs(arguments.environment());
    command
}

/// The slowest of some tests, for people.
fn told(mut tests: Vec<(String, f64)>) -> String {
    tests.sort_by(|a, b| b.1.total_cmp(&a.1));
    let lines = tests.iter().take(N_SLOWEST).map(|(name, seconds)| format!("\n{seconds:7.1} s  {name}"));
    format!("{}{}", bold("the slowest tests"), lines.collect::<String>())
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

fn has_nextest() -> bool {
    let asked = Command::new(Repository::cargo()).args(["nextest", "--version"]).output();
    asked.is_ok_and(|out| out.status.success())
}

/// Has cargo-nextest build and run the tests of the workspace, and reads the time of each from its report.
fn by_nextest(root: &Path, step: &str, arguments: &Arguments) -> Result<Vec<(String, f64)>, Error> {
    let mut command = cargo(arguments);
    command.args(["nextest", "run", "--workspace", TARGETS]).current_dir(root);
    command.args(arguments.all.then_some(["--run-ignored", "all"]).into_iter().flatten());
    succeeded(step, command.status().map_err(|e| Error::io("cargo could not be started", e))?)?;
    let report = root.join(REPORT);
    let text = std::fs::read_to_string(&report).map_err(|e| Error::io(report.display().to_string(), e))?;
    let times: Vec<(String, f64)> = text.lines().filter_map(time_of).collect();
    if times.is_empty() { Err(failed(step, "cargo-nextest tells of no tests")) } else { Ok(times) }
}

/// Name and time of a test in a line of a report in the form of JUnit.
fn time_of(line: &str) -> Option<(String, f64)> {
    let attribute = |name: &str| -> Option<&str> {
        let (_, rest) = line.split_once(&format!(" {name}=\""))?;
        Some(rest.split_once('"')?.0)
    };
    line.trim_start().strip_prefix("<testcase ")?;
    let (name, program) = (attribute("name")?, attribute("classname")?);
    Some((format!("{program} {name}"), attribute("time")?.parse().ok()?))
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

    /// A call of the program as cargo would make it.
    fn command(&self) -> Command {
        let mut command = Command::new(&self.executable);
        command.current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder);
        command.env("CARGO", Repository::cargo()).stdin(Stdio::null());
        command
    }

    fn output(&self, command: &mut Command) -> Result<Output, Error> {
        command.output().map_err(|e| Error::io(self.executable.display().to_string(), e))
    }

    /// The names of its tests.
    fn names(&self) -> Result<Vec<String>, Error> {
        let listed = self.output(self.command().args(["--list", "--format", "terse"]))?;
        let listed = String::from_utf8_lossy(&listed.stdout);
        Ok(listed.lines().filter_map(|line| line.strip_suffix(": test").map(str::to_owned)).collect())
    }
}

/// One process: all tests of a program, or one of them.
struct Job<'a> {
    tests: &'a Tests,
    only: Option<String>,
}

impl Job<'_> {
    fn name(&self) -> String {
        format!("{}{}", self.tests.name, self.only.iter().map(|only| format!(" {only}")).collect::<String>())
    }

    /// Runs the tests, and shows what they say when they are through: one line of a program whose tests pass, nothing
    /// of a test that passes.
    fn run(&self, arguments: &Arguments) -> Result<(bool, f64), Error> {
        let clock = Instant::now();
        let mut command = self.tests.command();
        command.envs(arguments.environment());
        command.args(self.only.iter().flat_map(|only| ["--exact", only]));
        command.args(arguments.all.then_some("--include-ignored"));
        let output = self.tests.output(&mut command)?;
        let (name, seconds) = (self.name(), clock.elapsed().as_secs_f64());
        let said = String::from_utf8_lossy(&output.stdout);
        if !output.status.success() {
            let errors = String::from_utf8_lossy(&output.stderr);
            eprintln!("{}\n{said}{errors}{name}: {}", bold(&name), output.status);
        } else if self.only.is_none() {
            let result = said.lines().rfind(|line| line.starts_with("test result: ")).unwrap_or("no tests");
            let result = result.split_once("; finished").map_or(result, |(counts, _)| counts);
            eprintln!("{name}: {result} ({seconds:.1} s)");
        }
        Ok((output.status.success(), seconds))
    }
}

/// Builds the tests of the workspace and runs their programs, [`SIDE_BY_SIDE`] at a time, where cargo runs one after
/// the other. All of them are run, whichever fail. Stable Rust does not tell the time of a test in a program: to be
/// timed, each runs as a process of its own.
fn side_by_side(root: &Path, step: &str, arguments: &Arguments) -> Result<Vec<(String, f64)>, Error> {
    let mut command = cargo(arguments);
    command.args(["test", "--workspace", TARGETS, "--no-run", "--message-format", "json-render-diagnostics"]);
    let mut build = (command.current_dir(root).stdout(Stdio::piped()).spawn())
        .map_err(|e| Error::io("cargo could not be started", e))?;
    let lines = BufReader::new(build.stdout.take().expect("a pipe"));
    let lines: Result<Vec<Vec<u8>>, _> = std::io::BufRead::split(lines, b'\n').collect();
    let lines = lines.map_err(|e| Error::io("what cargo says", e))?;
    succeeded(step, build.wait().map_err(|e| Error::io("cargo", e))?)?;
    let mut programs: Vec<Tests> = lines.iter().filter_map(|line| Tests::told(line)).collect();
    programs.sort_by(|a, b| b.name.cmp(&a.name));
    let mut jobs = Vec::new();
    for tests in &programs {
        match arguments.timings {
            true => jobs.extend(tests.names()?.into_iter().map(|name| Job { tests, only: Some(name) })),
            false => jobs.push(Job { tests, only: None }),
        }
    }
    if jobs.is_empty() {
        return Err(failed(step, "cargo tells of no tests"));
    }
    let (waiting, broken, times) = (Mutex::new(jobs), Mutex::new(Vec::new()), Mutex::new(Vec::new()));
    let next = || waiting.lock().ok().and_then(|mut waiting| waiting.pop());
    let work = || -> Result<(), Error> {
        while let Some(job) = next() {
            let (has_passed, seconds) = job.run(arguments)?;
            if !has_passed && let Ok(mut broken) = broken.lock() {
                broken.push(job.name());
            }
            if let Ok(mut times) = times.lock() {
                times.push((job.name(), seconds));
            }
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let workers = [(); SIDE_BY_SIDE].map(|()| scope.spawn(work));
        workers.into_iter().try_for_each(|worker| worker.join().expect("a thread without panics"))
    })?;
    let broken = broken.into_inner().unwrap_or_default();
    if !broken.is_empty() {
        return Err(failed(step, &format!("failed: {}", broken.join(", "))));
    }
    Ok(times.into_inner().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::{Tests, time_of, told};

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

    #[test]
    fn times_are_read_from_a_report() {
        let line = "        <testcase name=\"shelf::bodies\" classname=\"hamel-tests::main\" \
                    timestamp=\"2026-11-25T19:00:00.000+00:00\" time=\"12.345\">";
        assert_eq!(time_of(line), Some(("hamel-tests::main shelf::bodies".to_owned(), 12.345)));
        assert_eq!(time_of("    <testsuite name=\"hamel-tests::main\" tests=\"2\" time=\"1.0\">"), None);
    }

    #[test]
    fn the_slowest_are_told_first_and_no_more_than_ten() {
        let tests = (0..12).map(|k| (format!("t{k}"), f64::from(k))).collect();
        let text = told(tests);
        let names: Vec<&str> = text.lines().skip(1).filter_map(|line| line.split(' ').next_back()).collect();
        assert_eq!(names, ["t11", "t10", "t9", "t8", "t7", "t6", "t5", "t4", "t3", "t2"]);
    }
}
