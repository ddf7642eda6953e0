//! Events: times, order, direction, stops and what cannot be located.

use std::ops::ControlFlow::{Break, Continue};

use hamel_runtime::{
    Direction, Dop853, Error, Failure, Gauss8, Integrator, Jet, Method, Options, Progress, Rk4, System,
    Taylor, Tsit5, Vern9,
};

/// `y = (cos t, -sin t)`.
struct Circle;

impl System<f64> for Circle {
    type State = [f64; 2];
    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [y[1], -y[0]];
    }
}

impl Jet<f64> for Circle {
    type Workspace = ();
    fn workspace(&self) {}
    fn series(&self, _t: f64, y: &[f64; 2], (): &mut (), out: &mut [[f64; 2]]) {
        let mut c = *y;
        for (k, out) in out.iter_mut().enumerate() {
            *out = c;
            let n = (k + 1) as f64;
            c = [c[1] / n, -c[0] / n];
        }
    }
}

const PI: f64 = std::f64::consts::PI;

/// Indices and times of the events of `cos t`, `sin t` and `t - 2` up to `end`.
fn events<M: Method<f64, Circle>>(method: M, options: Options<f64>, end: f64) -> Vec<(usize, f64)> {
    let mut found = vec![];
    let mut solver = Integrator::new(&Circle, method, 0.0, [1.0, 0.0], options).unwrap();
    let directions = [Direction::Either, Direction::Rising, Direction::Falling];
    let reached = solver.integrate_with_events(
        end,
        directions,
        |t, y| [y[0], -y[1], if end > 0.0 { 2.0 - t } else { t + 2.0 }],
        |event| {
            assert!(found.len() < 100);
            found.push((event.index, event.t));
            Continue(())
        },
    );
    assert_eq!((reached, solver.t()), (Ok(Progress::Reached), end));
    found
}

#[test]
fn events_are_located_in_the_order_of_time() {
    fn check<M: Method<f64, Circle>>(method: M, options: Options<f64>, tolerance: f64) {
        // At zero the sine is zero and rises; at pi it falls.
        let forward = [(1, 0.0), (0, 0.5 * PI), (2, 2.0), (0, 1.5 * PI), (1, 2.0 * PI), (0, 2.5 * PI)];
        // Backward in time the sine falls from zero to negative, and rises at -pi.
        let backward = [(0, -0.5 * PI), (2, -2.0), (1, -PI), (0, -1.5 * PI), (0, -2.5 * PI)];
        for (end, expected) in [(9.0, &forward[..]), (-9.0, &backward[..])] {
            let found = events(method, options, end);
            let name = M::TABLEAU.name;
            assert_eq!(found.len(), expected.len(), "{name}: {found:?}");
            for (&(index, t), &(expected_index, expected_t)) in found.iter().zip(expected) {
                assert_eq!(index, expected_index, "{name}: {found:?}");
                assert!((t - expected_t).abs() < tolerance, "{name}: {found:?}");
            }
        }
    }
    // Errors of steps and of dense output, of some tens of tolerances.
    check(Rk4, Options::fixed(0.01), 1e-8);
    check(Gauss8::fixed_point(), Options::fixed(0.1), 1e-8);
    check(Tsit5, Options::adaptive(1e-10, 1e-10), 1e-8);
    check(Dop853, Options::adaptive(1e-10, 1e-10), 1e-8);
    check(Vern9, Options::adaptive(1e-12, 1e-12), 1e-10);
    check(Taylor::new(), Options::adaptive(1e-12, 1e-12), 1e-11);
    check(Taylor::of_order(8), Options::fixed(0.1), 1e-9);
    // All events of one function within one step, and several of different ones in one step.
    check(Vern9, Options::fixed(1.5), 1e-3);
    check(Taylor::new(), Options::fixed(1.5), 1e-12);
}

