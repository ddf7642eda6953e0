//! A scene of a model with values of its parameters, as an object of Python.
//!
//! Deliberately does not know: how a motion is integrated, how results look in Python.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use hamel_codegen::spec::{self, ParamArray, Want};
use hamel_expr::rational_to_f64;
use hamel_run::cache::Cache;
use hamel_run::choice::gives_way;
use hamel_run::dynamics::{Dynamics, Factory as _, VecState};
use hamel_run::equilibria::{self, Along, Asked};
use hamel_run::error::Error;
use hamel_run::evaluate::{derivative, unusable_states};
use hamel_run::forms::Forms;
use hamel_run::info::{Info, ParamEntry};
use hamel_run::inputs::{Between, InputTable};
use hamel_run::interpreted::{self, Built};
use hamel_run::model::{self, Checked};
use hamel_run::session::{Session, closed};
use hamel_run::start::{Alike, Starts};
use hamel_runtime::{Dual, F64x8};
use numpy::{PyArray2, PyReadonlyArrayDyn, PyReadwriteArrayDyn, PyUntypedArrayMethods as _};
use pyo3::prelude::*;

use crate::arrays::{Rows, RowsMut, in_pieces};
use crate::errors::{OrRaise as _, exception};
use crate::functions;
use crate::prepared::Prepared;
use crate::rows::{
    by_row, check, other_shapes, rates, refuse, two_axes, two_axes_mut, two_axes_needed, write,
};
use crate::shipped::SHIPPED;

/// A scene of a model with values of its parameters.
#[pyclass(frozen, module = "pyhamel._hamel")]
pub(crate) struct Scene {
    pub(crate) model: Arc<Checked>,
    pub(crate) values: Vec<f64>,
    /// Inputs that are held elsewhere than in the model, and those of tables.
    pub(crate) table: Option<Arc<InputTable>>,
    prepared: Prepared,
    /// Complete states as starts, once asked for, unless something moves or converts them.
    complete: OnceLock<Option<Alike>>,
    file: String,
    text: String,
    budget: u64,
}

/// Names, values by default and meanings of parameters.
type Params = Vec<(String, f64, String)>;
/// Names, components and meanings of groups of outputs.
type Outputs = Vec<(String, Vec<String>, String)>;
type ReducedParts = (String, Vec<String>, usize, Option<BTreeMap<String, String>>);

impl Scene {
    fn new(
        model: Arc<Checked>,
        built: Arc<Built>,
        values: Vec<f64>,
        table: Option<Arc<InputTable>>,
        (file, text, budget): (String, String, u64),
    ) -> Result<Scene, Error> {
        let prepared = Prepared::with_values(built, &values)?;
        let complete = OnceLock::new();
        Ok(Scene { model, values, table, prepared, complete, file, text, budget })
    }

    /// Complete states in the scene's own variables as starts, where nothing moves or converts them.
    pub(crate) fn complete(&self) -> Option<&Alike> {
        let find = || {
            let forms = Forms::of(&self.model, self.info()).ok()?;
            let starts = Starts::new(&self.model, self.info(), forms).ok()?;
            let own = self.info().params.iter().zip(&self.values).map(|(p, value)| (p.name.clone(), *value));
            starts.alike(&own.collect(), &BTreeMap::new(), &self.info().state)
        };
        self.complete.get_or_init(find).as_ref()
    }

    pub(crate) fn built(&self) -> &Built {
        self.prepared.borrow_owner()
    }

    /// The same, to be kept beside the scene.
    pub(crate) fn shared(&self) -> Arc<Built> {
        Arc::clone(self.prepared.borrow_owner())
    }

    pub(crate) fn info(&self) -> &Info {
        self.built().info()
    }

    /// The text of the model.
    pub(crate) fn model_text(&self) -> &str {
        &self.text
    }

    /// What drives the inputs, for a document; nothing where they are the model's own.
    pub(crate) fn drives(&self) -> serde_json::Value {
        self.table.as_ref().map_or(serde_json::Value::Null, |table| table.described())
    }

