//! Angles as points of circles within steps: the same motion, error and events as with the angles as numbers.

use std::ops::ControlFlow;

use hamel_runtime::{
    Circles, Direction, Dop853, Dopri5, Integrator, Invariants, Method, OnCircles, Options, Progress,
    Projected, Real, Rk4, System, Tsit5, Vern9,
};

/// A driven pendulum beside one on its axis: an angle, and twice the difference of two.
///
/// ```text
/// a' = v,  b' = w,  v' = -sin a - k sin 2(a - b),  w' = k sin 2(a - b) + cos t
/// ```
#[derive(Clone, Copy)]
struct Pendulums<R> {
    k: R,
    drive: R,
}

impl<R: Real> Pendulums<R> {
    fn derivative(&self, t: R, [v, w]: [R; 2], sine: R, sine_of_twice: R) -> [R; 4] {
        let torque = self.k * sine_of_twice;
        [v, w, -sine - torque, torque + self.drive * t.cos()]
    }
}

impl<R: Real> System<R> for Pendulums<R> {
    type State = [R; 4];

    fn rhs(&self, t: R, y: &[R; 4], dy: &mut [R; 4]) {
        let [a, b, v, w] = *y;
        let twice = R::from_f64(2.0) * (a - b);
        *dy = self.derivative(t, [v, w], a.sin(), twice.sin());
    }
}

#[derive(Clone, Copy)]
struct Inside<R>(Pendulums<R>);

impl<R: Real> System<R> for Inside<R> {
    type State = [R; 8];

    fn rhs(&self, t: R, z: &[R; 8], dz: &mut [R; 8]) {
        let [_, _, v, w, cos_a, sin_a, cos_twice, sin_twice] = *z;
        let [da, db, dv, dw] = self.0.derivative(t, [v, w], sin_a, sin_twice);
        let turn = R::from_f64(2.0) * (da - db);
        *dz = [da, db, dv, dw, -(sin_a * da), cos_a * da, -(sin_twice * turn), cos_twice * turn];
    }
}

impl<R: Real> Circles<R> for Pendulums<R> {
    type Inside = Inside<R>;

    fn inside(&self) -> Inside<R> {
        Inside(*self)
    }

    fn on_circles(&self, y: &[R; 4]) -> [R; 8] {
        let [a, b, v, w] = *y;
        let ((sin_a, cos_a), (sine, cosine)) = (a.sin_cos(), (R::from_f64(2.0) * (a - b)).sin_cos());
        [a, b, v, w, cos_a, sin_a, cosine, sine]
    }
}

/// The energy of both, without the drive.
impl Invariants<f64, 1> for Pendulums<f64> {
    fn values(&self, _t: f64, y: &[f64; 4]) -> [f64; 1] {
        let [a, b, v, w] = *y;
        [0.5 * (v * v + w * w) - a.cos() - 0.5 * self.k * (2.0 * (a - b)).cos()]
    }

    fn gradients(&self, _t: f64, y: &[f64; 4], gradients: &mut [[f64; 4]; 1]) {
        let [a, b, v, w] = *y;
        let torque = self.k * (2.0 * (a - b)).sin();
        gradients[0] = [a.sin() + torque, -torque, v, w];
    }
}

const SYSTEM: Pendulums<f64> = Pendulums { k: 0.4, drive: 0.3 };
/// The first turns over and over.
const START: [f64; 4] = [0.3, -0.2, 3.5, 0.4];
const T_END: f64 = 40.0;

fn end<M: Method<f64, Pendulums<f64>>>(method: M, options: Options<f64>, t_end: f64) -> [f64; 4] {
    let mut solver = Integrator::new(&SYSTEM, method, 0.0, START, options).unwrap();
    solver.integrate_to(t_end).unwrap();
    *solver.state()
}

fn reference(t_end: f64) -> [f64; 4] {
    end(Vern9, Options::adaptive(3e-15, 3e-15), t_end)
}

fn distance<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_motion_is_the_same_and_turns_are_counted() {
    let exact = reference(T_END);
    assert!(exact[0] > 10.0 * std::f64::consts::TAU, "the pendulum turns over: {exact:?}");
    let found = end(OnCircles::new(Vern9), Options::adaptive(1e-14, 1e-14), T_END);
    // The motion multiplies an error by some hundreds on the way: rounding of an angle of 100 is 1e-14.
    assert!(distance(&found, &exact) < 3e-11, "{:e}", distance(&found, &exact));
}

