//! The field in which expressions have fingerprints: `p = 2305311381129556799` elements, chosen to resemble the reals.
//!
//! * `p = 3 mod 4`: minus one is no square. Squares play the part of positive numbers; each has one root that is a
//!   square itself, so that `sqrt(a) sqrt(b) = sqrt(a b)`.
//! * `(p - 1)/2` is prime: a square has one root of every order that is a square, so that `a^(1/3)` exists, and
//!   `(a^(1/3))^3 = a`.
//! * `p + 1` is divisible by [`TURN`] `= 2^6 3^3 5^2 7 11 13 17`: the circle `c^2 + s^2 = 1`, a cyclic group of `p + 1`
//!   points, has points of that order, and cosines and sines of `2 pi k/TURN` are elements of the field. `p` splits
//!   completely in the real subfield of the `TURN`-th cyclotomic field, so sending `2 cos(2 pi/TURN)` to that element
//!   is a homomorphism of rings on all sums, products and quotients of such cosines and sines.
//! * [`RATIONAL_SQUARES`], the primes up to 47, are squares, as is `sin(k pi/60)` for `0 < k < 60`; of the points of
//!   order [`TURN`], [`ONE_STEP`] is one for which `sqrt(2)`, `sqrt(3)`, .., `sqrt(17)` by cosines and by the field's
//!   own roots are the same elements.
//!
//! Elements are kept as `a 2^64 mod p` (Montgomery, 1985). Deliberately does not know: expressions.

use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{Signed, ToPrimitive, Zero};

use super::random::split_mix;
use super::rational::Rational;

/// The number of elements.
pub(super) const P: u64 = 2_305_311_381_129_556_799;
/// How many of the smallest angles of which cosine and sine are elements make a full turn.
pub(super) const TURN: u64 = 735_134_400;
/// Primes that are squares in the field, as every positive number is among the reals.
pub(super) const RATIONAL_SQUARES: [u64; 15] = [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47];

/// `-1/p mod 2^64`, by Newton's iteration.
const NEGATIVE_INVERSE: u64 = {
    let (mut inverse, mut k) = (1_u64, 0);
    while k < 6 {
        inverse = inverse.wrapping_mul(2_u64.wrapping_sub(P.wrapping_mul(inverse)));
        k += 1;
    }
    inverse.wrapping_neg()
};
/// `2^128 mod p`.
const SCALE: u64 = {
    let (mut power, mut k) = (1_u64, 0);
    while k < 128 {
        power = power * 2 % P;
        k += 1;
    }
    power
};
/// One.
pub(super) const ONE: u64 = {
    let (mut power, mut k) = (1_u64, 0);
    while k < 64 {
        power = power * 2 % P;
        k += 1;
    }
    power
};
/// Cosine and sine of `2 pi/TURN`.
const ONE_STEP: (u64, u64) = (mul(156_610_148_963_514_164, SCALE), mul(2_217_774_930_804_227_807, SCALE));

pub(super) const fn add(a: u64, b: u64) -> u64 {
    let s = a + b;
    if s >= P { s - P } else { s }
}

pub(super) const fn negate(a: u64) -> u64 {
    if a == 0 { 0 } else { P - a }
}

pub(super) const fn mul(a: u64, b: u64) -> u64 {
    let wide = a as u128 * b as u128;
    let multiple = (wide as u64).wrapping_mul(NEGATIVE_INVERSE);
    let reduced = ((wide + multiple as u128 * P as u128) >> 64) as u64;
    if reduced >= P { reduced - P } else { reduced }
}

pub(super) fn pow(mut base: u64, mut exponent: u64) -> u64 {
    let mut result = ONE;
    while exponent > 0 {
        if exponent & 1 == 1 {
            result = mul(result, base);
        }
        base = mul(base, base);
        exponent >>= 1;
    }
    result
}

pub(super) fn inverse(a: u64) -> Option<u64> {
    (a != 0).then(|| pow(a, P - 2))
}

/// The inverses of several elements, none of them zero, by that of their product (Montgomery, 1987).
pub(super) fn inverses<const N: usize>(elements: [u64; N]) -> [u64; N] {
    let mut before = [ONE; N];
    let mut product = ONE;
    for (before, element) in before.iter_mut().zip(elements) {
        *before = product;
        product = mul(product, element);
    }
    let mut rest = pow(product, P - 2);
    for (before, element) in before.iter_mut().zip(elements).rev() {
        *before = mul(*before, rest);
        rest = mul(rest, element);
    }
    before
}

/// Whether an element is the square of another one that is not zero.
pub(super) fn is_square(a: u64) -> bool {
    pow(a, (P - 1) / 2) == ONE
}

/// The integer `n`; none for a multiple of `p` other than zero, of which the field would tell a lie.
pub(super) fn integer(n: &BigInt) -> Option<u64> {
    if let Some(short) = n.to_i64() {
        let reduced = short.unsigned_abs() % P;
        let reduced = if short < 0 { negate(reduced) } else { reduced };
        return (reduced != 0 || short == 0).then(|| mul(reduced, SCALE));
    }
    let reduced = n.mod_floor(&BigInt::from(P)).to_u64()?;
    (reduced != 0 || n.is_zero()).then(|| mul(reduced, SCALE))
}

