//! Models from Rust, and every check that does not concern text.
//!
//! Deliberately does not know: syntax, equations of motion.

mod advected;
mod build;
mod connection;
mod constraints;
mod draft;
mod dynamics;
mod outputs;
mod params;
mod reconstruct;
mod scenes;
mod stages;
mod symbols;
mod variables;
mod view;

pub(super) use draft::DeclaredAs;
pub use draft::ModelBuilder;
pub use view::Placement;