    /// The inputs that something else than the model holds or drives, at a time.
    pub(crate) fn inputs_at(&self, t: f64) -> Result<Vec<(String, f64)>, Error> {
        let Some(table) = &self.table else { return Ok(Vec::new()) };
        let values = table.of_scene(self.info())?.at(t);
        let names = self.info().inputs.iter().map(|input| input.name.clone());
        Ok(names.zip(values).filter(|(name, _)| table.has(name)).collect())
    }

    fn source(&self) -> (String, String, u64) {
        (self.file.clone(), self.text.clone(), self.budget)
    }

    /// Values of the parameters of another scene of the model: the own ones, where both have one.
    fn values_of(&self, info: &Info) -> Vec<f64> {
        let own = |name: &str| self.info().params.iter().position(|p| p.name == name).map(|k| self.values[k]);
        info.params.iter().map(|p| own(&p.name).unwrap_or(p.default)).collect()
    }

    fn dynamics(&self) -> &dyn Dynamics {
        self.prepared.one()
    }

    /// What a number of a scene costs; a call of the interpreter takes longer.
    pub(crate) fn cost(&self) -> u64 {
        self.dynamics().rhs_cost()
    }

    /// Calls `work` with states and results, without holding Python, and says which states have no values.
    fn on_states(
        &self,
        py: Python<'_>,
        (y, t): (&PyReadonlyArrayDyn<'_, f64>, f64),
        out: &mut PyReadwriteArrayDyn<'_, f64>,
        (cost, threads): (u64, Option<bool>),
        work: impl Fn(&Rows<'_>, &mut RowsMut<'_>, usize) -> bool + Send + Sync,
    ) -> PyResult<()> {
        let (states, out) = (two_axes(y.as_array())?, two_axes_mut(out.as_array_mut())?);
        if states.ncols() != self.info().state.len() || states.nrows() != out.nrows() {
            return Err(other_shapes());
        }
        let done = py.detach(|| match in_pieces(states, out, (cost, threads), work) {
            Ok(true) => Ok(()),
            Ok(false) => refuse(self.dynamics(), states, t),
            Err(error) => Err(error),
        });
        done.or_raise(py)
    }
}

#[pymethods]
impl Scene {
    /// The scene of a model: of a file or a name that the package knows, or of `text`, which `name` stands for then.
    #[staticmethod]
    #[pyo3(signature = (name, text, scene, budget, library, sizes=Vec::new()))]
    fn load(
        py: Python<'_>,
        name: &str,
        text: Option<String>,
        scene: &str,
        budget: u64,
        library: Option<PathBuf>,
        sizes: Vec<(String, i64)>,
    ) -> PyResult<Scene> {
        let load = || -> Result<Scene, Error> {
            let cache = library.map_or_else(Cache::none, |library| Cache::of_user().of_library(library));
            let session = Session::of_shipped(SHIPPED).with_budget(budget).with_cache(cache.clone());
            let (model, file, text) = match text {
                Some(text) => {
                    let text = spec::with_sizes(name, &text, &sizes)?;
                    let model = Arc::new(Checked::new(session.parse_with_totals(name, &text)?, cache));
                    (model, name.to_owned(), text)
                }
                None => {
                    let file = session.find(name)?.sized(&sizes);
                    (Arc::clone(file.checked()?), file.shown(), file.text()?.into_owned())
                }
            };
            let built = interpreted::build(&model, scene)?.in_memory();
            let values = built.info().defaults();
            Scene::new(model, Arc::new(built), values, None, (file, text, budget))
        };
        py.detach(load).or_raise(py)
    }

    /// The same scene with other values of all its parameters, in their order.
    fn with_values(&self, py: Python<'_>, values: Vec<f64>) -> PyResult<Scene> {
        let built = Arc::clone(self.prepared.borrow_owner());
        Scene::new(Arc::clone(&self.model), built, values, self.table.clone(), self.source()).or_raise(py)
    }