#[test]
fn the_error_is_that_of_the_tolerance() {
    let exact = reference(10.0);
    for exponent in 4..=13 {
        let tolerance = 10.0_f64.powi(-exponent);
        let options = Options::adaptive(tolerance, tolerance);
        let errors = [end(Vern9, options, 10.0), end(OnCircles::new(Vern9), options, 10.0)];
        let [number, circle] = errors.map(|end| distance(&end, &exact));
        // As for numbers but for luck: the truncation error has other coefficients.
        assert!(circle < 10.0 * number.max(tolerance), "{tolerance:e}: {number:e} and {circle:e}");
    }
}

/// `error(step) / error(step / 2)`, as a power of two.
fn order<M: Method<f64, Pendulums<f64>> + Copy>(method: M, step: f64) -> f64 {
    let exact = reference(4.0);
    let [coarse, fine] =
        [step, 0.5 * step].map(|step| distance(&end(method, Options::fixed(step), 4.0), &exact));
    (coarse / fine).log2()
}

#[test]
fn the_order_of_methods_is_kept() {
    let orders = [
        (order(OnCircles::new(Rk4), 0.01), 4.0),
        (order(OnCircles::new(Tsit5), 0.05), 5.0),
        (order(OnCircles::new(Dopri5), 0.05), 5.0),
        (order(OnCircles::new(Dop853), 0.1), 8.0),
        (order(OnCircles::new(Vern9), 0.25), 9.0),
    ];
    for (found, due) in orders {
        assert!(found > due - 0.5 && found < due + 2.0, "{orders:?}");
    }
}

/// The derivative at an accepted state, and what a step starts from, are the system's own, so that nothing accumulates
/// that the angles do not have.
#[test]
fn every_step_starts_from_the_points_of_its_angles() {
    let options = Options::adaptive(1e-9, 1e-9);
    let mut solver = Integrator::new(&SYSTEM, OnCircles::new(Vern9), 0.0, START, options).unwrap();
    for _ in 0..20 {
        let _ = solver.step_towards(T_END).unwrap();
        let mut again = Integrator::new(
            &SYSTEM,
            OnCircles::new(Vern9),
            solver.t(),
            *solver.state(),
            Options::fixed(0.05),
        )
        .unwrap();
        let _ = again.step_towards(T_END).unwrap();
        assert_eq!(again.stats().rhs_evals, 1 + 1 + 16, "only the first step has to find its points");
    }
    let stats = solver.stats();
    // The derivative at the start, a guess of the first step, the first points.
    assert_eq!(stats.rhs_evals, 3 + 16 * (stats.steps + stats.rejected));
}

#[test]
fn states_and_events_within_steps_are_those_of_the_angles() {
    let times: Vec<f64> = (1..40).map(|k| 0.23 * f64::from(k)).collect();
    let visit = |circles: bool| {
        let (mut samples, mut events) = (Vec::new(), Vec::new());
        let options = Options::adaptive(1e-13, 1e-13);
        let output = |_: f64, y: &[f64; 4]| samples.push(*y);
        // The pendulum is upright or hangs, again and again.
        let functions = |_: f64, y: &[f64; 4]| [y[0].sin()];
        let on_event = |event: hamel_runtime::Event<'_, f64, [f64; 4]>| {
            events.push(event.t);
            if events.len() == 9 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let (t, progress) = if circles {
            let method = OnCircles::new(Vern9);
            let mut solver = Integrator::new(&SYSTEM, method, 0.0, START, options).unwrap();
            let progress = solver
                .sample_with_events(20.0, times.clone(), output, [Direction::Either], functions, on_event)
                .unwrap();
            // It goes on from the event.
            solver.integrate_to(20.0).unwrap();
            (*solver.state(), progress)
        } else {
            let mut solver = Integrator::new(&SYSTEM, Vern9, 0.0, START, options).unwrap();
            let progress = solver
                .sample_with_events(20.0, times.clone(), output, [Direction::Either], functions, on_event)
                .unwrap();
            solver.integrate_to(20.0).unwrap();
            (*solver.state(), progress)
        };
        assert_eq!(progress, Progress::Running);
        (t, samples, events)
    };
    let ((number, samples, events), (circle, samples_on_circle, events_on_circle)) =
        (visit(false), visit(true));
    assert_eq!((events.len(), samples.len()), (9, samples_on_circle.len()));
    assert!(samples.len() > 10);
    for (a, b) in events.iter().zip(&events_on_circle) {
        assert!((a - b).abs() < 1e-11, "{a} and {b}");
    }
    for (a, b) in samples.iter().zip(&samples_on_circle) {
        assert!(distance(a, b) < 1e-10, "{a:?} and {b:?}");
    }
    assert!(distance(&number, &circle) < 1e-9, "{number:?} and {circle:?}");
}

