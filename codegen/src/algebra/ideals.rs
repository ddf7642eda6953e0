//! Chains of ideals `g = n_0 > n_1 > ..`, verified step by step.
//!
//! Deliberately does not know: inner products, what a chain is used for.

use num_traits::{One, Zero};

use crate::error::{Error, spell_vector};
use crate::expr::Rational;

use super::lie::LieAlgebra;
use super::matrix::{Matrix, Subspace};

/// One step of a chain by its name, with vectors that span it.
pub(crate) type Step<'a> = (&'a str, &'a [Vec<Rational>]);

/// The basis of the whole algebra, which begins a chain.
pub(crate) fn whole_algebra(algebra: &LieAlgebra) -> Vec<Vec<Rational>> {
    let n = algebra.dim();
    let entry = |i: usize, k: usize| if i == k { Rational::one() } else { Rational::zero() };
    (0..n).map(|k| (0..n).map(|i| entry(i, k)).collect()).collect()
}

/// A basis of the next step of a chain: it lies in the step above, is smaller, is not zero, and `[above, next]` lies in
/// it. Messages spell vectors in `basis`.
///
/// # Errors
/// [`Error::ShapeMismatch`], [`Error::NotNested`], [`Error::EmptyStage`], [`Error::NotAnIdeal`] with the offending
/// pair.
pub(crate) fn next_ideal(
    algebra: &LieAlgebra,
    basis: &[String],
    (above_name, above): Step<'_>,
    (name, spanning): Step<'_>,
) -> Result<Vec<Vec<Rational>>, Error> {
    let n = algebra.dim();
    if let Some(bad) = spanning.iter().find(|v| v.len() != n) {
        let what = format!("vector spanning stage {name}");
        return Err(Error::ShapeMismatch { what, found: bad.len(), expected: n });
    }
    let empty = || Error::EmptyStage { stage: name.to_owned() };
    let ideal = independent_vectors(spanning);
    let (outer, inner) = Subspace::new(above).zip(Subspace::new(&ideal)).ok_or_else(empty)?;
    if ideal.iter().any(|v| !outer.contains(v)) {
        return Err(Error::NotNested { stage: name.to_owned(), above: above_name.to_owned() });
    }
    if ideal.is_empty() || inner.dim() == outer.dim() {
        return Err(empty());
    }
    for x in above {
        for y in &ideal {
            let bracket = algebra.bracket_of(x, y);
            if !inner.contains(&bracket) {
                let spell = |v: &[Rational]| spell_vector(basis, v);
                return Err(Error::NotAnIdeal {
                    stage: name.to_owned(),
                    above: above_name.to_owned(),
                    pair: [spell(x), spell(y)],
                    bracket: spell(&bracket),
                });
            }
        }
    }
    Ok(ideal)
}

/// The first vectors of a list that are linearly independent of those before.
pub(crate) fn independent_vectors(vectors: &[Vec<Rational>]) -> Vec<Vec<Rational>> {
    let columns = Matrix::from_rows(vectors).map(|m| m.transposed());
    let Some(columns) = columns.filter(|m| m.n_rows() > 0) else { return Vec::new() };
    columns.echelon().1.into_iter().map(|k| vectors[k].clone()).collect()
}
