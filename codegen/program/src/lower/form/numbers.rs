//! Numbers that depend on parameters alone: each function of the parameters once, with remembered arithmetic.
//!
//! A number is identified by its fingerprint, so that equal numbers are one however they were written. Does not know:
//! what a number is multiplied with.

use std::collections::BTreeMap;

use num_traits::{One, Signed};
use rustc_hash::FxHashMap;

use hamel_expr::{ExprId, Fingerprint, Graph, Node, Rational, Sign, remembered_sign_of};

/// A parameter-only number up to its sign; zero is never one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(super) struct Coefficient {
    pub(super) negative: bool,
    /// Position in the table of numbers; 0 is one.
    pub(super) number: u32,
}

impl Coefficient {
    pub(super) const ONE: Coefficient = Coefficient { negative: false, number: 0 };

    pub(super) fn is_unit(self) -> bool {
        self.number == 0
    }

    pub(super) fn signed_by(self, negative: bool) -> Coefficient {
        Coefficient { negative: self.negative ^ negative, ..self }
    }
}

/// Parameter-only numbers: each function once, with remembered arithmetic.
#[derive(Debug, Default)]
pub(super) struct Numbers {
    exprs: Vec<ExprId>,
    by_fingerprint: FxHashMap<Fingerprint, u32>,
    by_expr: FxHashMap<ExprId, Option<Coefficient>>,
    products: FxHashMap<(u32, u32), Coefficient>,
    quotients: FxHashMap<(u32, u32), Option<Coefficient>>,
    /// Reciprocals; none of what is zero everywhere.
    reciprocals: FxHashMap<u32, Option<ExprId>>,
    sums: FxHashMap<(Coefficient, Coefficient), Option<Coefficient>>,
    /// Terms of the numbers computed so far.
    pub(super) n_terms: usize,
    /// Signs of what may be divided by.
    signs: BTreeMap<ExprId, Sign>,
    /// Signs found from these.
    found_signs: FxHashMap<ExprId, Sign>,
}

impl Numbers {
    pub(super) fn new(graph: &Graph, signs: &BTreeMap<ExprId, Sign>) -> Numbers {
        let mut numbers = Numbers { signs: signs.clone(), ..Numbers::default() };
        numbers.exprs.push(graph.one());
        numbers.by_fingerprint.insert(*graph.fingerprint(graph.one()), 0);
        numbers
    }

    /// The number that an expression is; none for zero.
    pub(super) fn of(&mut self, graph: &mut Graph, e: ExprId) -> Option<Coefficient> {
        if let Some(known) = self.by_expr.get(&e) {
            return *known;
        }
        let coefficient = self.find(graph, e);
        self.by_expr.insert(e, coefficient);
        coefficient
    }

    fn find(&mut self, graph: &mut Graph, e: ExprId) -> Option<Coefficient> {
        self.n_terms += graph.node(e).n_operands();
        let zero = graph.zero();
        if graph.fingerprints_agree(e, zero) {
            return None;
        }
        let negated = graph.neg(e);
        // A fingerprint with void points tells nothing: such a number is equal to itself alone.
        let telling = |graph: &Graph, e: ExprId| {
            let fingerprint = *graph.fingerprint(e);
            fingerprint.iter().all(Option::is_some).then_some(fingerprint)
        };
        let (plus, minus) = (telling(graph, e), telling(graph, negated));
        if let Some(known) = plus.and_then(|f| self.by_fingerprint.get(&f)) {
            return Some(Coefficient { negative: false, number: *known });
        }
        if let Some(known) = minus.and_then(|f| self.by_fingerprint.get(&f)) {
            return Some(Coefficient { negative: true, number: *known });
        }
        // Of a number and its opposite, the one with fewer minus signs is kept.
        let is_negative = match graph.node(e) {
            Node::Constant(c) => c.is_negative(),
            Node::Product { coefficient, .. } => coefficient.is_negative(),
            Node::Sum { terms, .. } => terms.iter().all(|(_, q)| q.is_negative()),
            _ => false,
        };
        let (kept, fingerprint) = if is_negative { (negated, minus) } else { (e, plus) };
        let number = u32::try_from(self.exprs.len()).expect("fewer than 2^32 numbers fit in memory");
        self.exprs.push(kept);
        if let Some(fingerprint) = fingerprint {
            self.by_fingerprint.insert(fingerprint, number);
        }
        self.by_expr.insert(kept, Some(Coefficient { negative: false, number }));
        Some(Coefficient { negative: is_negative, number })
    }

