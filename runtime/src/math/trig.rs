//! Sine and cosine of `f64` and of several `f64` side by side, without calls and branches up to [`BOUND`].
//!
//! The angle is reduced by the nearest multiple of `pi/2` to `r - l` (Cody and Waite, three parts of `pi/2`), and both
//! functions of it come from polynomials of degree 13 and 14. The largest error that was measured, over 10^7 angles and
//! those next to all multiples of `pi/4`, is 0.79 units in the last place, or 0.73 where the target fuses
//! multiplication and addition. Every lane, and each of two angles, does the operations of the scalar function, hence
//! has its bits. The results are the same on all platforms that fuse, and on all that do not. The module
//! deliberately does not know angles beyond the bound: the standard library or `libm` answers for those.
//!
//! Sources: W. J. Cody, W. Waite, Software Manual for the Elementary Functions, 1980; the split of the cosine
//! is that of FDLIBM (Sun Microsystems, 1993). The polynomials are minimax by the Remez exchange in 300 bits.

use core::ops::{Add, Mul, Neg, Sub};

/// The largest angle that is reduced here, `2^18 pi/2` rounded down: `n` times a part of `pi/2` with 35 bits is exact.
pub const BOUND: f64 = 411_774.0;

/// `1.5 * 2^52`: added to a number below `2^51`, it leaves the nearest integer in the lowest bits.
const SHIFTER: f64 = 6_755_399_441_055_744.0;

/// `pi/2 = PART_1 + PART_2 + PART_3` up to 5e-40; the first two have 35 bits.
const PART_1: f64 = 1.570_796_326_792_333_3;
const PART_2: f64 = 2.563_344_151_583_955_8e-12;
const PART_3: f64 = 1.056_299_906_698_742_8e-23;

/// Coefficients `[S, C]` of `sin r = r - r^3 (S0 + S1 r^2 + ..)`, up to `2^-57 r`, and of
/// `cos r = 1 - r^2/2 + r^4 (C0 + C1 r^2 + ..)`, up to `2^-59`, on `|r| <= pi/4`; `C` with the other sign.
///
/// They are side by side, and both results are differences, so that the compiler computes both at once.
const COEFFICIENTS: [[f64; 2]; 6] = [
    [0.166_666_666_666_666_32, -0.041_666_666_666_666_6],
    [-0.008_333_333_333_322_403, 0.001_388_888_888_887_411],
    [0.000_198_412_698_297_986_8, -2.480_158_728_947_258e-5],
    [-2.755_731_368_861_114e-6, 2.755_731_434_943_31e-7],
    [2.505_075_757_725_407_4e-8, -2.087_572_286_320_554_4e-9],
    [-1.589_676_336_878_039_3e-10, 1.135_962_579_767_467_6e-11],
];

/// What the kernel does with a number, or with several at once.
pub trait Angle:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    /// `x` on every lane.
    fn splat(x: f64) -> Self;
    /// `self * factor + addend`, rounded as [`mul_add`](crate::math::mul_add) does.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// Sine and cosine of `r + n pi/2` from those of `r`, where `n` modulo 4 is in the two lowest bits of `self`.
    fn quarter_turns(self, sine: Self, cosine: Self) -> (Self, Self);
}

