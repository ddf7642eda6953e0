//! Stumpff's functions, from which sines and cosines of lengths are made without a division by what may be zero:
//!
//! ```text
//! c_k(z) = sum_j (-z)^j/(2 j + k)!      c_0(x^2) = cos x, c_1(x^2) = sin(x)/x, c_2(x^2) = (1 - cos x)/x^2, ..
//! c_k(z) = 1/k! - z c_(k+2)(z),         c_k'(z) = (k c_(k+2)(z) - c_(k+1)(z))/2
//! ```
//!
//! They are entire, and their derivatives are functions of the family. Near zero the series is summed: up to `z = (k +
//! 1)(k + 2)/2` each of its terms is at most half of the one before. Beyond, the recurrence takes sine and cosine up to
//! `k`, and loses no more than a few bits in a step. Deliberately does not know: which scalars there are.
//!
//! # Source
//! Stumpff 1959, Himmelsmechanik I, section 41; Bond and Allman 1996, Modern astrodynamics, appendix E.

use crate::real::Real;

/// `c_k(z)`.
pub(crate) fn stumpff<R: Real>(z: R, k: u32) -> R {
    let largest = R::from_f64(f64::from((k + 1) * (k + 2)) * 0.5);
    if z.abs().all_gt(largest) { beyond(z, k) } else { series(z, k) }
}

/// The sum of the series, by Horner's rule.
fn series<R: Real>(z: R, k: u32) -> R {
    let is_small = !z.abs().all_gt(R::ONE);
    // What is left out is below half a unit of the last place: z^n k!/(2 n + k)!.
    let n = match (R::EPSILON < f64::EPSILON, is_small) {
        (false, true) => 12,
        (false, false) => 24 + k / 2,
        (true, true) => 18,
        (true, false) => 40 + k / 2,
    };
    let mut sum = R::ONE;
    for j in (0..n).rev() {
        let first = k + 2 * j + 1;
        sum = R::ONE - z * sum / R::from_f64(f64::from(first * (first + 1)));
    }
    sum / factorial(k)
}

/// By sine and cosine, or their hyperbolic sisters.
fn beyond<R: Real>(z: R, k: u32) -> R {
    let half = R::from_f64(0.5);
    let is_circular = z.all_gt(R::ZERO);
    let x = if is_circular { z.sqrt() } else { (-z).sqrt() };
    let (mut m, mut c) = match (k, k % 2) {
        (0, _) => (0, if is_circular { x.cos() } else { x.cosh() }),
        (_, 1) => (1, if is_circular { x.sin() / x } else { x.sinh() / x }),
        _ => {
            // 1 - cos x = 2 sin(x/2)^2 keeps its digits where cos x is next to one.
            let sine = if is_circular { (x * half).sin() / x } else { (x * half).sinh() / x };
            (2, sine * sine * R::from_f64(2.0))
        }
    };
    while m < k {
        c = (R::ONE / factorial::<R>(m) - c) / z;
        m += 2;
    }
    c
}

fn factorial<R: Real>(k: u32) -> R {
    let mut product = R::ONE;
    for m in 2..=k {
        product *= R::from_f64(f64::from(m));
    }
    product
}

#[cfg(test)]
mod tests {
    use crate::{DoubleDouble, Dual, Real};

    /// Arguments on both sides of every change of formula.
    const ARGUMENTS: [f64; 16] =
        [0.0, 1e-300, 4.9e-7, 0.01, 0.99, 1.01, 2.9, 3.1, 5.9, 6.1, 9.8, 10.2, 20.9, 21.1, 39.0, 250.0];

    /// A relative error of a few units in the last place, or that of an argument in which `z` is rounded: near a zero
    /// of the function digits of `z` are worth more than its own.
    #[test]
    fn double_precision_agrees_with_double_double() {
        for k in 0..12 {
            for z in ARGUMENTS.into_iter().flat_map(|z| [z, -z]) {
                let wide = DoubleDouble::from(z).stumpff(k);
                let slope = Dual::variable(DoubleDouble::from(z)).stumpff(k).derivative;
                let allowed = 8.0 * f64::EPSILON * (wide.hi().abs() + (slope.hi() * z).abs());
                let off = (DoubleDouble::from(Real::stumpff(z, k)) - wide).hi().abs();
                assert!(off <= allowed, "c_{k}({z}): {} off by {off:e}, {allowed:e} allowed", wide.hi());
            }
        }
    }

    /// Sine and cosine of twice as many digits, and the recurrence that ties the family.
    #[test]
    fn the_family_is_that_of_sine_and_cosine() {
        let close = |what: &str, a: DoubleDouble, b: DoubleDouble| {
            let off = (a - b).hi().abs();
            assert!(off <= 1e-29 * b.hi().abs().max(1e-3), "{what}: {} off by {off:e}", b.hi());
        };
        for z in ARGUMENTS.into_iter().filter(|z| *z > 1e-3) {
            let z = DoubleDouble::from(z);
            let x = z.sqrt();
            close("cos", z.stumpff(0), x.cos());
            close("sin", z.stumpff(1), x.sin() / x);
            close("1 - cos", z.stumpff(2), (DoubleDouble::ONE - x.cos()) / z);
            close("sinh", (-z).stumpff(1), x.sinh() / x);
            let mut inverse = DoubleDouble::ONE;
            for k in 0..20_u32 {
                close("recurrence", z.stumpff(k) + z * z.stumpff(k + 2), inverse);
                inverse /= DoubleDouble::from(f64::from(k + 1));
            }
        }
    }

    #[test]
    fn derivatives_are_exact_at_zero() {
        for k in 0..6_u32 {
            let found = Dual::variable(0.0_f64).stumpff(k);
            let factorial: f64 = (1..=k).map(f64::from).product();
            let next = factorial * f64::from((k + 1) * (k + 2));
            assert!((found.value * factorial - 1.0).abs() < 1e-15);
            assert!((found.derivative * next + 1.0).abs() < 1e-15, "c_{k}'(0) = {}", found.derivative);
        }
    }

    #[test]
    fn what_is_no_number_stays_none() {
        assert!(Real::stumpff(f64::NAN, 1).is_nan());
        assert_eq!(Real::stumpff(0.25_f32, 1), Real::stumpff(0.25_f64, 1) as f32);
    }
}
