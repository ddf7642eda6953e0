//! What the property and identity tests share: exact oracles, random algebras, random systems.
//!
//! Nothing here is used by the generator; the oracles are written from the formulas, not from its code.

pub mod algebras;
pub mod bundle;
pub mod draws;
pub mod errata;
pub mod linear;
pub mod models;
pub mod problem;
pub mod random;
pub mod reference;
pub mod tracked;

/// The heavy top's generated file under `include!`, the other way of using it besides `mod`.
pub mod included {
    include!("../../models/src/generated/heavy_top.rs");
}

/// The examples of the page compile and run.
#[cfg(doctest)]
#[doc = include_str!("../../docs/build-rs.md")]
pub struct BuildScripts;

/// The same for the page on ensembles.
#[cfg(doctest)]
#[doc = include_str!("../../docs/ensembles.md")]
pub struct Ensembles;
