//! Exact flows and discrete equations of a scene, as methods of the runtime ask for them.
//!
//! Deliberately does not know: who evaluates them, how steps are composed or solved.

use hamel_codegen::scene::DiscretePart;
use hamel_runtime::{Discrete, ExactFlows};

use super::dynamics::{Dynamics, PreparedScene, VecState};

impl PreparedScene<'_> {
    /// The numbers of a function of the discrete equations.
    fn discrete_numbers(
        &self,
        part: DiscretePart,
        (t, h): (f64, f64),
        y: &VecState,
        z: &VecState,
        out: &mut [f64],
    ) {
        let mut variables = Vec::with_capacity(1 + y.0.len() + z.0.len());
        variables.push(h);
        variables.extend_from_slice(&y.0);
        variables.extend_from_slice(&z.0);
        self.discrete_of(part, t, &variables, out);
    }
}

impl Discrete<f64> for PreparedScene<'_> {
    type Unknowns = VecState;

    fn discrete_unknowns(&self) -> VecState {
        VecState(vec![0.0; Dynamics::discrete(&**self).map_or(0, |layout| layout.n_unknowns)])
    }

    fn discrete_start(&self, t: f64, h: f64, y: &VecState, z: &mut VecState) {
        let known = z.clone();
        self.discrete_numbers(DiscretePart::Start, (t, h), y, &known, &mut z.0);
    }

    fn discrete_residual(&self, t: f64, h: f64, y: &VecState, z: &VecState, residual: &mut VecState) {
        self.discrete_numbers(DiscretePart::Residual, (t, h), y, z, &mut residual.0);
    }

    fn discrete_jacobian(&self, t: f64, h: f64, y: &VecState, z: &VecState, jacobian: &mut [VecState]) {
        let Some(layout) = Dynamics::discrete(&**self) else { return };
        let mut entries = vec![0.0; layout.pattern.len()];
        self.discrete_numbers(DiscretePart::Jacobian, (t, h), y, z, &mut entries);
        jacobian.iter_mut().for_each(|row| row.0.fill(0.0));
        for ((i, j), entry) in layout.pattern.iter().zip(entries) {
            jacobian[*i].0[*j] = entry;
        }
    }

    fn discrete_end(&self, z: &VecState, y: &mut VecState) {
        let Some(layout) = Dynamics::discrete(&**self) else { return };
        for (component, place) in y.0.iter_mut().zip(&layout.state) {
            *component = z.0[*place];
        }
    }
}

impl ExactFlows<f64> for PreparedScene<'_> {
    fn n_flows(&self) -> usize {
        self.flows().unwrap_or(0)
    }

    fn flow(&self, index: usize, tau: f64, y: &VecState, increment: &mut VecState) {
        Dynamics::flow(&**self, index, tau, &y.0, &mut increment.0);
    }
}
