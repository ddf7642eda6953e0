//! The events that are watched for along a motion: those of its scene, which may change its state or end it, and
//! sections, which are told only.
//!
//! Their functions are evaluated by the interpreter, whoever evaluates the right-hand side: an event is the same
//! wherever the motion is integrated.
//!
//! Does not know: how steps are made, how a request was written.

use hamel_codegen::scene::{self, Executable};
use hamel_codegen::spec;
use serde::{Deserialize, Serialize};

use super::info::Info;
use crate::error::Error;
use crate::model::{Checked, Model, first_message, is_one_expression};

/// An event on the way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EventRecord {
    /// Its name.
    pub name: String,
    /// Its time.
    pub t: f64,
    /// The state there, before the event has changed it.
    pub state: Vec<f64>,
}

/// Most events and sections of one motion: the integrator knows their number when it is compiled.
pub const MAX_EVENTS: usize = 32;

/// The events that are watched for along a motion, evaluated in the state of the scene that is integrated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Watched {
    pub(super) executable: Executable,
    /// Number of sections, which come after the events of the model.
    pub(super) n_sections: usize,
    /// Whether the events of the model are those of the scene.
    pub(super) has_own: bool,
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
        let what = format!("events {}", sections.join("\n"));
        let is_sound = |executable: &Executable| executable.verify().is_ok();
        let executable: Executable = model.cached(&what, &info.scene, is_sound, make)?;
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
fn extended(model: &Checked, sections: &[String], path: &str) -> Result<Model, Error> {
    let Some(origin) = &model.origin else {
        return Err(Error::unusable(path, "needs the text of the model"));
    };
    let mut items = String::new();
    for (k, section) in sections.iter().enumerate() {
        if !is_one_expression(section) {
            let reason = format!("is {section:?}: give one expression, with `rising` or `falling` behind it");
            return Err(Error::unusable(path, reason));
        }
        items.push_str(&format!("\nevent {SECTION}{} = {section};", k + 1));
    }
    let text = spec::with_items(&origin.text, &items);
    // The budget is that of the model, which was within it.
    spec::parse_within(model.graph.budget(), path, &text)
        .map_err(|problems| Error::unusable(path, first_message(&problems)))
}
