//! Dual numbers: a value and its derivative along one direction (forward mode).
//!
//! Source: W. K. Clifford, Preliminary sketch of biquaternions, 1873; A. Griewank, A. Walther, Evaluating
//! Derivatives, 2008, chapter 3. The module deliberately does not know what is differentiated, nor by how many
//! variables: one direction at a time.

use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::Real;
use crate::real::assign_operators;

/// `value + derivative ε` with `ε² = 0`: `f(Dual)` has the value `f(x)` and the derivative `f'(x) x'`.
///
/// The derivative has the accuracy of the scalar, no step being taken. It is infinite or NaN where the function has
/// none: `sqrt` and `abs` at zero, `asin` and `acos` at `±1`, `atan2` at the origin. Comparisons, step-size
/// control and [`magnitude`](Real::magnitude) see the value alone; [`all_finite`](Real::all_finite) sees both. Duals of
/// duals have second derivatives.
///
/// ```
/// use hamel_runtime::{Dual, Real};
///
/// let x = Dual::variable(0.5);
/// let y = x * x.sin();
/// assert_eq!(y.value, 0.5 * 0.5_f64.sin());
/// assert!((y.derivative - (0.5_f64.sin() + 0.5 * 0.5_f64.cos())).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual<R = f64> {
    /// The value.
    pub value: R,
    /// The derivative of the value along the chosen direction.
    pub derivative: R,
}

impl<R: Real> Dual<R> {
    /// A value with its derivative.
    #[inline]
    #[must_use]
    pub const fn new(value: R, derivative: R) -> Self {
        Self { value, derivative }
    }

    /// A value that does not depend on the variable.
    #[inline]
    #[must_use]
    pub const fn constant(value: R) -> Self {
        Self::new(value, R::ZERO)
    }

    /// The variable itself: its derivative is one.
    #[inline]
    #[must_use]
    pub const fn variable(value: R) -> Self {
        Self::new(value, R::ONE)
    }

    /// A function of this number, from its value and its slope there.
    #[inline]
    fn chain(self, value: R, slope: R) -> Self {
        Self::new(value, self.derivative * slope)
    }

    /// `1 - value^2` without cancellation.
    #[inline]
    fn complement(self) -> R {
        (R::ONE - self.value) * (R::ONE + self.value)
    }
}

impl<R: Real> From<R> for Dual<R> {
    #[inline]
    fn from(value: R) -> Self {
        Self::constant(value)
    }
}

impl<R: Real> Add for Dual<R> {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(self.value + other.value, self.derivative + other.derivative)
    }
}

impl<R: Real> Sub for Dual<R> {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        Self::new(self.value - other.value, self.derivative - other.derivative)
    }
}

impl<R: Real> Neg for Dual<R> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::new(-self.value, -self.derivative)
    }
}

/// `(x y)' = x' y + x y'`.
impl<R: Real> Mul for Dual<R> {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let derivative = self.derivative.mul_add(other.value, self.value * other.derivative);
        Self::new(self.value * other.value, derivative)
    }
}

/// `(x/y)' = (x' - (x/y) y')/y`.
impl<R: Real> Div for Dual<R> {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let quotient = self.value / other.value;
        Self::new(quotient, (self.derivative - quotient * other.derivative) / other.value)
    }
}

assign_operators! { [<R: Real>] Dual<R> }

impl<R: Real> Real for Dual<R> {
    const ZERO: Self = Self::constant(R::ZERO);
    const ONE: Self = Self::constant(R::ONE);
    const EPSILON: f64 = R::EPSILON;
    const MIN_POSITIVE: f64 = R::MIN_POSITIVE;

