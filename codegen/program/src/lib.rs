//! From named expressions to straight-line code.
//!
//! [`lower`] makes a flat [`program`] of ordered definitions, and [`emit`] writes it as Rust, C, WebAssembly or an FMU.
//!
//! Deliberately does not know: models, algebras, mechanics.

pub mod emit;
pub mod lower;
pub mod program;
