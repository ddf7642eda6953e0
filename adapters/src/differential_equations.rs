//! The interface of the crate `differential-equations`.

use differential_equations::linalg::Matrix;
use differential_equations::ode::ODE;
use hamel_runtime::{Differentiable, System};

use crate::{Adapter, WithJacobian};

/// ```
/// use differential_equations::prelude::*;
/// use hamel_adapters::Adapter;
/// use hamel_models::generated::heavy_top;
///
/// let top = heavy_top::Prepared::new(&heavy_top::Params::default()).expect("the published values");
/// let adapter = Adapter(&top);
/// let y0 = [0.1, 0.2, 5.0, 0.0, 0.6, 0.8];
/// let method = ExplicitRungeKutta::dop853().rtol(1e-10).atol(1e-12);
/// let solution = IVP::ode(&adapter, 0.0, 1.0, y0).method(method).solve().expect("a solution");
/// adapter.verify(1.0, solution.y.last().expect("the end")).expect("a state");
/// ```
impl<const N: usize, S: System<f64, State = [f64; N]>> ODE<f64, [f64; N]> for Adapter<S> {
    fn diff(&self, t: f64, y: &[f64; N], dydt: &mut [f64; N]) {
        self.0.rhs(t, y, dydt);
    }
}

/// As [`Adapter`], with the Jacobian of scenes that want derivatives instead of finite differences.
///
/// ```
/// use differential_equations::prelude::*;
/// use hamel_adapters::WithJacobian;
/// use hamel_models::generated::heavy_top_derivatives as heavy_top;
///
/// let top = heavy_top::Prepared::new(&heavy_top::Params::default()).expect("the published values");
/// let adapter = WithJacobian(&top);
/// let method = DiagonallyImplicitRungeKutta::kvaerno745().rtol(1e-8).atol(1e-10);
/// let problem = IVP::ode(&adapter, 0.0, 1.0, [0.1, 0.2, 5.0, 0.0, 0.6, 0.8]);
/// let solution = problem.method(method).solve().expect("a solution");
/// adapter.verify(1.0, solution.y.last().expect("the end")).expect("a state");
/// ```
impl<const N: usize, S: Differentiable<f64> + System<f64, State = [f64; N]>> ODE<f64, [f64; N]>
    for WithJacobian<S>
{
    fn diff(&self, t: f64, y: &[f64; N], dydt: &mut [f64; N]) {
        self.0.rhs(t, y, dydt);
    }

    fn jacobian(&self, t: f64, y: &[f64; N], j: &mut Matrix<f64>) {
        let mut rows = [[0.0; N]; N];
        self.0.jacobian(t, y, &mut rows);
        for (row, values) in rows.iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                j[(row, column)] = *value;
            }
        }
    }
}
