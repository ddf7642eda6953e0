//! A scalar that carries the largest term that entered its value.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use hamel_runtime::Real;

/// A number together with the largest term that enters it.
///
/// `term` of an input is its magnitude. A sum has the larger of its summands' terms, so cancellation leaves a trace. A
/// factor, a divisor or a function multiplies the term of its argument as it multiplies a small change of it: for `a b`
/// it is `max(term_a |b|, |a| term_b)`, for `a/b` it is `max(term_a/|b|, |a| term_b/b^2)`, for `f(a)` it is
/// `|f'(a)| term_a`, and never less than the value itself. A result computed in `f64` cannot be expected closer to the
/// truth than a few units in the last place of its largest term.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tracked {
    /// The number, computed with exactly the operations of `f64`.
    pub value: f64,
    /// The largest term that enters it.
    pub term: f64,
}

impl Tracked {
    /// An input.
    pub fn input(value: f64) -> Tracked {
        Tracked { value, term: value.abs() }
    }

    fn new(value: f64, term: f64) -> Tracked {
        Tracked { value, term: term.max(value.abs()) }
    }

    fn function(self, value: f64, derivative: f64) -> Tracked {
        Tracked::new(value, derivative.abs() * self.term)
    }
}

impl Add for Tracked {
    type Output = Tracked;
    fn add(self, other: Tracked) -> Tracked {
        Tracked::new(self.value + other.value, self.term.max(other.term))
    }
}

impl Sub for Tracked {
    type Output = Tracked;
    fn sub(self, other: Tracked) -> Tracked {
        Tracked::new(self.value - other.value, self.term.max(other.term))
    }
}

impl Mul for Tracked {
    type Output = Tracked;
    fn mul(self, other: Tracked) -> Tracked {
        let term = (self.term * other.value.abs()).max(self.value.abs() * other.term);
        Tracked::new(self.value * other.value, term)
    }
}

impl Div for Tracked {
    type Output = Tracked;
    fn div(self, other: Tracked) -> Tracked {
        let divisor = other.value.abs();
        let term = (self.term / divisor).max(self.value.abs() * other.term / (divisor * divisor));
        Tracked::new(self.value / other.value, term)
    }
}

impl Neg for Tracked {
    type Output = Tracked;
    fn neg(self) -> Tracked {
        Tracked { value: -self.value, term: self.term }
    }
}

macro_rules! assign {
    ($($name:ident $method:ident $op:tt;)*) => { $(
        impl $name for Tracked {
            fn $method(&mut self, other: Tracked) {
                *self = *self $op other;
            }
        }
    )* };
}

assign! { AddAssign add_assign +; SubAssign sub_assign -; MulAssign mul_assign *; DivAssign div_assign /; }

impl Real for Tracked {
    const ZERO: Tracked = Tracked { value: 0.0, term: 0.0 };
    const ONE: Tracked = Tracked { value: 1.0, term: 1.0 };

    fn from_f64(x: f64) -> Tracked {
        Tracked::input(x)
    }
    fn ratio(p: f64, q: f64) -> Tracked {
        Tracked::input(f64::ratio(p, q))
    }
    fn mul_add(self, factor: Tracked, addend: Tracked) -> Tracked {
        let value = Real::mul_add(self.value, factor.value, addend.value);
        Tracked::new(value, (self * factor).term.max(addend.term))
    }
    fn sum_error(self, other: Tracked) -> Tracked {
        Tracked::input(self.value.sum_error(other.value))
    }
    fn product_error(self, other: Tracked) -> Tracked {
        Tracked::input(self.value.product_error(other.value))
    }
    fn circle_error(self, cosine: Tracked) -> Tracked {
        Tracked::input(self.value.circle_error(cosine.value))
    }
    fn sqrt(self) -> Tracked {
        let root = Real::sqrt(self.value);
        self.function(root, 0.5 / root)
    }
    fn sin(self) -> Tracked {
        self.function(Real::sin(self.value), Real::cos(self.value))
    }
    fn cos(self) -> Tracked {
        self.function(Real::cos(self.value), Real::sin(self.value))
    }
    fn tan(self) -> Tracked {
        let tan = Real::tan(self.value);
        self.function(tan, 1.0 + tan * tan)
    }
    fn asin(self) -> Tracked {
        self.function(Real::asin(self.value), (1.0 - self.value * self.value).sqrt().recip())
    }
    fn acos(self) -> Tracked {
        self.function(Real::acos(self.value), (1.0 - self.value * self.value).sqrt().recip())
    }
    fn atan(self) -> Tracked {
        self.function(Real::atan(self.value), (1.0 + self.value * self.value).recip())
    }
    fn atan2(self, x: Tracked) -> Tracked {
        let square = self.value * self.value + x.value * x.value;
        let term = (self.term * x.value.abs()).max(self.value.abs() * x.term) / square;
        Tracked::new(Real::atan2(self.value, x.value), term)
    }
    fn exp(self) -> Tracked {
        let exp = Real::exp(self.value);
        self.function(exp, exp)
    }
    fn ln(self) -> Tracked {
        self.function(Real::ln(self.value), self.value.recip())
    }
    fn sinh(self) -> Tracked {
        self.function(Real::sinh(self.value), Real::cosh(self.value))
    }
    fn cosh(self) -> Tracked {
        self.function(Real::cosh(self.value), Real::sinh(self.value))
    }
    fn tanh(self) -> Tracked {
        let tanh = Real::tanh(self.value);
        self.function(tanh, 1.0 - tanh * tanh)
    }
    fn abs(self) -> Tracked {
        self.function(Real::abs(self.value), 1.0)
    }
    fn all_gt(self, other: Tracked) -> bool {
        self.value > other.value
    }
    fn all_ge(self, other: Tracked) -> bool {
        self.value >= other.value
    }
    fn all_ne(self, other: Tracked) -> bool {
        self.value != other.value
    }
    fn all_finite(self) -> bool {
        self.value.is_finite()
    }
    fn magnitude(self) -> f64 {
        self.value.abs()
    }
}

/// Distance from `|x|` to the next larger double.
pub fn unit_in_the_last_place(x: f64) -> f64 {
    let x = x.abs();
    f64::from_bits(x.to_bits() + 1) - x
}
