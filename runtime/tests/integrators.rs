//! Order, accuracy, direction, landing and failures of the integrators, on problems with a closed form.

use hamel_runtime::{
    Dop853, Dopri5, Error, Failure, Gauss4, Gauss6, Gauss8, Integrator, Method, Midpoint, Norm, Options,
    Progress, Real, Rk4, StateVector, System, Tsit5, Vern9,
};

/// A nonlinear system that depends on time.
///
/// ```text
/// a' = a (1 - a),  b' = b cos t,  (c, d)' = (c^2 + d^2) (-d, c)
/// ```
struct Mixed;

impl<R: Real> System<R> for Mixed {
    type State = [R; 4];
    fn rhs(&self, t: R, &[a, b, c, d]: &[R; 4], dy: &mut [R; 4]) {
        let rate = c * c + d * d;
        *dy = [a * (R::ONE - a), b * t.cos(), -rate * d, rate * c];
    }
}

fn mixed_solution(t: f64) -> [f64; 4] {
    // r = 1.2, so that (c, d) turns at the rate 1.44.
    [1.0 / (1.0 + 3.0 * (-t).exp()), t.sin().exp(), 1.2 * (1.44 * t).cos(), 1.2 * (1.44 * t).sin()]
}

fn distance<R: Real + Into<f64>>(y: &[R], expected: &[f64]) -> f64 {
    y.iter().zip(expected).map(|(&y, e)| (y.into() - e).abs()).fold(0.0, f64::max)
}

/// Slope of the least-squares line through the points `(ln h, ln error)`.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let logs: Vec<_> = points.iter().map(|(h, error)| (h.ln(), error.ln())).collect();
    let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / n;
    let (x_mean, y_mean) = (mean(|p| p.0), mean(|p| p.1));
    let covariance: f64 = logs.iter().map(|p| (p.0 - x_mean) * (p.1 - y_mean)).sum();
    covariance / logs.iter().map(|p| (p.0 - x_mean).powi(2)).sum::<f64>()
}

/// Step sizes and the errors that they lead to.
type Errors = Vec<(f64, f64)>;

/// Errors at the end of `[0, end]` and of dense output within, for step sizes `end/n`.
fn errors<M: Method<f64, Mixed>>(method: M, end: f64, counts: &[u32]) -> (Errors, Errors) {
    let mut at_end = vec![];
    let mut between = vec![];
    for &n in counts {
        let h = end / f64::from(n);
        let mut solver =
            Integrator::new(&Mixed, method, 0.0, mixed_solution(0.0), Options::fixed(h)).unwrap();
        let mut worst = 0.0_f64;
        let times = (0..n).flat_map(|i| [0.3, 0.5, 0.77].map(|x| (f64::from(i) + x) * h));
        solver.sample(end, times, |t, y| worst = worst.max(distance(y, &mixed_solution(t)))).unwrap();
        assert_eq!(solver.t(), end);
        assert_eq!(solver.stats().steps, u64::from(n));
        at_end.push((h, distance(solver.state(), &mixed_solution(end))));
        between.push((h, worst));
    }
    (at_end, between)
}

fn check_orders<M: Method<f64, Mixed>>(method: M, end: f64, counts: &[u32], order: f64, dense_order: f64) {
    let name = M::TABLEAU.name;
    let (at_end, between) = errors(method, end, counts);
    println!("{name}: steps {:.3}, dense output {:.3}", slope(&at_end), slope(&between));
    println!("  {at_end:?}\n  {between:?}");
    for (what, points, order) in [("steps", at_end, order), ("dense output", between, dense_order)] {
        // All errors stay above round-off, or the slope says nothing.
        assert!(points.iter().all(|&(_, error)| error > 2e-14), "{name} {what}: {points:?}");
        let observed = slope(&points);
        // The next term of the expansion lifts the slope of Dop853 where its errors are above round-off.
        let expected = order - 0.2..order + 0.5;
        assert!(expected.contains(&observed), "{name} {what}: order {observed} instead of {order}");
    }
}

