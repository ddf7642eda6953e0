//! Results for people: files, figures, pages, text on a terminal.
//!
//! Does not know: how anything was computed.

pub mod columns;
pub(crate) mod crossings;
pub(crate) mod families;
pub mod fields;
pub mod files;
pub mod fitted;
pub mod fmu;
pub mod formulations;
pub(crate) mod opened;
mod picture;
pub mod plot;
pub mod report;
pub mod terminal;
pub mod trajectories;
