//! Scenes of hamel that are evaluated and integrated: what the command, its Python package and its benchmarks share.
//!
//! Everything that evaluates a scene does so through [`dynamics::Dynamics`], so that scenes that are interpreted and
//! scenes that are compiled in memory share one implementation of every request.
//!
//! Does not know: commands and their arguments, how results are shown.

#![forbid(unsafe_code)]

pub mod admissible;
mod any_method;
pub mod asked;
pub mod auto;
pub mod bars;
pub mod bytes;
pub mod cache;
pub mod choice;
mod constraint_rows;
mod crossing;
pub mod direction;
mod driving;
pub mod dynamics;
mod eigenvalues;
pub mod ensemble;
pub mod equilibria;
pub mod error;
pub mod evaluate;
mod events;
mod extrapolated;
pub mod fit;
pub mod follow;
pub mod forms;
mod guards;
pub mod hash;
pub mod info;
pub mod inputs;
mod inside;
pub mod integrate;
pub mod interpreted;
pub mod interrupts;
mod least_squares;
pub mod length;
pub mod linearize;
mod lost_rank;
mod machine;
pub mod matrices;
pub mod members;
pub mod method;
pub mod model;
pub mod names;
pub mod noise;
mod passing;
pub mod ranks;
mod record;
pub mod repository;
pub mod request;
pub mod resources;
mod runnable;
mod saltation;
mod scale;
mod sensitivity;
pub mod session;
pub mod signs;
pub mod simulation;
mod solver;
pub mod start;
mod state;
pub mod statistics;
pub mod stepper;
mod steps;
mod stored;
pub mod streams;
pub mod temporary;
pub mod watched;
mod wide;

pub use error::Error;
pub use scale::energy_scale;
