//! Numbers of 106 bits as unevaluated sums of two `f64`: the arithmetic against which that of `f64` is measured.
//!
//! Sources: T. J. Dekker, A floating-point technique for extending the available precision, 1971; M. Joldes, J.-M.
//! Muller, V. Popescu, Tight and rigorous error bounds for basic building blocks of double-word arithmetic, 2017
//! (sum: algorithm 6, product: algorithm 12); Y. Hida, X. S. Li, D. H. Bailey, Library for double-double and
//! quad-double arithmetic, 2001. The module deliberately does not know correct rounding: the last two or three bits
//! of a result are not the nearest ones.

use core::fmt;
use core::ops::{Add, Div, Mul, Neg, Sub};

use crate::Real;
use crate::math;
use crate::real::assign_operators;

/// A number `hi + lo` of about 106 bits, 31 to 32 decimal digits, with the exponents of `f64`.
///
/// The relative error of every operation and function of [`Real`] is below 2e-31 (`+ - * / sqrt`: below 1e-31) where
/// it is neither within 1e32 of the smallest nor within a factor 2 of the largest `f64`: there digits of `lo` are
/// lost. The sine near a multiple of `pi` and the like keep this relative error down to angles that differ from it by
/// 1e-20, and an absolute error of 1e-49 below. Sine, cosine and tangent of angles beyond `2^50` are NaN.
///
/// ```
/// use hamel_runtime::{DoubleDouble, Real};
///
/// let third = DoubleDouble::ratio(1.0, 3.0);
/// assert_eq!(third.to_string(), "3.333333333333333333333333333333e-1");
/// assert_eq!(third * DoubleDouble::from(3.0), DoubleDouble::ONE);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct DoubleDouble {
    hi: f64,
    lo: f64,
}

/// `x + y = sum + error` exactly (Knuth).
#[inline]
fn two_sum(x: f64, y: f64) -> (f64, f64) {
    let sum = x + y;
    let part = sum - x;
    (sum, (x - (sum - part)) + (y - part))
}

/// `x y = product + error` exactly, unless it underflows (by fusion, or Dekker and Veltkamp).
#[inline]
fn two_product(x: f64, y: f64) -> (f64, f64) {
    let product = x * y;
    if math::FUSED {
        return (product, math::mul_add(x, y, -product));
    }
    /// The upper 26 bits and the rest; large numbers are scaled, as the factor would overflow them.
    fn split(x: f64) -> (f64, f64) {
        const FACTOR: f64 = 134_217_729.0; // 2^27 + 1
        const LARGE: f64 = 6.7e299;
        const SCALE: f64 = 268_435_456.0; // 2^28
        let scale = if math::abs(x) > LARGE { SCALE } else { 1.0 };
        let x = x / scale;
        let t = FACTOR * x;
        let upper = t - (t - x);
        (upper * scale, (x - upper) * scale)
    }
    let ((a, b), (c, d)) = (split(x), split(y));
    (product, ((a * c - product) + a * d + b * c) + b * d)
}

/// `n + 1.5 * 2^52 - 1.5 * 2^52`: the integer nearest to a number below `2^51`.
#[inline]
fn nearest(x: f64) -> f64 {
    const SHIFTER: f64 = 6_755_399_441_055_744.0;
    (x + SHIFTER) - SHIFTER
}

/// `2^k` for a normal result.
#[inline]
fn power_of_two(k: i32) -> f64 {
    f64::from_bits(((k + 1023) as u64) << 52)
}

