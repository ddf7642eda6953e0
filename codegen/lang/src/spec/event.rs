//! Events of a model as data, and which outputs are theirs.
//!
//! Deliberately does not know: their functions and what they set, which are outputs; how events are located.

use super::diagnostic::Span;
use super::mode::Impact;
use hamel_expr::SymbolId;

/// What a [`NamedVector`](super::NamedVector) is in the model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputPart {
    /// An output that the model declares.
    Own,
    /// The functions of all events.
    Events,
    /// What an event sets: the new values, in the order of [`Event::sets`].
    After,
    /// The poses of all named frames in space: for each the place, then the rotation by rows.
    Poses,
    /// The twists of all named frames in their own axes: for each the angular velocity, then the velocity.
    Twists,
    /// All bodies in space, for those who compare: for each the place of its mass centre, its mass, its rotation by
    /// rows, and its inertia in its own axes by rows.
    Bodies,
    /// Place and velocity of the mass centre of all bodies in space.
    CenterOfMass,
    /// Their momentum in the axes of space: the angular one about the mass centre, then the linear one.
    CentroidalMomentum,
}

/// Which changes of sign of a function are an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum EventDirection {
    /// From negative to zero or positive.
    Rising,
    /// From positive to zero or negative.
    Falling,
    /// Both.
    Either,
    /// From positive to zero or negative, and where another event leaves the function negative: a condition `f < 0`
    /// that begins to hold.
    Below,
}

/// An event: a change of sign of a function of time and state, and what it does.
///
/// The functions of all events are the components of the output [`OutputPart::Events`], and what one of them sets is
/// its output [`OutputPart::After`], so that both are written in the state of every formulation as outputs are.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Name.
    pub name: String,
    /// Which changes of sign are events.
    pub direction: EventDirection,
    /// The mode while which it is watched for, by its place among [`modes`](super::Model::modes).
    pub mode: Option<usize>,
    /// What it sets: velocities, coordinates, advected parameters, by component.
    pub sets: Vec<SymbolId>,
    /// How the velocities among these change, where constraints say so.
    pub impact: Option<Impact>,
    /// Whether it ends the motion.
    pub stops: bool,
    /// Documentation.
    pub doc: String,
    /// Where its name stands.
    pub span: Option<Span>,
}

impl Event {
    /// Name of the output with what an event sets.
    pub fn after(event: &str) -> String {
        format!("after_{event}")
    }
}
