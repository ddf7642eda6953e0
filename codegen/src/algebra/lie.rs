//! Finite-dimensional Lie algebras by rational structure constants.
//!
//! Deliberately does not know: representations, algebras by name.

use std::collections::BTreeMap;

use num_traits::Zero;

use super::matrix::Matrix;
use crate::error::{Error, spell_vector};
use crate::expr::Rational;

/// A block of consecutive basis elements that one velocity vector names, such as the rotation part of se(3).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// What the block is, such as `so(3)` or `R^3`.
    pub name: String,
    /// Number of basis elements.
    pub dim: usize,
}

/// `[e_a, e_b] = sum_k q_k e_{c_k}` as `(a, b, [(c_k, q_k), ..])`.
pub type Bracket = (usize, usize, Vec<(usize, Rational)>);

/// A Lie algebra `[e_a, e_b] = C^c_ab e_c` with verified antisymmetry and Jacobi identity.
///
/// ```
/// use hamel_codegen::{algebra::LieAlgebra, expr::Rational};
/// let so3 = LieAlgebra::so(3).unwrap();
/// assert_eq!(so3.structure_constant(2, 0, 1), Rational::from_integer(1.into())); // [e1, e2] = e3
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LieAlgebra {
    pub(super) name: String,
    pub(super) blocks: Vec<Block>,
    pub(super) basis: Vec<String>,
    /// Non-zero brackets of pairs `a < b`, as sparse sorted vectors.
    pub(super) brackets: BTreeMap<(usize, usize), Vec<(usize, Rational)>>,
}

impl LieAlgebra {
    /// An algebra from the brackets of its basis; pairs that are left out commute.
    ///
    /// # Errors
    /// All of [`Error::NotAntisymmetric`]; when there are none, all of [`Error::JacobiViolated`] naming the triple.
    pub fn from_brackets(
        name: &str,
        basis: Vec<String>,
        brackets: &[Bracket],
    ) -> Result<LieAlgebra, Vec<Error>> {
        let blocks = vec![Block { name: name.to_owned(), dim: basis.len() }];
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
        brackets: &[Bracket],
    ) -> Result<LieAlgebra, Vec<Error>> {
        let covered: usize = blocks.iter().map(|s| s.dim).sum();
        if covered != basis.len() {
            let what = format!("blocks of {name}");
            return Err(vec![Error::ShapeMismatch { what, found: covered, expected: basis.len() }]);
        }
        let mut errors = Vec::new();
        let mut table: BTreeMap<(usize, usize), Vec<(usize, Rational)>> = BTreeMap::new();
        for (a, b, value) in brackets {
            let mut dense = vec![Rational::zero(); basis.len()];
            for (c, q) in value {
                dense[*c] += q;
            }
            if a > b {
                dense.iter_mut().for_each(|q| *q = -q.clone());
            }
            let sparse: Vec<_> = dense.into_iter().enumerate().filter(|(_, q)| !q.is_zero()).collect();
            let pair = (*a.min(b), *a.max(b));
            let clash = match table.get(&pair) {
                Some(before) => *before != sparse,
                None => a == b && !sparse.is_empty(),
            };
            if clash {
                errors.push(Error::NotAntisymmetric { a: basis[*a].clone(), b: basis[*b].clone() });
            } else if a != b {
                table.insert(pair, sparse);
            }
        }
        table.retain(|_, v| !v.is_empty());
        let algebra = LieAlgebra { name: name.to_owned(), blocks, basis, brackets: table };
        // Of a table that is no bracket the Jacobi identity says nothing.
        if errors.is_empty() {
            errors = algebra.jacobi_violations();
        }
        if errors.is_empty() { Ok(algebra) } else { Err(errors) }
    }

    /// `[[a, b], c] + [[b, c], a] + [[c, a], b]` is antisymmetric in the triple, so every non-zero `[a, b]` adds its
    /// part to the sorted triple with a sign; triples that no bracket touches cost nothing.
    fn jacobi_violations(&self) -> Vec<Error> {
        let mut residuals: BTreeMap<[usize; 3], BTreeMap<usize, Rational>> = BTreeMap::new();
        for (a, b, value) in self.brackets() {
            for c in (0..self.dim()).filter(|c| *c != a && *c != b) {
                let (triple, negative) = match () {
                    () if c > b => ([a, b, c], false),
                    () if c > a => ([a, c, b], true),
                    () => ([c, a, b], false),
                };
                for (d, q) in value {
                    for (e, p) in self.bracket(*d, c) {
                        let term = if negative { -(q * p) } else { q * p };
                        *residuals.entry(triple).or_default().entry(e).or_insert_with(Rational::zero) += term;
                    }
                }
            }
        }
        residuals
            .into_iter()
            .filter(|(_, residual)| residual.values().any(|q| !q.is_zero()))
            .map(|(triple, residual)| {
                let mut dense = vec![Rational::zero(); self.dim()];
                residual.into_iter().for_each(|(e, q)| dense[e] = q);
                Error::JacobiViolated {
                    triple: triple.map(|k| self.basis[k].clone()),
                    residual: spell_vector(&self.basis, &dense),
                }
            })
            .collect()
    }

    /// The algebra under another name.
    pub fn renamed(mut self, name: &str) -> LieAlgebra {
        self.name = name.to_owned();
        self
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The dimension.
    pub fn dim(&self) -> usize {
        self.basis.len()
    }

    /// The blocks, in basis order.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// Names of the basis elements.
    pub fn basis(&self) -> &[String] {
        &self.basis
    }

    /// `[e_a, e_b]` as a sparse vector.
    pub fn bracket(&self, a: usize, b: usize) -> Vec<(usize, Rational)> {
        if a <= b {
            self.brackets.get(&(a, b)).cloned().unwrap_or_default()
        } else {
            self.bracket(b, a).into_iter().map(|(c, q)| (c, -q)).collect()
        }
    }

    /// The non-zero brackets of pairs `a < b`.
    pub fn brackets(&self) -> impl Iterator<Item = (usize, usize, &[(usize, Rational)])> {
        self.brackets.iter().map(|((a, b), v)| (*a, *b, v.as_slice()))
    }

    /// `C^c_ab`.
    pub fn structure_constant(&self, c: usize, a: usize, b: usize) -> Rational {
        self.bracket(a, b).into_iter().find(|(d, _)| *d == c).map_or_else(Rational::zero, |(_, q)| q)
    }

    /// `[x, y]` of two vectors.
    pub fn bracket_of(&self, x: &[Rational], y: &[Rational]) -> Vec<Rational> {
        let mut result = vec![Rational::zero(); self.dim()];
        for (a, b, value) in self.brackets() {
            if (x[a].is_zero() || y[b].is_zero()) && (x[b].is_zero() || y[a].is_zero()) {
                continue;
            }
            let weight = &x[a] * &y[b] - &x[b] * &y[a];
            if weight.is_zero() {
                continue;
            }
            for (c, q) in value {
                result[*c] += &weight * q;
            }
        }
        result
    }

    /// Matrix of `ad_{e_a}`: column `b` is `[e_a, e_b]`.
    pub fn ad(&self, a: usize) -> Matrix {
        let n = self.dim();
        let mut m = Matrix::zeros(n, n);
        for b in 0..n {
            for (c, q) in self.bracket(a, b) {
                m.set(c, b, q);
            }
        }
        m
    }

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
        Ok(LieAlgebra { brackets, ..self.clone() })
    }
}