    /// The same scene with inputs that are held, and with those of a table: `rows` under `names`, of which one is `t`.
    fn with_inputs(
        &self,
        py: Python<'_>,
        held: Vec<(String, f64)>,
        names: Vec<String>,
        rows: Vec<Vec<f64>>,
        interpolation: &str,
    ) -> PyResult<Scene> {
        let make = || -> Result<Scene, Error> {
            let between = Between::named(interpolation)?;
            let mut table = InputTable::held("inputs", &held);
            if !names.is_empty() {
                table = table.overlaid(&InputTable::new("inputs", &names, &rows, between)?);
            }
            if let Some(own) = &self.table {
                table = own.overlaid(&table);
            }
            let built = match gives_way(&self.model, self.info(), &table) {
                Some(scene) => interpreted::build(&self.model, scene)?.in_memory().driven_by(&table)?,
                None => self.built().also_driven_by(&table)?,
            };
            let values = self.values_of(built.info());
            Scene::new(Arc::clone(&self.model), Arc::new(built), values, Some(Arc::new(table)), self.source())
        };
        py.detach(make).or_raise(py)
    }

    /// The same scene of the model whose inputs are driven by expressions, names with values.
    fn driven(
        &self,
        py: Python<'_>,
        inputs: Vec<(String, String)>,
        library: Option<PathBuf>,
    ) -> PyResult<Scene> {
        let make = || -> Result<Scene, Error> {
            let cache = library.map_or_else(Cache::none, |library| Cache::of_user().of_library(library));
            let (text, closed) = closed(&self.file, &self.text, &self.model, (&inputs, "inputs"))?;
            let model = Arc::new(Checked::new(closed, cache));
            let built = interpreted::build(&model, &self.info().scene)?.in_memory();
            let values = self.values_of(built.info());
            Scene::new(model, Arc::new(built), values, None, (self.file.clone(), text, self.budget))
        };
        py.detach(make).or_raise(py)
    }

    /// Names of the inputs, the values they are held at (none where a table drives them), and meanings.
    #[getter]
    fn inputs(&self) -> Vec<(String, Option<f64>, String)> {
        let own = &self.info().inputs;
        let names: Vec<&str> = own.iter().map(|input| input.name.as_str()).collect();
        let all =
            self.model.inputs.iter().filter(|input| names.is_empty() || names.contains(&input.name.as_str()));
        all.map(|input| {
            let held = match &self.table {
                Some(table) if table.has(&input.name) => table.held_value(&input.name),
                _ => Some(rational_to_f64(&input.default)),
            };
            (input.name.clone(), held, input.doc.clone())
        })
        .collect()
    }

    /// Inputs that form vectors and matrices: name, shape, and the input at each entry, row by row, none where it is
    /// zero.
    #[getter]
    fn input_arrays(&self) -> Vec<(String, Vec<usize>, Vec<Option<String>>)> {
        let of_one = |array: &ParamArray| {
            let name = |k: usize| self.model.graph.name(array.symbols[k]).to_owned();
            let entries = array.layout.entries().into_iter().map(|at| at.map(name)).collect();
            (array.name.clone(), array.layout.shape(), entries)
        };
        self.model.input_arrays.iter().map(of_one).collect()
    }

    /// Names of the inputs that the scene takes.
    #[getter]
    fn taken_inputs(&self) -> Vec<String> {
        self.info().inputs.iter().map(|input| input.name.clone()).collect()
    }

    /// Names of the inputs of the model that are no noises.
    #[getter]
    fn controls(&self) -> Vec<String> {
        self.model.controls().map(|input| input.name.clone()).collect()
    }

    /// Name of the model.
    #[getter]
    fn name(&self) -> &str {
        &self.info().model
    }

    /// Name of the scene.
    #[getter]
    fn scene(&self) -> &str {
        &self.info().scene
    }

