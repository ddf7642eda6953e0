//! Front ends: from a checked model to one Lie algebroid with Lagrangian, constraint and force.
//!
//! `stages` splits an algebra along a chain of ideals, `constraint` solves the kinematic constraints, and [`reduce`]
//! puts the algebroid of the model together. A new kind of system is a new way to fill in [`ReducedSystem`].
//!
//! Deliberately does not know: equations of motion, programs, text files.

mod circle;
mod connection;
mod constraint;
mod front_end;
mod reconstruction;
mod stages;

pub use circle::{Circle, with_circles};
pub use connection::with_connection;
pub use constraint::{
    AccelerationRow, AccelerationSource, ConstraintRow, KinematicConstraint, Reactions, SolvedConstraint,
    Unknown,
};
pub use front_end::{DomainCondition, ReducedSystem, StateKind, reduce};
pub(crate) use reconstruction::expressions_mut;
pub use reconstruction::{MomentumInSpace, ReconstructedCoordinate};
pub use stages::{StageLevel, Stages, Tensor};