#[test]
fn observed_orders_are_those_of_the_methods() {
    // Dense output of order p has local errors O(h^(p+1)), which is also the order of what is observed.
    check_orders(Rk4, 2.0, &[40, 60, 90, 135, 200], 4.0, 4.0);
    check_orders(Dopri5, 2.0, &[40, 60, 90, 135, 200], 5.0, 5.0);
    check_orders(Tsit5, 2.0, &[40, 60, 90, 135, 200], 5.0, 5.0);
    check_orders(Dop853, 2.0, &[12, 15, 19, 24, 30], 8.0, 8.0);
    check_orders(Vern9, 40.0, &[420, 460, 500, 550, 600], 9.0, 9.0);
    check_orders(Midpoint::fixed_point(), 2.0, &[100, 150, 230, 350, 500], 2.0, 2.0);
    check_orders(Gauss4::fixed_point(), 2.0, &[40, 60, 90, 135, 200], 4.0, 4.0);
    check_orders(Gauss6::fixed_point(), 2.0, &[20, 30, 45, 60], 6.0, 6.0);
    check_orders(Gauss8::fixed_point(), 2.0, &[8, 10, 13, 16, 20], 8.0, 7.0);
}

fn check_adaptive<M: Method<f64, Mixed>>(method: M, norm: Norm) {
    let name = M::TABLEAU.name;
    let mut previous = f64::INFINITY;
    for exponent in [4, 6, 8, 10, 12] {
        let rtol = 10.0_f64.powi(-exponent);
        let options = Options::adaptive(rtol, rtol).with_norm(norm);
        let mut solver = Integrator::new(&Mixed, method, 0.0, mixed_solution(0.0), options).unwrap();
        let mut worst = 0.0_f64;
        let times = (1..200).map(|i| f64::from(i) * 0.05);
        solver.sample(10.0, times, |t, y| worst = worst.max(distance(y, &mixed_solution(t)))).unwrap();
        let error = distance(solver.state(), &mixed_solution(10.0)).max(worst);
        let stats = solver.stats();
        println!("{name} {norm:?} rtol 1e-{exponent}: error {error:.2e}, {stats:?}");
        // Errors of the radius of (c, d) add up, and turn it by an angle that grows with the square of time.
        assert!(error < 2000.0 * rtol, "{name}, rtol {rtol:e}: error {error:e}");
        assert!(error < previous, "{name}, rtol {rtol:e}: a tighter tolerance did not help");
        assert!(stats.rejected * 4 <= stats.steps + 8, "{name}, rtol {rtol:e}: {stats:?}");
        previous = error;
    }
}

#[test]
fn adaptive_errors_follow_the_tolerance() {
    for norm in [Norm::Rms, Norm::Max] {
        check_adaptive(Dopri5, norm);
        check_adaptive(Tsit5, norm);
        check_adaptive(Dop853, norm);
        check_adaptive(Vern9, norm);
    }
}

#[test]
fn integration_runs_backward_and_returns() {
    fn check<M: Method<f64, Mixed>>(method: M, options: Options<f64>) {
        let name = M::TABLEAU.name;
        let start = mixed_solution(2.0);
        let mut solver = Integrator::new(&Mixed, method, 2.0, start, options).unwrap();
        let mut n_samples = 0;
        let times = [1.9, 1.5, 1.5, 0.3, -1.0];
        solver
            .sample(-1.0, times, |t, y| {
                assert_eq!(t, times[n_samples]);
                assert!(distance(y, &mixed_solution(t)) < 1e-6, "{name} at {t}");
                n_samples += 1;
            })
            .unwrap();
        assert_eq!((solver.t(), n_samples), (-1.0, times.len()));
        assert!(solver.previous_t() > -1.0);
        solver.integrate_to(2.0).unwrap();
        assert_eq!(solver.t(), 2.0);
        assert!(distance(solver.state(), &start) < 1e-8, "{name}");
    }
    check(Rk4, Options::fixed(0.01));
    check(Tsit5, Options::fixed(0.02));
    check(Dopri5, Options::adaptive(1e-10, 1e-10));
    check(Tsit5, Options::adaptive(1e-10, 1e-10));
    check(Dop853, Options::adaptive(1e-10, 1e-10));
    check(Vern9, Options::adaptive(1e-10, 1e-10));
    check(Gauss6::fixed_point(), Options::fixed(0.02));
}

