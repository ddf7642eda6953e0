//! Integration of a scene from an initial state.
//!
//! Does not know: whether the scene is compiled or interpreted, how a request was written, files, figures.

use std::ops::ControlFlow;

use hamel_runtime::{Error as SolverError, Integrator};

use super::admissible;
use super::auto::Purpose;
use super::crossing::{NOT_THERE, Refusal};
use super::dynamics::{Factory, PreparedScene, VecState};
use super::evaluate::{describe, prepare, refused, why_stopped};
use super::events::Watcher;
use super::info::Info;
use super::length::method_of_long;
use super::lost_rank::Rank;
use super::method::{MethodName, Steps};
use super::noise;
use super::passing::Course;
use super::record::Record;
use super::sensitivity::Along;
use super::simulation::{Sample, SimulateRequest, SimulateResponse, stopped_because};
use super::solver::method_of;
use crate::error::Error;
use crate::interrupts;

/// Integrates a scene. `progress` is told the time reached after every step. A noted interrupt ends the motion there.
///
/// # Errors
/// [`Error::NoState`], [`Error::Params`], [`Error::State`] and [`Error::Inadmissible`] for the initial state,
/// [`Error::Options`], and [`Error::Stopped`] with the state reached when the integration cannot go on.
pub fn simulate(
    factory: &dyn Factory,
    request: &SimulateRequest,
    progress: &mut dyn FnMut(f64),
) -> Result<SimulateResponse, Error> {
    let times: Vec<f64> = (0..request.samples).map(|k| request.sample_time(k)).collect();
    let mut told = |t| {
        progress(t);
        interrupts::look()
    };
    simulate_at(factory, request, &times, &mut told)
}

/// The same with samples at any `times`, from zero in the direction of the motion to its end at most. Where `progress`
/// breaks, the motion ends with that step.
///
/// # Errors
/// As [`simulate`].
pub fn simulate_at(
    factory: &dyn Factory,
    request: &SimulateRequest,
    times: &[f64],
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<SimulateResponse, Error> {
    has_state(factory.info())?;
    request.validate(factory.info())?;
    let dynamics = prepare_moved(factory, request, times)?;
    admissible::check(&*dynamics, &request.initial, request.n_group)?;
    let long = if request.method == MethodName::Auto { method_of_long(factory, request) } else { None };
    if let Some(method) = long {
        return motion(&dynamics, &SimulateRequest { method, ..request.clone() }, times, progress);
    }
    if request.along.is_empty() {
        return motion(&dynamics, request, times, progress);
    }
    keeps_rank(&dynamics, request, progress)?;
    let along = Along::new(factory, &request.along, request.method, "sensitivity")?;
    let initial = along.initial(&request.initial, &request.tangents);
    let extended = SimulateRequest { initial, ..request.clone() };
    extended.validate(along.info())?;
    let mut response = motion(&prepare(&along, &request.params)?, &extended, times, progress)?;
    along.separate(&mut response);
    Ok(response)
}

/// Holds a motion whose derivatives are asked for to regular positions: through a singular one the equations of motion
/// do not say what these are. With derivatives behind its state a motion is not moved onto equations
/// between coordinates, and may lead past the position on another branch.
///
/// # Errors
/// [`Error::Stopped`] with the state at the first singular position; as [`simulate`].
fn keeps_rank(
    dynamics: &PreparedScene<'_>,
    request: &SimulateRequest,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(), Error> {
    if !Rank::may_be_lost(&**dynamics, &request.initial) {
        return Ok(());
    }
    let plain = SimulateRequest { along: Vec::new(), tangents: Vec::new(), samples: 0, ..request.clone() };
    let passed = motion(dynamics, &plain, &[], progress)?.singular_positions;
    let Some(first) = passed.first() else { return Ok(()) };
    let until = SimulateRequest { t_final: first.t, ..plain };
    let there = motion(dynamics, &until, &[], progress)?.last;
    let reason = "equations between coordinates depend on each other there, and derivatives do not go on through such a \
                  position: end before it";
    Err(stopped_because(dynamics.info(), first.t, &there, reason.to_owned()))
}

/// The scene with its parameters, moved by its noises where it has any.
fn prepare_moved<'f>(
    factory: &'f dyn Factory,
    request: &SimulateRequest,
    times: &[f64],
) -> Result<PreparedScene<'f>, Error> {
    let info = factory.info();
    if info.noises.is_empty() {
        return prepare(factory, &request.params);
    }
    if request.watched.is_some() {
        noise::refuse(info, "whose paths no event is watched for on")?;
    }
    if !request.along.is_empty() {
        noise::refuse(info, "whose paths have no derivatives")?;
    }
    let SimulateRequest { method, steps, t_final, .. } = *request;
    let wiener = request.noise.wiener(info, (method, steps), times.iter().copied().chain([t_final]))?;
    factory.prepare_noisy(&request.params, wiener).map_err(|bad| refused(info, &request.params, bad))
}

/// A motion that has not come to its end: why, and the samples on the way.
pub(super) struct Unfinished {
    pub(super) error: Error,
    pub(super) samples: Vec<Sample>,
    /// Accepted steps.
    pub(super) steps: u64,
}

impl From<Error> for Box<Unfinished> {
    fn from(error: Error) -> Self {
        Box::new(Unfinished { error, samples: Vec::new(), steps: 0 })
    }
}

