//! Motions of a scene, one or many, as objects and arrays of Python.
//!
//! Deliberately does not know: how anything is integrated, how results look in Python.

use std::collections::BTreeMap;
use std::sync::Arc;

use hamel::commands::report::pictured;
use hamel::output::columns::Chosen;
use hamel::output::fields::fields;
use hamel::output::files::{self, Run};
use hamel::output::plot;
use hamel::output::report;
use hamel::output::report::contents::contents;
use hamel_codegen::scene::told_in_words;
use hamel_run::asked::{Asked, Words};
use hamel_run::auto;
use hamel_run::ensemble::{Cancel, Width};
use hamel_run::error::Error;
use hamel_run::info::Info;
use hamel_run::inputs::InputTable;
use hamel_run::integrate::simulate_at;
use hamel_run::length::method_of_long;
use hamel_run::method::{MethodName, Steps};
use hamel_run::model::{self, Checked, blocks};
use hamel_run::noise::{Noise, samples_for};
use hamel_run::simulation::{SimulateRequest, SimulateResponse};
use hamel_run::stepper::Pace;
use numpy::ndarray::{Array2, Array3};
use numpy::{PyArray1, PyArray2, PyReadonlyArray2, ToPyArray as _};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::ensemble as many;
use crate::errors::{OrRaise as _, exception};
use crate::interrupts::{Interrupts, interruptible};
use crate::scene::Scene;

/// Arguments in Python.
const ARGUMENTS: Words = Words {
    set: "params",
    initial: "y0",
    sections: "events",
    along: "sensitivity",
    samples: "t",
    step: "step",
    reconstructing: "in scene `reconstruction` only, which integrates",
};

/// A motion: what was asked and what came out.
#[pyclass(frozen, module = "pyhamel._hamel")]
pub(crate) struct Motion {
    model: Arc<Checked>,
    info: Info,
    table: Option<Arc<InputTable>>,
    request: SimulateRequest,
    response: SimulateResponse,
    /// What the initial state has that nobody gave.
    told: Option<String>,
}

/// How steps are made.
#[derive(FromPyObject)]
pub(crate) struct Options {
    #[pyo3(item)]
    method: Option<String>,
    #[pyo3(item)]
    rtol: Option<f64>,
    #[pyo3(item)]
    atol: Option<f64>,
    #[pyo3(item)]
    step: Option<f64>,
    #[pyo3(item)]
    max_step: Option<f64>,
    #[pyo3(item)]
    max_steps: Option<u64>,
    /// Seed, number of the path, grid.
    #[pyo3(item)]
    noise: (u64, u32, Option<f64>),
}

impl Options {
    /// Largest number of steps.
    pub(crate) fn max_steps(&self) -> Option<u64> {
        self.max_steps
    }

    /// The path of the scene's noises.
    ///
    /// # Errors
    /// [`Error::Request`] where the scene has none.
    fn noise(&self, info: &Info) -> Result<Noise, Error> {
        let (seed, path, step) = self.noise;
        let noise = Noise { seed, path, step };
        noise.suits(info).map_err(|reason| Error::unusable("noise_seed", reason))?;
        Ok(noise)
    }

    /// The method: the one that is given, that of scenes with noise, or another one.
    fn method(&self, info: &Info, otherwise: MethodName) -> Result<MethodName, Error> {
        match &self.method {
            Some(name) => MethodName::named(name).map_err(|reason| Error::unusable("method", reason)),
            None if info.noises.is_empty() => Ok(otherwise),
            None => Ok(MethodName::Midpoint),
        }
    }

    /// The method and its steps.
    ///
    /// # Errors
    /// [`Error::Request`] for what is no method, and steps that do not suit it.
    pub(crate) fn steps(&self, info: &Info, otherwise: MethodName) -> Result<(MethodName, Steps), Error> {
        let method = self.method(info, otherwise)?;
        // A scene with noise says itself which steps it takes.
        let is_free = self.method.is_none() && !info.noises.is_empty();
        let of_steps = if is_free { MethodName::default() } else { method };
        let steps = Steps::new(of_steps, self.rtol, self.atol, self.step);
        let steps = steps.map_err(|reason| Error::unusable(ARGUMENTS.step, reason))?;
        Ok((method, steps.within(self.max_step).map_err(|reason| Error::unusable("max_step", reason))?))
    }

    /// How a stepper moves states on by `dt`: methods with fixed steps take it as one, unless a step is given.
    ///
    /// # Errors
    /// As [`steps`](Self::steps).
    pub(crate) fn pace(&self, info: &Info, dt: f64) -> Result<Pace, Error> {
        let method = self.method(info, MethodName::default())?;
        let is_one = method.has_fixed_steps() && self.step.is_none() && dt.is_finite() && dt != 0.0;
        let steps = match is_one && self.rtol.is_none() && self.atol.is_none() && self.max_step.is_none() {
            true => Steps::Fixed { step: dt.abs() },
            false => self.steps(info, method)?.1,
        };
        Ok(Pace { dt, method, steps, max_steps: self.max_steps })
    }

