//! States of first order and their rates.
//!
//! Deliberately does not know: what depends on them, equations of motion.

use std::collections::BTreeSet;

use super::draft::{DeclaredAs, FirstOrderDraft, ModelBuilder};
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::expressions::ExpressionRole;
use crate::spec::layout::Layout;
use crate::spec::model::*;
use crate::spec::value::Value;
use hamel_expr::{ExprId, SymbolId};

impl ModelBuilder {
    /// A number of the state whose rate the model gives, by [`ModelBuilder::state_rate`].
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder, Rational};
    ///
    /// let mut b = ModelBuilder::new("motor");
    /// let (_, turning) = b.coordinate("theta", Domain::Angle, "");
    /// let voltage = b.input("V", Rational::from_integer(0.into()), "");
    /// let current = b.state("i", Domain::Real, "current");
    /// let (g, back) = (b.graph(), current.clone());
    /// let loss = back.add(g, &turning).unwrap();
    /// let rate = voltage.sub(g, &loss).unwrap();
    /// let energy = turning.mul(g, &turning).unwrap();
    /// b.state_rate("i", &rate).lagrangian(&energy).force("theta_dot", &current);
    /// let model = b.build().unwrap();
    /// assert_eq!(model.first_order[0].components[0].0, "i");
    /// ```
    pub fn state(&mut self, name: &str, domain: Domain, doc: &str) -> Value {
        let (symbol, expr) = self.new_symbol(name, DeclaredAs::FirstOrder);
        self.first_order_draft(name, vec![(name.to_owned(), symbol)], domain, doc);
        Value::Scalar(expr)
    }

    /// A vector of the state whose rate the model gives.
    pub fn state_vector(&mut self, name: &str, n: usize, domain: Domain, doc: &str) -> Value {
        self.declare(name, DeclaredAs::FirstOrder);
        let (mut components, mut entries) = (Vec::new(), Vec::new());
        for component in Layout::Vector(n).names(name) {
            let (symbol, expr) = self.new_symbol(&component, DeclaredAs::FirstOrderComponent);
            components.push((component, symbol));
            entries.push(expr);
        }
        let value = Value::Vector(entries);
        self.bind(name, &value);
        self.first_order_draft(name, components, domain, doc);
        value
    }

    pub(super) fn first_order_draft(
        &mut self,
        name: &str,
        components: Vec<(String, SymbolId)>,
        domain: Domain,
        doc: &str,
    ) {
        if let Domain::Interval(low, high) = domain {
            self.check_interval(low, high);
        }
        let (name, doc, span) = (name.to_owned(), doc.to_owned(), self.here);
        let rate = None;
        self.first_order.push(FirstOrderDraft { name, components, domain, rate, doc, span });
    }

    /// The rate of a state of first order: a function of the state, inputs and the time.
    pub fn state_rate(&mut self, name: &str, rate: &Value) -> &mut Self {
        let here = self.here;
        match self.first_order.iter_mut().find(|state| state.name == name) {
            Some(draft) => draft.rate = Some((rate.clone(), here)),
            None => self.problem(here, format!("`{name}` is not a state of first order"), "declare it first"),
        }
        self
    }

    pub(super) fn check_first_order(&mut self) -> Vec<FirstOrderState> {
        let mut result = Vec::new();
        for draft in self.first_order.clone() {
            let Some((rate, of_rate)) = draft.rate else {
                if !self.broken.contains("state") {
                    let message = format!("state `{}` has no rate", draft.name);
                    self.problem(draft.span, message, "give it by `state_rate`");
                }
                continue;
            };
            let Some(rate) = self.fitted("the rate of", &draft.name, &rate, of_rate) else { continue };
            let place = format!("the rate of `{}`", draft.name);
            if rate.entries().iter().any(|e| self.reports_stray(*e, of_rate, &place, &[])) {
                continue;
            }
            let is_mode = self.modes.iter().any(|mode| mode.name == draft.name);
            result.push(FirstOrderState {
                name: draft.name,
                components: draft.components,
                domain: draft.domain,
                rates: rate.into_entries(),
                is_entropy: false,
                is_mode,
                doc: draft.doc,
                span: draft.span,
                of_rate,
            });
        }
        result
    }

    /// Symbols of the states of first order.
    pub(super) fn first_order_symbols(&self) -> impl Iterator<Item = SymbolId> {
        self.first_order.iter().flat_map(|state| state.components.iter().map(|(_, symbol)| *symbol))
    }

    /// A state of first order in an equation between positions is a problem; true when there is one.
    pub(super) fn reports_first_order(&mut self, e: ExprId, place: &str, span: Option<Span>) -> bool {
        let free = self.graph.free_symbols(e);
        let Some(state) = self.first_order_symbols().find(|s| free.contains(s)) else { return false };
        let message = format!("{place} between positions contains the state `{}`", self.graph.name(state));
        let help = "the velocity would follow from its rate: write the constraint on velocities, with the rate \
                    in it";
        self.problem(span, message, help);
        true
    }
}

