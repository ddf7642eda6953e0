//! When a value cannot be told from the rounding errors of its terms.
//!
//! Deliberately does not know: what the values are, what is done about one that is lost.

use std::collections::BTreeMap;

use num_traits::{One, Signed};

use crate::expr::{ExprId, Func, Graph, Node, Rational, Section, Sign, SymbolId, inlined, sign_of};

/// Operations behind a term, prepared numbers included: what few terms exceed.
const ROUNDINGS_OF_A_TERM: usize = 8;

/// For every expression, in the form in which it is computed, a scale `s` such that its value `p` is nothing but rounding error where `s + p = s`.
///
/// With `n` terms `t_i` that is `s = (n + 8) sum_i |t_i|`: the error of a sum is at most `(n - 1 + m) u sum_i |t_i|` where each
/// term is the result of `m` operations, those of the numbers in it included, and `s + p = s` in
/// arithmetic of unit roundoff `u` for `|p| <= u s`, so that no constant of a number format enters. Sums that other
/// sums are made of are taken apart. Where no terms can cancel it is zero, and `0 + p = 0` says that `p` is zero.
///
/// # Source
/// Higham 2002, Accuracy and stability of numerical algorithms, section 4.2
pub(super) fn rounding_scales(
    graph: &mut Graph,
    expressions: &[ExprId],
    sections: &[Section],
    signs: &BTreeMap<ExprId, Sign>,
) -> Vec<ExprId> {
    let definitions: BTreeMap<SymbolId, ExprId> =
        sections.iter().flat_map(|s| &s.definitions).map(|d| (d.symbol, d.expr)).collect();
    let values = inlined(graph, sections.iter().flat_map(|s| &s.definitions));
    let scales = expressions.iter().map(|e| {
        let terms = terms(graph, *e, &definitions);
        let mut signs_met = [false; 2];
        let mut sizes = Vec::with_capacity(terms.len());
        for (term, q) in &terms {
            // Signs show when definitions are put in: `gamma1 Z1` is a square when `Z1 = gamma1/I1`.
            let value = graph.subs(*term, &values).unwrap_or(*term);
            let size = match sign_of(graph, value, signs) {
                Sign::Positive | Sign::NonNegative => {
                    signs_met[usize::from(q.is_negative())] = true;
                    *term
                }
                Sign::Negative | Sign::NonPositive => {
                    signs_met[usize::from(q.is_positive())] = true;
                    graph.neg(*term)
                }
                Sign::NonZero | Sign::Unknown => {
                    signs_met = [true; 2];
                    graph.func(Func::Abs, *term)
                }
            };
            sizes.push((size, q.abs() * Rational::from_integer((terms.len() + ROUNDINGS_OF_A_TERM).into())));
        }
        if terms.len() > 1 && signs_met == [true; 2] {
            graph.linear_combination(&sizes)
        } else {
            graph.zero()
        }
    });
    scales.collect()
}

/// The terms that an expression is a sum of, with their coefficients, seen through the names of sums.
fn terms(graph: &Graph, e: ExprId, definitions: &BTreeMap<SymbolId, ExprId>) -> Vec<(ExprId, Rational)> {
    let mut terms = Vec::new();
    let mut pending = vec![(e, Rational::one())];
    while let Some((e, q)) = pending.pop() {
        match graph.node(e) {
            Node::Sum { constant, terms: inner } => {
                pending.extend(inner.iter().map(|(t, c)| (*t, &q * c)));
                pending.push((graph.one(), q * constant));
            }
            Node::Symbol(s) => match definitions.get(s).map(|d| (d, graph.node(*d))) {
                Some((d, Node::Sum { .. } | Node::Symbol(_))) => pending.push((*d, q)),
                _ => terms.push((e, q)),
            },
            _ => terms.push((e, q)),
        }
    }
    terms.retain(|(_, q)| *q != Rational::default());
    terms
}
