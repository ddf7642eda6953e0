//! The interface of the crate `ode_solvers`.

use hamel_runtime::System;
use ode_solvers::SVector;

use crate::Adapter;

/// ```
/// use hamel_adapters::Adapter;
/// use hamel_models::generated::heavy_top;
/// use ode_solvers::{Dopri5, OutputType, SVector};
///
/// let top = heavy_top::Prepared::new(&heavy_top::Params::default())?;
/// let y0 = SVector::from([0.1, 0.2, 5.0, 0.0, 0.6, 0.8]);
/// let mut solver = Dopri5::new(Adapter(&top), 0.0, 1.0, 1.0, y0, 1e-10, 1e-12);
/// solver.set_output(OutputType::Sparse);
/// solver.integrate()?;
/// let last = solver.y_out().last().expect("the end");
/// Adapter(&top).verify(1.0, &last.data.0[0])?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// Take `Dopri5`, not `Dop853`, for a system that depends on time explicitly: in the `Dop853` of `ode_solvers` 0.6.2
/// the nodes `c_12` and `c_13` are 0 instead of 1, so that its last stages are evaluated at the start of the step. Such
/// a system fails with it, or is integrated wrongly without a word. A right-hand side without `t`, as that of most
/// scenes, is not affected; [`hamel_runtime::Dop853`] is right for both.
///
/// `Sparse` output has the states after all steps. Of `Dense` output, the solver's own choice, the last state is not to
/// be trusted: `ode_solvers` 0.6.2 extrapolates it from an earlier step.
///
/// The integration is stopped after a step that led to something that is not a state, which
/// [`verify`](Adapter::verify) tells from the end.
impl<const N: usize, S: System<f64, State = [f64; N]>> ode_solvers::System<f64, SVector<f64, N>>
    for Adapter<S>
{
    fn system(&self, t: f64, y: &SVector<f64, N>, dy: &mut SVector<f64, N>) {
        self.0.rhs(t, &y.data.0[0], &mut dy.data.0[0]);
    }

    fn solout(&mut self, t: f64, y: &SVector<f64, N>, _dy: &SVector<f64, N>) -> bool {
        self.verify(t, &y.data.0[0]).is_err()
    }
}
