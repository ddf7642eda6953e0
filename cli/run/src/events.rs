//! The events of a motion while it is integrated, with everything else that is noted on the way.
//!
//! Does not know: how steps are made, which events there are.

use std::borrow::Cow;
use std::ops::ControlFlow;

use hamel_codegen::scene::{Interpreter, SceneEvent};
use hamel_codegen::spec::EventDirection;
use hamel_runtime::{Action, Direction, Observer};

use super::dynamics::{Dynamics, VecState};
use super::record::{Noted, Record};
use super::saltation::Saltation;
use super::simulation::{SimulateRequest, stopped_because};
use super::watched::{EventRecord, Watched};
use crate::error::Error;

/// So many states that a motion can go back to are kept as they come.
const MAX_MARKS: usize = 512;

/// Their distance in time from one another then, relative to that from the present.
const APART: f64 = 0.25;

/// A state on the way that the motion can go back to, as none has been changed by an event since.
pub(super) struct Mark {
    pub(super) t: f64,
    pub(super) y: Vec<f64>,
    noted: Noted,
    n_events: usize,
}

/// The events of one motion while it is integrated, with everything that is noted on the way.
pub(super) struct Watcher<'r, 'a> {
    pub(super) record: Record<'r>,
    dynamics: &'r dyn Dynamics,
    /// Number of components of the state without derivatives behind it.
    n_own: usize,
    /// With the parameters of the motion; none where nothing is watched.
    interpreter: Option<Interpreter<'a>>,
    /// None where there are no derivatives, or nothing is watched.
    saltation: Option<Saltation<'a>>,
    events: &'a [SceneEvent],
    /// Whether each of them is the scene's own, and whether it is watched.
    own: Vec<(bool, bool)>,
    progress: &'r mut dyn FnMut(f64) -> ControlFlow<()>,
    pub(super) log: Vec<EventRecord>,
    /// The event that has ended the motion.
    pub(super) ended_by: Option<String>,
    /// What has gone wrong.
    pub(super) error: Option<Error>,
    /// States to go back to where constraints become dependent, in the order of time, where they may.
    pub(super) marks: Vec<Mark>,
    /// Changes of the state by events.
    pub(super) n_changes: u64,
    /// Whether somebody has called the motion off.
    is_called_off: bool,
}

impl<'r, 'a> Watcher<'r, 'a> {
    /// Watches for the events that a request asks for, in the state with derivatives behind it if it asks for some.
    pub(super) fn new(
        dynamics: &'r dyn Dynamics,
        request: &'a SimulateRequest,
        (record, progress): (Record<'r>, &'r mut dyn FnMut(f64) -> ControlFlow<()>),
    ) -> Result<Watcher<'r, 'a>, Error> {
        let (params, along) = (&request.params, &request.along);
        let (mut interpreter, mut saltation, mut own, mut events) = (None, None, Vec::new(), &[][..]);
        if let Some(Watched { executable, n_sections, has_own }) = &request.watched {
            let refused = |reason| Error::Options { reason };
            interpreter = Some(executable.prepare(params).map_err(|bad| refused(bad.condition))?);
            if !along.is_empty() {
                saltation = Some(Saltation::new(executable, params, along).map_err(refused)?);
            }
            events = &executable.events;
            let n_own = events.len() - n_sections;
            let refused = |reason| Error::State { path: "initial".into(), reason };
            if let Some(mode) = executable.modes.iter().find(|k| !matches!(request.initial[**k], 0.0 | 1.0)) {
                let (name, value) = (&executable.program.state[*mode], request.initial[*mode]);
                return Err(refused(format!("mode {name} is {value}: a mode is 1 while it is on, and 0")));
            }
            let interpreter = interpreter.as_ref().filter(|_| *has_own);
            let values = interpreter
                .and_then(|own| own.events(0.0, &request.initial[..executable.program.state.len()]));
            let holds = |k: &usize| events[*k].direction == EventDirection::Below;
            let holds =
                (0..n_own).filter(holds).find(|k| values.as_ref().is_some_and(|values| values[*k] < 0.0));
            if let Some(k) = holds {
                let name = &events[k].name;
                return Err(refused(format!(
                    "condition {name} holds already, and happens where it begins to hold"
                )));
            }
            own = (0..events.len()).map(|k| (k < n_own, k >= n_own || *has_own)).collect();
        }
        let (log, ended_by, error) = (Vec::new(), None, None);
        let n_own = request.initial.len() / (along.len() + 1);
        let mut watcher = Watcher {
            record,
            dynamics,
            n_own,
            interpreter,
            saltation,
            events,
            own,
            progress,
            log,
            ended_by,
            error,
            marks: Vec::new(),
            n_changes: 0,
            is_called_off: false,
        };
        watcher.mark(0.0, &request.initial);
        Ok(watcher)
    }

