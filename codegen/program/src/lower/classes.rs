//! What an expression depends on: nothing but parameters, time, or the state.

use rustc_hash::FxHashMap;

use super::{Inputs, Request};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Node, Section, SymbolId};

/// The fastest-changing input of a value; later variants change faster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Class {
    Constant,
    Param,
    /// Time and inputs.
    Time,
    State,
}

/// Classes of expressions, in the light of the inputs and definitions.
#[derive(Clone, Debug)]
pub(super) struct Classes {
    symbols: FxHashMap<SymbolId, Class>,
    expressions: FxHashMap<ExprId, Class>,
}

impl Classes {
    /// Classifies everything that definitions and results use.
    ///
    /// # Errors
    /// [`Error::Program`] for a symbol that is neither an input nor defined earlier, or is defined twice.
    pub(super) fn of(
        graph: &Graph,
        inputs: &Inputs,
        sections: &[Section],
        requests: &[Request],
    ) -> Result<Classes, Error> {
        let mut symbols: FxHashMap<SymbolId, Class> = FxHashMap::default();
        symbols.extend(inputs.params.iter().map(|s| (*s, Class::Param)));
        symbols.insert(inputs.time, Class::Time);
        symbols.extend(inputs.held.iter().map(|(s, _)| (*s, Class::Time)));
        symbols.extend(inputs.state.iter().map(|s| (*s, Class::State)));
        symbols.extend(inputs.arguments.values().flatten().map(|s| (*s, Class::State)));
        let mut classes = Classes { symbols, expressions: FxHashMap::default() };
        for definition in sections.iter().flat_map(|s| &s.definitions) {
            let class = classes.add(graph, definition.expr)?;
            if classes.symbols.insert(definition.symbol, class).is_some() {
                return Err(Error::Program {
                    reason: format!("{} is an input or defined twice", graph.name(definition.symbol)),
                });
            }
        }
        for (_, e) in requests.iter().flat_map(|r| &r.results) {
            classes.add(graph, *e)?;
        }
        Ok(classes)
    }

    /// Classifies an expression and all it uses.
    ///
    /// # Errors
    /// [`Error::Program`] for an unknown symbol.
    pub(super) fn add(&mut self, graph: &Graph, root: ExprId) -> Result<Class, Error> {
        for e in post_order(graph, &[root], |e| self.expressions.contains_key(&e)) {
            let class = match graph.node(e) {
                Node::Symbol(s) => *self.symbols.get(s).ok_or_else(|| Error::Program {
                    reason: format!("{} is used before its definition, or is no input", graph.name(*s)),
                })?,
                node => {
                    let mut class = Class::Constant;
                    node.for_each_operand(|operand| class = class.max(self.expressions[&operand]));
                    class
                }
            };
            self.expressions.insert(e, class);
        }
        Ok(self.expressions[&root])
    }

    /// Class of an expression added before.
    pub(super) fn get(&self, e: ExprId) -> Class {
        self.expressions[&e]
    }
}

/// The nodes behind `roots` for which `done` is false, operands first; does not look behind those that are done.
pub(super) fn post_order(graph: &Graph, roots: &[ExprId], done: impl Fn(ExprId) -> bool) -> Vec<ExprId> {
    let mut seen = rustc_hash::FxHashSet::default();
    let mut pending = roots.to_vec();
    while let Some(e) = pending.pop() {
        if !done(e) && seen.insert(e) {
            graph.node(e).for_each_operand(|operand| pending.push(operand));
        }
    }
    // Operands precede the nodes that use them in the arena.
    let mut ordered: Vec<ExprId> = seen.into_iter().collect();
    ordered.sort_unstable();
    ordered
}
