//! Rates that a model gives in the place of a Lagrangian: accelerations, and velocities as functions of the base.
//!
//! Deliberately does not know: what the rates are used for.

use std::collections::BTreeSet;

use super::draft::{GivenDraft, ModelBuilder};
use super::symbols::Special;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::layout::short_list;
use crate::spec::model::*;
use crate::spec::value::Value;
use hamel_expr::{ExprId, SymbolId};

impl ModelBuilder {
    /// The rate of a velocity (a vector or a component), in the place of the equations of a Lagrangian.
    pub fn acceleration(&mut self, velocity: &str, value: &Value) -> &mut Self {
        self.given_rate(true, velocity, value)
    }

    /// A velocity (a vector or a component) as a function of the base and the time: a field of first order.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("decay");
    /// let (x, _) = b.coordinate("x", Domain::Real, "");
    /// let rate = x.neg(b.graph());
    /// let model = b.field("x_dot", &rate).clone().build().unwrap();
    /// assert!(model.given.is_some());
    /// ```
    pub fn field(&mut self, velocity: &str, value: &Value) -> &mut Self {
        self.given_rate(false, velocity, value)
    }

    fn given_rate(&mut self, is_acceleration: bool, velocity: &str, value: &Value) -> &mut Self {
        let (name, value, span) = (velocity.to_owned(), value.clone(), self.here);
        self.given.push(GivenDraft { is_acceleration, name, value, span });
        self
    }

    /// Whether the motion is given and follows from no Lagrangian.
    pub(super) fn is_given(&self) -> bool {
        !self.given.is_empty() || self.broken.contains("acceleration") || self.broken.contains("field")
    }

    /// What is given for every velocity; none where the motion follows from a Lagrangian or a Hamiltonian.
    pub(super) fn check_given(&mut self) -> Option<Vec<Given>> {
        let first = self.given.first().cloned()?;
        self.check_beside_given(&first);
        let names = self.velocity_names();
        let mut given: Vec<Option<Given>> = vec![None; names.len()];
        for draft in self.given.clone() {
            let GivenDraft { is_acceleration, name, value, span } = &draft;
            let indices = self.velocity_indices(name);
            if indices.is_empty() {
                self.unknown_velocity(name, *span);
                continue;
            }
            let what = format!("{} of", draft.item());
            let Some(value) = self.fitted(&what, name, value, *span) else { continue };
            for (k, e) in indices.into_iter().zip(value.into_entries()) {
                if !self.is_rate(e, &draft) {
                    break;
                }
                let rate = if *is_acceleration { Given::Acceleration(e) } else { Given::Velocity(e) };
                if given[k].replace(rate).is_some() {
                    let message = format!("the motion of `{}` is given twice", names[k]);
                    self.problem(*span, message, "keep one of them");
                    break;
                }
            }
        }
        let open: Vec<usize> = (0..given.len()).filter(|k| given[*k].is_none()).collect();
        let n_rows = self.n_constraints();
        if n_rows > 0 && !self.given.iter().any(|g| g.is_acceleration) {
            if n_rows != open.len() && !self.is_half_given() && !self.broken.contains("constraint") {
                self.wrong_number(&first, (n_rows, &open), &names);
            }
            return Some(given.into_iter().map(|own| own.unwrap_or(Given::Constrained)).collect());
        }
        if let Some(k) = open.first().filter(|_| !self.is_half_given()) {
            let message = format!("nothing gives the motion of `{}`", names[*k]);
            let help = format!(
                "add `acceleration {0} = ..;`, or `field {0} = ..;` of first order, or a constraint that gives it \
                 beside fields",
                names[*k]
            );
            self.problem(first.span, message, help);
        }
        given.into_iter().collect()
    }

    /// As many constraints as velocities without a field determine the motion.
    fn wrong_number(&mut self, first: &GivenDraft, (n_rows, open): (usize, &[usize]), names: &[String]) {
        let counted = |n: usize, one: &str| format!("{n} {one}{}", if n == 1 { "" } else { "s" });
        let [rows, left] = [counted(n_rows, "constraint"), counted(open.len(), "velocity")];
        let left = if open.len() == 1 { left } else { format!("{} velocities", open.len()) };
        let message = format!("{rows} beside fields for {left}");
        let open: Vec<String> = open.iter().map(|k| names[*k].clone()).collect();
        let help = match open.is_empty() {
            true => {
                "the fields give every velocity: leave out as many of them as there are constraints".into()
            }
            false => format!(
                "{}: each needs one constraint, or a field",
                short_list("the velocities without a field are", &open)
            ),
        };
        self.problem(first.span, message, help);
    }

