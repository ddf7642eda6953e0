//! Numbers in closed form to 31 digits, and as text that is stored.
//!
//! Does not know: which numbers a sum or product of others is.

use hamel_runtime::{DoubleDouble, Real};

use super::number::Number;
use super::samples::long;

/// `pi`, and what the double next to it lacks.
const PI: [f64; 2] = [std::f64::consts::PI, 1.224_646_799_147_353_2e-16];

impl Number {
    /// The double next to the number, and the double next to what that one lacks: 31 digits together.
    pub fn parts(&self) -> [f64; 2] {
        let pi = DoubleDouble::sum_of(PI[0], PI[1]);
        let mut value = DoubleDouble::ZERO;
        for (summand, q) in self.summands() {
            let mut product = long(q);
            for _ in 0..summand.pi.unsigned_abs() {
                product = if summand.pi > 0 { product * pi } else { product / pi };
            }
            if summand.root != 1 {
                // Roots of whole numbers below 2^53 are taken of the number itself.
                product *= DoubleDouble::from(summand.root as f64).sqrt();
            }
            let [n, d] = summand.angle;
            if 2 * n != d {
                product *= (pi * DoubleDouble::from(n as f64) / DoubleDouble::from(d as f64)).sin();
            }
            value += product;
        }
        [value.hi(), value.lo()]
    }
}

#[cfg(feature = "serde")]
mod stored {
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    use crate::Rational;
    use crate::number::{Number, Summand};

    /// Power of pi, number under the root, angle, rational factor.
    type Stored = (i32, u64, i64, i64, String);

    impl Serialize for Number {
        fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            let summands = self.summands();
            let stored = summands.map(|(s, q)| (s.pi, s.root, s.angle[0], s.angle[1], q.to_string()));
            serializer.collect_seq(stored.collect::<Vec<Stored>>())
        }
    }

    impl<'de> Deserialize<'de> for Number {
        fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Number, D::Error> {
            let mut summands = Vec::new();
            for (pi, root, n, d, q) in Vec::<Stored>::deserialize(deserializer)? {
                let rational: Rational =
                    q.parse().map_err(|_| D::Error::custom(format!("{q:?} is no rational number")))?;
                summands.push((Summand { pi, root, angle: [n, d] }, rational));
            }
            Number::of_summands(summands)
                .ok_or_else(|| D::Error::custom("an angle with the denominator zero"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Rational, Scalar};

    fn q(n: i64, d: i64) -> Number {
        Rational::new(n.into(), d.into()).into()
    }

    #[test]
    fn values_have_31_digits() {
        // 1 + 2 cos(2 pi/5) + 2 cos(4 pi/5) = 0, so that any two of these differ by what the third is.
        let cosine = |k: i64| Number::cos_pi(2 * k, 5).unwrap().times(&q(2, 1));
        let [a, b] = [cosine(1).parts(), cosine(2).parts()];
        let sum = DoubleDouble::sum_of(a[0], a[1]) + DoubleDouble::sum_of(b[0], b[1]) + DoubleDouble::ONE;
        assert!(sum.magnitude() < 1e-30, "{sum:?}");
        // sin(pi/3)/pi = sqrt(3)/(2 pi)
        let [hi, lo] = Number::sin_pi(1, 3).unwrap().times(&Number::power_of_pi(-1)).parts();
        let value = DoubleDouble::sum_of(hi, lo) * DoubleDouble::sum_of(2.0 * PI[0], 2.0 * PI[1]);
        assert!((value * value - DoubleDouble::from(3.0)).magnitude() < 1e-30, "{value:?}");
        assert_eq!(q(-3, 4).parts(), [-0.75, 0.0]);
        assert_eq!(q(1, 3).parts()[0], 1.0 / 3.0);
        assert_eq!(Number::default().parts(), [0.0, 0.0]);
    }
}
