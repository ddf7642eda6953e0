//! Complex matrices in panels of eight columns: products, and passes over pairs of blocks that face each other across
//! the diagonal.
//!
//! A matrix of `n` rows is a slice of [`Row`]s: the row `i` of the panel `b` has the place `b padded(n) + i` and holds
//! the real parts of the columns `8 b` to `8 b + 7`, then their imaginary parts. Rows and columns from `n` on are zero,
//! so that all blocks are whole. Both factors of a product are read in the order in which they lie in memory, so that
//! nothing is packed before; in a row-major matrix of 256 columns every row would be on the same lines of the cache.
//!
//! Does not know: Hermitian matrices, fluids, steps.

use crate::math::mul_add;

/// Columns of a panel.
pub(super) const LANES: usize = 8;

/// Largest size of a matrix: the room for a solver is below `2^32` numbers, whatever the target.
pub(super) const LARGEST: usize = 4096;

/// A row of a panel: real parts, then imaginary parts.
pub(super) type Row = [f64; 2 * LANES];

/// Eight rows of a panel.
pub(super) type Block = [Row; LANES];

/// One part of a row.
type Part = [f64; LANES];

/// Rows of the tile of a product that is kept in registers: there are 32 of them with AVX-512, otherwise 16 with AVX.
const TILE: usize = if cfg!(target_feature = "avx512f") { 6 } else { 2 };

/// Rows of the left factor that stay in the cache while the right one goes by: 256 KiB for `n = 256`.
const ROWS_IN_CACHE: usize = 60;

/// Number of panels of a matrix with so many columns.
pub(super) const fn n_panels(columns: usize) -> usize {
    columns.div_ceil(LANES)
}

/// Number of rows of a panel of a matrix with so many rows, those that are zero included.
pub(super) const fn padded(rows: usize) -> usize {
    LANES * rows.div_ceil(LANES)
}

/// Number of [`Row`]s of a matrix.
pub(super) const fn n_rows(rows: usize, columns: usize) -> usize {
    padded(rows) * n_panels(columns)
}

/// Adds a matrix to another one; an empty one adds nothing.
pub(super) fn add(sum: &mut [Row], other: &[Row]) {
    for (x, y) in sum.iter_mut().zip(other) {
        for (x, y) in x.iter_mut().zip(y) {
            *x += y;
        }
    }
}

/// Adds the blocks of a matrix on and above the diagonal to another one.
pub(super) fn add_upper(n: usize, sum: &mut [Row], other: &[Row]) {
    for b in 0..n_panels(n) {
        let rows = LANES * (b + 1);
        add(&mut sum[b * padded(n)..][..rows], &other[b * padded(n)..][..rows]);
    }
}

/// The two parts of a row.
#[inline(always)]
fn parts(row: &Row) -> (&Part, &Part) {
    let (re, im) = row.split_at(LANES);
    (re.try_into().expect("half of a row"), im.try_into().expect("half of a row"))
}

/// Adds to a tile the product of columns of the left factor, which are `M` rows of a panel, with rows of the right one.
#[inline(always)]
fn accumulate<const M: usize>(re: &mut [Part; M], im: &mut [Part; M], left: &[Row; M], right: &[Row]) {
    for (k, row) in right.iter().enumerate().take(LANES) {
        let (b_re, b_im) = parts(row);
        for r in 0..M {
            let (a_re, a_im) = (left[r][k], left[r][LANES + k]);
            for l in 0..LANES {
                re[r][l] = mul_add(a_re, b_re[l], re[r][l]);
                im[r][l] = mul_add(a_re, b_im[l], im[r][l]);
            }
            for l in 0..LANES {
                re[r][l] = mul_add(-a_im, b_im[l], re[r][l]);
                im[r][l] = mul_add(a_im, b_re[l], im[r][l]);
            }
        }
    }
}

/// Rows `i` to `i + M` of the product with one panel of the right factor.
#[inline(always)]
fn tile<const M: usize>(n: usize, left: &[Row], i: usize, right: &[Row], out: &mut [Row]) {
    let (mut re, mut im) = ([[0.0; LANES]; M], [[0.0; LANES]; M]);
    let (whole, rest) = right.as_chunks::<LANES>();
    let height = padded(n);
    for (q, rows) in whole.iter().enumerate() {
        let left: &[Row; M] = left[q * height + i..][..M].try_into().expect("M rows");
        accumulate(&mut re, &mut im, left, rows);
    }
    if !rest.is_empty() {
        let left: &[Row; M] = left[whole.len() * height + i..][..M].try_into().expect("M rows");
        accumulate(&mut re, &mut im, left, rest);
    }
    for r in 0..M {
        let (of_re, of_im) = out[i + r].split_at_mut(LANES);
        of_re.copy_from_slice(&re[r]);
        of_im.copy_from_slice(&im[r]);
    }
}

