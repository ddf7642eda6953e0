//! Actuators and Lyapunov functions as they are declared, before anything is checked.
//!
//! Deliberately does not know: how a force follows from a function.

use crate::spec::diagnostic::Span;
use crate::spec::value::Value;
use hamel_expr::SymbolId;

/// Actuators and Lyapunov functions as they are declared.
#[derive(Clone, Debug, Default)]
pub(super) struct FeedbackDraft {
    pub(super) actuators: Vec<Actuator>,
    pub(super) functions: Vec<Function>,
    /// `dV/du` of a function, by its name and its symbol.
    pub(super) responses: Vec<(String, SymbolId)>,
}

#[derive(Clone, Debug)]
pub(super) struct Actuator {
    pub(super) name: String,
    pub(super) symbol: SymbolId,
    /// The velocity that it acts along, once it is known.
    pub(super) along: Option<Value>,
    pub(super) doc: String,
    pub(super) span: Option<Span>,
}

#[derive(Clone, Debug)]
pub(super) struct Function {
    pub(super) name: String,
    pub(super) value: Value,
    pub(super) rate: Option<Value>,
    pub(super) doc: String,
    pub(super) span: Option<Span>,
}
