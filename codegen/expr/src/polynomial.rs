//! Polynomials in some symbols with coefficients that are any expressions in the others, and their division.
//!
//! What divides exactly does so as polynomials: a quotient `a/b` of functions that both vanish somewhere has a value
//! there. Does not know: what the symbols are, polynomials in several levels of coefficients.

use std::collections::BTreeMap;

use num_traits::{Signed, ToPrimitive};
use rustc_hash::FxHashMap;

use super::fraction::Fractions;
use super::graph::Graph;
use super::knowledge::Vanishing;
use super::node::{ExprId, Node, SymbolId};
use super::rational::Rational;

/// A higher power is no polynomial here.
const MAX_DEGREE: u32 = 16;

/// Powers of the symbols, in their order.
pub type Powers = Vec<u32>;

/// `sum_k c_k prod_i x_i^k_i`, with coefficients that do not contain the `x_i`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Polynomial {
    symbols: Vec<SymbolId>,
    /// Compared lexicographically: the first symbol counts most.
    terms: BTreeMap<Powers, ExprId>,
}

/// `a = quotient b + remainder`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Division {
    /// Terms of `a` that the leading term of `b` divides, one after the other.
    pub quotient: Polynomial,
    /// Terms that the leading term of `b` does not divide.
    pub remainder: Polynomial,
}

/// What a node is, on the way up.
enum Part {
    /// Free of the symbols.
    Constant,
    Terms(BTreeMap<Powers, ExprId>),
}

impl Polynomial {
    /// An expression as a polynomial in symbols, the first of which leads; nothing where it is not written as one, with
    /// positive whole powers of sums and products.
    pub fn new(g: &mut Graph, e: ExprId, symbols: &[SymbolId]) -> Option<Polynomial> {
        let unit = |k: usize| (0..symbols.len()).map(|j| u32::from(j == k)).collect::<Powers>();
        let none = vec![0; symbols.len()];
        let mut parts: FxHashMap<ExprId, Part> = FxHashMap::default();
        let order = g.reachable(&[e]);
        g.charge(order.len());
        for node in order {
            let operands_are_constant = {
                let mut all = true;
                g.node(node).for_each_operand(|operand| all &= matches!(parts[&operand], Part::Constant));
                all
            };
            let terms_of = |parts: &FxHashMap<ExprId, Part>, e: ExprId| match &parts[&e] {
                Part::Constant => BTreeMap::from([(none.clone(), e)]),
                Part::Terms(terms) => terms.clone(),
            };
            let part = match g.node(node).clone() {
                Node::Symbol(s) => match symbols.iter().position(|own| *own == s) {
                    Some(k) => Part::Terms(BTreeMap::from([(unit(k), g.one())])),
                    None => Part::Constant,
                },
                _ if operands_are_constant => Part::Constant,
                Node::Sum { constant, terms } => {
                    let mut sums: BTreeMap<Powers, Vec<(ExprId, Rational)>> = BTreeMap::new();
                    sums.entry(none.clone()).or_default().push((g.one(), constant));
                    for (term, weight) in terms.iter() {
                        for (powers, c) in terms_of(&parts, *term) {
                            sums.entry(powers).or_default().push((c, weight.clone()));
                        }
                    }
                    let sums = sums.into_iter().map(|(powers, list)| (powers, g.linear_combination(&list)));
                    Part::Terms(sums.collect())
                }
                Node::Product { coefficient, factors } => {
                    let mut total = BTreeMap::from([(none.clone(), g.rational(coefficient))]);
                    for (base, q) in factors.iter() {
                        let Part::Terms(terms) = &parts[base] else {
                            let power = g.power_product(&[(*base, q.clone())]).ok()?;
                            total.values_mut().for_each(|c| *c = g.mul(*c, power));
                            continue;
                        };
                        let n = q
                            .numer()
                            .to_u32()
                            .filter(|n| q.is_integer() && q.is_positive() && *n <= MAX_DEGREE)?;
                        for _ in 0..n {
                            total = multiplied(g, &total, terms)?;
                        }
                    }
                    Part::Terms(total)
                }
                _ => return None,
            };
            parts.insert(node, part);
        }
        let terms = match parts.remove(&e)? {
            Part::Constant => BTreeMap::from([(none, e)]),
            Part::Terms(terms) => terms,
        };
        Some(Polynomial { symbols: symbols.to_vec(), terms }.tidied(g))
    }

    /// Coefficients in lowest terms, and none that is seen to vanish.
    fn tidied(mut self, g: &mut Graph) -> Polynomial {
        let mut fractions = Fractions::default();
        for c in self.terms.values_mut() {
            *c = shorter(g, &mut fractions, *c);
        }
        self.terms.retain(|_, c| g.vanishing(*c) != Vanishing::Zero);
        self
    }

    /// Whether there is no term.
    pub fn is_zero(&self) -> bool {
        self.terms.is_empty()
    }

    /// Powers and coefficients, the leading term last.
    pub fn terms(&self) -> impl DoubleEndedIterator<Item = (&Powers, ExprId)> {
        self.terms.iter().map(|(powers, c)| (powers, *c))
    }

    /// Powers and coefficient of the leading term.
    pub fn leading(&self) -> Option<(&Powers, ExprId)> {
        self.terms().next_back()
    }

    /// `prod_i x_i^k_i`.
    pub fn monomial(&self, g: &mut Graph, powers: &Powers) -> ExprId {
        let mut factors = Vec::new();
        for (symbol, n) in self.symbols.iter().zip(powers) {
            let x = g.sym(*symbol);
            factors.push(g.powi(x, i64::from(*n)));
        }
        g.product(&factors)
    }

