//! A scene of a model, derived and lowered in this process, evaluated operation by operation or as machine code of the
//! same operations.
//!
//! Does not know: commands, files, JSON.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, OnceLock};

use hamel_codegen::expr::rational_to_f64;
use hamel_codegen::program::{Counts, Function, Jet, Point, Role, Run as _, ViolatedCondition};
use hamel_codegen::scene::{self, BuiltScene, Executable, Interpreter};
use hamel_codegen::spec;
use hamel_jit::Compiled;
use hamel_runtime::{Dual, F64x4, Failure, Pivot, Real as _};
use serde::{Deserialize, Serialize};

use super::dynamics::{
    BadParams, DualRates, Dynamics, Factory, LaneDynamics, PreparedLanes, PreparedScene, SideBySide, VecState,
    lane_by_lane,
};
use super::info::{Info, OutputEntry, ParamEntry};
use super::watched::Watched;
use crate::cache::Cache;
use crate::error::Error;
use crate::model::{Checked, Model};

/// A scene that this process evaluates.
#[derive(Debug)]
pub struct Built {
    model: Arc<Checked>,
    executable: Executable,
    /// Its machine code; none where the scene is interpreted.
    compiled: Option<Compiled>,
    info: Info,
    /// The scene with its equations, when something else is to be derived from them.
    derived: OnceLock<Option<BuiltScene>>,
    /// The same with its invariants, when first asked for; none if there are none.
    invariants: OnceLock<Option<Executable>>,
}

/// What is kept of a scene.
#[derive(Debug, Serialize, Deserialize)]
struct Stored {
    executable: Executable,
    info: Info,
}

impl Stored {
    fn of(model: &str, scene: &BuiltScene) -> Stored {
        let param = |p: &spec::Param| ParamEntry {
            name: p.name.clone(),
            default: rational_to_f64(&p.default),
            doc: p.doc.clone(),
        };
        let info = Info {
            model: model.to_owned(),
            scene: scene.name.clone(),
            state: scene.state_names(),
            momenta: momenta(scene),
            params: scene.params().iter().map(param).collect(),
            outputs: scene.outputs().iter().map(output_entry).collect(),
            has_energy: scene.has_energy(),
            conserves_energy: scene.has_energy() && scene.equations.facts.energy_is_conserved,
        };
        Stored { executable: scene.executable(), info }
    }
}

/// Components of a state in the place of velocities of the model.
fn momenta(scene: &BuiltScene) -> Vec<String> {
    let carried = scene.equations.system.momenta.iter().filter(|m| m.symbol.is_some()).map(|m| &m.name);
    let others = scene.legendre().momenta.iter().map(|(name, _)| name);
    let mut names: Vec<String> = carried.chain(others).cloned().collect();
    names.sort();
    names.dedup();
    names
}

fn output_entry(output: &hamel_codegen::mechanics::Output) -> OutputEntry {
    OutputEntry {
        name: output.name.clone(),
        components: output.components.iter().map(|(name, _)| name.clone()).collect(),
        doc: output.doc.clone(),
    }
}