#[test]
fn invariants_are_kept_on_circles() {
    let system = Pendulums { k: 0.4, drive: 0.0 };
    let method = Projected::<_, 1>::new(OnCircles::new(Dopri5));
    let mut solver = Integrator::new(&system, method, 0.0, START, Options::adaptive(1e-6, 1e-6)).unwrap();
    let [level] = system.values(0.0, &START);
    for _ in 0..100 {
        let _ = solver.step_towards(1e3).unwrap();
        let [energy] = system.values(0.0, solver.state());
        assert!((energy - level).abs() < 4e-15 * level.abs().max(1.0), "{energy} and {level}");
    }
}

#[cfg(feature = "lanes")]
mod lanes {
    use hamel_runtime::{
        Circles, F64x4, F64x8, Gauss16, Gbs14, Integrator, OnCircles, Options, OverScalar, Real, Vern9,
    };

    use super::{Inside, Pendulums, START, SYSTEM, distance, end, reference};

    impl<Q: Real, R: Real> OverScalar<Q, R> for Pendulums<R> {
        type Over = Pendulums<Q>;

        fn over(&self, convert: impl Fn(R) -> Q) -> Pendulums<Q> {
            Pendulums { k: convert(self.k), drive: convert(self.drive) }
        }

        fn state_over(state: &[R; 4], convert: impl Fn(R) -> Q) -> [Q; 4] {
            state.map(convert)
        }
    }

    impl<Q: Real, R: Real> OverScalar<Q, R> for Inside<R> {
        type Over = Inside<Q>;

        fn over(&self, convert: impl Fn(R) -> Q) -> Inside<Q> {
            Inside(self.0.over(convert))
        }

        fn state_over(state: &[R; 8], convert: impl Fn(R) -> Q) -> [Q; 8] {
            state.map(convert)
        }
    }

    #[test]
    fn extrapolation_has_the_same_motion() {
        let exact = reference(10.0);
        for exponent in 4..=13 {
            let tolerance = 10.0_f64.powi(-exponent);
            let options = Options::adaptive(tolerance, tolerance);
            let errors = [end(Gbs14, options, 10.0), end(OnCircles::new(Gbs14), options, 10.0)];
            let [number, circle] = errors.map(|end| distance(&end, &exact));
            // As for numbers but for luck: the truncation error has other coefficients.
            assert!(circle < 10.0 * number.max(tolerance), "{tolerance:e}: {number:e} and {circle:e}");
        }
    }

    /// States within a step are steps of their own, and leave what the next step starts from.
    #[test]
    fn states_within_a_step_leave_the_next_one_alone() {
        let options = Options::adaptive(1e-12, 1e-12);
        let mut plain = Integrator::new(&SYSTEM, OnCircles::new(Gbs14), 0.0, START, options).unwrap();
        let mut asked = Integrator::new(&SYSTEM, OnCircles::new(Gbs14), 0.0, START, options).unwrap();
        let mut found = START;
        for _ in 0..8 {
            let _ = (plain.step_towards(10.0).unwrap(), asked.step_towards(10.0).unwrap());
            assert_eq!(plain.state(), asked.state());
            let middle = 0.5 * (asked.previous_t() + asked.t());
            asked.interpolate(middle, &mut found).unwrap();
            assert!(distance(&found, &reference(middle)) < 1e-10);
        }
        assert_eq!(asked.stats().rhs_evals, plain.stats().rhs_evals + 8 * 13);
    }

    #[test]
    fn implicit_stages_are_on_circles_too() {
        let exact = reference(4.0);
        let found = end(OnCircles::new(Gauss16), Options::fixed(0.1), 4.0);
        assert!(distance(&found, &exact) < 1e-12, "{:e}", distance(&found, &exact));
    }

    #[test]
    fn every_lane_has_the_bits_of_a_scalar() {
        fn run<R: Real>(drive: R, convert: impl Fn(f64) -> R + Copy) -> [R; 4]
        where
            Pendulums<R>: Circles<R, State = [R; 4], Inside = Inside<R>>,
        {
            let system = Pendulums { k: convert(0.4), drive };
            let options = Options::fixed(convert(0.11));
            let mut solver =
                Integrator::new(&system, OnCircles::new(Vern9), convert(0.0), START.map(convert), options)
                    .unwrap();
            solver.integrate_to(convert(3.0)).unwrap();
            *solver.state()
        }
        let drives: [f64; 8] = std::array::from_fn(|k| 0.1 * k as f64);
        let eight = run(F64x8::new(drives), F64x8::splat);
        let four = run(F64x4::new([drives[0], drives[1], drives[2], drives[3]]), F64x4::splat);
        for (k, drive) in drives.into_iter().enumerate() {
            let one = run(drive, |x| x);
            assert_eq!(eight.map(|x| x.lane(k)), one);
            if k < 4 {
                assert_eq!(four.map(|x| x.lane(k)), one);
            }
        }
    }
}
