//! Expansion to a sum of monomials, the exact normal form of polynomials and the fallback of the zero test.

use num_traits::{Signed, ToPrimitive};
use rustc_hash::FxHashMap;

use super::graph::Graph;
use super::node::{ExprId, Node};
use super::rational::Rational;

/// Largest positive power of a sum that is multiplied out.
const MAX_POWER: i64 = 16;
/// Most products that one multiplication of two sums may make; larger ones are kept as they are.
const MAX_PRODUCTS: usize = 1 << 12;

impl Graph {
    /// Multiplies products and small positive powers of sums out; everything else is kept.
    ///
    /// Two polynomials are equal exactly when their expansions have the same handle.
    pub fn expand(&mut self, e: ExprId) -> ExprId {
        let mut image: FxHashMap<ExprId, ExprId> = FxHashMap::default();
        let order = self.reachable(&[e]);
        self.charge(order.len());
        for e in order {
            let expanded = match self.node(e).clone() {
                Node::Constant(_) | Node::Pi | Node::Symbol(_) => e,
                Node::Sum { constant, terms } => {
                    let mut list: Vec<_> = terms.iter().map(|(t, q)| (image[t], q.clone())).collect();
                    list.push((self.one(), constant));
                    self.linear_combination(&list)
                }
                Node::Product { coefficient, factors } => {
                    let mut total = self.rational(coefficient);
                    for (base, q) in factors.iter() {
                        total = self.multiply_out(total, image[base], q);
                    }
                    total
                }
                Node::Function(f, a) => self.func(f, image[&a]),
                Node::Atan2(y, x) => self.atan2(image[&y], image[&x]),
            };
            image.insert(e, expanded);
        }
        image[&e]
    }

    /// How many terms `e` has multiplied out, before any of them cancel.
    pub fn n_terms_expanded(&self, e: ExprId) -> usize {
        let mut n_terms: FxHashMap<ExprId, usize> = FxHashMap::default();
        for e in self.reachable(&[e]) {
            let n = match self.node(e) {
                Node::Constant(_) | Node::Pi | Node::Symbol(_) | Node::Function(..) | Node::Atan2(..) => 1,
                Node::Sum { terms, .. } => {
                    terms.iter().fold(1_usize, |sum, (term, _)| sum.saturating_add(n_terms[term]))
                }
                Node::Product { factors, .. } => factors.iter().fold(1_usize, |product, (base, q)| {
                    let power = q.numer().to_u32().filter(|_| q.is_integer());
                    power.map_or(product, |power| product.saturating_mul(n_terms[base].saturating_pow(power)))
                }),
            };
            n_terms.insert(e, n);
        }
        n_terms.get(&e).copied().unwrap_or(1)
    }

    fn multiply_out(&mut self, total: ExprId, base: ExprId, q: &Rational) -> ExprId {
        let repeat = q.numer().to_i64().filter(|n| q.is_integer() && q.is_positive() && *n <= MAX_POWER);
        match repeat {
            Some(n) => (0..n).fold(total, |total, _| self.distribute(total, base)),
            None => {
                let power = self.power_product(&[(base, q.clone())]);
                // A vanishing denominator is kept out of the graph by `pow` and `subs`.
                power.map_or(total, |power| self.distribute(total, power))
            }
        }
    }

    fn distribute(&mut self, a: ExprId, b: ExprId) -> ExprId {
        let (left, right) = (self.summands(a), self.summands(b));
        if left.len().saturating_mul(right.len()) > MAX_PRODUCTS {
            return self.mul(a, b);
        }
        let mut products = Vec::with_capacity(left.len() * right.len());
        for (x, p) in &left {
            for (y, q) in &right {
                products.push((self.mul(*x, *y), p * q));
            }
        }
        self.linear_combination(&products)
    }

    /// The summands of an expression with their rational weights.
    pub fn summands(&mut self, e: ExprId) -> Vec<(ExprId, Rational)> {
        match self.node(e).clone() {
            Node::Sum { constant, terms } => {
                let mut list = terms.to_vec();
                if constant != Rational::from_integer(0.into()) {
                    list.push((self.one(), constant));
                }
                list
            }
            _ => vec![(e, Rational::from_integer(1.into()))],
        }
    }
}
