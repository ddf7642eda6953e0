//! Modes: constraints and forces that are there at some times, events that are watched for then, and impacts.
//!
//! Deliberately does not know: how impacts are solved.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::{DeclaredAs, ModelBuilder};
use super::event_drafts::{Located, ModeAct};
use super::symbols::Special;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::mode::{Impact, after_impact};
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::shape::Shape;
use crate::spec::value::Value;
use hamel_expr::{ExprId, SymbolId};

impl ModelBuilder {
    /// A mode, with constraints, forces and events between two calls of [`ModelBuilder::within`]. Its value is one
    /// while it is on, and zero otherwise.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder, Value};
    ///
    /// let mut b = ModelBuilder::new("stick");
    /// let (_, v) = b.coordinate("x", Domain::Real, "");
    /// b.mode("stuck", "");
    /// let (zero, one) = (Value::Scalar(b.graph().zero()), Value::Scalar(b.graph().one()));
    /// let energy = v.mul(b.graph(), &v).unwrap();
    /// b.lagrangian(&energy);
    /// b.within(Some("stuck")).constraint(Some("hold"), "x_dot = 0", &v, &zero).within(None);
    /// b.initial("stuck", &one);
    /// assert_eq!(b.build().unwrap().constraints[0].mode, Some(0));
    /// ```
    pub fn mode(&mut self, name: &str, doc: &str) -> Value {
        let (symbol, expr) = self.new_symbol(name, DeclaredAs::Mode);
        self.first_order_draft(name, vec![(name.to_owned(), symbol)], Domain::Real, doc);
        let (zero, here) = (Value::Scalar(self.graph.zero()), self.here);
        if let Some(draft) = self.first_order.last_mut() {
            draft.rate = Some((zero, here));
        }
        self.modes.push(Mode { name: name.to_owned(), symbol, doc: doc.to_owned(), span: here });
        Value::Scalar(expr)
    }

    /// Constraints, conditions on displacements, forces and events that follow belong to a mode, or to none.
    pub fn within(&mut self, mode: Option<&str>) -> &mut Self {
        self.current_mode = mode.and_then(|name| self.modes.iter().position(|mode| mode.name == name));
        self
    }

    /// A force that acts while the mode is on that is declared now.
    pub(super) fn while_on(&mut self, force: &Value) -> Value {
        let Some(mode) = self.current_mode else { return force.clone() };
        let mut entries = force.entries().to_vec();
        self.scale_by_mode(Some(mode), &mut entries);
        force.with_entries(entries)
    }

    /// `s e`, where there is a mode.
    pub(super) fn scale_by_mode(&mut self, mode: Option<usize>, entries: &mut [ExprId]) {
        let Some(mode) = mode else { return };
        let s = self.graph.sym(self.modes[mode].symbol);
        entries.iter_mut().for_each(|e| *e = self.graph.mul(s, *e));
    }

    /// `w f + 1 - w`: a function of an event that is watched for where `w` is one, while its mode is on and those are
    /// off that it enters or strikes.
    pub(super) fn watched(&mut self, mode: Option<usize>, acts: &[ModeAct], function: ExprId) -> ExprId {
        let mut factors = Vec::new();
        let one = self.graph.one();
        if let Some(mode) = mode {
            factors.push(self.graph.sym(self.modes[mode].symbol));
        }
        for act in acts {
            let (ModeAct::Enter((name, _)) | ModeAct::Impact((name, _), _)) = act else { continue };
            if let Some(mode) = self.modes.iter().find(|mode| mode.name == *name) {
                let s = self.graph.sym(mode.symbol);
                factors.push(self.graph.sub(one, s));
            }
        }
        if factors.is_empty() {
            return function;
        }
        let watched = self.graph.product(&factors);
        let (on, off) = (self.graph.mul(watched, function), self.graph.sub(one, watched));
        self.graph.add(on, off)
    }

