//! A scene of a model, derived and lowered in this process, evaluated operation by operation or as machine code of the
//! same operations.
//!
//! Does not know: commands, files, JSON.

use std::sync::{Arc, OnceLock};

use hamel_codegen::scene::{
    self, BuiltScene, Derivative, DiscreteLayout, DiscretePart, Executable, Interpreter,
};
use hamel_codegen::spec::Want;
use hamel_program::program::{Counts, Function, Role, SeriesRoom};
use hamel_runtime::{Dual, F64x4, F64x8, Failure, Pivot, Wiener};

use super::constraint_rows::ConstraintRows;
use super::driving::{Driving, OnLanes, bad_params};
use super::dynamics::{
    BadParams, Dynamics, Factory, LaneDynamics as _, PositionEquations, PreparedDuals, PreparedLanes,
    PreparedScene, Several, SideBySide, VecState, lane_by_lane,
};
use super::guards::{check, domain, pivots};
use super::info::Info;
use super::inputs::{Drive, Driven, InputTable};
use super::machine;
use super::runnable::{Runnable, RunnableCircles, RunnableSeries};
use super::stored::{Stored, fits, output_entry};
use super::watched::Watched;
use crate::cache::Cache;
use crate::error::Error;
use crate::model::{self, Checked, Model};

/// A scene that this process evaluates.
#[derive(Debug)]
pub struct Built {
    model: Arc<Checked>,
    executable: Arc<Runnable>,
    /// Whether what is derived later is compiled, too.
    is_in_memory: bool,
    /// What drives the inputs; none where they are held.
    drive: Drive,
    info: Info,
    /// The scene with its equations, when something else is to be derived from them.
    derived: OnceLock<Option<Arc<BuiltScene>>>,
    /// The right-hand side on circles, made when first asked for; none where it does not pay.
    circles: OnceLock<Option<RunnableCircles>>,
    /// The recurrence of Taylor coefficients, derived when first asked for, if it exists.
    series: OnceLock<Option<RunnableSeries>>,
    /// The same with its invariants, when first asked for; none if there are none.
    invariants: OnceLock<Option<Runnable>>,
    /// The same with its equations between coordinates; none if there are none.
    positions: OnceLock<Option<Runnable>>,
    /// The same with the residuals of constraints that a state can violate, if there are any.
    residuals: OnceLock<Option<Box<Built>>>,
    /// The same with its exact flows, or why there are none.
    splitting: OnceLock<Result<Runnable, String>>,
    /// The same with products of its transposed Jacobian, or why there are none.
    vjp: OnceLock<Result<Runnable, String>>,
}

/// Derives and lowers a scene.
///
/// # Errors
/// [`Error::UnknownScene`], [`Error::Models`].
pub fn build(model: &Arc<Checked>, scene: &str) -> Result<Built, Error> {
    let mut derived = OnceLock::new();
    let is_sound = |stored: &Stored| stored.is_sound(&model.name, scene);
    let stored = model.cached("scene", scene, is_sound, || {
        let built = model.derive(scene)?;
        let stored = Stored::of(&model.name, &built);
        derived = OnceLock::from(Some(built));
        Ok(stored)
    })?;
    Ok(Built::new(model, stored, derived))
}

/// Derives and lowers a scene with everything that a report shows: see [`scene::build_pictured`].
///
/// # Errors
/// As [`build`].
pub fn build_pictured(model: &Model, scene: &str) -> Result<Built, Error> {
    let built = scene::build_pictured(model, scene)?;
    // Not the scene of this name that a cache keeps.
    let model = Arc::new(Checked::new(model.clone(), Cache::none()));
    let stored = Stored::of(&model.name, &built);
    Ok(Built::new(&model, stored, OnceLock::from(Some(Arc::new(built)))))
}

impl Built {
    fn new(model: &Arc<Checked>, stored: Stored, derived: OnceLock<Option<Arc<BuiltScene>>>) -> Built {
        let Stored { executable, info } = stored;
        Built::of(model, Arc::new(Runnable::new(executable, false)), None, info, derived)
    }

    fn of(
        model: &Arc<Checked>,
        executable: Arc<Runnable>,
        drive: Drive,
        info: Info,
        derived: OnceLock<Option<Arc<BuiltScene>>>,
    ) -> Built {
        Built {
            model: Arc::clone(model),
            is_in_memory: false,
            executable,
            drive,
            info,
            derived,
            circles: OnceLock::new(),
            series: OnceLock::new(),
            invariants: OnceLock::new(),
            positions: OnceLock::new(),
            residuals: OnceLock::new(),
            splitting: OnceLock::new(),
            vjp: OnceLock::new(),
        }
    }

