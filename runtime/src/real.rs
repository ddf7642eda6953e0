//! The scalar of generated code: what a right-hand side may do with a number.
//!
//! The module deliberately does not know how many lanes a scalar has: comparisons hold on every lane.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::math;

/// A real number, or several of them side by side (SIMD lanes) which are computed alike.
///
/// Implemented for `f64` and `f32` by the functions of [`math`] and [`math::single`], for
/// [`DoubleDouble`](crate::DoubleDouble), for [`Dual`](crate::Dual) of any of them, and for `F64x4` and `F64x8`
/// with the feature `lanes`.
pub trait Real:
    Copy
    + Default
    + PartialEq
    + Debug
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// Zero on every lane.
    const ZERO: Self;
    /// One on every lane.
    const ONE: Self;
    /// Distance from one to the next larger number, as a bound on tolerances.
    const EPSILON: f64 = f64::EPSILON;
    /// The least positive number that has all its digits.
    const MIN_POSITIVE: f64 = f64::MIN_POSITIVE;

    /// The number nearest to `x`: `x` itself unless the type is narrower than `f64`.
    fn from_f64(x: f64) -> Self;

    /// A constant that is known to more digits than `f64` has: `hi + lo`, where `hi` is the `f64` next to it.
    ///
    /// Types without more digits than `f64` take `hi` alone; wider ones add `lo`.
    #[inline]
    fn from_parts(hi: f64, lo: f64) -> Self {
        if Self::EPSILON < f64::EPSILON {
            Self::from_f64(hi) + Self::from_f64(lo)
        } else {
            Self::from_f64(hi)
        }
    }

    /// The quotient `p/q`, correctly rounded for `f64`; wider types keep more digits of it.
    #[inline]
    fn ratio(p: f64, q: f64) -> Self {
        Self::from_f64(p) / Self::from_f64(q)
    }

    /// `self * factor + addend`: rounded once where the target fuses it in one instruction, twice elsewhere.
    ///
    /// Never a call of a library: a fused operation that the target lacks would cost more than it saves.
    #[inline]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        self * factor + addend
    }

    /// The rounding error of a sum: `self + other = s + error` exactly, where `s` is the sum as it is computed. Zero
    /// for types of more digits than `f64`; NaN where the sum overflows.
    ///
    /// # Source
    /// Knuth, The Art of Computer Programming, volume 2, section 4.2.2, theorem B
    #[inline]
    fn sum_error(self, other: Self) -> Self {
        let _ = other;
        Self::ZERO
    }

    /// The rounding error of a product: `self * other = p + error` up to the square of the roundoff, where `p` is the
    /// product as it is computed, unless the error underflows. Zero for types of more digits than `f64`; NaN where the
    /// product overflows.
    ///
    /// # Source
    /// Dekker 1971, A floating-point technique for extending the available precision, with factors split by their bits
    #[inline]
    fn product_error(self, other: Self) -> Self {
        let _ = other;
        Self::ZERO
    }

    /// `(1 - sine^2 - cosine^2)/2` of a sine, `self`, and a cosine as they are computed, with the digits of a rounding
    /// error: `(sine, cosine) (1 + error)` is a point of the circle.
    #[inline]
    fn circle_error(self, cosine: Self) -> Self {
        let (p, q) = (self * self, cosine * cosine);
        let first = Self::ONE - q;
        let rest = Self::ONE.sum_error(-q) + first.sum_error(-p);
        let errors = self.product_error(self) + cosine.product_error(cosine);
        ((first - p) + (rest - errors)) * Self::from_f64(0.5)
    }

    /// Square root; NaN below zero.
    fn sqrt(self) -> Self;
    /// Sine of an angle in radians.
    fn sin(self) -> Self;
    /// Cosine of an angle in radians.
    fn cos(self) -> Self;
    /// Sine and cosine of one angle in radians.
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        (self.sin(), self.cos())
    }
    /// Sines and cosines of two angles in radians, each with the bits that [`Real::sin_cos`] gives it.
    // As a function of its own it would pass 12 registers through memory on lanes of 8 (two_arm_satellite with momenta:
    // 8.5 ns a state, 7.4 so).
    #[inline(always)]
    fn sin_cos_of_two(self, other: Self) -> ([Self; 2], [Self; 2]) {
        let ((sine, cosine), (other_sine, other_cosine)) = (self.sin_cos(), other.sin_cos());
        ([sine, other_sine], [cosine, other_cosine])
    }
    /// Tangent of an angle in radians.
    fn tan(self) -> Self;
    /// Arc sine in radians; NaN outside `[-1, 1]`.
    fn asin(self) -> Self;
    /// Arc cosine in radians; NaN outside `[-1, 1]`.
    fn acos(self) -> Self;
    /// Arc tangent in radians.
    fn atan(self) -> Self;
    /// Angle of the point `(x, self)` in `(-pi, pi]`.
    fn atan2(self, x: Self) -> Self;
    /// Exponential function.
    fn exp(self) -> Self;
    /// Natural logarithm; NaN below zero.
    fn ln(self) -> Self;
    /// Hyperbolic sine.
    fn sinh(self) -> Self;
    /// Hyperbolic cosine.
    fn cosh(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// Stumpff's function `c_k(z) = sum_j (-z)^j/(2 j + k)!` of `z = self`: `c_1(x^2) = sin(x)/x`, `c_2(x^2) = (1 - cos
    /// x)/x^2`, exact to rounding also near zero. A scalar of several lanes computes each by itself.
    fn stumpff(self, k: u32) -> Self {
        crate::stumpff::stumpff(self, k)
    }
    /// Coefficient `k` of the power series about `w = self` of `theta/sin(theta)` as a function of `w =
    /// sin(theta/2)^2`: `log R = turn_0(w) (R - R^T)/2` with `w = (3 - tr R)/4`. Exact to rounding also near zero,
    /// infinite at one, which is half a turn, and NaN beyond and below `-1/8`. A scalar of several lanes computes each
    /// by itself.
    fn turn(self, k: u32) -> Self {
        crate::turn::turn(self, k)
    }
    /// Reciprocal `1/self`; infinite at zero.
    #[inline]
    fn recip(self) -> Self {
        Self::ONE / self
    }

    /// Whether `self > other` on every lane; false where a lane is NaN.
    fn all_gt(self, other: Self) -> bool;
    /// Whether `self >= other` on every lane; false where a lane is NaN.
    fn all_ge(self, other: Self) -> bool;
    /// Whether `self != other` on every lane; a NaN differs from everything, as in IEEE 754.
    fn all_ne(self, other: Self) -> bool;
    /// Whether no lane is infinite or NaN.
    fn all_finite(self) -> bool;
    /// The largest absolute value of a lane, for error control and messages; NaN if a lane is NaN.
    fn magnitude(self) -> f64;
}

