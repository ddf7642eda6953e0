//! Several `f64` side by side as one scalar, in vector registers (crate `wide`).
//!
//! Every lane of every operation and function has the bits that the scalar of [`math`] has. The module
//! deliberately does not know which registers the target has: `wide` falls back to smaller ones and to arrays.

use core::ops::{Add, Div, Mul, Neg, Sub};

use wide::{f64x4, f64x8, u64x4, u64x8};

use crate::Real;
use crate::math;
use crate::math::trig::{self, Angle};
use crate::real::assign_operators;

macro_rules! lanes {
    ($(#[$attribute:meta])* $name:ident, $floats:ident, $bits:ident, $n:literal) => {
        $(#[$attribute])*
        ///
        /// Arithmetic, roots, sine and cosine are done on all lanes at once; the other functions, and sine and
        /// cosine where a lane is beyond `4e5`, one lane after the other. Every lane of a result has the bits of
        /// the same operation on `f64`.
        ///
        /// ```
        #[doc = concat!("use hamel_runtime::{Real, ", stringify!($name), "};")]
        ///
        #[doc = concat!("let x = ", stringify!($name), "::splat(0.5);")]
        /// assert_eq!(x.sin().lane(3), hamel_runtime::math::sin(0.5));
        /// ```
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        #[repr(transparent)]
        pub struct $name($floats);

        impl $name {
            /// The number of lanes.
            pub const LANES: usize = $n;

            /// The lanes in their order.
            #[inline]
            #[must_use]
            pub const fn new(lanes: [f64; $n]) -> Self {
                Self($floats::new(lanes))
            }

            /// `x` on every lane.
            #[inline]
            #[must_use]
            pub const fn splat(x: f64) -> Self {
                Self($floats::splat(x))
            }

            /// The lanes in their order.
            #[inline]
            #[must_use]
            pub const fn to_array(self) -> [f64; $n] {
                self.0.to_array()
            }

            /// One lane.
            ///
            /// # Panics
            /// When there is no such lane.
            #[inline]
            #[must_use]
            pub const fn lane(self, k: usize) -> f64 {
                self.to_array()[k]
            }

            /// The larger number on every lane; of NaN any.
            #[inline]
            #[must_use]
            pub fn max(self, other: Self) -> Self {
                Self(self.0.fast_max(other.0))
            }

            #[inline]
            fn map(self, f: impl FnMut(f64) -> f64) -> Self {
                Self::new(self.to_array().map(f))
            }

            #[cold]
            #[inline(never)]
            fn lanewise_sin_cos(self) -> (Self, Self) {
                (self.map(math::sin), self.map(math::cos))
            }
        }

        impl From<[f64; $n]> for $name {
            #[inline]
            fn from(lanes: [f64; $n]) -> Self {
                Self::new(lanes)
            }
        }

        impl From<$name> for [f64; $n] {
            #[inline]
            fn from(lanes: $name) -> Self {
                lanes.to_array()
            }
        }

        lanes! { @operators $name; Add add + Sub sub - Mul mul * Div div / }
        assign_operators! { [] $name }

        impl Neg for $name {
            type Output = Self;
            #[inline]
            fn neg(self) -> Self {
                Self(-self.0)
            }
        }

        impl Angle for $name {
            #[inline]
            fn splat(x: f64) -> Self {
                Self::splat(x)
            }
            #[inline]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                Real::mul_add(self, factor, addend)
            }
            #[inline]
            fn quarter_turns(self, sine: Self, cosine: Self) -> (Self, Self) {
                let n = self.0.to_bits();
                let odd = $floats::from_bits($bits::splat(0) - (n & $bits::splat(1)));
                let (s, c) = (odd.select(cosine.0, sine.0), odd.select(sine.0, cosine.0));
                let sign = |n: $bits| $floats::from_bits((n & $bits::splat(2)) << 62_u32);
                (Self(s ^ sign(n)), Self(c ^ sign(n + $bits::splat(1))))
            }
        }

        impl Real for $name {
            const ZERO: Self = Self::splat(0.0);
            const ONE: Self = Self::splat(1.0);

            #[inline]
            fn from_f64(x: f64) -> Self {
                Self::splat(x)
            }
            #[inline]
            fn ratio(p: f64, q: f64) -> Self {
                Self::splat(p / q)
            }
            #[inline]
            fn mul_add(self, factor: Self, addend: Self) -> Self {
                if math::FUSED { Self(self.0.mul_add(factor.0, addend.0)) } else { self * factor + addend }
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
                let upper = |x: Self| Self($floats::from_bits(x.0.to_bits() & $bits::splat(!0x7ff_ffff)));
                let (a, c) = (upper(self), upper(other));
                let (b, d) = (self - a, other - c);
                ((a * c - product) + a * d + b * c) + b * d
            }
            #[inline]
            fn sqrt(self) -> Self {
                Self(self.0.sqrt())
            }
            #[inline]
            fn sin(self) -> Self {
                self.sin_cos().0
            }
            #[inline]
            fn cos(self) -> Self {
                self.sin_cos().1
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                if self.0.abs().simd_gt($floats::splat(trig::BOUND)).any() {
                    self.lanewise_sin_cos()
                } else {
                    trig::reduced(self)
                }
            }
            lanes! { @lanewise tan asin acos atan exp ln sinh cosh tanh }
            fn stumpff(self, k: u32) -> Self {
                self.map(|z| Real::stumpff(z, k))
            }
            fn turn(self, k: u32) -> Self {
                self.map(|w| Real::turn(w, k))
            }
            #[inline]
            fn atan2(self, x: Self) -> Self {
                let (y, x) = (self.to_array(), x.to_array());
                Self::new(core::array::from_fn(|k| math::atan2(y[k], x[k])))
            }
            #[inline]
            fn abs(self) -> Self {
                Self(self.0.abs())
            }
            #[inline]
            fn all_gt(self, other: Self) -> bool {
                self.0.simd_gt(other.0).all()
            }
            #[inline]
            fn all_ge(self, other: Self) -> bool {
                self.0.simd_ge(other.0).all()
            }
            #[inline]
            fn all_ne(self, other: Self) -> bool {
                self.0.simd_ne(other.0).all()
            }
            #[inline]
            fn all_finite(self) -> bool {
                self.0.abs().simd_lt($floats::splat(f64::INFINITY)).all()
            }
            #[inline]
            fn magnitude(self) -> f64 {
                let larger = |a: f64, b: f64| if a.is_nan() || a > b { a } else { b };
                self.0.abs().to_array().into_iter().fold(0.0, larger)
            }
        }
    };
    (@operators $name:ident; $($trait:ident $method:ident $operator:tt)*) => {$(
        impl $trait for $name {
            type Output = Self;
            #[inline]
            fn $method(self, other: Self) -> Self {
                Self(self.0 $operator other.0)
            }
        }
    )*};
    (@lanewise $($name:ident)*) => {$(
        #[inline]
        fn $name(self) -> Self {
            self.map(math::$name)
        }
    )*};
}

lanes! {
    /// Four `f64` side by side: one register of AVX, two of SSE2 or NEON.
    F64x4, f64x4, u64x4, 4
}
lanes! {
    /// Eight `f64` side by side: one register of AVX-512, two of AVX; hides latencies where there are enough of them.
    F64x8, f64x8, u64x8, 8
}

#[cfg(test)]
mod tests {
    use super::{F64x4, F64x8};
    use crate::Real;

    const SPECIAL: [f64; 8] = [0.0, -0.0, 1.0, f64::INFINITY, f64::NAN, -2.5e-310, 7e5, -3.0];

    /// Every function on lanes that differ, in the order of a list, against the same function of `f64`.
    fn bits_agree<R: Real, const N: usize>(new: fn([f64; N]) -> R, array: fn(R) -> [f64; N]) {
        macro_rules! same {
            ($x:ident, $y:ident; $($expression:expr),*) => {$({
                fn function<R: Real>($x: R, $y: R) -> R {
                    let _ = ($x, $y);
                    $expression
                }
                for round in 0..60_u32 {
                    let number = |k: usize| {
                        let near = (k as f64 - 1.3) * 0.41 + f64::from(round) * 1.7;
                        if round < 8 { SPECIAL[(round as usize + 3 * k) % 8] } else { near - 50.0 }
                    };
                    let x: [f64; N] = core::array::from_fn(number);
                    let y: [f64; N] = core::array::from_fn(|k| number(2 * k + 5) * 0.01);
                    let lanes = array(function(new(x), new(y)));
                    for k in 0..N {
                        let scalar = function(x[k], y[k]);
                        let same = lanes[k].to_bits() == scalar.to_bits() || lanes[k].is_nan() && scalar.is_nan();
                        assert!(same, "{}({}, {}): {} and {scalar}", stringify!($expression), x[k], y[k], lanes[k]);
                    }
                }
            })*};
        }
        same! { x, y; x.sin_cos_of_two(y).0[0], x.sin_cos_of_two(y).0[1], x.sin_cos_of_two(y).1[0],
            x.sin_cos_of_two(y).1[1],
            x + y, x - y, x * y, x / y, -x, x.mul_add(y, R::ONE), x.recip(), R::ratio(1.0, 3.0) * x,
            x.sqrt(), x.sin(), x.cos(), x.sin_cos().0, x.sin_cos().1, y.sin(), y.cos(), x.tan(), y.asin(), y.acos(),
            x.atan(), x.atan2(y), x.exp(), x.ln(), x.sinh(), x.cosh(), x.tanh(), x.abs(),
            y.stumpff(1), x.stumpff(2), x.stumpff(5), y.turn(0), x.turn(0), y.turn(1), y.turn(3)
        }
    }

    #[test]
    fn lanes_have_the_bits_of_scalars() {
        bits_agree(F64x4::new, F64x4::to_array);
        bits_agree(F64x8::new, F64x8::to_array);
    }

    #[test]
    fn comparisons_hold_on_every_lane() {
        let x = F64x4::new([1.0, 2.0, 3.0, 4.0]);
        assert!(x.all_gt(F64x4::ZERO) && !x.all_gt(F64x4::ONE) && x.all_ge(F64x4::ONE));
        assert!(x.all_ne(F64x4::ZERO) && !x.all_ne(F64x4::splat(3.0)) && x != F64x4::ONE);
        let nan = F64x4::new([1.0, 2.0, f64::NAN, 4.0]);
        assert!(!nan.all_gt(F64x4::ZERO) && !nan.all_ge(F64x4::ZERO) && nan.all_ne(F64x4::ZERO));
        assert!(x.all_finite() && !nan.all_finite() && !F64x4::splat(f64::NEG_INFINITY).all_finite());
        assert_eq!((-x).magnitude(), 4.0);
        assert!(nan.magnitude().is_nan() && F64x8::splat(f64::NAN).magnitude().is_nan());
        assert_eq!((x.lane(2), F64x8::splat(7.0).lane(7)), (3.0, 7.0));
        assert_eq!(<[f64; 4]>::from(F64x4::from([1.0, 2.0, 3.0, 4.0])), x.to_array());
    }
}
