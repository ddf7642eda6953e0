//! States of first order: numbers of the state whose rates the model gives, beside those that follow from a Lagrangian.
//!
//! Deliberately does not know: who uses them, how a rate is written.

use super::diagnostic::Span;
use super::model::Domain;
use hamel_expr::{ExprId, SymbolId};

/// A number or a vector of the state with `zdot = f(x, y, z, u, t)`: a current, an activation, an integral.
///
/// On the algebroid its components are base coordinates that no velocity moves: no displacement changes them, and no
/// force belongs to them.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstOrderState {
    /// Name of the number or the vector.
    pub name: String,
    /// Names and symbols of the components; the one of `name` for a number.
    pub components: Vec<(String, SymbolId)>,
    /// Where each component lives.
    pub domain: Domain,
    /// `f`, one a component; functions of the state, inputs and the time.
    pub rates: Vec<ExprId>,
    /// Whether it is the entropy of something: its rate is a power over a temperature.
    pub is_entropy: bool,
    /// Whether it is a [`Mode`](super::Mode): zero or one, changed by events alone.
    pub is_mode: bool,
    /// Documentation.
    pub doc: String,
    /// Where its name stands.
    pub span: Option<Span>,
    /// Where its rate stands.
    pub of_rate: Option<Span>,
}
