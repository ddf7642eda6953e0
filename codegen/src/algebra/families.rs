//! Matrices that span so(n), gl(n), sl(n) and su(n).
//!
//! Deliberately does not know: brackets, representations.

use num_traits::One;

use crate::expr::Rational;

use super::matrix::Matrix;

/// Largest matrix size of a named algebra; beyond it tables would not fit the limits of generated code.
pub(super) const MAX_SIZE: usize = 10;

/// The matrix with a one at `(i, j)` and zeros elsewhere.
pub(super) fn unit(n: usize, i: usize, j: usize) -> Matrix {
    let mut m = Matrix::zeros(n, n);
    m.set(i, j, Rational::one());
    m
}

/// Basis of so(n): the hat matrices for `n = 3`, else `E_ij - E_ji` for `i < j` in lexicographic order.
pub(super) fn so_matrices(n: usize) -> Vec<Matrix> {
    let pairs: Vec<(usize, usize)> = if n == 3 {
        vec![(2, 1), (0, 2), (1, 0)]
    } else {
        (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect()
    };
    pairs.into_iter().map(|(i, j)| unit(n, i, j).minus(&unit(n, j, i))).collect()
}

/// Basis of gl(n): `E_ij`, row-major.
pub(super) fn gl_matrices(n: usize) -> Vec<Matrix> {
    (0..n).flat_map(|i| (0..n).map(move |j| unit(n, i, j))).collect()
}

/// Basis of sl(n): `E_ij` with `i != j` row-major, then `E_kk - E_{k+1,k+1}`.
pub(super) fn sl_matrices(n: usize) -> Vec<Matrix> {
    let off = (0..n).flat_map(|i| (0..n).filter(move |j| *j != i).map(move |j| unit(n, i, j)));
    let diagonal = (0..n.saturating_sub(1)).map(|k| unit(n, k, k).minus(&unit(n, k + 1, k + 1)));
    off.chain(diagonal).collect()
}

/// Real `2n x 2n` matrices of a basis of su(n): `E_jk - E_kj`, `i(E_jk + E_kj)` for `j < k`, then
/// `i(E_kk - E_{k+1,k+1})`; the complex number `a + ib` is the block `[[a, -b], [b, a]]`.
pub(super) fn su_matrices(n: usize) -> Vec<Matrix> {
    let block = |entries: &[(usize, usize, i64, i64)]| {
        let mut m = Matrix::zeros(2 * n, 2 * n);
        for (i, j, re, im) in entries {
            let q = |x: i64| Rational::from_integer(x.into());
            m.set(2 * i, 2 * j, q(*re));
            m.set(2 * i + 1, 2 * j + 1, q(*re));
            m.set(2 * i, 2 * j + 1, q(-im));
            m.set(2 * i + 1, 2 * j, q(*im));
        }
        m
    };
    let mut list = Vec::new();
    for j in 0..n {
        for k in j + 1..n {
            list.push(block(&[(j, k, 1, 0), (k, j, -1, 0)]));
            list.push(block(&[(j, k, 0, 1), (k, j, 0, 1)]));
        }
    }
    for k in 0..n.saturating_sub(1) {
        list.push(block(&[(k, k, 0, 1), (k + 1, k + 1, 0, -1)]));
    }
    list
}

/// The matrices of an algebra by its name, such as `so(3)`.
pub(super) fn defining_matrices(name: &str) -> Option<Vec<Matrix>> {
    let (family, size) = name.strip_suffix(')')?.split_once('(')?;
    let n: usize = size.parse().ok().filter(|n| (1..=MAX_SIZE).contains(n))?;
    match family {
        "so" => Some(so_matrices(n)),
        "gl" => Some(gl_matrices(n)),
        "sl" => Some(sl_matrices(n)),
        "su" => Some(su_matrices(n)),
        _ => None,
    }
}