/// One problem for each item of the geometry that contains a state of first order: no displacement changes one, so that
/// nothing that displacements are measured with may depend on it.
pub(super) fn misplaced_states(model: &Model) -> Vec<Diagnostic> {
    let symbols: BTreeSet<SymbolId> =
        model.first_order.iter().flat_map(|s| s.components.iter().map(|(_, symbol)| *symbol)).collect();
    if symbols.is_empty() {
        return Vec::new();
    }
    let mut problems: Vec<Diagnostic> = Vec::new();
    for (role, e) in model.expressions() {
        let found = model.graph.free_symbols(e).into_iter().find(|s| symbols.contains(s));
        let (Some(state), Some((what, span))) = (found, of_geometry(model, role)) else { continue };
        let message = format!("{what} contains the state `{}`", model.graph.name(state));
        let help =
            "states of first order are for the Lagrangian, forces, constraints, rates, outputs and events";
        let problem = Diagnostic::new(span, message).with_help(help);
        if !problems.iter().any(|p| p.span == problem.span && p.message == problem.message) {
            problems.push(problem);
        }
    }
    problems
}

/// What an expression is, and where it stands; none where a state of first order is allowed, or another check is about
/// it.
fn of_geometry(model: &Model, role: ExpressionRole) -> Option<(String, Option<Span>)> {
    Some(match role {
        ExpressionRole::Lagrangian
        | ExpressionRole::Hamiltonian
        | ExpressionRole::Noise(_)
        | ExpressionRole::Force(_)
        | ExpressionRole::FirstOrderRate(_)
        | ExpressionRole::Given(_)
        | ExpressionRole::ConstraintResidual(_)
        | ExpressionRole::ConstraintPosition(_)
        | ExpressionRole::Implied(_)
        | ExpressionRole::ConstraintAcceleration(_)
        | ExpressionRole::VirtualConstraint(_)
        | ExpressionRole::Reconstruction(_)
        | ExpressionRole::Casimir(_)
        | ExpressionRole::QuasiInvariance(_)
        | ExpressionRole::Output(_)
        | ExpressionRole::Lyapunov
        | ExpressionRole::Impact(_)
        | ExpressionRole::DomainEnd(_)
        | ExpressionRole::Condition(_)
        | ExpressionRole::Initial(_) => return None,
        ExpressionRole::AdvectedAction(k) => {
            let advected = &model.advected[k];
            (format!("the action on `{}`", advected.name), advected.span)
        }
        ExpressionRole::Connection => ("the connection".to_owned(), model.places.connection),
        ExpressionRole::Algebroid => {
            ("the algebroid".to_owned(), model.algebroid.as_ref().and_then(|a| a.span))
        }
        ExpressionRole::Frame => ("the frame".to_owned(), model.frame.as_ref().and_then(|f| f.span)),
        ExpressionRole::Section(k) => {
            let section = &model.sections[k];
            (format!("section `{}`", section.name), section.span)
        }
        ExpressionRole::Ideal | ExpressionRole::StageConnection => {
            let span = model.stages.as_ref().and_then(|chain| chain.spans.iter().flatten().next().copied());
            ("a stage".to_owned(), span)
        }
        ExpressionRole::InnerProduct => ("the inner product".to_owned(), model.places.inner_product),
    })
}
