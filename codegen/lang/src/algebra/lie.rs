//! Finite-dimensional Lie algebras by structure constants.
//!
//! Deliberately does not know: representations, algebras by name.

use std::collections::BTreeMap;

use super::functions::Functions;
use super::matrix::Matrix;
use super::skew::{Bracket, SkewBracket};
use hamel_expr::error::Error;
use hamel_expr::{Number, Rational, Scalar};

/// A block of consecutive basis elements that one velocity vector names, such as the rotation part of se(3).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// What the block is, such as `so(3)` or `R^3`.
    pub name: String,
    /// Number of basis elements.
    pub dim: usize,
    /// Names of the components of a vector of the block, beside its own, where they have other ones than numbers.
    pub labels: Vec<String>,
}

impl Block {
    /// A block whose components are numbered.
    pub fn new(name: &str, dim: usize) -> Block {
        Block { name: name.to_owned(), dim, labels: Vec::new() }
    }
}

/// A Lie algebra `[e_a, e_b] = C^c_ab e_c` with verified antisymmetry and Jacobi identity, or an almost algebra, which
/// is not asked for the latter.
///
/// Structure constants are rational, or [numbers in closed form](Number).
///
/// ```
/// use hamel_expr::Rational;
/// use hamel_lang::algebra::LieAlgebra;
/// let so3 = LieAlgebra::so(3).unwrap();
/// assert_eq!(so3.structure_constant(2, 0, 1), Rational::from_integer(1.into())); // [e1, e2] = e3
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LieAlgebra<Q = Rational> {
    pub(super) name: String,
    pub(super) blocks: Vec<Block>,
    pub(super) bracket: SkewBracket<Q>,
    pub(super) is_almost: bool,
    pub(super) functions: Option<Functions>,
}

impl<Q: Scalar> LieAlgebra<Q> {
    /// An algebra from the brackets of its basis; pairs that are left out commute.
    ///
    /// # Errors
    /// All of [`Error::NotAntisymmetric`]; when there are none, all of [`Error::JacobiViolated`] naming the triple.
    pub fn from_brackets(
        name: &str,
        basis: Vec<String>,
        brackets: &[Bracket<Q>],
    ) -> Result<LieAlgebra<Q>, Vec<Error>> {
        let blocks = vec![Block::new(name, basis.len())];
        LieAlgebra::with_blocks(name, blocks, basis, brackets)
    }

    /// [`LieAlgebra::from_brackets`] with a division of the basis into blocks.
    ///
    /// # Errors
    /// As [`LieAlgebra::from_brackets`], and [`Error::ShapeMismatch`] when the blocks do not cover the basis.
    pub fn with_blocks(
        name: &str,
        blocks: Vec<Block>,
        basis: Vec<String>,
        brackets: &[Bracket<Q>],
    ) -> Result<LieAlgebra<Q>, Vec<Error>> {
        let covered: usize = blocks.iter().map(|s| s.dim).sum();
        if covered != basis.len() {
            let what = format!("blocks of {name}");
            return Err(vec![Error::ShapeMismatch { what, found: covered, expected: basis.len() }]);
        }
        let algebra = LieAlgebra { blocks, ..LieAlgebra::almost(name, basis, brackets)? };
        let errors = algebra.bracket.jacobi_violations();
        if errors.is_empty() { Ok(LieAlgebra { is_almost: false, ..algebra }) } else { Err(errors) }
    }

    /// An almost algebra: a skew bracket that is not asked for the Jacobi identity, such as that of a Galerkin
    /// truncation. Energy is conserved by its equations, and Casimirs are not.
    ///
    /// # Errors
    /// All of [`Error::NotAntisymmetric`].
    pub fn almost(
        name: &str,
        basis: Vec<String>,
        brackets: &[Bracket<Q>],
    ) -> Result<LieAlgebra<Q>, Vec<Error>> {
        Ok(LieAlgebra {
            name: name.to_owned(),
            blocks: vec![Block::new(name, basis.len())],
            bracket: SkewBracket::new(basis, brackets)?,
            is_almost: true,
            functions: None,
        })
    }

    /// Names of the basis as the blocks have them, for the components of vectors: those of a block may occur in another
    /// one, too.
    pub fn labels(&self) -> Vec<String> {
        let mut labels = Vec::new();
        for block in &self.blocks {
            let own = &self.basis()[labels.len()..labels.len() + block.dim];
            labels.extend_from_slice(if block.labels.is_empty() { own } else { &block.labels });
        }
        labels
    }