    /// Names of all scenes of the model.
    #[getter]
    fn scenes(&self) -> Vec<String> {
        self.model.scene_names()
    }

    /// First line of the documentation.
    #[getter]
    fn title(&self) -> String {
        model::title(&self.model)
    }

    /// The file, or what stands for it.
    #[getter]
    fn file(&self) -> &str {
        &self.file
    }

    /// The text of the model.
    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    /// The budget of derivations.
    #[getter]
    fn budget(&self) -> u64 {
        self.budget
    }

    /// Warnings about the model, as the command prints them; empty where there are none.
    #[getter]
    fn warnings(&self) -> String {
        if self.model.warnings.is_empty() { String::new() } else { self.model.warnings.render(false) }
    }

    /// Names of the state's components in order.
    #[getter]
    fn state(&self) -> Vec<String> {
        self.info().state.clone()
    }

    /// Names, defaults and meanings of the parameters.
    #[getter]
    fn params(&self) -> Params {
        self.info().params.iter().map(|p| (p.name.clone(), p.default, p.doc.clone())).collect()
    }

    /// Values of the parameters in order.
    #[getter]
    fn values(&self) -> Vec<f64> {
        self.values.clone()
    }

    /// Names, components and meanings of the groups of outputs.
    #[getter]
    fn outputs(&self) -> Outputs {
        self.info().outputs.iter().map(|o| (o.name.clone(), o.components.clone(), o.doc.clone())).collect()
    }

    /// Whether the scene has an energy.
    #[getter]
    fn has_energy(&self) -> bool {
        self.info().has_energy
    }

    /// Whether it has one that is proved to be constant along the motion.
    #[getter]
    fn conserves_energy(&self) -> bool {
        self.info().conserves_energy
    }

    /// Writes rates of states, rows of `y`, to the rows of `out`.
    fn rhs(
        &self,
        py: Python<'_>,
        y: PyReadonlyArrayDyn<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
        threads: Option<bool>,
    ) -> PyResult<()> {
        let n = self.info().state.len();
        // Eight at a time.
        let cost = self.cost() / 4 + n as u64;
        self.on_states(py, (&y, t), &mut out, (cost, threads), |rows, out, n_rows| {
            rates(&self.prepared, t, rows, out, n_rows, n)
        })
    }

    /// Writes the rates of one state.
    fn rhs_of_one(
        &self,
        py: Python<'_>,
        y: PyReadonlyArrayDyn<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
    ) -> PyResult<()> {
        let n = self.info().state.len();
        if y.len() != n || out.len() != n {
            return Err(other_shapes());
        }
        let copied = || Cow::Owned(y.as_array().iter().copied().collect::<Vec<f64>>());
        let state = y.as_slice().map_or_else(|_| copied(), Cow::Borrowed);
        let Ok(out) = out.as_slice_mut() else { return Err(two_axes_needed()) };
        self.dynamics().rhs(t, &state, out);
        if out.iter().all(|x| x.is_finite()) {
            return Ok(());
        }
        derivative(self.dynamics(), t, &state)
            .map(drop)
            .map_err(|reason| exception(py, &Error::State { path: "y".into(), reason }))
    }

    /// Says whether the equations can be evaluated at states, rows of `y`; raises why not.
    fn check(&self, py: Python<'_>, y: PyReadonlyArrayDyn<'_, f64>, t: f64) -> PyResult<()> {
        let states = two_axes(y.as_array())?;
        py.detach(|| check(self.dynamics(), states, t)).or_raise(py)
    }