/// A rational number; none where `p` divides the numerator or the denominator.
pub(super) fn rational(q: &Rational) -> Option<u64> {
    let numerator = integer(q.numer())?;
    if q.is_integer() { Some(numerator) } else { Some(mul(numerator, inverse(integer(q.denom())?)?)) }
}

/// The rational number with the smallest numerator and denominator that an element is, if both are small.
pub(super) fn as_small_rational(a: u64) -> Option<Rational> {
    const LARGEST: u64 = 1 << 16;
    let plain = mul(a, 1);
    let (mut r, mut s) = ((P, plain), (0_i128, 1_i128));
    while r.1 > LARGEST {
        let quotient = r.0 / r.1;
        r = (r.1, r.0 - quotient * r.1);
        s = (s.1, s.0 - i128::from(quotient) * s.1);
    }
    (s.1 != 0 && s.1.unsigned_abs() <= u128::from(LARGEST))
        .then(|| Rational::new(BigInt::from(r.1), BigInt::from(s.1)))
}

/// `1/d` among the exponents of squares; none for a multiple of their number.
fn exponent_of_root(degree: u64) -> Option<u64> {
    const ORDER: u64 = (P - 1) / 2;
    if degree == 2 {
        return Some(ORDER.div_ceil(2));
    }
    // Euclid's algorithm; the number of squares is a prime.
    let (mut r, mut s) = ((ORDER, degree % ORDER), (0_i128, 1_i128));
    while r.1 > 1 {
        let quotient = r.0 / r.1;
        r = (r.1, r.0 - quotient * r.1);
        s = (s.1, s.0 - i128::from(quotient) * s.1);
    }
    (r.1 == 1).then(|| u64::try_from(s.1.rem_euclid(i128::from(ORDER))).ok()).flatten()
}

/// A numerator that is small beside `p - 1`: `a^(p - 1) = 1` would be taken for an identity.
pub(super) fn small_exponent(n: &BigInt) -> Option<i64> {
    n.to_i64().filter(|n| n.unsigned_abs() < 1 << 40)
}

/// `a^q`: for a `q` that is no integer, the power that is a square, of a square; none for huge exponents.
pub(super) fn power(a: u64, q: &Rational) -> Option<u64> {
    let n = small_exponent(q.numer())?;
    let root = if q.is_integer() {
        a
    } else {
        if a == 0 {
            return (n > 0).then_some(0);
        }
        let degree = q.denom().to_u64()?;
        let root = pow(a, exponent_of_root(degree)?);
        // A root of even degree taken of what is no square has the power -a.
        let exists = if degree % 2 == 0 { pow(root, degree) == a } else { is_square(a) };
        if !exists {
            return None;
        }
        root
    };
    let raised = pow(root, n.unsigned_abs());
    if n < 0 { inverse(raised) } else { Some(raised) }
}

/// A point of the circle, or any `cosine + i sine`.
pub(super) type Point = (u64, u64);

pub(super) fn turn_by(a: Point, b: Point) -> Point {
    (add(mul(a.0, b.0), negate(mul(a.1, b.1))), add(mul(a.0, b.1), mul(a.1, b.0)))
}

/// `n` times the angle of a point.
pub(super) fn times(a: Point, n: i64) -> Point {
    let mut base = if n < 0 { (a.0, negate(a.1)) } else { a };
    let (mut result, mut n) = ((ONE, 0), n.unsigned_abs());
    while n > 0 {
        if n & 1 == 1 {
            result = turn_by(result, base);
        }
        base = turn_by(base, base);
        n >>= 1;
    }
    result
}

/// The point of the circle with a parameter: `((1 - t^2)/(1 + t^2), 2 t/(1 + t^2))`.
pub(super) fn point(t: u64) -> Point {
    let square = mul(t, t);
    // Minus one is no square.
    let norm = pow(add(ONE, square), P - 2);
    (mul(add(ONE, negate(square)), norm), mul(add(t, t), norm))
}

/// Whether `q pi` is an angle of the field.
pub(super) fn is_angle(q: &Rational) -> bool {
    (BigInt::from(TURN / 2)).is_multiple_of(q.denom())
}

/// Cosine and sine of `q pi`; none for a `q` whose denominator is not that of an angle of the field.
pub(super) fn multiple_of_pi(q: &Rational) -> Option<Point> {
    let steps = q * Rational::from(BigInt::from(TURN / 2));
    let steps = steps.is_integer().then(|| steps.numer().mod_floor(&BigInt::from(TURN)))?;
    Some(times(ONE_STEP, steps.to_i64()?))
}