    /// Notes a state to go back to; of many, those long ago are kept farther apart.
    fn mark(&mut self, t: f64, y: &[f64]) {
        if !self.record.may_lose_rank() {
            return;
        }
        if self.marks.len() >= MAX_MARKS {
            let mut kept = None;
            self.marks.retain(|mark| {
                let is_apart =
                    kept.is_none_or(|last: f64| (mark.t - last).abs() >= APART * (t - mark.t).abs());
                if is_apart {
                    kept = Some(mark.t);
                }
                is_apart
            });
        }
        let (noted, n_events) = (self.record.noted(), self.log.len());
        self.marks.push(Mark { t, y: y.to_vec(), noted, n_events });
    }

    /// Goes back to one of the marks: its time and state.
    pub(super) fn rewind(&mut self, mark: usize) -> (f64, Vec<f64>) {
        self.marks.truncate(mark + 1);
        let Mark { t, ref y, noted, n_events } = self.marks[mark];
        let y = y.clone();
        self.record.rewind(t, &y, noted);
        self.log.truncate(n_events);
        (self.error, self.ended_by) = (None, None);
        (t, y)
    }

    /// Goes on from a state, with nothing to go back to before it.
    pub(super) fn begin_again(&mut self, t: f64, y: &[f64]) {
        self.record.begin_again(t, y);
        self.marks.clear();
        self.mark(t, y);
    }

    /// Whether the motion has come to an end before its time.
    pub(super) fn is_over(&self) -> bool {
        self.error.is_some() || self.ended_by.is_some() || self.is_called_off
    }

    /// What evaluates the events, with the inputs of a time.
    fn at<'i>(&self, interpreter: &'i Interpreter<'a>, t: f64) -> Cow<'i, Interpreter<'a>> {
        let Some(inputs) = self.dynamics.inputs_at(t).filter(|inputs| inputs.len() == interpreter.n_inputs())
        else {
            return Cow::Borrowed(interpreter);
        };
        let mut interpreter = interpreter.clone();
        interpreter.set_inputs(&inputs);
        Cow::Owned(interpreter)
    }

    /// The changes of sign that are watched for.
    pub(super) fn directions<const K: usize>(&self) -> [Direction; K] {
        let mut directions = [Direction::Either; K];
        for (direction, event) in directions.iter_mut().zip(self.events) {
            *direction = match event.direction {
                EventDirection::Rising => Direction::Rising,
                EventDirection::Falling | EventDirection::Below => Direction::Falling,
                EventDirection::Either => Direction::Either,
            };
        }
        directions
    }

    /// Changes a state, with its derivatives if it has some, as an event does.
    fn change(&mut self, index: usize, t: f64, z: &mut [f64]) -> Result<(), Error> {
        let (event, n, events) = (&self.events[index], self.n_own, self.events);
        let before = z[..n].to_vec();
        let stopped = |reason: String| {
            let reason = format!("event {} {reason}", event.name);
            Err(stopped_because(self.dynamics.info(), t, &before, reason))
        };
        let done = match (&self.saltation, &self.interpreter) {
            (Some(saltation), _) => {
                let rates = |z: &[f64]| {
                    let mut dz = vec![0.0; z.len()];
                    self.dynamics.rhs(t, z, &mut dz);
                    dz
                };
                match saltation.pass((index, events), t, z, &rates) {
                    Ok(done) => done,
                    Err(reason) => return stopped(reason),
                }
            }
            (None, Some(interpreter)) => self.at(interpreter, t).apply(events, index, t, z),
            (None, None) => Vec::new(),
        };
        for followed in done.iter().skip(1).map(|k| &events[*k]) {
            let state = z[..n].to_vec();
            self.log.push(EventRecord { name: followed.name.clone(), t, state });
            if followed.stops {
                self.ended_by = Some(followed.name.clone());
            }
        }
        match self.record.restart(t, &before, &z[..n])? {
            Some(reason) => stopped(reason),
            None => {
                self.n_changes += 1;
                self.marks.clear();
                self.mark(t, z);
                Ok(())
            }
        }
    }

    fn keep(&mut self, outcome: Result<(), Error>) -> ControlFlow<()> {
        match outcome {
            Ok(()) if self.error.is_none() => ControlFlow::Continue(()),
            Ok(()) => ControlFlow::Break(()),
            Err(error) => {
                self.error.get_or_insert(error);
                ControlFlow::Break(())
            }
        }
    }
}

