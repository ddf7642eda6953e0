//! A scene's program with prepared parameters, run operation by operation.
//!
//! Does not know: how the program was made.

use hamel_runtime::Dual;

use crate::program::{Jet, Point, Role};

use super::derivatives::Derivative;
use super::invariants::GRADIENTS;
use super::{BuiltScene, INVARIANTS};

/// A scene's program with prepared parameters, run operation by operation.
#[derive(Clone, Debug)]
pub struct Interpreter<'a> {
    pub(super) scene: &'a BuiltScene,
    pub(super) params: Vec<f64>,
    pub(super) prepared: Vec<f64>,
}

impl Interpreter<'_> {
    /// The scene.
    pub fn scene(&self) -> &BuiltScene {
        self.scene
    }

    fn call(&self, role: &Role, t: f64, y: &[f64], out: &mut [f64]) -> bool {
        let Some(k) = self.scene.program.function_idx(role) else { return false };
        self.scene.program.run(k, &self.params, &self.prepared, t, y, out);
        true
    }

    /// Time derivative of the state.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        self.call(&Role::Rate, t, y, dy);
    }

    /// Derivatives of [`rhs`](Interpreter::rhs) by the components of the state: row `i` has those of component `i`.
    ///
    /// By dual numbers, so that the scene need not want the Jacobian.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs_jacobian(&self, t: f64, y: &[f64], rows: &mut [&mut [f64]]) {
        let Some(k) = self.scene.program.function_idx(&Role::Rate) else { return };
        let constants = |values: &[f64]| values.iter().copied().map(Dual::constant).collect::<Vec<Dual>>();
        let (params, prepared) = (constants(&self.params), constants(&self.prepared));
        let (mut state, mut out) = (constants(y), constants(y));
        for column in 0..y.len() {
            state[column] = Dual::variable(y[column]);
            self.scene.program.run(k, &params, &prepared, Dual::constant(t), &state, &mut out);
            state[column] = Dual::constant(y[column]);
            rows.iter_mut().zip(&out).for_each(|(row, value)| row[column] = value.derivative);
        }
    }

    /// Taylor coefficients of the solution through a state, by the recurrence of [`BuiltScene::jet`].
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series(&self, jet: &Jet, t: f64, y: &[f64], out: &mut [&mut [f64]]) {
        jet.series(&self.params, &self.prepared, t, y, out);
    }

    /// Energy, when the scene wants it.
    pub fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        let mut out = [0.0];
        self.call(&Role::Energy, t, y, &mut out).then_some(out[0])
    }

    /// All outputs, concatenated.
    pub fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        let mut all = Vec::new();
        for output in &self.scene.outputs {
            let mut out = vec![0.0; output.components.len()];
            self.call(&Role::Output(output.name.clone()), t, y, &mut out);
            all.extend(out);
        }
        all
    }

    /// A derivative that is a matrix, row by row, when the scene wants it.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn matrix(&self, derivative: Derivative, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.matrix_named(derivative.name(), t, y)
    }

    /// Invariants of the motion, when the scene wants them, in the order of its output `invariants`.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn invariants(&self, t: f64, y: &[f64]) -> Option<Vec<f64>> {
        let names = self.scene.invariant_names()?;
        let mut values = vec![0.0; names.len()];
        self.call(&Role::Output(INVARIANTS.to_owned()), t, y, &mut values);
        Some(values)
    }

    /// Their gradients, a row for each.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn invariant_gradients(&self, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.matrix_named(GRADIENTS, t, y)
    }

    fn matrix_named(&self, name: &str, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        let matrix = self.scene.matrices.iter().find(|m| m.name == name)?;
        let mut entries = vec![0.0; matrix.pattern.len()];
        self.call(&Role::Output(name.to_owned()), t, y, &mut entries);
        let (n_rows, n_columns) = matrix.shape;
        let mut rows = vec![vec![0.0; n_columns]; n_rows];
        for ((i, j), entry) in matrix.pattern.iter().zip(entries) {
            rows[*i][*j] = entry;
        }
        Some(rows)
    }

    /// A derivative that is a product with `vector`, when the scene wants it.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn product(&self, derivative: Derivative, t: f64, y: &[f64], vector: &[f64]) -> Option<Vec<f64>> {
        let product = self.scene.products.iter().find(|p| p.derivative == derivative)?;
        let k = self.scene.program.function_idx(&derivative.role())?;
        let mut out = vec![0.0; product.components.len()];
        let point = Point { t, state: y, argument: vector };
        self.scene.program.run_at(k, &self.params, &self.prepared, point, &mut out);
        Some(out)
    }

    /// Everything that the right-hand side divides by and that may vanish or overflow: names, values, and scales of their
    /// rounding errors, as [`hamel_runtime::Pivot`] has them.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn pivots(&self, t: f64, y: &[f64]) -> Vec<(&str, f64, f64)> {
        let program = &self.scene.program;
        let Some(k) = program.function_idx(&Role::Pivots) else { return Vec::new() };
        let results = &program.functions[k].results;
        let mut out = vec![0.0; results.len()];
        program.run(k, &self.params, &self.prepared, t, y, &mut out);
        let (values, scales) = out.split_at(out.len() / 2);
        let names = results.iter().map(|(name, _)| name.as_str());
        names.zip(values).zip(scales).map(|((name, value), scale)| (name, *value, *scale)).collect()
    }

    /// Why the right-hand side cannot be evaluated here.
    ///
    /// # Errors
    /// The name of the pivot that is not finite, that vanishes, or that rounding errors of its terms could hide.
    pub fn check(&self, t: f64, y: &[f64]) -> Result<(), String> {
        let lost = |(_, value, scale): &(&str, f64, f64)| {
            hamel_runtime::Pivot { name: "", value: *value, scale: *scale }.verify(t).is_err()
        };
        self.pivots(t, y).into_iter().find(lost).map_or(Ok(()), |(name, ..)| Err(name.to_owned()))
    }

    /// The number that stays the same along a motion while no matrix becomes singular; zero if none can.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn signature(&self, t: f64, y: &[f64]) -> f64 {
        let mut out = [0.0];
        self.call(&Role::Signature, t, y, &mut out);
        out[0]
    }

    /// Whether the coordinates lie in their domain.
    ///
    /// # Errors
    /// The first condition that does not hold, such as `theta > 0`.
    pub fn domain(&self, t: f64, y: &[f64]) -> Result<(), String> {
        let is_inside = |value: &f64| *value > 0.0;
        self.guard(&Role::Domain, t, y, |out| out.iter().position(|value| !is_inside(value)))
    }

    /// The name of the result of a function that does not hold.
    fn guard(
        &self,
        role: &Role,
        t: f64,
        y: &[f64],
        broken: impl Fn(&[f64]) -> Option<usize>,
    ) -> Result<(), String> {
        let Some(k) = self.scene.program.function_idx(role) else { return Ok(()) };
        let results = &self.scene.program.functions[k].results;
        let mut out = vec![0.0; results.len()];
        self.scene.program.run(k, &self.params, &self.prepared, t, y, &mut out);
        broken(&out).map_or(Ok(()), |k| Err(results[k].0.clone()))
    }
}
