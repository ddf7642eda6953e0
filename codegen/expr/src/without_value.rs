//! Numbers that are none: logarithms and roots of negative numbers, the arcsine of two, the angle of the origin.
//!
//! Deliberately does not know: what an expression is for, what is done about it.

use std::collections::BTreeMap;

use super::graph::Graph;
use super::node::{ExprId, Func, Node};
use super::rational::Rational;

/// What rounding moves a number by that is written as a sum or a product of others.
const ROUNDING: f64 = 1e-12;

impl Graph {
    /// Whether an expression is made of numbers alone and has no real value.
    pub fn is_number_without_value(&mut self, e: ExprId) -> bool {
        let mut pending = vec![e];
        while let Some(part) = pending.pop() {
            match self.node(part) {
                Node::Symbol(_) => return false,
                node => node.for_each_operand(|operand| pending.push(operand)),
            }
        }
        self.without_value(&[e]).is_some()
    }

    /// The first expression behind the roots that is made of numbers alone and has no real value.
    ///
    /// Numbers are compared with the ends of a domain up to rounding: what is next to an end has a value.
    pub fn without_value(&mut self, roots: &[ExprId]) -> Option<ExprId> {
        let numbers = self.eval_known(roots, &BTreeMap::new());
        let is_root_of_negative = |(base, q): &&(ExprId, Rational)| {
            !q.is_integer() && numbers.get(base).is_some_and(|x| *x < -ROUNDING)
        };
        let value = |e: &ExprId| numbers.get(e).copied();
        let is_zero = |e: &ExprId| *e == self.zero();
        let found = self.reachable(roots).into_iter().find(|e| match self.node(*e) {
            Node::Function(Func::Ln, a) => is_zero(a) || value(a).is_some_and(|x| x < -ROUNDING),
            Node::Function(Func::Asin | Func::Acos, a) => value(a).is_some_and(|x| x.abs() > 1.0 + ROUNDING),
            Node::Function(Func::Turn(_), a) => value(a).is_some_and(|x| x > 1.0 - ROUNDING),
            // Where the cosine does not vanish it is a quotient.
            Node::Function(Func::Tan, a) => value(a).is_some_and(|x| x.cos().abs() < ROUNDING),
            Node::Atan2(y, x) => is_zero(y) && is_zero(x),
            Node::Product { factors, .. } => factors.iter().any(|factor| is_root_of_negative(&factor)),
            Node::Constant(_) | Node::Pi | Node::Symbol(_) | Node::Sum { .. } | Node::Function(..) => false,
        })?;
        // Of a product the root alone.
        let Node::Product { factors, .. } = self.node(found) else { return Some(found) };
        let root = factors.iter().find(is_root_of_negative).cloned();
        root.map_or(Some(found), |root| self.power_product(&[root]).ok())
    }
}