    /// A constraint, multiplied by the symbol of its mode if it has one.
    pub(super) fn constraint_of_mode(
        &mut self,
        mut constraint: Constraint,
        place: &str,
    ) -> Option<Constraint> {
        let Some(mode) = constraint.mode else { return Some(constraint) };
        let span = constraint.span;
        let what = match &constraint.kind {
            ConstraintKind::Linear => None,
            ConstraintKind::Nonlinear => Some("is not linear in the velocities"),
            ConstraintKind::SecondOrder { .. } | ConstraintKind::ThirdOrder { .. } => {
                Some("restricts accelerations")
            }
        };
        if self.hamiltonian.is_some() || !self.given.is_empty() {
            let help = "write the Lagrangian: impulses and multipliers act in its metric";
            self.problem(span, format!("{place} of a mode has no Lagrangian beside it"), help);
            return None;
        }
        if let Some(what) = what {
            let help = "constraints of a mode are linear in the velocities, or equations between positions";
            self.problem(span, format!("{place} of a mode {what}"), help);
            return None;
        }
        let free = self.graph.free_symbols(constraint.residual);
        if self.modes.iter().any(|mode| free.contains(&mode.symbol)) {
            let help = "its constraints hold while it is on: leave the name out";
            self.problem(span, format!("{place} of a mode contains a mode"), help);
            return None;
        }
        if self.reports_stray(constraint.residual, span, &format!("{place} of a mode"), &[] as &[Special]) {
            return None;
        }
        // The derivative alone: where the mode begins says where.
        constraint.position = None;
        let mut residual = [constraint.residual];
        self.scale_by_mode(Some(mode), &mut residual);
        [constraint.residual] = residual;
        Some(constraint)
    }

    /// Conditions on displacements stand beside constraints one by one where there are modes.
    pub(super) fn check_pairs_of_modes(
        &mut self,
        constraints: &[Constraint],
        conditions: &[VirtualConstraint],
    ) {
        let has_modes = constraints.iter().any(|c| c.mode.is_some());
        if conditions.is_empty() || !(has_modes || conditions.iter().any(|c| c.mode.is_some())) {
            return;
        }
        let own: Vec<Option<usize>> = constraints.iter().map(|c| c.mode).collect();
        let found: Vec<Option<usize>> = conditions.iter().map(|c| c.mode).collect();
        if own == found || !self.problems.is_empty() {
            return;
        }
        let message = "conditions on displacements do not stand beside the constraints of modes one by one";
        let help =
            "give in each mode, and outside of modes, as many conditions as constraints, in their order";
        let problem = Diagnostic::new(conditions[0].span, message).with_help(help);
        self.problems.push(problem);
    }

    /// The symbols `lambda_name` of the multipliers of named constraints, for functions of events; names that the model
    /// declares itself stay what they are.
    pub(in crate::spec) fn declare_multipliers(&mut self) {
        for draft in self.constraints.clone() {
            let Some(name) = draft.name else { continue };
            let (left, right) = Value::fit_zero(&self.graph, &draft.left, &draft.right);
            let Ok(residual) = left.sub(&mut self.graph, &right) else { continue };
            let whole = format!("lambda_{name}");
            if self.names.contains_key(&whole) {
                continue;
            }
            let names: Vec<String> = match residual.shape() {
                Shape::Scalar => vec![name],
                _ => (1..=residual.entries().len()).map(|k| format!("{name}{k}")).collect(),
            };
            let here = std::mem::replace(&mut self.here, draft.span);
            let mut entries = Vec::new();
            for name in names {
                let own = format!("lambda_{name}");
                if self.names.contains_key(&own) {
                    continue;
                }
                let (symbol, e) = self.new_symbol(&own, DeclaredAs::Multiplier);
                self.multiplier_symbols.push((name, symbol));
                entries.push(e);
            }
            if entries.len() > 1 && entries.len() == residual.entries().len() {
                self.declare(&whole, DeclaredAs::Multiplier);
                self.bind(&whole, &residual.with_entries(entries));
            }
            self.here = here;
        }
        self.gather_multipliers();
    }

    /// The vector `lambda_hold` of constraints `hold1`, `hold2`, .. that a loop has declared.
    fn gather_multipliers(&mut self) {
        let mut families: BTreeMap<String, Vec<(usize, ExprId)>> = BTreeMap::new();
        for (name, symbol) in &self.multiplier_symbols {
            let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
            if let (Ok(k), false) = (name[stem.len()..].parse(), stem.is_empty()) {
                families.entry(stem.to_owned()).or_default().push((k, self.graph.sym(*symbol)));
            }
        }
        for (stem, mut members) in families {
            members.sort_unstable_by_key(|(k, _)| *k);
            let whole = format!("lambda_{stem}");
            let is_whole = members.iter().enumerate().all(|(place, (k, _))| *k == place + 1);
            if is_whole && !self.names.contains_key(&whole) {
                self.declare(&whole, DeclaredAs::Multiplier);
                self.bind(&whole, &Value::Vector(members.into_iter().map(|(_, e)| e).collect()));
            }
        }
    }

