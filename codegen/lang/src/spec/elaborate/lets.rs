//! Definitions, in the order of their use.
//!
//! Deliberately does not know: items other than `let`, `state`, `lyapunov` and `body`.

use std::collections::BTreeMap;

use super::order::{describe_cycle, order_by_use};
use super::values::Elaboration;
use crate::spec::ast::{BodyItem, BodyPart, Expr, Item, ItemKind, Name};
use crate::spec::builder::DeclaredAs;
use crate::spec::diagnostic::Diagnostic;

/// The definitions of a file that can be evaluated, in the order of their use.
pub(super) struct Lets<'a> {
    list: Vec<(&'a Name, Definition<'a>)>,
    index: BTreeMap<&'a str, usize>,
    uses: Vec<Vec<usize>>,
    order: Vec<usize>,
}

/// What a name stands for.
#[derive(Clone, Copy)]
enum Definition<'a> {
    /// `let name = expr;`
    Value(&'a Expr),
    /// A part of a body.
    Part(&'a BodyItem, BodyPart),
}

impl Definition<'_> {
    fn names(&self) -> Vec<&str> {
        match self {
            Definition::Value(expr) => expr.names(),
            Definition::Part(body, _) => body.expressions().flat_map(Expr::names).collect(),
        }
    }
}

impl Lets<'_> {
    /// The definitions that some expressions need, and the others, both in the order of their use.
    pub(super) fn needed_first(&self, by: &[&Expr]) -> (Vec<usize>, Vec<usize>) {
        let mut is_needed = vec![false; self.list.len()];
        let names = by.iter().flat_map(|e| e.names());
        let mut pending: Vec<usize> = names.filter_map(|n| self.index.get(n).copied()).collect();
        while let Some(k) = pending.pop() {
            if !std::mem::replace(&mut is_needed[k], true) {
                pending.extend(&self.uses[k]);
            }
        }
        self.order.iter().partition(|k| is_needed[**k])
    }
}

impl Elaboration<'_> {
    /// Claims the names of all definitions and finds their order.
    pub(super) fn declare_lets<'a>(&mut self, items: &'a [Item]) -> Lets<'a> {
        let mut lets: Vec<(&'a Name, Definition<'a>)> = Vec::new();
        let mut index: BTreeMap<&'a str, usize> = BTreeMap::new();
        let defined = items.iter().flat_map(|item| match &item.kind {
            ItemKind::Let { name, value } => vec![(name, Definition::Value(value))],
            // A rate is a definition: what mentions it means its value.
            ItemKind::State { rate: (name, value), .. } => vec![(name, Definition::Value(value))],
            ItemKind::Lyapunov { name, function, .. } => vec![(name, Definition::Value(function))],
            ItemKind::Body(body) => {
                body.parts.iter().map(|(part, name)| (name, Definition::Part(body, *part))).collect()
            }
            _ => Vec::new(),
        });
        for (name, value) in defined {
            if self.builder.at(Some(name.span)).declare(&name.text, DeclaredAs::Definition) {
                index.insert(&name.text, lets.len());
                lets.push((name, value));
            } else {
                self.poisoned.insert(name.text.clone());
            }
        }
        let uses: Vec<Vec<usize>> = lets
            .iter()
            .map(|(_, value)| value.names().into_iter().filter_map(|n| index.get(n).copied()).collect())
            .collect();
        let (order, cycles) = order_by_use(&uses);
        for cycle in cycles {
            let described = describe_cycle(&cycle, |k| &lets[k].0.text);
            let mut problem =
                Diagnostic::new(Some(lets[cycle[0]].0.span), format!("definition in a circle: {described}"));
            for k in cycle.iter().skip(1).take(4) {
                problem = problem.with_place(Some(lets[*k].0.span), "part of the circle");
            }
            self.builder.problems.push(problem.with_help("define one of them without the others"));
            self.poisoned.extend(cycle.iter().map(|k| lets[*k].0.text.clone()));
        }
        Lets { list: lets, index, uses, order }
    }

    /// Evaluates definitions in the order that is given.
    pub(super) fn define_lets(&mut self, lets: &Lets<'_>, order: &[usize]) {
        for k in order {
            let (name, definition) = lets.list[*k];
            if self.poisoned.contains(&name.text) {
                continue;
            }
            let value = match definition {
                Definition::Value(expr) => {
                    let rates = self.rates_for(&[expr]);
                    let mut evaluator = self.evaluator(&[], None);
                    evaluator.rates = rates.as_ref();
                    evaluator.eval(expr)
                }
                Definition::Part(body, part) => self.part(body, part),
            };
            match value {
                Some((value, bits)) => {
                    self.builder.bind(&name.text, &value);
                    self.weights.insert(name.text.clone(), bits);
                }
                None => {
                    self.poisoned.insert(name.text.clone());
                }
            }
        }
    }
}