/// With `K` zero where nothing is watched, otherwise [`MAX_EVENTS`](super::watched::MAX_EVENTS): nobody pays for events
/// that there are none of.
impl<const K: usize> Observer<f64, VecState, K> for Watcher<'_, '_> {
    fn sample(&mut self, t: f64, state: &VecState) {
        if self.error.is_none() {
            let outcome = self.record.sample(t, &state.0);
            let _ = self.keep(outcome);
        }
    }

    fn step(&mut self, t: f64, state: &VecState) -> ControlFlow<()> {
        let outcome = self.record.step(t, &state.0);
        let told = (self.progress)(t);
        self.is_called_off |= told.is_break();
        self.keep(outcome)?;
        if self.record.path.is_none() {
            self.mark(t, &state.0);
        }
        if self.record.near_at.is_some() {
            return ControlFlow::Break(());
        }
        told
    }

    fn values(&mut self, t: f64, state: &VecState) -> [f64; K] {
        // What is not watched never changes its sign.
        let mut values = [1.0; K];
        let own = &state.0[..self.n_own];
        let interpreter = self.interpreter.as_ref();
        let found = interpreter.and_then(|interpreter| self.at(interpreter, t).events(t, own));
        for ((out, value), (_, is_watched)) in values.iter_mut().zip(found.unwrap_or_default()).zip(&self.own)
        {
            if *is_watched {
                *out = value;
            }
        }
        values
    }

    fn event(&mut self, index: usize, t: f64, state: &mut VecState) -> Action {
        let (event, (is_own, _)) = (&self.events[index], self.own[index]);
        let state_there = state.0[..self.n_own].to_vec();
        self.log.push(EventRecord { name: event.name.clone(), t, state: state_there });
        if !is_own {
            return Action::Continue;
        }
        // The last state is at another time for other parameters, whether the event sets something or not.
        let changes = !event.sets.is_empty() || (event.stops && self.saltation.is_some());
        if changes {
            let outcome = self.change(index, t, &mut state.0);
            if self.keep(outcome).is_break() {
                return Action::Stop;
            }
        }
        if event.stops {
            // A state that is set was looked at before.
            let outcome = if changes { Ok(()) } else { self.record.keeps_rank(t, &state.0[..self.n_own]) };
            if self.keep(outcome).is_break() {
                return Action::Stop;
            }
            self.ended_by = Some(event.name.clone());
        }
        match (changes, self.ended_by.is_some()) {
            (false, false) => Action::Continue,
            (false, true) => Action::Stop,
            // A path through a singular position ends with a change of the state.
            (true, false) if self.record.path.is_some() => Action::ChangeAndStop,
            (true, false) => Action::Restart,
            (true, true) => Action::ChangeAndStop,
        }
    }
}
