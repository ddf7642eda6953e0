//! States that are moved on by the same length of time again and again, in the same storage: for loops of somebody
//! else, who reads the states and gives inputs between.
//!
//! Does not know: where states are kept, threads, what an input is for.

use std::ops::ControlFlow;

use hamel_ensemble::Lanes;
use hamel_runtime::{AtRest, Error as SolverError, F64x4, F64x8, Integrator, Method, Options, System};

use super::any_method::{AnyMethod, Chosen, SideBySide};
use super::auto::Purpose;
use super::dynamics::{BadParams, Factory, PreparedLanes, PreparedScene, Several, VecState};
use super::evaluate::{prepare, refused, why_stopped};
use super::integrate::has_state;
use super::lost_rank::{Held, Rank};
use super::method::{MethodName, Steps};
use super::solver::method_of;
use crate::error::Error;

/// What moves states of a scene on by a length of time.
pub struct Stepper<'a> {
    factory: &'a dyn Factory,
    params: Vec<f64>,
    method: AnyMethod<'a>,
    options: Options<f64>,
    dt: f64,
    /// Whether constraints may lose their rank on the way.
    is_held: bool,
}

/// How states are moved on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pace {
    /// By how much; negative for motions backward.
    pub dt: f64,
    /// The method.
    pub method: MethodName,
    /// How it chooses steps on the way; adaptive ones try the whole way first.
    pub steps: Steps,
    /// Largest number of steps of one way, unless it is that of the steps.
    pub max_steps: Option<u64>,
}

/// What one thread moves states in.
#[derive(Default)]
pub struct Room<'a> {
    eight: LanesRoom<'a, F64x8>,
    four: LanesRoom<'a, F64x4>,
    one: Storage<f64, PreparedScene<'a>, Chosen<'a, AnyMethod<'a>>>,
}

/// A method on lanes.
type OnLanes<'a, L> = Chosen<'a, SideBySide<'a, L>>;

/// The same for states side by side.
struct LanesRoom<'a, L: Several> {
    storage: Storage<L, PreparedLanes<'a, L>, OnLanes<'a, L>>,
    state: Vec<L>,
    inputs: Vec<L>,
}

impl<L: Several> Default for LanesRoom<'_, L> {
    fn default() -> Self {
        LanesRoom { storage: Storage::default(), state: Vec::new(), inputs: Vec::new() }
    }
}

/// The most states side by side.
const WIDTH: usize = F64x8::LANES;

/// Rows of numbers, as many as there are, on lanes: a lane beyond the last row repeats it.
fn gather<L: Several>((rows, n_rows): (&[f64], usize), lanes: &mut Vec<L>) {
    let n = rows.len() / n_rows;
    lanes.clear();
    lanes.extend((0..n).map(|c| L::gather(|k| rows[k.min(n_rows - 1) * n + c])));
}

/// A system, and an integrator at rest.
struct Storage<R: Lanes, S: System<R>, M: Method<R, S>> {
    system: Option<S>,
    rest: Option<AtRest<R, S, M>>,
    /// Parameters and inputs, when the system is made.
    values: Vec<R>,
}

impl<R: Lanes, S: System<R>, M: Method<R, S>> Default for Storage<R, S, M> {
    fn default() -> Self {
        Storage { system: None, rest: None, values: Vec::new() }
    }
}

/// Why a state was not moved on.
enum Stop {
    Params(BadParams),
    Moving(f64, NotMoved),
}

/// Why an integration did not come to its end.
enum NotMoved {
    Solver(SolverError),
    LostRank(Error),
}