    /// Whether what an event sets is a state of first order.
    pub(super) fn is_first_order(&self, name: &str) -> bool {
        let is_it = |d: &DeclaredAs| matches!(d, DeclaredAs::FirstOrder | DeclaredAs::FirstOrderComponent);
        self.names.get(name).is_some_and(|declared| is_it(&declared.what))
    }

    fn mode_of_act(&mut self, place: &str, (name, span): &Located) -> Option<usize> {
        let found = self.modes.iter().position(|mode| mode.name == *name);
        if found.is_none() && !self.broken.contains("mode") {
            let near = names::suggest(name, self.modes.iter().map(|mode| mode.name.as_str()));
            self.problem(*span, format!("{place}: `{name}` is not a mode"), near);
        }
        found
    }

    /// What an event sets by what it does to modes, and the impact if there is one.
    pub(super) fn check_acts(
        &mut self,
        event: &str,
        acts: &[ModeAct],
    ) -> (Vec<(SymbolId, ExprId)>, Option<Impact>) {
        let place = format!("event `{event}`");
        let (zero, one) = (self.graph.zero(), self.graph.one());
        let (mut sets, mut named) = (Vec::new(), Vec::new());
        let (mut modes, mut restitution, mut strikes) = (Vec::new(), Vec::new(), false);
        for act in acts {
            let (ModeAct::Enter(name) | ModeAct::Leave(name) | ModeAct::Impact(name, _)) = act;
            let Some(mode) = self.mode_of_act(&place, name) else { continue };
            if named.contains(&mode) {
                let message = format!("{place} names the mode `{}` twice", name.0);
                self.problem(name.1, message, "keep one of them");
                continue;
            }
            named.push(mode);
            let symbol = self.modes[mode].symbol;
            let has_constraints = self.constraints.iter().any(|constraint| constraint.mode == Some(mode));
            match act {
                ModeAct::Enter(_) => {
                    strikes |= has_constraints;
                    modes.push((symbol, one));
                    sets.push((symbol, one));
                }
                ModeAct::Leave(_) => {
                    modes.push((symbol, zero));
                    sets.push((symbol, zero));
                }
                ModeAct::Impact(name, _) if !has_constraints => {
                    let message = format!("{place} strikes the mode `{}`, which has no constraint", name.0);
                    self.problem(name.1, message, "an impact is along the constraints of a mode");
                }
                ModeAct::Impact(_, e) => {
                    strikes = true;
                    modes.push((symbol, one));
                    let Some(e) = self.restitution(&place, e.as_ref()) else { continue };
                    restitution.push((symbol, e));
                }
            }
        }
        if !strikes {
            return (sets, None);
        }
        let mut velocities = Vec::new();
        for velocity in self.velocity_symbols() {
            let name = after_impact(event, self.graph.name(velocity));
            let after = self.graph.symbol(&name);
            let e = self.graph.sym(after);
            sets.push((velocity, e));
            velocities.push(after);
        }
        (sets, Some(Impact { modes, restitution, velocities }))
    }

    /// How much of a velocity comes back: a number, zero where nothing says so.
    fn restitution(&mut self, place: &str, e: Option<&(Value, Option<Span>)>) -> Option<ExprId> {
        let Some((value, span)) = e else { return Some(self.graph.zero()) };
        let Value::Scalar(e) = *value else {
            let message = format!("{place} gives back {} of a velocity", value.shape());
            self.problem(*span, message, "write a number, such as `impact foot with 0.8;`");
            return None;
        };
        let params: BTreeSet<SymbolId> = self.params.iter().map(|param| param.symbol).collect();
        if !self.graph.free_symbols(e).is_subset(&params) {
            let message = format!("{place} gives back a part of a velocity that is not made of parameters");
            self.problem(*span, message, "write a number or a parameter");
            return None;
        }
        Some(e)
    }
}
