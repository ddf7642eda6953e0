//! Ordered definitions and wanted results to a flat straight-line [`Program`] with a parameter-only part.
//!
//! Value numbering, factoring, hoisting and dead-code removal happen here; every rewrite is directional and none makes
//! the program dearer. Deliberately does not know: mechanics (a definition is a name with a formula), Rust (a program
//! has operations and operands, no text).

mod assemble;
mod class;
mod divisors;
mod extract;
mod forms;
mod fuse;
mod number;
mod optimise;
mod pack;
mod pair;
mod polynomial;
mod rounding;
mod units;

use std::collections::{BTreeMap, BTreeSet};

use crate::error::Error;
use crate::expr::{ExprId, Func, Graph, Section, Sign, SymbolId, needed_sections, sign_of};
use crate::program::{Program, Relation, Role, Symbols, verify};

pub use divisors::{Divisors, WatchedMatrix};

use class::{Class, Classes};
use forms::Forms;
use optimise::Optimised;

/// The symbols that get their values from outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// Parameters, constant in time.
    pub params: Vec<SymbolId>,
    /// Time.
    pub time: SymbolId,
    /// Components of the state.
    pub state: Vec<SymbolId>,
    /// Signs of expressions in the parameters: what may be divided by.
    pub signs: BTreeMap<ExprId, Sign>,
    /// Pairs of components of the state, cosine and sine, whose squares add up to one.
    pub circles: Vec<[SymbolId; 2]>,
    /// Components of the vector that a function takes besides time and state, by the function's role.
    pub arguments: BTreeMap<Role, Vec<SymbolId>>,
    /// What is known about values that may be divided by.
    pub divisors: Divisors,
}

impl Inputs {
    /// Components of the vector that a function takes besides time and state; most take none.
    fn argument(&self, role: &Role) -> &[SymbolId] {
        self.arguments.get(role).map_or(&[], Vec::as_slice)
    }

    /// What the inputs of the program stand for.
    pub fn symbols(&self) -> Symbols<'_> {
        Symbols { params: &self.params, time: self.time, state: &self.state, arguments: &self.arguments }
    }
}

/// A function to make: what it is for and its named results.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// What the function is for.
    pub role: Role,
    /// Names and values of the results in order.
    pub results: Vec<(String, ExprId)>,
}

/// A condition that the parameters have to satisfy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParamCondition {
    /// As the model words it.
    pub text: String,
    /// What it means; may be empty.
    pub meaning: String,
    /// The side that has to be larger.
    pub greater: ExprId,
    /// The side that has to be smaller.
    pub less: ExprId,
    /// How they compare.
    pub relation: Relation,
    /// Whether the larger side, to be positive or other than zero, is the result of a calculation, which rounding errors could hide.
    pub is_rounded: bool,
}

/// Lowers sections of definitions and the requested functions to one program.
///
/// # Errors
/// [`Error::Program`] when a symbol is used before its definition, or a condition depends on more than parameters;
/// [`Error::OutOfRange`] when a constant does not fit an `f64`; [`Error::OverBudget`].
pub fn lower(
    graph: &mut Graph,
    inputs: &Inputs,
    sections: &[Section],
    conditions: &[ParamCondition],
    requests: &[Request],
) -> Result<Program, Error> {
    let program = lowered(graph, inputs, sections, conditions, requests);
    // Beside a graph that is past its budget, whatever else seems wrong says nothing.
    graph.within_budget()?;
    program
}