    /// Constraints beside fields are linear: one of them stands for each velocity that no field gives.
    pub(super) fn check_kinematic(&mut self, constraints: &[Constraint]) {
        if self.given.is_empty() {
            return;
        }
        for constraint in constraints.iter().filter(|c| c.kind != ConstraintKind::Linear) {
            let message =
                format!("constraint `{}` beside `field` is not affine in the velocities", constraint.text);
            let help = "without a lagrangian constraints are solved for velocities; write a rate of its own by \
                        `state`, or add a lagrangian";
            self.problem(constraint.span, message, help);
        }
    }

    /// How many equations the constraints of the text are, by component.
    pub(super) fn n_constraints(&self) -> usize {
        let rows = self.constraints.iter().chain(self.determined.iter().map(|(_, draft)| draft));
        rows.map(|c| c.left.entries().len().max(c.right.entries().len())).sum()
    }

    /// Whether something about given rates is wrong already.
    fn is_half_given(&self) -> bool {
        let items = ["acceleration", "field", "constraint", "velocity", "coordinate", "frame", "algebroid"];
        items.iter().any(|item| self.broken.contains(item))
            || self.problems.iter().any(|p| self.given.iter().any(|g| p.span == g.span))
    }

    fn is_rate(&mut self, e: ExprId, draft: &GivenDraft) -> bool {
        let place = format!("{} of `{}`", draft.item(), draft.name);
        if self.reports_stray(e, draft.span, &place, &[] as &[Special]) {
            return false;
        }
        let velocities: BTreeSet<SymbolId> = self.velocity_symbols().into_iter().collect();
        let free = self.graph.free_symbols(e);
        match free.intersection(&velocities).next().filter(|_| !draft.is_acceleration) {
            Some(velocity) => {
                let message = format!("{place} contains the velocity `{}`", self.graph.name(*velocity));
                let help = "a field of first order is a function of the base; write `acceleration` otherwise";
                self.problem(draft.span, message, help);
                false
            }
            None => true,
        }
    }

    /// What has no meaning where the motion is given.
    fn check_beside_given(&mut self, first: &GivenDraft) {
        let item = first.item();
        for (other, span) in [("lagrangian", &self.lagrangian), ("hamiltonian", &self.hamiltonian)] {
            if let Some((_, span)) = span {
                let problem = Diagnostic::new(first.span, format!("the model has `{item}` and a {other}"))
                    .with_place(*span, format!("the {other}"))
                    .with_help(format!(
                        "keep one of them; forces are added to a {other} with `force`, and numbers with a rate of \
                         their own by `state`"
                    ));
                self.problems.push(problem);
                return;
            }
        }
        // Constraints give the velocities that no field does.
        let has_accelerations = self.given.iter().any(|g| g.is_acceleration);
        let is_kinematic = !self.constraints.is_empty() && !has_accelerations;
        let beside: [(&str, Option<Option<Span>>); 10] = [
            ("constraint", self.constraints.first().filter(|_| has_accelerations).map(|c| c.span)),
            ("virtual", self.virtual_constraints.first().map(|c| c.span)),
            ("independent", self.independent.as_ref().map(|(_, span)| *span)),
            ("multipliers", self.multipliers),
            ("force", self.forces.first().map(|(_, _, span)| *span)),
            ("momentum", self.momenta.first().map(|m| m.span)),
            ("stage", self.stages.first().map(|s| s.span)),
            ("section", self.sections.first().map(|s| s.span)),
            ("quasi_velocity", self.quasi_velocities.first().map(|_| first.span)),
            ("connection", self.derived_connection.filter(|_| !is_kinematic).map(|(_, span)| span)),
        ];
        for (other, span) in beside {
            if let Some(span) = span {
                let message = format!("`{other}` beside `{item}` has no use");
                let help = "the motion is given, and nothing is derived from a lagrangian";
                self.problem(span, message, help);
            }
        }
    }

    /// What a scene cannot want of a motion that is given.
    pub(super) fn wants_of_given(&mut self, scene: &str, want: &str, span: Option<Span>) -> bool {
        let needs = ["energy", "energy_rate", "momentum"];
        if !self.is_given() || !needs.contains(&want) {
            return false;
        }
        let message = format!("scene `{scene}` wants `{want}`, but the motion follows from no lagrangian");
        let help = "`acceleration` and `field` say nothing of it; write what you want as an `output`";
        self.problem(span, message, help);
        true
    }
}
