//! Representations of Lie algebras by matrices.

use hamel_expr::error::Error;
use hamel_expr::{Number, Rational, Scalar};

use super::families::defining_matrices;
use super::lie::LieAlgebra;
use super::matrix::Matrix;

/// Matrices `rho(e_a)` with `rho([e_a, e_b]) = rho(e_a) rho(e_b) - rho(e_b) rho(e_a)`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Representation<Q = Rational> {
    name: String,
    dim: usize,
    matrices: Vec<Matrix<Q>>,
    labels: Vec<String>,
}

impl<Q: Scalar> Representation<Q> {
    /// A representation by given matrices, one per basis element.
    ///
    /// # Errors
    /// [`Error::ShapeMismatch`], or [`Error::NotARepresentation`] naming the pair and the entry.
    pub fn from_matrices(
        name: &str,
        algebra: &LieAlgebra<Q>,
        matrices: Vec<Matrix<Q>>,
    ) -> Result<Representation<Q>, Error> {
        let expected = algebra.dim();
        if matrices.len() != expected {
            let what = format!("representation {name}");
            return Err(Error::ShapeMismatch { what, found: matrices.len(), expected });
        }
        let dim = matrices.first().map_or(0, Matrix::n_rows);
        for (m, element) in matrices.iter().zip(algebra.basis()) {
            let bad = [m.n_rows(), m.n_columns()].into_iter().find(|n| *n != dim);
            if let Some(found) = bad {
                let what = format!("matrix of {element} in {name}");
                return Err(Error::ShapeMismatch { what, found, expected: dim });
            }
        }
        let representation = Representation { name: name.to_owned(), dim, matrices, labels: Vec::new() };
        representation.verify(algebra)?;
        Ok(representation)
    }

    /// A representation that is known to be one.
    pub(super) fn unverified(
        name: &str,
        dim: usize,
        matrices: Vec<Matrix<Q>>,
        labels: Vec<String>,
    ) -> Representation<Q> {
        Representation { name: name.to_owned(), dim, matrices, labels }
    }

    fn verify(&self, algebra: &LieAlgebra<Q>) -> Result<(), Error> {
        for a in 0..algebra.dim() {
            for b in a + 1..algebra.dim() {
                let (ma, mb) = (&self.matrices[a], &self.matrices[b]);
                let mut residual =
                    Matrix::zeros(self.dim, self.dim).minus(&ma.times(mb).minus(&mb.times(ma)));
                for (c, q) in algebra.bracket(a, b) {
                    for i in 0..self.dim {
                        for j in 0..self.dim {
                            let sum = residual.get(i, j).plus(&q.times(self.matrices[c].get(i, j)));
                            residual.set(i, j, sum);
                        }
                    }
                }
                let entries = (0..self.dim).flat_map(|i| (0..self.dim).map(move |j| (i, j)));
                if let Some((i, j)) = entries.into_iter().find(|(i, j)| !residual.get(*i, *j).is_zero()) {
                    return Err(Error::NotARepresentation {
                        pair: [a, b].map(|k| algebra.basis()[k].clone()),
                        entry: (i + 1, j + 1),
                        residual: {
                            let (negative, size) = residual.get(i, j).spelled();
                            if negative { format!("-{size}") } else { size }
                        },
                    });
                }
            }
        }
        Ok(())
    }

    /// The adjoint representation `x -> [e_a, x]`.
    pub fn adjoint(algebra: &LieAlgebra<Q>) -> Representation<Q> {
        let matrices = (0..algebra.dim()).map(|a| algebra.ad(a)).collect();
        let labels = algebra.blocks().iter().flat_map(|block| block.labels.clone()).collect();
        Representation { name: "adjoint".into(), dim: algebra.dim(), matrices, labels }
    }

    /// The coadjoint representation, dual of the adjoint one.
    pub fn coadjoint(algebra: &LieAlgebra<Q>) -> Representation<Q> {
        let mut r = Representation::adjoint(algebra).dual();
        r.name = "coadjoint".into();
        r
    }

    /// The dual representation `-rho(e_a)^T`.
    pub fn dual(&self) -> Representation<Q> {
        let zero = Matrix::zeros(self.dim, self.dim);
        let matrices = self.matrices.iter().map(|m| zero.minus(&m.transposed())).collect();
        let labels = self.labels.clone();
        Representation { name: format!("dual({})", self.name), dim: self.dim, matrices, labels }
    }

    /// The trivial representation on R^n.
    pub fn trivial(algebra: &LieAlgebra<Q>, n: usize) -> Representation<Q> {
        let matrices = vec![Matrix::zeros(n, n); algebra.dim()];
        Representation { name: format!("trivial({n})"), dim: n, matrices, labels: Vec::new() }
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Dimension of the space acted on.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// Number of matrices, the dimension of the algebra.
    pub fn n_generators(&self) -> usize {
        self.matrices.len()
    }

    /// `rho(e_a)`.
    pub fn matrix(&self, a: usize) -> &Matrix<Q> {
        &self.matrices[a]
    }

    /// Names of the components of a vector of the space, where they have other ones than numbers.
    pub fn labels(&self) -> &[String] {
        &self.labels
    }

    /// `rho(e_a) v`.
    pub fn act(&self, a: usize, v: &[Q]) -> Vec<Q> {
        (0..self.dim)
            .map(|i| {
                self.matrices[a].row(i).iter().zip(v).fold(Q::zero(), |sum, (m, x)| sum.plus(&m.times(x)))
            })
            .collect()
    }
}

impl Representation {
    /// The representation `-rho` of an abelian algebra: that of so(2) then turns counter-clockwise.
    ///
    /// # Errors
    /// [`Error::NotARepresentation`] where the algebra is not abelian.
    pub fn reversed(&self, algebra: &LieAlgebra) -> Result<Representation, Error> {
        let zero = Matrix::zeros(self.dim, self.dim);
        let matrices = self.matrices.iter().map(|m| zero.minus(m)).collect();
        Representation::from_matrices(&self.name, algebra, matrices)
    }
}

impl From<Representation> for Representation<Number> {
    fn from(own: Representation) -> Representation<Number> {
        let matrices = own.matrices.iter().map(|m| m.map(|q| q.clone().into())).collect();
        Representation { name: own.name, dim: own.dim, matrices, labels: own.labels }
    }
}

impl Representation {
    /// The defining representation of so(n), gl(n) or sl(n) on R^n; `None` for other algebras.
    pub fn standard<P: Scalar>(algebra: &LieAlgebra<P>) -> Option<Representation> {
        let matrices = defining_matrices(algebra.name())?;
        let dim = matrices.first().map_or(0, Matrix::n_rows);
        Some(Representation { name: "standard".into(), dim, matrices, labels: Vec::new() })
    }
}