    /// The same scene as machine code, whose functions are compiled when they are first called; interpreted still where
    /// there is no compiler for this machine.
    #[must_use]
    pub fn in_memory(self) -> Built {
        if !machine::IS_THERE {
            return self;
        }
        let Built { model, executable, drive, info, derived, .. } = self;
        // Nobody shares what is not compiled yet.
        let executable = match Arc::try_unwrap(executable) {
            Ok(own) => own.executable,
            Err(shared) => shared.executable.clone(),
        };
        let executable = Arc::new(Runnable::new(executable, true));
        Built { is_in_memory: true, ..Built::of(&model, executable, drive, info, derived) }
    }

    /// The same with code for these registers at most, to compare.
    #[cfg(test)]
    pub(crate) fn with_registers_up_to(mut self, most: machine::Registers) -> Built {
        if let Some(Runnable { compiled, .. }) = Arc::get_mut(&mut self.executable) {
            *compiled = compiled.take().map(|compiled| compiled.with_registers_up_to(most));
        }
        self
    }

    /// The same scene with inputs from a table.
    ///
    /// # Errors
    /// As [`InputTable::of_scene`].
    pub fn driven_by(self, table: &InputTable) -> Result<Built, Error> {
        let drive = Some(Arc::new(table.of_scene(&self.info)?));
        Ok(Built { drive, ..self })
    }

    /// The same scene and code with inputs from a table, beside this one.
    ///
    /// # Errors
    /// As [`InputTable::of_scene`].
    pub fn also_driven_by(&self, table: &InputTable) -> Result<Built, Error> {
        let drive = Some(Arc::new(table.of_scene(&self.info)?));
        let (executable, info) = (Arc::clone(&self.executable), self.info.clone());
        let driven = Built::of(&self.model, executable, drive, info, OnceLock::new());
        Ok(Built { is_in_memory: self.is_in_memory, ..driven })
    }

    /// Whether inputs are driven by a table, or held elsewhere than in the model.
    pub fn is_driven(&self) -> bool {
        self.drive.is_some()
    }

