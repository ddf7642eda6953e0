//! Signs of expressions, as far as they follow from those of their parts.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::{Signed, ToPrimitive, Zero};
use rustc_hash::FxHashMap;

use super::graph::Graph;
use super::node::{ExprId, Func, Node};
use super::rational::Rational;

/// What is known about the sign of an expression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Greater than zero.
    Positive,
    /// At least zero.
    NonNegative,
    /// Less than zero.
    Negative,
    /// At most zero.
    NonPositive,
    /// Not zero.
    NonZero,
    /// Nothing.
    Unknown,
}

/// How two sides of a condition on parameters compare.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Relation {
    /// `greater > less`.
    Greater,
    /// `greater >= less`.
    GreaterEqual,
    /// `greater != less`.
    NotEqual,
}

impl Sign {
    /// Whether the expression cannot vanish.
    pub fn is_definite(self) -> bool {
        matches!(self, Sign::Positive | Sign::Negative | Sign::NonZero)
    }

    fn flipped(self) -> Sign {
        match self {
            Sign::Positive => Sign::Negative,
            Sign::Negative => Sign::Positive,
            Sign::NonNegative => Sign::NonPositive,
            Sign::NonPositive => Sign::NonNegative,
            Sign::NonZero | Sign::Unknown => self,
        }
    }

    fn of_rational(q: &Rational) -> Sign {
        if q.is_zero() {
            Sign::NonNegative
        } else if q.is_positive() {
            Sign::Positive
        } else {
            Sign::Negative
        }
    }

    fn plus(self, other: Sign) -> Sign {
        use Sign::{Negative, NonNegative, NonPositive, Positive, Unknown};
        match (self, other) {
            (Positive, Positive | NonNegative) | (NonNegative, Positive) => Positive,
            (NonNegative, NonNegative) => NonNegative,
            (Negative, Negative | NonPositive) | (NonPositive, Negative) => Negative,
            (NonPositive, NonPositive) => NonPositive,
            _ => Unknown,
        }
    }

    fn times(self, other: Sign) -> Sign {
        use Sign::{Negative, NonNegative, NonPositive, NonZero, Positive, Unknown};
        match (self, other) {
            (NonZero, s) | (s, NonZero) if s.is_definite() => NonZero,
            (Unknown | NonZero, _) | (_, Unknown | NonZero) => Unknown,
            (Positive, s) | (s, Positive) => s,
            (Negative, s) | (s, Negative) => s.flipped(),
            (NonNegative, s) | (s, NonNegative) => s,
            (NonPositive, NonPositive) => NonNegative,
        }
    }
}

/// Sign of an expression, given signs of symbols and of whole expressions.
pub fn sign_of(g: &Graph, e: ExprId, facts: &BTreeMap<ExprId, Sign>) -> Sign {
    remembered_sign_of(g, e, facts, &mut FxHashMap::default())
}

/// As [`sign_of`] with a memory of the signs found before from the same facts.
pub fn remembered_sign_of(
    g: &Graph,
    e: ExprId,
    facts: &BTreeMap<ExprId, Sign>,
    memo: &mut FxHashMap<ExprId, Sign>,
) -> Sign {
    let mut new = BTreeSet::new();
    let mut pending = vec![e];
    while let Some(node) = pending.pop() {
        if !memo.contains_key(&node) && new.insert(node) {
            g.node(node).for_each_operand(|operand| pending.push(operand));
        }
    }
    // Operands precede the nodes that use them in the arena.
    for node in new {
        let derived = match g.node(node) {
            Node::Constant(c) => Sign::of_rational(c),
            Node::Pi => Sign::Positive,
            Node::Symbol(_) => Sign::Unknown,
            Node::Sum { constant, terms } => {
                let start = Sign::of_rational(constant);
                terms.iter().fold(start, |s, (t, q)| s.plus(memo[t].times(Sign::of_rational(q))))
            }
            Node::Product { coefficient, factors } => {
                factors.iter().fold(Sign::of_rational(coefficient), |s, (base, q)| {
                    let base = memo[base];
                    let even = q.is_integer() && q.numer().to_i64().is_some_and(|n| n % 2 == 0);
                    let power = match (even, base.is_definite(), q.is_integer()) {
                        (true, true, _) => Sign::Positive,
                        (true, false, _) => Sign::NonNegative,
                        // A root exists only of what is not negative, and a denominator only of what is not zero.
                        (_, _, false) if q.is_negative() || base == Sign::Positive => Sign::Positive,
                        (_, _, false) => Sign::NonNegative,
                        _ => base,
                    };
                    s.times(power)
                })
            }
            // Of a series of positive coefficients, of which the first one is the largest below zero.
            Node::Function(Func::Exp | Func::Cosh | Func::Turn(_), _) => Sign::Positive,
            Node::Function(Func::Abs, a) if memo[a].is_definite() => Sign::Positive,
            Node::Function(Func::Abs, _) => Sign::NonNegative,
            Node::Function(Func::Sinh | Func::Tanh | Func::Asin | Func::Atan, a) => memo[a],
            // The mean of a cosine with a weight that falls.
            Node::Function(Func::Stumpff(k), z) if matches!(memo[z], Sign::NonNegative | Sign::Positive) => {
                match k {
                    0 | 1 => Sign::Unknown,
                    2 => Sign::NonNegative,
                    _ => Sign::Positive,
                }
            }
            // The angle has the sign of y.
            Node::Atan2(y, _) => match memo[y] {
                Sign::Negative | Sign::Positive | Sign::NonNegative => memo[y],
                _ => Sign::Unknown,
            },
            Node::Function(..) => Sign::Unknown,
        };
        let known = facts.get(&node).copied().unwrap_or(Sign::Unknown);
        let sign = if derived.is_definite() || known == Sign::Unknown { derived } else { known };
        memo.insert(node, sign);
    }
    memo[&e]
}
