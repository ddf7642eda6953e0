//! Parameter-only factors meet across definitions, so that one hoisted number takes the place of several.
//!
//! `p = P*x, q = Q*p` becomes `q = (P*Q)*x`, and `s = P*x + Q*y, r = R*s` becomes `r = (P*R)*x + (Q*R)*y`, where no
//! function uses `p` or `s` for anything else. Each saves one multiplication a call.

use std::collections::{HashMap, HashSet};

use num_traits::One;

use super::class::{Class, Classes, post_order};
use super::{Definition, Request, Section, Source};
use crate::error::Error;
use crate::expr::{DivisionByZero, ExprId, Graph, Node, Rational, SymbolId};

/// Rewrites every definition and result of `source`.
pub(super) fn absorb(graph: &mut Graph, source: &Source<'_>) -> Result<(Vec<Section>, Vec<Request>), Error> {
    let mut pass = Pass {
        classes: source.classes.clone(),
        single: used_once(graph, source),
        definitions: HashMap::new(),
        image: HashMap::new(),
    };
    let mut sections = Vec::with_capacity(source.sections.len());
    for section in source.sections {
        let mut definitions = Vec::with_capacity(section.definitions.len());
        for definition in &section.definitions {
            let expr = pass.rewrite(graph, definition.expr)?;
            pass.definitions.insert(definition.symbol, expr);
            definitions.push(Definition { symbol: definition.symbol, expr });
        }
        sections.push(Section { title: section.title.clone(), definitions });
    }
    let mut requests = Vec::with_capacity(source.requests.len());
    for request in source.requests {
        let mut results = Vec::with_capacity(request.results.len());
        for (name, e) in &request.results {
            results.push((name.clone(), pass.rewrite(graph, *e)?));
        }
        requests.push(Request { name: request.name.clone(), results });
    }
    Ok((sections, requests))
}

/// Expressions, symbols among them, that no function uses in two places.
fn used_once(graph: &Graph, source: &Source<'_>) -> HashSet<ExprId> {
    let mut most: HashMap<ExprId, usize> = HashMap::new();
    for request in source.requests {
        let mut roots: Vec<ExprId> = request.results.iter().map(|(_, e)| *e).collect();
        let needed = source.needed_definitions(graph, &roots);
        let definitions = source.sections.iter().flat_map(|s| &s.definitions);
        roots.extend(definitions.filter(|d| needed.contains(&d.symbol)).map(|d| d.expr));
        let mut uses: HashMap<ExprId, usize> = HashMap::new();
        for root in &roots {
            *uses.entry(*root).or_default() += 1;
        }
        for e in graph.reachable(&roots) {
            graph.node(e).for_each_operand(|operand| *uses.entry(operand).or_default() += 1);
        }
        for (e, n) in uses {
            let most = most.entry(e).or_default();
            *most = n.max(*most);
        }
    }
    most.into_iter().filter(|(_, n)| *n == 1).map(|(e, _)| e).collect()
}

struct Pass {
    classes: Classes,
    /// Of the expressions before rewriting.
    single: HashSet<ExprId>,
    /// Rewritten values of definitions.
    definitions: HashMap<SymbolId, ExprId>,
    image: HashMap<ExprId, ExprId>,
}

type Factors = Vec<(ExprId, Rational)>;

fn vanishing(_: DivisionByZero) -> Error {
    Error::DivisionByZero { place: "hoisting".to_owned() }
}

impl Pass {
    fn rewrite(&mut self, graph: &mut Graph, root: ExprId) -> Result<ExprId, Error> {
        for e in post_order(graph, &[root], |e| self.image.contains_key(&e)) {
            let rewritten = match graph.node(e).clone() {
                Node::Constant(_) | Node::Pi | Node::Symbol(_) => e,
                Node::Function(f, a) => graph.func(f, self.image[&a]),
                Node::Sum { constant, terms } => {
                    let mut list: Vec<_> = terms.iter().map(|(t, q)| (self.image[t], q.clone())).collect();
                    list.push((graph.one(), constant));
                    graph.linear_combination(&list)
                }
                Node::Product { coefficient, factors } => {
                    let product = self.product(graph, &factors)?;
                    graph.scale(product, &coefficient)
                }
            };
            self.classes.add(graph, rewritten)?;
            self.image.insert(e, rewritten);
        }
        Ok(self.image[&root])
    }

    fn hoists(&self, base: ExprId) -> bool {
        self.classes.get(base) <= Class::Param
    }

    fn product(&mut self, graph: &mut Graph, factors: &[(ExprId, Rational)]) -> Result<ExprId, Error> {
        let (mut numbers, mut others): (Factors, Factors) = (Vec::new(), Vec::new());
        for (base, q) in factors {
            let list = if self.hoists(*base) { &mut numbers } else { &mut others };
            list.push((self.image[base], q.clone()));
        }
        let changing = factors.iter().filter(|(base, _)| !self.hoists(*base));
        let taken = changing.clone().enumerate().find_map(|(k, (base, q))| {
            let value =
                self.value_used_here_only(graph, *base).filter(|_| q.is_one() && !numbers.is_empty())?;
            self.absorbs(graph, value).then_some((k, value))
        });
        if let Some((k, value)) = taken {
            others[k].0 = self.times(graph, &numbers, value)?;
            numbers.clear();
        }
        numbers.extend(others);
        graph.power_product(&numbers).map_err(vanishing)
    }

    /// The value of an expression, seen through a definition, if only the asking product uses it.
    fn value_used_here_only(&self, graph: &Graph, base: ExprId) -> Option<ExprId> {
        if !self.single.contains(&base) {
            return None;
        }
        match graph.node(base) {
            // The definition's own expression may serve elsewhere under no name: costs decide in the end.
            Node::Symbol(s) => self.definitions.get(s).copied(),
            _ => Some(self.image[&base]),
        }
    }

    /// Whether a parameter-only factor costs nothing more there.
    fn absorbs(&self, graph: &Graph, e: ExprId) -> bool {
        let has_number = |e: ExprId| match graph.node(e) {
            Node::Product { factors, .. } => factors.iter().any(|(base, _)| self.hoists(*base)),
            _ => false,
        };
        match graph.node(e) {
            Node::Sum { terms, .. } => terms
                .iter()
                .all(|(term, q)| self.hoists(*term) || has_number(*term) || !q.is_one() && !(-q).is_one()),
            _ => has_number(e),
        }
    }

    /// `numbers * e`, distributed over a sum.
    fn times(&mut self, graph: &mut Graph, numbers: &Factors, e: ExprId) -> Result<ExprId, Error> {
        let scaled = |graph: &mut Graph, e: ExprId| {
            let mut factors = numbers.clone();
            factors.push((e, Rational::one()));
            graph.power_product(&factors).map_err(vanishing)
        };
        let product = match graph.node(e).clone() {
            Node::Sum { constant, terms } => {
                let mut list = Vec::with_capacity(terms.len() + 1);
                for (term, q) in terms {
                    list.push((scaled(graph, term)?, q));
                }
                let one = graph.one();
                list.push((scaled(graph, one)?, constant));
                graph.linear_combination(&list)
            }
            _ => scaled(graph, e)?,
        };
        self.classes.add(graph, product)?;
        Ok(product)
    }
}