#[test]
fn every_end_is_reached_exactly() {
    for options in [Options::fixed(0.1), Options::fixed(0.07), Options::adaptive(1e-8, 1e-8)] {
        let mut solver = Integrator::new(&Mixed, Tsit5, 0.0, mixed_solution(0.0), options).unwrap();
        for end in [0.1, 0.3, 1.0 / 3.0, 1.0 / 3.0, 1.0, 1.0 + 1e-15, 3.7, 0.9] {
            solver.integrate_to(end).unwrap();
            assert_eq!(solver.t().to_bits(), f64::to_bits(end));
        }
        assert_eq!(solver.step_towards(0.9), Ok(Progress::Reached));
        assert!(distance(solver.state(), &mixed_solution(0.9)) < 1e-5);
    }
}

#[test]
fn fixed_steps_leave_no_sliver() {
    // Ten times 0.1 summed plainly stays below one.
    let mut solver = Integrator::new(&Mixed, Rk4, 0.0, mixed_solution(0.0), Options::fixed(0.1)).unwrap();
    solver.integrate_to(1.0).unwrap();
    assert_eq!(solver.stats().steps, 10);
    assert_eq!(solver.stats().rhs_evals, 41);
}

#[test]
fn fixed_steps_in_single_precision_leave_no_sliver() {
    let start = mixed_solution(0.0).map(|y| y as f32);
    let mut solver = Integrator::new(&Mixed, Rk4, 100.0, start, Options::fixed(0.1_f32)).unwrap();
    for end in 101..=110_u16 {
        solver.integrate_to(f32::from(end)).unwrap();
    }
    assert_eq!(solver.stats().steps, 100);
}

#[test]
fn steps_respect_their_maximum_and_initial_size() {
    let options = Options::adaptive(1e-3, 1e-3).with_max_step(0.05).with_initial_step(0.01);
    let mut solver = Integrator::new(&Mixed, Dop853, 0.0, mixed_solution(0.0), options).unwrap();
    assert_eq!(solver.step_towards(3.0), Ok(Progress::Running));
    assert_eq!((solver.previous_t(), solver.t()), (0.0, 0.01));
    while solver.step_towards(3.0) == Ok(Progress::Running) {
        assert!(solver.t() - solver.previous_t() <= 0.05 * (1.0 + 1e-14));
    }
    assert_eq!(solver.t(), 3.0);
}

#[test]
fn short_calls_do_not_keep_steps_short() {
    let options = Options::adaptive(1e-6, 1e-6);
    let run = |n_calls: u32| {
        let mut solver = Integrator::new(&Mixed, Tsit5, 0.0, mixed_solution(0.0), options).unwrap();
        for call in 1..=n_calls {
            solver.integrate_to(f64::from(call) / f64::from(n_calls) * 1e-3).unwrap();
        }
        solver.integrate_to(10.0).unwrap();
        solver.stats().steps
    };
    assert!(run(10) <= run(1) + 14, "{} and {}", run(10), run(1));
}

#[test]
fn time_and_state_do_not_drift_by_round_off() {
    struct Clock;
    impl System<f64> for Clock {
        type State = [f64; 1];
        fn rhs(&self, _t: f64, _y: &[f64; 1], dy: &mut [f64; 1]) {
            dy[0] = 1.0;
        }
    }
    let mut solver = Integrator::new(&Clock, Rk4, 0.0, [0.0], Options::fixed(0.1)).unwrap();
    for _ in 0..100_000 {
        assert_eq!(solver.step_towards(1e9), Ok(Progress::Running));
    }
    // Plain summation is off by 2e-8 here; one unit in the last place of 10000 is 1.8e-12.
    assert!((solver.t() - 10_000.0).abs() < 4e-12, "{:e}", solver.t() - 10_000.0);
    assert!((solver.state()[0] - 10_000.0).abs() < 4e-12, "{:e}", solver.state()[0] - 10_000.0);
}

/// A heavy top without symmetry, in body coordinates: momentum and direction of gravity.
///
/// ```text
/// M' = M x Omega + Gamma x chi,  Gamma' = Gamma x Omega,  M_i = I_i Omega_i
/// ```
struct HeavyTop;

