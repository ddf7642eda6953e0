//! Advected parameters and the action on them.
//!
//! Deliberately does not know: what depends on them.

use std::collections::BTreeSet;

use super::draft::{AdvectedDraft, DeclaredAs, ModelBuilder};
use crate::spec::diagnostic::Span;
use crate::spec::layout::{Layout, short_list};
use crate::spec::model::*;
use crate::spec::value::Value;
use hamel_expr::SymbolId;

impl ModelBuilder {
    /// An advected parameter: a vector of dimension `n`, or a number for `None`.
    pub fn advected(&mut self, name: &str, n: Option<usize>, doc: &str) -> Value {
        let span = self.here;
        let (value, components) = match n {
            None => {
                let (symbol, expr) = self.new_symbol(name, DeclaredAs::Advected);
                (Value::Scalar(expr), vec![(name.to_owned(), symbol)])
            }
            Some(n) => return self.advected_vector(name, &Layout::Vector(n).names(name), doc),
        };
        self.advected_draft(name, value, components, doc, span)
    }

    /// An advected parameter whose components have names of their own.
    pub fn advected_vector(&mut self, name: &str, names: &[String], doc: &str) -> Value {
        let span = self.here;
        self.declare(name, DeclaredAs::Advected);
        let (mut components, mut entries) = (Vec::new(), Vec::new());
        for component in names {
            let (symbol, expr) = self.new_symbol(component, DeclaredAs::AdvectedComponent);
            components.push((component.clone(), symbol));
            entries.push(expr);
        }
        let value = Value::Vector(entries);
        self.bind(name, &value);
        self.advected_draft(name, value, components, doc, span)
    }

    fn advected_draft(
        &mut self,
        name: &str,
        value: Value,
        components: Vec<(String, SymbolId)>,
        doc: &str,
        span: Option<Span>,
    ) -> Value {
        let draft = AdvectedDraft {
            name: name.to_owned(),
            value: value.clone(),
            components,
            action: None,
            doc: doc.to_owned(),
            span,
        };
        self.advected.push(draft);
        value
    }

    /// The infinitesimal action `xi . a` of the velocity on an advected parameter; `adot = -xi . a`.
    pub fn advected_action(&mut self, name: &str, action: &Value) -> &mut Self {
        let here = self.here;
        match self.advected.iter_mut().find(|a| a.name == name) {
            Some(draft) => draft.action = Some((action.clone(), here)),
            None => self.problem(here, format!("`{name}` is not an advected parameter"), "declare it first"),
        }
        self
    }

    pub(super) fn check_advected(&mut self) -> Vec<Advected> {
        let original = self.original_symbols();
        let (rates, fibre) = original.split_at(self.n_shape());
        let (rates, fibre): (BTreeSet<SymbolId>, Vec<SymbolId>) =
            (rates.iter().copied().collect(), fibre.to_vec());
        let mut result = Vec::new();
        for draft in self.advected.clone() {
            let Some((action, span)) = draft.action else {
                if !self.broken.contains("advected") {
                    let message = format!("advected parameter `{}` has no action", draft.name);
                    self.problem(draft.span, message, "give `xi . a`, for example `cross(Omega, Gamma)`");
                }
                continue;
            };
            if action.shape() != draft.value.shape() {
                let message = format!(
                    "action on `{}` must be {}, found {}",
                    draft.name,
                    draft.value.shape(),
                    action.shape()
                );
                self.problem(span, message, "it is the rate of change of the parameter, up to the sign");
                continue;
            }
            let mut fine = true;
            let action = action.map(|e| self.in_original(e));
            for e in action.entries() {
                if self.reports_stray(*e, span, &format!("action on `{}`", draft.name), &[]) {
                    fine = false;
                    break;
                }
                let occurring = self.occurring(*e, &fibre);
                let linear = match self.graph.affine_parts(*e, &occurring) {
                    Some((_, offset)) => self.graph.is_zero(offset),
                    None => false,
                };
                if !linear || self.graph.depends_on(*e, &rates) {
                    let message =
                        format!("action on `{}` is not linear in the velocities of the algebra", draft.name);
                    let names: Vec<String> = self.velocities.iter().map(|v| v.name.clone()).collect();
                    self.problem(span, message, short_list("the velocities are", &names));
                    fine = false;
                    break;
                }
            }
            if fine {
                result.push(Advected {
                    name: draft.name,
                    components: draft.components,
                    action: action.into_entries(),
                    doc: draft.doc,
                    span: draft.span,
                });
            }
        }
        result
    }
}
