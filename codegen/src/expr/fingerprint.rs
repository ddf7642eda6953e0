//! Values of expressions at random points of a prime field: a proof of "not zero", and of "zero" up to chance.
//!
//! Every symbol gets a pseudo-random value in `F_p`, `p = 2^61 - 1`, at each of [`POINTS`] independent points. Sums,
//! products and integer powers are evaluated in the field. `sin` and `cos` go through the rational parametrisation
//! `((1 - t^2)/(1 + t^2), 2t/(1 + t^2))` of the circle attached to every term of their argument, so the addition
//! theorems and `sin^2 + cos^2 = 1` hold; `exp` is a character of its argument's terms; square roots are modular square
//! roots (a homomorphism on squares, and `p = 3 mod 4`); any other function is an opaque value of its argument's
//! fingerprint. A point at which a denominator vanishes or a root does not exist is void for that expression.
//!
//! Two different functions of total degree `d` agree at one random point with probability at most `d/p` (Schwartz,
//! 1980; Zippel, 1979); with two valid points and `d < 1000` a false zero has probability below `2e-31`.

use num_bigint::BigInt;
use num_integer::Integer;
use num_traits::ToPrimitive;

use super::graph::{ExprId, Graph};
use super::rational::Rational;

pub(crate) const POINTS: usize = 8;
const P: u64 = (1 << 61) - 1;
/// Arguments of `sin`, `cos` and `exp` may carry denominators dividing this; others are opaque.
const DENOMINATOR: i64 = 24;

/// Values at the random points; `None` where the expression has none.
pub(crate) type Fingerprint = [Option<u64>; POINTS];

pub(super) fn add(a: u64, b: u64) -> u64 {
    let s = a + b;
    if s >= P { s - P } else { s }
}

fn negate(a: u64) -> u64 {
    if a == 0 { 0 } else { P - a }
}

pub(super) fn mul(a: u64, b: u64) -> u64 {
    let wide = u128::from(a) * u128::from(b);
    let folded = (wide & u128::from(P)) as u64 + (wide >> 61) as u64;
    if folded >= P { folded - P } else { folded }
}

fn pow(mut base: u64, mut exponent: u64) -> u64 {
    let mut result = 1;
    while exponent > 0 {
        if exponent & 1 == 1 {
            result = mul(result, base);
        }
        base = mul(base, base);
        exponent >>= 1;
    }
    result
}

fn inverse(a: u64) -> Option<u64> {
    (a != 0).then(|| pow(a, P - 2))
}

/// SplitMix64 (Steele, Lea, Flood, 2014), folded into the field.
fn hash(seed: u64) -> u64 {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) % P
}

fn integer(n: &BigInt) -> u64 {
    match n.to_i64() {
        Some(small) => small.rem_euclid(P as i64) as u64,
        None => n.mod_floor(&BigInt::from(P)).to_u64().unwrap_or(0),
    }
}

pub(super) fn constant(q: &Rational) -> Fingerprint {
    let numerator = integer(q.numer());
    let value =
        if q.is_integer() { Some(numerator) } else { inverse(integer(q.denom())).map(|d| mul(numerator, d)) };
    [value; POINTS]
}

/// A fresh independent value per point, determined by `key`.
pub(super) fn opaque(key: u64) -> Fingerprint {
    std::array::from_fn(|k| Some(hash(key.wrapping_mul(POINTS as u64 + 1).wrapping_add(k as u64))))
}

/// Opaque function of a fingerprint: equal arguments give equal values.
pub(super) fn opaque_of(tag: u64, argument: &Fingerprint) -> Fingerprint {
    argument.map(|a| a.map(|a| hash(hash(tag) ^ a)))
}

/// `base^exponent`; only integers and half-integers have a value.
pub(super) fn power(base: &Fingerprint, exponent: &Rational) -> Fingerprint {
    let (Some(n), Some(d)) = (exponent.numer().to_i64(), exponent.denom().to_u64()) else {
        return [None; POINTS];
    };
    base.map(|value| {
        let value = value?;
        let root = match d {
            1 => value,
            2 => {
                let root = pow(value, P.div_ceil(4));
                // A non-residue: the field has no square root here.
                if mul(root, root) != value {
                    return None;
                }
                root
            }
            _ => hash(hash(d) ^ value),
        };
        let raised = pow(root, n.unsigned_abs());
        if n < 0 { inverse(raised) } else { Some(raised) }
    })
}