    /// Writes the derivatives of rates by states, row by row, to the rows of `out`, `[n_states, n * n]`.
    fn jacobian(
        &self,
        py: Python<'_>,
        y: PyReadonlyArrayDyn<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
        threads: Option<bool>,
    ) -> PyResult<()> {
        let (dynamics, n) = (self.dynamics(), self.info().state.len());
        let cost = 20 * self.cost() * n as u64;
        self.on_states(py, (&y, t), &mut out, (cost, threads), |rows, out, n_rows| {
            let mut matrix = vec![VecState(vec![0.0; n]); n];
            by_row(rows, out, n_rows, (n, n * n), |y, result| {
                dynamics.jacobian(t, y, &mut matrix);
                result.chunks_mut(n.max(1)).zip(&matrix).for_each(|(out, row)| out.copy_from_slice(&row.0));
            })
        })
    }

    /// Writes derivatives of rates along directions, which are behind the states in the rows of `pairs`, along a
    /// direction of the parameters and along the time.
    fn jvp(
        &self,
        py: Python<'_>,
        pairs: PyReadonlyArrayDyn<'_, f64>,
        along_params: Vec<f64>,
        t: f64,
        dt: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
    ) -> PyResult<()> {
        let n = self.info().state.len();
        let dual = |(value, derivative): (&f64, &f64)| Dual { value: *value, derivative: *derivative };
        let params: Vec<Dual> = self.values.iter().zip(&along_params).map(dual).collect();
        let (pairs, mut out) = (two_axes(pairs.as_array())?, two_axes_mut(out.as_array_mut())?);
        if along_params.len() != self.values.len()
            || pairs.ncols() != 2 * n
            || out.dim() != (pairs.nrows(), n)
        {
            return Err(other_shapes());
        }
        let done = || -> Result<(), Error> {
            // Their values are those that the scene was prepared with.
            let refused = |bad: hamel_run::dynamics::BadParams| Error::Options { reason: bad.to_string() };
            let duals = self.built().prepare_duals(&params).map_err(refused)?;
            let (mut y, mut dy) = (vec![Dual::constant(0.0); n], vec![Dual::constant(0.0); n]);
            let mut bad = Vec::new();
            for (k, (pair, mut out)) in pairs.rows().into_iter().zip(out.rows_mut()).enumerate() {
                y.iter_mut().enumerate().for_each(|(i, y)| *y = dual((&pair[i], &pair[n + i])));
                duals.rhs(dual((&t, &dt)), &y, &mut dy);
                out.iter_mut().zip(&dy).for_each(|(out, dy)| *out = dy.derivative);
                if dy.iter().any(|dy| !dy.derivative.is_finite()) {
                    bad.push((k, "the derivative of its rates is not finite".to_owned()));
                }
            }
            if bad.is_empty() { Ok(()) } else { Err(unusable_states(bad, pairs.nrows())) }
        };
        py.detach(done).or_raise(py)
    }

    /// Writes products of the transposed Jacobian with vectors, which are behind the states in the rows of `pairs`,
    /// `[n_states, 2 n]`, to the rows of `out`.
    fn vjp(
        &self,
        py: Python<'_>,
        pairs: PyReadonlyArrayDyn<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
        threads: Option<bool>,
    ) -> PyResult<()> {
        let (dynamics, n) = (self.dynamics(), self.info().state.len());
        let zeros = vec![0.0; n];
        // Derived when it is first asked for.
        let is_there = py.detach(|| dynamics.vjp(t, &zeros, &zeros)).map(drop);
        is_there
            .map_err(|reason| Error::unusable(format!("scene {}", self.info().scene), reason))
            .or_raise(py)?;
        let at = (pairs.as_array(), t, out.as_array_mut());
        let product = |y: &[f64], w: &[f64]| dynamics.vjp(t, y, w).ok();
        functions::of_pairs(py, dynamics, (n, n), at, (2 * self.cost(), threads), product)
    }

    /// Velocities of the state that have rates of their own: components of accelerations, rows of the mass matrix.
    #[getter]
    fn velocities(&self) -> Vec<String> {
        self.info().velocities.clone()
    }

    /// Names of the frames of the model.
    #[getter]
    fn frames(&self) -> Vec<String> {
        self.info().frames.clone()
    }