    /// Parameters, and the inputs behind them, if there are any.
    fn parted<'v, R>(&self, values: &'v [R]) -> (&'v [R], &'v [R]) {
        values.split_at(self.info.params.len().min(values.len()))
    }

    fn circles(&self) -> Option<&RunnableCircles> {
        let make = || Some(RunnableCircles::new(self.executable.circles()?, self.is_in_memory));
        self.circles.get_or_init(make).as_ref()
    }

    fn series(&self) -> Option<&RunnableSeries> {
        let make = || Some(RunnableSeries::new(self.executable.jet().ok()?, self.is_in_memory));
        self.series.get_or_init(make).as_ref()
    }

    /// The scene with its equations; none only by a bug, because it was derived before.
    fn derived(&self) -> Option<&BuiltScene> {
        self.derived.get_or_init(|| self.model.derive(&self.info.scene).ok()).as_deref()
    }

    /// The scene with the same parameters and state that has the residuals of the constraints that a state can violate,
    /// and the momenta; none if there are no such constraints.
    pub fn with_residuals(&self) -> Option<Built> {
        let Info { model, scene, .. } = &self.info;
        let is_sound = |stored: &Option<Stored>| {
            stored
                .as_ref()
                .is_none_or(|stored| stored.is_sound(model, scene) && fits(&stored.executable, &self.info))
        };
        let stored: Result<Option<Stored>, Error> = self.model.cached("residuals", scene, is_sound, || {
            let scene = self.derived().and_then(|scene| scene.with_residuals().ok()?);
            Ok(scene.map(|scene| {
                let outputs = scene.outputs().iter().map(output_entry).collect();
                let info = Info { outputs, has_energy: false, ..self.info.clone() };
                Stored { executable: scene.executable(), info }
            }))
        });
        stored.ok().flatten().map(|stored| Built::new(&self.model, stored, OnceLock::new()))
    }

    /// The scene, or another one in its state, that has these residuals.
    fn residual_scene(&self) -> Option<&Executable> {
        if self.info.output_range(Want::Constraint.name()).is_some() {
            return Some(self.executable());
        }
        let find = || {
            let is_hidden = self.model.hides_residuals(&self.info.scene).unwrap_or(true);
            is_hidden.then(|| self.with_residuals()).flatten().map(Box::new)
        };
        self.residuals.get_or_init(find).as_deref().map(Built::executable)
    }

    fn with_invariants(&self) -> Option<&Runnable> {
        self.invariants.get_or_init(|| self.also("invariants", |scene| scene.with_invariants().ok())).as_ref()
    }

    /// The scene with its invariants, if anything beside components of the state is conserved.
    pub(super) fn invariants_of_motion(&self) -> Option<&Executable> {
        self.with_invariants().map(|found| &**found)
    }

    fn with_positions(&self) -> Option<&Runnable> {
        let find = || {
            let has_some = model::has_positions(&self.model);
            has_some.then(|| self.also("positions", |scene| scene.with_positions().ok())).flatten()
        };
        self.positions.get_or_init(find).as_ref()
    }

    /// The scene with something else, kept by the name of that; none if it is not there.
    fn also(&self, what: &str, with: impl Fn(&BuiltScene) -> Option<BuiltScene>) -> Option<Runnable> {
        let is_sound =
            |found: &Option<Executable>| found.as_ref().is_none_or(|found| fits(found, &self.info));
        let found = self.model.cached(what, &self.info.scene, is_sound, || {
            Ok(self.derived().and_then(with).map(|scene| scene.executable()))
        });
        let found: Option<Executable> = found.ok().flatten();
        found.map(|executable| Runnable::new(executable, self.is_in_memory))
    }

    /// Whether a state can violate equations between coordinates.
    pub fn is_restricted(&self) -> bool {
        model::has_positions(&self.model) && self.derived().is_some_and(BuiltScene::is_restricted)
    }

    /// The scene with its equations between coordinates; none where it has none, or leaves out a coordinate in them.
    pub(super) fn equations_between_coordinates(&self) -> Option<&Executable> {
        self.with_positions().map(|found| &**found)
    }

    /// The components of the state that the equations between coordinates contain.
    pub fn components_in_positions(&self) -> Vec<usize> {
        self.with_positions().map_or_else(Vec::new, |found| found.components_in_positions())
    }

    /// Names of the residuals of the equations between coordinates, and of what coordinates keep beside them.
    pub fn position_names(&self) -> Vec<String> {
        self.with_positions().map_or_else(Vec::new, |found| found.position_names())
    }

    /// The scene with its exact flows, or why it has none.
    fn with_splitting(&self) -> Result<&Runnable, String> {
        let find = || self.also_or_why("splitting", |scene| scene.with_splitting().map_err(why_unsplit));
        self.splitting.get_or_init(find).as_ref().map_err(Clone::clone)
    }

    /// The scene with products of its transposed Jacobian, or why it has none.
    fn with_vjp(&self) -> Result<&Runnable, String> {
        let why = |error| format!("has no products of its transposed Jacobian: {error}");
        let find = || self.also_or_why("vjp", |scene| scene.with_vjp().map_err(why));
        self.vjp.get_or_init(find).as_ref().map_err(Clone::clone)
    }

    /// As [`also`](Self::also), or why there is none.
    fn also_or_why(
        &self,
        what: &str,
        with: impl Fn(&BuiltScene) -> Result<BuiltScene, String>,
    ) -> Result<Runnable, String> {
        let is_sound = |found: &Option<Result<Executable, String>>| {
            found.iter().flatten().all(|found| fits(found, &self.info))
        };
        let found = self.model.cached(what, &self.info.scene, is_sound, || {
            Ok(self.derived().map(|scene| with(scene).map(|scene| scene.executable())))
        });
        let found: Result<Executable, String> =
            found.ok().flatten().unwrap_or_else(|| Err("could not be derived again".to_owned()));
        found.map(|executable| Runnable::new(executable, self.is_in_memory))
    }

    /// The events of the scene, if it has any.
    pub fn watched(&self) -> Option<Watched> {
        Watched::of(&self.executable)
    }

    /// What it takes to run the scene, over any scalar.
    pub fn executable(&self) -> &Executable {
        &self.executable
    }

    /// Operations of one evaluation of the right-hand side.
    pub fn rhs_counts(&self) -> Counts {
        // Every scene has a right-hand side.
        self.executable.program.function(&Role::Rate).map_or_else(Counts::default, Function::counts)
    }
}

/// Why a scene has no exact flows, after its name.
fn why_unsplit(error: hamel_codegen::error::Error) -> String {
    match error {
        hamel_codegen::error::Error::NoSplitting { reason } => {
            format!("is not split into exact flows: {reason}")
        }
        other => format!("is not split into exact flows: {other}"),
    }
}

