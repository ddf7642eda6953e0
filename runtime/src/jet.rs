//! What the Taylor method asks of a system, and the sums that the Taylor coefficients of its solutions need.
//!
//! The module deliberately does not know step sizes, nor which operations a system consists of.

use crate::real::Real;
use crate::system::System;

/// The highest order of Taylor coefficients that can be computed: for tolerances down to 1e-27.
pub const MAX_ORDER: usize = 32;

/// A system that knows the Taylor coefficients of its solutions.
pub trait Jet<R: Real>: System<R> {
    /// Storage of the series behind the coefficients, worth keeping from one call to the next.
    type Workspace;

    /// A workspace, whose contents do not matter.
    fn workspace(&self) -> Self::Workspace;

    /// Writes the normalised Taylor coefficients of the solution `y(t)` that passes through `y`.
    ///
    /// ```text
    /// y(t + h) = sum_k out_k h^k
    /// ```
    ///
    /// # Shapes
    ///
    /// out: \[order + 1\], with an order of at most [`MAX_ORDER`]; what is beyond is left as it is.
    fn series(&self, t: R, y: &Self::State, workspace: &mut Self::Workspace, out: &mut [Self::State]);

    /// Writes the coefficients of the solution on its way from `t` towards another time, and returns the time up to
    /// which they are those of one solution: `towards`, or an earlier one where what drives the system goes over into
    /// another function of time, such as the next piece of a table. [`Taylor`](crate::Taylor) ends a step there.
    ///
    /// # Shapes
    ///
    /// As [`series`](Self::series).
    #[inline]
    fn series_towards(
        &self,
        (t, towards): (R, R),
        y: &Self::State,
        workspace: &mut Self::Workspace,
        out: &mut [Self::State],
    ) -> R {
        self.series(t, y, workspace, out);
        towards
    }
}

impl<R: Real, S: Jet<R> + ?Sized> Jet<R> for &S {
    type Workspace = S::Workspace;

    fn workspace(&self) -> Self::Workspace {
        (**self).workspace()
    }

    #[inline]
    fn series(&self, t: R, y: &Self::State, workspace: &mut Self::Workspace, out: &mut [Self::State]) {
        (**self).series(t, y, workspace, out);
    }

    #[inline]
    fn series_towards(
        &self,
        way: (R, R),
        y: &Self::State,
        workspace: &mut Self::Workspace,
        out: &mut [Self::State],
    ) -> R {
        (**self).series_towards(way, y, workspace, out)
    }
}

/// Writes the coefficients of an order to series whose coefficients lie beside each other, as
/// [`Products::add_convolutions_to`](crate::Products::add_convolutions_to) reads them; from [`MAX_ORDER`] on nothing
/// happens.
///
/// # Shapes
///
/// series: \[n, MAX_ORDER\], coefficients: \[n\].
#[inline]
pub fn set_order<R: Real>(series: &mut [[R; MAX_ORDER]], order: u32, coefficients: &[R]) {
    for (series, coefficient) in series.iter_mut().zip(coefficients) {
        if let Some(place) = series.get_mut(order as usize) {
            *place = *coefficient;
        }
    }
}

/// The inner parts of `N` Cauchy products of series, side by side, order after order.
///
/// ```text
/// sum_k = sum_{j=1}^{k-1} left_j right_{k-j}
/// ```
///
/// Rows of the orders 1, 2, .. are pushed one after the other; the sums belong to the order after the last.
#[derive(Clone, Copy, Debug)]
pub struct Convolutions<R, const N: usize> {
    left: [[R; N]; MAX_ORDER],
    right: [[R; N]; MAX_ORDER],
    n_rows: usize,
}

impl<R: Real, const N: usize> Default for Convolutions<R, N> {
    fn default() -> Self {
        Self { left: [[R::ZERO; N]; MAX_ORDER], right: [[R::ZERO; N]; MAX_ORDER], n_rows: 0 }
    }
}

impl<R: Real, const N: usize> Convolutions<R, N> {
    /// Forgets all rows.
    #[inline]
    pub fn clear(&mut self) {
        self.n_rows = 0;
    }

