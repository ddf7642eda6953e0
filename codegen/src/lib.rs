//! hamel-codegen
pub mod algebra;
pub mod error;
pub mod expr;