impl DoubleDouble {
    /// Half of pi in four parts, for the reduction of angles.
    const HALF_PI: [f64; 4] = [
        core::f64::consts::FRAC_PI_2,
        6.123_233_995_736_766e-17,
        -1.497_384_904_859_169_8e-33,
        5.562_271_104_316_826e-50,
    ];
    /// Natural logarithm of 2 in three parts.
    const LN_2: [f64; 3] = [core::f64::consts::LN_2, 2.319_046_813_846_299_6e-17, 5.707_708_438_416_212e-34];
    /// `1/n!`, upper and lower part.
    const RECIPROCAL_FACTORIALS: [(f64, f64); 30] = [
        (1.0, 0.0),
        (1.0, 0.0),
        (0.5, 0.0),
        (0.166_666_666_666_666_66, 9.251_858_538_542_97e-18),
        (0.041_666_666_666_666_664, 2.312_964_634_635_742_7e-18),
        (0.008_333_333_333_333_333, 1.156_482_317_317_871_4e-19),
        (0.001_388_888_888_888_889, -5.300_543_954_373_577e-20),
        (0.000_198_412_698_412_698_4, 1.720_955_829_342_070_5e-22),
        (2.480_158_730_158_73e-5, 2.151_194_786_677_588_2e-23),
        (2.755_731_922_398_589_3e-6, -1.858_393_274_046_472e-22),
        (2.755_731_922_398_589e-7, 2.376_771_462_225_029_7e-23),
        (2.505_210_838_544_172e-8, -1.448_814_070_935_912e-24),
        (2.087_675_698_786_81e-9, -1.207_345_059_113_26e-25),
        (1.605_904_383_682_161_3e-10, 1.258_529_458_875_209_8e-26),
        (1.147_074_559_772_972_5e-11, 2.065_551_275_283_074_5e-28),
        (7.647_163_731_819_816e-13, 7.038_728_777_334_53e-30),
        (4.779_477_332_387_385e-14, 4.399_205_485_834_081e-31),
        (2.811_457_254_345_520_6e-15, 1.650_884_273_086_143_3e-31),
        (1.561_920_696_858_622_5e-16, 1.191_067_966_027_375_4e-32),
        (8.220_635_246_624_33e-18, 2.214_189_411_960_426_5e-34),
        (4.110_317_623_312_165e-19, 1.441_297_337_865_952_7e-36),
        (1.957_294_106_339_126_3e-20, -1.364_350_383_008_790_8e-36),
        (8.896_791_392_450_574e-22, -7.911_402_614_872_376e-38),
        (3.868_170_170_630_684e-23, -8.843_177_655_482_344e-40),
        (1.611_737_571_096_118_4e-24, -3.684_657_356_450_976_6e-41),
        (6.446_950_284_384_474e-26, -1.933_040_423_370_346_5e-42),
        (2.479_596_263_224_797_6e-27, -1.295_373_096_476_522_9e-43),
        (9.183_689_863_795_546e-29, 1.430_315_039_678_732_2e-45),
        (3.279_889_237_069_838e-30, 1.511_754_274_402_987_9e-46),
        (1.130_996_288_644_771_6e-31, 1.049_801_541_295_950_6e-47),
    ];
    /// The largest angle whose functions are computed: `2^50`.
    const LARGEST_ANGLE: f64 = 1_125_899_906_842_624.0;

    /// The sum `x + y`, exactly.
    ///
    /// ```
    /// use hamel_runtime::{DoubleDouble, Real};
    ///
    /// let x = DoubleDouble::sum_of(1.0, 1e-25);
    /// assert_eq!((x - DoubleDouble::ONE).hi(), 1e-25);
    /// ```
    #[must_use]
    pub fn sum_of(x: f64, y: f64) -> Self {
        let (hi, lo) = two_sum(x, y);
        Self::normal(hi, lo)
    }

    /// The nearest `f64`.
    #[inline]
    #[must_use]
    pub const fn hi(self) -> f64 {
        self.hi
    }

    /// What is missing to [`hi`](Self::hi): at most half a unit in its last place.
    #[inline]
    #[must_use]
    pub const fn lo(self) -> f64 {
        self.lo
    }

    /// `hi + lo` where `hi` dominates; a zero keeps its sign, and an infinity does not become NaN.
    #[inline]
    fn normal(hi: f64, lo: f64) -> Self {
        if lo == 0.0 || !hi.is_finite() {
            return Self { hi, lo: 0.0 };
        }
        let sum = hi + lo;
        Self { hi: sum, lo: if sum.is_finite() { lo - (sum - hi) } else { 0.0 } }
    }

    #[inline]
    fn product_of(x: f64, y: f64) -> Self {
        let (hi, lo) = two_product(x, y);
        Self::normal(hi, lo)
    }

