//! States that are moved on by the same length of time again and again, in the same storage: for loops of somebody
//! else, who reads the states and gives inputs between.
//!
//! Does not know: where states are kept, threads, what an input is for.

use std::ops::ControlFlow;

use hamel_ensemble::Lanes;
use hamel_runtime::{AtRest, Error as SolverError, F64x4, Integrator, Method, Options, System};

use super::any_method::{AnyMethod, Chosen, SideBySide};
use super::auto::Purpose;
use super::dynamics::{BadParams, Factory, PreparedLanes, PreparedScene, VecState};
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
    lanes: Storage<F64x4, PreparedLanes<'a>, Chosen<'a, SideBySide<'a>>>,
    one: Storage<f64, PreparedScene<'a>, Chosen<'a, AnyMethod<'a>>>,
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

    /// Whether states are moved on four at a time: not where each is held to the rank of constraints on its way.
    pub fn has_lanes(&self) -> bool {
        self.method.of_lanes().is_some() && !self.is_held
    }

    /// Moves four states on from a time, with common steps that keep the tolerances of each; whether they have come.
    /// The inputs are held at values, all of them, or none are given. States that have not come stay where they are.
    ///
    /// # Panics
    /// When there are no lanes, or a size is wrong.
    pub fn step_lanes(&self, room: &mut Room<'a>, t: f64, inputs: &[F64x4], y: &mut [F64x4]) -> bool {
        let method = self.method.of_lanes().expect("a method that has lanes");
        let Storage { system, rest, values } = &mut room.lanes;
        let holds = system.as_mut().is_some_and(|own| own.hold(inputs));
        if !holds {
            self.values(values, inputs);
            match self.factory.prepare_lanes(values) {
                Ok(made) => *system = Some(made),
                Err(_) => return false,
            }
        }
        // It is there, as has just been seen.
        let Some(system) = &*system else { return false };
        self.advance(system, method, rest, (t, y), &mut |solver, end| Ok(solver.integrate_to(end)?)).is_ok()
    }

    /// Moves one state on, as [`step_lanes`](Self::step_lanes) does, with steps of its own.
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

    use hamel_runtime::F64x4;

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
        let pushes = [0.3, -0.5, 0.0, 1.1];
        for (method, tolerance) in
            [(MethodName::Rk4, 0.0), (MethodName::Dop853, 1e-9), (MethodName::Gbs14, 1e-9)]
        {
            let mut ends = Vec::new();
            for in_memory in [false, true] {
                let scene = scene(in_memory);
                let stepper = Stepper::new(&scene, &[1.5], pace(method)).unwrap();
                assert!(stepper.has_lanes());
                let mut room = Room::default();
                let mut lanes = START.map(F64x4::splat);
                let mut single = [START; 4];
                for k in 0..4 {
                    let pushes = pushes.map(|push| push * f64::from(k));
                    let t = 0.1 * f64::from(k);
                    assert!(stepper.step_lanes(&mut room, t, &[F64x4::new(pushes)], &mut lanes));
                    for (y, push) in single.iter_mut().zip(pushes) {
                        stepper.step(&mut room, t, &[push], y).unwrap();
                    }
                }
                for (lane, y) in single.iter().enumerate() {
                    for (own, lanes) in y.iter().zip(&lanes) {
                        let error = (own - lanes.lane(lane)).abs();
                        assert!(error <= tolerance, "{}: {error:e}", method.name());
                    }
                }
                ends.push(lanes.map(F64x4::to_array));
            }
            assert_eq!(ends[0], ends[1], "{}, interpreted and in memory", method.name());
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
        let mut lanes: [F64x4; 4] =
            std::array::from_fn(|c| F64x4::new([START[c], START[c], beyond[c], START[c]]));
        let before = lanes;
        assert!(!stepper.step_lanes(&mut room, 0.0, &[F64x4::splat(0.3)], &mut lanes));
        assert_eq!(lanes, before);
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
        assert!(!stepper.has_lanes());
        let mut room = Room::default();
        let mut y = [1.0, 0.0, 1.0, 1.0, 0.0, 1.0];
        stepper.step(&mut room, 0.0, &[], &mut y).unwrap();
        assert!((y[0] - 2.5).abs() < 1e-9, "{y:?}");
        let before = y;
        let stopped = stepper.step(&mut room, 1.5, &[], &mut y).unwrap_err().to_string();
        assert!(stopped.contains("depend on each other"), "{stopped}");
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
