//! What a right-hand side divides by, in the form in which it does so.
//!
//! Does not know: what the values mean; those that have a name of their own bring it along.

use std::collections::BTreeMap;

use num_traits::{One, Signed};

use crate::lower::Inputs;
use crate::lower::classes::{Class, Classes};
use crate::lower::form::Form;
use hamel_expr::error::Error;
use hamel_expr::{
    ExprId, Func, Graph, Node, Rational, Sign, Style, SymbolId, inlined, needed_sections, sign_of,
};

/// What is known about values that may be divided by.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Divisors {
    /// What those are called that cannot vanish and may yet overflow.
    pub names: Vec<(ExprId, String)>,
    /// Matrices with pivots that can change their sign.
    pub watched: Vec<WatchedMatrix>,
}

/// A matrix that is to stay regular along a motion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WatchedMatrix {
    /// Whether the sum of the pivots' signs is watched, by Sylvester's law of inertia, or their product, the sign of
    /// the determinant.
    pub is_symmetric: bool,
    /// The pivots that can change their sign, as the results of [`Role::Pivots`](crate::program::Role::Pivots) have
    /// them.
    pub pivots: Vec<ExprId>,
}

/// Longer formulas are no name.
const MAX_NAME: usize = 60;

/// A value that a function divides by.
pub(super) struct Divisor {
    pub(super) name: String,
    pub(super) expr: ExprId,
    /// Whether it is a product of others, whose rounding errors do not matter besides theirs.
    pub(super) is_composite: bool,
    /// Whether it is a single one that can be negative and positive.
    pub(super) changes_sign: bool,
}

/// The values that `function` divides by and that can vanish or overflow, without those in `known`; first single ones
/// in the order of their use, then their products and powers, which can overflow where these do not.
pub(super) fn divisors(
    graph: &mut Graph,
    inputs: &Inputs,
    function: &Form,
    known: &[ExprId],
) -> Result<Vec<Divisor>, Error> {
    let roots: Vec<ExprId> = function.request.results.iter().map(|(_, e)| *e).collect();
    let sections = needed_sections(graph, &function.sections, &roots);
    let requests = std::slice::from_ref(&function.request);
    let classes = Classes::of(graph, inputs, &function.sections, requests)?;
    let definitions = || sections.iter().flat_map(|s| &s.definitions);
    let expressions: Vec<ExprId> = definitions().map(|d| d.expr).chain(roots).collect();
    let mut denominators: Vec<Vec<(ExprId, Rational)>> = Vec::new();
    for e in expressions {
        for node in graph.reachable(&[e]) {
            let Node::Product { factors, .. } = graph.node(node) else { continue };
            let changing =
                factors.iter().filter(|(base, q)| q.is_negative() && classes.get(*base) > Class::Param);
            let denominator: Vec<(ExprId, Rational)> = changing.map(|(base, q)| (*base, -q)).collect();
            if !denominator.is_empty() && !denominators.contains(&denominator) {
                denominators.push(denominator);
            }
        }
    }
    if denominators.is_empty() {
        return Ok(Vec::new());
    }
    let values = inlined(graph, definitions());
    let mut naming = Naming { graph, inputs, function, values };
    let mut found: Vec<Divisor> = Vec::new();
    for (base, _) in denominators.iter().flatten() {
        if known.contains(base) || found.iter().any(|d| d.expr == *base) || naming.is_harmless(*base) {
            continue;
        }
        let changes_sign = naming.sign(*base) == Sign::Unknown && !naming.is_a_large_number(*base);
        found.push(Divisor { name: naming.name(*base), expr: *base, is_composite: false, changes_sign });
    }
    for denominator in &denominators {
        let is_single = matches!(denominator.as_slice(), [(_, q)] if *q <= Rational::one());
        if is_single || denominator.iter().all(|(base, _)| naming.is_bounded(*base)) {
            continue;
        }
        let expr = naming.graph.power_product(denominator);
        // Powers of what is not zero: there is nothing that could be divided by zero.
        let Ok(expr) = expr else { continue };
        if !found.iter().any(|d| d.expr == expr) {
            let name = naming.name(expr);
            found.push(Divisor { name, expr, is_composite: true, changes_sign: false });
        }
    }
    Ok(found)
}

struct Naming<'a> {
    graph: &'a mut Graph,
    inputs: &'a Inputs,
    function: &'a Form,
    /// Definitions written in the inputs.
    values: BTreeMap<SymbolId, ExprId>,
}

