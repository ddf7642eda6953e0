//! Elimination of unknowns from linear equations over expressions, written once.
//!
//! A [`Tableau`] has rows of equations, columns of unknowns and further columns of right-hand sides; a
//! [`QuadraticForm`] is the symmetric tableau of a least value, of which each entry stands once. Every elimination of
//! the generator is an order of steps of these two:
//!
//! | elimination | tableau | step | order |
//! |---|---|---|---|
//! | dense systems, inverses | rows | [`Tableau::eliminate`] | column by column, the best row, [`solve_symbolic`] |
//! | saddle points | rows | [`Tableau::eliminate`] | down the diagonal, [`solve_symmetric`] |
//! | linear constraints, virtual displacements | rows | [`Tableau::eliminate`] | the best cell, or as the model says |
//! | blocks that divide by their determinant alone | rows | [`Tableau::eliminate_together`] | a few rows at once |
//! | constraints on accelerations | rows | [`Tableau::cross_out`] | column by column, without a division |
//! | Guyan's condensation, composite bodies | form | [`QuadraticForm::substitute`] | those of the fewest operations |
//! | articulated bodies | form | [`QuadraticForm::least`] | the last body first |
//!
//! What is divided by is graded in one place: [`Judge::grade`].
//!
//! Deliberately does not know: where equations come from, what their unknowns are, which order costs least.

mod cofactors;
mod form;
mod grade;
mod rows;
mod solve;

pub use cofactors::{MAX_COFACTORS, MAX_DETERMINANT, Numbers, Ring, adjugate, determinant};
pub use form::{Least, Pen, QuadraticForm, Slopes};
pub use grade::{Grade, Judge, Known};
pub use rows::{Cell, Tableau, Tie};
pub use solve::{
    determinant_of, solve_by_cofactors, solve_over_determinant, solve_symbolic, solve_symmetric,
};

#[cfg(test)]
mod tests;