fn lowered(
    graph: &mut Graph,
    inputs: &Inputs,
    sections: &[Section],
    conditions: &[ParamCondition],
    requests: &[Request],
) -> Result<Program, Error> {
    let classes = Classes::of(graph, inputs, sections, requests)?;
    let source = Source { inputs, sections, conditions, classes };
    source.check_conditions(graph)?;
    source.check_arguments(graph, requests)?;
    let signs = source.signs(graph);
    let mut forms = Forms::new(graph, &source, conditions, &signs);
    let mut pool = number::Pool::new();
    let mut functions = Vec::with_capacity(requests.len());
    let mut rhs: Option<Optimised> = None;
    for request in requests {
        graph.within_budget()?;
        let mut wanted = Vec::new();
        if request.role == Role::Pivots {
            let checked = source.checked(graph, &signs, &mut forms, request, rhs.as_ref())?;
            let signature = source.signature(graph, request, &checked);
            wanted.push(checked);
            wanted.extend(signature);
        } else {
            wanted.push(optimise::optimise(graph, &source, &signs, &mut forms, request)?);
        }
        if request.role == Role::Rate {
            rhs = wanted.last().cloned();
        }
        for own in wanted {
            let requests = [own.request];
            let classes = Classes::of(graph, inputs, &own.sections, &requests)?;
            let source = Source { inputs, sections: &own.sections, conditions, classes };
            functions.push(number::number_function(graph, &source, &requests[0], &mut pool)?);
            graph.charge(functions.last().map_or(0, |f| f.definitions.len() + f.results.len()));
        }
    }
    graph.within_budget()?;
    let (sections, conditions) = source.rounded_conditions(graph, &signs, &mut forms);
    let classes = Classes::of(graph, inputs, &sections, requests)?;
    let source = Source { inputs, sections: &sections, conditions: &conditions, classes };
    let conditions = number::number_conditions(graph, &source, &mut pool)?;
    let program = assemble::assemble(graph, &source, pool, functions, conditions)?;
    verify(&program)?;
    Ok(program)
}