    #[inline]
    fn from_f64(x: f64) -> Self {
        Self::constant(R::from_f64(x))
    }
    #[inline]
    fn from_parts(hi: f64, lo: f64) -> Self {
        Self::constant(R::from_parts(hi, lo))
    }
    #[inline]
    fn ratio(p: f64, q: f64) -> Self {
        Self::constant(R::ratio(p, q))
    }
    #[inline]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        let derivative = self.value.mul_add(factor.derivative, addend.derivative);
        Self::new(
            self.value.mul_add(factor.value, addend.value),
            self.derivative.mul_add(factor.value, derivative),
        )
    }
    /// Derivatives of errors are errors of derivatives.
    #[inline]
    fn sum_error(self, other: Self) -> Self {
        let derivative = self.derivative.sum_error(other.derivative);
        Self::new(self.value.sum_error(other.value), derivative)
    }
    #[inline]
    fn product_error(self, other: Self) -> Self {
        Self::constant(self.value.product_error(other.value))
    }
    #[inline]
    fn circle_error(self, cosine: Self) -> Self {
        Self::constant(self.value.circle_error(cosine.value))
    }
    #[inline]
    fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        Self::new(root, self.derivative / (root + root))
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
        let (sine, cosine) = self.value.sin_cos();
        (self.chain(sine, cosine), self.chain(cosine, -sine))
    }
    #[inline]
    fn tan(self) -> Self {
        let tangent = self.value.tan();
        self.chain(tangent, tangent.mul_add(tangent, R::ONE))
    }
    #[inline]
    fn asin(self) -> Self {
        Self::new(self.value.asin(), self.derivative / self.complement().sqrt())
    }
    #[inline]
    fn acos(self) -> Self {
        Self::new(self.value.acos(), -self.derivative / self.complement().sqrt())
    }
    #[inline]
    fn atan(self) -> Self {
        Self::new(self.value.atan(), self.derivative / self.value.mul_add(self.value, R::ONE))
    }
    /// `(x y' - y x')/(x^2 + y^2)`.
    #[inline]
    fn atan2(self, x: Self) -> Self {
        let y = self;
        let square = x.value.mul_add(x.value, y.value * y.value);
        let numerator = x.value * y.derivative - y.value * x.derivative;
        Self::new(y.value.atan2(x.value), numerator / square)
    }
    #[inline]
    fn exp(self) -> Self {
        let exp = self.value.exp();
        self.chain(exp, exp)
    }
    #[inline]
    fn ln(self) -> Self {
        Self::new(self.value.ln(), self.derivative / self.value)
    }
    #[inline]
    fn sinh(self) -> Self {
        self.chain(self.value.sinh(), self.value.cosh())
    }
    #[inline]
    fn cosh(self) -> Self {
        self.chain(self.value.cosh(), self.value.sinh())
    }
    /// The slope is `1/cosh^2`, which keeps its digits where `1 - tanh^2` has lost them.
    #[inline]
    fn tanh(self) -> Self {
        let sech = self.value.cosh().recip();
        self.chain(self.value.tanh(), sech * sech)
    }
    #[inline]
    fn abs(self) -> Self {
        let size = self.value.abs();
        self.chain(size, size / self.value)
    }
    /// The slope is `(k c_(k+2) - c_(k+1))/2`.
    fn stumpff(self, k: u32) -> Self {
        let factor = R::from_f64(f64::from(k));
        let slope = (factor * self.value.stumpff(k + 2) - self.value.stumpff(k + 1)) * R::from_f64(0.5);
        self.chain(self.value.stumpff(k), slope)
    }
    /// The slope is `(k + 1) turn_(k+1)`.
    fn turn(self, k: u32) -> Self {
        let slope = R::from_f64(f64::from(k + 1)) * self.value.turn(k + 1);
        self.chain(self.value.turn(k), slope)
    }
    #[inline]
    fn all_gt(self, other: Self) -> bool {
        self.value.all_gt(other.value)
    }
    #[inline]
    fn all_ge(self, other: Self) -> bool {
        self.value.all_ge(other.value)
    }
    #[inline]
    fn all_ne(self, other: Self) -> bool {
        self.value.all_ne(other.value)
    }
    #[inline]
    fn all_finite(self) -> bool {
        self.value.all_finite() && self.derivative.all_finite()
    }
    #[inline]
    fn magnitude(self) -> f64 {
        self.value.magnitude()
    }
}

#[cfg(test)]
mod tests {
    use super::Dual;
    use crate::{DoubleDouble, Real};