impl System<f64> for HeavyTop {
    type State = [f64; 6];
    fn rhs(&self, _t: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let cross = |a: [f64; 3], b: [f64; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let (momentum, gamma) = ([y[0], y[1], y[2]], [y[3], y[4], y[5]]);
        let omega = [y[0] / 0.6, y[1] / 0.8, y[2] / 0.5];
        let chi = [0.3, -0.2, 1.0];
        let (turn, torque, drift) = (cross(momentum, omega), cross(gamma, chi), cross(gamma, omega));
        *dy = [turn[0] + torque[0], turn[1] + torque[1], turn[2] + torque[2], drift[0], drift[1], drift[2]];
    }
}

#[test]
fn tight_tolerances_give_nine_digits_of_a_heavy_top() {
    let start = [0.9, -0.4, 1.1, 0.48, 0.6, 0.64];
    let run = |steps: u32| {
        let h = 10.0 / f64::from(steps);
        let mut solver = Integrator::new(&HeavyTop, Dop853, 0.0, start, Options::fixed(h)).unwrap();
        solver.integrate_to(10.0).unwrap();
        *solver.state()
    };
    let reference = run(4000);
    let roundoff = distance(&run(2000), &reference);
    assert!(roundoff < 1e-12, "{roundoff:e}");
    let options = Options::adaptive(1e-12, 1e-14);
    let mut solver = Integrator::new(&HeavyTop, Dop853, 0.0, start, options).unwrap();
    solver.integrate_to(10.0).unwrap();
    println!("dop853: {:.2e}, {:?}", distance(solver.state(), &reference), solver.stats());
    assert!(distance(solver.state(), &reference) < 1e-10);
    let mut solver = Integrator::new(&HeavyTop, Tsit5, 0.0, start, options).unwrap();
    solver.integrate_to(10.0).unwrap();
    println!("tsit5: {:.2e}, {:?}", distance(solver.state(), &reference), solver.stats());
    assert!(distance(solver.state(), &reference) < 1e-9);
}

#[test]
fn interpolation_covers_the_last_step_only() {
    let options = Options::fixed(0.5);
    let mut solver = Integrator::new(&Mixed, Dop853, 0.0, mixed_solution(0.0), options).unwrap();
    let mut out = [0.0; 4];
    assert_eq!(solver.interpolate(0.0, &mut out), Ok(()));
    assert_eq!(out, mixed_solution(0.0));
    assert_eq!(solver.interpolate(0.1, &mut out), Err(Error::OutsideInterval { t: 0.1, from: 0.0, to: 0.0 }));
    assert_eq!(solver.step_towards(1.0), Ok(Progress::Running));
    let after_first = *solver.state();
    assert_eq!(solver.step_towards(1.0), Ok(Progress::Reached));
    let evals = solver.stats().rhs_evals;
    assert_eq!(evals, 25);
    assert_eq!(solver.interpolate(0.5, &mut out), Ok(()));
    assert_eq!(out, after_first);
    assert_eq!(solver.interpolate(1.0, &mut out), Ok(()));
    assert_eq!(&out, solver.state());
    assert_eq!(solver.stats().rhs_evals, evals);
    for t in [0.6, 0.9] {
        solver.interpolate(t, &mut out).unwrap();
        assert!(distance(&out, &mixed_solution(t)) < 1e-5);
    }
    // The three stages for dense output are computed once a step.
    assert_eq!(solver.stats().rhs_evals, evals + 3);
    assert_eq!(solver.interpolate(0.4, &mut out), Err(Error::OutsideInterval { t: 0.4, from: 0.5, to: 1.0 }));
    assert!(matches!(solver.interpolate(f64::NAN, &mut out), Err(Error::OutsideInterval { .. })));
}

#[test]
fn sampling_rejects_times_outside() {
    let mut solver =
        Integrator::new(&Mixed, Tsit5, 0.0, mixed_solution(0.0), Options::adaptive(1e-6, 1e-6)).unwrap();
    let early = solver.sample(1.0, [-0.5], |_, _| {});
    assert_eq!(early, Err(Error::OutsideInterval { t: -0.5, from: 0.0, to: 0.0 }));
    let late = solver.sample(1.0, [1.5], |_, _| {});
    assert_eq!(late, Err(Error::OutsideInterval { t: 1.5, from: 0.0, to: 1.0 }));
    assert!(matches!(solver.sample(1.0, [f64::NAN], |_, _| {}), Err(Error::TimeNotFinite { .. })));
    assert!(matches!(solver.sample(f64::INFINITY, [], |_, _| {}), Err(Error::TimeNotFinite { .. })));
    assert!(matches!(solver.integrate_to(f64::NAN), Err(Error::TimeNotFinite { .. })));
    assert_eq!(solver.t(), 0.0);
    solver.sample(1.0, [0.0, 1.0], |t, y| assert!(distance(y, &mixed_solution(t)) < 1e-5)).unwrap();
    assert_eq!(solver.t(), 1.0);
}

#[test]
fn tolerances_and_starts_are_rejected() {
    let new = |options, t0, y0| Integrator::new(&Mixed, Tsit5, t0, y0, options).unwrap_err();
    let good = Options::adaptive(1e-6, 1e-6);
    let y0 = mixed_solution(0.0);
    let least = 10.0 * f64::EPSILON;
    assert_eq!(new(Options::adaptive(1e-15, 0.0), 0.0, y0), Error::RelativeTolerance { value: 1e-15, least });
    assert_eq!(new(Options::adaptive(0.0, 0.0), 0.0, y0), Error::ZeroTolerances { least });
    assert_eq!(
        new(Options::adaptive(1e-6, -1.0), 0.0, y0),
        Error::AbsoluteTolerance { value: -1.0, least: 0.0 }
    );
    assert_eq!(new(Options::fixed(0.0), 0.0, y0), Error::StepSize { value: 0.0 });
    assert_eq!(new(good, f64::INFINITY, y0), Error::TimeNotFinite { value: f64::INFINITY });
    let bad = [0.0, 0.0, f64::NAN, 0.0];
    assert_eq!(new(good, 0.5, bad), Error::Failure(Failure::NonFinite { t: 0.5, index: 2 }));
    let overflow = [0.0, 0.0, 0.0, 1e200];
    assert_eq!(new(good, 0.5, overflow), Error::Failure(Failure::NonFinite { t: 0.5, index: 2 }));
    let rk4 = Integrator::new(&Mixed, Rk4, 0.0, y0, good).unwrap_err();
    assert_eq!(rk4, Error::NoErrorEstimate { method: "rk4" });
}

/// `y' = y^2`, which reaches infinity at `t = 1` from `y(0) = 1`.
struct BlowUp;

impl System<f64> for BlowUp {
    type State = [f64; 1];
    fn rhs(&self, _t: f64, y: &[f64; 1], dy: &mut [f64; 1]) {
        dy[0] = y[0] * y[0];
    }
}

#[test]
fn blow_up_ends_in_step_too_small() {
    fn check<M: Method<f64, BlowUp>>(method: M) {
        let options = Options::adaptive(1e-8, 1e-8);
        let mut solver = Integrator::new(&BlowUp, method, 0.0, [1.0], options).unwrap();
        let error = solver.integrate_to(2.0).unwrap_err();
        let Error::StepTooSmall { t, h } = error else { panic!("{}: {error:?}", M::TABLEAU.name) };
        assert!((t - 1.0).abs() < 1e-6 && h > 0.0 && h < 1e-14, "{}: {error:?}", M::TABLEAU.name);
        // The last accepted state is kept, and finite.
        assert_eq!(solver.t(), t);
        assert!(solver.state()[0] > 1e6 && solver.state()[0].is_finite());
        let steps = solver.stats().steps;
        assert_eq!(solver.integrate_to(2.0), Err(error));
        assert_eq!(solver.stats().steps, steps);
    }
    check(Dopri5);
    check(Tsit5);
    check(Dop853);
    check(Vern9);
}

#[test]
fn step_limit_is_kept() {
    let options = Options::adaptive(1e-10, 1e-10).with_max_steps(5);
    let mut solver = Integrator::new(&Mixed, Tsit5, 0.0, mixed_solution(0.0), options).unwrap();
    let error = solver.integrate_to(10.0).unwrap_err();
    assert_eq!(error, Error::TooManySteps { t: solver.t(), limit: 5 });
    assert!(solver.t() > 0.0 && distance(solver.state(), &mixed_solution(solver.t())) < 1e-8);
    // The limit interrupts between steps: the last one can still be interpolated.
    let mut out = [0.0; 4];
    let middle = 0.5 * (solver.previous_t() + solver.t());
    solver.interpolate(middle, &mut out).unwrap();
    assert!(distance(&out, &mixed_solution(middle)) < 1e-8);
    assert_eq!(solver.stats().steps + solver.stats().rejected, 5);
    // The limit is that of one call.
    assert_eq!(solver.step_towards(10.0), Ok(Progress::Running));
}

/// `y' = -1/(2 y)`, so that `y = sqrt(1 - t)` meets a vanishing pivot at `t = 1`.
struct Pivot {
    explains: bool,
}

impl System<f64> for Pivot {
    type State = [f64; 2];
    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        // Infinite at the pivot, and NaN beyond.
        *dy = [0.0, -0.5 / (y[1].sqrt() * y[1].sqrt())];
    }
    fn check(&self, t: f64, y: &[f64; 2]) -> Result<(), Failure> {
        if self.explains && y[1] == 0.0 {
            return Err(Failure::Singular { t, pivot: "y" });
        }
        if self.explains && y[1] < 0.0 {
            return Err(Failure::OutsideDomain { t, condition: "y > 0" });
        }
        Ok(())
    }
}