impl Naming<'_> {
    fn value(&mut self, e: ExprId) -> ExprId {
        self.graph.subs(e, &self.values).unwrap_or(e)
    }

    fn sign(&mut self, e: ExprId) -> Sign {
        let value = self.value(e);
        sign_of(self.graph, value, &self.inputs.signs)
    }

    /// Whether a value is a number and less than that, by sines and cosines: `2 + sin(x)`.
    fn is_a_large_number(&mut self, e: ExprId) -> bool {
        let value = self.value(e);
        let Node::Sum { constant, terms } = self.graph.node(value) else { return false };
        let is_up_to_one =
            |e: &ExprId| matches!(self.graph.node(*e), Node::Function(Func::Sin | Func::Cos | Func::Tanh, _));
        let sizes = terms.iter().map(|(term, q)| match self.graph.node(*term) {
            Node::Product { coefficient, factors } => {
                let bounded = factors.iter().all(|(base, q)| q.is_positive() && is_up_to_one(base));
                bounded.then(|| (coefficient * q).abs())
            }
            _ => is_up_to_one(term).then(|| q.abs()),
        });
        let largest: Option<Rational> = sizes.sum();
        largest.is_some_and(|largest| largest < constant.abs())
    }

    /// Whether a value can neither vanish nor overflow.
    fn is_harmless(&mut self, e: ExprId) -> bool {
        self.sign(e).is_definite() && self.is_bounded(e)
    }

    /// Whether a value is bounded for bounded parameters, whatever the state.
    fn is_bounded(&mut self, e: ExprId) -> bool {
        let value = self.value(e);
        let mut bounded: BTreeMap<ExprId, bool> = BTreeMap::new();
        let inputs = self.inputs;
        for node in self.graph.reachable(&[value]) {
            let is_bounded = match self.graph.node(node) {
                Node::Constant(_) | Node::Pi => true,
                Node::Symbol(s) => {
                    inputs.params.contains(s) || inputs.circles.iter().flatten().any(|c| c == s)
                }
                Node::Sum { terms, .. } => terms.iter().all(|(term, _)| bounded[term]),
                // What only parameters are in is checked when these are prepared.
                Node::Product { factors, .. } => factors.iter().all(|(base, q)| {
                    bounded[base] && (q.is_positive() || is_constant(self.graph, inputs, *base))
                }),
                Node::Function(
                    Func::Sin | Func::Cos | Func::Tanh | Func::Asin | Func::Acos | Func::Atan,
                    _,
                )
                | Node::Atan2(..) => true,
                Node::Function(Func::Abs | Func::Stumpff(_), a) => bounded[a],
                Node::Function(_, a) => is_constant(self.graph, inputs, *a),
            };
            bounded.insert(node, is_bounded);
        }
        bounded[&value]
    }

    /// What a value is called: a given name, its formula if that is short, the name of its definition otherwise.
    fn name(&mut self, e: ExprId) -> String {
        let value = self.value(e);
        let whole = match self.graph.node(e) {
            Node::Symbol(s) => self.function.units.get(s).map_or(value, |unit| self.graph.mul(*unit, value)),
            _ => value,
        };
        for (known, name) in &self.inputs.divisors.names {
            if self.graph.fingerprints_agree(whole, *known) {
                return name.clone();
            }
        }
        let formula = self.graph.display(value, Style::Plain);
        match self.graph.node(e) {
            Node::Symbol(s) if formula.chars().count() > MAX_NAME && !self.graph.name(*s).is_empty() => {
                self.graph.name(*s).to_owned()
            }
            _ if formula.chars().count() > MAX_NAME => {
                format!("{} ..", formula.chars().take(MAX_NAME).collect::<String>())
            }
            _ => formula,
        }
    }
}

fn is_constant(graph: &Graph, inputs: &Inputs, e: ExprId) -> bool {
    graph.free_symbols(e).iter().all(|s| inputs.params.contains(s))
}

/// Single divisors whose signs are told apart; more of them share a sign, the product of theirs.
const MAX_SINGLE: usize = 40;

/// `sum_m c_m s_m + sum_k 2^-(k+2) s_k` with `s_m` the sum or the product of the signs of a matrix's pivots, factors
/// `c_m` that keep the numbers apart, and the signs `s_k` of single divisors: a change of less than one is theirs
/// alone.
pub(super) fn signature(graph: &mut Graph, matrices: &[(bool, Vec<ExprId>)], single: &[ExprId]) -> ExprId {
    let sign = |graph: &mut Graph, p: ExprId| {
        let size = graph.func(Func::Abs, p);
        let inverse = graph.powi(size, -1);
        graph.mul(p, inverse)
    };
    let mut terms = Vec::new();
    let mut factor = Rational::one();
    for (is_symmetric, pivots) in matrices {
        let signs: Vec<ExprId> = pivots.iter().map(|p| sign(graph, *p)).collect();
        // Sums of n signs have n + 1 values at distances of two, and a product has two.
        let (number, n_values) =
            if *is_symmetric { (graph.sum(&signs), signs.len() + 1) } else { (graph.product(&signs), 2) };
        terms.push((number, factor.clone()));
        factor *= Rational::from_integer(n_values.into());
    }
    let half = Rational::new(1.into(), 2.into());
    let mut weight = half.clone();
    for k in 0..single.len().min(MAX_SINGLE) {
        let signs: Vec<ExprId> = single.iter().skip(k).step_by(MAX_SINGLE).map(|p| sign(graph, *p)).collect();
        weight *= &half;
        terms.push((graph.product(&signs), weight.clone()));
    }
    graph.linear_combination(&terms)
}
