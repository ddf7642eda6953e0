//! Events as they are declared, before anything is checked.
//!
//! Deliberately does not know: modes and variables of the model, functions of events.

use crate::spec::diagnostic::Span;
use crate::spec::event::EventDirection;
use crate::spec::value::Value;

/// A name and where it was used.
pub(in crate::spec) type Located = (String, Option<Span>);

/// What an event sets, and to what.
#[derive(Clone, Debug)]
pub(in crate::spec) struct EventSet {
    pub(in crate::spec) target: Located,
    pub(in crate::spec) value: Value,
    /// Where the value stands.
    pub(in crate::spec) span: Option<Span>,
}

/// What an event does to a mode.
#[derive(Clone, Debug)]
pub(in crate::spec) enum ModeAct {
    /// Its constraints begin to hold, by an impact without return.
    Enter(Located),
    /// They hold no longer.
    Leave(Located),
    /// They are struck, with the part of the velocity that comes back.
    Impact(Located, Option<(Value, Option<Span>)>),
}

/// An event.
#[derive(Clone, Debug)]
pub(super) struct EventDraft {
    pub(super) name: String,
    pub(super) value: Value,
    /// Where the function stands.
    pub(super) of_value: Option<Span>,
    pub(super) direction: EventDirection,
    pub(super) sets: Vec<EventSet>,
    pub(super) acts: Vec<ModeAct>,
    pub(super) stops: bool,
    /// The mode while which it is watched for.
    pub(super) mode: Option<usize>,
    pub(super) doc: String,
    /// Where its name stands.
    pub(super) span: Option<Span>,
}
