//! Passes of an iteration over the matrices that it moves: its start from the steps before, an improvement, the end of
//! a step. Blocks that face each other across the diagonal are written together, so that matrices stay Hermitian.
//!
//! Does not know: surfaces, what moves a matrix, when an iteration ends.

use super::panels::{Block, LANES, Row, adjoint, block, block_mut, element, n_panels, n_rows};
use crate::math::mul_add;
use crate::methods::two_sum;

/// Most steps that are extrapolated.
pub(super) const MAX_HISTORY: usize = 8;

/// A matrix that is moved, with what its iteration is made of.
pub(super) struct Moved<'a> {
    /// `W_n`.
    pub(super) value: &'a mut [Row],
    /// What the sum `value` lacks, above the diagonal.
    pub(super) residue: &'a mut [Row],
    /// `Y`.
    pub(super) middle: &'a mut [Row],
    /// `A`.
    pub(super) first: &'a mut [Row],
    /// `B`, above the diagonal.
    pub(super) second: &'a mut [Row],
    /// `D` of this step and of those before, above the diagonal.
    pub(super) history: &'a mut [Row],
}

impl<'a> Moved<'a> {
    /// Matrices of which it consists.
    pub(super) const fn n_matrices(n_kept: usize) -> usize {
        5 + n_kept
    }

    /// The matrices in their room, and the rest of the room.
    pub(super) fn new(n: usize, n_kept: usize, rows: &'a mut [Row]) -> (Self, &'a mut [Row]) {
        let size = n_rows(n, n);
        let (value, rows) = rows.split_at_mut(size);
        let (residue, rows) = rows.split_at_mut(size);
        let (middle, rows) = rows.split_at_mut(size);
        let (first, rows) = rows.split_at_mut(size);
        let (second, rows) = rows.split_at_mut(size);
        let (history, rest) = rows.split_at_mut(n_kept * size);
        (Self { value, residue, middle, first, second, history }, rest)
    }
}

/// `tr(x y)` of Hermitian matrices.
pub(super) fn inner(x: &[Row], y: &[Row]) -> f64 {
    let mut sums = [0.0; 2 * LANES];
    for (x, y) in x.iter().zip(y) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum = mul_add(*x, *y, *sum);
        }
    }
    sums.iter().sum()
}

pub(super) fn non_finite(n: usize, matrix: &[Row]) -> Option<usize> {
    let is_bad = |at: &usize| !element(n, matrix, at / n, at % n).iter().all(|x| x.is_finite());
    (0..n * n).find(is_bad)
}

/// The start of the iteration: `D` by the polynomial through the steps before.
pub(super) fn start(n: usize, m: &mut Moved<'_>, n_known: usize, next: usize, n_kept: usize) {
    let size = n_rows(n, n);
    // The weights (-1)^k (q choose k + 1) of the step k + 1 steps ago.
    let mut weights = [0.0; MAX_HISTORY];
    let mut weight = -1.0;
    for (k, of_step) in weights.iter_mut().enumerate().take(n_known) {
        weight *= -((n_known - k) as f64) / (k + 1) as f64;
        *of_step = weight;
    }
    for a in 0..n_panels(n) {
        for b in a..n_panels(n) {
            let mut d: Block = [[0.0; 2 * LANES]; LANES];
            for (k, &weight) in weights[..n_known].iter().enumerate() {
                let slot = (next + n_kept - 1 - k) % n_kept;
                let old = block(n, &m.history[slot * size..][..size], a, b);
                for i in 0..LANES {
                    for l in 0..2 * LANES {
                        d[i][l] = mul_add(weight, old[i][l], d[i][l]);
                    }
                }
            }
            place(n, m, next, (a, b), &d);
        }
    }
}

/// Errors of the extrapolation of the step in the slot `next` from those before it, as squares of norms of Frobenius by
/// the number of steps: the error of the polynomial through `q` steps before is the backward difference of the order
/// `q`. Where iterations end early, what they leave over is multiplied by `2^q`.
#[cold]
#[inline(never)]
pub(super) fn errors_of_start(
    n: usize,
    history: &[Row],
    next: usize,
    n_kept: usize,
) -> [f64; 1 + MAX_HISTORY] {
    let size = n_rows(n, n);
    let mut squares = [0.0; 1 + MAX_HISTORY];
    for a in 0..n_panels(n) {
        for b in a..n_panels(n) {
            for i in 0..LANES {
                let mut differences = [[0.0; 2 * LANES]; 1 + MAX_HISTORY];
                for (k, of_step) in differences.iter_mut().enumerate().take(n_kept) {
                    let slot = (next + n_kept - k) % n_kept;
                    *of_step = block(n, &history[slot * size..][..size], a, b)[i];
                }
                for (q, square) in squares.iter_mut().enumerate().take(n_kept).skip(1) {
                    for k in 0..n_kept - q {
                        for l in 0..2 * LANES {
                            differences[k][l] -= differences[k + 1][l];
                        }
                    }
                    *square += differences[0].iter().map(|x| x * x).sum::<f64>();
                }
            }
        }
    }
    squares
}

/// The number of steps with the least error.
pub(super) fn best_order(squares: &[f64; 1 + MAX_HISTORY], n_kept: usize) -> usize {
    let mut best = 0;
    for q in 1..n_kept {
        if best == 0 || squares[q] < squares[best] {
            best = q;
        }
    }
    best
}

