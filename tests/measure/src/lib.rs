//! Scalars that know their rounding error, and reproducible random numbers: what tests and `cargo xtask stress` share.
//!
//! Deliberately does not know: models, and the generator. It compiles in a moment.

pub mod both;
pub mod random;
pub mod tracked;