    /// Whether the scene has a function of that name.
    fn has(&self, name: &str) -> bool {
        self.built().executable().program.functions.iter().any(|function| function.role.name() == name)
    }

    /// Writes forces at accelerations, which are behind the states in the rows of `pairs`, `[n_states, n + m]`, to the
    /// rows of `out`, `[n_states, m]`.
    fn inverse_dynamics(
        &self,
        py: Python<'_>,
        pairs: PyReadonlyArrayDyn<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
        threads: Option<bool>,
    ) -> PyResult<()> {
        let (dynamics, sizes) = (self.dynamics(), (self.info().state.len(), self.info().velocities.len()));
        let at = (pairs.as_array(), t, out.as_array_mut());
        let forces = |y: &[f64], a: &[f64]| dynamics.inverse_dynamics(t, y, a);
        functions::of_pairs(py, dynamics, sizes, at, (self.cost(), threads), forces)
    }

    /// Files of the models that this one is the quotient of, and the variables of the map, where the scene has it.
    fn total(&self, py: Python<'_>) -> PyResult<(Vec<String>, Option<functions::TotalVariables>)> {
        py.detach(|| functions::total(&self.model, self.built().executable())).or_raise(py)
    }

    /// Writes the states, or the parameters, that the map gives for the rows of `total`, `[n_states, n + k]`, to the
    /// rows of `out`.
    fn quotient(
        &self,
        py: Python<'_>,
        of_params: bool,
        total: PyReadonlyArrayDyn<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
        threads: Option<bool>,
    ) -> PyResult<()> {
        let at = (total.as_array(), t, out.as_array_mut());
        functions::images(py, self.dynamics(), of_params, at, (self.cost(), threads))
    }

    /// Writes a matrix of each state, `[n_rows, n_columns]`, row by row, to the rows of `out`.
    fn matrix(
        &self,
        py: Python<'_>,
        name: &str,
        y: PyReadonlyArrayDyn<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
        threads: Option<bool>,
    ) -> PyResult<()> {
        let (dynamics, n) = (self.dynamics(), self.info().state.len());
        let (Some(want), Some(size)) = (Want::from_name(name), out.shape().get(1).copied()) else {
            return Err(other_shapes());
        };
        self.on_states(py, (&y, t), &mut out, (self.cost(), threads), |rows, out, n_states| {
            by_row(rows, out, n_states, (n, size), |y, result| {
                let found = dynamics.matrix(want, t, y).map(|rows| rows.concat());
                write(found.filter(|entries| entries.len() == size).as_deref(), result)
            })
        })
    }

    /// Writes the energies of states, `[n_states, 1]`.
    fn energy(
        &self,
        py: Python<'_>,
        y: PyReadonlyArrayDyn<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
        threads: Option<bool>,
    ) -> PyResult<()> {
        let (dynamics, n) = (self.dynamics(), self.info().state.len());
        self.on_states(py, (&y, t), &mut out, (self.cost(), threads), |rows, out, n_rows| {
            by_row(rows, out, n_rows, (n, 1), |y, result| {
                result[0] = dynamics.energy(t, y).unwrap_or(f64::NAN)
            })
        })
    }

    /// Writes all outputs of states, one group after the other.
    fn outputs_of(
        &self,
        py: Python<'_>,
        y: PyReadonlyArrayDyn<'_, f64>,
        t: f64,
        mut out: PyReadwriteArrayDyn<'_, f64>,
        threads: Option<bool>,
    ) -> PyResult<()> {
        let (dynamics, n, width) = (self.dynamics(), self.info().state.len(), self.info().n_outputs());
        self.on_states(py, (&y, t), &mut out, (4 * self.cost(), threads), |rows, out, n_rows| {
            by_row(rows, out, n_rows, (n, width), |y, result| result.copy_from_slice(&dynamics.outputs(t, y)))
        })
    }

