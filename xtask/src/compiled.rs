//! The compiled models in another process: how it is started, and what the two say to each other.
//!
//! One JSON value a line in both directions. The process first says its name and version; then each request gets one
//! answer, a `Result`. Its standard error is the user's, so that progress bars appear.
//!
//! Deliberately does not know: generated code. The other side is [`serve`], run by `hamel-compiled`.

use std::io::{BufRead, BufReader, IsTerminal as _, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::backend::{Backend, simulate_with_bar};
use crate::dynamics::{Factory, Info};
use crate::ensemble::{EnsembleRequest, Member, integrate};
use crate::error::{Error, WireError};
use crate::eval::{EvalRequest, EvalResponse, eval};
use crate::simulate::{SimulateRequest, SimulateResponse};
use crate::workspace::Workspace;

/// Name of the package and program with the compiled models.
const PACKAGE: &str = "hamel-compiled";

/// First line of the process.
#[derive(Debug, Serialize, Deserialize)]
struct Hello {
    program: String,
    version: String,
}

/// A request to the process.
#[derive(Debug, Serialize, Deserialize)]
enum Ask {
    /// Choose a scene; the answer is an [`Opened`].
    Open { model: String, scene: String },
    /// Evaluate the chosen scene.
    Eval(EvalRequest),
    /// Integrate the chosen scene.
    Simulate(SimulateRequest),
    /// Integrate the chosen scene many times.
    Ensemble(EnsembleRequest),
}

/// What became of [`Ask::Open`].
#[derive(Debug, Serialize, Deserialize)]
enum Opened {
    Scene(Info),
    NoModel { known: Vec<String> },
    NoScene { known: Vec<String> },
}

type Answer<T> = Result<T, WireError>;

/// A compiled scene in another process.
#[derive(Debug)]
pub struct Remote {
    info: Info,
    process: Process,
}

impl Remote {
    /// Starts the process and chooses a scene.
    ///
    /// # Errors
    /// [`Error::NotCompiled`] when the program does not build or lacks the scene, [`Error::UnknownScene`].
    pub fn open(workspace: &Workspace, model: &str, scene: &str) -> Result<Remote, Error> {
        let mut process = Process::start(workspace, model)?;
        let opened: Answer<Opened> =
            process.ask(&Ask::Open { model: model.to_owned(), scene: scene.to_owned() })?;
        match opened? {
            Opened::Scene(info) => Ok(Remote { info, process }),
            Opened::NoModel { known } => Err(Error::NotCompiled {
                what: format!("model {model}"),
                reason: if known.is_empty() {
                    "no model has been generated".into()
                } else {
                    format!("only these have been generated: {}", known.join(", "))
                },
            }),
            Opened::NoScene { known } => {
                Err(Error::UnknownScene { model: model.to_owned(), name: scene.to_owned(), known })
            }
        }
    }
}

impl Backend for Remote {
    fn info(&self) -> &Info {
        &self.info
    }

    fn eval(&mut self, request: &EvalRequest) -> Result<EvalResponse, Error> {
        let answer: Answer<EvalResponse> = self.process.ask(&Ask::Eval(request.clone()))?;
        Ok(answer?)
    }

    fn simulate(&mut self, request: &SimulateRequest) -> Result<SimulateResponse, Error> {
        // JSON has no infinity, and what is too large is not worth sending.
        request.validate(&self.info)?;
        let answer: Answer<SimulateResponse> = self.process.ask(&Ask::Simulate(request.clone()))?;
        Ok(answer?)
    }

    fn ensemble(&mut self, request: &EnsembleRequest) -> Result<Vec<Member>, Error> {
        request.options()?;
        let answer: Answer<Vec<Member>> = self.process.ask(&Ask::Ensemble(request.clone()))?;
        Ok(answer?)
    }
}

#[derive(Debug)]
struct Process {
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: BufReader<ChildStdout>,
    model: String,
}

impl Process {
    fn start(workspace: &Workspace, model: &str) -> Result<Process, Error> {
        let program = build(workspace, model)?;
        let mut command = Command::new(&program);
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let started = command.spawn();
        let mut child = started.map_err(|e| Error::io(program.display().to_string(), e))?;
        // Both were asked for above.
        let stdin = child.stdin.take().expect("piped standard input");
        let stdout = BufReader::new(child.stdout.take().expect("piped standard output"));
        let mut process = Process { child, stdin: Some(stdin), stdout, model: model.to_owned() };
        // Another program may say anything.
        let hello: Option<Hello> = process.read().ok().flatten();
        match hello {
            Some(hello) if hello.program == PACKAGE && hello.version == env!("CARGO_PKG_VERSION") => {
                Ok(process)
            }
            _ => Err(process.ended("its process does not answer")),
        }
    }

    fn ask<T: DeserializeOwned>(&mut self, ask: &Ask) -> Result<T, Error> {
        let mut line = serde_json::to_string(ask).map_err(|e| Error::io("the request", e.into()))?;
        line.push('\n');
        if let Some(stdin) = &mut self.stdin {
            let sent = stdin.write_all(line.as_bytes()).and_then(|()| stdin.flush());
            if sent.is_err() {
                return Err(self.ended("its process ended too early"));
            }
        }
        match self.read()? {
            Some(answer) => Ok(answer),
            None => Err(self.ended("its process ended without an answer")),
        }
    }

    /// One line; none at the end of the stream.
    fn read<T: DeserializeOwned>(&mut self) -> Result<Option<T>, Error> {
        let fail = |e| Error::io("the answer of the compiled models", e);
        let mut line = String::new();
        if self.stdout.read_line(&mut line).map_err(fail)? == 0 {
            return Ok(None);
        }
        serde_json::from_str(&line).map(Some).map_err(|e| fail(e.into()))
    }

    fn ended(&mut self, why: &str) -> Error {
        self.stdin = None;
        // Unread output would keep the process alive.
        let _ = std::io::copy(&mut self.stdout.by_ref().take(1 << 20), &mut std::io::sink());
        let status = match self.child.wait() {
            Ok(status) => format!("{why} ({status})"),
            Err(_) => why.to_owned(),
        };
        Error::NotCompiled { what: self.model.clone(), reason: status }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // The process ends at the end of its input.
        self.stdin = None;
        let _ = self.child.wait();
    }
}

/// Builds the program with the compiled models, which takes no time when nothing changed, and returns its path.
fn build(workspace: &Workspace, model: &str) -> Result<PathBuf, Error> {
    run_build(cargo_build(workspace, PACKAGE), PACKAGE, "building the compiled models")?.ok_or_else(|| {
        Error::NotCompiled { what: model.to_owned(), reason: "the compiled models do not build".into() }
    })
}

/// The command that builds a package of the workspace, optimised; for [`run_build`].
pub(crate) fn cargo_build(workspace: &Workspace, package: &str) -> Command {
    let mut command = Command::new(Workspace::cargo());
    command
        .args(["build", "--quiet", "--release", "--message-format", "json", "--package", package])
        .arg("--manifest-path")
        .arg(workspace.manifest())
        .stdin(Stdio::null());
    command
}

/// Runs a [`cargo_build`] and returns the path of its program, or nothing when it does not build.
///
/// What the compiler says is shown when the build fails, and is of no interest otherwise; `doing` is shown meanwhile.
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
        eprint!("{}", message["message"]["rendered"].as_str().unwrap_or_default());
    }
    eprint!("{}", String::from_utf8_lossy(&output.stderr));
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
        let thread = std::io::stderr().is_terminal().then(|| std::thread::spawn(show));
        Spinner { done, thread }
    }

    fn stop(self) {
        drop(self.done);
        if let Some(thread) = self.thread {
            let _ = thread.join();
        }
    }
}