#[test]
fn a_function_of_time_is_located_to_round_off() {
    let options = Options::fixed(0.7);
    let mut solver = Integrator::new(&Circle, Rk4, 0.0, [1.0, 0.0], options).unwrap();
    let mut found = vec![];
    let _ = solver
        .integrate_with_events(
            3.0,
            [Direction::Rising; 2],
            |t, _| [t - 1.23, t.powi(3) - 8.0],
            |event| {
                found.push(event.t);
                Continue(())
            },
        )
        .unwrap();
    assert_eq!(found.len(), 2);
    for (t, expected) in found.into_iter().zip([1.23, 2.0]) {
        assert!((0.0..1e-15).contains(&(t - expected)), "{:e}", t - expected);
    }
}

#[test]
fn a_stop_leaves_the_integrator_at_the_event() {
    stops_at_events(Vern9);
    stops_at_events(Taylor::new());
}

fn stops_at_events(method: impl Method<f64, Circle>) {
    let mut solver =
        Integrator::new(&Circle, method, 0.0, [1.0, 0.0], Options::adaptive(1e-12, 1e-12)).unwrap();
    let zero_of_cosine = |_: f64, y: &[f64; 2]| [y[0]];
    let mut times = vec![];
    // Every stop is left again without finding the same event twice.
    for n in 1..=3 {
        let progress = solver.integrate_with_events(20.0, [Direction::Either], zero_of_cosine, |event| {
            times.push((event.t, *event.state));
            Break(())
        });
        assert_eq!((progress, times.len()), (Ok(Progress::Running), n));
        assert_eq!((solver.t(), *solver.state()), times[n - 1]);
        let expected = (n as f64 - 0.5) * PI;
        assert!((solver.t() - expected).abs() < 1e-10 && solver.state()[0].abs() < 1e-10);
    }
    let mut out = [0.0; 2];
    let middle = 0.5 * (solver.previous_t() + solver.t());
    let lost = Error::NoDenseOutput { t: solver.t() };
    assert_eq!(solver.interpolate(middle, &mut out), Err(lost));
    solver.integrate_to(10.0).unwrap();
    assert!((solver.state()[0] - 10.0_f64.cos()).abs() < 1e-10);
}

#[test]
fn samples_and_events_are_told_in_the_order_of_time() {
    tells_in_order(Dop853);
    tells_in_order(Taylor::new());
}

fn tells_in_order(method: impl Method<f64, Circle>) {
    use std::cell::RefCell;
    let told = RefCell::new(vec![]);
    let mut solver = Integrator::new(&Circle, method, 0.0, [1.0, 0.0], Options::fixed(1.0)).unwrap();
    let progress = solver.sample_with_events(
        5.0,
        [0.0, 1.5, 1.6, 4.0, 4.9],
        |t, _| told.borrow_mut().push((t * 10.0).round() / 10.0),
        [Direction::Falling, Direction::Rising],
        |_, y| [y[0], y[0]],
        |event| {
            told.borrow_mut().push(event.index as f64 + 100.0);
            if event.index == 1 { Break(()) } else { Continue(()) }
        },
    );
    assert_eq!(progress, Ok(Progress::Running));
    assert_eq!(told.into_inner(), [0.0, 1.5, 100.0, 1.6, 4.0, 101.0]);
    assert!((solver.t() - 1.5 * PI).abs() < 1e-5);
}

#[test]
fn an_event_at_the_end_of_a_step_is_found_once() {
    let mut solver = Integrator::new(&Circle, Rk4, 0.0, [1.0, 0.0], Options::fixed(0.25)).unwrap();
    let mut found = vec![];
    for end in [0.5, 1.0] {
        let progress = solver.integrate_with_events(
            end,
            [Direction::Either],
            |t, _| [t - 0.5],
            |event| {
                found.push(event.t);
                Break(())
            },
        );
        assert_eq!((progress, solver.t()), (Ok(Progress::Reached), end));
    }
    assert_eq!(found, [0.5]);
}

