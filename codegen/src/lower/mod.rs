//! Ordered definitions and wanted results to a flat straight-line [`Program`] with a parameter-only part.
//!
//! Value numbering, factoring, hoisting and dead-code removal happen here; every rewrite is directional and none makes
//! the program dearer. Deliberately does not know: mechanics (a definition is a name with a formula), Rust (a program
//! has operations and operands, no text).

mod absorb;
mod assemble;
mod class;
mod expressions;
mod factor;
mod interpret;
mod number;
mod program;
mod verify;

use std::collections::{BTreeMap, BTreeSet};

use crate::error::Error;
use crate::expr::{ExprId, Graph, SymbolId};

pub use crate::expr::{Definition, Section};

pub use interpret::ViolatedCondition;
pub use program::{
    Condition, Constant, Counts, Function, Instruction, Literal, Op, Operand, Prepare, Program, Relation,
    Slot,
};
pub use verify::verify;

use class::{Class, Classes};

/// The symbols that get their values from outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// Parameters, constant in time.
    pub params: Vec<SymbolId>,
    /// Time.
    pub time: SymbolId,
    /// Components of the state.
    pub state: Vec<SymbolId>,
}

/// A function to make: its name and its named results.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// Name of the function: `rhs`, `energy`, `check`, or an output.
    pub name: String,
    /// Names and values of the results in order.
    pub results: Vec<(String, ExprId)>,
}

/// A condition that the parameters have to satisfy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParamCondition {
    /// As the model words it.
    pub text: String,
    /// The side that has to be larger.
    pub greater: ExprId,
    /// The side that has to be smaller.
    pub less: ExprId,
    /// How they compare.
    pub relation: Relation,
}

/// More nodes than this and the factoring of single sections is no longer tried one by one.
const MAX_NODES_FOR_TRIALS: usize = 20_000;

/// Lowers sections of definitions and the requested functions to one program.
///
/// # Errors
/// [`Error::Program`] when a symbol is used before its definition, or a condition depends on more than parameters;
/// [`Error::OutOfRange`] when a constant does not fit an `f64`.
pub fn lower(
    graph: &mut Graph,
    inputs: &Inputs,
    sections: &[Section],
    conditions: &[ParamCondition],
    requests: &[Request],
) -> Result<Program, Error> {
    let plain = Source {
        inputs,
        sections,
        conditions,
        requests,
        classes: Classes::of(graph, inputs, sections, requests)?,
    };
    plain.check_conditions(graph)?;
    let (sections_factored, requests_factored) = factor::factor(graph, &plain)?;

    // Factoring saves operations within one sum and can lose a product that several sums share, so each section keeps
    // whichever form makes the whole program cheaper; the plain program is one of the candidates.
    let n_parts = sections.len() + 1;
    let attempt = |graph: &mut Graph, factored: &[bool]| -> Result<(u64, Program), Error> {
        let mixed: Vec<Section> = (0..sections.len())
            .map(|k| if factored[k] { sections_factored[k].clone() } else { sections[k].clone() })
            .collect();
        let wanted = if factored[sections.len()] { &requests_factored } else { requests };
        let classes = Classes::of(graph, inputs, &mixed, wanted)?;
        let source = Source { inputs, sections: &mixed, conditions, requests: wanted, classes };
        let program = source.lower_as_written(graph)?;
        let (sections_absorbed, requests_absorbed) = absorb::absorb(graph, &source)?;
        let (sections, requests) = (&sections_absorbed, &requests_absorbed);
        let classes = Classes::of(graph, inputs, sections, requests)?;
        let absorbed = Source { inputs, sections, conditions, requests, classes }.lower_as_written(graph)?;
        let (cost, cost_absorbed) = (program.cost(), absorbed.cost());
        Ok(if cost_absorbed < cost { (cost_absorbed, absorbed) } else { (cost, program) })
    };
    let mut choice = vec![false; n_parts];
    let mut best = attempt(graph, &choice)?;
    let all = vec![true; n_parts];
    let everything = attempt(graph, &all)?;
    if everything.0 <= best.0 {
        (best, choice) = (everything, all);
    }
    let n_nodes = plain.roots(graph).len();
    if n_nodes.saturating_mul(n_parts) <= MAX_NODES_FOR_TRIALS {
        for part in 0..n_parts {
            let unchanged = match sections.get(part) {
                Some(section) => sections_factored[part] == *section,
                None => requests_factored == requests,
            };
            if unchanged {
                continue;
            }
            choice[part] = !choice[part];
            let trial = attempt(graph, &choice)?;
            if trial.0 < best.0 {
                best = trial;
            } else {
                choice[part] = !choice[part];
            }
        }
    }
    verify(&best.1)?;
    Ok(best.1)
}

/// What is lowered, with the dependence of every expression on parameters, time and state.
struct Source<'a> {
    inputs: &'a Inputs,
    sections: &'a [Section],
    conditions: &'a [ParamCondition],
    requests: &'a [Request],
    classes: Classes,
}

impl Source<'_> {
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

    /// Every expression node behind the definitions and results.
    fn roots(&self, graph: &Graph) -> Vec<ExprId> {
        let definitions = self.sections.iter().flat_map(|s| s.definitions.iter().map(|d| d.expr));
        let results = self.requests.iter().flat_map(|r| r.results.iter().map(|(_, e)| *e));
        graph.reachable(&definitions.chain(results).collect::<Vec<_>>())
    }

    /// The passes in order.
    fn lower_as_written(&self, graph: &mut Graph) -> Result<Program, Error> {
        let mut pool = number::Pool::new();
        let mut functions = Vec::with_capacity(self.requests.len());
        for request in self.requests {
            functions.push(number::number_function(graph, self, request, &mut pool)?);
        }
        let conditions = number::number_conditions(graph, self, &mut pool)?;
        let program = assemble::assemble(graph, self, pool, functions, conditions)?;
        if cfg!(debug_assertions) {
            verify(&program)?;
        }
        Ok(program)
    }

    /// The definitions a function needs, by symbol, found from its results backwards.
    fn needed_definitions(&self, graph: &Graph, roots: &[ExprId]) -> BTreeSet<SymbolId> {
        let definitions: BTreeMap<SymbolId, ExprId> =
            self.sections.iter().flat_map(|s| &s.definitions).map(|d| (d.symbol, d.expr)).collect();
        let mut needed = BTreeSet::new();
        let mut seen = BTreeSet::new();
        let mut pending: Vec<ExprId> = roots.to_vec();
        while let Some(e) = pending.pop() {
            if !seen.insert(e) {
                continue;
            }
            match graph.node(e) {
                crate::expr::Node::Symbol(s) => {
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
}

#[cfg(test)]
pub(crate) mod tests;
