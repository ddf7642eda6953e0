//! Exact rationals and their two borders with text and floating point.

use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::{One, Signed, ToPrimitive, Zero};

/// Largest exact number: longer ones take seconds to reduce, each time.
pub(super) const MAX_BITS: u64 = 1 << 18;

/// Exact rational number; the only kind of literal coefficient an expression can hold.
pub type Rational = num_rational::BigRational;

/// Numerator and denominator of a short number.
fn short(q: &Rational) -> Option<(i128, i128)> {
    Some((q.numer().to_i64()?.into(), q.denom().to_i64()?.into()))
}

/// `n/d` for a positive `d`.
fn ratio(n: i128, d: i128) -> Rational {
    if d == 1 {
        return Rational::from(BigInt::from(n));
    }
    let common = match (u64::try_from(n.unsigned_abs()), u64::try_from(d)) {
        (Ok(n), Ok(d)) => n.gcd(&d).into(),
        _ => n.gcd(&d),
    };
    Rational::new_raw(BigInt::from(n / common), BigInt::from(d / common))
}

/// `a b`, without arithmetic of long numbers where both are short.
pub(super) fn times(a: &Rational, b: &Rational) -> Rational {
    if a.is_one() {
        return b.clone();
    }
    if b.is_one() {
        return a.clone();
    }
    match (short(a), short(b)) {
        (Some((n, d)), Some((m, e))) => ratio(n * m, d * e),
        _ => a * b,
    }
}

/// `a + b`, without arithmetic of long numbers where both are short.
pub(super) fn plus(a: &Rational, b: &Rational) -> Rational {
    let of_short = || {
        let ((n, d), (m, e)) = (short(a)?, short(b)?);
        Some(if d == e { ratio(n + m, d) } else { ratio((n * e).checked_add(m * d)?, d * e) })
    };
    of_short().unwrap_or_else(|| a + b)
}

/// Reads a decimal literal such as `12`, `0.35` or `1e-3` exactly.
///
/// # Errors
/// `None` when the text is not a decimal literal or its exponent is outside `-400..=400`.
pub fn parse_decimal(text: &str) -> Option<Rational> {
    let text: String = text.chars().filter(|c| *c != '_').collect();
    let (mantissa, exponent) = match text.find(['e', 'E']) {
        Some(at) => (&text[..at], text[at + 1..].parse::<i32>().ok()?),
        None => (text.as_str(), 0),
    };
    if exponent.abs() > 400 {
        return None;
    }
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let digits: String = [whole, fraction].concat();
    if digits.is_empty() || !digits.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let numerator: BigInt = digits.parse().ok()?;
    let shift = exponent - i32::try_from(fraction.len()).ok()?;
    let scale = BigInt::from(10).pow(shift.unsigned_abs());
    Some(if shift >= 0 { Rational::from(numerator * scale) } else { Rational::new(numerator, scale) })
}

/// The `f64` nearest to a rational (ties to even), so that a decimal literal and its parsed double agree.
pub fn rational_to_f64(q: &Rational) -> f64 {
    if q.is_zero() {
        return 0.0;
    }
    let (negative, numerator, denominator) = (q.is_negative(), q.numer().abs(), q.denom().clone());
    // Scale so that the integer quotient has 64 or 65 bits, then round it once to 53 bits by hand.
    let shift = 65 - (numerator.bits() as i64 - denominator.bits() as i64);
    let (scaled, divisor) =
        if shift >= 0 { (numerator << shift, denominator) } else { (numerator, denominator << -shift) };
    let (quotient, remainder) = num_integer::Integer::div_rem(&scaled, &divisor);
    // 65 or 66 bits: a sticky lowest bit keeps the information that the division was inexact.
    let sticky = if remainder.is_zero() { BigInt::zero() } else { BigInt::one() };
    let doubled: BigInt = (quotient << 1u32) + sticky;
    let bits: u128 = doubled.to_u128().unwrap_or(u128::MAX);
    let exponent = -shift - 1;
    let magnitude = round_scaled(bits, exponent);
    if negative { -magnitude } else { magnitude }
}

/// `bits * 2^exponent` rounded to nearest even, subnormal range included.
fn round_scaled(bits: u128, exponent: i64) -> f64 {
    let length = 128 - i64::from(bits.leading_zeros());
    // Exponent of the lowest bit an f64 of this size keeps; never below that of the subnormals.
    let lowest = (length + exponent - 53).max(-1074);
    let drop = lowest - exponent;
    if drop > 127 {
        return 0.0;
    }
    let kept = if drop <= 0 {
        bits << (-drop).min(127)
    } else {
        let floor = bits >> drop;
        let rest = bits & ((1u128 << drop) - 1);
        let half = 1u128 << (drop - 1);
        floor + u128::from(rest > half || (rest == half && floor & 1 == 1))
    };
    // `kept` has at most 54 bits, so the conversion and both scalings by powers of two are exact or overflow properly.
    let first = lowest / 2;
    kept as f64 * power_of_two(first) * power_of_two(lowest - first)
}

fn power_of_two(exponent: i64) -> f64 {
    match exponent {
        e if e > 1023 => f64::INFINITY,
        e if e < -1022 => 0.0,
        e => f64::from_bits(((e + 1023) as u64) << 52),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic_of_short_numbers_is_that_of_long_ones() {
        let whole = [0, 1, -1, 2, 3, -6, 10, 1 << 40, i64::MAX, i64::MIN];
        let mut numbers = Vec::new();
        for n in whole {
            numbers.extend([1, 2, 3, 12, i64::MAX].map(|d| Rational::new(n.into(), d.into())));
        }
        numbers.push(Rational::new(BigInt::from(1) << 80u32, BigInt::from(3).pow(60)));
        for a in &numbers {
            for b in &numbers {
                for (fast, plain) in [(times(a, b), a * b), (plus(a, b), a + b)] {
                    assert_eq!((fast.numer(), fast.denom()), (plain.numer(), plain.denom()), "{a}, {b}");
                }
            }
        }
    }
}