    /// How all trajectories of an ensemble are integrated.
    ///
    /// # Errors
    /// As [`steps`](Self::steps), and for another number of lanes than 1, 4 and 8.
    fn many(
        &self,
        info: &Info,
        t_final: f64,
        samples: usize,
        lanes: usize,
        threads: Option<usize>,
    ) -> Result<many::Asked, Error> {
        let (method, steps) = self.steps(info, MethodName::default())?;
        let noise = self.noise(info)?;
        let width = Width::of_lanes(lanes)
            .ok_or_else(|| Error::unusable("lanes", format!("is {lanes}, but has to be 1, 4 or 8")))?;
        Ok(many::Asked { t_final, samples, method, steps, noise, max_steps: self.max_steps, width, threads })
    }
}

/// Number of samples of a motion in fixed steps for which nobody has chosen another one.
#[pyfunction]
pub(crate) fn default_samples(scene: &Scene, t_final: f64, step: f64) -> usize {
    samples_for(scene.info(), Steps::Fixed { step }, t_final, 201)
}

/// The motion from an initial state, of which components are given by name, with samples at the given times.
#[pyfunction]
#[pyo3(signature = (scene, y0, t_final, times, options, sections, sensitivity, max_events, outputs))]
#[expect(clippy::too_many_arguments, reason = "arguments of Python, all given by name there")]
pub(crate) fn simulate(
    py: Python<'_>,
    scene: &Scene,
    y0: Vec<(String, f64)>,
    t_final: f64,
    times: Vec<f64>,
    options: Options,
    sections: Vec<String>,
    sensitivity: Vec<String>,
    max_events: Option<u64>,
    outputs: bool,
) -> PyResult<Motion> {
    let mut interrupts = Interrupts::new();
    let run = || -> Result<Motion, Error> {
        let (asked_method, steps) = options.steps(scene.info(), MethodName::Auto)?;
        let built = scene.built();
        let has_events = !sections.is_empty() || built.watched().is_some();
        let purpose = auto::Purpose::of(times.len(), has_events);
        let method = match (asked_method, steps) {
            (MethodName::Auto, Steps::Adaptive { rtol, .. }) => {
                auto::choose(rtol, built.rhs_counts().cost(), purpose)
            }
            (method, _) => method,
        };
        let names = scene.info().param_names();
        let set = names.into_iter().map(str::to_owned).zip(scene.values.iter().copied()).collect();
        let asked = Asked {
            set,
            initial: y0,
            t_final,
            method,
            steps,
            samples: times.len(),
            with_outputs: outputs,
            n_group: 0,
            max_steps: options.max_steps,
            max_events,
            noise: options.noise(scene.info())?,
            sections,
            along: sensitivity,
        };
        // Names of events and of parameters to differentiate by are looked up in the model.
        let alike = if has_events || !asked.along.is_empty() { None } else { scene.complete() };
        let (mut request, told) = match alike.and_then(|alike| asked.complete(built, alike)) {
            Some(request) => (request, Vec::new()),
            None => asked.request(&ARGUMENTS, &scene.model, built)?,
        };
        if asked_method == MethodName::Auto {
            request.method = method_of_long(&built, &request).unwrap_or(request.method);
        }
        if built.is_driven() && !request.along.is_empty() && request.watched.is_some() {
            let reason = "is not carried through events whose inputs are in a table or held elsewhere than in the \
                          model: drive them by expressions";
            return Err(Error::unusable(ARGUMENTS.along, reason));
        }
        let response = simulate_at(&built, &request, &times, &mut |_| interrupts.look())?;
        Ok(Motion {
            model: Arc::clone(&scene.model),
            info: scene.info().clone(),
            table: scene.table.clone(),
            request,
            response,
            told: told_in_words(&told),
        })
    };
    let made = py.detach(run);
    interrupts.raised()?;
    made.or_raise(py)
}

