//! Inputs that are one polynomial in time.
//!
//! The module deliberately does not know who computes a series, or how long a step is.

use crate::inputs::{PolynomialSignal, Signal, SignalOverScalar};
use crate::real::Real;

/// Inputs that are one polynomial in time, of degree `K - 1`.
///
/// ```text
/// u(t) = sum_k c_k (t - t_0)^k
/// ```
///
/// ```
/// use hamel_runtime::{Polynomial, PolynomialSignal, Signal};
///
/// let parabola = Polynomial::new(1.0, [[2.0], [0.0], [3.0]]);
/// assert_eq!(Signal::<f64, (), 1>::at(&parabola, 3.0, &()), [14.0]);
/// let mut around = [[0.0]; 4];
/// let end = parabola.piece((3.0, 9.0), &mut around);
/// assert_eq!((around, end), ([[14.0], [12.0], [3.0], [0.0]], 9.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polynomial<R, const M: usize, const K: usize> {
    start: R,
    coefficients: [[R; M]; K],
}

impl<R: Real, const M: usize, const K: usize> Polynomial<R, M, K> {
    /// The polynomial with these coefficients around the time `start`; of none, zero.
    pub const fn new(start: R, coefficients: [[R; M]; K]) -> Self {
        Self { start, coefficients }
    }
}

impl<R: Real, S, const M: usize, const K: usize> Signal<R, S, M> for Polynomial<R, M, K> {
    fn at(&self, t: R, _y: &S) -> [R; M] {
        let mut values = [[R::ZERO; M]];
        self.piece((t, t), &mut values);
        values[0]
    }
}

impl<R: Real, const M: usize, const K: usize> PolynomialSignal<R, M> for Polynomial<R, M, K> {
    fn piece(&self, (t, towards): (R, R), coefficients: &mut [[R; M]]) -> R {
        let h = t - self.start;
        // Horner's rule, once for each coefficient that is wanted.
        let mut shifted = self.coefficients;
        for (k, out) in coefficients.iter_mut().enumerate() {
            let Some((first, rest)) = shifted.get_mut(k..).and_then(<[_]>::split_first_mut) else {
                *out = [R::ZERO; M];
                continue;
            };
            let mut above = [R::ZERO; M];
            for coefficient in rest.iter_mut().rev().chain([first]) {
                for (value, above) in coefficient.iter_mut().zip(&mut above) {
                    *value = above.mul_add(h, *value);
                    *above = *value;
                }
            }
            *out = shifted[k];
        }
        towards
    }
}

impl<Q: Real, R: Real, SQ, S, const M: usize, const K: usize> SignalOverScalar<Q, R, SQ, S, M>
    for Polynomial<R, M, K>
{
    type Over = Polynomial<Q, M, K>;

    fn over(&self, convert: impl Fn(R) -> Q) -> Self::Over {
        Polynomial {
            start: convert(self.start),
            coefficients: self.coefficients.map(|row| row.map(&convert)),
        }
    }
}
