//! Programs and libraries of the repository, built by cargo.
//!
//! Does not know: what is built.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use hamel_run::Error;
use hamel_run::repository::Repository;
use hamel_run::streams::tell;

/// How much the compiler optimises what is built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Profile {
    /// As this program was, so that both share what they depend on.
    OfThisProgram,
    /// Fully: what is built measures times, or runs for long.
    Release,
}

/// The command that builds a package of the workspace with a program or library of the same name; for [`run_build`].
pub(crate) fn cargo_build(repository: &Repository, package: &str, profile: Profile) -> Command {
    let mut command = Command::new(Repository::cargo());
    if profile == Profile::OfThisProgram && cfg!(debug_assertions) {
        // With the features of the whole workspace, as its tests are built.
        command.args(["build", "--workspace", "--bin", package]);
    } else {
        command.args(["build", "--release", "--package", package]);
    }
    command
        .args(["--quiet", "--message-format", "json"])
        .arg("--manifest-path")
        .arg(repository.manifest())
        .stdin(Stdio::null());
    command
}

/// Runs a [`cargo_build`] and returns the path of its program, or nothing when it does not build.
///
/// What the compiler says is shown when the build fails, and is of no interest otherwise; `doing` is shown meanwhile.
///
/// # Errors
/// [`Error::Io`] when cargo cannot be started.
pub(crate) fn run_build(
    command: Command,
    program: &str,
    doing: &'static str,
) -> Result<Option<PathBuf>, Error> {
    run_build_of(command, doing, |message| {
        let is_program = message["target"]["name"] == program;
        message["executable"].as_str().filter(|_| is_program).map(PathBuf::from)
    })
}

/// As [`run_build`] for a library: the path of what other crates are linked with.
///
/// # Errors
/// As [`run_build`].
pub(crate) fn run_library_build(
    command: Command,
    library: &str,
    doing: &'static str,
) -> Result<Option<PathBuf>, Error> {
    run_build_of(command, doing, |message| {
        let is_library = message["target"]["name"] == library;
        let files = message["filenames"].as_array().filter(|_| is_library)?;
        files.iter().filter_map(|f| f.as_str()).find(|f| f.ends_with(".rlib")).map(PathBuf::from)
    })
}

fn run_build_of(
    mut command: Command,
    doing: &'static str,
    product: impl Fn(&serde_json::Value) -> Option<PathBuf>,
) -> Result<Option<PathBuf>, Error> {
    let spinner = Spinner::start(doing);
    let output = command.output();
    spinner.stop();
    let output = output.map_err(|e| Error::io("cargo could not be started", e))?;
    let messages: Vec<serde_json::Value> =
        output.stdout.split(|b| *b == b'\n').filter_map(|line| serde_json::from_slice(line).ok()).collect();
    let path = messages.iter().find_map(product);
    if output.status.success() && path.is_some() {
        return Ok(path);
    }
    for message in messages.iter().filter(|m| m["message"]["level"] == "error") {
        tell(message["message"]["rendered"].as_str().unwrap_or_default().trim_end());
    }
    tell(String::from_utf8_lossy(&output.stderr).trim_end());
    Ok(None)
}

/// Says what is being built, when that takes long and somebody watches.
struct Spinner {
    done: std::sync::mpsc::Sender<()>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Spinner {
    fn start(doing: &'static str) -> Spinner {
        let (done, wait) = std::sync::mpsc::channel::<()>();
        let show = move || {
            let ended = |r| !matches!(r, Err(std::sync::mpsc::RecvTimeoutError::Timeout));
            if ended(wait.recv_timeout(Duration::from_millis(1500))) {
                return;
            }
            let bar = ProgressBar::new_spinner();
            // The template is a constant that indicatif accepts.
            bar.set_style(
                ProgressStyle::with_template("  {spinner} {msg} {elapsed}").expect("valid template"),
            );
            bar.set_message(doing);
            while !ended(wait.recv_timeout(Duration::from_millis(120))) {
                bar.tick();
            }
            bar.finish_and_clear();
        };
        let thread = hamel_run::signs::are_shown().then(|| std::thread::spawn(show));
        Spinner { done, thread }
    }

    fn stop(self) {
        drop(self.done);
        if let Some(thread) = self.thread {
            let _ = thread.join();
        }
    }
}
