//! The command line of hamel: generation of models, and evaluation and simulation of scenes by name.
//!
//! Everything that evaluates a scene does so through [`dynamics::Dynamics`], so that the interpreter here and the
//! compiled models in `hamel-compiled` share one implementation of [`eval`] and [`simulate`].
//!
//! Deliberately does not know: generated code. A broken generated file can always be regenerated, because nothing here
//! depends on it; compiled models are reached through another process ([`compiled`]).

pub mod admissible;
pub mod auto;
pub mod backend;
pub mod bench;
pub mod codegen_bridge;
pub mod commands;
pub mod compiled;
pub mod dynamics;
pub mod ensemble;
pub mod error;
pub mod eval;
pub mod files;
pub mod generate;
pub mod initial;
pub mod json;
pub mod names;
pub mod package;
pub mod plot;
pub mod report;
pub mod simulate;
pub mod stress;
pub mod workspace;

pub use backend::{Backend, Local};
pub use dynamics::{Dynamics, Factory, Info};
pub use error::Error;