#[test]
fn failures_are_explained_by_the_system() {
    let options = Options::adaptive(1e-8, 1e-8);
    let singular = Integrator::new(&Pivot { explains: true }, Tsit5, 0.0, [3.0, 0.0], options).map(|_| ());
    assert_eq!(singular, Err(Error::Failure(Failure::Singular { t: 0.0, pivot: "y" })));
    let unexplained =
        Integrator::new(&Pivot { explains: false }, Tsit5, 0.0, [3.0, 0.0], options).map(|_| ());
    assert_eq!(unexplained, Err(Error::Failure(Failure::NonFinite { t: 0.0, index: 1 })));

    fn check<M: Method<f64, Pivot>>(method: M, options: Options<f64>, explains: bool) {
        let name = M::TABLEAU.name;
        let system = Pivot { explains };
        let mut solver = Integrator::new(&system, method, 0.0, [3.0, 1.0], options).unwrap();
        let error = solver.integrate_to(2.0).unwrap_err();
        match (error, explains) {
            (Error::Failure(Failure::OutsideDomain { t, condition: "y > 0" }), true)
            | (Error::Failure(Failure::NonFinite { t, index: 1 }), false) => {
                assert!((t - 1.0).abs() < 0.1, "{name}: {error}");
            }
            _ => panic!("{name}: {error:?}"),
        }
        assert!(solver.t() < 1.01 && solver.t() > 0.8, "{name}: {}", solver.t());
        assert!(solver.state().iter().all(|y| y.is_finite()) && solver.state()[1] > 0.0, "{name}");
    }
    for explains in [true, false] {
        check(Rk4, Options::fixed(0.06), explains);
        check(Dop853, Options::fixed(0.06), explains);
        check(Dopri5, options, explains);
        check(Tsit5, options, explains);
        check(Dop853, options, explains);
        check(Vern9, options, explains);
    }
}

