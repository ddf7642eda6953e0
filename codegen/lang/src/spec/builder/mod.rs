//! Models from Rust, and every check that does not concern text.
//!
//! Deliberately does not know: syntax, equations of motion.

mod advected;
mod algebroid;
mod applied;
mod build;
mod centroid;
mod configuration;
mod connection;
mod constraints;
mod draft;
mod dynamics;
mod event_drafts;
mod events;
mod feedback_drafts;
mod first_order;
mod frame;
mod given;
mod inputs;
mod lyapunov;
mod modes;
mod momenta;
mod named_frames;
mod noise;
mod outputs;
mod params;
mod positions;
mod reconstruct;
mod scenes;
mod sections;
mod sizes;
mod stages;
mod symbols;
mod thermo;
mod totals;
mod variables;
mod view;

pub(super) use algebroid::SectionBracket;
pub use draft::ModelBuilder;
pub(super) use draft::{BodyDraft, CarryDraft, DeclaredAs, FrameMotion, NamedFrameDraft};
pub(super) use event_drafts::{EventSet, ModeAct};
pub(in crate::spec) use view::FIELD;
pub use view::Placement;