    /// The text of the model reduced by the symmetries that are found, a line on each, and the dimension of the
    /// group, and the map from the model where it is known.
    fn reduce(&self, py: Python<'_>) -> PyResult<ReducedParts> {
        let reduced = || -> Result<_, Error> {
            let reduced = hamel_codegen::symmetry::reduce(&self.model)?;
            let map = reduced.map.map(|map| map.images.into_iter().collect());
            Ok((spec::format("reduced", &reduced.text)?, reduced.report, reduced.dim, map))
        };
        py.detach(reduced).or_raise(py)
    }

    /// A relative equilibrium near a guess, a family of them, or an orbit, as JSON. The times are the one that
    /// equations are frozen at, and the period of an orbit.
    #[pyo3(signature = (guess, keep, free, at_rest, times, along=None))]
    fn trim(
        &self,
        py: Python<'_>,
        guess: Vec<(String, f64)>,
        keep: Vec<(String, Option<f64>)>,
        free: Vec<String>,
        at_rest: bool,
        times: (Option<f64>, Option<f64>),
        along: Option<(String, f64, f64, usize)>,
    ) -> PyResult<String> {
        let (t, period) = times;
        let along = along.map(|(name, from, to, n_points)| Along { name, from, to, n_points });
        let own = |name: &String| along.as_ref().is_some_and(|along| along.name == *name);
        let names = self.info().params.iter().map(|p| p.name.clone());
        let set = names.zip(self.values.iter().copied()).filter(|(name, _)| !own(name)).collect();
        let held =
            |input: &ParamEntry| Some((input.name.clone(), self.table.as_ref()?.held_value(&input.name)?));
        let hold = self.info().inputs.iter().filter_map(held).filter(|(name, _)| !own(name)).collect();
        let asked = Asked {
            set,
            at: guess.into_iter().collect(),
            hold,
            keep,
            free,
            at_rest,
            t,
            along,
            period,
            dashes: "",
        };
        let find = || equilibria::find(&self.model, &self.info().scene, &asked);
        Ok(py.detach(find).or_raise(py)?.to_json().to_string())
    }

    /// Rates of the same states, `repeats` times in Rust alone, in seconds: `[arrays as Python has them, lanes]`. For
    /// measurements only.
    fn measured(
        &self,
        py: Python<'_>,
        y: PyReadonlyArrayDyn<'_, f64>,
        out: Bound<'_, PyArray2<f64>>,
        repeats: usize,
    ) -> PyResult<[f64; 2]> {
        use numpy::PyArrayMethods as _;
        let states = two_axes(y.as_array())?;
        let mut out = out.readwrite();
        let mut out = out.as_array_mut();
        let (n, n_rows) = (states.ncols(), states.nrows());
        let seconds = || {
            let (scene, rows) = (&self.prepared, Rows::of(states));
            // The first round fills the caches, here and below.
            rates(scene, 0.0, &rows, &mut RowsMut::of(out.view_mut()), n_rows, n);
            let clock = std::time::Instant::now();
            for _ in 0..repeats {
                rates(scene, 0.0, &rows, &mut RowsMut::of(out.view_mut()), n_rows, n);
            }
            let of_arrays = clock.elapsed().as_secs_f64();
            let Some(eight) = scene.eight() else { return [of_arrays, f64::NAN] };
            let mut lanes = vec![VecState(vec![F64x8::splat(0.0); n]); n_rows / F64x8::LANES];
            lanes.iter_mut().enumerate().for_each(|(k, lanes)| rows.lanes(k * F64x8::LANES, &mut lanes.0));
            let mut results = lanes.clone();
            let mut all = || {
                lanes.iter().zip(&mut results).for_each(|(y, dy)| eight.rhs(F64x8::splat(0.0), y, dy));
                std::hint::black_box(&mut results);
            };
            all();
            let clock = std::time::Instant::now();
            (0..repeats).for_each(|_| all());
            [of_arrays, clock.elapsed().as_secs_f64()]
        };
        Ok(py.detach(seconds))
    }
}
