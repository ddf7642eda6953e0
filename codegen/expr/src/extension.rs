//! Values of expressions with many roots: at points of the prime field, in its extension by `i`, where every element of
//! the field has a root.
//!
//! Of `n` roots that nothing ties to each other, all exist in the field itself at one point of `2^n`. Minus one is no
//! square there: `sqrt(a) = i sqrt(-a)` where `a` has no root, and sums, products and powers of these are `x + i y`.
//! Roots of such numbers are there at every second point. As with [values](super::fingerprint) in the field, an
//! expression that vanishes has the value zero, and a value other than zero proves that it does not, unless an operand
//! is in doubt. Two different functions of total degree `d` agree at a random point, with random signs of the roots,
//! with probability at most `d/p`.
//!
//! Functions have values here where their arguments are in the field. Does not know: signs, verdicts.

use num_bigint::BigInt;
use rustc_hash::FxHashMap;

use super::arena::Arena;
use super::field::{self, Point};
use super::fingerprint::has_even_denominator;
use super::knowledge::{Base, POINTS};
use super::node::{ExprId, Node};
use super::rational::Rational;

/// Points at which values are found.
const EXTENDED: usize = 6;

/// Roots of roots are taken as often as this at most.
const MAX_ROOTS: u32 = 8;

impl Arena {
    /// Values at some of the further points, unless they are too much work.
    pub(super) fn extended_values(&self, e: ExprId) -> Option<Vec<Option<Point>>> {
        let all = self.all_behind(e, |_| false)?;
        let value = |point: usize| {
            let mut values: FxHashMap<ExprId, Point> = FxHashMap::default();
            for e in &all {
                if let Some(value) = self.extended(self.node(*e), point, &|e| values.get(&e).copied()) {
                    values.insert(*e, value);
                }
            }
            values.get(&e).copied()
        };
        Some((POINTS..POINTS + EXTENDED).map(value).collect())
    }

    /// The value of a node at a point, from values of its operands.
    fn extended(&self, node: &Node, point: usize, at: &dyn Fn(ExprId) -> Option<Point>) -> Option<Point> {
        match node {
            Node::Symbol(s) if let Some(definition) = self.definition(*s) => at(definition),
            Node::Sum { constant, terms } => {
                let mut total = (field::rational(constant)?, 0);
                for (e, q) in terms {
                    let (q, (x, y)) = (field::rational(q)?, at(*e)?);
                    total = (field::add(total.0, field::mul(q, x)), field::add(total.1, field::mul(q, y)));
                }
                Some(total)
            }
            Node::Product { coefficient, factors } => {
                let mut total = (field::rational(coefficient)?, 0);
                for (e, q) in factors {
                    total = field::turn_by(total, self.extended_power(*e, q, at)?);
                }
                Some(total)
            }
            _ => {
                let in_field = |e: ExprId| at(e).filter(|(_, y)| *y == 0).map(|(x, _)| x);
                Some((self.value_of(node, point, &in_field, None)?, 0))
            }
        }
    }

    /// `base^q`: of a product of which no factor is in doubt, the product of the powers.
    fn extended_power(
        &self,
        base: ExprId,
        q: &Rational,
        at: &dyn Fn(ExprId) -> Option<Point>,
    ) -> Option<Point> {
        if !has_even_denominator(q) {
            return power(at(base)?, q);
        }
        if self.knowledge().base(base) != Base::Free {
            return None;
        }
        match self.node(self.named(base)) {
            Node::Product { coefficient, factors } => {
                let mut total = power((field::rational(coefficient)?, 0), q)?;
                for (factor, n) in factors {
                    total = field::turn_by(total, power(at(*factor)?, &(n * q))?);
                }
                Some(total)
            }
            _ => power(at(base)?, q),
        }
    }
}

/// `a^q`: by square roots where the denominator is a power of two, of an element of the field also by others.
fn power(a: Point, q: &Rational) -> Option<Point> {
    let n = field::small_exponent(q.numer())?;
    let mut root = a;
    if !q.is_integer() {
        let n_roots = u32::try_from(q.denom().trailing_zeros()?).ok().filter(|n| *n <= MAX_ROOTS)?;
        if *q.denom() == BigInt::from(1_u64 << n_roots) {
            for _ in 0..n_roots {
                root = square_root(root)?;
            }
        } else if a.1 == 0 {
            return Some((field::power(a.0, q)?, 0));
        } else {
            return None;
        }
    }
    let mut raised = field::times(root, n.checked_abs()?);
    if n < 0 {
        let (x, y) = raised;
        let per_norm = field::inverse(norm(raised))?;
        raised = (field::mul(x, per_norm), field::negate(field::mul(y, per_norm)));
    }
    Some(raised)
}

/// One of the roots of an element: of a square of the field the one that is a square there.
fn square_root((x, y): Point) -> Option<Point> {
    let half = Rational::new(1.into(), 2.into());
    let root = |a: u64| field::power(a, &half);
    if y == 0 {
        return root(x).map(|root| (root, 0)).or_else(|| Some((0, root(field::negate(x))?)));
    }
    // `(a + i b)^2 = x + i y` with `a^2 + b^2` the root of `x^2 + y^2`; of `(s + x)/2` and `(x - s)/2` one is a square.
    let s = root(norm((x, y)))?;
    let one_half = field::rational(&half)?;
    let a = [s, field::negate(s)].into_iter().find_map(|s| root(field::mul(field::add(x, s), one_half)))?;
    let b = field::mul(field::mul(y, one_half), field::inverse(a)?);
    Some((a, b))
}

/// `x^2 + y^2`, which is zero at zero alone.
fn norm((x, y): Point) -> u64 {
    field::add(field::mul(x, x), field::mul(y, y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_element_of_the_field_has_a_root_and_powers_are_those_of_a_field() {
        let ratio = |n: i64, d: i64| Rational::new(n.into(), d.into());
        let elements: Vec<u64> = (0..40).map(field::hash).collect();
        assert!(
            elements.iter().any(|a| !field::is_square(*a)) && elements.iter().any(|a| field::is_square(*a))
        );
        for pair in elements.windows(2) {
            for a in [(pair[0], 0), field::turn_by((pair[0], pair[1]), (pair[0], pair[1]))] {
                let root = power(a, &ratio(1, 2)).unwrap();
                assert_eq!(field::turn_by(root, root), a);
                assert_eq!(power(a, &ratio(3, 2)), Some(field::turn_by(a, root)));
                let inverse = power(root, &ratio(-1, 1)).unwrap();
                assert_eq!(field::turn_by(inverse, root), (field::ONE, 0));
            }
        }
        // Roots of order four are roots of roots.
        let square = field::mul(elements[0], elements[0]);
        assert_eq!(power((square, 0), &ratio(1, 4)), Some((field::power(square, &ratio(1, 4)).unwrap(), 0)));
        assert_eq!(power((square, 0), &ratio(1, 3)), Some((field::power(square, &ratio(1, 3)).unwrap(), 0)));
    }
}
