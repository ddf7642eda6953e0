//! Lagrangians that a symmetry changes by the rate of a function.
//!
//! Deliberately does not know: how the symmetry reduces a motion.

use super::diagnostic::Span;
use hamel_expr::ExprId;

/// A cyclic coordinate or a velocity along which the Lagrangian changes by the rate of `f`, `X L = df/dt`: the constant
/// of the motion is `dL/dy - f`, a parameter.
///
/// # Source
/// Langerock, Cantrijn, Vankerschaver 2010, Routhian reduction for quasi-invariant Lagrangians, J. Math. Phys. 51,
/// 022902.
#[derive(Clone, Debug, PartialEq)]
pub struct QuasiInvariance {
    /// The velocity, by index as in [`Carried`](super::Carried).
    pub velocity: usize,
    /// Name of the parameter.
    pub parameter: String,
    /// `f`, of base coordinates, advected parameters, states of first order, parameters and the time.
    pub function: ExprId,
    /// Where `f` stands.
    pub span: Option<Span>,
}