/// Many motions, one for each row of `values`, whose columns `names` names; arrays by name.
#[pyfunction]
#[pyo3(signature = (scene, names, values, t_final, samples, options, lanes, threads))]
#[expect(clippy::too_many_arguments, reason = "arguments of Python, all given by name there")]
pub(crate) fn ensemble<'py>(
    py: Python<'py>,
    scene: &Scene,
    names: Vec<String>,
    values: PyReadonlyArray2<'py, f64>,
    t_final: f64,
    samples: usize,
    options: Options,
    lanes: usize,
    threads: Option<usize>,
) -> PyResult<Bound<'py, PyDict>> {
    let (n_rows, n, n_params) =
        (values.as_array().nrows(), scene.info().state.len(), scene.info().params.len());
    let rows = values.as_array();
    let cancel = Cancel::default();
    let run = || {
        let asked = options.many(scene.info(), t_final, samples, lanes, threads)?;
        many::integrate(scene, &names, rows, &asked, &cancel)
    };
    let all = interruptible(py, &cancel, run)?;
    let shape = |e: numpy::ndarray::ShapeError| pyo3::exceptions::PyRuntimeError::new_err(e.to_string());
    let of_two = |width: usize, values| Array2::from_shape_vec((n_rows, width), values).map_err(shape);
    let states = Array3::from_shape_vec((n_rows, samples, n), all.states).map_err(shape)?;
    let found = PyDict::new(py);
    found.set_item("t", PyArray1::from_vec(py, all.times))?;
    found.set_item("y", numpy::PyArray3::from_owned_array(py, states))?;
    found.set_item("energy", PyArray2::from_owned_array(py, of_two(samples, all.energies)?))?;
    found.set_item("t_end", PyArray1::from_vec(py, all.ends))?;
    found.set_item("y_end", PyArray2::from_owned_array(py, of_two(n, all.last)?))?;
    found.set_item("steps", PyArray1::from_vec(py, all.steps))?;
    found.set_item("errors", all.errors)?;
    found.set_item("params", PyArray2::from_owned_array(py, of_two(n_params, all.params)?))?;
    found.set_item("y0", PyArray2::from_owned_array(py, of_two(n, all.initial)?))?;
    Ok(found)
}

/// The same into a file or a store; returns what became of them as text.
#[pyfunction]
#[pyo3(signature = (
    scene, names, values, t_final, samples, options, lanes, threads, out, resume, part, statistics, quantiles, bins
))]
#[expect(clippy::too_many_arguments, reason = "arguments of Python, all given by name there")]
pub(crate) fn write_ensemble(
    py: Python<'_>,
    scene: &Scene,
    names: Vec<String>,
    values: PyReadonlyArray2<'_, f64>,
    t_final: f64,
    samples: usize,
    options: Options,
    lanes: usize,
    threads: Option<usize>,
    out: std::path::PathBuf,
    resume: bool,
    part: Option<(usize, usize)>,
    statistics: Vec<String>,
    quantiles: Vec<f64>,
    bins: u16,
) -> PyResult<String> {
    let rows: Vec<Vec<f64>> = values.as_array().rows().into_iter().map(|row| row.to_vec()).collect();
    let cancel = Cancel::default();
    let run = || {
        let asked = options.many(scene.info(), t_final, samples, lanes, threads)?;
        let to = many::Written { out, resume, part, statistics, quantiles, bins };
        many::write(scene, (names, rows), &asked, to, cancel.clone())
    };
    interruptible(py, &cancel, run)
}

impl Motion {
    /// Rows of numbers of all samples.
    fn table<'py>(
        &self,
        py: Python<'py>,
        row: impl Fn(&hamel_run::simulation::Sample) -> &[f64],
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let samples = &self.response.samples;
        let width = samples.first().map_or(0, |sample| row(sample).len());
        let all: Vec<f64> = samples.iter().flat_map(|sample| row(sample).iter().copied()).collect();
        let array = Array2::from_shape_vec((samples.len(), width), all);
        let array = array.map_err(|e| pyo3::exceptions::PyRuntimeError::new_err(e.to_string()))?;
        Ok(PyArray2::from_owned_array(py, array))
    }
}

