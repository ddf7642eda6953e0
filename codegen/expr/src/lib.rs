//! Symbolic core: a hash-consed graph of exact expressions.
//!
//! Nodes are canonical by construction (flattened, sorted, merged, folded), coefficients and exponents are exact
//! rationals, and every node carries fingerprints modulo a large prime, so that zeros are found and never rounded to.
//! An expression that does not vanish is proved not to, or said to be unknown. The operands of a node precede the node
//! in the arena: every traversal is a loop over ascending ids, and no depth of a graph can overflow the stack.
//!
//! Deliberately does not know: algebras, mechanics, floating-point evaluation order, Rust.

pub mod differentiate;
pub mod error;
pub mod parallel;
pub mod trace;

mod arena;
mod budget;
mod calculus;
mod construct;
mod definition;
mod expand;
mod extension;
mod factors;
mod field;
mod fingerprint;
mod fraction;
mod graph;
mod hessian;
mod independence;
mod knowledge;
mod node;
mod number;
mod number_value;
mod partials;
mod polynomial;
mod primitive;
mod print;
mod random;
mod rational;
mod real_point;
mod relations;
mod samples;
mod shared;
mod sign;
mod trials;
mod without_value;
mod zero;

pub use budget::{Budget, Exhausted, Resource, Stage};
pub use calculus::Partials;
pub use definition::{Definition, Section, SectionWriter, inlined, needed_sections};
pub use fraction::Fractions;
pub use graph::{DivisionByZero, Graph};
pub use hessian::ValueMatrix;
pub use knowledge::Fingerprint;
pub use knowledge::Vanishing;
pub use node::{ExprId, Func, Node, SymbolId};
pub use number::{Number, Residue, Scalar};
pub use polynomial::{Division, Polynomial, Powers};
pub use primitive::primitive;
pub use print::Style;
pub use print::{SPELLED, identifier};
pub use random::{split_mix, uniform};
pub use rational::{Rational, parse_decimal, rational_to_f64};
pub use real_point::RealValues;
pub use relations::rational_relations;
pub use samples::{Measured, Samples};
pub use sign::remembered_sign_of;
pub use sign::{Relation, Sign, sign_of};
pub use trials::{Trials, Workspace};

pub use zero::independent_rows;

#[cfg(test)]
mod tests;
#[cfg(test)]
mod zero_tests;
