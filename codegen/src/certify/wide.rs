//! A number to 31 digits that carries a bound of its own error.
//!
//! Does not know: expressions, programs, what is compared.

use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use hamel_runtime::{DoubleDouble, Real};

/// Relative error of an operation on double-double numbers: arithmetic stays below `2^-103`, elementary functions below
/// `2^-101` (`runtime/src/double_double.rs`).
const UNIT: f64 = 1.0 / (1u128 << 100) as f64;

/// A double-double number and a bound of the error that all operations before made in it.
///
/// `e(a + b) = e(a) + e(b) + u|a + b|`, `e(ab) = |a| e(b) + |b| e(a) + e(a) e(b) + u|ab|`,
/// `e(f(a)) = |f'(a)| e(a) + u|f(a)|` to first order.
///
/// # Source
/// Higham, Accuracy and Stability of Numerical Algorithms, 2002, section 3.3 (running error analysis).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Wide {
    value: DoubleDouble,
    error: f64,
}

impl Wide {
    pub(super) fn exact(x: f64) -> Wide {
        Wide { value: x.into(), error: 0.0 }
    }

    /// The value, as if it had no error.
    pub(super) fn of(x: Wide) -> Wide {
        Wide { error: 0.0, ..x }
    }

    /// The number with a further error.
    pub(super) fn uncertain(self, error: f64) -> Wide {
        Wide { error: self.error + error, ..self }
    }

    pub(super) fn size(self) -> f64 {
        self.value.hi().abs()
    }

    pub(super) fn to_f64(self) -> f64 {
        self.value.hi()
    }

    pub(super) fn error(self) -> f64 {
        self.error
    }

    fn rounded(value: DoubleDouble, error: f64) -> Wide {
        Wide { value, error: error + UNIT * value.hi().abs() }
    }

    /// A function with that slope.
    fn chain(self, value: DoubleDouble, slope: f64) -> Wide {
        let carried = if self.error == 0.0 { 0.0 } else { slope.abs() * self.error };
        Wide::rounded(value, carried)
    }
}

impl Add for Wide {
    type Output = Wide;
    fn add(self, other: Wide) -> Wide {
        Wide::rounded(self.value + other.value, self.error + other.error)
    }
}

impl Sub for Wide {
    type Output = Wide;
    fn sub(self, other: Wide) -> Wide {
        self + -other
    }
}

impl Neg for Wide {
    type Output = Wide;
    fn neg(self) -> Wide {
        Wide { value: -self.value, ..self }
    }
}

impl Mul for Wide {
    type Output = Wide;
    fn mul(self, other: Wide) -> Wide {
        let error = self.size() * other.error + other.size() * self.error + self.error * other.error;
        Wide::rounded(self.value * other.value, error)
    }
}

impl Div for Wide {
    type Output = Wide;
    fn div(self, other: Wide) -> Wide {
        let value = self.value / other.value;
        // A divisor that may be zero has a quotient without any digits.
        let divisor = other.size() - other.error;
        let error = match divisor > 0.0 {
            true => (self.error + value.hi().abs() * other.error) / divisor,
            false => f64::INFINITY,
        };
        Wide::rounded(value, error)
    }
}

macro_rules! assign {
    ($($trait:ident $method:ident $op:tt;)*) => { $(
        impl $trait for Wide {
            fn $method(&mut self, other: Wide) {
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

impl Real for Wide {
    const ZERO: Wide = Wide { value: DoubleDouble::ZERO, error: 0.0 };
    const ONE: Wide = Wide { value: DoubleDouble::ONE, error: 0.0 };
    const EPSILON: f64 = DoubleDouble::EPSILON;

    fn from_f64(x: f64) -> Wide {
        Wide::exact(x)
    }

    fn from_parts(hi: f64, lo: f64) -> Wide {
        // Two parts are a number that was rounded to them.
        let value = DoubleDouble::from_parts(hi, lo);
        if lo == 0.0 { Wide { value, error: 0.0 } } else { Wide::rounded(value, 0.0) }
    }

    fn sqrt(self) -> Wide {
        let root = self.value.sqrt();
        self.chain(root, 0.5 / root.hi())
    }
    fn sin(self) -> Wide {
        self.sin_cos().0
    }
    fn cos(self) -> Wide {
        self.sin_cos().1
    }
    fn sin_cos(self) -> (Wide, Wide) {
        let (sine, cosine) = self.value.sin_cos();
        (self.chain(sine, cosine.hi()), self.chain(cosine, sine.hi()))
    }
    fn tan(self) -> Wide {
        let (sine, cosine) = self.sin_cos();
        sine / cosine
    }
    fn asin(self) -> Wide {
        let cosine = ((DoubleDouble::ONE - self.value) * (DoubleDouble::ONE + self.value)).sqrt();
        self.chain(self.value.asin(), 1.0 / cosine.hi())
    }
    fn acos(self) -> Wide {
        let sine = ((DoubleDouble::ONE - self.value) * (DoubleDouble::ONE + self.value)).sqrt();
        self.chain(self.value.acos(), 1.0 / sine.hi())
    }
    fn atan(self) -> Wide {
        let x = self.value.hi();
        self.chain(self.value.atan(), 1.0 / (1.0 + x * x))
    }
    fn atan2(self, x: Wide) -> Wide {
        let square = self.size() * self.size() + x.size() * x.size();
        let error = (x.size() * self.error + self.size() * x.error) / square;
        Wide::rounded(self.value.atan2(x.value), error)
    }
    fn exp(self) -> Wide {
        let value = self.value.exp();
        self.chain(value, value.hi())
    }
    fn ln(self) -> Wide {
        self.chain(self.value.ln(), 1.0 / self.value.hi())
    }
    fn sinh(self) -> Wide {
        self.chain(self.value.sinh(), self.value.cosh().hi())
    }
    fn cosh(self) -> Wide {
        self.chain(self.value.cosh(), self.value.sinh().hi())
    }
    fn tanh(self) -> Wide {
        let value = self.value.tanh();
        self.chain(value, 1.0 - value.hi() * value.hi())
    }
    fn abs(self) -> Wide {
        Wide { value: self.value.abs(), ..self }
    }
    fn stumpff(self, k: u32) -> Wide {
        let z = self.value;
        let [own, one, two] = [0, 1, 2].map(|j| z.stumpff(k + j));
        let slope = 0.5 * (f64::from(k) * two.hi() - one.hi());
        // Sums of the series and of the recursion cancel to numbers below one.
        self.chain(own, slope).uncertain(UNIT)
    }
    fn turn(self, k: u32) -> Wide {
        let [own, next] = [0, 1].map(|j| self.value.turn(k + j));
        self.chain(own, f64::from(k + 1) * next.hi())
    }
    fn all_gt(self, other: Wide) -> bool {
        self.value > other.value
    }
    fn all_ge(self, other: Wide) -> bool {
        self.value >= other.value
    }
    fn all_ne(self, other: Wide) -> bool {
        self.value != other.value
    }
    fn all_finite(self) -> bool {
        self.value.all_finite() && self.error.is_finite()
    }
    fn magnitude(self) -> f64 {
        self.size()
    }
}