/// Which part of a product is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// Every element.
    All,
    /// Elements on and above the diagonal, and some below it.
    Upper,
}

/// `out = left right`.
pub(super) fn product(n: usize, left: &[Row], right: &[Row], out: &mut [Row], extent: Extent) {
    for from in (0..n).step_by(ROWS_IN_CACHE) {
        let to = n.min(from + ROWS_IN_CACHE);
        let panels = right.chunks_exact(padded(n)).zip(out.chunks_exact_mut(padded(n)));
        for (b, (right, out)) in panels.enumerate() {
            let right = &right[..n];
            let end = match extent {
                Extent::All => to,
                Extent::Upper => to.min(LANES * (b + 1)),
            };
            let mut i = from;
            while i + TILE <= end {
                tile::<TILE>(n, left, i, right, out);
                i += TILE;
            }
            while i + 2 <= end {
                tile::<2>(n, left, i, right, out);
                i += 2;
            }
            if i < end {
                tile::<1>(n, left, i, right, out);
            }
        }
    }
}

/// The block of eight rows from `8 a` on in the panel `b`.
#[inline(always)]
pub(super) fn block(n: usize, matrix: &[Row], a: usize, b: usize) -> &Block {
    // A slice of eight rows.
    matrix[b * padded(n) + LANES * a..].first_chunk().expect("a block of the matrix")
}

/// [`block`] for writing.
#[inline(always)]
pub(super) fn block_mut(n: usize, matrix: &mut [Row], a: usize, b: usize) -> &mut Block {
    matrix[b * padded(n) + LANES * a..].first_chunk_mut().expect("a block of the matrix")
}

/// The conjugate transpose of a block.
#[inline(always)]
pub(super) fn adjoint(block: &Block) -> Block {
    let mut out = [[0.0; 2 * LANES]; LANES];
    for i in 0..LANES {
        for j in 0..LANES {
            out[j][i] = block[i][j];
            out[j][LANES + i] = -block[i][LANES + j];
        }
    }
    out
}

/// An element.
pub(super) fn element(n: usize, matrix: &[Row], i: usize, j: usize) -> [f64; 2] {
    let row = &matrix[j / LANES * padded(n) + i];
    [row[j % LANES], row[LANES + j % LANES]]
}

/// Sets an element.
pub(super) fn set_element(n: usize, matrix: &mut [Row], (i, j): (usize, usize), [re, im]: [f64; 2]) {
    let row = &mut matrix[j / LANES * padded(n) + i];
    row[j % LANES] = re;
    row[LANES + j % LANES] = im;
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::{Extent, Row, adjoint, block, block_mut, element, n_panels, n_rows, product, set_element};

    fn matrix(n: usize, seed: usize) -> Vec<Row> {
        let mut matrix = vec![[0.0; 16]; n_rows(n, n)];
        for i in 0..n {
            for j in 0..n {
                let x = (i * 7 + j * 13 + seed) as f64;
                set_element(n, &mut matrix, (i, j), [(x * 0.37).sin(), (x * 0.91 + 0.3).cos()]);
            }
        }
        matrix
    }

    #[test]
    fn products_are_sums_over_rows_and_columns() {
        for n in [1, 2, 3, 5, 7, 8, 9, 16, 23, 63, 65] {
            let (x, y) = (matrix(n, 1), matrix(n, 5));
            let mut all = vec![[0.0; 16]; n_rows(n, n)];
            let mut upper = all.clone();
            product(n, &x, &y, &mut all, Extent::All);
            product(n, &x, &y, &mut upper, Extent::Upper);
            for i in 0..n {
                for j in 0..n {
                    let mut sum = [0.0; 2];
                    for k in 0..n {
                        let ([a, b], [c, d]) = (element(n, &x, i, k), element(n, &y, k, j));
                        sum = [sum[0] + a * c - b * d, sum[1] + a * d + b * c];
                    }
                    let found = element(n, &all, i, j);
                    for k in 0..2 {
                        assert!((found[k] - sum[k]).abs() < 1e-13 * n as f64, "{n}: {i}, {j}");
                    }
                    if j >= i {
                        assert_eq!(found, element(n, &upper, i, j));
                    }
                }
            }
        }
    }

    #[test]
    fn blocks_cover_a_matrix() {
        for n in [5, 8, 13] {
            let x = matrix(n, 3);
            let mut transposed = vec![[0.0; 16]; n_rows(n, n)];
            for a in 0..n_panels(n) {
                for b in 0..n_panels(n) {
                    *block_mut(n, &mut transposed, b, a) = adjoint(block(n, &x, a, b));
                }
            }
            for i in 0..n {
                for j in 0..n {
                    let [re, im] = element(n, &x, j, i);
                    assert_eq!(element(n, &transposed, i, j), [re, -im]);
                }
            }
        }
    }
}
