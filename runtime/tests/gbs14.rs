//! Extrapolation of order 14 in lanes: its order, its errors against tolerances, output inside of steps and events.

#![cfg(feature = "lanes")]

use std::ops::ControlFlow;

use hamel_runtime::{
    Direction, Error, F64x8, Gbs14, Integrator, Invariants, Norm, Options, OverScalar, Projected, Real,
    System, Vern9,
};

use crate::systems::{Driven, Kepler};

const DRIVEN: Driven<f64> = Driven { a: 0.3, w: 1.7 };
const START: [f64; 3] = [0.4, 0.9, -0.2];
/// Eccentricity one half.
const PERIHELION: [f64; 4] = [0.5, 0.0, 0.0, 1.732_050_807_568_877_2];
const PERIOD: f64 = std::f64::consts::TAU;

fn distance<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn reference(t: f64) -> [f64; 3] {
    let mut solver = Integrator::new(&DRIVEN, Vern9, 0.0, START, Options::adaptive(3e-15, 3e-15)).unwrap();
    solver.integrate_to(t).unwrap();
    *solver.state()
}

#[test]
fn the_order_is_fourteen() {
    let end = reference(6.0);
    let error = |steps: u32| {
        let options = Options::fixed(6.0 / f64::from(steps));
        let mut solver = Integrator::new(&DRIVEN, Gbs14, 0.0, START, options).unwrap();
        solver.integrate_to(6.0).unwrap();
        assert_eq!(solver.stats().rhs_evals, 1 + 14 * u64::from(steps));
        distance(solver.state(), &end)
    };
    let (coarse, fine) = (error(4), error(6));
    let order = (coarse / fine).ln() / 1.5_f64.ln();
    assert!((12.5..16.5).contains(&order), "{order}: {coarse:e} {fine:e}");
}

#[test]
fn first_steps_are_as_long_as_those_that_follow() {
    for exponent in 3..=14 {
        let tolerance = 10.0_f64.powi(-exponent);
        for direction in [1.0, -1.0] {
            let options = Options::adaptive(tolerance, tolerance);
            let mut solver = Integrator::new(&DRIVEN, Gbs14, 0.0, START, options).unwrap();
            let sizes: [f64; 2] = std::array::from_fn(|_| {
                assert!(!solver.step_towards(direction * 50.0).unwrap().reached());
                (solver.t() - solver.previous_t()).abs()
            });
            let ratio = sizes[0] / sizes[1];
            assert!((0.6..1.6).contains(&ratio), "{tolerance:e}, {direction}: {sizes:?}");
            // One step may have been tried before the first.
            assert!(solver.stats().rejected <= 1, "{tolerance:e}: {:?}", solver.stats());
        }
    }
}

#[test]
fn a_short_interval_takes_one_step() {
    let mut solver = Integrator::new(&DRIVEN, Gbs14, 0.0, START, Options::adaptive(1e-12, 1e-12)).unwrap();
    solver.integrate_to(0.2).unwrap();
    let stats = solver.stats();
    assert_eq!((stats.steps, stats.rejected, stats.rhs_evals), (1, 0, 1 + 5 + 14));
    assert!(distance(solver.state(), &reference(0.2)) < 1e-14);
}

/// Four rows are of order eight, and their estimate judges them as that of seven does.
#[test]
fn four_rows_are_enough_for_a_short_interval_to_a_low_accuracy() {
    let error = |t: f64| {
        let options = Options::adaptive(1e-4, 1e-4);
        let mut solver = Integrator::new(&DRIVEN, Gbs14, 0.0, START, options).unwrap();
        solver.integrate_to(t).unwrap();
        let stats = solver.stats();
        assert_eq!((stats.steps, stats.rejected, stats.rhs_evals), (1, 0, 1 + 5 + 8), "{t}");
        let mut within = START;
        solver.interpolate(0.5 * t, &mut within).unwrap();
        assert!(distance(&within, &reference(0.5 * t)) < 1e-6, "{t}");
        distance(solver.state(), &reference(t))
    };
    let (coarse, fine) = (error(0.4), error(0.2));
    assert!(coarse < 1e-6 && coarse > 1e-13, "{coarse:e}");
    let order = (coarse / fine).log2();
    assert!((7.5..10.5).contains(&order), "{order}: {coarse:e} {fine:e}");
}

