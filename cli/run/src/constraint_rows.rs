//! Derivatives of the residuals of constraints by velocities, along a motion that a state can carry away from them.
//!
//! Deliberately does not know: who asks, what rows that depend on each other mean.

use hamel_codegen::scene::{Executable, Interpreter, Prior};
use hamel_codegen::spec::{Model, Want};
use hamel_runtime::Dual;

use super::dynamics::VecState;
use super::info::Info;

/// What residuals are computed by, with their parameters.
pub(super) struct ConstraintRows<'a> {
    interpreter: Interpreter<'a, Dual<f64>>,
    /// Places of velocities and momenta.
    velocities: Vec<usize>,
}

impl<'a> ConstraintRows<'a> {
    /// By a scene in the same state that has the residuals. Parameters that are not allowed have no rows.
    pub(super) fn new(
        (scene, info): (&'a Executable, &Info),
        model: &Model,
        params: &[f64],
    ) -> Option<ConstraintRows<'a>> {
        let constants: Vec<Dual<f64>> = params.iter().copied().map(Dual::constant).collect();
        let mut interpreter = scene.prepare_over(&constants).ok()?;
        // Residuals read no input.
        let inputs = vec![Dual::constant(0.0); interpreter.n_inputs()];
        if !inputs.is_empty() {
            interpreter.set_inputs(&inputs);
        }
        let prior = Prior::of(model, &info.scene, &Default::default());
        let velocities = (0..info.state.len()).filter(|k| prior.is_velocity(&info.state[*k])).collect();
        Some(ConstraintRows { interpreter, velocities })
    }

    /// The residuals.
    pub(super) fn residuals(&self, t: f64, y: &[f64]) -> Vec<f64> {
        let state: Vec<Dual<f64>> = y.iter().copied().map(Dual::constant).collect();
        let found = self.interpreter.output(Want::Constraint.name(), Dual::constant(t), &state);
        found.unwrap_or_default().iter().map(|residual| residual.value).collect()
    }

    /// A row for each residual, also of an equation between coordinates, whose row is zero. Components of the state
    /// that are no velocities have zeros.
    pub(super) fn at(&self, t: f64, y: &[f64]) -> Vec<VecState> {
        let mut rows: Vec<VecState> = Vec::new();
        let mut state: Vec<Dual<f64>> = y.iter().copied().map(Dual::constant).collect();
        for k in &self.velocities {
            state[*k] = Dual::variable(y[*k]);
            let found = self.interpreter.output(Want::Constraint.name(), Dual::constant(t), &state);
            state[*k] = Dual::constant(y[*k]);
            let found = found.unwrap_or_default();
            rows.resize_with(found.len(), || VecState(vec![0.0; y.len()]));
            for (row, residual) in rows.iter_mut().zip(found) {
                row.0[*k] = residual.derivative;
            }
        }
        rows
    }
}