    /// Adds the rows of the next order; beyond [`MAX_ORDER`] rows nothing happens.
    #[inline]
    pub fn push(&mut self, left: [R; N], right: [R; N]) {
        if let (Some(left_row), Some(right_row)) =
            (self.left.get_mut(self.n_rows), self.right.get_mut(self.n_rows))
        {
            (*left_row, *right_row) = (left, right);
            self.n_rows += 1;
        }
    }

    /// The sums of the order after the last row.
    ///
    /// The terms with the newest rows come last, so that all others can be summed before those are there.
    #[inline]
    #[must_use]
    pub fn sums(&self) -> [R; N] {
        let mut sums = [R::ZERO; N];
        let (Some(left), Some(right)) = (self.left.get(..self.n_rows), self.right.get(..self.n_rows)) else {
            return sums;
        };
        let mut add = |left: &[R; N], right: &[R; N]| {
            for ((sum, left), right) in sums.iter_mut().zip(left).zip(right) {
                *sum = left.mul_add(*right, *sum);
            }
        };
        match (left, right) {
            ([oldest_left, left @ .., newest_left], [oldest_right, right @ .., newest_right]) => {
                for (left, right) in left.iter().zip(right.iter().rev()) {
                    add(left, right);
                }
                add(oldest_left, newest_right);
                add(newest_left, oldest_right);
            }
            ([left], [right]) => add(left, right),
            _ => {}
        }
        sums
    }
}

/// The inner parts of Cauchy products of any number of series, side by side, from their rows of the orders 1, 2, ..:
///
/// ```text
/// sums = sum_{j=1}^{k-1} left_j right_{k-j}
/// ```
///
/// with the bits of [`Convolutions`]: the terms with the last rows come last.
///
/// # Shapes
/// left, right: \[k - 1\]\[n\], sums: \[n\].
///
/// # Panics
/// When a size is wrong.
#[inline(always)]
pub fn convolve<R: Real>([left, right]: [&[R]; 2], sums: &mut [R]) {
    let n = sums.len();
    let mut at = 0;
    while at + 16 <= n {
        convolve_block::<R, 16>([left, right], at, sums);
        at += 16;
    }
    while at + 4 <= n {
        convolve_block::<R, 4>([left, right], at, sums);
        at += 4;
    }
    while at < n {
        convolve_block::<R, 1>([left, right], at, sums);
        at += 1;
    }
}

/// The same for `WIDTH` series from a place on.
#[inline(always)]
fn convolve_block<R: Real, const WIDTH: usize>([left, right]: [&[R]; 2], at: usize, sums: &mut [R]) {
    let n = sums.len();
    let n_rows = left.len() / n;
    let mut block = [R::ZERO; WIDTH];
    // One loop, as a closure may stay a function of its own, in other registers than its caller.
    for term in 0..n_rows {
        let i = match n_rows - term {
            1 => term,
            2 => 0,
            _ => term + 1,
        };
        let (left, right) = (&left[i * n + at..][..WIDTH], &right[(n_rows - 1 - i) * n + at..][..WIDTH]);
        for lane in 0..WIDTH {
            block[lane] = left[lane].mul_add(right[lane], block[lane]);
        }
    }
    sums[at..at + WIDTH].copy_from_slice(&block);
}

#[cfg(test)]
mod tests {
    use super::{Convolutions, convolve};

    #[test]
    fn sums_side_by_side_have_the_bits_of_sums_alone() {
        for n in [0, 1, 3, 4, 5, 16, 21, 37] {
            let mut alone = std::vec![Convolutions::<f64, 1>::default(); n];
            let (mut left, mut right) = (std::vec::Vec::new(), std::vec::Vec::new());
            for order in 0..9 {
                let mut sums = std::vec![1.0; n];
                convolve([&left, &right], &mut sums);
                let own: std::vec::Vec<f64> = alone.iter().map(|lane| lane.sums()[0]).collect();
                assert_eq!(sums, own, "{n} series, {order} rows");
                for (k, lane) in alone.iter_mut().enumerate() {
                    let x = (k as f64 + 1.7 * f64::from(order)).sin();
                    let y = (x * 12.3).cos();
                    lane.push([x], [y]);
                    left.push(x);
                    right.push(y);
                }
            }
        }
    }
}