/// A start at which nothing can be foreseen: all is zero, or the trial leaves the domain.
#[test]
fn starts_that_tell_nothing_are_left() {
    let mut solver = Integrator::new(&DRIVEN, Gbs14, 0.0, [0.0; 3], Options::adaptive(1e-10, 1e-10)).unwrap();
    solver.integrate_to(3.0).unwrap();
    let mut other = Integrator::new(&DRIVEN, Vern9, 0.0, [0.0; 3], Options::adaptive(1e-13, 1e-13)).unwrap();
    other.integrate_to(3.0).unwrap();
    assert!(distance(solver.state(), other.state()) < 1e-9);
    // Falling straight into the centre: the trial passes through it.
    let fall = [1e-3, 0.0, -1e-6, 0.0];
    let mut solver = Integrator::new(&Kepler, Gbs14, 0.0, fall, Options::adaptive(1e-10, 0.0)).unwrap();
    solver.integrate_to(3e-5).unwrap();
    assert!(solver.state()[0] > 0.0 && solver.stats().rejected < 20, "{:?}", solver.stats());
}

#[test]
fn errors_follow_the_tolerance_in_either_direction_of_time() {
    for tolerance in [1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14] {
        let mut solver =
            Integrator::new(&Kepler, Gbs14, 0.0, PERIHELION, Options::adaptive(tolerance, tolerance))
                .unwrap();
        solver.integrate_to(3.0 * PERIOD).unwrap();
        let error = distance(solver.state(), &PERIHELION);
        // An error along the orbit grows as the square of the number of periods.
        assert!(error < 1e4 * tolerance, "{tolerance:e}: {error:e}");
        let n_forth = solver.stats().steps;
        solver.integrate_to(0.0).unwrap();
        let error = distance(solver.state(), &PERIHELION);
        assert!(error < 4e4 * tolerance, "{tolerance:e}: {error:e}");
        assert!(n_forth > 5, "{n_forth}");
    }
}

/// At the same tolerance as `Vern9`, in fewer evaluations one after the other.
#[test]
fn steps_are_longer_than_those_of_lower_order() {
    let evaluations = |gbs: bool| {
        let options = Options::adaptive(1e-12, 1e-12);
        if gbs {
            let mut solver = Integrator::new(&Kepler, Gbs14, 0.0, PERIHELION, options).unwrap();
            solver.integrate_to(PERIOD).unwrap();
            solver.stats().rhs_evals
        } else {
            let mut solver = Integrator::new(&Kepler, Vern9, 0.0, PERIHELION, options).unwrap();
            solver.integrate_to(PERIOD).unwrap();
            solver.stats().rhs_evals
        }
    };
    let (gbs, vern) = (evaluations(true), evaluations(false));
    assert!(10 * gbs < 6 * vern, "{gbs} {vern}");
}

#[test]
fn states_inside_of_steps_are_as_accurate_as_their_ends() {
    let mut solver = Integrator::new(&DRIVEN, Gbs14, 0.0, START, Options::adaptive(1e-12, 1e-12)).unwrap();
    let times = (0..=40).map(|k| 0.25 * f64::from(k));
    let mut sampled = Vec::new();
    solver.sample(10.0, times, |t, y| sampled.push((t, *y))).unwrap();
    assert_eq!(sampled.len(), 41);
    assert!(solver.stats().steps < 20);
    for (t, y) in sampled {
        let error = distance(&y, &if t == 0.0 { START } else { reference(t) });
        // The error of all steps before grows to 2.2e-12.
        assert!(error < 4e-12, "{t}: {error:e}");
    }
    // Near the end of a step the state inside of it is that of the end.
    let (from, to) = (solver.previous_t(), solver.t());
    let mut inside = [0.0; 3];
    solver.interpolate(to - (to - from) * 1e-14, &mut inside).unwrap();
    assert!(distance(&inside, solver.state()) < 1e-13);
}