#[test]
fn a_function_that_is_zero_over_a_stretch_is_told_at_its_start() {
    fn check<M: Method<f64, Circle>>(method: M, options: Options<f64>) {
        // Zero from 1.1 to 1.9 and beyond zero after; stretches of many steps, of one, and within one.
        for (from, to) in [(1.1, 1.9), (0.3, 2.9), (1.1, 1.1001)] {
            let functions = |t: f64, _: &[f64; 2]| {
                let falling = if t < from { from - t } else { (to - t).min(0.0) };
                [falling, -falling, falling]
            };
            let directions = [Direction::Falling, Direction::Rising, Direction::Rising];
            let mut found = vec![];
            let mut solver = Integrator::new(&Circle, method, 0.0, [1.0, 0.0], options).unwrap();
            let reached = solver.integrate_with_events(3.0, directions, functions, |event| {
                found.push((event.index, event.t));
                Continue(())
            });
            assert_eq!(reached, Ok(Progress::Reached));
            assert_eq!(found.iter().map(|event| event.0).collect::<Vec<_>>(), [0, 1], "{found:?}");
            for (_, t) in found {
                assert!((from..from + 1e-14).contains(&t), "{}: {t} instead of {from}", M::TABLEAU.name);
            }
        }
    }
    check(Rk4, Options::fixed(0.25));
    check(Rk4, Options::fixed(3.0));
    check(Vern9, Options::adaptive(1e-9, 1e-9));
    check(Taylor::new(), Options::adaptive(1e-9, 1e-9));
}

#[test]
fn event_functions_without_value_are_reported() {
    let mut solver = Integrator::new(&Circle, Rk4, 0.0, [1.0, 0.0], Options::fixed(0.25)).unwrap();
    let functions = |_: f64, y: &[f64; 2]| [1.0, (y[0] - 0.9).sqrt()];
    let error =
        solver.integrate_with_events(9.0, [Direction::Either; 2], functions, |_| Continue(())).unwrap_err();
    assert_eq!(error, Error::EventNotFinite { t: 0.5, index: 1 });
    assert_eq!(solver.t(), 0.5);
    assert!((solver.state()[0] - 0.5_f64.cos()).abs() < 1e-4);
}

/// `y' = -1` on the half line `y > 0`.
struct HalfLine;

impl System<f64> for HalfLine {
    type State = [f64; 1];
    fn rhs(&self, _t: f64, _y: &[f64; 1], dy: &mut [f64; 1]) {
        dy[0] = -1.0;
    }
    fn domain(&self, t: f64, y: &[f64; 1]) -> Result<(), Failure> {
        if y[0] > 0.0 { Ok(()) } else { Err(Failure::OutsideDomain { t, condition: "y > 0" }) }
    }
}

impl Jet<f64> for HalfLine {
    type Workspace = ();
    fn workspace(&self) {}
    fn series(&self, _t: f64, y: &[f64; 1], (): &mut (), out: &mut [[f64; 1]]) {
        out.fill([0.0]);
        (out[0], out[1]) = (*y, [-1.0]);
    }
}

#[test]
fn leaving_the_domain_is_an_error_and_keeps_the_last_state_inside() {
    let outside = Integrator::new(&HalfLine, Tsit5, 0.0, [-1.0], Options::fixed(0.1)).map(|_| ());
    assert_eq!(outside, Err(Failure::OutsideDomain { t: 0.0, condition: "y > 0" }.into()));

    let mut solver = Integrator::new(&HalfLine, Rk4, 0.0, [1.0], Options::fixed(0.3)).unwrap();
    let error = solver.integrate_to(2.0).unwrap_err();
    assert!(
        matches!(error, Error::Failure(Failure::OutsideDomain { t, .. }) if (t - 1.2).abs() < 1e-14),
        "{error:?}"
    );
    assert!((solver.t() - 0.9).abs() < 1e-14 && (solver.state()[0] - 0.1).abs() < 1e-14);

    // Error control comes as close to the boundary as steps change the time.
    ends_at_the_boundary(Tsit5);
    ends_at_the_boundary(Taylor::new());
}

