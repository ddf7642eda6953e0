//! Sums of products over a constant table, which loops run through.
//!
//! The module deliberately does not know what the factors are, nor where a table comes from.

use crate::jet::MAX_ORDER;
use crate::real::Real;

/// Bytes of a product in a table: its left factor, its right factor and its number, two bytes each.
const WIDTH: usize = 6;
/// Sums that run side by side, so that an addition does not wait for the one before it.
const LANES: usize = 4;

/// Sums of products of two factors and a number, result after result:
///
/// ```text
/// out_k += sum over the products of k of  number * left_i * right_j
/// ```
///
/// ```
/// use hamel_runtime::Products;
/// // out_0 = 2 x_0 y_1,  out_1 = -x_1 y_0 + 2 x_1 y_1
/// static TABLE: Products<'static> = Products::new(
///     b"\x00\x00\x01\x00\x00\x00\x01\x00\x00\x00\x01\x00\x01\x00\x01\x00\x00\x00",
///     &[1, 3],
///     &[[2.0, 0.0], [-1.0, 0.0]],
/// );
/// let mut out = [0.0; 2];
/// TABLE.add_to(&[3.0, 5.0], &[7.0, 11.0], &mut out);
/// assert_eq!(out, [66.0, 75.0]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Products<'a> {
    places: &'a [u8],
    ends: &'a [u32],
    numbers: &'a [[f64; 2]],
}

