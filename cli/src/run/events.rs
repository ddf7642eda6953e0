//! The events of a motion: those of the scene, which may change its state or end it, and sections, which are told only.
//!
//! Their functions are evaluated by the interpreter, whoever evaluates the right-hand side: an event is the same
//! wherever the motion is integrated.
//!
//! Does not know: how steps are made, how a request was written.

use std::ops::ControlFlow;

use hamel_codegen::scene::{self, Executable, Interpreter, SceneEvent};
use hamel_codegen::spec::EventDirection;
use hamel_runtime::{Action, Direction, Observer};
use serde::{Deserialize, Serialize};

use super::dynamics::VecState;
use super::info::Info;
use super::record::Record;
use super::simulation::{EventRecord, stopped_because};
use crate::error::Error;
use crate::model::{self, Checked};

/// Most events and sections of one motion: the integrator knows their number when it is compiled.
pub(crate) const MAX_EVENTS: usize = 32;

/// The events that are watched for along a motion, evaluated in the state of the scene that is integrated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Watched {
    executable: Executable,
    /// Number of sections, which come after the events of the model.
    n_sections: usize,
    /// Whether the events of the model are those of the scene.
    has_own: bool,
}

/// What begins the name of a section; a number follows.
const SECTION: &str = "section";

impl Watched {
    /// The events of a scene that was built with them; none if it has none.
    pub fn of(executable: &Executable) -> Option<Watched> {
        let watched = Watched { executable: executable.clone(), n_sections: 0, has_own: true };
        (!executable.events.is_empty()).then_some(watched)
    }

    /// The events of a scene and sections, each an expression of the model's language, with `rising` or `falling`
    /// behind it where only these crossings are meant; `path` says where they were given. None if there are neither.
    ///
    /// # Errors
    /// [`Error::Request`] for sections that are no such expressions; [`Error::Models`].
    pub fn new(
        model: &Checked,
        info: &Info,
        sections: &[String],
        path: &str,
    ) -> Result<Option<Watched>, Error> {
        let has_own = scene::has_events(model, &info.scene);
        if sections.is_empty() && !has_own {
            return Ok(None);
        }
        let make = || {
            let built = if sections.is_empty() {
                scene::build_events(model, &info.scene)?
            } else {
                let extended = extended(model, sections, path)?;
                scene::build_events(&extended, &info.scene)
                    .map_err(|problems| Error::unusable(path, first_message(&problems)))?
            };
            Ok(built.executable())
        };
        let executable: Executable =
            model.cached(&format!("events {}", sections.join("\n")), &info.scene, make)?;
        if executable.program.state != info.state || executable.program.params != info.param_names() {
            let reason = format!("cannot be watched in scene {}, which carries another state", info.scene);
            return Err(Error::unusable(path, reason));
        }
        if executable.events.len() > MAX_EVENTS {
            let reason = format!("make more than {MAX_EVENTS} with the events of the model: take fewer");
            return Err(Error::unusable(path, reason));
        }
        Ok(Some(Watched { executable, n_sections: sections.len(), has_own }))
    }

    /// Name of an event by its position.
    pub(super) fn name(&self, index: usize) -> Option<&str> {
        self.executable.events.get(index).map(|event| event.name.as_str())
    }

    /// Whether an event may change the state or end the motion.
    pub fn acts(&self) -> bool {
        self.has_own && self.executable.events.iter().any(|event| event.stops || !event.sets.is_empty())
    }
}

/// The model with sections as further events.
fn extended(model: &Checked, sections: &[String], path: &str) -> Result<model::Model, Error> {
    let Some(origin) = &model.origin else {
        return Err(Error::unusable(path, "needs the text of the model"));
    };
    let mut items = String::new();
    for (k, section) in sections.iter().enumerate() {
        if section.contains([';', '{', '}', '\n']) || section.contains("//") || section.contains("/*") {
            let reason = format!("is {section:?}: give one expression, with `rising` or `falling` behind it");
            return Err(Error::unusable(path, reason));
        }
        items.push_str(&format!("\nevent {SECTION}{} = {section};", k + 1));
    }
    // The end of the model: the last brace that is no part of a comment.
    let mut end = None;
    let mut start = 0;
    for line in origin.text.split_inclusive('\n') {
        let code = line.split("//").next().unwrap_or(line);
        end = code.rfind('}').map(|at| start + at).or(end);
        start += line.len();
    }
    let mut text = origin.text.clone();
    text.insert_str(end.unwrap_or(text.len()), &items);
    // The budget is that of the model, which was within it.
    hamel_codegen::spec::parse_within(model.graph.budget(), path, &text)
        .map_err(|problems| Error::unusable(path, first_message(&problems)))
}

/// The first of some problems, with its help.
fn first_message(problems: &hamel_codegen::spec::Diagnostics) -> String {
    let Some(problem) = problems.iter().next() else { return String::new() };
    let help = problem.help.as_ref().map(|help| format!(": {help}")).unwrap_or_default();
    format!("{}{help}", problem.message)
}

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
    pub(super) fn directions(&self) -> [Direction; MAX_EVENTS] {
        let mut directions = [Direction::Either; MAX_EVENTS];
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

impl Observer<f64, VecState, MAX_EVENTS> for Watcher<'_, '_> {
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

    fn values(&mut self, t: f64, state: &VecState) -> [f64; MAX_EVENTS] {
        // What is not watched never changes its sign.
        let mut values = [1.0; MAX_EVENTS];
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