fn motion(
    dynamics: &PreparedScene<'_>,
    request: &SimulateRequest,
    times: &[f64],
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<SimulateResponse, Error> {
    followed(dynamics, request, times, progress).map_err(|unfinished| unfinished.error)
}

/// The motion of a prepared scene through its events.
///
/// # Errors
/// As [`simulate`], with what there is of the motion.
pub(super) fn followed(
    dynamics: &PreparedScene<'_>,
    request: &SimulateRequest,
    times: &[f64],
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<SimulateResponse, Box<Unfinished>> {
    let purpose = Purpose::of(request.samples, request.watched.is_some());
    let method =
        method_of(request.method, request.steps, purpose, &**dynamics, &request.initial)?.of_scenes();
    let info = dynamics.info();
    let options = request.steps.options(request.t_final, request.max_steps)?;
    let options = options.with_max_events(request.max_events);
    let start = |error: SolverError| match error {
        SolverError::Failure(failure) => {
            Error::State { path: "initial".into(), reason: describe(info, failure) }
        }
        other => Error::Options { reason: other.to_string() },
    };
    let clock = std::time::Instant::now();
    Integrator::new(dynamics, method, 0.0, VecState(request.initial.clone()), options).map_err(start)?;
    let record = Record::new(&**dynamics, request)?;
    let mut watcher = Watcher::new(&**dynamics, request, (record, progress))?;
    let course = Course { request, times, options };
    let reached = course.follow((dynamics, method), &mut watcher).map_err(start)?;
    let Watcher { record, log, ended_by, error, .. } = watcher;
    let (samples, steps) = (record.samples, reached.steps);
    if let Some(error) = error {
        let error = not_passed(error, reached.refusal);
        return Err(Box::new(Unfinished { error, samples, steps }));
    }
    if let Some(error) = reached.error {
        let (t, y) = (reached.t, &reached.y);
        let (SolverError::EventNotFinite { index, .. } | SolverError::EventsAccumulate { index, .. }) = error
        else {
            let error = not_passed(stopped(info, t, y, &error), reached.refusal);
            return Err(Box::new(Unfinished { error, samples, steps }));
        };
        let event = request.watched.as_ref().and_then(|watched| watched.name(index));
        let reason = format!("event {}: {}", event.unwrap_or_default(), why_stopped(info, &error));
        return Err(Box::new(Unfinished { error: stopped_because(info, t, y, reason), samples, steps }));
    }
    let energy_drift = record.initial_energy.map(|_| (record.deviation / record.scale).min(f64::MAX));
    Ok(SimulateResponse {
        t: reached.t,
        last: reached.y,
        along: Vec::new(),
        steps: reached.steps,
        rejected: reached.rejected,
        rhs_evals: reached.rhs_evals,
        energy_drift,
        events: request.watched.is_some().then_some(log),
        ended_by,
        singular_positions: reached.passed,
        warnings: drift_warning(info, request.steps, energy_drift).into_iter().collect(),
        initial_energy: record.initial_energy,
        energy_scale: record.scale,
        energy_at_steps: record.energy_at_steps,
        initial_residual: record.initial_residual,
        constraint_residual: record.residual,
        samples,
        seconds: clock.elapsed().as_secs_f64(),
    })
}

/// An error that names why a singular position was not passed, where there is one.
fn not_passed(error: Error, refusal: Option<Refusal>) -> Error {
    match (error, refusal) {
        (Error::Stopped { t, state, reason }, Some(refusal)) if refusal != NOT_THERE => {
            let reason = format!("{reason}; the singular position is not passed: {refusal}");
            Error::Stopped { t, state, reason }
        }
        (error, _) => error,
    }
}

/// Whether there is anything to integrate.
///
/// # Errors
/// [`Error::NoState`].
pub fn has_state(info: &Info) -> Result<(), Error> {
    if info.state.is_empty() {
        return Err(Error::NoState { scene: info.scene.clone(), model: info.model.clone() });
    }
    Ok(())
}

/// A larger relative drift of an energy that is conserved is told.
const LARGE_DRIFT: f64 = 1e-3;

/// Of adaptive steps, in units of the relative tolerance: as many steps may add up.
const MANY_TOLERANCES: f64 = 1e3;

/// That a motion is another one, where the energy shows it: fixed steps have no error estimate, and an estimate does
/// not see where constraints lose their rank.
fn drift_warning(info: &Info, steps: Steps, drift: Option<f64>) -> Option<String> {
    let drift = drift.filter(|_| info.conserves_energy)?;
    let (large, reason) = match steps {
        Steps::Fixed { step } => (
            LARGE_DRIFT,
            format!(
                "step {step:?} is too long for this motion, take a shorter one or a method with adaptive steps"
            ),
        ),
        Steps::Adaptive { rtol, .. } => (
            LARGE_DRIFT.max(MANY_TOLERANCES * rtol),
            format!(
                "on its way the motion passed a place where the constraints or the inertia lose their rank, or the \
                 tolerance {rtol:?} is too large for it"
            ),
        ),
    };
    (drift > large).then(|| format!("the energy is conserved but moved by {drift:.1e} of its size: {reason}"))
}

fn stopped(info: &Info, t: f64, y: &[f64], error: &SolverError) -> Error {
    stopped_because(info, t, y, why_stopped(info, error))
}