impl Built {
    /// On lanes, in machine code where the scene is compiled, otherwise one after the other.
    fn prepare_several<L: Several>(&self, values: &[L]) -> Result<PreparedLanes<'_, L>, BadParams> {
        let (params, inputs) = self.parted(values);
        match self.executable.prepare_lanes((params, inputs), &self.drive) {
            Some(lanes) => Ok(Box::new(lanes.map_err(bad_params)?)),
            None => SideBySide::boxed(self, values),
        }
    }

    /// With values for the inputs in the place of what drives them, or none.
    fn prepare_driven(
        &self,
        (params, inputs): (&[f64], &[f64]),
        drive: &Drive,
    ) -> Result<PreparedScene<'_>, BadParams> {
        let interpreter = self.executable.prepare(params).map_err(bad_params)?;
        Ok(PreparedScene::new(Interpreted {
            built: self,
            params: params.to_vec(),
            inputs: inputs.to_vec(),
            interpreter: Driving::held(interpreter).driven(drive).holding(inputs),
            invariants: OnceLock::new(),
            positions: OnceLock::new(),
            constraint_rows: OnceLock::new(),
            splitting: OnceLock::new(),
            vjp: OnceLock::new(),
            lanes: OnceLock::new(),
        }))
    }
}

impl Factory for Built {
    fn info(&self) -> &Info {
        &self.info
    }

    fn prepare(&self, values: &[f64]) -> Result<PreparedScene<'_>, BadParams> {
        let (params, inputs) = self.parted(values);
        self.prepare_driven((params, inputs), &self.drive)
    }

    fn prepare_noisy(&self, values: &[f64], noise: Wiener) -> Result<PreparedScene<'_>, BadParams> {
        let (params, held) = self.parted(values);
        let drive = Driven::noisy(&self.info, self.drive.as_deref(), held, noise);
        self.prepare_driven((params, &[]), &Some(Arc::new(drive)))
    }

    fn prepare_lanes(&self, values: &[F64x4]) -> Result<PreparedLanes<'_>, BadParams> {
        self.prepare_several(values)
    }

    fn prepare_eight_lanes(&self, values: &[F64x8]) -> Result<PreparedLanes<'_, F64x8>, BadParams> {
        self.prepare_several(values)
    }

    fn prepare_duals(&self, values: &[Dual]) -> Result<PreparedDuals<'_>, BadParams> {
        let (params, inputs) = self.parted(values);
        let interpreter = self.executable.prepare_over(params).map_err(bad_params)?;
        Ok(Box::new(Driving::held(interpreter).driven(&self.drive).holding(inputs)))
    }
}

struct Interpreted<'a> {
    built: &'a Built,
    params: Vec<f64>,
    /// What the inputs are held at in the place of what drives them; empty unless they are.
    inputs: Vec<f64>,
    interpreter: Driving<'a>,
    /// The interpreter of the scene with invariants.
    invariants: OnceLock<Option<Interpreter<'a>>>,
    /// The interpreter of the scene with its equations between coordinates.
    positions: OnceLock<Option<Interpreter<'a>>>,
    /// Derivatives of the residuals of constraints.
    constraint_rows: OnceLock<Option<ConstraintRows<'a>>>,
    /// The interpreter of the scene with exact flows.
    splitting: OnceLock<Option<Interpreter<'a>>>,
    /// What evaluates products of the transposed Jacobian.
    vjp: OnceLock<Option<Driving<'a>>>,
    /// The same parameters on every lane, when first asked for; none where the scene is interpreted.
    lanes: OnceLock<Option<OnLanes<'a>>>,
}