#[test]
fn a_step_out_of_the_domain_is_tried_again_shorter() {
    // y = (1 - t/2)^2 touches zero at t = 2; large trial steps fall below, where sqrt is NaN.
    struct Drain;
    impl System<f64> for Drain {
        type State = [f64; 1];
        fn rhs(&self, _t: f64, y: &[f64; 1], dy: &mut [f64; 1]) {
            dy[0] = -y[0].sqrt();
        }
    }
    let options = Options::adaptive(1e-9, 1e-12).with_initial_step(5.0);
    let mut solver = Integrator::new(&Drain, Tsit5, 0.0, [1.0], options).unwrap();
    solver.integrate_to(1.9).unwrap();
    assert!((solver.state()[0] - 0.0025).abs() < 1e-10);
    assert!(solver.stats().rejected > 0);
}

#[test]
fn dense_output_is_lost_after_a_failed_step() {
    let system = Pivot { explains: true };
    let mut solver = Integrator::new(&system, Rk4, 0.0, [0.0, 1.0], Options::fixed(0.3)).unwrap();
    assert!(solver.integrate_to(2.0).is_err());
    let (from, to) = (solver.previous_t(), solver.t());
    assert!(to > from);
    let mut out = [0.0; 2];
    assert_eq!(solver.interpolate(0.5 * (from + to), &mut out), Err(Error::NoDenseOutput { t: to }));
    assert_eq!(solver.interpolate(to, &mut out), Ok(()));
    assert_eq!(&out, solver.state());
}