/// Sine and cosine of `x`, where no lane is beyond [`BOUND`].
#[inline]
pub fn reduced<A: Angle>(x: A) -> (A, A) {
    let turns = x.mul_add(A::splat(core::f64::consts::FRAC_2_PI), A::splat(SHIFTER));
    let n = turns - A::splat(SHIFTER);
    // x - n pi/2 = r - l. The products with the first two parts and the first difference are exact; the
    // rounding error of the second difference is in l. |n PART_3| is below 0.05 |r| for every x in the bound.
    let near = n.mul_add(A::splat(-PART_1), x);
    let part = n * A::splat(PART_2);
    let r = near - part;
    let l = n.mul_add(A::splat(PART_3), part - (near - r));

    let z = r * r;
    let mut sums = COEFFICIENTS[5].map(A::splat);
    for [s, c] in COEFFICIENTS.into_iter().take(5).rev() {
        sums = [sums[0].mul_add(z, A::splat(s)), sums[1].mul_add(z, A::splat(c))];
    }
    // w - lost = 1 - r^2/2, where the product inside `lost` is the one inside `w`.
    let half = r * A::splat(0.5);
    let w = (-half).mul_add(r, A::splat(1.0));
    let lost = half.mul_add(r, w - A::splat(1.0));
    // sin(r - l) = r - (r^3 S + l cos r); every sign is such that -0 stays -0.
    let sine = r - (r * z).mul_add(sums[0], l * w);
    // cos(r - l) = 1 - r^2/2 - (r^4 C - l sin r)
    let cosine = w - (z * z).mul_add(sums[1], (-r).mul_add(l, lost));
    turns.quarter_turns(sine, cosine)
}

impl Angle for f64 {
    #[inline]
    fn splat(x: f64) -> Self {
        x
    }
    #[inline]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        super::mul_add(self, factor, addend)
    }
    #[inline]
    fn quarter_turns(self, sine: Self, cosine: Self) -> (Self, Self) {
        let n = self.to_bits();
        // Bit 0 of n becomes bit 62, that of the number 2: the comparison of numbers keeps the choice in vector
        // registers. Where only one function is used, compilers choose its polynomial by a branch instead: 34
        // instructions, 46 for both (x86-64-v3; callgrind). The pair of the standard library takes 136.
        let odd = f64::from_bits(n << 62) != 0.0;
        let (sine, cosine) = if odd { (cosine, sine) } else { (sine, cosine) };
        // Exact, and shorter than moving sign bits: both factors are side by side.
        static SIGNS: [f64; 5] = [1.0, 1.0, -1.0, -1.0, 1.0];
        let k = (n & 3) as usize;
        (sine * SIGNS[k], cosine * SIGNS[k + 1])
    }
}

/// Sine and cosine of one angle in radians, equal to [`sin`] and [`cos`] bit for bit.
#[inline]
#[must_use]
pub fn sin_cos(x: f64) -> (f64, f64) {
    if super::abs(x) > BOUND { large(x) } else { reduced(x) }
}

/// Two angles side by side, for the compiler to put into one vector register. Every operation is that of `f64` on each.
#[derive(Clone, Copy)]
struct Two([f64; 2]);

impl Two {
    #[inline]
    fn zip(self, other: Two, f: impl Fn(f64, f64) -> f64) -> Two {
        Two([f(self.0[0], other.0[0]), f(self.0[1], other.0[1])])
    }
}

impl Add for Two {
    type Output = Two;
    #[inline]
    fn add(self, other: Two) -> Two {
        self.zip(other, |x, y| x + y)
    }
}

impl Sub for Two {
    type Output = Two;
    #[inline]
    fn sub(self, other: Two) -> Two {
        self.zip(other, |x, y| x - y)
    }
}

impl Mul for Two {
    type Output = Two;
    #[inline]
    fn mul(self, other: Two) -> Two {
        self.zip(other, |x, y| x * y)
    }
}

impl Neg for Two {
    type Output = Two;
    #[inline]
    fn neg(self) -> Two {
        Two(self.0.map(|x| -x))
    }
}

impl Angle for Two {
    #[inline]
    fn splat(x: f64) -> Self {
        Two([x; 2])
    }
    #[inline]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        let sum = |k: usize| super::mul_add(self.0[k], factor.0[k], addend.0[k]);
        Two([sum(0), sum(1)])
    }
    #[inline]
    fn quarter_turns(self, sine: Self, cosine: Self) -> (Self, Self) {
        let of = |k: usize| self.0[k].quarter_turns(sine.0[k], cosine.0[k]);
        let ((s0, c0), (s1, c1)) = (of(0), of(1));
        (Two([s0, s1]), Two([c0, c1]))
    }
}

