//! The generated equations against a solution in closed form.
//!
//! With `Omega3 = 0` and a diagonal inertia matrix, the rotor's momentum `h = J alpha_dot` is constant and
//! `M' = M x Omega + lambda E3`, `M = (I11 Omega1, I22 Omega2, h)`, is a linear oscillation:
//!
//! ```text
//! Omega1 = A cos(w t),   Omega2 = A sqrt(I11/I22) sin(w t),   w = h / sqrt(I11 I22)
//! ```

use hamel_downstream::models::suslov_gyrostat::{INFO, Params, Prepared, State};
use hamel_downstream::models::suslov_gyrostat_steps as steps;
use hamel_runtime::{Discrete2, Dop853, Integrator, Options};

/// States at `t_final` of the motion from `start`.
fn run(system: &Prepared, start: State, t_final: f64) -> State {
    let options = Options::adaptive(1e-12, 1e-12);
    let mut solver = Integrator::new(system, Dop853, 0.0, start.to_array(), options).unwrap();
    solver.integrate_to(t_final).unwrap();
    State::from_array(*solver.state())
}

#[test]
fn the_motion_is_the_known_oscillation() {
    let params = Params::default();
    let system = Prepared::new(&params).unwrap();
    let (amplitude, alpha_dot, t) = (0.8, 5.0, 7.0);
    let start = State { alpha: 0.0, alpha_dot, Omega1: amplitude, Omega2: 0.0 };
    let end = run(&system, start, t);
    let h = hamel_downstream::spin(alpha_dot);
    let w = h / (params.I11 * params.I22).sqrt();
    let expected = [
        alpha_dot * t,
        alpha_dot,
        amplitude * (w * t).cos(),
        amplitude * (params.I11 / params.I22).sqrt() * (w * t).sin(),
    ];
    // The integration is asked for 1e-12 a step, and takes some tens of steps.
    for (name, (x, y)) in INFO.state.iter().zip(end.to_array().into_iter().zip(expected)) {
        assert!((x - y).abs() < 1e-10 * y.abs().max(1.0), "{name}: {x}, expected {y}");
    }
    assert!((w * t).sin().abs() > 0.1 && (w * t).cos().abs() > 0.1, "the end is no special point");
}

/// Distance from the known oscillation after steps of size `h`, and what the momentum of the rotor has lost.
fn by_steps(h: f64) -> (f64, f64) {
    let params = steps::Params::default();
    let system = steps::Prepared::new(&params).unwrap();
    let (amplitude, alpha_dot, t) = (0.8, 5.0, 7.0);
    let start = steps::State { alpha: 0.0, alpha_dot, Omega1: amplitude, Omega2: 0.0 };
    let mut solver =
        Integrator::new(&system, Discrete2::new(), 0.0, start.to_array(), Options::fixed(h)).unwrap();
    solver.integrate_to(t).unwrap();
    let end = steps::State::from_array(*solver.state());
    let w = hamel_downstream::spin(alpha_dot) / (params.I11 * params.I22).sqrt();
    let expected = [amplitude * (w * t).cos(), amplitude * (params.I11 / params.I22).sqrt() * (w * t).sin()];
    ((end.Omega1 - expected[0]).hypot(end.Omega2 - expected[1]), end.alpha_dot - alpha_dot)
}

#[test]
fn steps_by_discrete_equations_are_of_order_two_and_keep_the_momentum() {
    let [(coarse, lost), (fine, _)] = [0.02, 0.01].map(by_steps);
    assert!(((coarse / fine).log2() - 2.0).abs() < 0.05, "{coarse:e}, {fine:e}");
    // Rounding of a few hundred steps.
    assert!(lost.abs() < 1e-13, "{lost:e}");
}

#[test]
fn the_energy_is_kept_without_any_symmetry_of_the_body() {
    let params = Params { I12: 0.1, I13: 0.3, I23: -0.2, ..Params::default() };
    let system = Prepared::new(&params).unwrap();
    let start = State { alpha: 0.2, alpha_dot: 1.5, Omega1: 0.8, Omega2: -0.6 };
    let energy = |state: &State| system.energy(0.0, &state.to_array());
    let end = run(&system, start, 20.0);
    assert!((end.Omega1 - start.Omega1).abs() > 0.1 && (end.Omega2 - start.Omega2).abs() > 0.1, "{end:?}");
    // Errors of 1e-12 a step in a few hundred steps.
    assert!((energy(&end) / energy(&start) - 1.0).abs() < 1e-9, "{} {}", energy(&start), energy(&end));
}

#[test]
fn parameters_are_checked() {
    let error = Prepared::<f64>::new(&Params { J: -1.0, ..Params::default() }).unwrap_err();
    assert_eq!(error.condition, "J > 0");
}
