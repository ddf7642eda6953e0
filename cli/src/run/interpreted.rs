//! A scene of a model, derived and lowered in this process, evaluated operation by operation.
//!
//! Does not know: commands, files, JSON.

use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::OnceLock;

use hamel_codegen::expr::rational_to_f64;
use hamel_codegen::program::{Counts, Function, Jet, Role};
use hamel_codegen::scene::{self, BuiltScene, Interpreter};
use hamel_codegen::spec;
use hamel_runtime::{Failure, Pivot};

use super::dynamics::{BadParams, Dynamics, Factory, Info, OutputEntry, ParamEntry, PreparedScene, VecState};
use crate::error::Error;
use crate::model::{Model, scene_names};

/// A scene that the interpreter evaluates.
#[derive(Debug)]
pub struct Built {
    scene: BuiltScene,
    info: Info,
    /// The same with its invariants, built when first asked for; none if there are none.
    with_invariants: OnceLock<Option<BuiltScene>>,
}

/// Derives and lowers a scene.
///
/// # Errors
/// [`Error::UnknownScene`], [`Error::Models`].
pub fn build(model: &Model, scene_name: &str) -> Result<Built, Error> {
    let mut known = scene_names(model);
    if !known.iter().any(|k| k == scene::DERIVATIVES) {
        // Built when it is asked for: it is emitted only for models that declare it.
        known.push(scene::DERIVATIVES.to_owned());
    }
    if !known.iter().any(|k| k == scene_name) {
        return Err(Error::UnknownScene { model: model.name.clone(), name: scene_name.into(), known });
    }
    Ok(built(model, scene::build(model, scene_name)?))
}

/// Derives and lowers a scene with everything that a report shows: see [`scene::build_pictured`].
///
/// # Errors
/// As [`build`].
pub fn build_pictured(model: &Model, scene_name: &str) -> Result<Built, Error> {
    Ok(built(model, scene::build_pictured(model, scene_name)?))
}

fn built(model: &Model, scene: BuiltScene) -> Built {
    let param = |p: &spec::Param| ParamEntry {
        name: p.name.clone(),
        default: rational_to_f64(&p.default),
        doc: p.doc.clone(),
    };
    let info = Info {
        model: model.name.clone(),
        scene: scene.name.clone(),
        state: scene.state_names(),
        params: scene.params().iter().map(param).collect(),
        outputs: scene.outputs().iter().map(output_entry).collect(),
        has_energy: scene.has_energy(),
        conserves_energy: scene.has_energy() && scene.equations.facts.energy_is_conserved,
    };
    Built { scene, info, with_invariants: OnceLock::new() }
}

fn output_entry(output: &hamel_codegen::mechanics::Output) -> OutputEntry {
    OutputEntry {
        name: output.name.clone(),
        components: output.components.iter().map(|(name, _)| name.clone()).collect(),
        doc: output.doc.clone(),
    }
}

impl Built {
    /// What was derived and lowered.
    pub(crate) fn scene(&self) -> &BuiltScene {
        &self.scene
    }

    /// The scene with the same parameters and state that has the residuals of the constraints that a state can violate, and
    /// the momenta; none if there are no such constraints.
    pub fn with_residuals(&self) -> Option<Built> {
        let scene = self.scene.with_residuals().ok()??;
        let outputs = scene.outputs().iter().map(output_entry).collect();
        let info = Info { outputs, has_energy: false, ..self.info.clone() };
        Some(Built { scene, info, with_invariants: OnceLock::new() })
    }

    /// Operations of one evaluation of the right-hand side.
    pub fn rhs_counts(&self) -> Counts {
        let program = &self.scene.program;
        // Every scene has a right-hand side.
        program.function(&Role::Rate).map_or_else(Counts::default, Function::counts)
    }
}

impl Factory for Built {
    fn info(&self) -> &Info {
        &self.info
    }

    fn prepare(&self, values: &[f64]) -> Result<PreparedScene<'_>, BadParams> {
        let interpreter = self
            .scene
            .prepare(values)
            .map_err(|bad| BadParams { condition: bad.condition, meaning: bad.meaning })?;
        let (jet, invariants) = (OnceLock::new(), OnceLock::new());
        Ok(Box::new(Interpreted { built: self, params: values.to_vec(), interpreter, jet, invariants }))
    }
}

struct Interpreted<'a> {
    built: &'a Built,
    params: Vec<f64>,
    interpreter: Interpreter<'a>,
    /// The recurrence of Taylor coefficients, derived when first asked for; none only by a bug of the generator.
    jet: OnceLock<Option<Jet>>,
    /// The interpreter of the scene with invariants.
    invariants: OnceLock<Option<Interpreter<'a>>>,
}

impl<'a> Interpreted<'a> {
    fn with_invariants(&self) -> Option<&Interpreter<'a>> {
        let interpreter = self.invariants.get_or_init(|| {
            let scene = self.built.with_invariants.get_or_init(|| self.built.scene.with_invariants().ok());
            scene.as_ref()?.prepare(&self.params).ok()
        });
        interpreter.as_ref()
    }
}

impl Dynamics for Interpreted<'_> {
    fn info(&self) -> &Info {
        &self.built.info
    }

    fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        self.interpreter.rhs(t, y, dy);
    }

    fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        self.interpreter.energy(t, y)
    }

    fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        self.interpreter.outputs(t, y)
    }

    fn series(&self, t: f64, y: &[f64], out: &mut [VecState]) -> bool {
        let Some(jet) = self.jet.get_or_init(|| self.interpreter.scene().jet().ok()) else { return false };
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
        Some(self.with_invariants().and_then(|i| i.scene().invariant_names()).map_or(0, |names| names.len()))
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
            verified.or_else(|_| Pivot { name: forever(name.to_owned()), value, scale }.verify(t))
        })
    }

    fn domain(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        let outside = |condition| Failure::OutsideDomain { t, condition: forever(condition) };
        self.interpreter.domain(t, y).map_err(outside)
    }

    fn signature(&self, t: f64, y: &[f64]) -> f64 {
        self.interpreter.signature(t, y)
    }

    fn pivots(&self, t: f64, y: &[f64], visit: &mut dyn FnMut(Pivot<f64>)) {
        for (name, value, scale) in self.interpreter.pivots(t, y) {
            visit(Pivot { name: forever(name.to_owned()), value, scale });
        }
    }
}

/// The runtime's failures borrow from the program for ever, so each pivot's name and each condition is kept once.
fn forever(name: String) -> &'static str {
    static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut kept = KEPT.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(known) = kept.get(name.as_str()) {
        return known;
    }
    let name: &'static str = name.leak();
    kept.insert(name);
    name
}