/// `x += y` and the like from `x + y`, for a type with its generics before it.
macro_rules! assign_operators {
    ($generics:tt $type:ty) => {
        crate::real::assign_operators! { AddAssign add_assign + $generics $type }
        crate::real::assign_operators! { SubAssign sub_assign - $generics $type }
        crate::real::assign_operators! { MulAssign mul_assign * $generics $type }
        crate::real::assign_operators! { DivAssign div_assign / $generics $type }
    };
    ($trait:ident $method:ident $operator:tt [$($generics:tt)*] $type:ty) => {
        impl $($generics)* core::ops::$trait for $type {
            #[inline]
            fn $method(&mut self, other: Self) {
                *self = *self $operator other;
            }
        }
    };
}
pub(crate) use assign_operators;

macro_rules! real {
    (
        $float:ident, $functions:path, lower bits $lower:literal,
        from_f64($x:ident) = $from_f64:expr, ratio($p:ident, $q:ident) = $ratio:expr
    ) => {
        impl Real for $float {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const EPSILON: f64 = $float::EPSILON as f64;
            const MIN_POSITIVE: f64 = $float::MIN_POSITIVE as f64;

            #[inline]
            fn from_f64($x: f64) -> Self {
                $from_f64
            }
            #[inline]
            fn ratio($p: f64, $q: f64) -> Self {
                $ratio
            }
            #[inline]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                use $functions as functions;
                functions::mul_add(self, factor, addend)
            }
            #[inline]
            fn sum_error(self, other: Self) -> Self {
                let sum = self + other;
                let part = sum - self;
                (self - (sum - part)) + (other - part)
            }
            #[inline]
            fn product_error(self, other: Self) -> Self {
                let product = self * other;
                let upper = |x: Self| Self::from_bits(x.to_bits() & !$lower);
                let (a, c) = (upper(self), upper(other));
                let (b, d) = (self - a, other - c);
                ((a * c - product) + a * d + b * c) + b * d
            }
            real! { unary $functions; sqrt sin cos tan asin acos atan exp ln sinh cosh tanh abs }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                use $functions as functions;
                functions::sin_cos(self)
            }
            #[inline]
            fn sin_cos_of_two(self, other: Self) -> ([Self; 2], [Self; 2]) {
                use $functions as functions;
                functions::sin_cos_of_two(self, other)
            }
            #[inline]
            fn atan2(self, x: Self) -> Self {
                use $functions as functions;
                functions::atan2(self, x)
            }
            #[inline]
            fn all_gt(self, other: Self) -> bool {
                self > other
            }
            #[inline]
            fn all_ge(self, other: Self) -> bool {
                self >= other
            }
            #[inline]
            fn all_ne(self, other: Self) -> bool {
                self != other
            }
            #[inline]
            fn all_finite(self) -> bool {
                self.is_finite()
            }
            #[inline]
            #[allow(clippy::unnecessary_cast, reason = "the cast widens f32")]
            fn magnitude(self) -> f64 {
                math::abs(self as f64)
            }
        }
    };
    (unary $functions:path; $($name:ident)*) => {$(
        #[inline]
        fn $name(self) -> Self {
            use $functions as functions;
            functions::$name(self)
        }
    )*};
}

