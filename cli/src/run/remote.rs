//! A compiled scene in another process: how the process is started, and requests to it.
//!
//! Does not know: generated code. The other side is [`serve`](super::protocol::serve), run by `hamel-compiled`.

use std::io::{BufRead, BufReader, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde::de::DeserializeOwned;

use super::backend::Backend;
use super::cargo;
use super::ensemble::{EnsembleRequest, Member};
use super::evaluate::{EvalRequest, EvalResponse};
use super::fit::{FitRequest, FitResponse};
use super::info::Info;
use super::protocol::{Answer, Ask, Hello, Opened, PACKAGE};
use super::simulation::{SimulateRequest, SimulateResponse};
use crate::error::Error;
use crate::repository::Repository;

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
    pub fn open(repository: &Repository, model: &str, scene: &str) -> Result<Remote, Error> {
        let mut process = Process::start(repository, model)?;
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

    fn is_here(&self) -> bool {
        false
    }

    fn eval(&mut self, request: &EvalRequest) -> Result<EvalResponse, Error> {
        let answer: Answer<EvalResponse> = self.process.ask(&Ask::Eval(request.clone()))?;
        Ok(answer?)
    }

    fn simulate(&mut self, request: &SimulateRequest) -> Result<SimulateResponse, Error> {
        // JSON has no infinity, and what is too large is not worth sending.
        request.validate(&self.info)?;
        let answer: Answer<SimulateResponse> = self.process.ask(&Ask::Simulate(Box::new(request.clone())))?;
        Ok(answer?)
    }

    fn fit(&mut self, request: &FitRequest) -> Result<FitResponse, Error> {
        let answer: Answer<FitResponse> = self.process.ask(&Ask::Fit(Box::new(request.clone())))?;
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
    fn start(repository: &Repository, model: &str) -> Result<Process, Error> {
        let program = build(repository, model)?;
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
fn build(repository: &Repository, model: &str) -> Result<PathBuf, Error> {
    let build = cargo::cargo_build(repository, PACKAGE, cargo::Profile::OfThisProgram);
    cargo::run_build(build, PACKAGE, "building the compiled models")?.ok_or_else(|| Error::NotCompiled {
        what: model.to_owned(),
        reason: "the compiled models do not build".into(),
    })
}
