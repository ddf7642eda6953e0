//! Mechanics in redundant coordinates, without symmetry, reduction or frames, for checks of models.

pub mod bodies;
mod check;
mod motion;
mod parameters;

pub use check::{Compared, check};
pub use motion::{Motion, Unreduced, Variables, random_motion};
pub use parameters::Parameters;
