//! The events of a scene: which components of its state they set.
//!
//! Their functions and what they set are outputs, written in the state of the scene as all outputs are.
//!
//! Does not know: how anything is lowered or emitted, how events are located.

use hamel_expr::error::Error;
use hamel_lang::spec::{Event, EventDirection, Want};
use hamel_mechanics::mechanics::{Equations, Output, OutputKind, StateEquation};

/// An event of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SceneEvent {
    /// Name.
    pub name: String,
    /// Which changes of sign of its function are events.
    pub direction: EventDirection,
    /// Whether it ends the motion.
    pub stops: bool,
    /// Positions in the state of the components that it sets, in the order of the output [`SceneEvent::after`].
    pub sets: Vec<usize>,
    /// What it is.
    pub doc: String,
}

impl SceneEvent {
    /// Name of the output with the new values of what the event sets.
    pub fn after(&self) -> String {
        Event::after(&self.name)
    }
}

/// The events that a scene with these outputs has; none unless it wants them.
///
/// # Errors
/// [`Error::EventSets`] where the state does not carry what an event sets.
pub(super) fn of_scene(
    equations: &Equations,
    scene: &str,
    state: &[StateEquation],
    outputs: &[Output],
) -> Result<Vec<SceneEvent>, Error> {
    if !outputs.iter().any(|o| o.kind == OutputKind::Group(Want::Events)) {
        return Ok(Vec::new());
    }
    let system = &equations.system;
    let mut events = Vec::new();
    for Event { name, direction, mode: _, sets, impact: _, stops, doc, span: _ } in &system.events {
        let mut places = Vec::new();
        for symbol in sets {
            let place = state.iter().position(|s| s.symbol == *symbol).ok_or_else(|| Error::EventSets {
                event: name.clone(),
                target: system.graph.name(*symbol).to_owned(),
                scene: scene.to_owned(),
                state: state.iter().map(|s| s.name.clone()).collect(),
            })?;
            places.push(place);
        }
        let (name, doc) = (name.clone(), doc.clone());
        events.push(SceneEvent { name, direction: *direction, stops: *stops, sets: places, doc });
    }
    Ok(events)
}