    /// The polynomial as an expression.
    pub fn expression(&self, g: &mut Graph) -> ExprId {
        let mut terms = Vec::new();
        for (powers, c) in &self.terms {
            let monomial = self.monomial(g, powers);
            terms.push(g.mul(*c, monomial));
        }
        g.sum(&terms)
    }

    /// Division with a remainder, but not by zero, and not where coefficients outgrow what a polynomial may have.
    ///
    /// # Panics
    /// Unless both are polynomials in the same symbols, in the same order.
    pub fn divided_by(&self, g: &mut Graph, divisor: &Polynomial) -> Option<Division> {
        assert_eq!(self.symbols, divisor.symbols, "polynomials in the same symbols");
        let (lead, by) = divisor.leading().map(|(powers, c)| (powers.clone(), c))?;
        let symbols = self.symbols.clone();
        let (mut quotient, mut remainder) = (BTreeMap::new(), BTreeMap::new());
        let mut rest = self.terms.clone();
        let mut fractions = Fractions::default();
        while let Some((powers, c)) = rest.pop_last() {
            if g.vanishing(c) == Vanishing::Zero {
                continue;
            }
            let step: Option<Powers> = powers.iter().zip(&lead).map(|(a, b)| a.checked_sub(*b)).collect();
            let Some(step) = step else {
                remainder.insert(powers, c);
                continue;
            };
            let q = g.div(c, by).ok()?;
            let q = shorter(g, &mut fractions, q);
            for (of, d) in divisor.terms.iter().rev().skip(1) {
                let powers: Powers = step.iter().zip(of).map(|(a, b)| a + b).collect();
                let product = g.mul(q, *d);
                let old = rest.get(&powers).copied().unwrap_or(g.zero());
                let difference = g.sub(old, product);
                let difference = g.cancel_zero(difference);
                rest.insert(powers, shorter(g, &mut fractions, difference));
            }
            quotient.insert(step, q);
        }
        let of = |terms| Polynomial { symbols: symbols.clone(), terms };
        Some(Division { quotient: of(quotient), remainder: of(remainder) })
    }
}

/// The shortest of an expression, the same in lowest terms, and the same as one quotient.
fn shorter(g: &mut Graph, fractions: &mut Fractions, e: ExprId) -> ExprId {
    let forms = [e, fractions.normal(g, e), fractions.quotient(g, e)];
    forms.into_iter().min_by_key(|e| g.reachable(&[*e]).len()).unwrap_or(e)
}

fn multiplied(
    g: &mut Graph,
    a: &BTreeMap<Powers, ExprId>,
    b: &BTreeMap<Powers, ExprId>,
) -> Option<BTreeMap<Powers, ExprId>> {
    let mut sums: BTreeMap<Powers, Vec<ExprId>> = BTreeMap::new();
    for (p, c) in a {
        for (q, d) in b {
            let powers: Powers = p.iter().zip(q).map(|(a, b)| a + b).collect();
            if powers.iter().sum::<u32>() > MAX_DEGREE {
                return None;
            }
            sums.entry(powers).or_default().push(g.mul(*c, *d));
        }
    }
    Some(sums.into_iter().map(|(powers, list)| (powers, g.sum(&list))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(g: &mut Graph) -> ([SymbolId; 3], [ExprId; 3]) {
        let symbols = ["x", "y", "c"].map(|name| g.symbol(name));
        (symbols, symbols.map(|s| g.sym(s)))
    }

    #[test]
    fn products_are_divided_by_their_factors() {
        let mut g = Graph::new();
        let ([x, y, _], [ex, ey, c]) = names(&mut g);
        // b = sin(c) x + y, a = b (x^2 - c y + 1)
        let sine = g.func(super::super::node::Func::Sin, c);
        let sx = g.mul(sine, ex);
        let b = g.add(sx, ey);
        let (square, cy, one) = (g.powi(ex, 2), g.mul(c, ey), g.one());
        let minus = g.neg(cy);
        let q = g.sum(&[square, minus, one]);
        let product = g.mul(b, q);
        let a = g.expand(product);
        for order in [[x, y], [y, x]] {
            let [n, d] = [a, b].map(|e| Polynomial::new(&mut g, e, &order).unwrap());
            let division = n.divided_by(&mut g, &d).unwrap();
            assert!(division.remainder.is_zero());
            let found = division.quotient.expression(&mut g);
            assert!(g.is_equal(found, q));
        }
        // The remainder of another term is told.
        let more = g.add(a, c);
        let [n, d] = [more, b].map(|e| Polynomial::new(&mut g, e, &[y, x]).unwrap());
        let division = n.divided_by(&mut g, &d).unwrap();
        let left = division.remainder.expression(&mut g);
        assert!(g.is_equal(left, c));
    }

    #[test]
    fn what_is_no_polynomial_is_none() {
        let mut g = Graph::new();
        let ([x, y, _], [ex, _, c]) = names(&mut g);
        let root = g.sqrt(ex);
        let inverse = g.powi(ex, -1);
        let sine = g.func(super::super::node::Func::Sin, ex);
        let high = g.powi(ex, 40);
        for e in [root, inverse, sine, high] {
            assert_eq!(Polynomial::new(&mut g, e, &[x, y]), None);
        }
        let free = g.sqrt(c);
        let constant = Polynomial::new(&mut g, free, &[x, y]).unwrap();
        assert_eq!(constant.leading(), Some((&vec![0, 0], free)));
    }
}
