//! Exact linear algebra of the oracles, written apart from the generator's own.

use hamel_expr::Rational;
use num_traits::{One, Zero};

/// A vector of exact numbers.
pub type Vector = Vec<Rational>;

/// A matrix by its rows.
pub type Rows = Vec<Vector>;

/// The integer `n`.
pub fn int(n: i64) -> Rational {
    Rational::from_integer(n.into())
}

/// The fraction `n / d`.
///
/// # Panics
/// When `d` is zero.
pub fn fraction(n: i64, d: i64) -> Rational {
    Rational::new(n.into(), d.into())
}

/// The `k`-th unit vector.
pub fn unit(n: usize, k: usize) -> Vector {
    (0..n).map(|i| int(i64::from(i == k))).collect()
}

/// The identity matrix.
pub fn identity(n: usize) -> Rows {
    (0..n).map(|k| unit(n, k)).collect()
}

/// `u . v`.
pub fn dot(u: &[Rational], v: &[Rational]) -> Rational {
    assert_eq!(u.len(), v.len(), "vectors of a dot product have the same length");
    u.iter().zip(v).map(|(x, y)| x * y).sum()
}

/// `u + s v`.
pub fn add_scaled(u: &[Rational], s: &Rational, v: &[Rational]) -> Vector {
    assert_eq!(u.len(), v.len(), "vectors of a sum have the same length");
    u.iter().zip(v).map(|(x, y)| x + s * y).collect()
}

/// `A v`.
pub fn times(a: &[Vector], v: &[Rational]) -> Vector {
    a.iter().map(|row| dot(row, v)).collect()
}

/// `A^T`.
pub fn transposed(a: &[Vector]) -> Rows {
    let n_columns = a.first().map_or(0, Vec::len);
    (0..n_columns).map(|j| a.iter().map(|row| row[j].clone()).collect()).collect()
}

/// `A B`.
pub fn product(a: &[Vector], b: &[Vector]) -> Rows {
    let columns = transposed(b);
    a.iter().map(|row| columns.iter().map(|column| dot(row, column)).collect()).collect()
}

/// Reduced row echelon form without its zero rows, and the pivot columns.
pub fn echelon(a: &[Vector]) -> (Rows, Vec<usize>) {
    let mut rest = a.to_vec();
    let mut done: Rows = Vec::new();
    let mut pivots = Vec::new();
    for column in 0..a.first().map_or(0, Vec::len) {
        let Some(found) = rest.iter().position(|row| !row[column].is_zero()) else { continue };
        let row = rest.swap_remove(found);
        let row: Vector = row.iter().map(|x| x / &row[column]).collect();
        for other in rest.iter_mut().chain(&mut done) {
            *other = add_scaled(other, &-other[column].clone(), &row);
        }
        done.push(row);
        pivots.push(column);
    }
    (done, pivots)
}

/// The rank.
pub fn rank(a: &[Vector]) -> usize {
    echelon(a).1.len()
}

/// Whether `v` is a combination of the rows of `a`.
pub fn spans(a: &[Vector], v: &[Rational]) -> bool {
    let mut wider = a.to_vec();
    wider.push(v.to_vec());
    rank(&wider) == rank(a)
}

/// The solution of `A x = b` whose free components are those of `free`, or `None` when there is none.
pub fn solve(a: &[Vector], b: &[Rational], free: &[Rational]) -> Option<Vector> {
    let n = free.len();
    let augmented: Rows =
        a.iter().zip(b).map(|(row, right)| [row.as_slice(), std::slice::from_ref(right)].concat()).collect();
    let (rows, pivots) = echelon(&augmented);
    if pivots.contains(&n) {
        return None;
    }
    let mut x = free.to_vec();
    for (row, &pivot) in rows.iter().zip(&pivots) {
        let known: Rational = (0..n).filter(|j| !pivots.contains(j)).map(|j| &row[j] * &free[j]).sum();
        x[pivot] = &row[n] - known;
    }
    Some(x)
}

/// The inverse of a square matrix, or `None` when it is singular.
pub fn inverse(a: &[Vector]) -> Option<Rows> {
    let n = a.len();
    if rank(a) < n {
        return None;
    }
    let zeros = vec![Rational::zero(); n];
    let columns: Option<Rows> = (0..n).map(|k| solve(a, &unit(n, k), &zeros)).collect();
    Some(transposed(&columns?))
}

/// Whether `A` is the identity.
pub fn is_identity(a: &[Vector]) -> bool {
    a.iter()
        .enumerate()
        .all(|(i, row)| row.iter().enumerate().all(|(j, x)| if i == j { x.is_one() } else { x.is_zero() }))
}
