//! Elementary functions of `f64`, and of `f32` in [`single`], from `std` or from the crate `libm`.
//!
//! Sine and cosine of `f64` are the crate's own, free of branches and of calls. Generated code and hamel's
//! interpreter call these same functions, so that their results agree bit for bit. Results of the two sources
//! may differ in the last digits. The module deliberately does not know
//! the trait [`Real`](crate::Real), which is built on it.

pub(crate) mod trig;

pub use trig::{cos, sin, sin_cos, sin_cos_of_two};

/// The kernel of sine and cosine and how [`mul_add`] rounds, for compilers that write the very same operations.
#[doc(hidden)]
pub mod kernel {
    pub use super::FUSED;
    pub use super::trig::{Angle, BOUND, reduced};
}

macro_rules! unary {
    ($float:ty; $($(#[$attribute:meta])* $name:ident = $std:ident | $libm:path;)*) => {$(
        $(#[$attribute])*
        #[inline]
        #[must_use]
        pub fn $name(x: $float) -> $float {
            #[cfg(feature = "std")]
            {
                x.$std()
            }
            #[cfg(all(feature = "libm", not(feature = "std")))]
            {
                $libm(x)
            }
            #[cfg(not(any(feature = "std", feature = "libm")))]
            {
                x
            }
        }
    )*};
}

macro_rules! binary {
    ($float:ty; $($(#[$attribute:meta])* $name:ident($x:ident, $y:ident) = $std:ident | $libm:path;)*) => {$(
        $(#[$attribute])*
        #[inline]
        #[must_use]
        pub fn $name($x: $float, $y: $float) -> $float {
            #[cfg(feature = "std")]
            {
                $x.$std($y)
            }
            #[cfg(all(feature = "libm", not(feature = "std")))]
            {
                $libm($x, $y)
            }
            #[cfg(not(any(feature = "std", feature = "libm")))]
            {
                $x + $y
            }
        }
    )*};
}

unary! { f64;
    /// Square root; NaN below zero.
    sqrt = sqrt | libm::sqrt;
    /// Tangent of an angle in radians.
    tan = tan | libm::tan;
    /// Arc sine in radians; NaN outside `[-1, 1]`.
    asin = asin | libm::asin;
    /// Arc cosine in radians; NaN outside `[-1, 1]`.
    acos = acos | libm::acos;
    /// Arc tangent in radians.
    atan = atan | libm::atan;
    /// Exponential function.
    exp = exp | libm::exp;
    /// Natural logarithm; NaN below zero.
    ln = ln | libm::log;
    /// Hyperbolic sine.
    sinh = sinh | libm::sinh;
    /// Hyperbolic cosine.
    cosh = cosh | libm::cosh;
    /// Hyperbolic tangent.
    tanh = tanh | libm::tanh;
    /// Absolute value.
    abs = abs | libm::fabs;
}

binary! { f64;
    /// Angle of the point `(x, y)` in `(-pi, pi]`.
    atan2(y, x) = atan2 | libm::atan2;
    /// Power `x^y`.
    pow(x, y) = powf | libm::pow;
}

/// Whether [`mul_add`] rounds once.
pub const FUSED: bool = cfg!(all(feature = "std", any(target_feature = "fma", target_arch = "aarch64")));

macro_rules! fused {
    ($float:ty) => {
        /// `x * y + z`: one instruction that rounds once where the target has it, else two that round twice.
        ///
        /// Without the target feature `mul_add` of the standard library is a call of several dozen instructions.
        #[inline]
        #[must_use]
        pub fn mul_add(x: $float, y: $float, z: $float) -> $float {
            #[cfg(all(feature = "std", any(target_feature = "fma", target_arch = "aarch64")))]
            {
                x.mul_add(y, z)
            }
            #[cfg(not(all(feature = "std", any(target_feature = "fma", target_arch = "aarch64"))))]
            {
                x * y + z
            }
        }
    };
}

fused! { f64 }

/// The same functions in single precision.
pub mod single {
    unary! { f32;
        /// Square root; NaN below zero.
        sqrt = sqrt | libm::sqrtf;
        /// Sine of an angle in radians.
        sin = sin | libm::sinf;
        /// Cosine of an angle in radians.
        cos = cos | libm::cosf;
        /// Tangent of an angle in radians.
        tan = tan | libm::tanf;
        /// Arc sine in radians; NaN outside `[-1, 1]`.
        asin = asin | libm::asinf;
        /// Arc cosine in radians; NaN outside `[-1, 1]`.
        acos = acos | libm::acosf;
        /// Arc tangent in radians.
        atan = atan | libm::atanf;
        /// Exponential function.
        exp = exp | libm::expf;
        /// Natural logarithm; NaN below zero.
        ln = ln | libm::logf;
        /// Hyperbolic sine.
        sinh = sinh | libm::sinhf;
        /// Hyperbolic cosine.
        cosh = cosh | libm::coshf;
        /// Hyperbolic tangent.
        tanh = tanh | libm::tanhf;
        /// Absolute value.
        abs = abs | libm::fabsf;
    }

    binary! { f32;
        /// Angle of the point `(x, y)` in `(-pi, pi]`.
        atan2(y, x) = atan2 | libm::atan2f;
        /// Power `x^y`.
        pow(x, y) = powf | libm::powf;
    }

    fused! { f32 }

    /// Sine and cosine of one angle in radians, equal to [`sin`] and [`cos`] bit for bit.
    #[inline]
    #[must_use]
    pub fn sin_cos(x: f32) -> (f32, f32) {
        (sin(x), cos(x))
    }

    /// Sines and cosines of two angles in radians, equal to [`sin_cos`] of each bit for bit.
    #[inline]
    #[must_use]
    pub fn sin_cos_of_two(x: f32, y: f32) -> ([f32; 2], [f32; 2]) {
        ([sin(x), sin(y)], [cos(x), cos(y)])
    }
}