    pub(super) fn expr(&self, graph: &mut Graph, c: Coefficient) -> ExprId {
        let e = self.exprs[c.number as usize];
        if c.negative { graph.neg(e) } else { e }
    }

    pub(super) fn mul(&mut self, graph: &mut Graph, a: Coefficient, b: Coefficient) -> Coefficient {
        let negative = a.negative ^ b.negative;
        let key = (a.number.min(b.number), a.number.max(b.number));
        if key.0 == 0 {
            return Coefficient { negative, number: key.1 };
        }
        let product = match self.products.get(&key) {
            Some(known) => *known,
            None => {
                let e = graph.mul(self.exprs[key.0 as usize], self.exprs[key.1 as usize]);
                let product = self.of(graph, e).expect("a product of numbers that are not zero");
                self.products.insert(key, product);
                product
            }
        };
        product.signed_by(negative)
    }

    /// `a / b`; none where a value of the parameters could make a denominator vanish that is not there already.
    pub(super) fn div(&mut self, graph: &mut Graph, a: Coefficient, b: Coefficient) -> Option<Coefficient> {
        let negative = a.negative ^ b.negative;
        let key = (a.number, b.number);
        if b.number == 0 {
            return Some(Coefficient { negative, number: a.number });
        }
        if a.number == b.number {
            return Some(Coefficient::ONE.signed_by(negative));
        }
        let quotient = match self.quotients.get(&key) {
            Some(known) => *known,
            None => {
                let quotient = self.quotient(graph, key);
                self.quotients.insert(key, quotient);
                quotient
            }
        };
        quotient.map(|q| q.signed_by(negative))
    }

    /// `c / d^n` where the value is infinite for `d = 0` anyway.
    pub(super) fn over(
        &mut self,
        graph: &mut Graph,
        c: Coefficient,
        d: Coefficient,
        n: u32,
    ) -> Option<Coefficient> {
        if d.number == 0 {
            return Some(c.signed_by(d.negative && n % 2 == 1));
        }
        let (c, d) = (self.expr(graph, c), self.expr(graph, d));
        let power = graph.power_product(&[(d, -Rational::from_integer(n.into()))]).ok()?;
        let e = graph.mul(c, power);
        self.of(graph, e)
    }

    fn quotient(&mut self, graph: &mut Graph, (a, b): (u32, u32)) -> Option<Coefficient> {
        let (a, divisor) = (self.exprs[a as usize], self.exprs[b as usize]);
        let reciprocal = self.reciprocals.entry(b);
        let reciprocal =
            reciprocal.or_insert_with(|| graph.power_product(&[(divisor, -Rational::one())]).ok());
        let e = graph.mul(a, (*reciprocal)?);
        let denominators = |e: ExprId| -> Vec<(ExprId, Rational)> {
            match graph.node(e) {
                Node::Product { factors, .. } => {
                    factors.iter().filter(|(_, q)| q.is_negative()).cloned().collect()
                }
                _ => Vec::new(),
            }
        };
        let there = denominators(a);
        let is_safe = denominators(e).iter().all(|(base, q)| {
            there.iter().any(|(other, p)| other == base && p <= q)
                || remembered_sign_of(graph, *base, &self.signs, &mut self.found_signs).is_definite()
        });
        if is_safe { self.of(graph, e) } else { None }
    }

    /// Whether a number is known to be positive.
    pub(super) fn is_positive(&mut self, graph: &mut Graph, c: Coefficient) -> bool {
        let e = self.expr(graph, c);
        remembered_sign_of(graph, e, &self.signs, &mut self.found_signs) == Sign::Positive
    }

    /// `a + b`; none for zero.
    pub(super) fn add(&mut self, graph: &mut Graph, a: Coefficient, b: Coefficient) -> Option<Coefficient> {
        let key = (a.min(b), a.max(b));
        if let Some(known) = self.sums.get(&key) {
            return *known;
        }
        let (x, y) = (self.expr(graph, a), self.expr(graph, b));
        let e = graph.add(x, y);
        let sum = self.of(graph, e);
        self.sums.insert(key, sum);
        sum
    }
}
