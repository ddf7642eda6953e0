//! Fits of a scene to measured values, as objects of Python.
//!
//! Deliberately does not know: how a fit is done, how results look in Python.

use std::path::PathBuf;
use std::sync::Arc;

use hamel::output::fitted::{self, Fitted};
use hamel::output::plot;
use hamel_run::error::Error;
use hamel_run::fit::{FitRequest, FitResponse, Prior, Progress};
use hamel_run::info::Info;
use hamel_run::method::MethodName;
use hamel_run::model::{self, Checked, blocks};
use hamel_run::request::fit::{Asked, CURVE, Found, Source, ends, normal};
use hamel_run::request::table::{Cells, Table};
use numpy::ndarray::Array2;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::errors::{OrRaise as _, exception, in_arguments};
use crate::interrupts::Interrupts;
use crate::motion::Options;
use crate::scene::Scene;

/// A question of a fit with its answer.
#[pyclass(frozen, module = "pyhamel._hamel")]
pub(crate) struct Fit {
    model: Arc<Checked>,
    info: Info,
    found: Found,
}

/// A fit as Python asks for it.
#[derive(FromPyObject)]
pub(crate) struct Wanted {
    /// The file of the table.
    #[pyo3(item)]
    path: Option<PathBuf>,
    /// Or its columns: names with numbers, or with the first of their words.
    #[pyo3(item)]
    columns_of_data: Vec<(String, Vec<f64>, Option<String>)>,
    #[pyo3(item)]
    unknowns: Vec<String>,
    #[pyo3(item)]
    columns: Vec<(String, String)>,
    #[pyo3(item)]
    time: String,
    #[pyo3(item)]
    t0: f64,
    #[pyo3(item)]
    sigma: Vec<(String, f64)>,
    #[pyo3(item)]
    bounds: Vec<(String, [f64; 2])>,
    #[pyo3(item)]
    prior: Vec<(String, [f64; 2])>,
    #[pyo3(item)]
    restarts: usize,
    #[pyo3(item)]
    segments: usize,
    #[pyo3(item)]
    y0: Vec<(String, f64)>,
}

impl Wanted {
    /// With the parameters of a scene.
    fn asked(self, scene: &Scene, options: &Options) -> Result<Asked, Error> {
        let data = match self.path {
            Some(path) => Source::File(path),
            None => {
                let columns = self
                    .columns_of_data
                    .into_iter()
                    .map(|(name, numbers, word)| (name, word.map_or(Cells::Numbers(numbers), Cells::Words)));
                Source::Table(Table::of_columns("data", columns.collect())?)
            }
        };
        let bounds = self.bounds.into_iter().map(|(name, given)| match ends(given) {
            Ok(ends) => Ok((name, ends)),
            Err(why) => Err(Error::unusable("bounds", format!("of {name}, {given:?}, {why}"))),
        });
        let prior =
            self.prior.into_iter().map(|(name, [mean, deviation])| -> Result<(String, Prior), Error> {
                match normal(mean, deviation) {
                    Ok(prior) => Ok((name, prior)),
                    Err(why) => Err(Error::unusable("prior", format!("of {name}: {why}"))),
                }
            });
        let (method, steps) = options.steps(scene.info(), MethodName::default())?;
        let names = scene.info().param_names();
        Ok(Asked {
            data,
            free: self.unknowns,
            columns: self.columns,
            time: self.time,
            t0: self.t0,
            sigma: self.sigma,
            bounds: bounds.collect::<Result<_, _>>()?,
            prior: prior.collect::<Result<_, _>>()?,
            restarts: self.restarts,
            segments: self.segments,
            set: names.into_iter().map(str::to_owned).zip(scene.values.iter().copied()).collect(),
            initial: self.y0,
            method,
            steps,
            max_steps: options.max_steps(),
            n_curve: CURVE,
        })
    }
}