    /// The product by a power of two, exactly.
    #[inline]
    fn scaled(self, power: f64) -> Self {
        Self::normal(self.hi * power, self.lo * power)
    }

    /// `self - n (p0 + p1 + ..)`; exact but for the sums.
    fn minus_multiple(self, n: f64, parts: &[f64]) -> Self {
        if n == 0.0 {
            return self;
        }
        parts.iter().fold(self, |rest, &part| rest - Self::product_of(n, part))
    }

    /// `sum_k self^k/(first + k step)!`, its first `n` terms.
    fn factorial_series(self, first: usize, step: usize, n: usize) -> Self {
        let terms = Self::RECIPROCAL_FACTORIALS[first..].iter().step_by(step).take(n);
        terms.rev().fold(Self::ZERO, |sum, &(hi, lo)| Self { hi, lo } + self * sum)
    }

    /// `exp(self) - 1` with its relative error for `|self| <= 0.7`, by the series at `self/32` and five doublings.
    fn small_exp_m1(self) -> Self {
        let r = self.scaled(1.0 / 32.0);
        // e^2x - 1 = (e^x - 1) (e^x - 1 + 2)
        (0..5).fold(r * r.factorial_series(1, 1, 14), |p, _| p * (p + Self::from(2.0)))
    }

    /// An odd function from its values for positive numbers; a zero keeps its sign.
    fn odd(self, function: impl Fn(Self) -> Self) -> Self {
        let value = function(self.abs());
        if self.hi.is_sign_negative() { -value } else { value }
    }

    /// `exp(self) - 1`.
    fn exp_m1(self) -> Self {
        if math::abs(self.hi) <= 0.7 { self.small_exp_m1() } else { Real::exp(self) - Self::ONE }
    }

    /// The angle less the nearest multiple of `pi/2`, and that multiple.
    fn reduced(self) -> (Self, i64) {
        if math::abs(self.hi) > Self::LARGEST_ANGLE {
            return (f64::NAN.into(), 0);
        }
        let n = nearest(self.hi * core::f64::consts::FRAC_2_PI);
        (self.minus_multiple(n, &Self::HALF_PI), n as i64)
    }

    /// The sine of `|self| < 0.8`.
    fn small_sin(self) -> Self {
        self * (-(self * self)).factorial_series(1, 2, 15)
    }

    /// The cosine of `|self| < 0.8`.
    fn small_cos(self) -> Self {
        (-(self * self)).factorial_series(0, 2, 15)
    }

    /// `sqrt(1 - self^2)`.
    fn complement(self) -> Self {
        Real::sqrt((Self::ONE - self) * (Self::ONE + self))
    }
}

impl From<f64> for DoubleDouble {
    #[inline]
    fn from(x: f64) -> Self {
        Self { hi: x, lo: 0.0 }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        let (hi, error) = two_sum(self.hi, other.hi);
        let (lo, lost) = two_sum(self.lo, other.lo);
        let sum = Self::normal(hi, error + lo);
        Self::normal(sum.hi, lost + sum.lo)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for DoubleDouble {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { hi: -self.hi, lo: -self.lo }
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let (hi, error) = two_product(self.hi, other.hi);
        let cross = self.lo * other.lo + self.hi * other.lo;
        Self::normal(hi, error + (cross + self.lo * other.hi))
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        let first = self.hi / other.hi;
        if first == 0.0 || !first.is_finite() || !other.hi.is_finite() {
            return first.into();
        }
        // Long division by three digits in the base 2^53.
        let rest = self - other * first.into();
        let second = rest.hi / other.hi;
        let third = (rest - other * second.into()).hi / other.hi;
        Self::normal(first, second) + third.into()
    }
}

assign_operators! { [] DoubleDouble }

impl Real for DoubleDouble {
    const ZERO: Self = Self { hi: 0.0, lo: 0.0 };
    const ONE: Self = Self { hi: 1.0, lo: 0.0 };
    /// `2^-104`.
    const EPSILON: f64 = f64::EPSILON * f64::EPSILON;
    /// `2^-969`: the last digit of `lo` is the smallest `f64`.
    const MIN_POSITIVE: f64 = f64::MIN_POSITIVE / (0.5 * f64::EPSILON);

