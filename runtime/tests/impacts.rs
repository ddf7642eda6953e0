//! Events that change the state: times of impacts against closed forms, what follows them, and where they accumulate.

use std::ops::ControlFlow;

use hamel_runtime::{
    Action, Direction, Dop853, Dopri5, Error, Events, Failure, Gauss4, Gauss8, Integrator, Invariants, Jet,
    Method, Observer, Options, Progress, Projected, Rk4, System, Taylor, Tsit5, Vern9,
};

const G: f64 = 9.81;

/// A ball above the ground, of which an impact keeps a part of the speed: height and speed.
#[derive(Clone, Copy)]
struct Ball {
    restitution: f64,
}

impl System<f64> for Ball {
    type State = [f64; 2];
    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [y[1], -G];
    }
}

impl Jet<f64> for Ball {
    type Workspace = ();
    fn workspace(&self) {}
    fn series(&self, _t: f64, y: &[f64; 2], (): &mut (), out: &mut [[f64; 2]]) {
        out.fill([0.0; 2]);
        for (out, c) in out.iter_mut().zip([*y, [y[1], -G], [-0.5 * G, 0.0]]) {
            *out = c;
        }
    }
}

impl Events<f64, 1> for Ball {
    const DIRECTIONS: [Direction; 1] = [Direction::Falling];
    fn event_values(&self, _t: f64, y: &[f64; 2]) -> [f64; 1] {
        [y[0]]
    }
    fn event_apply(&self, _index: usize, _t: f64, y: &mut [f64; 2]) -> Action {
        y[1] *= -self.restitution;
        Action::Restart
    }
}