/// Answers requests on standard input until its end: the whole of `hamel-compiled`.
///
/// `factories` are all compiled scenes.
///
/// # Errors
/// [`Error::Io`] when the other side is gone, [`Error::NotJson`] when it is not `xtask`.
pub fn serve(factories: &[Box<dyn Factory>]) -> Result<(), Error> {
    serve_on(factories, std::io::stdin().lock(), std::io::stdout().lock())
}

fn serve_on(
    factories: &[Box<dyn Factory>],
    input: impl BufRead,
    mut output: impl Write,
) -> Result<(), Error> {
    let mut say = |text: Result<String, serde_json::Error>| -> Result<(), Error> {
        let write = |text: String| writeln!(output, "{text}").and_then(|()| output.flush());
        text.map_err(std::io::Error::from).and_then(write).map_err(|e| Error::io("the answer", e))
    };
    let hello = Hello { program: PACKAGE.into(), version: env!("CARGO_PKG_VERSION").into() };
    say(serde_json::to_string(&hello))?;
    let mut chosen: Option<&dyn Factory> = None;
    for line in input.lines() {
        let line = line.map_err(|e| Error::io("the request", e))?;
        let ask: Ask = serde_json::from_str(&line)
            .map_err(|e| Error::NotJson { reason: e.to_string(), empty: line.is_empty() })?;
        let not_open = || Error::Options { reason: "no scene is open".into() };
        match ask {
            Ask::Open { model, scene } => {
                let of_model = || factories.iter().filter(|f| f.info().model == model);
                chosen = of_model().find(|f| f.info().scene == scene).map(|f| &**f);
                let opened = match chosen {
                    Some(factory) => Opened::Scene(factory.info().clone()),
                    None if of_model().next().is_none() => {
                        let mut known: Vec<String> =
                            factories.iter().map(|f| f.info().model.clone()).collect();
                        known.dedup();
                        Opened::NoModel { known }
                    }
                    None => Opened::NoScene { known: of_model().map(|f| f.info().scene.clone()).collect() },
                };
                say(serde_json::to_string(&Answer::Ok(opened)))?;
            }
            Ask::Eval(request) => {
                let answer = chosen.ok_or_else(not_open).and_then(|f| eval(f, &request));
                say(serde_json::to_string(&answer.map_err(|e| WireError::from(&e))))?;
            }
            Ask::Simulate(request) => {
                let answer = chosen.ok_or_else(not_open).and_then(|f| simulate_with_bar(f, &request));
                say(serde_json::to_string(&answer.map_err(|e| WireError::from(&e))))?;
            }
            Ask::Ensemble(request) => {
                let answer = chosen.ok_or_else(not_open).and_then(|f| integrate(f, &request));
                say(serde_json::to_string(&answer.map_err(|e| WireError::from(&e))))?;
            }
        }
    }
    Ok(())
}
