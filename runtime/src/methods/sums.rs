//! Sums over stages and components: vectorised where a row is a constant, compensated where they become a state.
//!
//! Does not know tableaux, or how steps are chosen.

use super::{Constant, Point};
use crate::options::Norm;
use crate::real::Real;
use crate::system::StateVector;

/// The stage derivatives of a step by index: of both ends, and those stored between.
pub(crate) struct Derivatives<'a, V> {
    pub(crate) n_stages: usize,
    pub(crate) first: &'a V,
    pub(crate) stored: &'a [V],
    pub(crate) last: &'a V,
}

impl<'a, V> Derivatives<'a, V> {
    /// `k_index`, by a choice that vanishes where the index is a constant.
    #[inline(always)]
    pub(crate) fn get(&self, index: usize) -> &'a V {
        if index == 0 {
            self.first
        } else if index < self.n_stages {
            &self.stored[index - 1]
        } else if index == self.n_stages {
            self.last
        } else {
            &self.stored[index - 2]
        }
    }

    /// Calls `put(c, sum_j row_j k_j[c])` for the components `c < n` in order.
    ///
    /// Sums of several components are formed side by side, so that they are vectorised without knowing where `put`
    /// writes; straight-line code where the row and `n` are constants.
    #[inline(always)]
    pub(crate) fn for_each_sum<R: Real>(
        &self,
        row: &[(usize, Constant)],
        n: usize,
        mut put: impl FnMut(usize, R),
    ) where
        V: StateVector<R>,
    {
        let mut c = 0;
        self.sum_blocks::<R, 8>(row, n, &mut c, &mut put);
        self.sum_blocks::<R, 4>(row, n, &mut c, &mut put);
        self.sum_blocks::<R, 2>(row, n, &mut c, &mut put);
        self.sum_blocks::<R, 1>(row, n, &mut c, &mut put);
    }

    #[inline(always)]
    fn sum_blocks<R: Real, const WIDTH: usize>(
        &self,
        row: &[(usize, Constant)],
        n: usize,
        start: &mut usize,
        put: &mut impl FnMut(usize, R),
    ) where
        V: StateVector<R>,
    {
        while n - *start >= WIDTH {
            let mut sums = [R::ZERO; WIDTH];
            for (term, &(index, weight)) in row.iter().enumerate() {
                let k = &self.get(index).as_slice()[*start..*start + WIDTH];
                let weight: R = weight.get();
                for (sum, &k) in sums.iter_mut().zip(k) {
                    *sum = if term == 0 { weight * k } else { weight.mul_add(k, *sum) };
                }
            }
            for (lane, sum) in sums.into_iter().enumerate() {
                put(*start + lane, sum);
            }
            *start += WIDTH;
        }
    }
}

/// The rounded sum and its rounding error: `a + b = sum + residue` exactly.
#[inline(always)]
pub(crate) fn two_sum<R: Real>(a: R, b: R) -> (R, R) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

/// `to + its residue = from + its residue + h sum_j b_j k_j`.
#[inline(always)]
pub(crate) fn compensated_advance<R: Real, V: StateVector<R>>(
    (from, to): (&Point<V>, &mut Point<V>),
    h: R,
    weights: &[(usize, Constant)],
    k: &Derivatives<'_, V>,
) {
    let (y, residue) = (from.state.as_slice(), from.residue.as_slice());
    let (out, out_residue) = (to.state.as_mut_slice(), to.residue.as_mut_slice());
    k.for_each_sum(weights, y.len(), |c, slope| {
        (out[c], out_residue[c]) = two_sum(y[c], h.mul_add(slope, residue[c]));
    });
}

/// Square of the norm of scaled components; NaN if one is.
#[inline(always)]
pub(crate) fn square_of_norm<R: Real>(norm: Norm, components: &[R]) -> f64 {
    match norm {
        Norm::Rms => {
            // Two sums side by side wait half as long for their additions.
            let square = |x: R| x.magnitude() * x.magnitude();
            let mut pairs = components.chunks_exact(2);
            let mut sums = [0.0, 0.0];
            for pair in &mut pairs {
                sums[0] += square(pair[0]);
                sums[1] += square(pair[1]);
            }
            let last: f64 = pairs.remainder().iter().map(|&x| square(x)).sum();
            (sums[0] + sums[1] + last) / components.len().max(1) as f64
        }
        Norm::Max => {
            let sizes = components.iter().map(|x| x.magnitude());
            let max = sizes.fold(0.0, |max: f64, x| if x.is_nan() || x > max { x } else { max });
            max * max
        }
    }
}
