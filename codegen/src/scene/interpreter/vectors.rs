//! Functions of a scene that take more than time and state: a duration, the variables of the implicit form, velocities,
//! accelerations.
//!
//! Does not know: how any of them was derived.

use hamel_program::program::{Point, Role};
use hamel_runtime::Real;

use super::Interpreter;
use crate::scene::built::legendre_role;
use crate::scene::discrete::DiscretePart;
use crate::scene::dynamics::inverse_dynamics_role;
use crate::scene::implicit;
use crate::scene::quotient::{params_role, state_role};
use crate::scene::splitting::flow_role;

impl Interpreter<'_> {
    /// Writes what an exact flow adds to a state in the time `tau`, [`hamel_runtime::ExactFlows::flow`]; false when the
    /// scene does not have that flow.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn flow(&self, index: usize, tau: f64, y: &[f64], increment: &mut [f64]) -> bool {
        let Some(k) = self.program.function_idx(&flow_role(index)) else { return false };
        let point = Point { t: 0.0, state: y, argument: &[tau] };
        self.program.run_at(k, &self.params, &self.prepared, point, increment);
        true
    }

    /// The right-hand side `f(t, z)` of the implicit form, when the scene wants it.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn implicit(&self, t: f64, z: &[f64]) -> Option<Vec<f64>> {
        self.of_variables(&implicit::right_side(), t, z)
    }

    /// The derivatives `df/dz` of the implicit form, row by row, when the scene wants it.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn implicit_jacobian(&self, t: f64, z: &[f64]) -> Option<Vec<Vec<f64>>> {
        let pattern = self.patterns.iter().find(|pattern| pattern.name == implicit::JACOBIAN)?;
        Some(pattern.filled(&self.of_variables(&implicit::jacobian(), t, z)?))
    }

    /// Writes the results of a function of the discrete equations for the variables `(h, y, z)` of a step from a state
    /// at a time, with the unknowns `z`; false when the scene has none.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn discrete(&self, part: DiscretePart, t: f64, variables: &[f64], out: &mut [f64]) -> bool {
        let Some(k) = self.program.function_idx(&part.role()) else { return false };
        // Such a function reads no state.
        let state = &variables[1..=self.program.state.len()];
        self.run_at(k, Point { t, state, argument: variables }, out);
        true
    }

    /// The state that the map of the quotient gives for a state and the parameters of the total system, one after the
    /// other, when the scene wants it.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn quotient(&self, t: f64, total: &[f64]) -> Option<Vec<f64>> {
        self.of_variables(&state_role(), t, total)
    }

    /// The parameters that it gives, in the order of the program's.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn quotient_parameters(&self, t: f64, total: &[f64]) -> Option<Vec<f64>> {
        self.of_variables(&params_role(), t, total)
    }

    /// The values of a function that takes variables in the place of the state.
    fn of_variables(&self, role: &Role, t: f64, z: &[f64]) -> Option<Vec<f64>> {
        let k = self.program.function_idx(role)?;
        let mut out = vec![0.0; self.program.functions[k].results.len()];
        // Such a function reads no state.
        let state = vec![0.0; self.program.state.len()];
        let point = Point { t, state: &state, argument: z };
        self.run_at(k, point, &mut out);
        Some(out)
    }

    /// The forces `tau = A a - f` along the velocities of the state, which have to act beside the model's for the
    /// rates of these velocities to be `a`, when the scene wants them.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn inverse_dynamics(&self, t: f64, y: &[f64], accelerations: &[f64]) -> Option<Vec<f64>> {
        self.of_vector(&inverse_dynamics_role(), t, y, accelerations)
    }
}

impl<R: Real> Interpreter<'_, R> {
    /// The momenta that the state carries by the velocities that they stand for, both in the order of
    /// [`BuiltScene::legendre`](crate::scene::BuiltScene::legendre); none where it carries none. The momenta in `y`
    /// mean nothing.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn legendre(&self, t: R, y: &[R], velocities: &[R]) -> Option<Vec<R>> {
        self.of_vector(&legendre_role(), t, y, velocities)
    }

    /// The values of a function of the state and a vector.
    fn of_vector(&self, role: &Role, t: R, y: &[R], vector: &[R]) -> Option<Vec<R>> {
        let k = self.program.function_idx(role)?;
        let mut out = vec![R::ZERO; self.program.functions[k].results.len()];
        self.run_at(k, Point { t, state: y, argument: vector }, &mut out);
        Some(out)
    }
}
