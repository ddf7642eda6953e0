//! The format of MuJoCo.
//!
//! # Source
//! mujoco.readthedocs.io/en/stable/XMLreference.html and modeling.html: lengths in m, masses in kg, angles in degrees
//! unless the file says radians.

mod actuators;
mod bodies;
mod equalities;
mod geoms;
mod include;
mod joints;
mod mujoco;
mod settings;

pub(crate) use include::{Source, splice};
pub(crate) use mujoco::read;
