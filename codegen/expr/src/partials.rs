//! How an expression depends on the expressions it is made of, one level down.

use std::collections::BTreeMap;

use num_traits::One;

use super::graph::Graph;
use super::node::{ExprId, Node};
use super::rational::Rational;

impl Graph {
    /// The operands of `e` and its partial derivatives by them, `de = sum_k partial_k d(operand_k)`, in ascending
    /// order.
    ///
    /// A sum of products is one level: `d(x y + x z) = (y + z) dx + x dy + x dz`. `value` stands for `e` wherever a
    /// derivative is cheaper in terms of the value itself, `d(x/d) = dx/d - (value/d) dd`, `d exp(x) = value dx`; it
    /// may be `e` or a symbol defined as `e`.
    pub fn partials(&mut self, e: ExprId, value: ExprId) -> Vec<(ExprId, ExprId)> {
        let mut partials: BTreeMap<ExprId, Vec<(ExprId, Rational)>> = BTreeMap::new();
        match self.node(e).clone() {
            Node::Sum { terms, .. } => {
                for (term, q) in &terms {
                    self.partials_of_term(*term, *term, q, &mut partials);
                }
            }
            // An argument without a derivative by it is a number, and nothing that moves.
            Node::Function(f, a) => {
                return self.func_derivative(f, a, value).map(|by_a| (a, by_a)).into_iter().collect();
            }
            Node::Atan2(y, x) => {
                let Some([by_y, by_x]) = self.atan2_derivatives(y, x) else { return Vec::new() };
                if y == x {
                    return vec![(y, self.add(by_y, by_x))];
                }
                let mut both = vec![(y, by_y), (x, by_x)];
                both.sort_unstable();
                return both;
            }
            _ => self.partials_of_term(e, value, &Rational::one(), &mut partials),
        }
        partials.into_iter().map(|(operand, terms)| (operand, self.linear_combination(&terms))).collect()
    }

    /// Adds the partial derivatives of `weight * term`.
    fn partials_of_term(
        &mut self,
        term: ExprId,
        value: ExprId,
        weight: &Rational,
        partials: &mut BTreeMap<ExprId, Vec<(ExprId, Rational)>>,
    ) {
        let Node::Product { coefficient, factors } = self.node(term).clone() else {
            partials.entry(term).or_default().push((self.one(), weight.clone()));
            return;
        };
        for (k, (base, q)) in factors.iter().enumerate() {
            // d(c b^q R) = c q b^(q - 1) R db = q value/b db; the first form has a value at b = 0 when q > 0.
            let (list, coefficient) = if value != term && *q < Rational::from_integer(0.into()) {
                (vec![(value, Rational::one()), (*base, -Rational::one())], Rational::one())
            } else {
                let mut rest = factors.to_vec();
                rest[k].1 -= Rational::one();
                (rest, coefficient.clone())
            };
            let partial = self.power_product(&list).expect("bases of a canonical product are not zero");
            partials.entry(*base).or_default().push((partial, weight * coefficient * q));
        }
    }
}
