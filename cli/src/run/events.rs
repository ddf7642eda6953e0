//! The events of a motion while it is integrated, with everything else that is noted on the way.
//!
//! Does not know: how steps are made, which events there are.

use std::ops::ControlFlow;

use hamel_codegen::scene::{Interpreter, SceneEvent};
use hamel_codegen::spec::EventDirection;
use hamel_runtime::{Action, Direction, Observer};

use super::dynamics::VecState;
use super::info::Info;
use super::record::Record;
use super::simulation::stopped_because;
use super::watched::{EventRecord, Watched};
use crate::error::Error;

/// The events of one motion while it is integrated, with everything that is noted on the way.
pub(super) struct Watcher<'r, 'a> {
    pub(super) record: Record<'r>,
    info: &'r Info,
    /// With the parameters of the motion; none where nothing is watched.
    interpreter: Option<Interpreter<'a>>,
    events: &'a [SceneEvent],
    /// Whether each of them is the scene's own, and whether it is watched.
    own: Vec<(bool, bool)>,
    progress: &'r mut dyn FnMut(f64),
    pub(super) log: Vec<EventRecord>,
    /// The event that has ended the motion.
    pub(super) ended_by: Option<String>,
    /// What has gone wrong.
    pub(super) error: Option<Error>,
}

impl<'r, 'a> Watcher<'r, 'a> {
    /// Watches for events with parameters of the scene.
    pub(super) fn new(
        watched: Option<&'a Watched>,
        params: &[f64],
        (record, info, progress): (Record<'r>, &'r Info, &'r mut dyn FnMut(f64)),
    ) -> Result<Watcher<'r, 'a>, Error> {
        let (mut interpreter, mut own, mut events) = (None, Vec::new(), &[][..]);
        if let Some(Watched { executable, n_sections, has_own }) = watched {
            let prepared = executable.prepare(params);
            interpreter = Some(prepared.map_err(|bad| Error::Options { reason: bad.condition })?);
            events = &executable.events;
            let n_own = events.len() - n_sections;
            own = (0..events.len()).map(|k| (k < n_own, k >= n_own || *has_own)).collect();
        }
        let (log, ended_by, error) = (Vec::new(), None, None);
        Ok(Watcher { record, info, interpreter, events, own, progress, log, ended_by, error })
    }

    /// The changes of sign that are watched for.
    pub(super) fn directions<const K: usize>(&self) -> [Direction; K] {
        let mut directions = [Direction::Either; K];
        for (direction, event) in directions.iter_mut().zip(self.events) {
            *direction = match event.direction {
                EventDirection::Rising => Direction::Rising,
                EventDirection::Falling => Direction::Falling,
                EventDirection::Either => Direction::Either,
            };
        }
        directions
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
        (self.progress)(t);
        self.keep(outcome)
    }

    fn values(&mut self, t: f64, state: &VecState) -> [f64; K] {
        // What is not watched never changes its sign.
        let mut values = [1.0; K];
        let found = self.interpreter.as_ref().and_then(|interpreter| interpreter.events(t, &state.0));
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
        self.log.push(EventRecord { name: event.name.clone(), t, state: state.0.clone() });
        if !is_own {
            return Action::Continue;
        }
        if !event.sets.is_empty()
            && let Some(interpreter) = &self.interpreter
        {
            let before = state.0.clone();
            interpreter.apply(event, t, &mut state.0);
            let outcome = match self.record.restart(t, &before, &state.0) {
                Ok(Some(reason)) => {
                    let reason = format!("event {} {reason}", event.name);
                    Err(stopped_because(self.info, t, &before, reason))
                }
                Ok(None) => Ok(()),
                Err(error) => Err(error),
            };
            if self.keep(outcome).is_break() {
                return Action::Stop;
            }
        }
        if event.stops {
            self.ended_by = Some(event.name.clone());
        }
        match (event.sets.is_empty(), event.stops) {
            (true, false) => Action::Continue,
            (true, true) => Action::Stop,
            (false, false) => Action::Restart,
            (false, true) => Action::ChangeAndStop,
        }
    }
}
