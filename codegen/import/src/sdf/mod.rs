//! The Simulation Description Format (SDFormat), of Gazebo.
//!
//! # Source
//! sdformat.org/spec and its pages on the semantics of poses; quantities are in SI units, angles in radians unless the
//! file says degrees.

mod frames;
mod joints;
mod model;

pub(crate) use model::read;