/// Derives and lowers a scene.
///
/// # Errors
/// [`Error::UnknownScene`], [`Error::Models`].
pub fn build(model: &Arc<Checked>, scene: &str) -> Result<Built, Error> {
    let mut derived = OnceLock::new();
    let stored = model.cached("scene", scene, || {
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
    Ok(Built::new(&model, stored, OnceLock::from(Some(built))))
}

impl Built {
    fn new(model: &Arc<Checked>, stored: Stored, derived: OnceLock<Option<BuiltScene>>) -> Built {
        let Stored { executable, info } = stored;
        let compiled = None;
        Built { model: Arc::clone(model), executable, compiled, info, derived, invariants: OnceLock::new() }
    }

    /// The same scene as machine code, whose functions are compiled when they are first called; interpreted still where
    /// there is no compiler for this machine.
    #[must_use]
    pub fn in_memory(self) -> Built {
        let compiled = Compiled::new(&self.executable.program);
        if let Err(reason) = &compiled {
            eprintln!("note: {reason}; the scene is interpreted");
        }
        Built { compiled: compiled.ok(), ..self }
    }

    /// The scene with its equations; none only by a bug, because it was derived before.
    fn derived(&self) -> Option<&BuiltScene> {
        self.derived.get_or_init(|| self.model.derive(&self.info.scene).ok()).as_ref()
    }

    /// The scene with the same parameters and state that has the residuals of the constraints that a state can violate,
    /// and the momenta; none if there are no such constraints.
    pub fn with_residuals(&self) -> Option<Built> {
        let stored: Result<Option<Stored>, Error> = self.model.cached("residuals", &self.info.scene, || {
            let scene = self.derived().and_then(|scene| scene.with_residuals().ok()?);
            Ok(scene.map(|scene| {
                let outputs = scene.outputs().iter().map(output_entry).collect();
                let info = Info { outputs, has_energy: false, ..self.info.clone() };
                Stored { executable: scene.executable(), info }
            }))
        });
        stored.ok().flatten().map(|stored| Built::new(&self.model, stored, OnceLock::new()))
    }

    fn with_invariants(&self) -> Option<&Executable> {
        let find = || {
            let found = self.model.cached("invariants", &self.info.scene, || {
                let scene = self.derived().and_then(|scene| scene.with_invariants().ok());
                Ok(scene.map(|scene| scene.executable()))
            });
            found.ok().flatten()
        };
        self.invariants.get_or_init(find).as_ref()
    }

    /// The events of the scene, if it has any.
    pub fn watched(&self) -> Option<Watched> {
        Watched::of(&self.executable)
    }

    /// Operations of one evaluation of the right-hand side.
    pub fn rhs_counts(&self) -> Counts {
        // Every scene has a right-hand side.
        self.executable.program.function(&Role::Rate).map_or_else(Counts::default, Function::counts)
    }
}

impl Built {
    fn interpreted(&self, values: &[f64]) -> Result<Interpreted<'_>, BadParams> {
        let interpreter = match &self.compiled {
            Some(compiled) => self.executable.prepare_on(compiled, values),
            None => self.executable.prepare(values),
        };
        Ok(Interpreted {
            built: self,
            params: values.to_vec(),
            interpreter: interpreter.map_err(bad_params)?,
            jet: OnceLock::new(),
            invariants: OnceLock::new(),
            lanes: OnceLock::new(),
        })
    }

}

/// The machine code of a scene on lanes with parameters of their own.
struct OnLanes<'a> {
    compiled: &'a Compiled,
    params: Vec<F64x4>,
    prepared: Vec<F64x4>,
}

impl<'a> OnLanes<'a> {
    fn new(compiled: &'a Compiled, params: &[F64x4]) -> Result<OnLanes<'a>, BadParams> {
        let prepared = compiled.program().prepare(params).map_err(bad_params)?;
        Ok(OnLanes { compiled, params: params.to_vec(), prepared })
    }

    fn call(&self, function_idx: usize, t: F64x4, state: &[F64x4], out: &mut [F64x4]) {
        let point = Point { t, state, argument: &[] };
        self.compiled.run_on_lanes(function_idx, &self.params, &self.prepared, point, out);
    }

    /// The function in a role and its values; none where the scene does not have it.
    fn values(&self, role: &Role, t: F64x4, y: &VecState<F64x4>) -> Option<(&'a Function, Vec<F64x4>)> {
        let k = self.compiled.program().function_idx(role)?;
        let function = &self.compiled.program().functions[k];
        let mut out = vec![F64x4::ZERO; function.results.len()];
        self.call(k, t, &y.0, &mut out);
        Some((function, out))
    }

    /// Calls `visit` with all pivots until it fails.
    fn visit_pivots(
        &self,
        t: F64x4,
        y: &VecState<F64x4>,
        mut visit: impl FnMut(&str, Pivot<F64x4>) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let Some((function, out)) = self.values(&Role::Pivots, t, y) else { return Ok(()) };
        let (values, scales) = out.split_at(out.len() / 2);
        let pivots = function.results.iter().zip(values).zip(scales);
        pivots.into_iter().try_for_each(|(((name, _), value), scale)| {
            visit(name, Pivot { name: "", value: *value, scale: *scale })
        })
    }
}

impl LaneDynamics for OnLanes<'_> {
    fn rhs(&self, t: F64x4, y: &VecState<F64x4>, dy: &mut VecState<F64x4>) {
        if let Some(k) = self.compiled.program().function_idx(&Role::Rate) {
            self.call(k, t, &y.0, &mut dy.0);
        }
    }

    fn check(&self, t: F64x4, y: &VecState<F64x4>) -> Result<(), Failure> {
        self.visit_pivots(t, y, |name, pivot| {
            let verified = pivot.verify(t);
            verified.or_else(|_| Pivot { name: interned(name.to_owned()), ..pivot }.verify(t))
        })
    }

    fn domain(&self, t: F64x4, y: &VecState<F64x4>) -> Result<(), Failure> {
        let Some((function, out)) = self.values(&Role::Domain, t, y) else { return Ok(()) };
        let broken = out.iter().position(|value| !value.all_gt(F64x4::ZERO));
        broken.map_or(Ok(()), |k| {
            let condition = interned(function.results[k].0.clone());
            Err(Failure::OutsideDomain { t: t.lane(0), condition })
        })
    }

    fn signature(&self, t: F64x4, y: &VecState<F64x4>) -> F64x4 {
        self.values(&Role::Signature, t, y).map_or(F64x4::ZERO, |(_, out)| out[0])
    }