/// Times of the impacts of a ball that starts upwards from the ground with the speed `G`.
fn impacts<M: Method<f64, Ball>>(method: M, options: Options<f64>, ball: Ball, n: usize) -> Vec<f64> {
    let mut solver = Integrator::new(&ball, method, 0.0, [0.0, G], options).unwrap();
    let mut times = vec![];
    let progress = solver.integrate_through_events(1e3, |event| {
        times.push(event.t);
        if times.len() == n { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(progress, Ok(Progress::Running), "{}", M::TABLEAU.name);
    times
}

#[test]
fn a_ball_bounces_at_the_times_of_its_closed_form() {
    fn check<M: Method<f64, Ball>>(method: M, options: Options<f64>, tolerance: f64) {
        for restitution in [1.0, 0.9, 0.5, 0.05] {
            // Without loss, what rounding does to a speed is multiplied by the number of flights that follow.
            let n = if restitution == 1.0 || restitution < 0.5 { 5 } else { 20 };
            let (mut expected, mut flight) = (0.0, 2.0);
            for (k, t) in impacts(method, options, Ball { restitution }, n).into_iter().enumerate() {
                expected += flight;
                flight *= restitution;
                let name = M::TABLEAU.name;
                assert!(
                    (t - expected).abs() < tolerance,
                    "{name} {restitution}: impact {k} at {t}, not {expected}"
                );
            }
        }
    }
    check(Vern9, Options::adaptive(1e-13, 1e-13), 1e-12);
    // Their steps may end hundreds of metres below the ground; an impact is found to rounding of that.
    check(Dop853, Options::adaptive(1e-10, 1e-10), 1e-11);
    check(Tsit5, Options::adaptive(1e-8, 1e-8), 1e-11);
    check(Dopri5, Options::adaptive(1e-8, 1e-8), 1e-11);
    check(Taylor::of_order(8), Options::adaptive(1e-12, 1e-12), 1e-10);
    check(Rk4, Options::fixed(0.01), 1e-12);
    check(Gauss4::fixed_point(), Options::fixed(0.02), 1e-12);
    // Steps that are longer than the flights, which start on the ground and end below it.
    check(Rk4, Options::fixed(3.0), 1e-12);
    check(Gauss8::fixed_point(), Options::fixed(5.0), 1e-12);
    check(Vern9, Options::fixed(7.0), 1e-11);
    check(Taylor::of_order(4), Options::fixed(100.0), 1e-10);
}

#[test]
fn impacts_that_accumulate_are_an_error() {
    for (restitution, limit) in [(0.5, 4.0), (0.9, 20.0), (0.05, 2.0 / 0.95)] {
        let ball = Ball { restitution };
        for options in [Options::adaptive(1e-12, 1e-12), Options::fixed(0.5)] {
            let mut solver = Integrator::new(&ball, Vern9, 0.0, [0.0, G], options).unwrap();
            let mut n = 0;
            let error = solver.integrate_through_events(1e3, |_| {
                n += 1;
                ControlFlow::Continue(())
            });
            let Err(Error::EventsAccumulate { t, index: 0 }) = error else {
                panic!("{restitution}: {error:?}")
            };
            // The flights that are left when one is a few thousand roundings long.
            let rest = 2e-12 * limit / (1.0 - restitution);
            assert!((t - limit).abs() < rest, "{restitution}: {t} instead of {limit} after {n}");
        }
    }
    let options = Options::adaptive(1e-9, 1e-9).with_max_events(5);
    let ball = Ball { restitution: 0.9 };
    let mut solver = Integrator::new(&ball, Vern9, 0.0, [0.0, G], options).unwrap();
    let error = solver.integrate_through_events(1e3, |_| ControlFlow::Continue(()));
    assert!(matches!(error, Err(Error::TooManyEvents { limit: 5, .. })), "{error:?}");
}

/// A ball on a floor that moves, in a field that drifts: of its last flights rounding hides the height.
#[derive(Clone, Copy, Debug)]
struct Moving {
    restitution: f64,
    frequency: f64,
    amplitude: f64,
}

impl System<f64> for Moving {
    type State = [f64; 4];
    fn rhs(&self, _t: f64, y: &[f64; 4], dy: &mut [f64; 4]) {
        *dy = [y[2], y[3], -0.3 * y[1], -G - 0.3 * y[0]];
    }
}

impl Events<f64, 2> for Moving {
    const DIRECTIONS: [Direction; 2] = [Direction::Falling, Direction::Rising];
    fn event_values(&self, t: f64, y: &[f64; 4]) -> [f64; 2] {
        [y[1] - self.amplitude * (self.frequency * t).sin(), (7.0 * t).sin() - 0.3 * self.restitution]
    }
    fn event_apply(&self, index: usize, t: f64, y: &mut [f64; 4]) -> Action {
        if index == 0 {
            let floor = self.amplitude * self.frequency * (self.frequency * t).cos();
            y[3] = floor - self.restitution * (y[3] - floor);
            y[0] += 0.1 * self.restitution;
        } else {
            y[2] += 0.01 * self.frequency;
        }
        Action::Restart
    }
}

#[test]
fn impacts_that_rounding_hides_let_nothing_through() {
    fn check<M: Method<f64, Moving>>(method: M, step: f64, moving: Moving) {
        let options = Options::fixed(step);
        let mut solver = Integrator::new(&moving, method, 0.0, [0.0, 0.0, 0.8, -0.5], options).unwrap();
        let end = solver.integrate_through_events(1.4, |_| ControlFlow::Continue(()));
        let name = M::TABLEAU.name;
        assert!(matches!(end, Err(Error::EventsAccumulate { index: 0, .. })), "{name} {moving:?}: {end:?}");
    }
    for (restitution, frequency, amplitude) in [
        (0.5486000000000019, 4.404999999999987, 0.029800000000000184),
        (0.6674, 1.8950000000000014, 0.1582000000000001),
        (0.7177999999999992, 1.8150000000000013, 0.18539999999999993),
        (0.8527999999999963, 1.6900000000000261, 0.04039999999999964),
    ] {
        check(Gauss4::fixed_point(), 0.05, Moving { restitution, frequency, amplitude });
    }
    for (restitution, frequency, amplitude) in [
        (0.46940000000000737, 2.7450000000000188, 0.14420000000000074),
        (0.8527999999999963, 1.6900000000000261, 0.04039999999999964),
        (0.7988000000000007, 1.2400000000000002, 0.11839999999999976),
        (0.841999999999996, 2.6000000000000014, 0.05600000000000023),
    ] {
        check(Vern9, 0.1, Moving { restitution, frequency, amplitude });
    }
}

/// A ball in a corner: two walls and a switch, all within one step.
struct Corner;

impl System<f64> for Corner {
    type State = [f64; 4];
    fn rhs(&self, _t: f64, y: &[f64; 4], dy: &mut [f64; 4]) {
        *dy = [y[2], y[3], 0.0, 0.0];
    }
}

impl Events<f64, 4> for Corner {
    const DIRECTIONS: [Direction; 4] =
        [Direction::Falling, Direction::Falling, Direction::Rising, Direction::Rising];
    fn event_values(&self, _t: f64, y: &[f64; 4]) -> [f64; 4] {
        [y[0], y[1], y[0] - 1.0, y[1] - 1.0]
    }
    fn event_apply(&self, index: usize, _t: f64, y: &mut [f64; 4]) -> Action {
        y[2 + index % 2] *= -1.0;
        Action::Restart
    }
}

#[test]
fn events_at_one_time_are_all_carried_out() {
    // Along the diagonal: both walls at once, every second.
    let mut solver = Integrator::new(&Corner, Rk4, 0.0, [0.5, 0.5, 1.0, 1.0], Options::fixed(0.7)).unwrap();
    let mut told = vec![];
    let progress = solver.integrate_through_events(4.0, |event| {
        told.push((event.index, (2.0 * event.t).round()));
        ControlFlow::Continue(())
    });
    assert_eq!(progress, Ok(Progress::Reached));
    assert_eq!(told, [(2, 1.0), (3, 1.0), (0, 3.0), (1, 3.0), (2, 5.0), (3, 5.0), (0, 7.0), (1, 7.0)]);
    for (y, expected) in solver.state().iter().zip([0.5, 0.5, 1.0, 1.0]) {
        assert!((y - expected).abs() < 1e-14, "{:?}", solver.state());
    }
}

/// `y' = (cos t, s)` with a state `s` that is switched where `y_0` passes zero, upwards or downwards.
struct Switch;

impl System<f64> for Switch {
    type State = [f64; 3];
    fn rhs(&self, t: f64, y: &[f64; 3], dy: &mut [f64; 3]) {
        *dy = [-t.sin(), y[2], 0.0];
    }
}

impl Events<f64, 1> for Switch {
    const DIRECTIONS: [Direction; 1] = [Direction::Either];
    fn event_values(&self, _t: f64, y: &[f64; 3]) -> [f64; 1] {
        [y[0]]
    }
    fn event_apply(&self, _index: usize, _t: f64, y: &mut [f64; 3]) -> Action {
        y[2] = -y[2];
        Action::Restart
    }
}

/// The ball of the wall that tells both directions.
struct Elastic;

impl System<f64> for Elastic {
    type State = [f64; 2];
    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [y[1], -G];
    }
}

impl Events<f64, 1> for Elastic {
    const DIRECTIONS: [Direction; 1] = [Direction::Either];
    fn event_values(&self, _t: f64, y: &[f64; 2]) -> [f64; 1] {
        [y[0]]
    }
    fn event_apply(&self, _index: usize, _t: f64, y: &mut [f64; 2]) -> Action {
        y[1] = -y[1];
        Action::Restart
    }
}

#[test]
fn an_impact_is_one_event_whatever_its_direction() {
    for options in [Options::adaptive(1e-12, 1e-12), Options::fixed(0.1), Options::fixed(5.0)] {
        let mut solver = Integrator::new(&Elastic, Vern9, 0.0, [0.0, G], options).unwrap();
        let mut n = 0;
        let progress = solver.integrate_through_events(2001.0, |event| {
            n += 1;
            // Every impact is found on a step that ends far below the wall, to rounding of that; the times add it up
            // twice.
            assert!((event.t - 2.0 * f64::from(n)).abs() < 1e-13 * f64::from(n * n + 10), "{n}: {}", event.t);
            ControlFlow::Continue(())
        });
        assert_eq!((progress, n), (Ok(Progress::Reached), 1000));
    }
}

#[test]
fn an_event_does_not_fire_again_at_its_own_zero() {
    use std::f64::consts::PI;
    for end in [20.0, -20.0] {
        for options in [Options::adaptive(1e-12, 1e-12), Options::fixed(0.1)] {
            let mut solver = Integrator::new(&Switch, Vern9, 0.0, [1.0, 0.0, 1.0], options).unwrap();
            let mut times = vec![];
            let progress = solver.integrate_through_events(end, |event| {
                times.push(event.t);
                ControlFlow::Continue(())
            });
            assert_eq!((progress, times.len()), (Ok(Progress::Reached), 6));
            for (k, t) in times.iter().enumerate() {
                assert!((t.abs() - (k as f64 + 0.5) * PI).abs() < 1e-11, "{times:?}");
            }
            // The triangle wave of slope one.
            let expected = 20.0 - 5.5 * PI - 0.5 * PI;
            assert!((solver.state()[1].abs() - expected.abs()).abs() < 1e-9, "{:?}", solver.state());
        }
    }
}

/// Stops the second time, with a changed state, and notes what it is told.
#[derive(Default)]
struct Notes {
    samples: Vec<(f64, f64)>,
    steps: usize,
    n: usize,
}

impl Observer<f64, [f64; 2], 1> for Notes {
    fn sample(&mut self, t: f64, y: &[f64; 2]) {
        self.samples.push((t, y[1]));
    }
    fn step(&mut self, _t: f64, _y: &[f64; 2]) -> ControlFlow<()> {
        self.steps += 1;
        ControlFlow::Continue(())
    }
    fn values(&mut self, _t: f64, y: &[f64; 2]) -> [f64; 1] {
        [y[0]]
    }
    fn event(&mut self, _index: usize, _t: f64, y: &mut [f64; 2]) -> Action {
        self.n += 1;
        if self.n == 2 {
            *y = [7.0, 8.0];
            Action::ChangeAndStop
        } else {
            *y = [0.0, G];
            Action::Restart
        }
    }
}

#[test]
fn samples_stand_beside_events_and_a_changed_state_may_be_the_last() {
    let ball = Ball { restitution: 1.0 };
    let mut solver = Integrator::new(&ball, Vern9, 0.0, [0.0, G], Options::adaptive(1e-12, 1e-12)).unwrap();
    let mut notes = Notes::default();
    let progress = solver.observe(9.0, [0.0, 1.0, 2.5, 3.0, 3.5, 8.0], [Direction::Falling], &mut notes);
    assert_eq!(progress, Ok(Progress::Running));
    assert!((solver.t() - 4.0).abs() < 1e-14);
    assert_eq!(solver.state(), &[7.0, 8.0]);
    let expected = [(0.0, G), (1.0, 0.0), (2.5, 0.5 * G), (3.0, 0.0), (3.5, -0.5 * G)];
    assert_eq!(notes.samples.len(), expected.len());
    for (found, expected) in notes.samples.iter().zip(expected) {
        assert!(found.0 == expected.0 && (found.1 - expected.1).abs() < 1e-11, "{found:?}");
    }
    assert!(notes.steps > 0);
    // And on from there, without dense output of the step that is gone.
    assert!(matches!(solver.interpolate(3.9, &mut [0.0; 2]), Err(Error::NoDenseOutput { .. })));
    solver.integrate_to(5.0).unwrap();
    assert!((solver.state()[1] - (8.0 - G)).abs() < 1e-12);
}

/// An oscillator that is kicked to twice its energy.
struct Kicked;

impl System<f64> for Kicked {
    type State = [f64; 2];
    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [y[1], -y[0]];
    }
    fn domain(&self, t: f64, y: &[f64; 2]) -> Result<(), Failure> {
        let inside = y[0].abs() < 100.0;
        if inside { Ok(()) } else { Err(Failure::OutsideDomain { t, condition: "|y| < 100" }) }
    }
}

impl Invariants<f64, 1> for Kicked {
    fn values(&self, _t: f64, y: &[f64; 2]) -> [f64; 1] {
        [0.5 * (y[0] * y[0] + y[1] * y[1])]
    }
    fn gradients(&self, _t: f64, y: &[f64; 2], gradients: &mut [[f64; 2]; 1]) {
        gradients[0] = *y;
    }
}

struct Kick(f64);

impl Observer<f64, [f64; 2], 1> for Kick {
    fn values(&mut self, t: f64, _y: &[f64; 2]) -> [f64; 1] {
        [t - 10.0]
    }
    fn event(&mut self, _index: usize, _t: f64, y: &mut [f64; 2]) -> Action {
        y.iter_mut().for_each(|y| *y *= self.0);
        Action::Restart
    }
}

#[test]
fn a_projection_keeps_the_level_of_the_state_after_the_event() {
    let method = Projected::<_, 1>::new(Dop853);
    let mut solver =
        Integrator::new(&Kicked, method, 0.0, [1.0, 0.0], Options::adaptive(1e-6, 1e-6)).unwrap();
    let reached = solver.observe(100.0, [], [Direction::Rising], &mut Kick(2.0));
    assert_eq!(reached, Ok(Progress::Reached));
    let [energy] = Kicked.values(0.0, solver.state());
    assert!((energy - 2.0).abs() < 1e-5, "{energy}");
    // Kept to rounding from the kick on.
    solver.integrate_to(200.0).unwrap();
    assert!((Kicked.values(0.0, solver.state())[0] - energy).abs() < 1e-14);
}

#[test]
fn a_state_outside_of_the_domain_is_refused() {
    let mut solver =
        Integrator::new(&Kicked, Dop853, 0.0, [1.0, 0.0], Options::adaptive(1e-9, 1e-9)).unwrap();
    let error = solver.observe(100.0, [], [Direction::Rising], &mut Kick(1000.0));
    let expected = Failure::OutsideDomain { t: 10.0, condition: "|y| < 100" };
    assert_eq!(error, Err(expected.into()));
    let error = solver.observe(100.0, [], [Direction::Rising], &mut Kick(f64::NAN));
    assert_eq!(error, Ok(Progress::Reached), "the time of the kick is over");
    let mut solver =
        Integrator::new(&Kicked, Dop853, 0.0, [1.0, 0.0], Options::adaptive(1e-9, 1e-9)).unwrap();
    let error = solver.observe(100.0, [], [Direction::Rising], &mut Kick(f64::NAN));
    assert_eq!(error, Err(Failure::NonFinite { t: 10.0, index: 0 }.into()));
}

/// Both times at which a ball passes a height, in steps that are as long as the flight: of every kind of dense output.
#[test]
fn a_function_that_changes_its_sign_twice_within_a_step_is_seen() {
    fn passes<M: Method<f64, Ball>>(method: M, options: Options<f64>) {
        let ball = Ball { restitution: 1.0 };
        let (height, speed) = (0.3 * G, G);
        let root = (speed * speed - 2.0 * G * height).sqrt();
        let expected = [(speed - root) / G, (speed + root) / G];
        let mut solver = Integrator::new(&ball, method, 0.0, [0.0, speed], options).unwrap();
        let mut times = Vec::new();
        let directions = [Direction::Either, Direction::Falling];
        let told = solver.integrate_with_events(
            2.1,
            directions,
            |_, y| [y[0] - height, y[0] - height],
            |event| {
                times.push((event.index, event.t));
                ControlFlow::Continue(())
            },
        );
        let name = M::TABLEAU.name;
        assert_eq!(told, Ok(Progress::Reached), "{name}");
        assert_eq!(times.iter().map(|(index, _)| *index).collect::<Vec<_>>(), [0, 0, 1], "{name}");
        for ((_, t), expected) in times.iter().zip([expected[0], expected[1], expected[1]]) {
            assert!((t - expected).abs() < 1e-12, "{name}: {t} instead of {expected}");
        }
        assert_eq!(solver.stats().steps, 1, "{name}");
    }
    passes(Vern9, Options::fixed(2.1));
    passes(Dop853, Options::fixed(2.1));
    passes(Gauss4::fixed_point(), Options::fixed(2.1));
    passes(Taylor::new(), Options::fixed(2.1));
}
