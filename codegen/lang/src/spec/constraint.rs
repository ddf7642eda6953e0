//! Constraints, and what some of them have beside their residual: an equation between positions, an acceleration that
//! the state carries, virtual displacements of their own.
//!
//! Deliberately does not know: models, how constraints are solved.

use super::diagnostic::Span;
use hamel_expr::{ExprId, SymbolId};

/// What a [`Constraint`] restricts, and how.
#[derive(Clone, Debug, PartialEq)]
pub enum ConstraintKind {
    /// Affine in the velocities: `w(x, t) . y + w0(x, t) = 0`; it may contain quasi-velocities.
    Linear,
    /// Not affine in the velocities: `phi(x, y, t) = 0` with virtual displacements `dphi/dy . delta y = 0` (Chetaev).
    Nonlinear,
    /// Affine in the accelerations: `w(x, y, t) . ydot + w0(x, y, t) = 0`, `w0` being the residual.
    SecondOrder {
        /// `w`: one coefficient per velocity, in the order of [`all_velocities`](super::Model::all_velocities).
        acceleration: Vec<ExprId>,
    },
    /// Affine in the rates of accelerations: `w(x, y, t) . yddot + w0(x, y, ydot, t) = 0`, `w0` being the residual, in
    /// which [`accelerations`](super::Model::accelerations) stand for `ydot`.
    ThirdOrder {
        /// `w`: one coefficient per velocity, in the order of [`all_velocities`](super::Model::all_velocities).
        jerk: Vec<ExprId>,
        /// What the state carries.
        carried: CarriedAcceleration,
    },
}

/// A scalar constraint.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// Given name, or `c1`, `c2`, .. in order.
    pub name: String,
    /// As written.
    pub text: String,
    /// Whether it restricts velocities linearly, velocities, or accelerations.
    pub kind: ConstraintKind,
    /// Left side minus right side, without the highest derivatives; of an equation between positions, its derivative.
    pub residual: ExprId,
    /// What the model says, where that is an equation between positions.
    pub position: Option<PositionEquation>,
    /// The velocity that a linear constraint is solved for, when those of constraints before it are known: its place in
    /// [`all_velocities`](super::Model::all_velocities).
    pub gives: Option<usize>,
    /// The mode that it holds in, by its place among [`modes`](super::Model::modes).
    pub mode: Option<usize>,
    /// Where it stands.
    pub span: Option<Span>,
}

/// An equation `f(x, a, t) = 0` between coordinates and advected parameters, whose derivative is a linear constraint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionEquation {
    /// `f`, left side minus right side.
    pub residual: ExprId,
    /// The base coordinate that the equation gives, with others of its item where they are several; absent where the
    /// equation is a constraint that says nothing about that.
    pub determines: Option<usize>,
}

/// An equation between coordinates that follows from the others of the model, next to a place: it was left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Implied {
    /// As written, with the component of a vector equation.
    pub text: String,
    /// Left side minus right side.
    pub residual: ExprId,
    /// Values of symbols that meet all equations, of coordinates and of entries of configurations that equations
    /// contain: equations may have other branches, where it does not follow.
    pub at: Vec<(SymbolId, f64)>,
    /// Where it stands.
    pub span: Option<Span>,
}

/// The acceleration `s = w . ydot + offset(x, y, t)` along a constraint of third order, whose rate the constraint gives
/// and which is a component of the state.
#[derive(Clone, Debug, PartialEq)]
pub struct CarriedAcceleration {
    /// Its name, `acceleration_` and that of the constraint.
    pub name: String,
    /// Its symbol.
    pub symbol: SymbolId,
    /// Zero in the velocities of the model as written; not zero where another connection changed these.
    pub offset: ExprId,
    /// Documentation.
    pub doc: String,
}

/// A function `V(x, y, t)` with the rate that it has along the motion, which the force of an actuator gives it.
///
/// It is the [constraint](Constraint) of its name on accelerations, and the actuator the
/// [condition](VirtualConstraint) of its name on virtual displacements.
#[derive(Clone, Debug, PartialEq)]
pub struct Lyapunov {
    /// Its name.
    pub name: String,
    /// `V`.
    pub value: ExprId,
    /// `dV/dt`, in which [`response`](Lyapunov::response) may be.
    pub rate: ExprId,
    /// What stands for `d(dV/dt)/du`, with `u` the force of the actuator.
    pub response: SymbolId,
    /// The name of the actuator.
    pub actuator: String,
    /// Where it stands.
    pub span: Option<Span>,
}

/// A scalar condition `f(x, y, ydot, t) . delta y = 0` on virtual displacements;
/// [`accelerations`](super::Model::accelerations) stand for `ydot`.
#[derive(Clone, Debug, PartialEq)]
pub struct VirtualConstraint {
    /// Given name, or `d1`, `d2`, .. in order.
    pub name: String,
    /// As written.
    pub text: String,
    /// `f`: one coefficient per velocity, in the order of [`all_velocities`](super::Model::all_velocities).
    pub one_form: Vec<ExprId>,
    /// The constraint `phi` of this name is a power, `phi = f_a y^a` and what depends on no velocity.
    pub power_of: Option<String>,
    /// The mode that it belongs to, by its place among [`modes`](super::Model::modes).
    pub mode: Option<usize>,
    /// Where it stands.
    pub span: Option<Span>,
}
