//! Exponents in monomials: rational numbers of 32 bits, most of them whole.
//!
//! Does not know: monomials.

use std::cmp::Ordering;
use std::ops::{Add, Mul, Neg, Sub};

use num_rational::Ratio;

/// A rational number in lowest terms: sums, products and comparisons of whole ones take no divisor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Exponent {
    numerator: i32,
    /// Positive.
    denominator: i32,
}

impl Exponent {
    pub(super) const ZERO: Exponent = Exponent::whole(0);
    pub(super) const ONE: Exponent = Exponent::whole(1);

    pub(super) const fn whole(n: i32) -> Exponent {
        Exponent { numerator: n, denominator: 1 }
    }

    /// `n/d` for a `d` other than zero.
    pub(super) fn new(n: i32, d: i32) -> Exponent {
        Ratio::new(n, d).into()
    }

    pub(super) fn numerator(self) -> i32 {
        self.numerator
    }

    pub(super) fn denominator(self) -> i32 {
        self.denominator
    }

    pub(super) fn is_whole(self) -> bool {
        self.denominator == 1
    }

    pub(super) fn is_zero(self) -> bool {
        self.numerator == 0
    }

    pub(super) fn is_positive(self) -> bool {
        self.numerator > 0
    }

    pub(super) fn is_negative(self) -> bool {
        self.numerator < 0
    }

    /// The whole number beside it, towards zero.
    pub(super) fn truncated(self) -> i32 {
        self.numerator / self.denominator
    }

    fn ratio(self) -> Ratio<i32> {
        Ratio::new_raw(self.numerator, self.denominator)
    }
}

impl From<Ratio<i32>> for Exponent {
    fn from(q: Ratio<i32>) -> Exponent {
        let (numerator, denominator) = q.into();
        Exponent { numerator, denominator }
    }
}

impl Ord for Exponent {
    fn cmp(&self, other: &Exponent) -> Ordering {
        if self.denominator == other.denominator {
            return self.numerator.cmp(&other.numerator);
        }
        let cross = |a: &Exponent, b: &Exponent| i64::from(a.numerator) * i64::from(b.denominator);
        cross(self, other).cmp(&cross(other, self))
    }
}

impl PartialOrd for Exponent {
    fn partial_cmp(&self, other: &Exponent) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Add for Exponent {
    type Output = Exponent;

    fn add(self, other: Exponent) -> Exponent {
        if self.is_whole() && other.is_whole() {
            return Exponent::whole(self.numerator + other.numerator);
        }
        (self.ratio() + other.ratio()).into()
    }
}

impl Sub for Exponent {
    type Output = Exponent;

    fn sub(self, other: Exponent) -> Exponent {
        self + -other
    }
}

impl Neg for Exponent {
    type Output = Exponent;

    fn neg(self) -> Exponent {
        Exponent { numerator: -self.numerator, ..self }
    }
}

impl Mul for Exponent {
    type Output = Exponent;

    fn mul(self, other: Exponent) -> Exponent {
        if self.is_whole() && other.is_whole() {
            return Exponent::whole(self.numerator * other.numerator);
        }
        (self.ratio() * other.ratio()).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arithmetic_and_order_are_those_of_ratios() {
        let ratios: Vec<Ratio<i32>> = (-6..=6).flat_map(|n| [1, 2, 3, 4].map(|d| Ratio::new(n, d))).collect();
        for a in &ratios {
            let x = Exponent::from(*a);
            assert_eq!(
                (x.is_whole(), x.is_zero(), x.truncated()),
                (a.is_integer(), *a.numer() == 0, a.to_integer())
            );
            assert_eq!((x.is_positive(), x.is_negative()), (*a.numer() > 0, *a.numer() < 0));
            for b in &ratios {
                let y = Exponent::from(*b);
                assert_eq!((x + y, x - y, x * y), ((a + b).into(), (a - b).into(), (a * b).into()));
                assert_eq!((x.cmp(&y), x == y), (a.cmp(b), a == b));
            }
        }
    }
}
