//! Motions that end at singular points, in compiled code: the inertia `1 - x^2` vanishes at `t = pi/4`, and the cranks
//! of a linkage lie flat.

use hamel_downstream::models::thinning::{Prepared, State};
use hamel_downstream::models::{windows, windows_bare};
use hamel_runtime::{
    Dop853, Dopri5, Error, Failure, Gauss6, Integrator, Method, Options, Rk4, StepSize, System, Vern9,
};

const PIVOT: &str = "inertia along x_dot";

fn run<M: Method<f64, Prepared>>(method: M, options: Options<f64>) -> (Error, f64, State) {
    let system = Prepared::new(&Default::default()).unwrap();
    let start = State { x: 0.0, w: 0.0, x_dot: 1.0, w_dot: 0.0 };
    let mut solver = Integrator::new(&system, method, 0.0, start.to_array(), options).unwrap();
    let error = solver.integrate_to(3.0).unwrap_err();
    (error, solver.t(), State::from_array(*solver.state()))
}

#[test]
fn compiled_fixed_steps_end_at_a_vanishing_pivot() {
    let (error, t, state) = run(Rk4, Options::fixed(0.1));
    assert!(matches!(error, Error::Failure(Failure::ChangedSign { pivot: PIVOT, .. })), "{error}");
    assert!((t - 0.7).abs() < 1e-12 && state.x < 1.0, "{t} {state:?}");
    let (error, ..) = run(Gauss6::fixed_point(), Options::fixed(0.1));
    assert!(matches!(error, Error::Failure(Failure::ChangedSign { pivot: PIVOT, .. })), "{error}");
}

#[test]
fn compiled_adaptive_steps_name_the_pivot_that_they_stop_at() {
    let (error, t, _) = run(Dop853, Options::adaptive(1e-10, 1e-12));
    assert!(matches!(error, Error::Failure(Failure::Singular { pivot: PIVOT, .. })), "{error}");
    assert!((t - core::f64::consts::FRAC_PI_4).abs() < 1e-6, "{t}");
}

#[test]
fn the_signature_says_on_which_side_a_state_is() {
    let system: Prepared = Prepared::new(&Default::default()).unwrap();
    let at = |x: f64| system.signature(0.0, &[x, 0.0, 1.0, 0.0]);
    assert_eq!([at(0.5), at(-0.9), at(1.5)], [1.0, 1.0, -1.0]);
    assert!(at(1.0).is_nan() && at(1e200).is_nan());
}

/// When the cranks of two windows lie flat, as `hamel simulate` tells: two equations depend on the others.
const FLAT: f64 = 0.714_356;

fn folds<S: System<f64, State = [f64; 12]>>(
    system: &S,
    start: [f64; 12],
    method: impl Method<f64, S>,
    options: Options<f64>,
) {
    let step = if let StepSize::Fixed(step) = options.step { step } else { 0.0 };
    let mut solver = Integrator::new(system, method, 0.0, start, options).unwrap();
    let error = solver.integrate_to(3.0).unwrap_err();
    let Error::Failure(Failure::RankLost { t } | Failure::Singular { t, .. }) = error else {
        panic!("{error}")
    };
    assert!((t - FLAT).abs() < 1e-3 + step, "{error}");
}

/// Whoever makes the steps, with the outputs of the model or without.
#[test]
fn compiled_motions_end_where_equations_depend_on_each_other() {
    let start = windows::INITIAL;
    let system = windows::Prepared::new(&Default::default()).unwrap();
    let bare = windows_bare::Prepared::new(&Default::default()).unwrap();
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10] {
        let options = Options::adaptive(tolerance, tolerance);
        folds(&system, start, Dop853, options);
        folds(&system, start, Vern9, options);
        folds(&bare, start, Dop853, options);
    }
    for step in [0.003, 0.01, 0.05] {
        folds(&system, start, Rk4, Options::fixed(step));
        folds(&bare, start, Dopri5, Options::fixed(step));
    }
}
