//! Symbolic core: a hash-consed graph of exact expressions.
//!
//! Nodes are canonical by construction (flattened, sorted, merged, folded), coefficients and exponents are exact
//! rationals, and every node carries fingerprints modulo a large prime, so that zeros are found and never rounded to.
//! A node's operands always precede it in the arena; every traversal is a loop over ascending ids and no depth of
//! graph can overflow the stack.
//!
//! Deliberately does not know: algebras, mechanics, floating-point evaluation order, Rust.

mod budget;
mod definition;
mod expand;
mod fingerprint;
mod graph;
mod partials;
mod print;
mod rational;
mod sign;

pub use budget::{Budget, Exhausted, Resource, Stage};
pub use definition::{Definition, Section, SectionWriter, inlined, needed_sections};
pub(crate) use fingerprint::{Fingerprint, independent_rows};
pub use graph::{DivisionByZero, ExprId, Func, Graph, Node, SymbolId};
pub use print::Style;
pub(crate) use print::identifier;
pub use rational::{Rational, parse_decimal, rational_to_f64};
pub(crate) use sign::remembered_sign_of;
pub use sign::{Sign, sign_of};

#[cfg(test)]
mod tests;