impl<'a> Interpreted<'a> {
    fn with_splitting(&self) -> Option<&Interpreter<'a>> {
        let prepare = || self.built.with_splitting().ok()?.prepare(&self.params).ok();
        self.splitting.get_or_init(prepare).as_ref()
    }

    /// Products of the transposed Jacobian with the inputs of the scene.
    fn with_vjp(&self) -> Option<&Driving<'a>> {
        let prepare = || {
            let held = Driving::held(self.built.with_vjp().ok()?.prepare(&self.params).ok()?);
            Some(held.driven(&self.interpreter.drive).holding(&self.inputs))
        };
        self.vjp.get_or_init(prepare).as_ref()
    }

    fn with_positions(&self) -> Option<&Interpreter<'a>> {
        let prepare = || self.built.with_positions()?.prepare(&self.params).ok();
        self.positions.get_or_init(prepare).as_ref()
    }

    fn with_residuals(&self) -> Option<&ConstraintRows<'a>> {
        let find = || {
            let known = (self.built.residual_scene()?, &self.built.info);
            ConstraintRows::new(known, &self.built.model, &self.params)
        };
        self.constraint_rows.get_or_init(find).as_ref()
    }

    /// The same parameters on every lane, where the scene is compiled.
    fn on_lanes(&self) -> Option<&OnLanes<'a>> {
        let prepare = || {
            let [params, inputs] = [&self.params, &self.inputs]
                .map(|values| values.iter().copied().map(F64x4::splat).collect::<Vec<F64x4>>());
            self.built.executable.prepare_lanes((&params, &inputs), &self.interpreter.drive)?.ok()
        };
        self.lanes.get_or_init(prepare).as_ref()
    }

    fn with_invariants(&self) -> Option<&Interpreter<'a>> {
        let prepare = || self.built.with_invariants()?.prepare(&self.params).ok();
        self.invariants.get_or_init(prepare).as_ref()
    }
}

