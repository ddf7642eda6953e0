//! The discrete Fourier transform of many sequences side by side, of any odd length.
//!
//! A sequence is a column of a matrix in panels. Lengths are split into their prime factors; a prime factor `p` is a
//! sum over pairs of elements as far from both ends, with real weights: `(p - 1)^2/4` products of a row with a number
//! for the cosines, as many for the sines. Results lie in the order of reversed digits, which the inverse begins with.
//!
//! Does not know: matrices, wave numbers.

use super::panels::{LANES, Row};
use crate::math::{mul_add, sin_cos};

/// Most prime factors of a length: odd ones up to the largest matrix, below `3^8`.
const MAX_FACTORS: usize = 8;

/// Transforms of one length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dft {
    n: usize,
    factors: [usize; MAX_FACTORS],
    n_factors: usize,
}

/// `exp(2 pi i k/n)` for `k < n`, as pairs.
pub(super) fn roots_of_unity(roots: &mut [f64]) {
    let n = roots.len() / 2;
    for (k, root) in roots.as_chunks_mut::<2>().0.iter_mut().enumerate() {
        let (sine, cosine) = sin_cos(core::f64::consts::TAU * k as f64 / n as f64);
        *root = [cosine, sine];
    }
}

impl Dft {
    /// The transforms of odd length `n`.
    pub(super) fn new(n: usize) -> Self {
        let (mut factors, mut n_factors) = ([0; MAX_FACTORS], 0);
        let (mut rest, mut p) = (n, 3);
        while rest > 1 {
            if p * p > rest {
                p = rest;
            }
            while rest % p == 0 {
                factors[n_factors] = p;
                n_factors += 1;
                rest /= p;
            }
            p += 2;
        }
        Self { n, factors, n_factors }
    }

    /// The frequency that lies at a place after [`forward`](Self::forward).
    pub(super) fn frequency(&self, place: usize) -> usize {
        let (mut rest, mut size, mut frequency, mut unit) = (place, self.n, 0, 1);
        for &p in &self.factors[..self.n_factors] {
            size /= p;
            frequency += unit * (rest / size);
            rest %= size;
            unit *= p;
        }
        frequency
    }

    /// `X_f = sum over j of x_j exp(-2 pi i f j/n)` of each column; `roots` are the [`roots_of_unity`], `work` has room
    /// for `2 n` rows' parts.
    pub(super) fn forward(&self, panel: &mut [Row], roots: &[f64], work: &mut [Row]) {
        let mut size = self.n;
        for &p in &self.factors[..self.n_factors] {
            self.pass::<false>(panel, (size, p), roots, work);
            size /= p;
        }
    }

    /// `x_j = sum over f of X_f exp(2 pi i f j/n)`: the inverse of [`forward`](Self::forward), times `n`.
    pub(super) fn inverse(&self, panel: &mut [Row], roots: &[f64], work: &mut [Row]) {
        let mut size = 1;
        for &p in self.factors[..self.n_factors].iter().rev() {
            size *= p;
            self.pass::<true>(panel, (size, p), roots, work);
        }
    }

    /// Splits each part of `size` rows into `p`, or puts them together again.
    #[inline(always)]
    fn pass<const INVERSE: bool>(
        &self,
        panel: &mut [Row],
        (size, p): (usize, usize),
        roots: &[f64],
        work: &mut [Row],
    ) {
        let m = size / p;
        let (work, _) = work.split_at_mut(p);
        for part in panel.chunks_exact_mut(size) {
            for j in 0..m {
                for (k, x) in work.iter_mut().enumerate() {
                    *x = part[k * m + j];
                    if INVERSE && j * k > 0 {
                        *x = turned(x, root(roots, j * k * (self.n / size)));
                    }
                }
                self.butterfly::<INVERSE>(work, roots, |k, mut x| {
                    if !INVERSE && j * k > 0 {
                        let [cosine, sine] = root(roots, j * k * (self.n / size));
                        x = turned(&x, [cosine, -sine]);
                    }
                    part[k * m + j] = x;
                });
            }
        }
    }