    /// Whether it is an almost algebra, of which the Jacobi identity is not claimed.
    pub fn is_almost(&self) -> bool {
        self.is_almost
    }

    /// The functions that its basis consists of, if it does.
    pub fn functions(&self) -> Option<&Functions> {
        self.functions.as_ref()
    }

    /// The same algebra with every structure constant mapped.
    pub(super) fn map<P>(&self, f: impl FnMut(&Q) -> P) -> LieAlgebra<P>
    where
        P: Scalar,
    {
        LieAlgebra {
            name: self.name.clone(),
            blocks: self.blocks.clone(),
            bracket: self.bracket.map(f),
            is_almost: self.is_almost,
            functions: self.functions.clone(),
        }
    }

    /// The algebra under another name.
    pub fn renamed(mut self, name: &str) -> LieAlgebra<Q> {
        self.name = name.to_owned();
        self
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The dimension.
    pub fn dim(&self) -> usize {
        self.bracket.dim()
    }

    /// The blocks, in basis order.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Names of the basis elements.
    pub fn basis(&self) -> &[String] {
        self.bracket.basis()
    }

    /// `[e_a, e_b]` as a sparse vector.
    pub fn bracket(&self, a: usize, b: usize) -> Vec<(usize, Q)> {
        self.bracket.of(a, b)
    }

    /// The non-zero brackets of pairs `a < b`.
    pub fn brackets(&self) -> impl Iterator<Item = (usize, usize, &[(usize, Q)])> {
        self.bracket.pairs()
    }

    /// `C^c_ab`.
    pub fn structure_constant(&self, c: usize, a: usize, b: usize) -> Q {
        self.bracket(a, b).into_iter().find(|(d, _)| *d == c).map_or_else(Q::zero, |(_, q)| q)
    }

    /// `[x, y]` of two vectors.
    pub fn bracket_of(&self, x: &[Q], y: &[Q]) -> Vec<Q> {
        self.bracket.of_vectors(x, y)
    }

    /// Matrix of `ad_{e_a}`: column `b` is `[e_a, e_b]`.
    pub fn ad(&self, a: usize) -> Matrix<Q> {
        let n = self.dim();
        let mut m = Matrix::zeros(n, n);
        for b in 0..n {
            for (c, q) in self.bracket(a, b) {
                m.set(c, b, q);
            }
        }
        m
    }
}

impl From<LieAlgebra> for LieAlgebra<Number> {
    fn from(algebra: LieAlgebra) -> LieAlgebra<Number> {
        algebra.map(|q| q.clone().into())
    }
}

impl LieAlgebra<Number> {
    /// The algebra with rational structure constants, if they all are.
    pub fn rational(&self) -> Option<LieAlgebra> {
        let is_rational =
            self.brackets().flat_map(|(.., value)| value).all(|(_, q)| q.as_rational().is_some());
        is_rational.then(|| self.map(|q| q.as_rational().unwrap_or_else(Rational::zero)))
    }
}

impl LieAlgebra {
    /// The same algebra in the basis whose elements are the columns of `p`.
    ///
    /// # Errors
    /// [`Error::ShapeMismatch`] when `p` is not square of the algebra's dimension, [`Error::Unsupported`] when it is
    /// singular.
    pub fn change_basis(&self, p: &Matrix) -> Result<LieAlgebra, Error> {
        let n = self.dim();
        if (p.n_rows(), p.n_columns()) != (n, n) {
            let what = "matrix of the change of basis".to_owned();
            return Err(Error::ShapeMismatch { what, found: p.n_rows(), expected: n });
        }
        let inverse = p.inverse().ok_or_else(|| Error::Unsupported {
            what: "a change of basis by a singular matrix".into(),
            possible: "an invertible matrix".into(),
        })?;
        let columns: Vec<Vec<Rational>> = {
            let t = p.transposed();
            (0..n).map(|k| t.row(k).to_vec()).collect()
        };
        let mut brackets = BTreeMap::new();
        for a in 0..n {
            for b in a + 1..n {
                let image = self.bracket_of(&columns[a], &columns[b]);
                let sparse: Vec<(usize, Rational)> = (0..n)
                    .map(|c| (c, inverse.row(c).iter().zip(&image).map(|(x, y)| x * y).sum::<Rational>()))
                    .filter(|(_, q)| !q.is_zero())
                    .collect();
                if !sparse.is_empty() {
                    brackets.insert((a, b), sparse);
                }
            }
        }
        // Jacobi holds in every basis.
        let bracket = SkewBracket { basis: self.basis().to_vec(), brackets };
        Ok(LieAlgebra { bracket, functions: None, ..self.clone() })
    }
}
