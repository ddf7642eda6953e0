//! When a value cannot be told from the rounding errors of what it is computed from.
//!
//! Does not know: what the values are, what is done about one that is lost.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::{One, Signed};
use rustc_hash::FxHashMap;

use hamel_expr::{
    Definition, ExprId, Func, Graph, Node, Rational, Section, Sign, SymbolId, inlined, remembered_sign_of,
};

/// Operations behind a value whose terms cannot cancel, prepared numbers included: what few exceed.
const ROUNDINGS_OF_A_TERM: usize = 8;

/// For every expression, in the form in which it is computed, a scale `s` such that its value `p` is nothing but
/// rounding error unless `s + |p| > s`; the definitions that scales are written with.
///
/// Errors of operands are carried along, to first order, as multiples of the unit roundoff `u`: of a sum, a product, a
/// function
///
/// ```text
/// s(sum_i c_i t_i)     = sum_i |c_i| (n |t_i| + s(t_i))              n terms
/// s(prod_i f_i^q_i)    = 8 |prod_i f_i^q_i| + sum_i |q_i prod_j f_j^q_j / f_i| s(f_i)
/// s(f(a, ..))          = 8 |f(a, ..)| + |df/da| s(a) + ..
/// ```
///
/// and `s(v) = 8 |v|` where nothing behind `v` can cancel. `s + |p| = s` in arithmetic of unit roundoff `u` for `|p| <=
/// u s`, so that no constant of a number format enters, and what overflows or is not a number is not greater either. A
/// pivot `a - b^2/c` is lost in the errors of the pivot `c` before it that way, and not in those of its own difference
/// alone. Where no terms can cancel the scale is zero, and `0 + |p| = 0` says that `p` is zero.
///
/// # Source
/// Higham 2002, Accuracy and stability of numerical algorithms, sections 3.3 and 4.2
pub(super) fn rounding_scales(
    graph: &mut Graph,
    expressions: &[ExprId],
    sections: &[Section],
    signs: &BTreeMap<ExprId, Sign>,
) -> (Vec<ExprId>, Vec<Definition>) {
    let written = || sections.iter().flat_map(|s| &s.definitions);
    let definitions: BTreeMap<SymbolId, ExprId> = written().map(|d| (d.symbol, d.expr)).collect();
    let values = inlined(graph, written());
    let mut behind = BTreeSet::new();
    let mut pending = expressions.to_vec();
    while let Some(e) = pending.pop() {
        if behind.insert(e) {
            match graph.node(e) {
                Node::Symbol(s) => pending.extend(definitions.get(s)),
                node => node.for_each_operand(|operand| pending.push(operand)),
            }
        }
    }
    let (scales, definitions_of_scales, found) = (BTreeMap::new(), Vec::new(), FxHashMap::default());
    let mut analysis = Analysis { graph, values, signs, found, scales, definitions: definitions_of_scales };
    // Operands, and definitions before their names, precede what uses them in the arena.
    for e in behind {
        let scale = match analysis.graph.node(e).clone() {
            Node::Constant(_) | Node::Pi => None,
            Node::Symbol(s) => definitions.get(&s).and_then(|d| analysis.scales.get(d).copied()),
            Node::Sum { constant, terms } => {
                let one = analysis.graph.one();
                let constant = (constant != Rational::default()).then_some((one, constant));
                analysis.sum(terms.iter().cloned().chain(constant).collect())
            }
            Node::Product { coefficient, factors } => analysis.product(e, &coefficient, &factors),
            Node::Function(f, a) => {
                let slope = analysis.graph.func_derivative(f, a, e);
                analysis.function(e, slope.map(|slope| (a, slope)))
            }
            Node::Atan2(y, x) => {
                let slopes = analysis.graph.atan2_derivatives(y, x);
                analysis.function(e, slopes.into_iter().flat_map(|[by_y, by_x]| [(y, by_y), (x, by_x)]))
            }
        };
        if let Some(scale) = scale {
            // A sum takes in what it is scaled by of the terms of a product's, and needs no name for them.
            let is_sum = matches!(analysis.graph.node(e), Node::Sum { .. });
            let scale = if is_sum { analysis.named(scale) } else { scale };
            analysis.scales.insert(e, scale);
        }
    }
    let scales = expressions.iter().map(|e| match analysis.scales.get(e).copied() {
        Some(scale) => analysis.named(scale),
        None => analysis.graph.zero(),
    });
    (scales.collect(), analysis.definitions)
}