impl Dynamics for Interpreted<'_> {
    fn info(&self) -> &Info {
        &self.built.info
    }

    fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        self.interpreter.at(t).rhs(t, y, dy);
    }

    fn hold(&mut self, inputs: &[f64]) -> bool {
        if inputs.len() != self.inputs.len() {
            return false;
        }
        if !inputs.is_empty() {
            self.inputs.copy_from_slice(inputs);
            self.interpreter.interpreter.set_inputs(inputs);
            // Those on lanes are prepared again when they are asked for.
            self.lanes.take();
            if let Some(Some(vjp)) = self.vjp.get_mut() {
                vjp.interpreter.set_inputs(inputs);
            }
        }
        true
    }

    fn inputs_at(&self, t: f64) -> Option<Vec<f64>> {
        let drive = self.interpreter.drive.as_ref();
        drive
            .map(|drive| drive.at(t))
            .or_else(|| Some(self.inputs.clone()).filter(|inputs| !inputs.is_empty()))
    }

    fn n_circles(&self) -> usize {
        self.built.circles().map_or(0, |found| found.circles.n_angles)
    }

    fn on_circles(&self, y: &[f64], z: &mut [f64]) {
        if let Some(found) = self.built.circles() {
            self.interpreter.interpreter.on_circles_by(found.run(), &found.circles, y, z);
        }
    }

    fn rhs_on_circles(&self, t: f64, z: &[f64], dz: &mut [f64]) {
        if let Some(found) = self.built.circles() {
            self.interpreter.at(t).rhs_on_circles_by(found.run(), t, z, dz);
        }
    }

    fn rhs_on_circles_on_lanes(&self, t: F64x4, z: &VecState<F64x4>, dz: &mut VecState<F64x4>) {
        let run = self.built.circles().and_then(|found| found.compiled.as_ref());
        match (self.on_lanes(), run) {
            (Some(lanes), Some(run)) => lanes.driving.at(t).rhs_on_circles_by(run, t, &z.0, &mut dz.0),
            _ => lane_by_lane(z, dz, |k, z, dz| self.rhs_on_circles(t.lane(k), z, dz)),
        }
    }

    fn rhs_on_lanes(&self, t: F64x4, y: &VecState<F64x4>, dy: &mut VecState<F64x4>) {
        match self.on_lanes() {
            Some(lanes) => lanes.rhs(t, y, dy),
            None => lane_by_lane(y, dy, |k, y, dy| self.rhs(t.lane(k), y, dy)),
        }
    }

    fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        self.interpreter.at(t).energy(t, y)
    }

    fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        self.interpreter.at(t).outputs(t, y)
    }

    fn series(
        &self,
        (t, towards): (f64, f64),
        y: &[f64],
        room: &mut SeriesRoom,
        out: &mut [VecState],
    ) -> Option<f64> {
        let series = self.built.series()?;
        let mut out: Vec<&mut [f64]> = out.iter_mut().map(|state| state.0.as_mut_slice()).collect();
        let Driving { interpreter, drive } = &self.interpreter;
        let (inputs, until) = drive.as_ref().map(|drive| drive.piece((t, towards))).unzip();
        interpreter.series_by((&series.jet, series.run()), room, (t, y), inputs.as_deref(), &mut out);
        Some(until.unwrap_or(towards))
    }

    fn vjp(&self, t: f64, y: &[f64], w: &[f64]) -> Result<Vec<f64>, String> {
        self.built.with_vjp()?;
        let product = self.with_vjp().and_then(|vjp| vjp.at(t).product(Derivative::Vjp, t, y, w));
        product.ok_or_else(|| "does not allow the values of the parameters".to_owned())
    }

    fn jacobian(&self, t: f64, y: &[f64], rows: &mut [VecState]) {
        let mut rows: Vec<&mut [f64]> = rows.iter_mut().map(|row| row.0.as_mut_slice()).collect();
        self.interpreter.at(t).rhs_jacobian(t, y, &mut rows);
    }

    fn inverse_dynamics(&self, t: f64, y: &[f64], a: &[f64]) -> Option<Vec<f64>> {
        self.interpreter.at(t).inverse_dynamics(t, y, a)
    }

    fn quotient(&self, of_params: bool, t: f64, total: &[f64]) -> Option<Vec<f64>> {
        let interpreter = self.interpreter.at(t);
        match of_params {
            true => interpreter.quotient_parameters(t, total),
            false => interpreter.quotient(t, total),
        }
    }

    fn matrix(&self, want: Want, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.interpreter.at(t).matrix_of(want, t, y)
    }

    fn rhs_cost(&self) -> u64 {
        self.built.rhs_counts().cost()
    }

    fn n_invariants(&self) -> usize {
        self.built.with_invariants().map_or(0, |found| found.n_invariants())
    }

    fn invariants(&self, t: f64, y: &[f64], values: &mut [f64]) {
        if let Some(found) = self.with_invariants().and_then(|i| i.invariants(t, y)) {
            values.copy_from_slice(&found);
        }
    }

    fn invariant_gradients(&self, t: f64, y: &[f64], gradients: &mut [VecState]) {
        let rows = self.with_invariants().and_then(|i| i.invariant_gradients(t, y)).unwrap_or_default();
        gradients.iter_mut().zip(rows).for_each(|(gradient, row)| gradient.0 = row);
    }

    fn positions(&self) -> Option<PositionEquations<'_>> {
        let found = self.built.with_positions()?;
        let layout = found.positions.as_ref()?;
        let n_functions = found.position_names().len();
        Some(PositionEquations { n_functions, n_equations: layout.n_equations, moved: &layout.moved })
    }

    fn position_residuals(&self, t: f64, y: &[f64], values: &mut [f64]) {
        if let Some(found) = self.with_positions().and_then(|i| i.positions(t, y)) {
            values.copy_from_slice(&found);
        }
    }

    fn position_gradients(&self, t: f64, y: &[f64], gradients: &mut [VecState]) {
        let rows = self.with_positions().and_then(|i| i.position_gradients(t, y)).unwrap_or_default();
        gradients.iter_mut().zip(rows).for_each(|(gradient, row)| gradient.0 = row);
    }

    fn constraint_rows(&self, t: f64, y: &[f64]) -> Vec<VecState> {
        self.with_residuals().map_or_else(Vec::new, |rows| rows.at(t, y))
    }

    fn constraint_residuals(&self, t: f64, y: &[f64]) -> Vec<f64> {
        self.with_residuals().map_or_else(Vec::new, |rows| rows.residuals(t, y))
    }

    fn discrete(&self) -> Option<&DiscreteLayout> {
        self.built.executable.discrete.as_ref()
    }

    fn discrete_of(&self, part: DiscretePart, t: f64, variables: &[f64], out: &mut [f64]) {
        let middle = t + 0.5 * variables[0];
        if !self.interpreter.at(middle).discrete(part, t, variables, out) {
            out.fill(f64::NAN);
        }
    }

    fn flows(&self) -> Result<usize, String> {
        self.built.with_splitting().map(|found| found.n_flows())
    }

    fn flow(&self, index: usize, tau: f64, y: &[f64], increment: &mut [f64]) {
        let is_there = self.with_splitting().is_some_and(|i| i.flow(index, tau, y, increment));
        if !is_there {
            increment.fill(f64::NAN);
        }
    }

    fn check(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        check(&self.interpreter.at(t), t, y)
    }

    fn domain(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        domain(&self.interpreter.at(t), t, y)
    }

    fn signature(&self, t: f64, y: &[f64]) -> f64 {
        self.interpreter.at(t).signature(t, y)
    }

    fn pivots(&self, t: f64, y: &[f64], visit: &mut dyn FnMut(Pivot<f64>)) {
        pivots(&self.interpreter.at(t), t, y, visit);
    }
}
