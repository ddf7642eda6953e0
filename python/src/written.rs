//! Texts of a scene: its files in some language, and the formulations that are the same motion.
//!
//! Deliberately does not know: how anything is derived or emitted, how results look in Python.

use std::collections::BTreeMap;

use hamel::output::formulations::table;
use hamel_codegen::Config;
use hamel_codegen::config::Language;
use hamel_codegen::scene;
use hamel_run::error::{Error, Problem};
use pyo3::prelude::*;

use crate::errors::OrRaise as _;
use crate::scene::Scene;

/// Languages by the names that `hamel generate --language` has for them; it writes FMUs besides.
const LANGUAGES: [(&str, Language); 10] = [
    ("rust", Language::Rust),
    ("c", Language::C),
    ("cpp", Language::Cpp),
    ("casadi", Language::Casadi),
    ("casadi-expr", Language::CasadiExpr),
    ("jax", Language::Jax),
    ("sympy", Language::Sympy),
    ("julia", Language::Julia),
    ("matlab", Language::Matlab),
    ("wasm", Language::Wasm),
];

/// The texts of the files of a scene by name.
#[pyfunction]
pub(crate) fn generate(py: Python<'_>, scene: &Scene, language: &str) -> PyResult<BTreeMap<String, String>> {
    let made = || -> Result<BTreeMap<String, String>, Error> {
        let Some((_, language)) = LANGUAGES.iter().find(|(name, _)| *name == language) else {
            let known = LANGUAGES.iter().map(|(name, _)| (*name).to_owned()).collect();
            let (path, name) = ("generate".to_owned(), language.to_owned());
            return Err(Error::Request {
                problems: vec![Problem::UnknownName { path, kind: "language", name, known }],
            });
        };
        let mut config = Config::new();
        config.language(*language).scenes(&scene.model.name, [&scene.info().scene]);
        Ok(config.generate(std::slice::from_ref(&**scene.model))?.files.into_iter().collect())
    };
    py.detach(made).or_raise(py)
}

/// A formulation: title, whether it is the scene's own, cost, chain, prepared numbers, bound of the rounding error.
type Row = (String, bool, u64, u64, usize, f64);

/// Formulations that were found, others with reasons, and the table.
type Listed = (Vec<Row>, Vec<(String, String)>, String);

/// Formulations of a scene, the cheapest first, others that were left out with reasons, and the table for people.
#[pyfunction]
pub(crate) fn formulations(py: Python<'_>, scene: &Scene) -> PyResult<Listed> {
    let made = || -> Result<_, Error> {
        let name = &scene.info().scene;
        let found = scene::formulations(&scene.model, name, &|_, _| {})?;
        let row = |one: &scene::Candidate| {
            let (cost, chain) = (one.counts.cost(), one.latency as u64);
            (one.title(), one.is_own(), cost, chain, one.n_prepared, one.rounding)
        };
        let rows: Vec<Row> = found.candidates.iter().map(row).collect();
        let left_out = found.left_out.iter().map(|one| (one.title.clone(), one.reason.clone())).collect();
        Ok((rows, left_out, table(&scene.model, name, &found)))
    };
    py.detach(made).or_raise(py)
}
