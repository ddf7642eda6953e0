//! Greedy common factors of sums; looks at one sum at a time.

use std::collections::{BTreeMap, HashMap};

use num_traits::{One, Signed, Zero};

use super::class::{Class, Classes, post_order};
use super::{Definition, Request, Section, Source};
use crate::error::Error;
use crate::expr::{DivisionByZero, ExprId, Graph, Node, Rational};

/// Sums inside factored sums are factored again down to this depth.
const MAX_DEPTH: usize = 32;

/// Rewrites every definition and result of `source`.
pub(super) fn factor(graph: &mut Graph, source: &Source<'_>) -> Result<(Vec<Section>, Vec<Request>), Error> {
    let mut pass = Pass { classes: source.classes.clone(), image: HashMap::new() };
    let mut sections = Vec::with_capacity(source.sections.len());
    for section in source.sections {
        let mut definitions = Vec::with_capacity(section.definitions.len());
        for definition in &section.definitions {
            let expr = pass.rewrite(graph, definition.expr)?;
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

/// Bases and their exponents.
type Factors = Vec<(ExprId, Rational)>;

/// A summand `coefficient * prod hoisted * prod factors`; a hoisted factor depends on parameters alone.
#[derive(Clone, Debug)]
struct Term {
    coefficient: Rational,
    hoisted: Factors,
    factors: BTreeMap<ExprId, Rational>,
}

impl Term {
    /// Multiplications per call, given that the hoisted part is a single number.
    fn n_mul(&self) -> i64 {
        if self.factors.is_empty() {
            return 0;
        }
        let two = Rational::from_integer(2.into());
        let powers: i64 = self.factors.values().map(|q| if q.abs() >= two { 2 } else { 1 }).sum();
        let number = !self.hoisted.is_empty() || !self.coefficient.abs().is_one();
        powers + i64::from(number) - 1
    }

    /// The term without the candidate, whose power in it is at least that of the candidate.
    fn without(&self, candidate: &Candidate) -> Term {
        let mut rest = self.clone();
        match candidate {
            Candidate::Base { base, exponent } => {
                if let Some(q) = rest.factors.get_mut(base) {
                    *q -= exponent;
                    if q.is_zero() {
                        rest.factors.remove(base);
                    }
                }
            }
            Candidate::Number { .. } => {
                rest.coefficient = rest.coefficient.signum();
                rest.hoisted.clear();
            }
        }
        rest
    }
}

/// What can be taken out of several terms.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Candidate {
    /// A power of a base that changes during integration.
    Base { base: ExprId, exponent: Rational },
    /// A whole parameter-only factor, up to sign.
    Number { hoisted: Factors, magnitude: Rational },
}

struct Pass {
    classes: Classes,
    image: HashMap<ExprId, ExprId>,
}

fn vanishing(_: DivisionByZero) -> Error {
    Error::DivisionByZero { place: "factoring".to_owned() }
}

impl Pass {
    fn rewrite(&mut self, graph: &mut Graph, root: ExprId) -> Result<ExprId, Error> {
        for e in post_order(graph, &[root], |e| self.image.contains_key(&e)) {
            let rewritten = match graph.node(e).clone() {
                Node::Constant(_) | Node::Pi | Node::Symbol(_) => e,
                Node::Function(f, a) => {
                    let a = self.image[&a];
                    graph.func(f, a)
                }
                Node::Product { coefficient, factors } => {
                    let list: Vec<_> = factors.iter().map(|(b, q)| (self.image[b], q.clone())).collect();
                    let product = graph.power_product(&list).map_err(vanishing)?;
                    graph.scale(product, &coefficient)
                }
                Node::Sum { constant, terms } => {
                    let hoists = self.classes.get(e) > Class::Param;
                    let terms =
                        terms.iter().map(|(t, q)| self.term(graph, self.image[t], q, hoists)).collect();
                    let sum = self.sum(graph, terms, 0)?;
                    let constant = graph.rational(constant);
                    graph.add(constant, sum)
                }
            };
            self.classes.add(graph, rewritten)?;
            self.image.insert(e, rewritten);
        }
        Ok(self.image[&root])
    }

    fn term(&self, graph: &Graph, e: ExprId, q: &Rational, hoists: bool) -> Term {
        let mut term = Term { coefficient: q.clone(), hoisted: Vec::new(), factors: BTreeMap::new() };
        let single = [(e, Rational::one())];
        let factors: &[(ExprId, Rational)] = match graph.node(e) {
            Node::Product { coefficient, factors } => {
                term.coefficient *= coefficient;
                factors
            }
            _ => &single,
        };
        for (base, exponent) in factors {
            if hoists && self.classes.get(*base) <= Class::Param {
                term.hoisted.push((*base, exponent.clone()));
            } else {
                term.factors.insert(*base, exponent.clone());
            }
        }
        term
    }

    /// `a*b + a*c = a*(b + c)`, and `P*x + P*y = P*(x + y)` for a parameter-only `P`, while it saves something.
    fn sum(&mut self, graph: &mut Graph, mut terms: Vec<Term>, depth: usize) -> Result<ExprId, Error> {
        while depth < MAX_DEPTH
            && let Some((candidate, members)) = best(&terms)
        {
            let mut inner = Vec::with_capacity(members.len());
            let mut rest = Vec::with_capacity(terms.len() - members.len() + 1);
            for (k, term) in terms.into_iter().enumerate() {
                if members.binary_search(&k).is_ok() {
                    inner.push(term.without(&candidate));
                } else {
                    rest.push(term);
                }
            }
            let inner = self.sum(graph, inner, depth + 1)?;
            let class = self.classes.add(graph, inner)?;
            let (content, primitive) = graph.primitive_part(inner);
            self.classes.add(graph, primitive)?;
            let mut taken = Term { coefficient: content, hoisted: Vec::new(), factors: BTreeMap::new() };
            match candidate {
                Candidate::Base { base, exponent } => {
                    taken.factors.insert(base, exponent);
                }
                Candidate::Number { hoisted, magnitude } => {
                    taken.coefficient *= magnitude;
                    taken.hoisted = hoisted;
                }
            }
            // The inner sum may be a product itself, when all its terms had a further factor in common.
            let inner = self.term(graph, primitive, &Rational::one(), class > Class::Param);
            taken.coefficient *= inner.coefficient;
            if class > Class::Param {
                for (base, q) in inner.factors {
                    *taken.factors.entry(base).or_insert_with(Rational::zero) += q;
                }
                taken.factors.retain(|_, q| !q.is_zero());
                taken.hoisted.extend(inner.hoisted);
            } else {
                taken.hoisted.extend(inner.factors);
            }
            taken.hoisted.sort();
            rest.push(taken);
            terms = rest;
        }
        let mut summands = Vec::with_capacity(terms.len());
        for term in terms {
            let factors: Vec<_> = term.hoisted.into_iter().chain(term.factors).collect();
            summands.push((graph.power_product(&factors).map_err(vanishing)?, term.coefficient));
        }
        Ok(graph.linear_combination(&summands))
    }
}

/// The candidate that saves most, if any saves anything, and the terms that have it.
fn best(terms: &[Term]) -> Option<(Candidate, Vec<usize>)> {
    // Positive and negative powers of a base are different candidates; a fractional part makes another one.
    let mut bases: BTreeMap<(ExprId, bool, Rational), Vec<usize>> = BTreeMap::new();
    let mut numbers: BTreeMap<(&Factors, Rational), Vec<usize>> = BTreeMap::new();
    for (k, term) in terms.iter().enumerate() {
        for (base, q) in &term.factors {
            let fraction = if q.is_integer() { Rational::zero() } else { q.clone() };
            bases.entry((*base, q.is_negative(), fraction)).or_default().push(k);
        }
        if !term.hoisted.is_empty() && !term.factors.is_empty() {
            numbers.entry((&term.hoisted, term.coefficient.abs())).or_default().push(k);
        }
    }
    let mut winner: Option<(i64, Candidate, Vec<usize>)> = None;
    let mut consider = |candidate: Candidate, members: Vec<usize>| {
        let mut gain = -1;
        let mut n_numbers = 0;
        for k in &members {
            let rest = terms[*k].without(&candidate);
            gain += terms[*k].n_mul() - rest.n_mul();
            n_numbers += i64::from(rest.factors.is_empty());
        }
        // Parameter-only terms of the inner sum are added once and for all in the prepared part.
        gain += (n_numbers - 1).max(0);
        if gain > 0 && winner.as_ref().is_none_or(|(most, ..)| gain > *most) {
            winner = Some((gain, candidate, members));
        }
    };
    for ((base, ..), members) in bases {
        if members.len() > 1 {
            let exponents = members.iter().map(|k| &terms[*k].factors[&base]);
            let exponent = exponents.min_by_key(|q| q.abs()).expect("there are members").clone();
            consider(Candidate::Base { base, exponent }, members);
        }
    }
    for ((hoisted, magnitude), members) in numbers {
        if members.len() > 1 {
            consider(Candidate::Number { hoisted: hoisted.clone(), magnitude }, members);
        }
    }
    winner.map(|(_, candidate, members)| (candidate, members))
}