struct Analysis<'a> {
    graph: &'a mut Graph,
    /// Definitions written in the inputs.
    values: BTreeMap<SymbolId, ExprId>,
    signs: &'a BTreeMap<ExprId, Sign>,
    /// Signs found from these.
    found: FxHashMap<ExprId, Sign>,
    /// Scales of what has terms behind it that can cancel.
    scales: BTreeMap<ExprId, ExprId>,
    definitions: Vec<Definition>,
}

impl Analysis<'_> {
    /// A name for an expression, which hides what it is a sum of.
    fn named(&mut self, expr: ExprId) -> ExprId {
        if matches!(self.graph.node(expr), Node::Symbol(_)) {
            return expr;
        }
        let symbol = self.graph.define("", expr);
        self.definitions.push(Definition { symbol, expr });
        self.graph.sym(symbol)
    }

    /// The sign and the absolute value of an expression.
    fn size(&mut self, e: ExprId) -> (Sign, ExprId) {
        // Signs show when definitions are put in: `gamma1 Z1` is a square when `Z1 = gamma1/I1`.
        let value = self.graph.subs(e, &self.values).unwrap_or(e);
        let sign = remembered_sign_of(self.graph, value, self.signs, &mut self.found);
        let size = match sign {
            Sign::Positive | Sign::NonNegative => e,
            Sign::Negative | Sign::NonPositive => self.graph.neg(e),
            Sign::NonZero | Sign::Unknown => self.graph.func(Func::Abs, e),
        };
        (sign, size)
    }

    /// The scale of a sum; none where no terms cancel, in it or behind it.
    fn sum(&mut self, terms: Vec<(ExprId, Rational)>) -> Option<ExprId> {
        let n = terms.len();
        let mut signs_met = [false; 2];
        let mut can_cancel = false;
        let mut sizes = Vec::with_capacity(2 * n);
        for (term, q) in terms {
            let (sign, size) = self.size(term);
            match sign {
                Sign::Positive | Sign::NonNegative => signs_met[usize::from(q.is_negative())] = true,
                Sign::Negative | Sign::NonPositive => signs_met[usize::from(q.is_positive())] = true,
                Sign::NonZero | Sign::Unknown => signs_met = [true; 2],
            }
            let scale = self.scales.get(&term).copied();
            can_cancel |= scale.is_some();
            let own = if scale.is_some() { n } else { n + ROUNDINGS_OF_A_TERM };
            sizes.push((size, q.abs() * Rational::from_integer(own.into())));
            sizes.extend(scale.map(|scale| (scale, q.abs())));
        }
        can_cancel |= n > 1 && signs_met == [true; 2];
        can_cancel.then(|| self.graph.linear_combination(&sizes))
    }

    /// The scale of a product; none where no terms cancel behind it.
    fn product(
        &mut self,
        product: ExprId,
        coefficient: &Rational,
        factors: &[(ExprId, Rational)],
    ) -> Option<ExprId> {
        let mut terms = Vec::new();
        for (base, q) in factors {
            if let Some(scale) = self.scales.get(base).copied() {
                // `|q prod/base|` without dividing by what may be zero.
                let mut rest = factors.to_vec();
                rest.iter_mut().filter(|(b, _)| b == base).for_each(|(_, q)| *q -= Rational::one());
                let rest = self.graph.power_product(&rest).ok()?;
                let (_, size) = self.size(rest);
                let term = self.graph.mul(size, scale);
                terms.push((term, (q * coefficient).abs()));
            }
        }
        self.with_own(product, terms)
    }

    /// The scale of a function's value, given its arguments and the derivatives by them; none where no terms cancel
    /// behind these.
    fn function(
        &mut self,
        value: ExprId,
        arguments: impl IntoIterator<Item = (ExprId, ExprId)>,
    ) -> Option<ExprId> {
        let mut terms = Vec::new();
        for (argument, slope) in arguments {
            if let Some(scale) = self.scales.get(&argument).copied() {
                let (_, size) = self.size(slope);
                terms.push((self.graph.mul(size, scale), Rational::one()));
            }
        }
        self.with_own(value, terms)
    }

    /// Errors that operands bring, and those of the operations themselves.
    fn with_own(&mut self, value: ExprId, mut terms: Vec<(ExprId, Rational)>) -> Option<ExprId> {
        if terms.is_empty() {
            return None;
        }
        let (_, size) = self.size(value);
        terms.push((size, Rational::from_integer(ROUNDINGS_OF_A_TERM.into())));
        Some(self.graph.linear_combination(&terms))
    }
}