fn steps(coefficient: &Rational) -> Option<i64> {
    let scaled = coefficient * Rational::from(BigInt::from(DENOMINATOR));
    scaled.is_integer().then(|| scaled.numer().to_i64()).flatten()
}

/// `(cos, sin)` of `sum c_k a_k` given the terms' coefficients and fingerprints.
pub(super) fn circle(terms: &[(Rational, Fingerprint)]) -> (Fingerprint, Fingerprint) {
    let mut cos = [None; POINTS];
    let mut sin = [None; POINTS];
    for k in 0..POINTS {
        let Some((c, s)) = circle_at(terms, k) else { continue };
        cos[k] = Some(c);
        sin[k] = Some(s);
    }
    (cos, sin)
}

fn circle_at(terms: &[(Rational, Fingerprint)], k: usize) -> Option<(u64, u64)> {
    let mut z = (1, 0);
    let multiply = |a: (u64, u64), b: (u64, u64)| {
        (add(mul(a.0, b.0), negate(mul(a.1, b.1))), add(mul(a.0, b.1), mul(a.1, b.0)))
    };
    for (coefficient, value) in terms {
        let t = hash(value[k]? ^ 0x5151);
        let (c, s) = {
            let norm = inverse(add(1, mul(t, t)))?;
            (mul(add(1, negate(mul(t, t))), norm), mul(add(t, t), norm))
        };
        let n = steps(coefficient).filter(|n| n.abs() < 1 << 40)?;
        let mut base = if n < 0 { (c, negate(s)) } else { (c, s) };
        let mut e = n.unsigned_abs();
        while e > 0 {
            if e & 1 == 1 {
                z = multiply(z, base);
            }
            base = multiply(base, base);
            e >>= 1;
        }
    }
    Some(z)
}

/// `exp(sum c_k a_k)` as the product of one character per term.
pub(super) fn exponential(terms: &[(Rational, Fingerprint)]) -> Fingerprint {
    std::array::from_fn(|k| {
        let mut product = 1;
        for (coefficient, value) in terms {
            let n = steps(coefficient)?;
            let raised = pow(hash(value[k]? ^ 0xe0e0), n.unsigned_abs());
            product = mul(product, if n < 0 { inverse(raised)? } else { raised });
        }
        Some(product)
    })
}

/// What the fingerprint proves about "is this zero".
pub(super) enum Verdict {
    /// Some point has a non-zero value: proved.
    NonZero,
    /// Zero at two or more points: a false verdict has probability below `2e-31`.
    Zero,
    /// Too few valid points.
    Unknown,
}

pub(super) fn verdict(fingerprint: &Fingerprint) -> Verdict {
    let valid = fingerprint.iter().flatten().count();
    if fingerprint.iter().flatten().any(|v| *v != 0) {
        Verdict::NonZero
    } else if valid >= 2 {
        Verdict::Zero
    } else {
        Verdict::Unknown
    }
}

/// Rows that are no combinations of those before them, over functions: by elimination at a random point.
///
/// Rows depend on each other at a point where they do not as functions with the chance of a false zero. Where no point is
/// valid for all entries, every row that does not vanish counts.
pub(crate) fn independent_rows(g: &Graph, rows: &[Vec<ExprId>]) -> Vec<usize> {
    let value = |e: &ExprId, point: usize| g.fingerprint(*e)[point];
    let valid = |point: &usize| rows.iter().flatten().all(|e| value(e, *point).is_some());
    let Some(point) = (0..POINTS).find(valid) else {
        return (0..rows.len()).filter(|k| rows[*k].iter().any(|e| *e != g.zero())).collect();
    };
    // Reduced rows with a one at their pivot.
    let mut basis: Vec<(usize, Vec<u64>)> = Vec::new();
    let mut kept = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        let mut rest: Vec<u64> = row.iter().filter_map(|e| value(e, point)).collect();
        for (pivot, known) in &basis {
            let factor = negate(rest[*pivot]);
            rest.iter_mut().zip(known).for_each(|(x, y)| *x = add(*x, mul(factor, *y)));
        }
        let pivot = rest.iter().position(|x| *x != 0);
        if let Some((pivot, scale)) = pivot.and_then(|pivot| Some((pivot, inverse(rest[pivot])?))) {
            rest.iter_mut().for_each(|x| *x = mul(*x, scale));
            basis.push((pivot, rest));
            kept.push(k);
        }
    }
    kept
}
