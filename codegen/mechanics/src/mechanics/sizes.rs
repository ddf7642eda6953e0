//! How large expressions are, as far as their numbers tell it.
//!
//! Deliberately does not know: what they stand for, values of symbols.

use std::collections::HashMap;

use hamel_expr::{ExprId, Graph, Node, Rational, rational_to_f64};
use num_traits::{One, Pow};

/// One over the power of two next to the size of an expression, as far as its numbers tell it; one for sizes near one.
pub(super) fn scale(g: &Graph, e: ExprId) -> Rational {
    /// Powers of two up to which a size is near one: the square of a factor, which may be lost, is below 64.
    const NEAR: i32 = 2;
    let mut sizes: HashMap<ExprId, f64> = HashMap::new();
    for e in g.reachable(&[e]) {
        let number = |q: &Rational| rational_to_f64(q).abs();
        let size = match g.node(e) {
            Node::Constant(q) => number(q),
            Node::Sum { constant, terms } => {
                terms.iter().fold(number(constant), |max, (e, q)| max.max(number(q) * sizes[e]))
            }
            Node::Product { coefficient, factors } => {
                let powers = factors.iter().map(|(e, q)| sizes[e].powf(rational_to_f64(q)));
                number(coefficient) * powers.product::<f64>()
            }
            Node::Pi | Node::Symbol(_) | Node::Function(..) | Node::Atan2(..) => 1.0,
        };
        sizes.insert(e, size);
    }
    let exponent = sizes[&e].log2().round();
    if !exponent.is_finite() || exponent.abs() <= f64::from(NEAR) {
        return Rational::one();
    }
    let two = Rational::from_integer(2.into());
    #[allow(clippy::cast_possible_truncation, reason = "exponents of numbers")]
    let power = Pow::pow(&two, exponent.abs() as u32);
    if exponent > 0.0 { power.recip() } else { power }
}
