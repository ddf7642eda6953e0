//! From a checked model of hamel to its equations of motion.
//!
//! [`reduction`] reduces a model to a Lie algebroid with Lagrangian, constraint and force; [`mechanics`] derives
//! equations, brackets, momenta, invariants and phases on it.
//!
//! Deliberately does not know: programs, scenes, Rust code.

pub mod mechanics;
pub mod reduction;
