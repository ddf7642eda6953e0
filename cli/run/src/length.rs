//! Whether a motion takes so many steps that errors of its energy add up, by its first steps.
//!
//! Does not know: which method suits which purpose, how a request was written.

use hamel_runtime::{Dop853, Integrator};

use super::any_method::MAX_INVARIANTS;
use super::auto;
use super::dynamics::{Factory, PreparedScene, VecState};
use super::evaluate::prepare;
use super::method::{MethodName, Steps};
use super::simulation::SimulateRequest;

/// Steps of `dop853` from which on a motion is long. The energy of `heavy_top` has moved by 7e-9 after five times as
/// many at the default tolerances, with `dop853` and `gbs14`
/// (`hamel simulate heavy_top --t-final 10000 --method gbs14`).
const LONG: f64 = 30_000.0;

/// Steps that are tried, and how many of them come first and may be of another size.
const TRIAL: [u32; 2] = [16, 32];

/// The method that `auto` takes for the motion of a request because it is long; none where it is not, or where errors
/// that add up are no matter of the energy: through events, and with derivatives beside.
pub fn method_of_long(factory: &dyn Factory, request: &SimulateRequest) -> Option<MethodName> {
    if request.watched.is_some() || !request.along.is_empty() || !factory.info().conserves_energy {
        return None;
    }
    let dynamics = prepare(factory, &request.params).ok()?;
    is_long(&dynamics, request)
        .then(|| auto::choose_for_long(matches!(dynamics.n_invariants(), 1..=MAX_INVARIANTS)))
}

fn is_long(dynamics: &PreparedScene<'_>, request: &SimulateRequest) -> bool {
    let Steps::Adaptive { max, .. } = request.steps else { return false };
    let Ok(options) = request.steps.options(request.t_final, request.max_steps) else { return false };
    if max.is_some_and(|max| request.t_final.abs() / max >= LONG) {
        return true;
    }
    let initial = VecState(request.initial.clone());
    let Ok(mut solver) = Integrator::new(dynamics, Dop853, 0.0, initial, options) else { return false };
    let mut times = [0.0; 2];
    for n in 1..=TRIAL[1] {
        // What ends, or fails, within so few steps is not long.
        if !solver.step_towards(request.t_final).is_ok_and(|progress| !progress.reached()) {
            return false;
        }
        times[usize::from(n > TRIAL[0])] = solver.t();
    }
    let step = (times[1] - times[0]).abs() / f64::from(TRIAL[1] - TRIAL[0]);
    request.t_final.abs() / step >= LONG
}
