//! Definitions, in the order of their use.
//!
//! Deliberately does not know: items other than `let`.

use std::collections::BTreeMap;

use super::order::{describe_cycle, order_by_use};
use super::values::Elaboration;
use crate::spec::ast::{Expr, Item, ItemKind, Name};
use crate::spec::builder::DeclaredAs;
use crate::spec::diagnostic::Diagnostic;

impl Elaboration<'_> {
    pub(super) fn define_lets(&mut self, items: &[Item]) {
        let mut lets: Vec<(&Name, &Expr)> = Vec::new();
        let mut index: BTreeMap<&str, usize> = BTreeMap::new();
        for item in items {
            let ItemKind::Let { name, value } = &item.kind else { continue };
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
        for k in order {
            let (name, expr) = lets[k];
            if self.poisoned.contains(&name.text) {
                continue;
            }
            match self.evaluator(None, None).eval(expr) {
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
