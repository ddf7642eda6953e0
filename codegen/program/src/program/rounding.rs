//! A bound of the rounding errors of a program's functions, carried along with every value.
//!
//! Does not know: where a program is evaluated, what its errors are compared with.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use hamel_runtime::{DoubleDouble, Real};

use hamel_expr::{Func, Measured};

/// A value to 31 digits and a bound of the error that rounding every operation to unit roundoff `u` makes in it, in
/// units of `u`, to first order.
///
/// ```text
/// e(a + b) = e(a) + e(b) + |a + b|,   e(a b) = |b| e(a) + |a| e(b) + |a b|,   e(f(a)) = |f'(a)| e(a) + |f(a)|
/// ```
///
/// # Source
/// Higham 2002, Accuracy and stability of numerical algorithms, section 3.3 (running error analysis)
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounded(Measured);

impl Bounded {
    /// An exact number.
    pub fn exact(value: DoubleDouble) -> Bounded {
        Bounded(Measured { value, error: 0.0 })
    }

    /// The value.
    pub fn value(self) -> DoubleDouble {
        self.0.value
    }

    /// The bound.
    pub fn error(self) -> f64 {
        self.0.error
    }
}

impl Default for Bounded {
    fn default() -> Bounded {
        Bounded::ZERO
    }
}

impl Add for Bounded {
    type Output = Bounded;
    fn add(self, other: Bounded) -> Bounded {
        Bounded(self.0.plus(other.0))
    }
}

impl Sub for Bounded {
    type Output = Bounded;
    fn sub(self, other: Bounded) -> Bounded {
        self + -other
    }
}

impl Mul for Bounded {
    type Output = Bounded;
    fn mul(self, other: Bounded) -> Bounded {
        Bounded(self.0.times(other.0, 1.0))
    }
}

impl Div for Bounded {
    type Output = Bounded;
    fn div(self, other: Bounded) -> Bounded {
        Bounded(self.0.times(other.0, -1.0))
    }
}

impl Neg for Bounded {
    type Output = Bounded;
    fn neg(self) -> Bounded {
        Bounded(Measured { value: -self.0.value, ..self.0 })
    }
}

macro_rules! assign {
    ($($trait:ident $method:ident $op:tt;)*) => { $(
        impl $trait for Bounded {
            fn $method(&mut self, other: Bounded) {
                *self = *self $op other;
            }
        }
    )* };
}

assign! {
    AddAssign add_assign +;
    SubAssign sub_assign -;
    MulAssign mul_assign *;
    DivAssign div_assign /;
}

macro_rules! functions {
    ($($name:ident $function:ident;)*) => { $(
        fn $name(self) -> Bounded {
            Bounded(self.0.function(Func::$function))
        }
    )* };
}

impl Real for Bounded {
    const ZERO: Bounded = Bounded(Measured { value: DoubleDouble::ZERO, error: 0.0 });
    const ONE: Bounded = Bounded(Measured { value: DoubleDouble::ONE, error: 0.0 });

    fn from_f64(x: f64) -> Bounded {
        Bounded::exact(x.into())
    }

    fn sqrt(self) -> Bounded {
        Bounded(Bounded::ONE.0.times(self.0, 0.5))
    }

    functions! {
        sin Sin;
        cos Cos;
        tan Tan;
        asin Asin;
        acos Acos;
        atan Atan;
        exp Exp;
        ln Ln;
        sinh Sinh;
        cosh Cosh;
        tanh Tanh;
    }

    fn stumpff(self, k: u32) -> Bounded {
        Bounded(self.0.function(Func::Stumpff(u8::try_from(k).unwrap_or(u8::MAX))))
    }

    fn turn(self, k: u32) -> Bounded {
        Bounded(self.0.function(Func::Turn(u8::try_from(k).unwrap_or(u8::MAX))))
    }

    fn abs(self) -> Bounded {
        Bounded(Measured { value: self.0.value.abs(), ..self.0 })
    }

    fn atan2(self, x: Bounded) -> Bounded {
        Bounded(self.0.atan2(x.0))
    }

    fn all_gt(self, other: Bounded) -> bool {
        self.0.value.all_gt(other.0.value)
    }

    fn all_ge(self, other: Bounded) -> bool {
        self.0.value.all_ge(other.0.value)
    }

    fn all_ne(self, other: Bounded) -> bool {
        self.0.value.all_ne(other.0.value)
    }

    fn all_finite(self) -> bool {
        self.0.value.all_finite()
    }

    fn magnitude(self) -> f64 {
        self.0.value.magnitude()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cancellation_shows_in_the_bound() {
        let third = Bounded::from_f64(1.0) / Bounded::from_f64(3.0);
        assert_eq!(third.error(), third.value().hi());
        let sum = third + Bounded::ONE;
        let small = sum - Bounded::ONE;
        // 1/3 and 4/3 are rounded, and the last difference.
        assert!((small.error() - 2.0).abs() < 1e-12, "{small:?}");
    }

    #[test]
    fn f64_keeps_within_the_bound() {
        fn area<R: Real>(a: R, b: R, c: R) -> R {
            let half = (a + b + c) / R::from_f64(2.0);
            (half * (half - a) * (half - b) * (half - c)).sqrt()
        }
        for k in 1..40 {
            let c = 1.9 + 0.002 * f64::from(k);
            let bounded = area(Bounded::ONE, Bounded::ONE, Bounded::from_f64(c));
            let off = (DoubleDouble::from(area(1.0, 1.0, c)) - bounded.value()).hi().abs();
            assert!(off <= bounded.error() * f64::EPSILON / 2.0, "{c}: {off:e} {bounded:?}");
        }
    }
}
