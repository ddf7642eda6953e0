//! Rows of a constraint that are solved one after the other.
//!
//! Deliberately does not know: how they are made, what they are solved for.

use hamel_expr::ExprId;

/// Rows that give their velocities one after the other, brought to a triangle by elimination without a choice of
/// pivots: `y_own = -(form y + right)` by velocities of later rows and independent ones.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// In the order in which rows are eliminated.
    pub(super) links: Vec<Link>,
}

/// A row of a chain.
#[derive(Clone, Debug)]
pub(super) struct Link {
    pub(super) row: usize,
    pub(super) own: usize,
    /// What the velocities of rows before are multiplied by, in their order.
    pub(super) before: Vec<ExprId>,
    /// The reciprocal of what is left of the coefficient of the own velocity.
    pub(super) scale: ExprId,
    /// Coefficients divided by that, zero at velocities that rows before or direct rows give.
    pub(super) form: Vec<ExprId>,
}