/// What is lowered, with the dependence of every expression on parameters, time and state.
struct Source<'a> {
    inputs: &'a Inputs,
    sections: &'a [Section],
    conditions: &'a [ParamCondition],
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

    /// A function sees its own argument only.
    fn check_arguments(&self, graph: &Graph, requests: &[Request]) -> Result<(), Error> {
        if self.inputs.arguments.is_empty() {
            return Ok(());
        }
        for request in requests {
            let roots: Vec<ExprId> = request.results.iter().map(|(_, e)| *e).collect();
            let needed = self.needed_definitions(graph, &roots);
            let definitions = self.sections.iter().flat_map(|s| &s.definitions);
            let used = definitions.filter(|d| needed.contains(&d.symbol)).map(|d| d.expr).chain(roots);
            let used: BTreeSet<SymbolId> = used.flat_map(|e| graph.free_symbols(e)).collect();
            let others = self.inputs.arguments.iter().filter(|(role, _)| **role != request.role);
            if let Some(foreign) = others.flat_map(|(_, symbols)| symbols).find(|s| used.contains(s)) {
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

    /// Pivots with their scales, in the form that `rhs` has them in: another form has other errors, and would find a number where
    /// that one divides by zero. A pivot that is no value of that form is computed in one of its own.
    fn checked(
        &self,
        graph: &mut Graph,
        signs: &BTreeMap<ExprId, Sign>,
        forms: &mut Forms,
        request: &Request,
        rhs: Option<&Optimised>,
    ) -> Result<Optimised, Error> {
        let sections_of_rhs = rhs.map_or(&[][..], |rhs| rhs.sections.as_slice());
        let divisors = sections_of_rhs.iter().flat_map(|s| &s.definitions);
        // With what each is in the units of the pivots: whether it vanishes does not depend on its own.
        let divisors = divisors.map(|d| {
            let value = graph.sym(d.symbol);
            let unit = rhs.and_then(|rhs| rhs.units.get(&d.symbol));
            (value, unit.map_or(value, |unit| graph.mul(*unit, value)))
        });
        let divisors: Vec<(ExprId, ExprId)> = divisors.collect();
        let in_rhs = |graph: &mut Graph, pivot| {
            divisors.iter().find(|(_, whole)| graph.is_seen_to_be_equal(*whole, pivot)).map(|(d, _)| *d)
        };
        let found: Vec<Option<ExprId>> = request.results.iter().map(|(_, e)| in_rhs(graph, *e)).collect();
        let others =
            request.results.iter().zip(&found).filter(|(_, found)| found.is_none()).map(|(r, _)| r.clone());
        let others = Request { role: request.role.clone(), results: others.collect() };
        let Optimised { mut sections, request: others, units } =
            optimise::optimise(graph, self, signs, forms, &others)?;
        let mut others = others.results.into_iter();
        let pivots = request.results.iter().zip(found).map(|((name, e), found)| match found {
            Some(in_rhs) => (name.clone(), in_rhs),
            None => others.next().unwrap_or_else(|| (name.clone(), *e)),
        });
        let mut results: Vec<(String, ExprId)> = pivots.collect();
        let known: Vec<ExprId> = results.iter().map(|(_, e)| *e).collect();
        let others = rhs.map_or(Ok(Vec::new()), |rhs| divisors::divisors(graph, self.inputs, rhs, &known))?;
        let n_composite = others.iter().filter(|d| d.is_composite).count();
        results.extend(others.into_iter().map(|d| (d.name, d.expr)));
        let n_single = results.len() - n_composite;
        let values: Vec<ExprId> = results.iter().map(|(_, e)| *e).collect();
        let own: BTreeSet<SymbolId> =
            sections.iter().flat_map(|s| &s.definitions).map(|d| d.symbol).collect();
        let nothing = Section { title: String::new(), definitions: Vec::new() };
        sections.resize(sections.len().max(sections_of_rhs.len()), nothing);
        for (section, of_rhs) in sections.iter_mut().zip(sections_of_rhs) {
            section.definitions.extend(of_rhs.definitions.iter().filter(|d| !own.contains(&d.symbol)));
        }
        let needed = needed_sections(graph, &sections, &values);
        let (mut scales, definitions) = rounding::rounding_scales(graph, &values[..n_single], &needed, signs);
        scales.resize(values.len(), graph.zero());
        if let Some(last) = sections.last_mut() {
            last.definitions.extend(definitions);
        }
        let names: Vec<String> = results.iter().map(|(name, _)| name.clone()).collect();
        results.extend(names.into_iter().zip(scales));
        Ok(Optimised { sections, request: Request { role: request.role.clone(), results }, units })
    }

    /// The function [`Role::Signature`], from the pivots as `checked` has them; none if nothing is watched.
    fn signature(&self, graph: &mut Graph, request: &Request, checked: &Optimised) -> Option<Optimised> {
        let watched = &self.inputs.divisors.watched;
        if watched.is_empty() {
            return None;
        }
        let as_checked = |pivot: &ExprId| {
            let k = request.results.iter().position(|(_, e)| e == pivot)?;
            Some(checked.request.results.get(k)?.1)
        };
        let matrices: Vec<(bool, Vec<ExprId>)> = watched
            .iter()
            .map(|m| (m.is_symmetric, m.pivots.iter().filter_map(as_checked).collect()))
            .collect();
        let value = divisors::signature(graph, &matrices);
        let results = vec![(Role::Signature.name().to_owned(), value)];
        let request = Request { role: Role::Signature, results };
        Some(Optimised { request, ..checked.clone() })
    }

    /// The conditions with scales of their rounding errors, `s + p > s` for `p > 0` and `s + |p| > s` for `p != 0`, and the definitions of scales after the others.
    fn rounded_conditions(
        &self,
        graph: &mut Graph,
        signs: &BTreeMap<ExprId, Sign>,
        forms: &mut Forms,
    ) -> (Vec<Section>, Vec<ParamCondition>) {
        let mut own = self.conditions.to_vec();
        for condition in own.iter_mut().filter(|c| c.is_rounded) {
            condition.greater = forms.best(graph, condition.greater);
        }
        let values: Vec<ExprId> = own.iter().filter(|c| c.is_rounded).map(|c| c.greater).collect();
        let needed = needed_sections(graph, self.sections, &values);
        let (scales, definitions) = rounding::rounding_scales(graph, &values, &needed, signs);
        let mut scales = scales.into_iter();
        let mut sections = self.sections.to_vec();
        match sections.last_mut() {
            Some(last) => last.definitions.extend(definitions),
            None if definitions.is_empty() => {}
            None => sections.push(Section { title: String::new(), definitions }),
        }
        let conditions = own.iter().map(|condition| {
            let scale = if condition.is_rounded { scales.next() } else { None };
            let Some(scale) = scale.filter(|scale| *scale != graph.zero()) else { return condition.clone() };
            let size = match condition.relation {
                Relation::NotEqual => graph.func(Func::Abs, condition.greater),
                _ => condition.greater,
            };
            let greater = graph.add(scale, size);
            ParamCondition { greater, less: scale, relation: Relation::Greater, ..condition.clone() }
        });
        (sections, conditions.collect())
    }

    /// What is known about signs, also of parameter-only definitions and of what the conditions speak of.
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

    /// The circles whose relation a function may use: all of them, unless it speaks of nothing but the circles, as one does
    /// that asks how far the state has drifted off them.
    fn circles_for(&self, graph: &Graph, roots: &[ExprId]) -> Vec<[SymbolId; 2]> {
        let own: BTreeSet<SymbolId> = self.inputs.circles.iter().flatten().copied().collect();
        let is_about_circles = roots.iter().all(|e| graph.free_symbols(*e).is_subset(&own));
        if is_about_circles { Vec::new() } else { self.inputs.circles.clone() }
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
