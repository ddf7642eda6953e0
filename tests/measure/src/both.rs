//! A scalar that is computed in `f64` and in double-double numbers at once.
//!
//! Deliberately does not know: what is computed with it.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::tracked::Tracked;
use hamel_runtime::{DoubleDouble, Real};

/// A number of a generated function in `f64`, with the largest term that entered it, beside the same number to 31
/// digits.
///
/// Both go through the same operations; comparisons are those of `f64`. Operations are calls on purpose: inlined, the
/// arithmetic of a double-double number would make each generated function too large to compile in reasonable time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Both {
    /// As `f64` computes it, bit for bit.
    pub tracked: Tracked,
    /// As double-double numbers compute it.
    pub exact: DoubleDouble,
}

impl Both {
    /// An input that both know exactly.
    pub fn input(value: f64) -> Both {
        Both { tracked: Tracked::input(value), exact: value.into() }
    }

    /// An input whose exact part is `value (1 + shift)`.
    pub fn shifted(value: f64, shift: f64) -> Both {
        Both { exact: DoubleDouble::from(value) * DoubleDouble::sum_of(1.0, shift), ..Both::input(value) }
    }

    /// What `f64` gives.
    pub fn value(self) -> f64 {
        self.tracked.value
    }

    /// Distance of the result in `f64` from the exact one.
    pub fn error(self) -> f64 {
        (DoubleDouble::from(self.value()) - self.exact).hi().abs()
    }
}

macro_rules! operators {
    ($($trait:ident $method:ident $assign_trait:ident $assign:ident $op:tt;)*) => { $(
        impl $trait for Both {
            type Output = Both;
            #[inline(never)]
            fn $method(self, other: Both) -> Both {
                Both { tracked: self.tracked $op other.tracked, exact: self.exact $op other.exact }
            }
        }
        impl $assign_trait for Both {
            fn $assign(&mut self, other: Both) {
                *self = *self $op other;
            }
        }
    )* };
}

operators! {
    Add add AddAssign add_assign +;
    Sub sub SubAssign sub_assign -;
    Mul mul MulAssign mul_assign *;
    Div div DivAssign div_assign /;
}

impl Neg for Both {
    type Output = Both;
    #[inline(never)]
    fn neg(self) -> Both {
        Both { tracked: -self.tracked, exact: -self.exact }
    }
}

macro_rules! functions {
    ($($name:ident)*) => { $(
        #[inline(never)]
        fn $name(self) -> Both {
            Both { tracked: self.tracked.$name(), exact: self.exact.$name() }
        }
    )* };
}

impl Real for Both {
    const ZERO: Both = Both { tracked: Tracked::ZERO, exact: DoubleDouble::ZERO };
    const ONE: Both = Both { tracked: Tracked::ONE, exact: DoubleDouble::ONE };

    #[inline(never)]
    fn from_f64(x: f64) -> Both {
        Both::input(x)
    }
    #[inline(never)]
    fn ratio(p: f64, q: f64) -> Both {
        Both { tracked: Tracked::ratio(p, q), exact: DoubleDouble::ratio(p, q) }
    }
    #[inline(never)]
    fn mul_add(self, factor: Both, addend: Both) -> Both {
        Both {
            tracked: self.tracked.mul_add(factor.tracked, addend.tracked),
            exact: self.exact.mul_add(factor.exact, addend.exact),
        }
    }
    // Double-double numbers need none.
    #[inline(never)]
    fn sum_error(self, other: Both) -> Both {
        Both { tracked: self.tracked.sum_error(other.tracked), exact: DoubleDouble::ZERO }
    }
    #[inline(never)]
    fn product_error(self, other: Both) -> Both {
        Both { tracked: self.tracked.product_error(other.tracked), exact: DoubleDouble::ZERO }
    }
    #[inline(never)]
    fn circle_error(self, cosine: Both) -> Both {
        Both { tracked: self.tracked.circle_error(cosine.tracked), exact: DoubleDouble::ZERO }
    }
    functions! { sqrt sin cos tan asin acos atan exp ln sinh cosh tanh abs }
    #[inline(never)]
    fn atan2(self, x: Both) -> Both {
        Both { tracked: self.tracked.atan2(x.tracked), exact: self.exact.atan2(x.exact) }
    }
    fn all_gt(self, other: Both) -> bool {
        self.value() > other.value()
    }
    fn all_ge(self, other: Both) -> bool {
        self.value() >= other.value()
    }
    fn all_ne(self, other: Both) -> bool {
        self.value() != other.value()
    }
    fn all_finite(self) -> bool {
        self.value().is_finite()
    }
    fn magnitude(self) -> f64 {
        self.value().abs()
    }
}

#[cfg(test)]
mod tests {
    use super::Both;
    use hamel_runtime::Real;

    #[test]
    fn cancellation_shows_in_the_error_and_in_the_term() {
        // 1 - cos x loses x^2/2 to the rounding of the cosine.
        let x = Both::input(1e-5);
        let difference = Both::ONE - x.cos();
        assert_eq!(difference.value(), 1.0 - hamel_runtime::math::cos(1e-5));
        assert_eq!(difference.tracked.term, 1.0);
        assert!((difference.exact.hi() / 0.5e-10 - 1.0).abs() < 1e-10);
        assert!(difference.error() > 1e-18 && difference.error() < f64::EPSILON);
        // 2 sin^2(x/2) does not.
        let half = (x * Both::from_f64(0.5)).sin();
        assert!((half * half + half * half).error() < 1e-26);
    }

    #[test]
    fn a_shifted_input_differs_in_its_exact_part() {
        let shifted = Both::shifted(3.0, 1e-12);
        assert_eq!(shifted.value(), 3.0);
        assert!((shifted.error() / 3e-12 - 1.0).abs() < 1e-12);
    }
}