/// Whether the root of a number is the field's, also beside other roots and sines: all of its primes are squares.
pub(super) fn has_consistent_root(q: &Rational) -> bool {
    let splits = |n: &BigInt| {
        let mut rest = n.clone();
        for q in RATIONAL_SQUARES.map(BigInt::from) {
            while rest.is_multiple_of(&q) {
                rest /= &q;
            }
        }
        rest == BigInt::from(1)
    };
    q.is_positive() && splits(q.numer()) && splits(q.denom())
}

/// A random number of the field.
pub(super) fn hash(mut seed: u64) -> u64 {
    split_mix(&mut seed) % P
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ratio(n: i64, d: i64) -> Rational {
        Rational::new(n.into(), d.into())
    }

    fn number(n: i64) -> u64 {
        integer(&BigInt::from(n)).unwrap()
    }

    /// Strong pseudoprime tests to the first twelve prime bases decide below 3.3e24 (Sorenson, Webster, 2015).
    fn is_prime(n: u64) -> bool {
        let n = BigInt::from(n);
        let (one, below) = (BigInt::from(1), &n - BigInt::from(1));
        let twos = below.trailing_zeros().unwrap();
        [2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37].iter().all(|base| {
            let mut x = BigInt::from(*base).modpow(&(&below >> twos), &n);
            x == one
                || (0..twos).any(|_| {
                    let reached = x == below;
                    x = &x * &x % &n;
                    reached
                })
        })
    }

    #[test]
    fn the_field_is_as_described() {
        assert!(is_prime(P) && is_prime((P - 1) / 2) && !is_prime(P - 4));
        assert_eq!(((P + 1) % TURN, TURN), (0, 64 * 27 * 25 * 7 * 11 * 13 * 17));
        assert!(RATIONAL_SQUARES.iter().all(|q| is_square(number(*q as i64))));
        assert!(!is_square(number(-1)));
        let full = multiple_of_pi(&ratio(2, TURN as i64)).unwrap();
        assert_eq!(times(full, TURN as i64), (ONE, 0));
        for q in [2, 3, 5, 7, 11, 13, 17] {
            assert_ne!(times(full, TURN as i64 / q), (ONE, 0), "{q}");
        }
        assert_eq!(multiple_of_pi(&ratio(1, 2)), Some((0, ONE)));
        assert_eq!(multiple_of_pi(&ratio(1, 19)), None);
        for k in 1..60 {
            assert!(is_square(multiple_of_pi(&ratio(k, 60)).unwrap().1), "sin({k} pi/60)");
        }
    }

    #[test]
    fn roots_of_primes_are_products_of_sines() {
        // prod_{k=1}^{q-1} 2 sin(k pi/q) = q, and the first half of the factors equals the second one.
        for q in [3, 5, 7, 11, 13, 17] {
            let half = (1..=(q - 1) / 2).fold(ONE, |product, k| {
                let sine = multiple_of_pi(&ratio(k, q)).unwrap().1;
                mul(product, add(sine, sine))
            });
            assert_eq!(Some(half), power(number(q), &ratio(1, 2)), "sqrt({q})");
        }
        let quarter = multiple_of_pi(&ratio(1, 4)).unwrap().1;
        assert_eq!(Some(add(quarter, quarter)), power(number(2), &ratio(1, 2)));
    }

    #[test]
    fn arithmetic_is_that_of_a_field() {
        let samples: Vec<u64> = (0..40).map(hash).chain([0, ONE, negate(ONE)]).collect();
        for a in &samples {
            for b in &samples {
                let product = BigInt::from(mul(*a, 1)) * BigInt::from(mul(*b, 1));
                assert_eq!(integer(&product), Some(mul(*a, *b)));
                assert_eq!(add(add(*a, *b), negate(*b)), *a);
            }
            assert!(inverse(*a).is_none_or(|b| mul(*a, b) == ONE));
            let several = [*a, hash(7), ONE].map(|x| if x == 0 { ONE } else { x });
            assert_eq!(inverses(several).map(Some), several.map(inverse));
            for (n, d) in [(1, 2), (1, 3), (-2, 5), (3, 4), (1, 53)] {
                let square = mul(*a, *a);
                let root = power(square, &ratio(n, d));
                assert_eq!(root.and_then(|r| power(r, &ratio(d, 1))), power(square, &ratio(n, 1)));
            }
        }
        for (n, d) in [(0, 1), (7, 3), (-5, 24), (65_536, 65_535)] {
            assert_eq!(as_small_rational(rational(&ratio(n, d)).unwrap()), Some(ratio(n, d)));
        }
        assert_eq!(integer(&(BigInt::from(P) * 3)), None);
        for n in [i64::MIN, i64::MIN + 1, -(P as i64), -1, 0, 1, P as i64, P as i64 + 1, i64::MAX] {
            let reduced = BigInt::from(n).mod_floor(&BigInt::from(P)).to_u64().unwrap();
            let expected = (reduced != 0 || n == 0).then(|| mul(reduced, SCALE));
            assert_eq!(integer(&BigInt::from(n)), expected, "{n}");
        }
        assert_eq!(rational(&Rational::new(1.into(), P.into())), None);
    }
}