    fn pivots(&self, t: F64x4, y: &VecState<F64x4>, visit: &mut dyn FnMut(Pivot<F64x4>)) {
        // Visiting does not fail.
        let _ = self.visit_pivots(t, y, |name, pivot| {
            visit(Pivot { name: interned(name.to_owned()), ..pivot });
            Ok(())
        });
    }
}

fn bad_params(bad: ViolatedCondition) -> BadParams {
    BadParams { condition: bad.condition, meaning: bad.meaning }
}

impl Factory for Built {
    fn info(&self) -> &Info {
        &self.info
    }

    fn prepare(&self, values: &[f64]) -> Result<PreparedScene<'_>, BadParams> {
        Ok(PreparedScene::new(self.interpreted(values)?))
    }

    fn prepare_lanes(&self, values: &[F64x4]) -> Result<PreparedLanes<'_>, BadParams> {
        match &self.compiled {
            Some(compiled) => Ok(Box::new(OnLanes::new(compiled, values)?)),
            None => SideBySide::boxed(self, values),
        }
    }

    fn prepare_duals(&self, values: &[Dual]) -> Result<DualRates<'_>, BadParams> {
        let rates = self.executable.prepare_rates(values).map_err(bad_params)?;
        Ok(Box::new(move |t, y, dy| rates.rhs(t, y, dy)))
    }
}

struct Interpreted<'a> {
    built: &'a Built,
    params: Vec<f64>,
    interpreter: Interpreter<'a>,
    /// The recurrence of Taylor coefficients, derived when first asked for; none where the right-hand side runs through
    /// tables.
    jet: OnceLock<Option<Jet>>,
    /// The interpreter of the scene with invariants.
    invariants: OnceLock<Option<Interpreter<'a>>>,
    /// The same parameters on every lane, when first asked for; none where it is interpreted.
    lanes: OnceLock<Option<OnLanes<'a>>>,
}

impl<'a> Interpreted<'a> {
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
        self.interpreter.rhs(t, y, dy);
    }

    fn rhs_on_lanes(&self, t: F64x4, y: &VecState<F64x4>, dy: &mut VecState<F64x4>) {
        let on_lanes = || {
            let params: Vec<F64x4> = self.params.iter().copied().map(F64x4::splat).collect();
            OnLanes::new(self.built.compiled.as_ref()?, &params).ok()
        };
        match self.lanes.get_or_init(on_lanes) {
            Some(rates) => rates.rhs(t, y, dy),
            None => lane_by_lane(y, dy, |k, y, dy| self.rhs(t.lane(k), y, dy)),
        }
    }

    fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        self.interpreter.energy(t, y)
    }

    fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        self.interpreter.outputs(t, y)
    }

    fn series(&self, t: f64, y: &[f64], out: &mut [VecState]) -> bool {
        let Some(jet) = self.jet.get_or_init(|| self.built.executable.jet().ok()) else { return false };
        let mut out: Vec<&mut [f64]> = out.iter_mut().map(|state| state.0.as_mut_slice()).collect();
        self.interpreter.series(jet, t, y, &mut out);
        true
    }

    fn jacobian(&self, t: f64, y: &[f64], rows: &mut [VecState]) {
        let mut rows: Vec<&mut [f64]> = rows.iter_mut().map(|row| row.0.as_mut_slice()).collect();
        self.interpreter.rhs_jacobian(t, y, &mut rows);
    }

    fn rhs_cost(&self) -> Option<u64> {
        Some(self.built.rhs_counts().cost())
    }

    fn n_invariants(&self) -> Option<usize> {
        Some(self.built.with_invariants().map_or(0, Executable::n_invariants))
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

    fn check(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        self.interpreter.pivots(t, y).into_iter().try_for_each(|(name, value, scale)| {
            let verified = Pivot { name: "", value, scale }.verify(t);
            verified.or_else(|_| Pivot { name: interned(name.to_owned()), value, scale }.verify(t))
        })
    }

    fn domain(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        let outside = |condition| Failure::OutsideDomain { t, condition: interned(condition) };
        self.interpreter.domain(t, y).map_err(outside)
    }

    fn signature(&self, t: f64, y: &[f64]) -> f64 {
        self.interpreter.signature(t, y)
    }

    fn pivots(&self, t: f64, y: &[f64], visit: &mut dyn FnMut(Pivot<f64>)) {
        for (name, value, scale) in self.interpreter.pivots(t, y) {
            visit(Pivot { name: interned(name.to_owned()), value, scale });
        }
    }
}

/// The runtime's failures borrow from the program for ever, so each pivot's name and each condition is kept once.
fn interned(name: String) -> &'static str {
    static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut kept = KEPT.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(known) = kept.get(name.as_str()) {
        return known;
    }
    let name: &'static str = name.leak();
    kept.insert(name);
    name
}