    /// The transform of `x.len()` rows, a prime number of them.
    #[inline(always)]
    fn butterfly<const INVERSE: bool>(&self, x: &mut [Row], roots: &[f64], mut out: impl FnMut(usize, Row)) {
        let p = x.len();
        let stride = self.n / p;
        let mut total = x[0];
        for j in 1..=p / 2 {
            let (low, high) = (x[j], x[p - j]);
            for l in 0..2 * LANES {
                x[j][l] = low[l] + high[l];
                x[p - j][l] = low[l] - high[l];
                total[l] += x[j][l];
            }
        }
        out(0, total);
        for k in 1..=p / 2 {
            let (mut even, mut odd) = (x[0], [0.0; 2 * LANES]);
            let mut turn = 0;
            for j in 1..=p / 2 {
                turn += k;
                if turn >= p {
                    turn -= p;
                }
                let [cosine, sine] = root(roots, turn * stride);
                let (sum, difference) = (&x[j], &x[p - j]);
                for l in 0..2 * LANES {
                    even[l] = mul_add(cosine, sum[l], even[l]);
                    odd[l] = mul_add(sine, difference[l], odd[l]);
                }
            }
            // even -+ i odd
            let (mut lower, mut upper) = (even, even);
            for l in 0..LANES {
                let (re, im) = (odd[l], odd[LANES + l]);
                lower[l] += im;
                lower[LANES + l] -= re;
                upper[l] -= im;
                upper[LANES + l] += re;
            }
            let (first, second) = if INVERSE { (p - k, k) } else { (k, p - k) };
            out(first, lower);
            out(second, upper);
        }
    }
}

#[inline(always)]
fn root(roots: &[f64], k: usize) -> [f64; 2] {
    [roots[2 * k], roots[2 * k + 1]]
}

/// A row times a complex number.
#[inline(always)]
fn turned(x: &Row, [cosine, sine]: [f64; 2]) -> Row {
    let mut out = [0.0; 2 * LANES];
    for l in 0..LANES {
        out[l] = mul_add(cosine, x[l], -(sine * x[LANES + l]));
        out[LANES + l] = mul_add(cosine, x[LANES + l], sine * x[l]);
    }
    out
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::{Dft, roots_of_unity};

    #[test]
    fn transforms_are_sums_and_their_own_inverses() {
        for n in [1, 3, 5, 7, 9, 15, 27, 49, 53, 105, 121] {
            let mut roots = vec![0.0; 2 * n];
            roots_of_unity(&mut roots);
            let dft = Dft::new(n);
            let start: Vec<[f64; 16]> =
                (0..n).map(|j| core::array::from_fn(|l| ((3 * j + 5 * l) as f64 * 0.7).sin())).collect();
            let (mut x, mut work) = (start.clone(), vec![[0.0; 16]; n]);
            dft.forward(&mut x, &roots, &mut work);
            for (place, found) in x.iter().enumerate() {
                let f = dft.frequency(place);
                for l in 0..8 {
                    let mut sum = [0.0; 2];
                    for (j, row) in start.iter().enumerate() {
                        let (sine, cosine) =
                            (-std::f64::consts::TAU * (f * j % n) as f64 / n as f64).sin_cos();
                        sum[0] += cosine * row[l] - sine * row[8 + l];
                        sum[1] += cosine * row[8 + l] + sine * row[l];
                    }
                    assert!(
                        (found[l] - sum[0]).abs() < 1e-12 && (found[8 + l] - sum[1]).abs() < 1e-12,
                        "{n}"
                    );
                }
            }
            dft.inverse(&mut x, &roots, &mut work);
            for (x, start) in x.iter().zip(&start) {
                for l in 0..16 {
                    assert!((x[l] / n as f64 - start[l]).abs() < 1e-14, "{n}");
                }
            }
        }
    }
}