    /// Every function of one variable, with points of its domain.
    macro_rules! for_each_function {
        ($visit:ident) => {
            $visit! {
                sqrt: |x| x.sqrt(); [0.3, 2.0]
                stumpff_1: |x| x.stumpff(1); [-7.0, 0.0, 0.4, 30.0]
                stumpff_2: |x| x.stumpff(2); [-7.0, 0.0, 0.4, 30.0]
                turn_0: |x| x.turn(0); [0.0, 0.3, 0.45, 0.9]
                turn_1: |x| x.turn(1); [0.0, 0.3, 0.45, 0.9]
                sin: |x| x.sin(); [-2.0, 0.0, 0.4]
                cos: |x| x.cos(); [-2.0, 0.1, 0.4]
                sin_cos: |x| { let (s, c) = (x + x).sin_cos(); s * c + s }; [-2.0, 0.1]
                tan: |x| x.tan(); [-1.2, 0.0, 0.4]
                asin: |x| x.asin(); [-0.9, 0.0, 0.99]
                acos: |x| x.acos(); [-0.9, 0.0, 0.99]
                atan: |x| x.atan(); [-3.0, 0.0, 0.7]
                atan2: |x| (x * x - x).atan2(x - R::ratio(1.0, 3.0)); [-3.0, 0.1, 0.7]
                exp: |x| x.exp(); [-3.0, 0.0, 0.7]
                ln: |x| x.ln(); [0.01, 1.0, 7.0]
                sinh: |x| x.sinh(); [-3.0, 0.0, 0.7]
                cosh: |x| x.cosh(); [-3.0, 0.1, 0.7]
                tanh: |x| x.tanh(); [-3.0, 0.0, 0.7, 9.0]
                abs: |x| x.abs(); [-3.0, 0.7]
                recip: |x| x.recip(); [-3.0, 0.7]
                quotient: |x| (x + R::ONE) / (x * x - R::from_f64(0.2)); [-3.0, 0.7]
                mul_add: |x| x.mul_add(x * x, -x); [-3.0, 0.7]
                assigned: |x| { let mut y = x; y += x; y *= x; y -= R::ONE; y /= x; y }; [-3.0, 0.7]
            }
        };
    }

    /// A central difference with the step 1e-10 in 106 bits: its error is 1e-20 of the third derivative and 1e-21 of
    /// the value, below the precision of `f64`.
    macro_rules! against_differences {
        ($($name:ident: |$x:ident| $body:expr; [$($point:literal),*])*) => {$({
            fn function<R: Real>($x: R) -> R {
                $body
            }
            for x in [$($point),*] {
                let dual = function(Dual::variable(x));
                let (h, at) = (DoubleDouble::from(1e-10), DoubleDouble::from(x));
                let difference = ((function(at + h) - function(at - h)) / (h + h)).hi();
                let tolerance = 1e-14 * difference.abs().max(1e-3);
                let label = stringify!($name);
                assert_eq!(dual.value.to_bits(), function(x).to_bits(), "{label}({x})");
                assert!((dual.derivative - difference).abs() <= tolerance,
                    "{label}'({x}): {} and {difference}", dual.derivative);
            }
        })*};
    }

    #[test]
    fn derivatives_are_limits_of_differences() {
        for_each_function!(against_differences);
    }

    /// Derivatives of duals along a direction are multiplied by it, and constants have none.
    macro_rules! along_a_direction {
        ($($name:ident: |$x:ident| $body:expr; [$($point:literal),*])*) => {$({
            fn function<R: Real>($x: R) -> R {
                $body
            }
            for x in [$($point),*] {
                let once = function(Dual::variable(x)).derivative;
                let twice = function(Dual::new(x, 2.0)).derivative;
                assert!((twice - 2.0 * once).abs() <= 1e-15 * twice.abs(), "{}", stringify!($name));
                assert_eq!(function(Dual::constant(x)).derivative, 0.0, "{}", stringify!($name));
            }
        })*};
    }

    #[test]
    fn derivatives_are_linear_in_the_direction() {
        for_each_function!(along_a_direction);
    }

    #[test]
    fn duals_of_duals_have_second_derivatives() {
        let x = Dual::variable(Dual::variable(0.7));
        let second = (x.sin() * x.exp()).derivative.derivative;
        assert!((second - 2.0 * 0.7_f64.cos() * 0.7_f64.exp()).abs() < 1e-14);
    }

    #[test]
    fn missing_derivatives_are_not_finite() {
        let (zero, one) = (Dual::variable(0.0), Dual::variable(1.0));
        assert!(!zero.sqrt().all_finite() && !zero.abs().all_finite() && !zero.atan2(zero).all_finite());
        assert!(!one.asin().all_finite() && !one.acos().all_finite());
        assert!(one.all_finite() && one.all_gt(zero) && one.all_ge(one) && one.all_ne(zero));
        assert_eq!(Dual::new(-2.0, 5.0).magnitude(), 2.0);
    }
}
