//! The factor of logarithms of rotations, without a division by zero at the identity:
//!
//! ```text
//! tau(w) = theta/sin(theta),  w = sin(theta/2)^2       log R = tau(w) (R - R^T)/2,  w = (3 - tr R)/4
//! tau_k(w) = tau^(k)(w)/k! = sum_j C(j + k, k) a_(j+k) w^j,  a_0 = 1,  a_n = 2n/(2n + 1) a_(n-1)
//! tau_k' = (k + 1) tau_(k+1)
//! 2 w (1 - w) (k + 1) tau_(k+1) + (2k + 1) (1 - 2w) tau_k - 2k tau_(k-1) = 1 for k = 0, 0 for others
//! ```
//!
//! The functions are analytic below `w = 1`, where the rotation is by half a turn and they are infinite. All terms of
//! the series are positive for positive `w`, and so are the terms of the recurrence from `w = 1/2` on. A rotation has
//! no `w` below zero but for rounding, and no value is given below `-1/8`.
//!
//! `tau` halves its angle by `tau(w) = tau(v)/sqrt(1 - w)`, `v = w/(2 (1 + sqrt(1 - w)))`, until few terms are left.
//! There are only operations that IEEE 754 rounds in one way, so that all targets have the same bits. Deliberately does
//! not know: which scalars there are.
//!
//! # Source
//! Abramowitz and Stegun 1964, 15.1.6 (`tau(w) = F(1, 1; 3/2; w)`), 15.2.1, 15.5.1; Murray, Li and Sastry 1994, A
//! mathematical introduction to robotic manipulation, section 2.2.

use crate::real::Real;

/// The least argument that has a value.
const LEAST: f64 = -0.125;

/// From this size on the angle is halved.
const HALVED: f64 = 0.04;

/// Coefficient `k` of the power series of `tau` about `w`; NaN below `-1/8` and beyond one.
pub(crate) fn turn<R: Real>(w: R, k: u32) -> R {
    if !w.all_ge(R::from_f64(LEAST)) {
        return R::from_f64(f64::NAN);
    }
    let half = R::from_f64(0.5);
    match k {
        0 => first(w),
        _ if w.all_gt(half) => recurrence(w, k),
        _ => series(w, k),
    }
}

fn first<R: Real>(mut w: R) -> R {
    let (limit, two) = (R::from_f64(HALVED), R::from_f64(2.0));
    let mut cosines = R::ONE;
    while w.abs().all_gt(limit) {
        let cosine = (R::ONE - w).sqrt();
        cosines *= cosine;
        w /= two * (R::ONE + cosine);
    }
    // Terms that are left out are below half a unit of the last place.
    let n = if R::EPSILON < f64::EPSILON { 24 } else { 12 };
    let mut sum = R::ONE;
    for j in (0..n).rev() {
        let next = 2 * j + 2;
        sum = R::ONE + w * sum * R::from_f64(f64::from(next)) / R::from_f64(f64::from(next + 1));
    }
    sum / cosines
}

/// The sum of the series, by Horner's rule.
fn series<R: Real>(w: R, k: u32) -> R {
    let is_small = !w.abs().all_gt(R::from_f64(0.125));
    let n = match (R::EPSILON < f64::EPSILON, is_small) {
        (false, true) => 19 + k,
        (false, false) => 56 + 4 * k,
        (true, true) => 37 + k,
        (true, false) => 112 + 4 * k,
    };
    let mut sum = R::ONE;
    for j in (0..n).rev() {
        let m = j + k + 1;
        let (above, below) = (2 * m * m, (j + 1) * (2 * m + 1));
        sum = R::ONE + w * sum * R::from_f64(f64::from(above)) / R::from_f64(f64::from(below));
    }
    for m in 1..=k {
        sum = sum * R::from_f64(f64::from(2 * m)) / R::from_f64(f64::from(2 * m + 1));
    }
    sum
}

