//! What is asked of the pivots of a scene, and when.
//!
//! `mechanics::solve` names the pivots; those of parameters alone become conditions on these, the others are handed to
//! `lower::pivots`, which tells the rest. Does not know: how pivots are computed and compared with their rounding
//! errors.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::{ExprId, Func, Graph, Rational, Sign, SymbolId, inlined, rational_to_f64, sign_of};
use hamel_mechanics::mechanics::{Equations, Pivot, PivotOrigin};
use hamel_program::lower::{self, ParamCondition};
use hamel_program::program::Relation;

use super::defaults;

/// What is asked of the pivots, and when.
pub(super) struct SortedPivots {
    /// Of those that depend on parameters alone: asked when these are prepared.
    pub(super) conditions: Vec<ParamCondition>,
    /// Those that change along a motion and could vanish.
    pub(super) moving: Vec<(String, ExprId)>,
    pub(super) divisors: lower::Divisors,
}

/// Entries of a matrix without a definite sign may be added to this multiple of their size while it is factored: three
/// of sixteen digits are lost at most besides those that its condition costs.
const MAX_GROWTH: i64 = 1024;

/// Sorts pivots by what is known about them.
///
/// A symmetric matrix of parameters whose pivots are positive for the defaults is taken for an inertia, and has to be
/// positive definite: elimination is stable then (Higham 2002, section 10.1). From any other, elimination in a fixed
/// order can lose everything, which the growth of its entries tells (section 9.3).
pub(super) fn sorted_pivots(graph: &mut Graph, equations: &Equations) -> SortedPivots {
    let system = &equations.system;
    let values = inlined(graph, equations.sections.iter().flat_map(|s| &s.definitions));
    let defaults: BTreeMap<SymbolId, f64> =
        system.params.iter().map(|p| (p.symbol, rational_to_f64(&p.default))).collect();
    let in_inputs: Vec<ExprId> =
        equations.pivots.iter().map(|p| graph.subs(p.expr, &values).unwrap_or(p.expr)).collect();
    // Names of symmetric matrices with a pivot that is not positive for the defaults.
    let mut indefinite = BTreeSet::new();
    for (pivot, value) in equations.pivots.iter().zip(&in_inputs) {
        let is_positive = |x: f64| x.is_finite() && x > 0.0;
        if equations.is_parameter_only(pivot.expr)
            && !graph.eval_f64(*value, &defaults).is_some_and(is_positive)
        {
            indefinite.insert(&pivot.matrix.name);
        }
    }
    let mut sorted =
        SortedPivots { conditions: Vec::new(), moving: Vec::new(), divisors: lower::Divisors::default() };
    let mut watched: BTreeMap<&String, lower::WatchedMatrix> = BTreeMap::new();
    let mut is_a_sum_of_squares = None;
    for (pivot, value) in equations.pivots.iter().zip(in_inputs) {
        let sign = sign_of(graph, value, &system.signs);
        let matrix = &pivot.matrix;
        let is_parameter_only = equations.is_parameter_only(pivot.expr);
        if sign.is_definite() {
            if !is_parameter_only {
                sorted.divisors.names.push((value, pivot.name.clone()));
            }
        } else if is_parameter_only {
            let is_inertia = matrix.is_symmetric && !indefinite.contains(&matrix.name);
            sorted.conditions.push(pivot_condition(graph, pivot, is_inertia));
            if !is_inertia && let Some(origin) = &pivot.origin {
                sorted.conditions.extend(growth_condition(graph, &pivot.name, origin));
            }
        } else {
            sorted.moving.push((pivot.name.clone(), pivot.expr));
            let mut keeps_sign = || {
                matrix.follows_hessian
                    && *is_a_sum_of_squares.get_or_insert_with(|| equations.hessian_is_a_sum_of_squares())
            };
            if sign == Sign::Unknown && !keeps_sign() {
                let new = || lower::WatchedMatrix { is_symmetric: matrix.is_symmetric, pivots: Vec::new() };
                watched.entry(&matrix.name).or_insert_with(new).pivots.push(pivot.expr);
            }
        }
    }
    sorted.divisors.watched = watched.into_values().collect();
    sorted
}

/// That a pivot of parameters can be divided by, and is positive where it is of an inertia.
fn pivot_condition(graph: &Graph, pivot: &Pivot, is_inertia: bool) -> ParamCondition {
    let (relation, text, meaning) = if is_inertia {
        (
            Relation::Greater,
            format!("{} > 0", pivot.name),
            "the matrix of inertia is positive definite for the default parameters and has to be so for these",
        )
    } else {
        (Relation::NotEqual, defaults::not_zero(&pivot.name), "")
    };
    ParamCondition {
        text,
        meaning: meaning.into(),
        greater: pivot.expr,
        less: graph.zero(),
        relation,
        is_rounded: true,
    }
}

/// That the terms of a pivot are not so much larger than the entries of the matrix that these are lost in their
/// rounding errors; none for the first pivot, which is an entry.
fn growth_condition(graph: &mut Graph, name: &str, origin: &PivotOrigin) -> Option<ParamCondition> {
    if origin.updates.is_empty() {
        return None;
    }
    let size = |graph: &mut Graph, e: ExprId| graph.func(Func::Abs, e);
    let mut terms = vec![size(graph, origin.entry)];
    for update in &origin.updates {
        let product = graph.product(update);
        terms.push(size(graph, product));
    }
    let entries: Vec<ExprId> = origin.entries.iter().map(|e| size(graph, *e)).collect();
    let (terms, entries) = (graph.sum(&terms), graph.sum(&entries));
    Some(ParamCondition {
        text: format!("terms of {name} <= {MAX_GROWTH} entries of its matrix"),
        meaning: "the entries would be lost in the rounding errors of the elimination".into(),
        greater: graph.scale(entries, &Rational::from_integer(MAX_GROWTH.into())),
        less: terms,
        relation: Relation::GreaterEqual,
        is_rounded: false,
    })
}
