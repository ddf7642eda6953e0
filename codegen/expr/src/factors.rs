//! Factors that all terms of several sums share.
//!
//! Does not know: factors of polynomials that are not written as such.

use std::collections::BTreeMap;

use num_traits::{One, Signed};

use super::graph::Graph;
use super::node::{ExprId, Node};
use super::rational::Rational;

impl Graph {
    /// Bases with positive powers that divide every term of every one of these sums; zeros are divided by everything.
    pub fn shared_factors(&mut self, sums: &[ExprId]) -> Vec<(ExprId, Rational)> {
        let zero = self.zero();
        let mut shared: Option<BTreeMap<ExprId, Rational>> = None;
        for sum in sums.iter().filter(|e| **e != zero) {
            for (term, _) in self.summands(*sum) {
                let factors: BTreeMap<ExprId, Rational> = match self.node(term) {
                    Node::Product { factors, .. } => factors.iter().cloned().collect(),
                    Node::Constant(_) => BTreeMap::new(),
                    _ => BTreeMap::from([(term, Rational::one())]),
                };
                shared = Some(match shared {
                    None => factors,
                    Some(shared) => {
                        let common = shared.into_iter().filter_map(|(base, q)| {
                            let own = factors.get(&base)?.clone();
                            Some((base, own.min(q)))
                        });
                        common.collect()
                    }
                });
            }
        }
        shared.unwrap_or_default().into_iter().filter(|(_, q)| q.is_positive()).collect()
    }

    /// A sum without factors that its terms share, `e / prod base^q`.
    pub fn without_factors(&mut self, e: ExprId, factors: &[(ExprId, Rational)]) -> ExprId {
        let mut terms = Vec::new();
        for (term, weight) in self.summands(e) {
            let inverse = factors.iter().map(|(base, q)| (*base, -q.clone()));
            let quotient: Vec<(ExprId, Rational)> = inverse.chain([(term, Rational::one())]).collect();
            // A factor that is zero divides no term of a sum that is not.
            terms.push((self.power_product(&quotient).unwrap_or(term), weight));
        }
        self.linear_combination(&terms)
    }
}

#[cfg(test)]
mod tests {
    use crate::Graph;

    #[test]
    fn factors_that_all_terms_share_are_divided_by() {
        let mut g = Graph::new();
        let [x, y, z] = ["x", "y", "z"].map(|name| {
            let symbol = g.symbol(name);
            g.sym(symbol)
        });
        let (xy, xx) = (g.mul(x, y), g.mul(x, x));
        let xxz = g.mul(xx, z);
        let first = g.add(xy, xxz);
        let zero = g.zero();
        let shared = g.shared_factors(&[first, xx, zero]);
        assert_eq!(shared, vec![(x, crate::Rational::from_integer(1.into()))]);
        let divided = g.without_factors(first, &shared);
        let xz = g.mul(x, z);
        let wanted = g.add(y, xz);
        assert_eq!(divided, wanted);
        assert_eq!(g.without_factors(xx, &shared), x);
        let one = g.one();
        let unit = g.add(one, x);
        assert!(g.shared_factors(&[first, unit]).is_empty());
    }
}