    #[inline]
    fn from_f64(x: f64) -> Self {
        x.into()
    }

    #[inline]
    fn from_parts(hi: f64, lo: f64) -> Self {
        Self::normal(hi, lo)
    }

    fn sqrt(self) -> Self {
        let root = math::sqrt(self.hi);
        if root == 0.0 || !root.is_finite() {
            return root.into();
        }
        let rest = self - Self::product_of(root, root);
        Self::normal(root, rest.hi / (2.0 * root))
    }

    fn sin(self) -> Self {
        let (r, n) = self.reduced();
        let value = if n & 1 == 0 { r.small_sin() } else { r.small_cos() };
        if n & 2 == 0 { value } else { -value }
    }

    fn cos(self) -> Self {
        let (r, n) = self.reduced();
        let value = if n & 1 == 0 { r.small_cos() } else { r.small_sin() };
        if (n + 1) & 2 == 0 { value } else { -value }
    }

    fn sin_cos(self) -> (Self, Self) {
        let (r, n) = self.reduced();
        let (sine, cosine) = (r.small_sin(), r.small_cos());
        match n & 3 {
            0 => (sine, cosine),
            1 => (cosine, -sine),
            2 => (-sine, -cosine),
            _ => (-cosine, sine),
        }
    }

    fn tan(self) -> Self {
        let (sine, cosine) = self.sin_cos();
        sine / cosine
    }

    fn asin(self) -> Self {
        self.atan2(self.complement())
    }

    fn acos(self) -> Self {
        self.complement().atan2(self)
    }

    fn atan(self) -> Self {
        self.atan2(Self::ONE)
    }

    fn atan2(self, x: Self) -> Self {
        if self.hi.is_nan() || x.hi.is_nan() {
            return f64::NAN.into();
        }
        // Only directions count: infinities become ones beside zeros, and the larger number comes near one.
        let infinite = self.hi.is_infinite() || x.hi.is_infinite();
        let direction = |v: Self| {
            let size: f64 = if v.hi.is_infinite() { 1.0 } else { 0.0 };
            if infinite { size.copysign(v.hi).into() } else { v }
        };
        let (mut y, mut x) = (direction(self), direction(x));
        let largest = math::abs(y.hi).max(math::abs(x.hi));
        if largest == 0.0 {
            x = 1.0_f64.copysign(x.hi).into();
        } else if !(1e-100..1e100).contains(&largest) {
            let scale = if largest < 1.0 { power_of_two(600) } else { power_of_two(-600) };
            (y, x) = (y.scaled(scale), x.scaled(scale));
        }
        // tan(angle - guess) = (y cos(guess) - x sin(guess))/(x cos(guess) + y sin(guess)), and the angle left
        // is of the order 2^-53, so that its cube, which is not computed, is below 2^-159.
        let guess = Self::from(math::atan2(y.hi, x.hi));
        if guess.hi == 0.0 {
            return guess;
        }
        let (sine, cosine) = guess.sin_cos();
        guess + (y * cosine - x * sine) / (x * cosine + y * sine)
    }

    fn exp(self) -> Self {
        if self.hi > 710.0 {
            return f64::INFINITY.into();
        }
        if self.hi < -750.0 {
            return Self::ZERO;
        }
        let k = nearest(self.hi * core::f64::consts::LOG2_E);
        let power = Self::ONE + self.minus_multiple(k, &Self::LN_2).small_exp_m1();
        // In two factors, since neither 2^1024 nor 2^-1080 is a normal number.
        let k = k as i32;
        power.scaled(power_of_two(k / 2)).scaled(power_of_two(k - k / 2))
    }