/// Fits a scene, from the values that its parameters have.
#[pyfunction]
#[pyo3(signature = (scene, wanted, options, progress))]
pub(crate) fn fit(
    py: Python<'_>,
    scene: &Scene,
    wanted: Wanted,
    options: Options,
    progress: Option<Py<PyAny>>,
) -> PyResult<Fit> {
    let mut interrupts = Interrupts::new();
    let run = || -> Result<Found, Error> {
        let asked = wanted.asked(scene, &options)?;
        asked.fit(&scene.model, scene.built(), &mut |at| {
            if let (Progress::Motion { n, sum_of_squares }, Some(progress)) = (at, &progress) {
                let called = interrupts.call(|py| progress.call1(py, (n, sum_of_squares)).map(drop));
                if called.is_break() {
                    return called;
                }
            }
            interrupts.look()
        })
    };
    let made = py.detach(run);
    interrupts.raised()?;
    let found = made.or_raise(py)?;
    Ok(Fit { model: Arc::clone(&scene.model), info: scene.info().clone(), found })
}

#[pymethods]
impl Fit {
    /// The answer as `hamel fit --json` prints it.
    fn json(&self) -> String {
        self.found.to_json(&self.info).to_string()
    }

    /// What the residuals say, in words.
    #[getter]
    fn verdict(&self) -> String {
        in_arguments(&self.found.response.verdict.text())
    }

    /// Columns that were in another unit, in words.
    #[getter]
    fn converted(&self) -> Vec<String> {
        self.found.converted.clone()
    }

    /// Names of the columns.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.found.request.columns.iter().map(|column| column.name.clone()).collect()
    }

    /// Times of the rows, from the start of the motion on.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.found.request.times)
    }

    /// The measured values, in the units of the model; NaN where there is none.
    #[getter]
    fn values<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, &self.found.request.values)
    }

    /// The motion less the measured values.
    #[getter]
    fn residuals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, &self.found.response.residuals)
    }

    /// The figure that `hamel fit -o fit.svg` writes.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        let (title, blocks) = (model::title(&self.model), blocks::blocks(&self.model));
        let (info, title, blocks) = (&self.info, title.as_str(), blocks.as_slice());
        let Found { request, response, .. } = &self.found;
        let drawn = plot::svg(&fitted::figure(&Fitted { info, title, blocks, request, response }));
        drawn.map_err(|e| Error::io("figure", std::io::Error::other(e.to_string()))).or_raise(py)
    }

    /// What `restored` takes besides the scene.
    fn kept(&self, py: Python<'_>) -> PyResult<String> {
        let Found { request, response, converted } = &self.found;
        // Intervals without ends have no numbers, and the search is over.
        let request = FitRequest { known: Vec::new(), ..request.clone() };
        let kept = serde_json::to_string(&(request, response, converted));
        kept.map_err(|e| exception(py, &Error::Options { reason: e.to_string() }))
    }

    /// A fit of a scene that was kept as text.
    #[staticmethod]
    fn restored(py: Python<'_>, scene: &Scene, kept: &str) -> PyResult<Fit> {
        let kept: Result<(FitRequest, FitResponse, Vec<String>), _> = serde_json::from_str(kept);
        let (request, response, converted) =
            kept.map_err(|e| exception(py, &Error::Options { reason: e.to_string() }))?;
        let found = Found { request, response, converted };
        Ok(Fit { model: Arc::clone(&scene.model), info: scene.info().clone(), found })
    }
}

impl Fit {
    fn table<'py>(&self, py: Python<'py>, rows: &[Vec<Option<f64>>]) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let cells = rows.iter().flatten().map(|cell| cell.unwrap_or(f64::NAN)).collect();
        let array = Array2::from_shape_vec((rows.len(), self.found.request.columns.len()), cells);
        let array = array.map_err(|e| pyo3::exceptions::PyRuntimeError::new_err(e.to_string()))?;
        Ok(PyArray2::from_owned_array(py, array))
    }
}
