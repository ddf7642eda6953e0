//! What polynomials cost.
//!
//! Does not know: how they become cheaper.

use std::collections::BTreeSet;

use super::exponent::Exponent;
use super::facts::{Costly, Price};
use super::numbers::Coefficient;
use super::polynomial::{Atom, Entry, Monomial, Polynomial, System, needed};
use crate::program::cost::thirds::{FLOP, INSTRUCTION};
use hamel_expr::Func;

/// What a call costs: all polynomials that the roots need, with their divisions and functions.
pub(super) fn cost(system: &System, entries: &[Entry], roots: &[usize]) -> i64 {
    let mut total = 0;
    let mut costly: BTreeSet<Costly> = BTreeSet::new();
    for k in needed(system, entries, roots) {
        let price = entries[k].value.price(|| Price::of(system, &entries[k].value));
        total += price.sum;
        costly.extend(price.costly.iter().copied());
    }
    total + costly.iter().map(Costly::cost).sum::<i64>()
}

impl Price {
    pub(super) fn of(system: &System, value: &Polynomial) -> Price {
        let mut costly: BTreeSet<Costly> = BTreeSet::new();
        for (atom, q) in value.iter().flat_map(|(m, _)| m) {
            if q.is_negative() {
                costly.insert(Costly::Division(*atom));
            }
            if !q.is_whole() {
                costly.insert(Costly::Root(*atom));
            }
            match system.atom(*atom) {
                Atom::Function(f, argument) => {
                    // Sine and cosine of one angle are computed together.
                    let kind = if f == Func::Sin { Func::Cos } else { f };
                    costly.insert(Costly::Function(kind, argument));
                }
                Atom::Atan2(y, x) => _ = costly.insert(Costly::Atan2(y, x)),
                Atom::Input(_) | Atom::Poly(_) => {}
            }
        }
        Price { sum: Shape::of(value).cost(), costly: costly.into_iter().collect() }
    }
}

/// Multiplications, terms, and terms with multiplications.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shape {
    pub(super) n_mul: i64,
    pub(super) n_terms: i64,
    pub(super) n_products: i64,
}

impl Shape {
    pub(super) fn of(value: &[(Monomial, Coefficient)]) -> Shape {
        let mut shape = Shape::default();
        for (m, c) in value {
            shape.add(n_mul(m, *c), 1);
        }
        shape
    }

    /// The same with a term more.
    pub(super) fn with(mut self, m: &Monomial, c: Coefficient) -> Shape {
        self.add(n_mul(m, c), 1);
        self
    }

    pub(super) fn add(&mut self, n_mul: i64, sign: i64) {
        self.n_mul += sign * n_mul;
        self.n_terms += sign;
        self.n_products += sign * i64::from(n_mul > 0);
    }

    pub(super) fn cost(&self) -> i64 {
        let n_add = (self.n_terms - 1).max(0);
        let fused = self.n_products.min(n_add);
        INSTRUCTION * (self.n_mul + n_add - fused) + FLOP * (self.n_mul + n_add)
    }
}

/// What it costs that the number of a term is other than one.
pub(super) fn price_of_number(value: &Polynomial, position: usize) -> i64 {
    let mut shape = Shape::default();
    for (k, (m, c)) in value.iter().enumerate() {
        if k != position {
            shape.add(n_mul(m, *c), 1);
        }
    }
    let with = |c: Coefficient| {
        let mut shape = shape;
        shape.add(n_mul(&value[position].0, c), 1);
        shape.cost()
    };
    with(Coefficient { negative: false, number: u32::MAX }) - with(Coefficient::ONE)
}

/// Literals of a power: `x x x` for a cube, fewer for higher powers by squaring.
pub(super) fn n_literals(q: Exponent) -> i64 {
    let whole = q.truncated().abs();
    let fraction = i64::from(!q.is_whole());
    let chain = if whole <= 3 { i64::from(whole) } else { 2 * i64::from(whole.ilog2()) };
    chain + fraction
}

pub(super) fn n_mul(m: &Monomial, c: Coefficient) -> i64 {
    let literals: i64 = m.iter().map(|(_, q)| n_literals(*q)).sum();
    (literals + i64::from(!c.is_unit()) - 1).max(0)
}