/// Takes an integrator to a time.
type Go<'g, R, S, M> = &'g mut dyn FnMut(&mut Integrator<'_, R, S, M>, R) -> Result<(), NotMoved>;

impl From<SolverError> for NotMoved {
    fn from(error: SolverError) -> Self {
        NotMoved::Solver(error)
    }
}

impl<'a> Stepper<'a> {
    /// For a scene with parameters, at any state.
    ///
    /// # Errors
    /// [`Error::NoState`], [`Error::Params`]; [`Error::Options`] for steps that the integrator does not take, and a
    /// method that does not suit the scene.
    pub fn new(factory: &'a dyn Factory, params: &[f64], pace: Pace) -> Result<Stepper<'a>, Error> {
        has_state(factory.info())?;
        let Pace { dt, method, steps, max_steps } = pace;
        if !dt.is_finite() || dt == 0.0 {
            return Err(Error::unusable("dt", format!("is {dt:?}: give a finite time other than zero")));
        }
        let options = steps.options(dt, max_steps.unwrap_or(steps.max_steps()))?;
        let options = options.with_initial_step(dt.abs());
        let invalid = |e: SolverError| Error::Options { reason: e.to_string() };
        options.validate().map_err(invalid)?;
        let dynamics = prepare(factory, params)?;
        let start = vec![0.0; factory.info().state.len()];
        let method = method_of(method, steps, Purpose::Ensemble, &*dynamics, &start)?;
        Method::<f64, PreparedScene<'a>>::validate(&method.of_scenes(), &options).map_err(invalid)?;
        let is_held = Rank::may_be_lost(&*dynamics, &start);
        Ok(Stepper { factory, params: params.to_vec(), method, options, dt, is_held })
    }

    /// Moves states on from a time, which are one after the other in `states`: eight at a time where the method has
    /// lanes, with common steps that keep the tolerances of each. The inputs are held at values, all of them for each
    /// state one after the other in `inputs`, or none are given. A state that cannot be moved stays where it is, and
    /// all others are moved.
    ///
    /// Threads may share states out if they take a multiple of eight each.
    ///
    /// # Errors
    /// As [`step`](Self::step), for the first state that is not moved, with its number.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn step_all(
        &self,
        room: &mut Room<'a>,
        t: f64,
        inputs: &[f64],
        states: &mut [f64],
    ) -> Result<(), (usize, Error)> {
        let n = self.factory.info().state.len();
        let n_held = inputs.len() / (states.len() / n).max(1);
        let mut stopped = Ok(());
        for (group, states) in states.chunks_mut(WIDTH * n).enumerate() {
            let (first, width) = (group * WIDTH, states.len() / n);
            let inputs = &inputs[first * n_held..(first + width) * n_held];
            if self.step_group(room, t, (inputs, width), states) {
                continue;
            }
            for (k, y) in states.chunks_mut(n).enumerate() {
                if let Err(error) = self.step(room, t, &inputs[k * n_held..(k + 1) * n_held], y) {
                    stopped = stopped.and(Err((first + k, error)));
                }
            }
        }
        stopped
    }

    /// Moves up to eight states on side by side; whether they have come, otherwise they are where they were.
    fn step_group(
        &self,
        room: &mut Room<'a>,
        t: f64,
        (inputs, width): (&[f64], usize),
        states: &mut [f64],
    ) -> bool {
        // Each is held to the rank of constraints on its way.
        if self.is_held {
            return false;
        }
        let (four, eight) = (self.method.of_lanes(), self.method.of_eight_lanes());
        match (four, eight) {
            // Lanes that repeat others have no say in the steps: these have the bits of eight.
            (Some(method), _) if width <= F64x4::LANES => {
                self.step_lanes((&mut room.four, method), t, (inputs, width), states)
            }
            (_, Some(method)) => self.step_lanes((&mut room.eight, method), t, (inputs, width), states),
            _ => false,
        }
    }

    /// The same on lanes, of which those beyond the last state repeat it.
    fn step_lanes<L: Several>(
        &self,
        (room, method): (&mut LanesRoom<'a, L>, OnLanes<'a, L>),
        t: f64,
        (inputs, width): (&[f64], usize),
        states: &mut [f64],
    ) -> bool {
        let LanesRoom { storage: Storage { system, rest, values }, state, inputs: held } = room;
        gather((states, width), state);
        gather((inputs, width), held);
        let holds = system.as_mut().is_some_and(|own| own.hold(held));
        if !holds {
            self.values(values, held);
            match L::prepare(self.factory, values) {
                Ok(made) => *system = Some(made),
                Err(_) => return false,
            }
        }
        // It is there, as has just been seen.
        let Some(system) = &*system else { return false };
        let mut to_end = |solver: &mut Integrator<'_, L, _, _>, end: L| Ok(solver.integrate_to(end)?);
        let has_come = self.advance(system, method, rest, (t, state), &mut to_end).is_ok();
        if has_come {
            for (k, y) in states.chunks_mut(state.len()).enumerate() {
                y.iter_mut().zip(&*state).for_each(|(y, lanes)| *y = lanes.lane(k));
            }
        }
        has_come
    }

    /// Moves one state on with steps of its own, as [`step_all`](Self::step_all) does.
    ///
    /// # Errors
    /// [`Error::Params`]; [`Error::Stopped`] with the time and the state from which it was not moved.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn step(&self, room: &mut Room<'a>, t: f64, inputs: &[f64], y: &mut [f64]) -> Result<(), Error> {
        let Storage { system, rest, values } = &mut room.one;
        let moved = match system.as_mut().is_some_and(|own| own.hold(inputs)) {
            true => Ok(()),
            false => {
                self.values(values, inputs);
                self.factory.prepare(values).map(|made| *system = Some(made)).map_err(Stop::Params)
            }
        };
        let info = self.factory.info();
        let moved = moved.and_then(|()| match &*system {
            Some(system) => {
                let method = self.method.of_scenes();
                self.advance(system, method, rest, (t, y), &mut |solver, end| {
                    if !self.is_held {
                        return Ok(solver.integrate_to(end)?);
                    }
                    let mut held = Held::new(
                        &**system,
                        (t, &solver.state().0),
                        |_, _: &VecState| {},
                        || ControlFlow::Continue(()),
                    );
                    let moved = solver.observe::<0>(end, [], [], &mut held);
                    held.kept().map_err(NotMoved::LostRank)?;
                    moved.map(|_| ()).map_err(NotMoved::Solver)
                })
            }
            // It is there, as has just been seen.
            None => Ok(()),
        });
        moved.map_err(|stop| match stop {
            Stop::Params(bad) => refused(info, &self.params, bad),
            Stop::Moving(_, NotMoved::LostRank(error)) => error,
            Stop::Moving(at, NotMoved::Solver(error)) => {
                let state = info.state.iter().cloned().zip(y.iter().copied()).collect();
                Error::Stopped { t: at, state, reason: why_stopped(info, &error) }
            }
        })
    }

    fn values<R: Lanes>(&self, values: &mut Vec<R>, inputs: &[R]) {
        values.clear();
        values.extend(self.params.iter().map(|x| R::from_f64(*x)));
        values.extend_from_slice(inputs);
    }

    /// Moves a state on by what `go` does with an integrator, and keeps the storage.
    fn advance<R, S, M>(
        &self,
        system: &S,
        method: M,
        rest: &mut Option<AtRest<R, S, M>>,
        (t, y): (f64, &mut [R]),
        go: Go<'_, R, S, M>,
    ) -> Result<(), Stop>
    where
        R: Lanes,
        S: System<R, State = VecState<R>>,
        M: Method<R, S>,
    {
        let (start, end) = (R::from_f64(t), R::from_f64(t + self.dt));
        let solver = match rest.take() {
            Some(rest) => rest.start(system, start, y),
            None => {
                let options = self.options.map(R::from_f64);
                Integrator::new(system, method, start, VecState(y.to_vec()), options)
            }
        };
        let mut solver = solver.map_err(|error| Stop::Moving(t, error.into()))?;
        let moved = go(&mut solver, end);
        let reached = solver.t().lane(0);
        if moved.is_ok() {
            y.copy_from_slice(&solver.state().0);
        }
        *rest = Some(solver.rest());
        moved.map_err(|error| Stop::Moving(reached, error))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::{Pace, Room, Stepper};
    use crate::cache::Cache;
    use crate::error::Error;
    use crate::interpreted::{self, Built};
    use crate::method::{MethodName, Steps};
    use crate::model::Checked;
    use crate::noise::Noise;
    use crate::session::Session;
    use crate::simulation::{MAX_EVENTS, SimulateRequest};

    const PUSHED: &str = "
        model pushed {
            param l = 2 where l > 0;
            input push = 0.3;
            coordinate theta in angle;
            coordinate x in (-100, 1);
            lagrangian = (x_dot^2 + l^2*theta_dot^2/2 + x_dot*theta_dot*cos(theta))/2 + l*cos(theta) - x^2/2;
            force x_dot = push;
        }
    ";

    fn scene(in_memory: bool) -> Built {
        let model = Session::of_shipped(&[]).parse("pushed", PUSHED).unwrap_or_else(|e| panic!("{e}"));
        let model = Arc::new(Checked::new(model, Cache::none()));
        let built = interpreted::build(&model, "controlled").unwrap_or_else(|e| panic!("{e}"));
        if in_memory { built.in_memory() } else { built }
    }

    fn pace(method: MethodName) -> Pace {
        let steps = match method.has_fixed_steps() {
            true => Steps::Fixed { step: 0.05 },
            false => Steps::Adaptive { rtol: 1e-9, atol: 1e-11, max: None },
        };
        Pace { dt: 0.1, method, steps, max_steps: None }
    }

    const START: [f64; 4] = [0.4, 0.2, 0.1, -0.3];

    /// The state after a motion with inputs that are held elsewhere.
    fn simulated(scene: &Built, method: MethodName, initial: &[f64], t_final: f64) -> Vec<f64> {
        let Pace { steps, .. } = pace(method);
        let request = SimulateRequest {
            params: vec![1.5],
            initial: initial.to_vec(),
            t_final,
            method,
            steps,
            samples: 0,
            with_outputs: false,
            n_group: 0,
            max_steps: 1_000_000,
            max_events: MAX_EVENTS,
            watched: None,
            noise: Noise::default(),
            along: Vec::new(),
            tangents: Vec::new(),
        };
        crate::integrate::simulate(scene, &request, &mut |_| {}).unwrap_or_else(|e| panic!("{e}")).last
    }

    #[test]
    fn a_step_of_a_method_with_fixed_steps_is_that_of_a_motion() {
        let scene = scene(true);
        for method in [MethodName::Rk4, MethodName::Gauss4, MethodName::Gauss16] {
            let stepper = Stepper::new(&scene, &[1.5], pace(method)).unwrap();
            let mut room = Room::default();
            let mut y = START;
            for _ in 0..3 {
                let end = simulated(&scene, method, &y, 0.1);
                stepper.step(&mut room, 0.0, &[], &mut y).unwrap();
                assert_eq!(y.as_slice(), end, "{}", method.name());
            }
        }
    }

    /// Lanes have the bits of single states, whoever evaluates, where steps are fixed; adaptive ones keep tolerances.
    #[test]
    fn lanes_are_moved_as_single_states_with_inputs_of_their_own() {
        /// A group of eight, and one that is not full.
        const N: usize = 13;
        let pushes = [0.3, -0.5, 0.0, 1.1];
        for (method, tolerance) in
            [(MethodName::Rk4, 0.0), (MethodName::Dop853, 1e-9), (MethodName::Gbs14, 1e-9)]
        {
            let mut ends = Vec::new();
            for in_memory in [false, true] {
                let scene = scene(in_memory);
                let stepper = Stepper::new(&scene, &[1.5], pace(method)).unwrap();
                let mut room = Room::default();
                let (mut all, mut single) = ([START; N].concat(), [START; N].concat());
                for k in 0..4 {
                    let pushes: Vec<f64> =
                        (0..N).map(|n| pushes[n % 4] * f64::from(k) + 0.01 * n as f64).collect();
                    let t = 0.1 * f64::from(k);
                    stepper.step_all(&mut room, t, &pushes, &mut all).unwrap();
                    for (y, push) in single.chunks_mut(4).zip(pushes) {
                        stepper.step(&mut room, t, &[push], y).unwrap();
                    }
                }
                for (own, lanes) in single.iter().zip(&all) {
                    let error = (own - lanes).abs();
                    assert!(error <= tolerance, "{}: {error:e}", method.name());
                }
                ends.push(all);
            }
            assert_eq!(ends[0], ends[1], "{}, interpreted and in memory", method.name());
        }
    }

    /// Four lanes are taken where there are no more states, and have the bits of eight.
    #[test]
    fn lanes_that_repeat_a_state_have_no_say() {
        let scene = scene(true);
        for method in [MethodName::Dop853, MethodName::Vern9, MethodName::Gbs14] {
            let stepper = Stepper::new(&scene, &[1.5], Pace { dt: 3.0, ..pace(method) }).unwrap();
            let mut room = Room::default();
            let row = |k: f64| [0.4 + 0.3 * k, 0.2, 0.1 * k, -0.3];
            let mut three = [row(0.0), row(1.0), row(2.0)].concat();
            let mut repeated = [row(0.0), row(1.0), row(2.0), row(2.0), row(2.0)].concat();
            stepper.step_all(&mut room, 0.0, &[], &mut three).unwrap();
            stepper.step_all(&mut room, 0.0, &[], &mut repeated).unwrap();
            assert_eq!(three, repeated[..three.len()], "{}", method.name());
        }
    }

    #[test]
    fn inputs_that_are_not_given_are_those_of_the_model() {
        let scene = scene(true);
        let stepper = Stepper::new(&scene, &[1.5], pace(MethodName::Dop853)).unwrap();
        let mut room = Room::default();
        let (mut own, mut held, mut other) = (START, START, START);
        stepper.step(&mut room, 0.0, &[], &mut own).unwrap();
        stepper.step(&mut room, 0.0, &[0.3], &mut held).unwrap();
        stepper.step(&mut room, 0.0, &[0.4], &mut other).unwrap();
        assert_eq!(own, held);
        assert_ne!(own, other);
    }

    #[test]
    fn a_state_that_cannot_be_moved_stays_where_it_is() {
        let scene = scene(true);
        let stepper = Stepper::new(&scene, &[1.5], pace(MethodName::Dop853)).unwrap();
        let mut room = Room::default();
        let beyond = [0.4, 0.99, 0.1, 3.0];
        let mut y = beyond;
        let stopped = stepper.step(&mut room, 0.0, &[0.3], &mut y);
        assert!(matches!(stopped, Err(Error::Stopped { .. })), "{stopped:?}");
        assert_eq!(y, beyond);
        let mut moved = START;
        stepper.step(&mut room, 0.0, &[0.3], &mut moved).unwrap();
        let mut all = [START, START, beyond, START, beyond].concat();
        let stopped = stepper.step_all(&mut room, 0.0, &[0.3; 5], &mut all);
        assert!(matches!(stopped, Err((2, Error::Stopped { .. }))), "{stopped:?}");
        assert_eq!(all, [moved, moved, beyond, moved, beyond].concat());
        // The storage is as good as before.
        let (mut after, mut fresh) = (START, START);
        stepper.step(&mut room, 0.0, &[0.3], &mut after).unwrap();
        stepper.step(&mut Room::default(), 0.0, &[0.3], &mut fresh).unwrap();
        assert_eq!(after, fresh);
    }

    /// Arms of a parallelogram that fold onto its base.
    #[test]
    fn a_step_past_a_loss_of_rank_is_refused() {
        let text = "model parallelogram {
            coordinate al in angle;
            coordinate be, ga in angle by
                0.3*[cos(al), sin(al)] + [cos(be), sin(be)] - 0.3*[cos(ga), sin(ga)] = [1, 0];
            lagrangian = al_dot^2/2 + be_dot^2/2 + ga_dot^2;
            multipliers;
        }";
        let model = Session::of_shipped(&[]).parse("parallelogram", text).unwrap_or_else(|e| panic!("{e}"));
        let model = Arc::new(Checked::new(model, Cache::none()));
        let scene = interpreted::build(&model, "default").unwrap_or_else(|e| panic!("{e}"));
        let stepper = Stepper::new(&scene, &[], Pace { dt: 1.5, ..pace(MethodName::Vern9) }).unwrap();
        let mut room = Room::default();
        let mut y = [1.0, 0.0, 1.0, 1.0, 0.0, 1.0];
        stepper.step(&mut room, 0.0, &[], &mut y).unwrap();
        assert!((y[0] - 2.5).abs() < 1e-9, "{y:?}");
        let before = y;
        let stopped = stepper.step(&mut room, 1.5, &[], &mut y).unwrap_err().to_string();
        assert!(stopped.contains("depend on each other"), "{stopped}");
        assert_eq!(y, before);
        // Not side by side, where nobody would see it.
        let stopped = stepper.step_all(&mut room, 1.5, &[], &mut y).map_err(|(_, error)| error.to_string());
        assert!(stopped.is_err_and(|text| text.contains("depend on each other")));
        assert_eq!(y, before);
    }

    #[test]
    fn what_no_state_can_have_is_told_at_once() {
        let scene = scene(true);
        let refused =
            |params: &[f64], pace: Pace| Stepper::new(&scene, params, pace).err().map(|e| e.to_string());
        let usual = pace(MethodName::Dop853);
        assert!(refused(&[1.5], usual).is_none());
        for dt in [0.0, f64::NAN, f64::INFINITY] {
            assert!(refused(&[1.5], Pace { dt, ..usual }).is_some_and(|text| text.contains("dt")), "{dt}");
        }
        assert!(refused(&[-1.0], usual).is_some_and(|text| text.contains("l > 0")));
        let steps = Steps::Adaptive { rtol: -1.0, atol: 1e-9, max: None };
        assert!(refused(&[1.5], Pace { steps, ..usual }).is_some());
    }
}
