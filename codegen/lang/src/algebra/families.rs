//! Matrices that span the algebras that are known by name.
//!
//! Deliberately does not know: brackets, representations.

use num_traits::One;

use hamel_expr::Rational;

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

/// Basis of sp(2m): `E_ij - E_{m+j,m+i}` row-major, then `E_{i,m+j} + E_{j,m+i}` and `E_{m+i,j} + E_{m+j,i}` for
/// `i <= j`, a single entry where both are the same.
pub(super) fn sp_matrices(n: usize) -> Vec<Matrix> {
    let m = n / 2;
    let mut list = Vec::new();
    for i in 0..m {
        list.extend((0..m).map(|j| unit(n, i, j).minus(&unit(n, m + j, m + i))));
    }
    for (rows, columns) in [(0, m), (m, 0)] {
        for i in 0..m {
            for j in i..m {
                let mut symmetric = unit(n, rows + i, columns + j);
                symmetric.set(rows + j, columns + i, Rational::one());
                list.push(symmetric);
            }
        }
    }
    list
}

/// Basis of sim(n), similarities of R^n as matrices of size `n + 1`: rotations, the dilation, translations.
pub(super) fn sim_matrices(n: usize) -> Vec<Matrix> {
    let mut dilation = Matrix::zeros(n + 1, n + 1);
    (0..n).for_each(|i| dilation.set(i, i, Rational::one()));
    let mut list = rotations(n, n + 1);
    list.push(dilation);
    list.extend((0..n).map(|i| unit(n + 1, i, n)));
    list
}

/// Basis of the Galilei algebra, whose group acts on places and times as matrices of size `n + 2`: rotations, boosts,
/// translations, the translation of time.
pub(super) fn galilei_matrices(n: usize) -> Vec<Matrix> {
    let mut list = rotations(n, n + 2);
    list.extend((0..n).map(|i| unit(n + 2, i, n)));
    list.extend((0..n).map(|i| unit(n + 2, i, n + 1)));
    list.push(unit(n + 2, n, n + 1));
    list
}

/// Basis of so(n) in the first rows and columns of larger matrices; that of so(2) turns counter-clockwise.
fn rotations(n: usize, size: usize) -> Vec<Matrix> {
    let embedded = |m: Matrix| {
        let mut larger = Matrix::zeros(size, size);
        for i in 0..n {
            (0..n).for_each(|j| larger.set(i, j, m.get(i, j).clone()));
        }
        larger
    };
    match n {
        2 => vec![embedded(unit(2, 1, 0).minus(&unit(2, 0, 1)))],
        _ => so_matrices(n).into_iter().map(embedded).collect(),
    }
}

/// Real `2n x 2n` matrices of a basis of u(n): those of su(n) beside the diagonal, then `i E_kk`.
pub(super) fn u_matrices(n: usize) -> Vec<Matrix> {
    let mut list = su_matrices(n);
    list.truncate(n * (n - 1));
    list.extend((0..n).map(|k| unit(2 * n, 2 * k + 1, 2 * k).minus(&unit(2 * n, 2 * k, 2 * k + 1))));
    list
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
        "sp" if n.is_multiple_of(2) => Some(sp_matrices(n)),
        "u" => Some(u_matrices(n)),
        _ => None,
    }
}