fn ends_at_the_boundary(method: impl Method<f64, HalfLine>) {
    let mut solver = Integrator::new(&HalfLine, method, 0.0, [1.0], Options::adaptive(1e-6, 1e-6)).unwrap();
    let error = solver.integrate_to(2.0).unwrap_err();
    assert!(matches!(error, Error::Failure(Failure::OutsideDomain { .. })), "{error:?}");
    assert!(solver.state()[0] > 0.0 && solver.state()[0] < 1e-13, "{:e}", solver.state()[0]);
    assert!(solver.stats().rejected < 200, "{:?}", solver.stats());
}

#[test]
fn components_have_their_own_tolerances() {
    // Two copies of one equation, the second of which is allowed to be wrong.
    struct Twice;
    impl System<f64> for Twice {
        type State = [f64; 2];
        fn rhs(&self, t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
            *dy = [y[0] * t.cos(), (20.0 * t).sin()];
        }
    }
    let options = Options::adaptive(1e-3, 1e-3);
    let new = || Integrator::new(&Twice, Tsit5, 0.0, [1.0, 0.0], options).unwrap();
    let steps = |rtol, atol| {
        let mut solver = new().with_tolerances(rtol, atol).unwrap();
        solver.integrate_to(5.0).unwrap();
        ((solver.state()[0] / 5.0_f64.sin().exp() - 1.0).abs(), solver.stats().steps)
    };
    let (both_error, both) = steps([1e-10; 2], [1e-10; 2]);
    let (first_error, first) = steps([1e-10, 0.0], [1e-10, 1e9]);
    let (second_error, second) = steps([0.0, 1e-10], [1e9, 1e-10]);
    assert!(both_error < 1e-9 && first_error < 1e-8 && second_error < 1e-2);
    assert!(3 * first < both && 3 * first < second, "{first}, {second} and {both}");
    let wrong = new().with_tolerances([1e-6; 2], [0.0, f64::NAN]).map(|_| ()).unwrap_err();
    assert!(matches!(wrong, Error::ComponentTolerances { index: 1, rtol: 1e-6, atol } if atol.is_nan()));
    let zero = new().with_tolerances([0.0; 2], [0.0, 1.0]).map(|_| ());
    assert_eq!(zero, Err(Error::ComponentTolerances { index: 0, rtol: 0.0, atol: 0.0 }));
}

/// `y' = -1 / (2 y)`, so that `y^2 = 1 - t` ends at `t = 1`; its series has the radius `y^2`.
struct Root;

impl System<f64> for Root {
    type State = [f64; 1];
    fn rhs(&self, _t: f64, y: &[f64; 1], dy: &mut [f64; 1]) {
        dy[0] = -0.5 / y[0];
    }
    fn check(&self, t: f64, y: &[f64; 1]) -> Result<(), Failure> {
        if y[0] == 0.0 { Err(Failure::OutsideDomain { t, condition: "y != 0" }) } else { Ok(()) }
    }
}

impl Jet<f64> for Root {
    type Workspace = ();
    fn workspace(&self) {}
    fn series(&self, _t: f64, y: &[f64; 1], (): &mut (), out: &mut [[f64; 1]]) {
        let (mut c, square) = (y[0], y[0] * y[0]);
        for (k, out) in out.iter_mut().enumerate() {
            *out = [c];
            c *= (k as f64 - 0.5) / ((k + 1) as f64 * square);
        }
    }
}

#[test]
fn series_do_not_pass_a_singularity() {
    // y^2 = 1 - t: the solution ends at t = 1.
    for tolerance in [1e-4, 1e-7, 1e-10, 1e-13] {
        let options = Options::adaptive(tolerance, tolerance);
        let mut solver = Integrator::new(&Root, Taylor::new(), 0.0, [1.0], options).unwrap();
        let end = solver.integrate_to(2.0).unwrap_err();
        assert!(matches!(end, Error::StepTooSmall { .. }), "{tolerance:e}: {end:?}");
        // What is known of the square at the end is the error made on the way.
        assert!((solver.t() - 1.0).abs() < 100.0 * tolerance, "{tolerance:e}: {}", solver.t());
    }
}