/// Sines and cosines of two angles in radians, equal to [`sin_cos`] of each bit for bit.
// Never inlined: the compiler packs the four polynomials into one register because the four results are stored side by
// side; inside of another function it packs less (58 instructions; two calls of `sin_cos` take 92; x86-64-v3).
#[inline(never)]
#[must_use]
pub fn sin_cos_of_two(x: f64, y: f64) -> ([f64; 2], [f64; 2]) {
    // One comparison for both, which fails for NaN; angles that only together are beyond the bound get the same bits.
    if super::abs(x) + super::abs(y) <= BOUND {
        let (sines, cosines) = reduced(Two([x, y]));
        (sines.0, cosines.0)
    } else {
        one_by_one(x, y)
    }
}

/// Sines and cosines of two angles of which one may be large.
#[cold]
#[inline(never)]
fn one_by_one(x: f64, y: f64) -> ([f64; 2], [f64; 2]) {
    let ((sine, cosine), (other_sine, other_cosine)) = (sin_cos(x), sin_cos(y));
    ([sine, other_sine], [cosine, other_cosine])
}

/// Sine of an angle in radians, up to 0.8 units in the last place below `4e5`; NaN for infinities.
#[inline]
#[must_use]
pub fn sin(x: f64) -> f64 {
    sin_cos(x).0
}

/// Cosine of an angle in radians, up to 0.8 units in the last place below `4e5`; NaN for infinities.
#[inline]
#[must_use]
pub fn cos(x: f64) -> f64 {
    sin_cos(x).1
}

