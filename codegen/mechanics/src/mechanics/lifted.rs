//! A mechanical connection by the names that equations of motion give it.
//!
//! Does not know: how it is solved for, which equations use it.

use hamel_expr::ExprId;

use super::solve::Factorisation;

/// The connection by names.
pub(super) struct Lifted {
    /// Of `K`.
    pub(super) factors: Factorisation,
    /// `K`.
    pub(super) inertia: Vec<Vec<ExprId>>,
    /// `L_vx`.
    pub(super) coupling: Vec<Vec<ExprId>>,
    /// `A`.
    pub(super) connection: Vec<Vec<ExprId>>,
    /// `A xdot`.
    pub(super) along: Vec<ExprId>,
}