#[test]
fn single_precision_reaches_its_accuracy() {
    let options = Options::adaptive(1e-5_f32, 1e-6);
    let start = mixed_solution(0.0).map(|y| y as f32);
    let mut solver = Integrator::new(&Mixed, Tsit5, 0.0_f32, start, options).unwrap();
    solver.integrate_to(3.0).unwrap();
    assert!(distance(solver.state(), &mixed_solution(3.0)) < 1e-4);
    let too_tight = Integrator::new(&Mixed, Tsit5, 0.0, start, Options::adaptive(1e-7_f32, 0.0)).map(|_| ());
    assert!(matches!(too_tight, Err(Error::RelativeTolerance { least, .. }) if least > 1e-6));
}

#[test]
fn states_may_have_a_dimension_known_at_run_time() {
    #[derive(Clone)]
    struct Dynamic(Vec<f64>);
    impl StateVector<f64> for Dynamic {
        fn as_slice(&self) -> &[f64] {
            &self.0
        }
        fn as_mut_slice(&mut self) -> &mut [f64] {
            &mut self.0
        }
    }
    struct Same;
    impl System<f64> for Same {
        type State = Dynamic;
        fn rhs(&self, t: f64, y: &Dynamic, dy: &mut Dynamic) {
            let mut out = [0.0; 4];
            Mixed.rhs(t, &[y.0[0], y.0[1], y.0[2], y.0[3]], &mut out);
            dy.0.copy_from_slice(&out);
        }
    }
    let options = Options::adaptive(1e-9, 1e-9);
    let start = mixed_solution(0.0);
    let mut fixed = Integrator::new(&Mixed, Dop853, 0.0, start, options).unwrap();
    let mut dynamic = Integrator::new(&Same, Dop853, 0.0, Dynamic(start.to_vec()), options).unwrap();
    fixed.integrate_to(5.0).unwrap();
    dynamic.integrate_to(5.0).unwrap();
    assert_eq!(fixed.state().as_slice(), dynamic.state().0);
    assert_eq!(fixed.stats(), dynamic.stats());
}

#[test]
fn empty_states_are_integrated() {
    struct Nothing;
    impl System<f64> for Nothing {
        type State = [f64; 0];
        fn rhs(&self, _t: f64, _y: &[f64; 0], _dy: &mut [f64; 0]) {}
    }
    let mut solver = Integrator::new(&&Nothing, Tsit5, 0.0, [], Options::adaptive(1e-9, 1e-9)).unwrap();
    solver.integrate_to(100.0).unwrap();
    assert_eq!(solver.t(), 100.0);
}

#[test]
fn equilibria_and_zero_components_are_no_obstacle() {
    // Absolute tolerance zero, components exactly zero: neither 0/0 nor an endless search for a step.
    struct Rest;
    impl System<f64> for Rest {
        type State = [f64; 2];
        fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
            *dy = [0.0, -y[1]];
        }
    }
    let mut solver = Integrator::new(&Rest, Tsit5, 1e6, [0.0, 1.0], Options::adaptive(1e-8, 0.0)).unwrap();
    solver.integrate_to(1e6 + 1.0).unwrap();
    assert!((solver.state()[1] - (-1.0_f64).exp()).abs() < 1e-7);
    let mut solver = Integrator::new(&Rest, Dop853, 0.0, [0.0, 0.0], Options::adaptive(1e-8, 0.0)).unwrap();
    solver.integrate_to(1e3).unwrap();
    assert_eq!(solver.state(), &[0.0, 0.0]);
}