/// The functions of the standard library or of `libm`; NaN for infinities and NaN.
#[cold]
#[inline(never)]
fn large(x: f64) -> (f64, f64) {
    #[cfg(feature = "std")]
    {
        (x.sin(), x.cos())
    }
    #[cfg(all(feature = "libm", not(feature = "std")))]
    {
        (libm::sin(x), libm::cos(x))
    }
    #[cfg(not(any(feature = "std", feature = "libm")))]
    {
        (x, x)
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_PI_2;

    use super::{BOUND, cos, sin, sin_cos, sin_cos_of_two};
    use crate::{DoubleDouble, Real};

    /// The largest errors of sine and cosine, in units in the last place of the exact values.
    fn worst(angles: impl Iterator<Item = f64>) -> [f64; 2] {
        angles.fold([0.0; 2], |worst, x| {
            let (sine, cosine) = DoubleDouble::from(x).sin_cos();
            let error = |value: f64, exact: DoubleDouble| {
                let exact_hi = exact.hi().abs();
                ((DoubleDouble::from(value) - exact).hi() / (exact_hi.next_up() - exact_hi)).abs()
            };
            let (s, c) = sin_cos(x);
            [worst[0].max(error(s, sine)), worst[1].max(error(c, cosine))]
        })
    }

    /// Bits of the fractional parts of the multiples of the golden ratio: evenly spread and always the same.
    fn spread(n: u64) -> impl Iterator<Item = u64> {
        (1..=n).map(|k| k.wrapping_mul(0x9e37_79b9_7f4a_7c15))
    }

    /// A number in `[2^exponent, 2^(exponent + 1))`.
    fn of_exponent(exponent: i64, bits: u64) -> f64 {
        f64::from_bits(((1023 + exponent) as u64) << 52 | (bits << 12) >> 12)
    }

    #[test]
    fn errors_are_below_four_fifths_of_a_unit_in_the_last_place() {
        let unit = |bits: u64| (bits >> 11) as f64 / (1_u64 << 53) as f64;
        // Every third, among them 29 and 204551, whose neighbours are closest.
        let near_zeros = (2..=1 << 18).step_by(3).map(|n| f64::from(n) * FRAC_PI_2);
        let near_ends = (1..=1 << 18).step_by(3).map(|n| (f64::from(n) - 0.5) * FRAC_PI_2);
        let few_turns = spread(100_000).map(|bits| 13.0 * unit(bits) - 6.5);
        let all_turns = spread(100_000).map(|bits| BOUND * (2.0 * unit(bits) - 1.0));
        let magnitudes = spread(50_000).map(|bits| of_exponent(-60 + (bits >> 52) as i64 % 78, bits));
        let sets = [
            ("near zeros", worst(near_zeros)),
            ("near ends", worst(near_ends)),
            ("few turns", worst(few_turns)),
            ("all turns", worst(all_turns)),
            ("magnitudes", worst(magnitudes)),
        ];
        for (label, errors) in sets {
            std::println!("{label}: {errors:?}");
            // A correctly rounded function reaches a half; less would say that the oracle is blind.
            assert!(errors.iter().all(|e| (0.49..0.8).contains(e)), "{label}: {errors:?}");
        }
    }

    #[test]
    fn sine_and_cosine_alone_are_those_of_the_pair() {
        for bits in spread(20_000) {
            // Some of them beyond the bound.
            let x = of_exponent((bits >> 52) as i64 % 40 - 10, bits);
            let (s, c) = sin_cos(x);
            assert_eq!((s.to_bits(), c.to_bits()), (sin(x).to_bits(), cos(x).to_bits()), "{x}");
            let (s_minus, c_minus) = sin_cos(-x);
            assert_eq!((s_minus, c_minus), (-s, c), "{x}");
        }
    }

    #[test]
    fn two_angles_at_once_have_the_bits_of_each_alone() {
        let special =
            [0.0, -0.0, f64::from_bits(1), 1.0, BOUND, BOUND.next_up(), -3e5, 1e300, f64::INFINITY, f64::NAN];
        let random = |bits: u64| {
            let size = of_exponent((bits >> 52) as i64 % 40 - 20, bits);
            if bits & 1 == 0 { size } else { -size }
        };
        let pairs = spread(50_000).map(|bits| [random(bits), random(bits.rotate_left(23))]);
        let specials = special.into_iter().flat_map(|x| special.map(|y| [x, y]));
        let mut quadrants = [[0_u32; 4]; 4];
        for [x, y] in pairs.chain(specials) {
            let (sines, cosines) = sin_cos_of_two(x, y);
            for (k, angle) in [x, y].into_iter().enumerate() {
                let (sine, cosine) = sin_cos(angle);
                let same = |a: f64, b: f64| a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan();
                assert!(same(sines[k], sine) && same(cosines[k], cosine), "{angle} of {x} and {y}");
            }
            let quadrant = |k: usize| usize::from(sines[k] < 0.0) + 2 * usize::from(cosines[k] < 0.0);
            quadrants[quadrant(0)][quadrant(1)] += 1;
        }
        assert!(quadrants.iter().flatten().all(|n| *n > 100), "{quadrants:?}");
    }

    #[test]
    fn the_smallest_angles_are_their_own_sines() {
        for x in [0.0, f64::from_bits(1), f64::MIN_POSITIVE, 1e-300, 1e-100, 1e-9] {
            assert_eq!(sin(x).to_bits(), x.to_bits());
            assert_eq!(sin(-x).to_bits(), (-x).to_bits());
            assert_eq!((cos(x), cos(-x)), (1.0, 1.0));
        }
    }

    #[test]
    fn infinities_and_nan_have_no_sine() {
        for x in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            assert!(sin(x).is_nan() && cos(x).is_nan());
        }
    }

    #[test]
    fn the_functions_continue_beyond_the_bound() {
        for x in [BOUND, BOUND.next_up(), -BOUND, -BOUND.next_up(), 1e6, -1e15] {
            let (sine, cosine) = DoubleDouble::from(x).sin_cos();
            assert!((sin(x) - sine.hi()).abs() < 2e-16 && (cos(x) - cosine.hi()).abs() < 2e-16, "{x}");
        }
        assert!(sin(1e300).abs() <= 1.0 && cos(f64::MAX).abs() <= 1.0);
    }
}
