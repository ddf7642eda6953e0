//! What the property and identity tests share: exact oracles, random algebras, random systems.
//!
//! Nothing here is used by the generator; the oracles are written from the formulas, not from its code.

pub mod algebras;
pub mod draws;
pub mod linear;
pub mod problem;
pub mod reference;
pub mod tracked;
