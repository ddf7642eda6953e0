//! What is lowered, checked, with what lowering knows of it from the start.
//!
//! Does not know: how anything is rewritten.

use std::collections::{BTreeMap, BTreeSet};

use super::classes::{Class, Classes};
use super::{Inputs, ParamCondition, Request};
use crate::program::Relation;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Node, Section, Sign, SymbolId, sign_of};

/// What is lowered, with the dependence of every expression on parameters, time and state.
#[derive(Clone)]
pub(super) struct Source<'a> {
    pub(super) inputs: &'a Inputs,
    pub(super) sections: &'a [Section],
    pub(super) conditions: &'a [ParamCondition],
    pub(super) requests: &'a [Request],
    pub(super) classes: Classes,
    /// What is known about signs, also of parameter-only definitions and of what the conditions speak of.
    pub(super) signs: BTreeMap<ExprId, Sign>,
}

impl<'a> Source<'a> {
    /// Checks what is to be lowered.
    ///
    /// # Errors
    /// [`Error::Program`] when a symbol is used before its definition, a condition depends on more than parameters, or
    /// a function depends on the argument of another one.
    pub(super) fn new(
        graph: &mut Graph,
        inputs: &'a Inputs,
        sections: &'a [Section],
        conditions: &'a [ParamCondition],
        requests: &'a [Request],
    ) -> Result<Source<'a>, Error> {
        let classes = Classes::of(graph, inputs, sections, requests)?;
        let mut source = Source { inputs, sections, conditions, requests, classes, signs: BTreeMap::new() };
        source.check_conditions(graph)?;
        source.check_arguments(graph)?;
        source.signs = source.signs(graph);
        Ok(source)
    }

    /// The same with further expressions in what is known.
    ///
    /// # Errors
    /// [`Error::Program`] for an unknown symbol.
    pub(super) fn with(&self, graph: &Graph, expressions: &[ExprId]) -> Result<Source<'a>, Error> {
        let mut source = self.clone();
        for e in expressions {
            source.classes.add(graph, *e)?;
        }
        Ok(source)
    }

    fn check_conditions(&self, graph: &Graph) -> Result<(), Error> {
        let mut classes = self.classes.clone();
        for condition in self.conditions {
            for side in [condition.greater, condition.less] {
                if classes.add(graph, side)? > Class::Param {
                    return Err(Error::Program {
                        reason: format!("condition {} depends on time or state", condition.text),
                    });
                }
            }
        }
        Ok(())
    }

    /// A function sees its own argument only.
    fn check_arguments(&self, graph: &Graph) -> Result<(), Error> {
        if self.inputs.arguments.is_empty() {
            return Ok(());
        }
        for request in self.requests {
            let roots: Vec<ExprId> = request.results.iter().map(|(_, e)| *e).collect();
            let needed = needed_definitions(graph, self.sections, &roots);
            let definitions = self.sections.iter().flat_map(|s| &s.definitions);
            let used = definitions.filter(|d| needed.contains(&d.symbol)).map(|d| d.expr).chain(roots);
            let used: BTreeSet<SymbolId> = used.flat_map(|e| graph.free_symbols(e)).collect();
            // Functions may take the same vector.
            let own = self.inputs.argument(&request.role);
            let mut all = self.inputs.arguments.values().flatten();
            if let Some(foreign) = all.find(|s| used.contains(s) && !own.contains(s)) {
                return Err(Error::Program {
                    reason: format!(
                        "{} depends on {}, which is no argument of it",
                        request.role,
                        graph.name(*foreign)
                    ),
                });
            }
        }
        Ok(())
    }

    fn signs(&self, graph: &mut Graph) -> BTreeMap<ExprId, Sign> {
        let mut signs = self.inputs.signs.clone();
        for condition in self.conditions {
            if condition.less == graph.zero() && condition.relation != Relation::GreaterEqual {
                signs.entry(condition.greater).or_insert(Sign::NonZero);
            }
        }
        for definition in self.sections.iter().flat_map(|s| &s.definitions) {
            if self.classes.get(definition.expr) <= Class::Param {
                let sign = sign_of(graph, definition.expr, &signs);
                let symbol = graph.sym(definition.symbol);
                if sign != Sign::Unknown {
                    signs.insert(symbol, sign);
                }
            }
        }
        signs
    }

    /// The circles whose relation a function may use: all of them but those of which a result is a function, as one is
    /// that asks how far the state has drifted off them; none if it speaks of nothing but the circles.
    pub(super) fn circles_for(&self, graph: &Graph, roots: &[ExprId]) -> Vec<[SymbolId; 2]> {
        let own: BTreeSet<SymbolId> = self.inputs.circles.iter().flatten().copied().collect();
        let is_about_circles = roots.iter().all(|e| graph.free_symbols(*e).is_subset(&own));
        let is_result = |circle: &[SymbolId; 2]| {
            let both: BTreeSet<SymbolId> = circle.iter().copied().collect();
            roots.iter().any(|e| graph.free_symbols(*e) == both)
        };
        let others = self.inputs.circles.iter().filter(|circle| !is_about_circles && !is_result(circle));
        others.copied().collect()
    }
}

/// The definitions a function needs, by symbol, found from its results backwards.
pub(super) fn needed_definitions(
    graph: &Graph,
    sections: &[Section],
    roots: &[ExprId],
) -> BTreeSet<SymbolId> {
    let definitions: BTreeMap<SymbolId, ExprId> =
        sections.iter().flat_map(|s| &s.definitions).map(|d| (d.symbol, d.expr)).collect();
    let mut needed = BTreeSet::new();
    let mut seen = BTreeSet::new();
    let mut pending: Vec<ExprId> = roots.to_vec();
    while let Some(e) = pending.pop() {
        if !seen.insert(e) {
            continue;
        }
        match graph.node(e) {
            Node::Symbol(s) => {
                if let Some(definition) = definitions.get(s)
                    && needed.insert(*s)
                {
                    pending.push(*definition);
                }
            }
            node => node.for_each_operand(|operand| pending.push(operand)),
        }
    }
    needed
}