#[pymethods]
impl Motion {
    /// Times of the samples.
    #[getter]
    fn t<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.response.samples.iter().map(|sample| sample.t).collect())
    }

    /// States of the samples.
    #[getter]
    fn y<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        if self.response.samples.is_empty() {
            return Ok(PyArray2::zeros(py, [0, self.info.state.len()], false));
        }
        self.table(py, |sample| &sample.state)
    }

    /// Energies of the samples; none where the scene has none.
    #[getter]
    fn energy<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let energies: Option<Vec<f64>> = self.response.samples.iter().map(|sample| sample.energy).collect();
        energies.filter(|_| self.info.has_energy).map(|energies| PyArray1::from_vec(py, energies))
    }

    /// All outputs of the samples.
    #[getter]
    fn outputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, |sample| &sample.outputs)
    }

    /// Derivatives of the states of the samples, one direction after the other.
    #[getter]
    fn along<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.table(py, |sample| &sample.along)
    }

    /// What the motion is differentiated by, with the derivatives of the final state.
    #[getter]
    fn along_end<'py>(&self, py: Python<'py>) -> Vec<(String, Bound<'py, PyArray1<f64>>)> {
        self.response.along.iter().map(|(name, values)| (name.clone(), values.to_pyarray(py))).collect()
    }

    /// Names, times and states of events, in the order of time.
    #[getter]
    fn events<'py>(&self, py: Python<'py>) -> Vec<(String, f64, Bound<'py, PyArray1<f64>>)> {
        let events = self.response.events.as_deref().unwrap_or_default();
        events.iter().map(|event| (event.name.clone(), event.t, event.state.to_pyarray(py))).collect()
    }

    /// The event that has ended the motion.
    #[getter]
    fn ended_by(&self) -> Option<String> {
        self.response.ended_by.clone()
    }

    /// Times of singular positions that were passed, and how many equations each has lost.
    #[getter]
    fn singular_positions(&self) -> Vec<(f64, usize)> {
        self.response.singular_positions.iter().map(|passed| (passed.t, passed.n_lost)).collect()
    }

    /// Time and state at the end.
    #[getter]
    fn end<'py>(&self, py: Python<'py>) -> (f64, Bound<'py, PyArray1<f64>>) {
        (self.response.t, self.response.last.to_pyarray(py))
    }

    /// Parameters and the initial state.
    #[getter]
    fn start<'py>(&self, py: Python<'py>) -> [Bound<'py, PyArray1<f64>>; 2] {
        [self.request.params.to_pyarray(py), self.request.initial.to_pyarray(py)]
    }

    /// Numbers about the integration, by name.
    #[getter]
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let SimulateResponse { steps, rejected, rhs_evals, energy_drift, .. } = self.response;
        let stats = PyDict::new(py);
        stats.set_item("method", self.request.method.name())?;
        stats.set_item("steps", steps)?;
        stats.set_item("rejected", rejected)?;
        stats.set_item("rhs_evals", rhs_evals)?;
        stats.set_item("energy_drift", energy_drift)?;
        stats.set_item("initial_energy", self.response.initial_energy)?;
        stats.set_item("constraint_residual", self.response.constraint_residual)?;
        stats.set_item("seconds", self.response.seconds)?;
        stats.set_item("start", self.told.clone())?;
        Ok(stats)
    }

    /// What there is to know besides.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.response.warnings.clone()
    }

    /// The figure that `hamel simulate -o motion.svg` writes.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        let drawn = || {
            let (title, blocks) = (model::title(&self.model), blocks::blocks(&self.model));
            let (fields, _) = fields(&self.model, &self.info, &self.request, &self.response);
            let run = Run {
                info: &self.info,
                title: &title,
                blocks: &blocks,
                request: &self.request,
                response: &self.response,
                fields: &fields,
                chosen: &Chosen::default(),
            };
            plot::svg(&files::figure(&run)?)
                .map_err(|e| Error::io("figure", std::io::Error::other(e.to_string())))
        };
        py.detach(drawn).or_raise(py)
    }

    /// A page that plays the motion; none where the model says nothing to draw.
    fn moving(&self, py: Python<'_>, samples: usize) -> PyResult<Option<String>> {
        let drawn = || -> Result<Option<String>, Error> {
            let page = contents(&self.model, &self.info.scene)?;
            if page.views.is_empty() && self.model.views.list.is_empty() {
                return Ok(None);
            }
            let by_name = |names: &[&str], values: &[f64]| -> BTreeMap<String, f64> {
                names.iter().map(|name| (*name).to_owned()).zip(values.iter().copied()).collect()
            };
            let set = by_name(&self.info.param_names(), &self.request.params);
            let given = by_name(&self.info.state_names(), &self.request.initial);
            let SimulateRequest { method, steps, .. } = self.request;
            // The scene that is drawn has coordinates besides, and not every method suits it.
            let method = if method.suits_all_scenes() { method } else { MethodName::Dop853 };
            let motion = (self.response.t, method, steps, samples);
            let motion =
                pictured(&self.model, &self.info.scene, [&set, &given], self.table.as_deref(), motion)?;
            Ok(report::moving(&page, &motion))
        };
        py.detach(drawn).or_raise(py)
    }

    /// What `restored` takes besides the scene.
    fn kept(&self, py: Python<'_>) -> PyResult<String> {
        let kept = serde_json::to_string(&(&self.request, &self.response, &self.told));
        kept.map_err(|e| exception(py, &Error::Options { reason: e.to_string() }))
    }

    /// A motion of a scene that was kept as text.
    #[staticmethod]
    fn restored(py: Python<'_>, scene: &Scene, kept: &str) -> PyResult<Motion> {
        let kept: Result<(SimulateRequest, SimulateResponse, Option<String>), _> = serde_json::from_str(kept);
        let (request, response, told) =
            kept.map_err(|e| exception(py, &Error::Options { reason: e.to_string() }))?;
        Ok(Motion {
            model: Arc::clone(&scene.model),
            info: scene.info().clone(),
            table: scene.table.clone(),
            request,
            response,
            told,
        })
    }
}