real! { f64, crate::math, lower bits 0x7ff_ffff, from_f64(x) = x, ratio(p, q) = p / q }
// The quotient is rounded once more, from f64; rounding p and q first would lose the digits of both.
real! { f32, crate::math::single, lower bits 0xfff, from_f64(x) = x as f32, ratio(p, q) = (p / q) as f32 }

#[cfg(test)]
mod tests {
    use super::Real;
    use crate::{DoubleDouble, Dual};

    #[test]
    fn functions_agree_with_identities() {
        let x = 0.7_f64;
        let (sine, cosine) = Real::sin_cos(x);
        assert_eq!((sine, cosine), (Real::sin(x), Real::cos(x)));
        assert!((sine * sine + cosine * cosine - 1.0).abs() < 1e-15);
        assert!((Real::tan(x) - sine / cosine).abs() < 1e-15);
        assert!((Real::asin(sine) - x).abs() < 1e-15);
        assert!((Real::acos(cosine) - x).abs() < 1e-15);
        assert!((Real::atan(Real::tan(x)) - x).abs() < 1e-15);
        assert!((Real::atan2(-sine, -cosine) - (x - core::f64::consts::PI)).abs() < 1e-15);
        assert!((Real::ln(Real::exp(x)) - x).abs() < 1e-15);
        assert!((Real::cosh(x) + Real::sinh(x) - Real::exp(x)).abs() < 1e-15);
        assert!((Real::tanh(x) - Real::sinh(x) / Real::cosh(x)).abs() < 1e-15);
        assert_eq!(Real::sqrt(2.25_f64), 1.5);
        assert_eq!(Real::abs(-x), x);
        assert_eq!(Real::recip(4.0_f64), 0.25);
    }

