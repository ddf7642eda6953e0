//! Texts of a scene: its files in some language, explanations, the certificate, and the formulations that are the same
//! motion.
//!
//! Deliberately does not know: how anything is derived or emitted, how results look in Python.

use std::collections::BTreeMap;
use std::path::PathBuf;

use hamel::output::fmu;
use hamel::output::formulations::table;
use hamel::output::report::contents::contents;
use hamel::output::report::page;
use hamel_codegen::config::{Language, Precision};
use hamel_codegen::scene::{self, Scenes};
use hamel_codegen::spec::Unit;
use hamel_codegen::{Config, explain as explained};
use hamel_expr::Style;
use hamel_run::error::{Error, Problem};
use hamel_run::model::units;
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

/// Numbers of C and C++ by the names that `hamel generate --precision` has for them.
const PRECISIONS: [(&str, Precision); 2] = [("double", Precision::Double), ("float", Precision::Single)];

/// The texts of the files of a scene by name.
#[pyfunction]
pub(crate) fn generate(
    py: Python<'_>,
    scene: &Scene,
    language: &str,
    precision: &str,
) -> PyResult<BTreeMap<String, String>> {
    let made = || -> Result<BTreeMap<String, String>, Error> {
        let Some((_, language)) = LANGUAGES.iter().find(|(name, _)| *name == language) else {
            if language == "fmu" {
                return Err(Error::unusable("generate", "has texts, and an FMU is an archive: call `fmu`"));
            }
            return Err(unknown("generate", "language", language, &LANGUAGES.map(|(name, _)| name)));
        };
        let Some((_, precision)) = PRECISIONS.iter().find(|(name, _)| *name == precision) else {
            return Err(unknown("generate", "precision", precision, &PRECISIONS.map(|(name, _)| name)));
        };
        let mut config = Config::new();
        config.language(*language).precision(*precision).scenes(&scene.model.name, [&scene.info().scene]);
        Ok(config.generate(std::slice::from_ref(&**scene.model))?.files.into_iter().collect())
    };
    py.detach(made).or_raise(py)
}

fn unknown(path: &str, kind: &'static str, name: &str, known: &[&str]) -> Error {
    let known = known.iter().map(|name| (*name).to_owned()).collect();
    let problem = Problem::UnknownName { path: path.to_owned(), kind, name: name.to_owned(), known };
    Error::Request { problems: vec![problem] }
}

/// Writes the FMU of a scene to a file, in the place of one that is there.
#[pyfunction]
pub(crate) fn write_fmu(py: Python<'_>, scene: &Scene, path: PathBuf) -> PyResult<()> {
    let write = || {
        let name = &scene.info().scene;
        scene.model.known_scene(name)?;
        fmu::write(&path, true, &scene.model, &Scenes::new(&scene.model).for_fmus().build(name)?)
    };
    py.detach(write).or_raise(py)
}

/// Styles of explanations by name.
const STYLES: [(&str, Style); 3] =
    [("text", Style::Unicode), ("latex", Style::Latex), ("mathml", Style::MathMl)];

/// All that is known about a scene, as `hamel explain` prints it, and its sections by title.
#[pyfunction]
pub(crate) fn explain(
    py: Python<'_>,
    scene: &Scene,
    style: &str,
) -> PyResult<(String, Vec<(&'static str, String)>)> {
    let made = || -> Result<_, Error> {
        let Some((_, style)) = STYLES.iter().find(|(name, _)| *name == style) else {
            return Err(unknown("explain", "style", style, &STYLES.map(|(name, _)| name)));
        };
        let derived = scene.model.derive(&scene.info().scene)?;
        let sections = explained::sections(&scene.model, &derived, *style);
        let by_title = sections.iter().map(|section| (section.kind.title(), section.text.clone())).collect();
        Ok((explained::written(sections, *style), by_title))
    };
    py.detach(made).or_raise(py)
}

/// The page of `hamel report`, without a motion.
#[pyfunction]
pub(crate) fn report(py: Python<'_>, scene: &Scene) -> PyResult<String> {
    let page = || page(&contents(&scene.model, &scene.info().scene)?, None);
    py.detach(page).or_raise(py)
}

/// Units of the time, parameters, inputs, components of the state, the energy and outputs, as figures show them; empty
/// where they are unknown or numbers.
#[pyfunction]
#[pyo3(name = "units")]
pub(crate) fn all_units(scene: &Scene) -> Vec<(String, String)> {
    let (info, known) = (scene.info(), &scene.model.units);
    let shown = |unit: Option<&Unit>| unit.map_or_else(String::new, |unit| units::shown(unit.text()));
    let names = info.params.iter().chain(&info.inputs).map(|entry| &entry.name).chain(&info.state);
    let mut all = vec![("t".to_owned(), shown(units::of_time(&scene.model)))];
    all.extend(names.map(|name| (name.clone(), shown(known.of(name)))));
    all.push(("energy".to_owned(), shown(known.energy())));
    for group in &info.outputs {
        let of_one = |(k, name): (usize, &String)| {
            (format!("{}.{name}", group.name), shown(known.of_output(&group.name, k)))
        };
        all.extend(group.components.iter().enumerate().map(of_one));
    }
    all
}

/// A certificate: the number of points, residuals of functions, functions that were not held with reasons, the text.
type Certified = (usize, BTreeMap<String, f64>, BTreeMap<String, String>, String);

/// Holds every function of a scene to its definition at so many points.
#[pyfunction]
pub(crate) fn certify(py: Python<'_>, scene: &Scene, n_points: usize) -> PyResult<Certified> {
    let certify = || -> Result<_, Error> {
        let (model, name) = (&scene.model, &scene.info().scene);
        let found = model.derive(name)?.certify(n_points);
        let found = found.map_err(|error| model.diagnostics(vec![model.diagnose(&error)]))?;
        let text = found.table();
        Ok((found.n_points, found.held, found.open, text))
    };
    py.detach(certify).or_raise(py)
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