    fn ln(self) -> Self {
        if !(self.hi > 0.0 && self.hi.is_finite()) {
            return math::ln(self.hi).into();
        }
        // self = m 2^k with m in [0.7, 1.4], so that k is 0 where the logarithm is small.
        let (number, shift) =
            if self.hi < 1e-290 { (self.scaled(power_of_two(200)), -200) } else { (self, 0) };
        let bits = (number.hi * core::f64::consts::SQRT_2).to_bits();
        let k = (bits >> 52) as i32 - 1023;
        let m = number.scaled(power_of_two(-k / 2)).scaled(power_of_two(-k - -k / 2));
        // Halley: ln m = g + 2 (m/e^g - 1)/(m/e^g + 1), which triples the 53 bits of g.
        let guess = Self::from(math::ln(m.hi));
        let rest = m * (-guess).small_exp_m1() + (m - Self::ONE);
        let ln_m = guess + (rest + rest) / (rest + Self::from(2.0));
        ln_m.minus_multiple(-f64::from(k + shift), &Self::LN_2)
    }

    fn sinh(self) -> Self {
        self.odd(|x| {
            if x.hi > 40.0 {
                let half = Real::exp(x.scaled(0.5));
                return half.scaled(0.5) * half;
            }
            // (e^x - e^-x)/2 = (p + p/(p + 1))/2 with p = e^x - 1
            let p = x.exp_m1();
            (p + p / (p + Self::ONE)).scaled(0.5)
        })
    }

    fn cosh(self) -> Self {
        let half = Real::exp(self.abs().scaled(0.5));
        let product = half.scaled(0.5) * half;
        product + product.recip().scaled(0.25)
    }

    fn tanh(self) -> Self {
        self.odd(|x| {
            let p = x.scaled(2.0).exp_m1();
            // 1 - tanh 40 is below 4e-35.
            if x.hi > 40.0 { Self::ONE } else { p / (p + Self::from(2.0)) }
        })
    }

    #[inline]
    fn abs(self) -> Self {
        if self.hi.is_sign_negative() { -self } else { self }
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
        self.hi.is_finite()
    }

    #[inline]
    fn magnitude(self) -> f64 {
        math::abs(self.hi)
    }
}

/// Scientific notation with 31 digits, or with one more than the precision asked for, at most 31.
impl fmt::Display for DoubleDouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const DIGITS: usize = 31;
        if self.hi == 0.0 || !self.hi.is_finite() {
            return fmt::Display::fmt(&self.hi, f);
        }
        let n = f.precision().map_or(DIGITS, |precision| precision.saturating_add(1).min(DIGITS));
        // 10^22 is the largest exact power.
        let ten = |k: i32| Self::from((0..k).fold(1.0, |power, _| 10.0 * power));
        let (mut m, mut exponent) = (self.abs(), 0);
        while m.hi >= 1e22 {
            // Both scaled, as a division has no digits at the largest numbers.
            let scale = power_of_two(-72);
            (m, exponent) = (m.scaled(scale) / ten(22).scaled(scale), exponent + 22);
        }
        while m.hi < 1.0 {
            (m, exponent) = (m * ten(22), exponent - 22);
        }
        let (mut low, mut high) = (0, 22);
        while high - low > 1 {
            let middle = (low + high) / 2;
            if m >= ten(middle) { low = middle } else { high = middle }
        }
        (m, exponent) = (m / ten(low), exponent + low);

        let mut digits = [0_u8; DIGITS];
        for digit in &mut digits[..n] {
            // The quotient may be a last bit below one or at ten; carries put that right.
            *digit = (m.hi as u8).min(9);
            let whole = if m < Self::from(f64::from(*digit)) { *digit - 1 } else { *digit };
            *digit = whole;
            m = (m - f64::from(whole).into()) * 10.0.into();
        }
        let mut carry = u8::from(m >= 5.0.into());
        for digit in digits[..n].iter_mut().rev() {
            let sum = *digit + carry;
            (*digit, carry) = (sum % 10, sum / 10);
        }
        if carry == 1 {
            digits[0] = 1;
            exponent += 1;
        }
        f.write_str(if self.hi < 0.0 { "-" } else { "" })?;
        for (k, digit) in digits[..n].iter().enumerate() {
            write!(f, "{}{digit}", if k == 1 { "." } else { "" })?;
        }
        write!(f, "e{exponent}")
    }
}