/// From `tau_0` on, by sums of positive terms.
fn recurrence<R: Real>(w: R, k: u32) -> R {
    let two = R::from_f64(2.0);
    let (divisor, slope) = (two * w * (R::ONE - w), two * w - R::ONE);
    let mut before = first(w);
    let mut own = (R::ONE + slope * before) / divisor;
    for m in 1..k {
        let (even, odd) = (R::from_f64(f64::from(2 * m)), R::from_f64(f64::from(2 * m + 1)));
        let next = (even * before + odd * slope * own) / (divisor * R::from_f64(f64::from(m + 1)));
        (before, own) = (own, next);
    }
    own
}

#[cfg(test)]
mod tests {
    use crate::{DoubleDouble, Dual, Real};

    /// Arguments on both sides of every change of formula.
    const ARGUMENTS: [f64; 16] = [
        -0.124,
        -1e-9,
        0.0,
        1e-300,
        4.9e-7,
        0.039,
        0.041,
        0.124,
        0.126,
        0.3,
        0.499,
        0.501,
        0.7,
        0.97,
        0.9999,
        1.0 - 1e-12,
    ];

    #[test]
    fn double_precision_agrees_with_double_double() {
        for k in 0..40 {
            for w in ARGUMENTS {
                let wide = DoubleDouble::from(w).turn(k);
                if !wide.all_finite() {
                    continue;
                }
                let off = (DoubleDouble::from(Real::turn(w, k)) - wide).hi().abs();
                // Products and quotients in a row: one rounding each.
                let allowed = f64::from(4 + k) * f64::EPSILON * wide.hi().abs();
                assert!(w < 0.0 || off <= allowed, "tau_{k}({w}): {} off by {off:e}", wide.hi());
                assert!(off <= 1e3 * f64::EPSILON * wide.hi().abs() || k > 20, "tau_{k}({w}): {off:e}");
            }
        }
    }

    /// Angle and sine of twice as many digits, and the recurrence that ties the family.
    #[test]
    fn the_family_is_that_of_angle_and_sine() {
        let number = |n: u32| DoubleDouble::from(f64::from(n));
        for theta in [0.01, 0.3, 0.42, 1.0, 1.56, 1.58, 2.5, 3.1] {
            let theta = DoubleDouble::from(theta);
            let sine = (theta / number(2)).sin();
            let w = sine * sine;
            let expected = theta / theta.sin();
            let off = (w.turn(0) - expected).hi().abs();
            assert!(off < 1e-27 * expected.hi(), "{}: off by {off:e}", theta.hi());
            for k in 0..30 {
                let ahead = number(2 * (k + 1)) * w * (DoubleDouble::ONE - w) * w.turn(k + 1);
                let own = number(2 * k + 1) * (DoubleDouble::ONE - number(2) * w) * w.turn(k);
                let behind = if k == 0 { DoubleDouble::ONE } else { number(2 * k) * w.turn(k - 1) };
                let (left, size) = (ahead + own - behind, ahead.hi() + own.hi().abs() + behind.hi());
                assert!(left.hi().abs() < 1e-29 * size, "tau_{k}({}): {:e}", w.hi(), left.hi() / size);
            }
        }
    }

    #[test]
    fn derivatives_are_exact_at_zero() {
        let mut expected = 1.0;
        for k in 0..6_u32 {
            let found = Dual::variable(0.0_f64).turn(k);
            assert!((found.value - expected).abs() < 1e-15);
            expected *= f64::from(2 * k + 2) / f64::from(2 * k + 3);
            let slope = f64::from(k + 1) * expected;
            assert!((found.derivative - slope).abs() < 4e-15, "tau_{k}'(0) = {}", found.derivative);
        }
    }

    #[test]
    fn half_a_turn_is_infinite_and_more_has_no_value() {
        for k in 0..4 {
            assert_eq!(Real::turn(1.0_f64, k), f64::INFINITY);
            assert!([1.0 + 1e-15, -0.13, f64::NAN, f64::INFINITY].iter().all(|w| Real::turn(*w, k).is_nan()));
        }
        let (narrow, wide) = (Real::turn(0.25_f32, 1), Real::turn(0.25_f64, 1));
        assert!((f64::from(narrow) - wide).abs() < 8.0 * f64::from(f32::EPSILON));
    }
}
