//! Numbers with the slope along one direction, to differentiate any program by running it.

use hamel_runtime::Real;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

/// `value + slope e` with `e^2 = 0`: forward-mode differentiation of whatever is computed with it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual<R> {
    /// The value.
    pub value: R,
    /// Its derivative.
    pub slope: R,
}

impl<R: Real> Dual<R> {
    /// A number that does not move.
    pub fn constant(value: R) -> Dual<R> {
        Dual { value, slope: R::ZERO }
    }

    fn chain(self, value: R, derivative: R) -> Dual<R> {
        Dual { value, slope: derivative * self.slope }
    }
}

impl<R: Real> Add for Dual<R> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Dual { value: self.value + other.value, slope: self.slope + other.slope }
    }
}

impl<R: Real> Sub for Dual<R> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Dual { value: self.value - other.value, slope: self.slope - other.slope }
    }
}

impl<R: Real> Mul for Dual<R> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Dual { value: self.value * other.value, slope: self.slope * other.value + self.value * other.slope }
    }
}

impl<R: Real> Div for Dual<R> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Dual { value, slope: (self.slope - value * other.slope) / other.value }
    }
}

impl<R: Real> Neg for Dual<R> {
    type Output = Self;
    fn neg(self) -> Self {
        Dual { value: -self.value, slope: -self.slope }
    }
}

macro_rules! assign {
    ($($name:ident $method:ident $op:tt;)*) => { $(
        impl<R: Real> $name for Dual<R> {
            fn $method(&mut self, other: Self) {
                *self = *self $op other;
            }
        }
    )* };
}

assign! { AddAssign add_assign +; SubAssign sub_assign -; MulAssign mul_assign *; DivAssign div_assign /; }

impl<R: Real> Real for Dual<R> {
    const ZERO: Self = Dual { value: R::ZERO, slope: R::ZERO };
    const ONE: Self = Dual { value: R::ONE, slope: R::ZERO };

    fn from_f64(x: f64) -> Self {
        Dual::constant(R::from_f64(x))
    }
    fn ratio(p: f64, q: f64) -> Self {
        Dual::constant(R::ratio(p, q))
    }
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, (root + root).recip())
    }
    fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }
    fn cos(self) -> Self {
        self.chain(self.value.cos(), -self.value.sin())
    }
    fn tan(self) -> Self {
        let tan = self.value.tan();
        self.chain(tan, R::ONE + tan * tan)
    }
    fn asin(self) -> Self {
        self.chain(self.value.asin(), (R::ONE - self.value * self.value).sqrt().recip())
    }
    fn acos(self) -> Self {
        self.chain(self.value.acos(), -(R::ONE - self.value * self.value).sqrt().recip())
    }
    fn atan(self) -> Self {
        self.chain(self.value.atan(), (R::ONE + self.value * self.value).recip())
    }
    fn atan2(self, x: Self) -> Self {
        let square = self.value * self.value + x.value * x.value;
        let slope = (self.slope * x.value - self.value * x.slope) / square;
        Dual { value: self.value.atan2(x.value), slope }
    }
    fn exp(self) -> Self {
        let exp = self.value.exp();
        self.chain(exp, exp)
    }
    fn ln(self) -> Self {
        self.chain(self.value.ln(), self.value.recip())
    }
    fn sinh(self) -> Self {
        self.chain(self.value.sinh(), self.value.cosh())
    }
    fn cosh(self) -> Self {
        self.chain(self.value.cosh(), self.value.sinh())
    }
    fn tanh(self) -> Self {
        let tanh = self.value.tanh();
        self.chain(tanh, R::ONE - tanh * tanh)
    }
    fn abs(self) -> Self {
        let abs = self.value.abs();
        self.chain(abs, abs / self.value)
    }
    fn all_gt(self, other: Self) -> bool {
        self.value.all_gt(other.value)
    }
    fn all_ge(self, other: Self) -> bool {
        self.value.all_ge(other.value)
    }
    fn all_ne(self, other: Self) -> bool {
        self.value.all_ne(other.value)
    }
    fn all_finite(self) -> bool {
        self.value.all_finite() && self.slope.all_finite()
    }
    fn magnitude(self) -> f64 {
        self.value.magnitude()
    }
}
