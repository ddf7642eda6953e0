//! Linear systems by elimination with the largest pivots, in the place of the matrix.
//!
//! Deliberately does not know: where a matrix comes from.

use crate::real::Real;
use crate::system::StateVector;

/// Solves `rows x = b` for the first `n` components, `x` in the place of `b`; false where a pivot vanishes or is not
/// finite.
pub(super) fn solve<R: Real, Z: StateVector<R>>(rows: &mut [Z], x: &mut [R], n: usize) -> bool {
    for k in 0..n {
        let size = |row: &Z| row.as_slice()[k].magnitude();
        let largest = (k + 1..n).fold(k, |best, i| if size(&rows[i]) > size(&rows[best]) { i } else { best });
        rows.swap(k, largest);
        x.swap(k, largest);
        let (above, below) = rows.split_at_mut(k + 1);
        let pivot_row = above[k].as_slice();
        let pivot = pivot_row[k];
        if !pivot.all_ne(R::ZERO) || !pivot.all_finite() {
            return false;
        }
        for (i, row) in below[..n - k - 1].iter_mut().enumerate() {
            let row = row.as_mut_slice();
            let ratio = row[k] / pivot;
            for (entry, &above) in row[k + 1..n].iter_mut().zip(&pivot_row[k + 1..n]) {
                *entry -= ratio * above;
            }
            let known = x[k];
            x[k + 1 + i] -= ratio * known;
        }
    }
    for k in (0..n).rev() {
        let row = rows[k].as_slice();
        let known = (k + 1..n).fold(R::ZERO, |sum, j| sum + row[j] * x[j]);
        x[k] = (x[k] - known) / row[k];
    }
    true
}
