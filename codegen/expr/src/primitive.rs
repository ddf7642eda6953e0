//! Functions with a given derivative along a motion, guessed from values and proved.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::Zero;

use super::graph::Graph;
use super::node::{ExprId, SymbolId};
use super::rational::Rational;
use super::relations::rational_relations;

/// Most functions that are tried.
const MAX_CANDIDATES: usize = 160;

/// `f` with `sum over s of df/ds s' = rate`: a rational combination of products of the symbols that move with terms of
/// the slopes of `rate` by what the rates are made of, of these terms, and of their derivatives. None where no such
/// combination has this derivative.
pub fn primitive(g: &mut Graph, rate: ExprId, moving: &BTreeMap<SymbolId, ExprId>) -> Option<ExprId> {
    let symbols: Vec<SymbolId> = moving.keys().copied().collect();
    let mut drives: BTreeSet<SymbolId> = BTreeSet::new();
    for e in moving.values() {
        drives.extend(g.free_symbols(*e));
    }
    drives.retain(|y| !moving.contains_key(y));
    let mut terms = Vec::new();
    for y in drives {
        let slope = g.diff(rate, y);
        let slope = g.expand(slope);
        terms.extend(g.summands(slope).into_iter().map(|(term, _)| term));
    }
    terms.retain(|e| *e != g.zero());
    terms.sort_unstable();
    terms.dedup();
    let mut candidates = Vec::new();
    for term in terms {
        candidates.push(term);
        for s in &symbols {
            let x = g.sym(*s);
            candidates.push(g.mul(x, term));
            let slope = g.diff(term, *s);
            candidates.push(slope);
            for other in &symbols {
                let x = g.sym(*other);
                candidates.push(g.mul(x, slope));
            }
        }
    }
    candidates.sort_unstable();
    candidates.dedup();
    let mut columns: Vec<Vec<ExprId>> = Vec::new();
    let mut functions = Vec::new();
    for f in candidates.into_iter().take(MAX_CANDIDATES) {
        let along = g.derivative_along(f, moving);
        if !g.is_zero(along) {
            functions.push(f);
            columns.push(vec![along]);
        }
    }
    columns.push(vec![rate]);
    let relation = rational_relations(g, &columns).pop()?;
    let last = relation.last().filter(|q| !q.is_zero())?.clone();
    let weights = relation[..functions.len()].iter().map(|q| -(q / &last));
    let sum: Vec<(ExprId, Rational)> = functions.into_iter().zip(weights).collect();
    let f = g.linear_combination(&sum);
    let along = g.derivative_along(f, moving);
    g.is_equal(along, rate).then_some(f)
}

#[cfg(test)]
mod tests {
    use super::primitive;
    use crate::{Func, Graph};
    use std::collections::BTreeMap;

    #[test]
    fn functions_are_found_by_their_rates_and_forms_that_are_not_closed_have_none() {
        let mut g = Graph::new();
        let [x, y, u, v] = ["x", "y", "u", "v"].map(|name| g.symbol(name));
        let [x_dot, y_dot] = [u, v].map(|s| g.sym(s));
        let moving = BTreeMap::from([(x, x_dot), (y, y_dot)]);
        let [at_x, at_y] = [x, y].map(|s| g.sym(s));
        let sine = g.func(Func::Sin, at_x);
        for f in [at_x, g.mul(at_x, at_y), g.powi(at_y, 3), g.mul(sine, at_y), sine] {
            let rate = g.derivative_along(f, &moving);
            let found = primitive(&mut g, rate, &moving).unwrap();
            assert!(g.is_equal(found, f));
        }
        let twisted = g.mul(at_x, y_dot);
        assert_eq!(primitive(&mut g, twisted, &moving), None);
    }
}
