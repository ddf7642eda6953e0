//! hamel-codegen
pub mod algebra;
pub mod error;
pub mod expr;
pub mod mechanics;
pub mod reduction;
pub mod spec;
