//! Where the rates have values: intervals of coordinates, and arguments of functions that have no value everywhere.
//!
//! Does not know: what is divided by, how conditions are watched.

use std::collections::BTreeSet;

use num_traits::Signed;

use hamel_expr::{
    ExprId, Func, Graph, Node, Rational, Sign, Style, SymbolId, inlined, needed_sections, sign_of,
};
use hamel_mechanics::mechanics::Equations;
use hamel_program::lower::ParamCondition;
use hamel_program::program::Relation;

/// What has to hold for the rates to have values.
pub(super) struct Domain {
    /// Of what changes along a motion: positive inside, with the condition in words.
    pub(super) moving: Vec<(String, ExprId)>,
    /// Of parameters alone.
    pub(super) conditions: Vec<ParamCondition>,
}

/// Longer formulas are cut.
const MAX_FORMULA: usize = 60;

/// Intervals of the coordinates that are not left out, then the arguments of logarithms, roots, `asin`, `acos` and of
/// logarithms of rotations in
/// the rates, in the order of their use, unless these are seen to be inside.
///
/// An argument that inputs reach has no condition: guards do not know what drives these.
pub(super) fn domain(
    graph: &mut Graph,
    equations: &Equations,
    rates: &[ExprId],
    left_out: &BTreeSet<SymbolId>,
) -> Domain {
    let system = &equations.system;
    let intervals = system.domains.iter().filter(|d| !graph.depends_on(d.positive, left_out));
    let mut domain =
        Domain { moving: intervals.map(|d| (d.text.clone(), d.positive)).collect(), conditions: Vec::new() };
    let sections = needed_sections(graph, &equations.sections, rates);
    let definitions = || sections.iter().flat_map(|s| &s.definitions);
    let mut arguments: Vec<(ExprId, Inside)> = Vec::new();
    for e in definitions().map(|d| d.expr).chain(rates.iter().copied()).collect::<Vec<_>>() {
        for node in graph.reachable(&[e]) {
            for found in partial(graph.node(node)) {
                if !arguments.contains(&found) {
                    arguments.push(found);
                }
            }
        }
    }
    if arguments.is_empty() {
        return domain;
    }
    let values = inlined(graph, definitions());
    let inputs: BTreeSet<SymbolId> = system.inputs.iter().map(|i| i.symbol).collect();
    let parameters: BTreeSet<SymbolId> = system.params.iter().map(|p| p.symbol).collect();
    for (argument, inside) in arguments {
        let value = graph.subs(argument, &values).unwrap_or(argument);
        let watched = match inside {
            Inside::BelowOne => {
                let one = graph.one();
                graph.sub(one, value)
            }
            Inside::Positive | Inside::NotNegative | Inside::UpToOne => value,
        };
        let sign = sign_of(graph, watched, &system.signs);
        let symbols = graph.free_symbols(value);
        // Where an argument that cannot be negative is zero is a matter of what is divided by, or of infinity.
        let is_inside = inside != Inside::UpToOne && matches!(sign, Sign::Positive | Sign::NonNegative);
        if is_inside || symbols.is_empty() || symbols.iter().any(|s| inputs.contains(s)) {
            continue;
        }
        let formula = graph.display(value, Style::Plain);
        let formula = match formula.chars().count() > MAX_FORMULA {
            true => format!("{} ..", formula.chars().take(MAX_FORMULA).collect::<String>()),
            false => formula,
        };
        if symbols.iter().all(|s| parameters.contains(s)) {
            domain.conditions.extend(conditions(graph, (argument, inside), &formula));
        } else {
            let (text, positive) = moving(graph, (argument, inside), &formula);
            domain.moving.push((text, positive));
        }
    }
    domain
}

/// Where a function of an argument has a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Inside {
    Positive,
    NotNegative,
    /// Between minus one and one.
    UpToOne,
    BelowOne,
}

/// The arguments of a node that has no value for all of them.
fn partial(node: &Node) -> Vec<(ExprId, Inside)> {
    match node {
        Node::Function(Func::Ln, a) => vec![(*a, Inside::Positive)],
        Node::Function(Func::Asin | Func::Acos, a) => vec![(*a, Inside::UpToOne)],
        Node::Function(Func::Turn(_), a) => vec![(*a, Inside::BelowOne)],
        Node::Product { factors, .. } => {
            let roots = factors.iter().filter(|(_, q)| !q.is_integer());
            let inside = |q: &Rational| match q.is_negative() {
                true => Inside::Positive,
                false => Inside::NotNegative,
            };
            roots.map(|(base, q)| (*base, inside(q))).collect()
        }
        _ => Vec::new(),
    }
}

/// A condition along a motion. Where the end belongs to the domain the function itself is computed, which is not a
/// number outside.
fn moving(graph: &mut Graph, (a, inside): (ExprId, Inside), formula: &str) -> (String, ExprId) {
    let above_one = |graph: &mut Graph, e: ExprId| {
        let one = graph.one();
        graph.add(one, e)
    };
    match inside {
        Inside::Positive => (format!("{formula} > 0"), a),
        Inside::NotNegative => {
            let root = graph.sqrt(a);
            (format!("{formula} >= 0"), above_one(graph, root))
        }
        Inside::BelowOne => {
            let one = graph.one();
            (format!("{formula} < 1"), graph.sub(one, a))
        }
        Inside::UpToOne => {
            let angle = graph.func(Func::Acos, a);
            (format!("-1 <= {formula} <= 1"), above_one(graph, angle))
        }
    }
}

/// Conditions on parameters.
fn conditions(graph: &mut Graph, (a, inside): (ExprId, Inside), formula: &str) -> Vec<ParamCondition> {
    let (zero, one) = (graph.zero(), graph.one());
    let condition = |text: String, greater, less, relation| ParamCondition {
        text,
        meaning: "the equations have no value otherwise".into(),
        greater,
        less,
        relation,
        is_rounded: false,
    };
    match inside {
        Inside::Positive => vec![condition(format!("{formula} > 0"), a, zero, Relation::Greater)],
        Inside::NotNegative => vec![condition(format!("{formula} >= 0"), a, zero, Relation::GreaterEqual)],
        Inside::BelowOne => vec![condition(format!("{formula} < 1"), one, a, Relation::Greater)],
        Inside::UpToOne => {
            let below = graph.neg(one);
            vec![
                condition(format!("{formula} >= -1"), a, below, Relation::GreaterEqual),
                condition(format!("{formula} <= 1"), one, a, Relation::GreaterEqual),
            ]
        }
    }
}
