//! What a process with compiled scenes and this program say to each other, and the side of that process: [`serve`].
//!
//! One JSON value a line in both directions. The process first says its name and version; then each request gets one
//! answer, a `Result`. Its standard error is the user's, so that progress bars appear.
//!
//! Does not know: generated code, how the process is started.

use std::io::{BufRead, Write};

use serde::{Deserialize, Serialize};

use super::backend::{fit_with_bar, simulate_with_bar};
use super::dynamics::Factory;
use super::ensemble::{EnsembleRequest, integrate};
use super::evaluate::{EvalRequest, eval};
use super::fit::FitRequest;
use super::info::Info;
use super::simulation::SimulateRequest;
use crate::error::{Error, WireError};

/// Name of the package and program with the compiled models.
pub(crate) const PACKAGE: &str = "hamel-compiled";

/// First line of the process.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) struct Hello {
    pub(crate) program: String,
    pub(crate) version: String,
}

/// A request to the process.
#[derive(Debug, Serialize, Deserialize)]
pub(crate) enum Ask {
    /// Choose a scene; the answer is an [`Opened`].
    Open { model: String, scene: String },
    /// Evaluate the chosen scene.
    Eval(EvalRequest),
    /// Integrate the chosen scene.
    Simulate(Box<SimulateRequest>),
    /// Fit the chosen scene to a table.
    Fit(Box<FitRequest>),
    /// Integrate the chosen scene many times.
    Ensemble(EnsembleRequest),
}

/// What became of [`Ask::Open`].
#[derive(Debug, Serialize, Deserialize)]
pub(crate) enum Opened {
    Scene(Info),
    NoModel { known: Vec<String> },
    NoScene { known: Vec<String> },
}

/// The answer to a request.
pub(crate) type Answer<T> = Result<T, WireError>;

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
            Ask::Fit(request) => {
                let answer = chosen.ok_or_else(not_open).and_then(|f| fit_with_bar(f, &request, None));
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
