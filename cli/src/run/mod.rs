//! Scenes that are evaluated and integrated.
//!
//! Does not know: how a request was written, how results are shown.

pub mod admissible;
pub mod asked;
pub mod auto;
pub mod bars;
pub mod choice;
pub mod direction;
pub mod dynamics;
pub mod ensemble;
pub mod evaluate;
mod events;
pub mod fit;
pub mod follow;
pub mod forms;
pub mod info;
pub mod inputs;
mod inside;
pub mod integrate;
pub mod interpreted;
mod least_squares;
pub mod length;
mod lost_rank;
mod machine;
pub mod matrices;
pub mod method;
pub(crate) mod ranks;
mod record;
pub mod resources;
mod saltation;
mod sensitivity;
pub mod simulation;
mod solver;
pub mod start;
pub(crate) mod statistics;
mod stored;
mod verdict;
pub mod watched;

pub use record::energy_scale;
