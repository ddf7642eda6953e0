//! The models of robots, from their descriptions.
//!
//! Deliberately does not know: formats, what becomes of a model.

use std::path::PathBuf;

use hamel::commands::import::{Choices, Limits, read};
use hamel_run::error::Error;
use hamel_run::session::Session;
use pyo3::prelude::*;

use crate::errors::OrRaise as _;

/// The text of the model of a robot, and the lines of its warnings.
#[pyfunction]
pub(crate) fn import_robot(
    py: Python<'_>,
    path: PathBuf,
    floating: bool,
    limits: &str,
    lock: Vec<String>,
    frames: Vec<String>,
    bodies: bool,
) -> PyResult<(String, String)> {
    let import = || -> Result<(String, String), Error> {
        let limits = match limits {
            "interval" => Limits::Interval,
            "spring" => Limits::Spring,
            "none" => Limits::None,
            other => {
                let expected = format!("is {other:?}: give \"interval\", \"spring\" or \"none\"");
                return Err(Error::unusable("limits".to_owned(), expected));
            }
        };
        let session = Session::of_shipped(&[]);
        let (imported, warnings) = read(&session, &path, Choices { floating, limits, lock, frames, bodies })?;
        let lines: Vec<String> = imported.notes.lines().chain(warnings.lines()).collect();
        Ok((imported.text, lines.join("\n")))
    };
    py.detach(import).or_raise(py)
}
