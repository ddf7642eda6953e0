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

/// After so many of them a motion is not long if steps that are so many times shorter would be too few: most motions
/// are short.
const SHORT: [(u32, f64); 2] = [(1, 30.0), (8, 4.0)];

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
        let n_steps = f64::from(n) * (request.t_final / solver.t()).abs();
        if SHORT.iter().any(|(after, times)| n == *after && times * n_steps < LONG) {
            return false;
        }
        times[usize::from(n > TRIAL[0])] = solver.t();
    }
    let step = (times[1] - times[0]).abs() / f64::from(TRIAL[1] - TRIAL[0]);
    request.t_final.abs() / step >= LONG
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::method_of_long;
    use crate::cache::Cache;
    use crate::interpreted;
    use crate::method::{MethodName, Steps};
    use crate::model::Checked;
    use crate::noise::Noise;
    use crate::session::Session;
    use crate::simulation::{MAX_EVENTS, SimulateRequest};

    /// The pendulum takes some two steps of `dop853` a unit of time at these tolerances.
    #[test]
    fn a_motion_is_long_by_the_number_of_its_steps() {
        let text = "model pendulum { coordinate q in angle; lagrangian = q_dot^2/2 + cos(q); }";
        let model = Session::of_shipped(&[]).parse("pendulum", text).unwrap_or_else(|e| panic!("{e}"));
        let model = Arc::new(Checked::new(model, Cache::none()));
        let scene = interpreted::build(&model, "default").unwrap_or_else(|e| panic!("{e}"));
        let found = |t_final: f64, max: Option<f64>| {
            let request = SimulateRequest {
                params: Vec::new(),
                initial: vec![0.9, 0.1],
                t_final,
                method: MethodName::Auto,
                steps: Steps::Adaptive { rtol: 1e-10, atol: 1e-12, max },
                samples: 2,
                with_outputs: false,
                n_group: 0,
                max_steps: 100_000_000,
                max_events: MAX_EVENTS,
                watched: None,
                noise: Noise::default(),
                along: Vec::new(),
                tangents: Vec::new(),
            };
            method_of_long(&scene, &request)
        };
        let long = Some(MethodName::Projected);
        assert_eq!([1.0, 30.0, 1e3, 5e3].map(|t| found(t, None)), [None; 4]);
        assert_eq!([1e5, -1e5, 1e7].map(|t| found(t, None)), [long; 3]);
        assert_eq!([found(1e3, Some(0.01)), found(1e3, Some(0.1))], [long, None]);
    }
}
