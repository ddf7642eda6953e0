//! Modes: constraints that hold at some times and not at others, and what changes velocities where they begin to hold.
//!
//! Deliberately does not know: events, how impacts are solved.

use super::diagnostic::Span;
use hamel_expr::{ExprId, SymbolId};

/// A mode: while it is on its constraints hold and its forces act.
///
/// Its symbol `s`, one while it is on and zero otherwise, is a component of the state that only events change. A
/// constraint `phi = 0` of the mode is `s phi = 0` with the multiplier `s lambda`, and `(1 - s) lambda = 0` says what
/// the multiplier is while the mode is off.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Name, which stands for `s` in expressions.
    pub name: String,
    /// `s`.
    pub symbol: SymbolId,
    /// Documentation.
    pub doc: String,
    /// Where its name stands.
    pub span: Option<Span>,
}

/// A change of velocities by impulses along the constraints: `p(y+) - p(y-) = sum_c s_c w_c mu_c` with
/// `s_c phi_c(y+) = -e_c s_c phi_c(y-)` and `(1 - s_c) mu_c = 0`, for `s` as the event has it.
///
/// # Source
/// Brogliato, Nonsmooth Mechanics (2016), chapter 6 (Newton's law of impacts in the kinetic metric).
#[derive(Clone, Debug, PartialEq)]
pub struct Impact {
    /// Symbols of modes whose constraints are there at the impact or not, by one or zero; others are as before.
    pub modes: Vec<(SymbolId, ExprId)>,
    /// Symbols of modes that are struck, with the part of the velocity along their constraints that comes back: `e`.
    pub restitution: Vec<(SymbolId, ExprId)>,
    /// What stands for the velocities after the impact, in the order of
    /// [`all_velocities`](super::Model::all_velocities).
    pub velocities: Vec<SymbolId>,
}

/// Name of what stands for a velocity after an impact.
pub(super) fn after_impact(event: &str, velocity: &str) -> String {
    format!("after_{event}_{velocity}")
}
