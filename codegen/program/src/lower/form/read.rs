//! Expressions as polynomials.
//!
//! Does not know: what polynomials are good for.

use num_traits::{One, ToPrimitive, Zero};
use rustc_hash::{FxHashMap, FxHashSet};

use super::exponent::Exponent;
use super::numbers::Coefficient;
use super::polynomial::{Atom, Entry, Monomial, Polynomial, System, power, times};
use crate::lower::SearchBudget;
use crate::lower::classes::{Class, Classes, post_order};
use crate::lower::source::Source;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Node, Rational, SymbolId};

/// Turns expressions into polynomials; every sum inside a product or function becomes a polynomial of its own.
pub(super) struct Reader<'a> {
    pub(super) system: System,
    pub(super) entries: Vec<Entry>,
    classes: &'a Classes,
    symbols: FxHashMap<SymbolId, usize>,
    /// Polynomials of inner sums, and those that only name what a function is applied to.
    inner: FxHashMap<ExprId, usize>,
}

impl<'a> Reader<'a> {
    pub(super) fn new(graph: &Graph, source: &'a Source<'_>, budget: &SearchBudget) -> Reader<'a> {
        Reader {
            system: System::new(graph, &source.signs, budget),
            entries: Vec::new(),
            classes: &source.classes,
            symbols: FxHashMap::default(),
            inner: FxHashMap::default(),
        }
    }

    fn changes(&self, e: ExprId) -> bool {
        self.classes.get(e) > Class::Param
    }

    /// Reads the value of a definition that changes from call to call.
    pub(super) fn define(
        &mut self,
        graph: &mut Graph,
        symbol: SymbolId,
        section: usize,
        e: ExprId,
    ) -> Result<(), Error> {
        let k = self.read(graph, e)?;
        let entry = &mut self.entries[k];
        if entry.definition.is_none() {
            entry.definition = Some((symbol, section));
        }
        self.symbols.insert(symbol, k);
        Ok(())
    }

    /// The polynomial of an expression.
    pub(super) fn read(&mut self, graph: &mut Graph, root: ExprId) -> Result<usize, Error> {
        // Inner sums first: operands precede the nodes that use them.
        let order = post_order(graph, &[root], |e| self.inner.contains_key(&e) || !self.changes(e));
        let mut separate: FxHashSet<ExprId> = FxHashSet::from_iter([root]);
        for e in &order {
            match graph.node(*e) {
                Node::Product { factors, .. } => {
                    let compound =
                        |b: &ExprId| matches!(graph.node(*b), Node::Sum { .. } | Node::Product { .. });
                    separate.extend(factors.iter().map(|(b, _)| *b).filter(compound));
                }
                Node::Function(_, a) => {
                    separate.insert(*a);
                }
                Node::Atan2(y, x) => separate.extend([*y, *x]),
                _ => {}
            }
        }
        // One argument of two may be a number.
        let mut numbers: Vec<ExprId> = Vec::new();
        for e in &order {
            if let Node::Atan2(y, x) = graph.node(*e) {
                numbers.extend([*y, *x].into_iter().filter(|a| !self.changes(*a)));
            }
        }
        for e in numbers.into_iter().chain(order) {
            if separate.contains(&e) && !self.inner.contains_key(&e) {
                let value = self.polynomial(graph, e)?;
                self.inner.insert(e, self.entries.len());
                self.entries.push(Entry { value, definition: None, unit: Coefficient::ONE });
            }
        }
        Ok(self.inner[&root])
    }

    fn polynomial(&mut self, graph: &mut Graph, e: ExprId) -> Result<Polynomial, Error> {
        let (constant, terms) = match graph.node(e).clone() {
            Node::Sum { constant, terms } => (constant, terms.to_vec()),
            _ => (Rational::zero(), vec![(e, Rational::one())]),
        };
        let mut list = Vec::with_capacity(terms.len() + 1);
        for (term, q) in terms {
            let (m, number) = self.monomial(graph, term)?;
            let number = graph.scale(number, &q);
            if let Some(c) = self.system.numbers.of(graph, number) {
                list.push((m, c));
            }
        }
        let constant = graph.rational(constant);
        list.extend(self.system.numbers.of(graph, constant).map(|c| (Monomial::new(), c)));
        Ok(self.system.collect(graph, list))
    }

    /// A term as a monomial times a parameter-only expression.
    fn monomial(&mut self, graph: &mut Graph, e: ExprId) -> Result<(Monomial, ExprId), Error> {
        if !self.changes(e) {
            return Ok((Monomial::new(), e));
        }
        let (coefficient, factors) = match graph.node(e).clone() {
            Node::Product { coefficient, factors } => (coefficient, factors.to_vec()),
            _ => (Rational::one(), vec![(e, Rational::one())]),
        };
        let mut numbers = Vec::new();
        let mut m = Monomial::new();
        for (base, q) in factors {
            if !self.changes(base) {
                numbers.push((base, q));
                continue;
            }
            let exponent = q.numer().to_i32().zip(q.denom().to_i32()).map(|(n, d)| Exponent::new(n, d));
            let exponent = exponent
                .ok_or_else(|| Error::Program { reason: format!("an exponent does not fit 32 bits: {q}") })?;
            let atom = match graph.node(base).clone() {
                Node::Symbol(s) => match self.symbols.get(&s) {
                    Some(k) => Atom::Poly(*k as u32),
                    None => Atom::Input(base),
                },
                Node::Function(f, a) => Atom::Function(f, self.inner[&a] as u32),
                Node::Atan2(y, x) => Atom::Atan2(self.inner[&y] as u32, self.inner[&x] as u32),
                _ => Atom::Poly(self.inner[&base] as u32),
            };
            let atom = self.system.atom_of(atom);
            m = times(&m, &power(atom, exponent));
        }
        let number = graph.power_product(&numbers);
        let number = number.map_err(|_| Error::DivisionByZero { place: "a coefficient".into() })?;
        Ok((m, graph.scale(number, &coefficient)))
    }
}
