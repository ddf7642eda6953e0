//! The language of hamel: text, or calls of a builder, to a checked model.
//!
//! [`algebra`] has Lie algebras, representations, stages and algebroids over exact numbers; [`spec`] is the language.
//!
//! Deliberately does not know: equations of motion, programs, Rust code.

pub mod algebra;
pub mod spec;
