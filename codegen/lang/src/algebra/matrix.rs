//! Exact linear algebra of numbers.
//!
//! Deliberately does not know: expressions, whose elimination is in [`super::tableau`].

use hamel_expr::{Rational, Scalar};

/// Dense matrix of exact numbers, row-major.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matrix<Q = Rational> {
    n_rows: usize,
    n_columns: usize,
    entries: Vec<Q>,
}

impl<Q: Scalar> Matrix<Q> {
    /// The zero matrix.
    pub fn zeros(n_rows: usize, n_columns: usize) -> Matrix<Q> {
        Matrix { n_rows, n_columns, entries: vec![Q::zero(); n_rows * n_columns] }
    }

    /// The identity.
    pub fn identity(n: usize) -> Matrix<Q> {
        let mut m = Matrix::zeros(n, n);
        for k in 0..n {
            m.set(k, k, Q::one());
        }
        m
    }

    /// A matrix from its rows, which must have equal lengths.
    pub fn from_rows(rows: &[Vec<Q>]) -> Option<Matrix<Q>> {
        let n_columns = rows.first().map_or(0, Vec::len);
        rows.iter().all(|r| r.len() == n_columns).then(|| Matrix {
            n_rows: rows.len(),
            n_columns,
            entries: rows.concat(),
        })
    }

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.n_rows
    }

    /// Number of columns.
    pub fn n_columns(&self) -> usize {
        self.n_columns
    }

    /// Entry in row `i`, column `j`, from zero.
    pub fn get(&self, i: usize, j: usize) -> &Q {
        &self.entries[i * self.n_columns + j]
    }

    /// Sets an entry.
    pub fn set(&mut self, i: usize, j: usize, value: Q) {
        self.entries[i * self.n_columns + j] = value;
    }

    /// A row.
    pub fn row(&self, i: usize) -> &[Q] {
        &self.entries[i * self.n_columns..(i + 1) * self.n_columns]
    }

    /// The transpose.
    pub fn transposed(&self) -> Matrix<Q> {
        let mut m = Matrix::zeros(self.n_columns, self.n_rows);
        for i in 0..self.n_rows {
            for j in 0..self.n_columns {
                m.set(j, i, self.get(i, j).clone());
            }
        }
        m
    }

    /// `self * other`.
    ///
    /// # Panics
    /// When the inner sizes differ.
    pub fn times(&self, other: &Matrix<Q>) -> Matrix<Q> {
        assert_eq!(self.n_columns, other.n_rows, "inner sizes of a matrix product agree");
        let mut m = Matrix::<Q>::zeros(self.n_rows, other.n_columns);
        for i in 0..self.n_rows {
            for k in 0..self.n_columns {
                let a = self.get(i, k);
                if a.is_zero() {
                    continue;
                }
                for j in 0..other.n_columns {
                    let sum = m.get(i, j).plus(&a.times(other.get(k, j)));
                    m.set(i, j, sum);
                }
            }
        }
        m
    }

    /// `self - other`, entry by entry.
    ///
    /// # Panics
    /// When the shapes differ.
    pub fn minus(&self, other: &Matrix<Q>) -> Matrix<Q> {
        assert_eq!((self.n_rows, self.n_columns), (other.n_rows, other.n_columns), "shapes agree");
        let entries = self.entries.iter().zip(&other.entries).map(|(a, b)| a.minus(b)).collect();
        Matrix { n_rows: self.n_rows, n_columns: self.n_columns, entries }
    }

    /// `q * self`.
    pub fn scaled(&self, q: &Q) -> Matrix<Q> {
        let entries = self.entries.iter().map(|e| e.times(q)).collect();
        Matrix { entries, ..self.clone() }
    }

    /// Whether every entry vanishes.
    pub fn is_zero(&self) -> bool {
        self.entries.iter().all(Q::is_zero)
    }

    /// The matrix with every entry mapped.
    pub fn map<P>(&self, f: impl FnMut(&Q) -> P) -> Matrix<P> {
        let entries = self.entries.iter().map(f).collect();
        Matrix { n_rows: self.n_rows, n_columns: self.n_columns, entries }
    }
}

impl Matrix {
    /// Reduced row echelon form and the pivot columns.
    pub fn echelon(&self) -> (Matrix, Vec<usize>) {
        let mut m = self.clone();
        let mut pivots = Vec::new();
        let mut row = 0;
        for column in 0..m.n_columns {
            let Some(found) = (row..m.n_rows).find(|i| !m.get(*i, column).is_zero()) else { continue };
            for j in 0..m.n_columns {
                m.entries.swap(found * m.n_columns + j, row * m.n_columns + j);
            }
            let pivot = m.get(row, column).recip();
            let support: Vec<usize> = (column..m.n_columns).filter(|j| !m.get(row, *j).is_zero()).collect();
            for j in &support {
                let scaled = m.get(row, *j) * &pivot;
                m.set(row, *j, scaled);
            }
            for i in (0..m.n_rows).filter(|i| *i != row) {
                let factor = m.get(i, column).clone();
                if factor.is_zero() {
                    continue;
                }
                for j in &support {
                    let reduced = m.get(i, *j) - &factor * m.get(row, *j);
                    m.set(i, *j, reduced);
                }
            }
            pivots.push(column);
            row += 1;
            if row == m.n_rows {
                break;
            }
        }
        (m, pivots)
    }

    /// The rank.
    pub fn rank(&self) -> usize {
        self.echelon().1.len()
    }

    /// The inverse of a square matrix, or `None` when it is singular.
    pub fn inverse(&self) -> Option<Matrix> {
        let n = self.n_rows;
        let mut wide = Matrix::zeros(n, 2 * n);
        for i in 0..n {
            for j in 0..n {
                wide.set(i, j, self.get(i, j).clone());
            }
            wide.set(i, n + i, <Rational as Scalar>::one());
        }
        let (reduced, pivots) = wide.echelon();
        if pivots != (0..n).collect::<Vec<_>>() {
            return None;
        }
        let mut inverse = Matrix::zeros(n, n);
        for i in 0..n {
            for j in 0..n {
                inverse.set(i, j, reduced.get(i, n + j).clone());
            }
        }
        Some(inverse)
    }
}

/// A span of vectors, for membership tests.
pub(crate) struct Subspace {
    /// Reduced row echelon form: each row by its pivot and what else does not vanish in it.
    rows: Vec<(usize, Vec<(usize, Rational)>)>,
}

impl Subspace {
    /// The span of vectors; none when their sizes differ.
    pub(crate) fn new(vectors: &[Vec<Rational>]) -> Option<Subspace> {
        let (rows, pivots) = Matrix::from_rows(vectors)?.echelon();
        let sparse = |row: usize| {
            let entries = rows.row(row).iter().enumerate().filter(|(_, q)| !q.is_zero());
            entries.map(|(j, q)| (j, q.clone())).collect()
        };
        Some(Subspace { rows: pivots.into_iter().enumerate().map(|(k, pivot)| (pivot, sparse(k))).collect() })
    }

    pub(crate) fn contains(&self, vector: &[Rational]) -> bool {
        let mut rest = vector.to_vec();
        for (pivot, row) in &self.rows {
            // The pivot itself is one.
            let factor = rest[*pivot].clone();
            if !factor.is_zero() {
                row.iter().for_each(|(j, q)| rest[*j] -= &factor * q);
            }
        }
        rest.iter().all(Scalar::is_zero)
    }
}
