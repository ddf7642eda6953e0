//! The linear system of a scene near a point.
//!
//! Deliberately does not know: how it is found, how it looks in Python.

use hamel_run::linearize::{Asked, Words, linearize as at};
use pyo3::prelude::*;

use crate::errors::OrRaise as _;
use crate::scene::Scene;

/// Arguments in Python.
const ARGUMENTS: Words = Words { set: "params", at: "y", hold: "inputs" };

/// The linear system at a state, of which components are given by name, as JSON.
#[pyfunction]
pub(crate) fn linearize(py: Python<'_>, scene: &Scene, y: Vec<(String, f64)>, t: f64) -> PyResult<String> {
    let find = || {
        let names = scene.info().params.iter().map(|p| p.name.clone());
        let set = names.zip(scene.values.iter().copied()).collect();
        let asked = Asked { set, at: y, hold: scene.inputs_at(t)?, t };
        at(&scene.model, &scene.info().scene, &asked, &ARGUMENTS)
    };
    Ok(py.detach(find).or_raise(py)?.to_json().to_string())
}
