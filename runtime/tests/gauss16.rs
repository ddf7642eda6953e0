//! Collocation of order 16 in lanes: its order and structure, round-off over many steps, output inside of steps,
//! events.

#![cfg(feature = "lanes")]

use std::ops::ControlFlow;

use hamel_runtime::{
    Direction, DoubleDouble, Error, F64x4, Failure, Gauss16, Integrator, Invariants, Options, OverScalar,
    Projected, Real, System, Vern9,
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

/// Relative error of the energy at a state, computed with 31 digits.
fn energy_error(start: &[f64; 4], y: &[f64; 4]) -> f64 {
    let energy = |y: &[f64; 4]| Kepler.values(DoubleDouble::ZERO, &y.map(DoubleDouble::from))[0];
    let error = (energy(y) - energy(start)) / energy(start);
    if DoubleDouble::ZERO.all_gt(error) { -error.magnitude() } else { error.magnitude() }
}

/// A pair of oscillators, `q'' = -q`.
#[derive(Clone, Copy)]
struct Springs;

impl<R: Real> System<R> for Springs {
    type State = [R; 4];
    fn rhs(&self, _t: R, y: &[R; 4], dy: &mut [R; 4]) {
        *dy = [y[2], y[3], -y[0], -y[1]];
    }
}

impl<Q: Real, R: Real> OverScalar<Q, R> for Springs {
    type Over = Springs;
    fn over(&self, _convert: impl Fn(R) -> Q) -> Springs {
        Springs
    }
    fn state_over(state: &[R; 4], convert: impl Fn(R) -> Q) -> [Q; 4] {
        state.map(convert)
    }
}

#[test]
fn the_order_is_sixteen() {
    fn error<S: OverScalar<F64x4, State = [f64; 4]>>(system: &S, start: [f64; 4], t: f64, n: u32) -> f64 {
        let options = Options::fixed(t / f64::from(n));
        let mut solver = Integrator::new(system, Gauss16, 0.0, start, options).unwrap();
        solver.integrate_to(t).unwrap();
        distance(solver.state(), &start)
    }
    let order = |errors: [f64; 2], steps: [u32; 2]| {
        (errors[0] / errors[1]).ln() / (f64::from(steps[1]) / f64::from(steps[0])).ln()
    };
    // Four turns of the oscillators, one of Kepler's problem: both end where they began.
    let springs = [9, 12].map(|n| error(&Springs, PERIHELION, 4.0 * PERIOD, n));
    let kepler = [22, 30].map(|n| error(&Kepler, PERIHELION, PERIOD, n));
    let found = [order(springs, [9, 12]), order(kepler, [22, 30])];
    assert!(found.iter().all(|order| (15.3..16.7).contains(order)), "{found:?} {springs:?} {kepler:?}");
}

#[test]
fn quadratic_invariants_are_kept_by_steps_of_any_length() {
    let options = Options::fixed(2.0);
    let mut solver = Integrator::new(&Springs, Gauss16, 0.0, PERIHELION, options).unwrap();
    let square = |y: &[f64; 4]| y.iter().map(|y| y * y).sum::<f64>();
    for _ in 0..100_000 {
        let _ = solver.step_towards(1e300).unwrap();
    }
    let drift = (square(solver.state()) / square(&PERIHELION) - 1.0).abs();
    // A random walk of 1e-15 a step, three hundred of them; a drift of as much would be 1e-10.
    assert!(drift < 1e-12, "{drift:e}");
}

#[test]
fn round_off_of_the_energy_adds_up_as_a_random_walk() {
    const ORBITS: u32 = 16;
    const STEPS: [u32; 3] = [1_000, 10_000, 100_000];
    let mut errors = [[0.0; ORBITS as usize]; 3];
    for k in 0..ORBITS {
        let e = 0.4 + 0.0123 * f64::from(k);
        let start = [1.0 - e, 0.0, 0.0, ((1.0 + e) / (1.0 - e)).sqrt()];
        let mut solver = Integrator::new(&Kepler, Gauss16, 0.0, start, Options::fixed(0.05)).unwrap();
        let mut next = 0;
        for step in 1..=STEPS[2] {
            let _ = solver.step_towards(1e300).unwrap();
            if step == STEPS[next] {
                errors[next][k as usize] = energy_error(&start, solver.state());
                next += 1;
            }
        }
    }
    let n = f64::from(ORBITS);
    let rms = errors.map(|e| (e.iter().map(|e| e * e).sum::<f64>() / n).sqrt());
    let mean = errors.map(|e| e.iter().sum::<f64>() / n);
    // Ten times in a hundredfold time, not a hundred; and no sign of its own beyond what 16 orbits have by chance.
    assert!(rms[2] < 8e-15 && rms[2] < 30.0 * rms[0], "{rms:?}");
    assert!(mean[2].abs() < rms[2], "{mean:?} {rms:?}");
    // The classical method of order 9 at the floor of its steps has a drift.
    let mut solver = Integrator::new(&Kepler, Vern9, 0.0, PERIHELION, Options::fixed(0.05)).unwrap();
    for _ in 0..STEPS[2] {
        let _ = solver.step_towards(1e300).unwrap();
    }
    let drift = energy_error(&PERIHELION, solver.state()).abs();
    assert!(drift > 100.0 * rms[2], "{drift:e}");
}

#[test]
fn states_inside_of_a_step_are_as_accurate_as_its_end_and_change_no_step() {
    let options = Options::fixed(0.5);
    let mut alone = Integrator::new(&DRIVEN, Gauss16, 0.0, START, options).unwrap();
    let mut watched = Integrator::new(&DRIVEN, Gauss16, 0.0, START, options).unwrap();
    alone.integrate_to(12.0).unwrap();
    let mut sampled = Vec::new();
    watched.sample(12.0, (0..40).map(|k| 0.3 * f64::from(k)), |t, y| sampled.push((t, *y))).unwrap();
    assert_eq!(alone.state(), watched.state());
    assert_eq!(sampled.len(), 40);
    for (t, y) in sampled {
        let error = distance(&y, &if t == 0.0 { START } else { reference(t) });
        assert!(error < 1e-12, "{t}: {error:e}");
    }
    let (from, to) = (watched.previous_t(), watched.t());
    let mut inside = [0.0; 3];
    watched.interpolate(to - (to - from) * 1e-14, &mut inside).unwrap();
    assert!(distance(&inside, watched.state()) < 1e-13);
}

#[test]
fn iterations_inside_of_a_step_start_from_its_stages() {
    let mut solver = Integrator::new(&DRIVEN, Gauss16, 0.0, START, Options::fixed(0.5)).unwrap();
    let _ = solver.step_towards(10.0).unwrap();
    let first = solver.stats().rhs_evals;
    let mut inside = [0.0; 3];
    solver.interpolate(0.3, &mut inside).unwrap();
    // The first step has started from the slope at its start alone.
    assert!(2 * (solver.stats().rhs_evals - first) <= first, "{first} {:?}", solver.stats());
}

#[test]
fn time_can_be_reversed() {
    let options = Options::fixed(0.1);
    let mut solver = Integrator::new(&Kepler, Gauss16, 0.0, PERIHELION, options).unwrap();
    solver.integrate_to(100.0).unwrap();
    solver.integrate_to(0.0).unwrap();
    let error = distance(solver.state(), &PERIHELION);
    assert!(error < 2e-12, "{error:e}");
}

#[test]
fn events_are_found_to_the_spacing_of_times() {
    let options = Options::fixed(PERIOD / 60.3);
    let mut solver = Integrator::new(&Kepler, Gauss16, 0.0, PERIHELION, options).unwrap();
    let mut times = Vec::new();
    let progress = solver
        .integrate_with_events(
            3.2 * PERIOD,
            [Direction::Rising],
            |_, y| [y[1]],
            |event| {
                times.push(event.t);
                if times.len() == 4 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            },
        )
        .unwrap();
    assert!(!progress.reached());
    // The first is the start.
    assert_eq!(times.len(), 4);
    for (k, t) in times.iter().enumerate() {
        assert!((t - PERIOD * k as f64).abs() <= 1e-13 * PERIOD * k as f64, "{k}: {t}");
    }
    assert_eq!(solver.t(), times[3]);
    // It goes on from there.
    solver.integrate_to(4.0 * PERIOD).unwrap();
    assert!(distance(solver.state(), &PERIHELION) < 1e-11);
}

#[test]
fn projection_keeps_the_energy_of_steps_and_between_them() {
    // Steps at which the method alone has errors of 1e-12.
    let method = Projected::<_, 1>::new(Gauss16);
    let mut solver = Integrator::new(&Kepler, method, 0.0, PERIHELION, Options::fixed(0.3)).unwrap();
    let times = (1..2000).map(|k| 0.1 * f64::from(k));
    let mut worst = 0.0_f64;
    solver.sample(200.0, times, |_, y| worst = worst.max(energy_error(&PERIHELION, y).abs())).unwrap();
    assert!(worst < 1e-15, "{worst:e}");
}

#[test]
fn what_it_cannot_do_is_said() {
    let refused =
        Integrator::new(&Kepler, Gauss16, 0.0, PERIHELION, Options::adaptive(1e-9, 1e-9)).map(|_| ());
    assert_eq!(refused, Err(Error::NoErrorEstimate { method: "gauss16" }));
    let mut solver = Integrator::new(&Springs, Gauss16, 0.0, PERIHELION, Options::fixed(100.0)).unwrap();
    let failed = solver.step_towards(1e4).map(|_| ());
    let is_said = matches!(
        failed,
        Err(Error::NotConverged { method: "gauss16", .. } | Error::Failure(Failure::NonFinite { .. }))
    );
    assert!(is_said, "{failed:?}");
    assert_eq!((solver.t(), *solver.state()), (0.0, PERIHELION));
}
