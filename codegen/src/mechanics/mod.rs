//! The one derivation: Lagrange-d'Alembert equations on a Lie algebroid, from a [`ReducedSystem`] to [`Equations`].
//!
//! Deliberately does not know: where the algebroid came from (Euler-Poincare, bundle, advection, stages), parameters
//! fixed or not, programs, Rust.
//!
//! [`ReducedSystem`]: crate::reduction::ReducedSystem

mod derive;
mod ignorable;
mod sections;
mod solve;
mod squares;
mod vertical;

pub(crate) use derive::solved_velocity;
pub use derive::{Equations, Facts, Output, OutputKind, StateEquation, derive};
pub use solve::{Factorisation, Pivot, PivotMatrix, PivotOrigin};
pub(crate) use vertical::unused_stem;
pub use vertical::{VerticalEquation, VerticalEquations};
