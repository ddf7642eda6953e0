//! Entropies that are produced: the sign of their rates, from conditions on parameters and domains.
//!
//! A rate is not negative where its terms are not, over a denominator that is positive. A term `c` without a sign is
//! made up for by two others where `c^2 = 4 p q`, `p` and `q` not negative: `p + c + q` is a square times something not
//! negative then, as in `kappa (T1 - T2)^2/(T1 T2)` for two bodies that exchange heat.
//!
//! # Source
//! Gay-Balmaz, Yoshimura 2017, A Lagrangian variational formulation for nonequilibrium thermodynamics I, section 3.
//!
//! Does not know: what produces entropy.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Graph, Node, Rational, Sign, sign_of};
use num_traits::Signed;

use super::equations::Production;
use crate::reduction::ReducedSystem;

/// Terms beyond which no sign is looked for: pairs of them are compared with a third.
const MAX_TERMS: usize = 40;

/// Each entropy of a system, and their sum: whether it is seen to grow.
pub(super) fn productions(system: &ReducedSystem) -> Vec<Production> {
    let mut g = system.graph.clone();
    let own: Vec<(String, ExprId)> = (system.own_rates.iter().filter(|own| own.is_entropy))
        .map(|own| (g.name(own.symbol).to_owned(), own.rate))
        .collect();
    let mut found = Vec::new();
    for (name, rate) in &own {
        let is_produced = is_not_negative(&mut g, *rate, &system.signs);
        found.push(Production { names: vec![name.clone()], is_produced });
    }
    if own.len() > 1 {
        let rates: Vec<ExprId> = own.iter().map(|(_, rate)| *rate).collect();
        let sum = g.sum(&rates);
        let names = own.into_iter().map(|(name, _)| name).collect();
        let is_produced = is_not_negative(&mut g, sum, &system.signs);
        found.push(Production { names, is_produced });
    }
    found
}

/// Whether an expression is seen not to be negative.
fn is_not_negative(g: &mut Graph, e: ExprId, signs: &BTreeMap<ExprId, Sign>) -> bool {
    let is = |g: &Graph, e: ExprId| matches!(sign_of(g, e, signs), Sign::Positive | Sign::NonNegative);
    if is(g, e) {
        return true;
    }
    let expanded = g.expand(e);
    let denominator = denominator(g, expanded);
    if sign_of(g, denominator, signs) != Sign::Positive {
        return false;
    }
    let product = g.mul(expanded, denominator);
    let numerator = g.expand(product);
    let mut terms: Vec<ExprId> =
        g.summands(numerator).into_iter().map(|(term, q)| g.scale(term, &q)).collect();
    if terms.len() > MAX_TERMS {
        return false;
    }
    while let Some(k) = terms.iter().position(|term| !is(g, *term)) {
        let cross = terms.remove(k);
        let square = g.powi(cross, 2);
        let sided: Vec<usize> = (0..terms.len()).filter(|p| is(g, terms[*p])).collect();
        let pairs = sided.iter().flat_map(|p| sided.iter().filter(move |q| p < *q).map(move |q| (*p, *q)));
        let makes_up = |(p, q): &(usize, usize)| {
            let product = g.mul(terms[*p], terms[*q]);
            let four = g.scale(product, &Rational::from_integer(4.into()));
            let rest = g.sub(square, four);
            g.is_zero(rest)
        };
        let Some((p, q)) = pairs.collect::<Vec<_>>().into_iter().find(makes_up) else { return false };
        terms.remove(q);
        terms.remove(p);
    }
    true
}

/// The product of what the terms of a sum divide by, each to its highest power.
fn denominator(g: &mut Graph, sum: ExprId) -> ExprId {
    let mut powers: BTreeMap<ExprId, Rational> = BTreeMap::new();
    for (term, _) in g.summands(sum) {
        let Node::Product { factors, .. } = g.node(term).clone() else { continue };
        for (base, q) in factors.iter().filter(|(_, q)| q.is_negative()) {
            let power = powers.entry(*base).or_insert_with(|| -q.clone());
            if *power < -q.clone() {
                *power = -q.clone();
            }
        }
    }
    let mut product = g.one();
    for (base, q) in powers {
        // A positive power divides by nothing.
        if let Ok(factor) = g.pow(base, &q) {
            product = g.mul(product, factor);
        }
    }
    product
}