    #[test]
    fn errors_are_what_rounding_leaves_out() {
        let numbers = [1.0, -1.0 / 3.0, 0.1, 1e-9, -7e8, 123_456.789, core::f64::consts::PI, 1e250];
        for x in numbers {
            for y in numbers {
                let sum = DoubleDouble::sum_of(x, y);
                assert_eq!((x + y, Real::sum_error(x, y)), (sum.hi(), sum.lo()));
                let product = DoubleDouble::from(x) * DoubleDouble::from(y);
                if product.all_finite() {
                    let off = Real::product_error(x, y) - product.lo();
                    assert!(
                        off.abs() <= f64::EPSILON * f64::EPSILON * product.hi().abs(),
                        "{x} {y}: {off:e}"
                    );
                }
            }
        }
        // Single numbers have exact sums and products in double.
        let (x, y) = (1.0_f32 / 3.0, -7.3e-3_f32);
        assert_eq!(f64::from(x + y) + f64::from(x.sum_error(y)), f64::from(x) + f64::from(y));
        let product = f64::from(x) * f64::from(y);
        let off = f64::from(x * y) + f64::from(x.product_error(y)) - product;
        assert!(off.abs() <= f64::from(f32::EPSILON).powi(2) * product.abs(), "{off:e}");
        assert_eq!(DoubleDouble::ONE.sum_error(1e-20.into()), DoubleDouble::ZERO);
    }

    #[test]
    fn a_sine_and_a_cosine_with_their_error_are_a_point_of_the_circle() {
        for k in 1..200 {
            let (sine, cosine) = Real::sin_cos(0.37 * f64::from(k));
            let scale = DoubleDouble::ONE + Real::circle_error(sine, cosine).into();
            let [s, c] = [sine, cosine].map(|x| DoubleDouble::from(x) * scale);
            assert!((s * s + c * c - DoubleDouble::ONE).hi().abs() < 1e-31, "{k}");
        }
    }

    #[test]
    fn derivatives_of_errors_vanish_or_are_errors() {
        let [x, y] = [Dual::new(0.1, 0.3), Dual::new(1e9, 1e8)];
        assert_eq!(x.sum_error(y), Dual::new(Real::sum_error(0.1, 1e9), Real::sum_error(0.3, 1e8)));
        assert_eq!(x.product_error(y), Dual::constant(Real::product_error(0.1, 1e9)));
    }

    #[test]
    fn single_precision_functions_agree_with_double() {
        let x = 0.7_f32;
        let y = f64::from(x);
        let pairs = [
            (Real::sin(x), Real::sin(y)),
            (Real::cos(x), Real::cos(y)),
            (Real::tan(x), Real::tan(y)),
            (Real::asin(x), Real::asin(y)),
            (Real::acos(x), Real::acos(y)),
            (Real::atan(x), Real::atan(y)),
            (Real::atan2(x, 0.3), Real::atan2(y, 0.3)),
            (Real::exp(x), Real::exp(y)),
            (Real::ln(x), Real::ln(y)),
            (Real::sinh(x), Real::sinh(y)),
            (Real::cosh(x), Real::cosh(y)),
            (Real::tanh(x), Real::tanh(y)),
            (Real::sqrt(x), Real::sqrt(y)),
        ];
        for (index, (single, double)) in pairs.into_iter().enumerate() {
            assert!((f64::from(single) - double).abs() < 3e-7, "function {index}: {single} and {double}");
        }
        assert_eq!(<f32 as Real>::ratio(1.0, 3.0), 1.0 / 3.0);
    }

    #[test]
    fn constants_of_two_parts_keep_what_the_type_can_hold() {
        let (hi, lo) = (1.0_f64, 1e-20);
        assert_eq!((f64::from_parts(hi, lo), f32::from_parts(hi, lo)), (1.0, 1.0));
        // A part of more than half a place of the first is not added either: the first is the value of `f64`.
        assert_eq!(f64::from_parts(1.0, f64::EPSILON), 1.0);
        let wide = DoubleDouble::from_parts(hi, lo);
        assert_eq!((wide.hi(), wide.lo()), (hi, lo));
        assert_eq!(Dual::<DoubleDouble>::from_parts(hi, lo), Dual::constant(wide));
    }

    #[test]
    fn comparisons_reject_nan() {
        assert!(!f64::NAN.all_gt(0.0) && !f64::NAN.all_ge(0.0) && !f64::NAN.all_finite());
        assert!(f64::NAN.all_ne(f64::NAN) && f64::NAN.magnitude().is_nan());
        assert!(!f64::INFINITY.all_finite() && 0.0.all_ge(-0.0) && !0.0.all_ne(-0.0));
        assert_eq!((-2.5_f32).magnitude(), 2.5);
    }
}