impl<'a> Products<'a> {
    /// A table of products.
    ///
    /// # Shapes
    ///
    /// places: \[6 n_products\], for each product the places of its left factor, its right factor and its number, each
    /// as two bytes, the lower one first; ends: \[n_results\], ascending, for each result the number of products up to
    /// and with its own; numbers: the `f64` next to each number, and what it lacks, as [`Real::from_parts`] takes them.
    #[must_use]
    pub const fn new(places: &'a [u8], ends: &'a [u32], numbers: &'a [[f64; 2]]) -> Products<'a> {
        Products { places, ends, numbers }
    }

    /// Adds the sums to `out`.
    ///
    /// The products of a result are shared out in turn among four sums, which are added up as `(0 + 1) + (2 + 3)`: the
    /// order, and with it every bit, is the same for every caller.
    ///
    /// # Shapes
    ///
    /// left, right: as long as the places of factors say; out: \[n_results\].
    ///
    /// # Panics
    ///
    /// When a factor or a number has no such place.
    #[inline]
    pub fn add_to<R: Real>(&self, left: &[R], right: &[R], out: &mut [R]) {
        self.add_sums_to(out, |own| {
            let mut sums = [R::ZERO; LANES];
            let mut rounds = own.chunks_exact(WIDTH * LANES);
            for round in &mut rounds {
                for (sum, place) in sums.iter_mut().zip(round.chunks_exact(WIDTH)) {
                    *sum = self.plus_product(*sum, place, left, right);
                }
            }
            for (sum, place) in sums.iter_mut().zip(rounds.remainder().chunks_exact(WIDTH)) {
                *sum = self.plus_product(*sum, place, left, right);
            }
            sums
        });
    }

    /// Adds the Taylor coefficients of an order of the sums of products of series to `out`:
    ///
    /// ```text
    /// out_k += sum over the products of k of  number * sum_{m=0}^{order} left_{i,m} right_{j,order-m}
    /// ```
    ///
    /// One pass through the table, whatever the order. The terms of a Cauchy product are shared out in turn among four
    /// sums, each of which is added to its own of a result, and these are added up as `(0 + 1) + (2 + 3)`: the order of
    /// operations, and with it every bit, is the same for every caller.
    ///
    /// ```
    /// use hamel_runtime::{MAX_ORDER, Products, set_order};
    /// // out = 3 x y with x = 1 + 2 h and y = 5 + 7 h: 15 + 51 h + 42 h^2
    /// static TABLE: Products<'static> = Products::new(&[0; 6], &[1], &[[3.0, 0.0]]);
    /// let (mut x, mut y) = ([[0.0; MAX_ORDER]], [[0.0; MAX_ORDER]]);
    /// set_order(&mut x, 0, &[1.0]);
    /// set_order(&mut x, 1, &[2.0]);
    /// set_order(&mut y, 0, &[5.0]);
    /// set_order(&mut y, 1, &[7.0]);
    /// let mut out = [0.0];
    /// TABLE.add_convolutions_to(1, &x, &y, &mut out);
    /// assert_eq!(out, [51.0]);
    /// ```
    ///
    /// # Shapes
    ///
    /// left, right: \[as long as the places of factors say, MAX_ORDER\], coefficients from order zero on;
    /// out: \[n_results\]; order: less than [`MAX_ORDER`], terms beyond are left out.
    ///
    /// # Panics
    ///
    /// When a factor or a number has no such place.
    ///
    /// # Source
    ///
    /// Moore, Interval Analysis (1966), chapter 11: the rule for the product of two series.
    #[inline]
    pub fn add_convolutions_to<R: Real>(
        &self,
        order: u32,
        left: &[[R; MAX_ORDER]],
        right: &[[R; MAX_ORDER]],
        out: &mut [R],
    ) {
        let n_terms = (order as usize + 1).min(MAX_ORDER);
        self.add_sums_to(out, |own| {
            let mut sums = [R::ZERO; LANES];
            for place in own.chunks_exact(WIDTH) {
                let (i, j, number) = self.product::<R>(place);
                let product = convolution(&left[i][..n_terms], &right[j][..n_terms]);
                for (sum, part) in sums.iter_mut().zip(product) {
                    *sum = number.mul_add(part, *sum);
                }
            }
            sums
        });
    }

    /// Adds to each result the four sums that its own products make.
    #[inline]
    fn add_sums_to<R: Real>(&self, out: &mut [R], sums_of: impl Fn(&[u8]) -> [R; LANES]) {
        let mut rest = self.places;
        let mut start = 0;
        for (result, end) in out.iter_mut().zip(self.ends) {
            let n = end.saturating_sub(start) as usize;
            let (own, after) = rest.split_at((WIDTH * n).min(rest.len()));
            (rest, start) = (after, *end);
            let [a, b, c, d] = sums_of(own);
            *result += (a + b) + (c + d);
        }
    }

    /// Places of the factors of the product at a place of the table, and its number.
    #[inline]
    fn product<R: Real>(&self, place: &[u8]) -> (usize, usize, R) {
        let at = |k: usize| usize::from(u16::from_le_bytes([place[k], place[k + 1]]));
        let [hi, lo] = self.numbers[at(4)];
        (at(0), at(2), R::from_parts(hi, lo))
    }

    /// `sum + number * left_i * right_j` of the product at a place of the table.
    #[inline]
    fn plus_product<R: Real>(&self, sum: R, place: &[u8], left: &[R], right: &[R]) -> R {
        let (i, j, number) = self.product::<R>(place);
        (number * left[i]).mul_add(right[j], sum)
    }
}

/// `sum_m left_m right_{n-1-m}` in four parts: of every fourth term each. Shapes: left, right: \[n\].
#[inline]
fn convolution<R: Real>(left: &[R], right: &[R]) -> [R; LANES] {
    let mut parts = [R::ZERO; LANES];
    let (left, left_rest) = left.as_chunks::<LANES>();
    let (right_rest, right) = right.as_rchunks::<LANES>();
    for (left, right) in left.iter().zip(right.iter().rev()) {
        for (k, part) in parts.iter_mut().enumerate() {
            *part = left[k].mul_add(right[LANES - 1 - k], *part);
        }
    }
    for ((part, left), right) in parts.iter_mut().zip(left_rest).zip(right_rest.iter().rev()) {
        *part = left.mul_add(*right, *part);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DoubleDouble, Dual};
    use std::vec::Vec;

    /// Products of all pairs of three factors for two results, the second with one product less.
    fn places() -> Vec<u8> {
        let mut places = Vec::new();
        for result in 0..2u16 {
            for i in 0..3u16 {
                for j in 0..3u16 - u16::from(result == 1 && i == 2) {
                    [i, j, (i + j + result) % 4].iter().for_each(|x| places.extend(x.to_le_bytes()));
                }
            }
        }
        places
    }

    const NUMBERS: [[f64; 2]; 4] = [[0.1, 1e-18], [-0.7, 3e-17], [2.0, 0.0], [1.0 / 3.0, 1.85e-17]];

    fn direct<R: Real>(left: &[R], right: &[R]) -> Vec<R> {
        let mut out = std::vec![R::ZERO; 2];
        for (k, place) in places().chunks_exact(6).enumerate() {
            let [i, j, c] = [0, 2, 4].map(|at| usize::from(place[at]));
            let [hi, lo] = NUMBERS[c];
            out[usize::from(k >= 9)] += R::from_parts(hi, lo) * left[i] * right[j];
        }
        out
    }

    #[test]
    fn sums_are_those_of_the_table_and_come_on_top() {
        let places = places();
        let table = Products::new(&places, &[9, 17], &NUMBERS);
        let (left, right) = ([0.3, -1.2, 0.7], [2.1, 0.4, -0.9]);
        let mut out = [10.0, 20.0];
        table.add_to(&left, &right, &mut out);
        for (k, (x, expected)) in out.iter().zip(direct(&left, &right)).enumerate() {
            let start = [10.0, 20.0][k];
            assert!((x - start - expected).abs() < 1e-14, "{k}: {x} {expected}");
        }
    }

    #[test]
    fn wider_scalars_take_all_digits_and_duals_the_derivative() {
        let places = places();
        let table = Products::new(&places, &[9, 17], &NUMBERS);
        let long = |x: [f64; 3]| x.map(DoubleDouble::from);
        let (left, right) = (long([0.3, -1.2, 0.7]), long([2.1, 0.4, -0.9]));
        let mut out = [DoubleDouble::ZERO; 2];
        table.add_to(&left, &right, &mut out);
        for (x, expected) in out.iter().zip(direct(&left, &right)) {
            assert!((*x - expected).magnitude() < 1e-29, "{x:?} {expected:?}");
        }
        let dual = |x: [f64; 3], d: [f64; 3]| [0, 1, 2].map(|k| Dual { value: x[k], derivative: d[k] });
        let (left, right) =
            (dual([0.3, -1.2, 0.7], [1.0, 0.5, -2.0]), dual([2.1, 0.4, -0.9], [0.2, 0.1, 3.0]));
        let mut out = [Dual::ZERO; 2];
        table.add_to(&left, &right, &mut out);
        for (x, expected) in out.iter().zip(direct(&left, &right)) {
            assert!((x.derivative - expected.derivative).abs() < 1e-14, "{x:?} {expected:?}");
        }
    }

    /// Against the definition, for every order.
    #[test]
    fn coefficients_of_sums_are_those_of_products_of_series() {
        let places = places();
        let table = Products::new(&places, &[9, 17], &NUMBERS);
        let series = |shift: f64| -> [[f64; MAX_ORDER]; 3] {
            core::array::from_fn(|i| {
                core::array::from_fn(|m| (shift + 1.7 * i as f64 + 0.9 * (m * m) as f64).sin())
            })
        };
        let (left, right) = (series(0.3), series(1.1));
        for order in 0..MAX_ORDER {
            let mut out = [10.0, 20.0];
            table.add_convolutions_to(order as u32, &left, &right, &mut out);
            let mut expected = [10.0, 20.0];
            for m in 0..=order {
                let (left, right) = (left.map(|x| x[m]), right.map(|x| x[order - m]));
                expected.iter_mut().zip(direct(&left, &right)).for_each(|(sum, x)| *sum += x);
            }
            for (x, expected) in out.iter().zip(expected) {
                // Sums of at most 288 terms of size one.
                assert!((x - expected).abs() < 1e-13, "order {order}: {x} {expected}");
            }
        }
    }

    #[test]
    #[should_panic(expected = "index out of bounds")]
    fn a_factor_that_is_not_there_is_told() {
        Products::new(&[3, 0, 0, 0, 0, 0], &[1], &[[1.0, 0.0]]).add_to(&[1.0], &[1.0], &mut [0.0]);
    }
}