#[test]
fn events_are_found_to_the_spacing_of_times() {
    let mut solver =
        Integrator::new(&Kepler, Gbs14, 0.0, PERIHELION, Options::adaptive(1e-14, 1e-14)).unwrap();
    let mut times = Vec::new();
    let progress = solver
        .integrate_with_events(
            3.2 * PERIOD,
            [Direction::Rising],
            |_, y| [y[1]],
            |event| {
                times.push(event.t);
                // Just after the change of sign, which is passed at a speed of 1.7 at most; the first is the start.
                assert!((0.0..=2.0 * f64::EPSILON * event.t).contains(&event.state[1]), "{:?}", event.state);
                if times.len() == 4 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            },
        )
        .unwrap();
    assert!(!progress.reached());
    assert_eq!(times.len(), 4);
    for (k, t) in times.iter().enumerate() {
        assert!((t - PERIOD * k as f64).abs() < 5e-12, "{k}: {t}");
    }
    assert_eq!(solver.t(), times[3]);
}

#[test]
fn an_event_costs_a_few_steps() {
    let evaluations = |watched: bool| {
        let options = Options::adaptive(1e-10, 1e-10);
        let mut solver = Integrator::new(&Kepler, Gbs14, 0.0, PERIHELION, options).unwrap();
        let mut n_events = 0;
        let functions =
            |_: f64, y: &[f64; 4]| if watched { [y[1], y[0] - 0.2, y[3] * y[2] - 0.1] } else { [1.0; 3] };
        let progress = solver
            .integrate_with_events(4.0 * PERIOD, [Direction::Either; 3], functions, |_| {
                n_events += 1;
                ControlFlow::Continue(())
            })
            .unwrap();
        assert!(progress.reached());
        (n_events, solver.stats().rhs_evals)
    };
    let ((none, plain), (found, with_events)) = (evaluations(false), evaluations(true));
    assert_eq!(none, 0);
    assert!(found >= 20, "{found}");
    // Two steps and the one whose state is told would be the least; bisection would take fifty. Where the cubic between
    // the ends is not close to the motion, five places within the step are looked at besides.
    let steps = (with_events - plain) as f64 / (14 * found) as f64;
    assert!(steps < 7.5, "{steps} of {found} events");
}

/// Where the cubic leaves the domain of the function, the place is found without it.
#[test]
fn an_event_is_found_where_a_cubic_misses_the_domain() {
    struct Turning;
    impl<R: Real> System<R> for Turning {
        type State = [R; 2];
        fn rhs(&self, _t: R, y: &[R; 2], dy: &mut [R; 2]) {
            *dy = [y[1], -y[0]];
        }
    }
    impl<Q: Real, R: Real> OverScalar<Q, R> for Turning {
        type Over = Turning;
        fn over(&self, _convert: impl Fn(R) -> Q) -> Turning {
            Turning
        }
        fn state_over(state: &[R; 2], convert: impl Fn(R) -> Q) -> [Q; 2] {
            state.map(convert)
        }
    }
    let options = Options::fixed(2.5);
    let mut solver = Integrator::new(&Turning, Gbs14, 0.0, [0.0, 1.0], options).unwrap();
    let mut misses = 0;
    let mut times = Vec::new();
    // On the circle the radius is one; a cubic over two and a half radians is far inside of it.
    let function = |_: f64, y: &[f64; 2]| {
        let is_on_circle = (y[0].hypot(y[1]) - 1.0).abs() < 1e-3;
        misses += u32::from(!is_on_circle);
        [if is_on_circle { y[0] - y[1] } else { f64::NAN }]
    };
    let progress = solver
        .integrate_with_events(2.5, [Direction::Rising], function, |event| {
            times.push(event.t);
            ControlFlow::Continue(())
        })
        .unwrap();
    assert!(progress.reached());
    assert!(misses > 0);
    assert_eq!(times.len(), 1);
    assert!((times[0] - std::f64::consts::FRAC_PI_4).abs() < 1e-9, "{times:?}");
}