#[test]
fn series_are_refused_where_they_are_not_finite() {
    let options = Options::adaptive(1e-10, 1e-10);
    let mut solver = Integrator::new(&Root, Taylor::new(), 0.0, [1.0], options).unwrap();
    solver.integrate_to(0.96).unwrap();
    assert!((solver.state()[0] - 0.2).abs() < 1e-9);

    let outside = Failure::OutsideDomain { t: 0.0, condition: "y != 0" };
    let at_zero = Integrator::new(&Root, Taylor::new(), 0.0, [0.0], options).map(|_| ());
    assert_eq!(at_zero, Err(outside.into()));
    // The derivative is finite here, higher coefficients are not.
    let mut solver = Integrator::new(&Root, Taylor::new(), 0.0, [1e-100], Options::fixed(1e-3)).unwrap();
    assert!(matches!(solver.integrate_to(1.0), Err(Error::Failure(Failure::NonFinite { t: 0.0, index: 0 }))));
    assert_eq!((solver.t(), *solver.state()), (0.0, [1e-100]));
}

/// Ticks of a clock, whose steps are as long as the motion.
fn ticks<M: Method<f64, Circle>>(method: M, options: Options<f64>, ends: &[f64], is_told: bool) -> Vec<f64> {
    let mut times = vec![];
    let mut solver = Integrator::new(&Circle, method, 0.0, [1.0, 0.0], options).unwrap();
    if is_told {
        solver = solver.with_events_told();
    }
    for end in ends {
        let clock = |t: f64, _: &[f64; 2]| [(4.0 * PI * t).sin()];
        let told = solver.integrate_with_events(*end, [Direction::Rising], clock, |event| {
            times.push(event.t);
            Continue(())
        });
        assert_eq!(told, Ok(Progress::Reached));
    }
    times
}

#[test]
fn a_clock_ticks_once_however_long_steps_are_and_wherever_motions_are_cut() {
    for options in [Options::fixed(10.0), Options::fixed(0.3), Options::adaptive(1e-9, 1e-9)] {
        for times in [
            ticks(Vern9, options, &[9.9], false),
            ticks(Taylor::new(), options, &[9.9], false),
            // Cut where the clock is zero: the tick of that time has been told.
            ticks(Vern9, options, &[0.0, 0.5, 1.0, 7.5, 9.9], false),
        ] {
            assert_eq!(times.len(), 20, "{times:?}");
            for (k, t) in times.iter().enumerate() {
                assert!((t - 0.5 * k as f64).abs() < 1e-14 * (1.0 + t), "{times:?}");
            }
        }
        // The motion goes on from the end of another one.
        let times = ticks(Dop853, options, &[9.9], true);
        assert!(times.len() == 19 && times[0] > 0.4, "{times:?}");
    }
}

#[test]
fn a_function_that_changes_too_often_is_told() {
    let mut solver = Integrator::new(&HalfLine, Rk4, 0.0, [1e8], Options::fixed(1e7)).unwrap();
    let clock = |t: f64, _: &[f64; 1]| [1.0, (t * 1e3).sin()];
    let told = solver.integrate_with_events(1e7, [Direction::Rising; 2], clock, |_| Continue(()));
    assert!(matches!(told, Err(Error::EventsUnresolved { index: 1, .. })), "{told:?}");
}

#[test]
fn a_function_that_barely_passes_zero_within_a_step_is_seen() {
    // The cosine is below -1 + depth around pi, for a time of sqrt(8 depth).
    for depth in [1e-2, 1e-6, 1e-10] {
        let mut times = vec![];
        let mut solver =
            Integrator::new(&Circle, Taylor::new(), 0.0, [1.0, 0.0], Options::fixed(1.5)).unwrap();
        let function = |_: f64, y: &[f64; 2]| [y[0] + (1.0 - depth)];
        let told = solver.integrate_with_events(5.0, [Direction::Either], function, |event| {
            times.push(event.t - PI);
            Continue(())
        });
        assert_eq!((told, times.len()), (Ok(Progress::Reached), 2), "{depth}: {times:?}");
        // The depth is known to some roundings of one.
        let half = (2.0 * depth).sqrt();
        assert!(times.iter().all(|t| (t.abs() - half).abs() < 0.02 * half), "{depth}: {times:?}");
    }
}
