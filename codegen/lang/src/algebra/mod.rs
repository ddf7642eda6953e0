//! Lie algebras, representations and Lie algebroids as exact data.
//!
//! Lie algebras are skew brackets for which the Jacobi identity holds, with structure constants that are rational or
//! numbers in closed form; an almost algebra is not asked for that identity. A Lie algebroid has an anchor and a
//! bracket whose coefficients are expressions on its base. Antisymmetry, Jacobi, the representation property and the
//! anchor condition are verified exactly and the offending elements are named.
//!
//! Deliberately does not know: Lagrangians, constraints, state vectors, text files.

mod algebroid;
mod circle;
mod families;
mod flows;
mod functions;
mod harmonics;
mod ideals;
mod lie;
mod matrix;
mod modes;
mod named;
mod products;
mod representation;
pub mod series;
mod skew;
pub mod tableau;

pub use algebroid::Algebroid;
pub use circle::CircleModes;
pub use functions::Functions;
pub use harmonics::Harmonics;
pub use ideals::{independent_vectors, lies_in, next_ideal, whole_algebra};
pub use lie::{Block, LieAlgebra};
pub use matrix::Matrix;
pub use modes::Modes;
pub use representation::Representation;
pub use skew::{Bracket, SkewBracket};
pub use tableau::{
    determinant_of, solve_by_cofactors, solve_over_determinant, solve_symbolic, solve_symmetric,
};

#[cfg(test)]
mod tests;