/// Writes a block of `D`, and of `Y = W + D`.
#[inline(always)]
fn place(n: usize, m: &mut Moved<'_>, next: usize, (a, b): (usize, usize), d: &Block) {
    let size = n_rows(n, n);
    *block_mut(n, &mut m.history[next * size..][..size], a, b) = *d;
    let (w, y) = (block(n, m.value, a, b), block_mut(n, m.middle, a, b));
    for i in 0..LANES {
        for l in 0..2 * LANES {
            y[i][l] = w[i][l] + d[i][l];
        }
    }
    if a != b {
        let y = *y;
        *block_mut(n, m.middle, b, a) = adjoint(&y);
    }
}

/// `A - A^+`.
#[inline(always)]
pub(super) fn skew(n: usize, first: &[Row], a: usize, b: usize) -> Block {
    let (mut x, y) = (*block(n, first, a, b), adjoint(block(n, first, b, a)));
    for i in 0..LANES {
        for l in 0..2 * LANES {
            x[i][l] -= y[i][l];
        }
    }
    x
}

/// `i factor x`.
#[inline(always)]
pub(super) fn turned(x: &Block, factor: f64) -> Block {
    let mut out = [[0.0; 2 * LANES]; LANES];
    for i in 0..LANES {
        for l in 0..LANES {
            out[i][l] = -factor * x[i][LANES + l];
            out[i][LANES + l] = factor * x[i][l];
        }
    }
    out
}

/// Makes `D` and `Y` from `A` and `B`; the square of the norm of the change.
pub(super) fn improve(n: usize, m: &mut Moved<'_>, next: usize, factor: f64) -> f64 {
    let size = n_rows(n, n);
    let square = factor * factor;
    let mut total = 0.0;
    for a in 0..n_panels(n) {
        for b in a..n_panels(n) {
            // D = X + Y^+, of X = i factor A - factor^2 B above the diagonal, and Y = i factor A below it; on it half
            // of B is in both, so that D is Hermitian to the last digit.
            let (first, second) = (block(n, m.first, a, b), block(n, m.second, a, b));
            let of_second = if a == b { 0.5 * square } else { square };
            let mut d: Block = [[0.0; 2 * LANES]; LANES];
            for i in 0..LANES {
                for l in 0..LANES {
                    let (re, im) = (l, LANES + l);
                    d[i][re] = mul_add(-factor, first[i][im], -(of_second * second[i][re]));
                    d[i][im] = mul_add(factor, first[i][re], -(of_second * second[i][im]));
                }
            }
            let below = if a == b { adjoint(&d) } else { adjoint(&turned(block(n, m.first, b, a), factor)) };
            let old = block(n, &m.history[next * size..][..size], a, b);
            let mut sums = [0.0; LANES];
            for i in 0..LANES {
                for l in 0..LANES {
                    let (re, im) = (l, LANES + l);
                    d[i][re] += below[i][re];
                    d[i][im] += below[i][im];
                    let (x, y) = (d[i][re] - old[i][re], d[i][im] - old[i][im]);
                    sums[l] = mul_add(x, x, mul_add(y, y, sums[l]));
                }
            }
            total += if a == b { 1.0 } else { 2.0 } * sums.iter().sum::<f64>();
            place(n, m, next, (a, b), &d);
        }
    }
    total
}

/// `W_(n+1)` from `A`, with the rounding errors of the sum kept.
pub(super) fn finish(n: usize, m: &mut Moved<'_>, factor: f64) {
    for a in 0..n_panels(n) {
        for b in a..n_panels(n) {
            let skew = skew(n, m.first, a, b);
            let value = block_mut(n, m.value, a, b);
            let residue = block_mut(n, m.residue, a, b);
            for i in 0..LANES {
                for l in 0..LANES {
                    let (re, im) = (l, LANES + l);
                    let (x, y) = (
                        mul_add(-factor, skew[i][im], residue[i][re]),
                        mul_add(factor, skew[i][re], residue[i][im]),
                    );
                    (value[i][re], residue[i][re]) = two_sum(value[i][re], x);
                    (value[i][im], residue[i][im]) = two_sum(value[i][im], y);
                }
            }
            if a != b {
                let value = *value;
                *block_mut(n, m.value, b, a) = adjoint(&value);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::{LANES, best_order, block_mut, errors_of_start, n_panels, n_rows};

    /// Steps along a cubic, each with an error, are extrapolated from four, or from fewer where the error is large.
    #[test]
    fn the_order_of_the_start_follows_the_errors_of_steps() {
        let (n, n_kept) = (11, 9);
        let size = n_rows(n, n);
        for next in [0, 5, 8] {
            let order = |error: f64| {
                let mut history = vec![[0.0; 2 * LANES]; n_kept * size];
                for back in 0..n_kept {
                    let slot = (next + n_kept - back) % n_kept;
                    let t = 0.1 * back as f64;
                    let sign = if back % 2 == 0 { 1.0 } else { -1.0 };
                    let value = 1.0 + t * (1.0 + t * (1.0 + t)) + sign * error;
                    for a in 0..n_panels(n) {
                        for b in a..n_panels(n) {
                            *block_mut(n, &mut history[slot * size..][..size], a, b) =
                                [[value; 2 * LANES]; LANES];
                        }
                    }
                }
                best_order(&errors_of_start(n, &history, next, n_kept), n_kept)
            };
            // An alternating error is multiplied by 2^q in the difference of the order q; those of the cubic are
            // 0.11, 0.03, 0.006 and zero.
            assert_eq!(order(1e-6), 4);
            assert_eq!(order(1e-3), 3);
            assert_eq!(order(1.0), 1);
        }
    }
}