#[test]
fn projection_keeps_the_energy_of_steps_and_between_them() {
    let options = Options::adaptive(1e-5, 1e-5);
    let mut solver =
        Integrator::new(&Kepler, Projected::<_, 1>::new(Gbs14), 0.0, PERIHELION, options).unwrap();
    let [level] = Kepler.values(0.0, &PERIHELION);
    let times = (1..200).map(|k| 0.1 * f64::from(k));
    let mut worst = 0.0_f64;
    solver.sample(20.0, times, |t, y| worst = worst.max((Kepler.values(t, y)[0] - level).abs())).unwrap();
    assert!(worst < 4e-15, "{worst:e}");
}

/// Trajectories in lanes: the order, the accuracy of each, and sums in another order than those of one trajectory.
#[test]
fn trajectories_in_lanes_are_as_accurate_as_one() {
    fn starts(k: usize) -> [f64; 3] {
        [START[0] + 0.1 * k as f64, START[1], START[2]]
    }
    let system = OverScalar::<F64x8>::over(&DRIVEN, F64x8::splat);
    let y0: [F64x8; 3] = std::array::from_fn(|c| F64x8::new(std::array::from_fn(|lane| starts(lane)[c])));
    let time = F64x8::splat;
    let fixed = Options::fixed(time(0.75));
    let mut lanes = Integrator::new(&system, Gbs14, time(0.0), y0, fixed).unwrap();
    lanes.integrate_to(time(6.0)).unwrap();
    assert_eq!(lanes.stats().rhs_evals, 1 + 8 * 50);
    let adaptive = Options::adaptive(time(1e-12), time(1e-12));
    let mut in_steps = Integrator::new(&system, Gbs14, time(0.0), y0, adaptive).unwrap();
    in_steps.integrate_to(time(6.0)).unwrap();
    let mut inside = y0;
    in_steps.interpolate((in_steps.previous_t() + in_steps.t()) * time(0.5), &mut inside).unwrap();
    for lane in 0..8 {
        let mut one = Integrator::new(&DRIVEN, Gbs14, 0.0, starts(lane), Options::fixed(0.75)).unwrap();
        one.integrate_to(6.0).unwrap();
        let of_lane = |y: &[F64x8; 3]| y.map(|x| x.lane(lane));
        let apart = distance(&of_lane(lanes.state()), one.state());
        // Sums in another order, whose weights are up to 56, over steps that part neighbours.
        assert!(apart < 2e-13, "{lane}: {apart:e}");
        let accurate = |t: f64| {
            let options = Options::adaptive(3e-15, 3e-15);
            let mut solver = Integrator::new(&DRIVEN, Vern9, 0.0, starts(lane), options).unwrap();
            solver.integrate_to(t).unwrap();
            *solver.state()
        };
        assert!(distance(&of_lane(in_steps.state()), &accurate(6.0)) < 4e-12, "{lane}");
        let middle = 0.5 * (in_steps.previous_t().lane(0) + in_steps.t().lane(0));
        assert!(distance(&of_lane(&inside), &accurate(middle)) < 4e-12, "{lane}");
    }
    let refused = Options::adaptive(time(5e-15), time(0.0));
    assert!(Integrator::new(&system, Gbs14, time(0.0), y0, refused).is_err());
}

#[test]
fn tolerances_below_its_floor_are_refused() {
    let refused = Integrator::new(&Kepler, Gbs14, 0.0, PERIHELION, Options::adaptive(5e-15, 0.0)).map(|_| ());
    assert_eq!(refused, Err(Error::RelativeTolerance { value: 5e-15, least: 1e-14 }));
    let options = Options::adaptive(0.0, 1e-9).with_norm(Norm::Max);
    let mut solver = Integrator::new(&Kepler, Gbs14, 0.0, PERIHELION, options).unwrap();
    solver.integrate_to(PERIOD).unwrap();
    assert!(distance(solver.state(), &PERIHELION) < 1e-7);
}
