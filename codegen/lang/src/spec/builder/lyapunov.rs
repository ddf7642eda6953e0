//! Actuators, and functions of the state that change at a rate: what the force of an actuator follows from.
//!
//! An actuator is a reaction along a one-form, so that virtual displacements vanish on it; the rate of the function
//! is a constraint on accelerations, `dV/dy . ydot + dV/dx . xdot - rate = 0`.
//!
//! Deliberately does not know: how constraints are solved, whether a force has a value where it divides by zero.
//!
//! # Source
//! Grillo, Marsden, Nair 2011, Lyapunov constraints and global asymptotic stabilization, J. Geom. Mech. 3, 145.

use std::collections::BTreeSet;

use super::draft::{DeclaredAs, ModelBuilder};
use super::feedback_drafts::{Actuator, FeedbackDraft, Function};
use super::symbols::Special;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::event::OutputPart;
use crate::spec::model::*;
use crate::spec::value::Value;
use hamel_expr::{ExprId, SymbolId};

impl ModelBuilder {
    /// The force of an actuator, a number; [`ModelBuilder::actuated_along`] says along what.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("slide");
    /// let (_, rate) = b.coordinate("x", Domain::Real, "");
    /// let energy = rate.mul(b.graph(), &rate).unwrap();
    /// b.actuator("u", "");
    /// let power = b.response("E", "u");
    /// let damping = power.mul(b.graph(), &power).unwrap().neg(b.graph());
    /// b.lagrangian(&energy).actuated_along("u", &rate).lyapunov("E", &energy, Some(&damping), "");
    /// let model = b.build().unwrap();
    /// assert_eq!(model.lyapunov.unwrap().actuator, "u");
    /// ```
    pub fn actuator(&mut self, name: &str, doc: &str) -> Value {
        let (symbol, expr) = self.new_symbol(name, DeclaredAs::Actuator);
        let (name, doc, span) = (name.to_owned(), doc.to_owned(), self.here);
        self.feedback.actuators.push(Actuator { name, symbol, along: None, doc, span });
        Value::Scalar(expr)
    }

    /// The combination of velocities along which an actuator acts: the power of its force `u` is `u`
    /// times that velocity.
    pub fn actuated_along(&mut self, actuator: &str, velocity: &Value) -> &mut Self {
        if let Some(own) = self.feedback.actuators.iter_mut().find(|a| a.name == actuator) {
            own.along = Some(velocity.clone());
        }
        self
    }

    /// What a unit of the force `actuator` adds to the rate of the function: `dV_du` of `V` and `u`.
    pub fn response(&mut self, function: &str, actuator: &str) -> Value {
        let name = format!("d{function}_d{actuator}");
        let (symbol, expr) = self.new_symbol(&name, DeclaredAs::Response);
        self.feedback.responses.push((function.to_owned(), symbol));
        Value::Scalar(expr)
    }

    /// A function of coordinates and velocities that changes along the motion at a rate, zero where none is given: the
    /// force of the actuator is what makes it do so.
    pub fn lyapunov(&mut self, name: &str, value: &Value, rate: Option<&Value>, doc: &str) -> &mut Self {
        let (name, value, rate) = (name.to_owned(), value.clone(), rate.cloned());
        let (doc, span) = (doc.to_owned(), self.here);
        self.feedback.functions.push(Function { name, value, rate, doc, span });
        self
    }

    /// Names of the actuators.
    pub(in crate::spec) fn actuators(&self) -> Vec<String> {
        self.feedback.actuators.iter().map(|a| a.name.clone()).collect()
    }

    /// Symbols that stand for forces of actuators, or for what a function has from them.
    pub(super) fn of_feedback(&self, symbol: SymbolId) -> bool {
        let forces = self.feedback.actuators.iter().map(|a| a.symbol);
        forces.chain(self.feedback.responses.iter().map(|(_, own)| *own)).any(|own| own == symbol)
    }

    /// Whether there is anything of the kind.
    pub(super) fn has_feedback(&self) -> bool {
        !(self.feedback.actuators.is_empty() && self.feedback.functions.is_empty())
    }

    /// The one actuator and the one function, where that is what there is.
    fn pair(&mut self) -> Option<(Actuator, Function)> {
        let FeedbackDraft { actuators, functions, responses: _ } = self.feedback.clone();
        let is_broken = self.broken.contains("actuate") || self.broken.contains("lyapunov");
        let twice = |second: Option<Span>, first: Option<Span>, message: &str, help: &str| {
            Some(Diagnostic::new(second, message).with_place(first, "first here").with_help(help))
        };
        let problem = match (actuators.as_slice(), functions.as_slice()) {
            _ if is_broken => None,
            ([], []) => None,
            ([first, second, ..], _) => twice(
                second.span,
                first.span,
                "the forces of several actuators do not follow from one rate",
                "keep one actuator; a force that is known is an `input u = 0;` with `force x_dot = u;`",
            ),
            (_, [first, second, ..]) => twice(
                second.span,
                first.span,
                "one actuator does not give several functions their rates",
                "keep one function, such as their sum",
            ),
            ([actuator], []) => {
                let message = format!("nothing says what the force `{}` of the actuator is", actuator.name);
                let help =
                    "write `lyapunov V = ..;` with a function that changes at a rate, or `input u = 0;`";
                Some(Diagnostic::new(actuator.span, message).with_help(help))
            }
            ([], [function]) => {
                let message = format!("nothing acts on `{}`", function.name);
                Some(Diagnostic::new(function.span, message).with_help("write `actuate u along x_dot;`"))
            }
            ([actuator], [function]) => return Some((actuator.clone(), function.clone())),
        };
        self.problems.extend(problem);
        None
    }

    /// What stands beside a Lyapunov function that it is not for.
    fn reports_beside(&mut self, span: Option<Span>) -> bool {
        let constraint = self.constraints.first().or(self.virtual_constraints.first());
        let constraint = constraint.or(self.determined.first().map(|(_, draft)| draft)).map(|c| c.span);
        let thermo = self.thermo;
        let beside = [
            ("constraints", "write the Lagrangian in coordinates that satisfy them", constraint.or(thermo)),
            ("a Hamiltonian", "write the Lagrangian", self.hamiltonian.as_ref().map(|(_, span)| *span)),
            ("given rates", "write the Lagrangian", self.given.first().map(|given| given.span)),
            ("white noise", "leave it out: the rate of a function has terms of second order", {
                self.noises.first().map(|noise| noise.span)
            }),
        ];
        let found = beside.into_iter().find_map(|(what, help, place)| Some((what, help, place?)));
        let Some((what, help, place)) = found else { return false };
        let problem = Diagnostic::new(span, format!("a Lyapunov function beside {what}"));
        self.problems.push(problem.with_place(place, "this one").with_help(help));
        true
    }

    /// The constraint on accelerations and the condition on displacements that actuator and function are, with the
    /// outputs of their names.
    pub(super) fn check_lyapunov(
        &mut self,
        advected: &[Advected],
        connection: Option<&[Vec<ExprId>]>,
        lagrangian: ExprId,
        (constraints, conditions): (&mut Vec<Constraint>, &mut Vec<VirtualConstraint>),
    ) -> Option<Lyapunov> {
        if !self.has_feedback() {
            return None;
        }
        let (actuator, function) = self.pair()?;
        let span = function.span;
        if self.reports_beside(span) {
            return None;
        }
        let one_form = self.one_form_of(&actuator)?;
        let name = function.name.clone();
        let response = self.feedback.responses.iter().find(|(own, _)| *own == name).map(|(_, s)| *s)?;
        let momenta = self.momenta_of(lagrangian);
        let value = self.number(&function.value, &format!("the Lyapunov function `{name}`"), span)?;
        let value = self.in_velocities(value, &momenta);
        let rate = match &function.rate {
            None => self.graph.zero(),
            Some(rate) => self.number(rate, &format!("the rate of `{name}`"), span)?,
        };
        let rate = self.in_velocities(rate, &momenta);
        let place = format!("the Lyapunov function `{name}`");
        if self.reports_stray(value, span, &place, &[]) || self.reports_moving(value, &place, span) {
            return None;
        }
        let own_force = self.graph.free_symbols(rate).contains(&actuator.symbol);
        if own_force {
            let message = format!("the rate of `{name}` contains the force `{}`", actuator.name);
            self.problem(span, message, "the force follows from the rate, and not the rate from the force");
            return None;
        }
        if self.reports_stray(rate, span, &format!("the rate of `{name}`"), &[Special::Feedback]) {
            return None;
        }
        let velocities = self.velocity_symbols();
        let value = self.simple_in_frame(value);
        let acceleration: Vec<ExprId> = velocities.iter().map(|y| self.graph.diff(value, *y)).collect();
        if acceleration.iter().all(|e| *e == self.graph.zero()) {
            let message = format!("{place} contains no velocity");
            self.problem(span, message, "a force changes accelerations: add the kinetic energy");
            return None;
        }
        let rates = self.rates_of_positions(advected, connection);
        let drift = self.along(value, &rates);
        let residual = self.graph.sub(drift, rate);
        let text = format!("the rate of {name}");
        let kind = ConstraintKind::SecondOrder { acceleration };
        let (position, gives, mode) = (None, None, None);
        constraints.push(Constraint {
            name: name.clone(),
            text,
            kind,
            residual,
            position,
            gives,
            mode,
            span,
        });
        let text = format!("the power of {}", actuator.name);
        let (power_of, span) = (None, actuator.span);
        conditions.push(VirtualConstraint {
            name: actuator.name.clone(),
            text,
            one_form,
            power_of,
            mode,
            span,
        });
        let force = self.graph.sym(actuator.symbol);
        self.declare_feedback_output(&name, value, &function);
        self.declare_output_of_force(&actuator, force, &name);
        self.multiplier_symbols.push((name.clone(), actuator.symbol));
        let (actuator, span) = (actuator.name, function.span);
        Some(Lyapunov { name, value, rate, response, actuator, span })
    }

    fn declare_feedback_output(&mut self, name: &str, value: ExprId, function: &Function) {
        self.here = function.span;
        self.output_name(name);
        let doc = match function.doc.is_empty() {
            true => "Lyapunov function".to_owned(),
            false => function.doc.clone(),
        };
        let (name, part) = (name.to_owned(), OutputPart::Own);
        self.outputs.push(NamedVector { components: vec![(name.clone(), value)], name, doc, part });
    }

    fn declare_output_of_force(&mut self, actuator: &Actuator, force: ExprId, function: &str) {
        self.here = actuator.span;
        self.output_name(&actuator.name);
        let doc = match actuator.doc.is_empty() {
            true => format!("force of the actuator, which gives {function} its rate"),
            false => actuator.doc.clone(),
        };
        let (name, part) = (actuator.name.clone(), OutputPart::Own);
        self.outputs.push(NamedVector { components: vec![(name.clone(), force)], name, doc, part });
    }

    fn number(&mut self, value: &Value, what: &str, span: Option<Span>) -> Option<ExprId> {
        let Value::Scalar(e) = *value else {
            let message = format!("{what} must be a number, found {}", value.shape());
            self.problem(span, message, "use `dot(a, b)` for the pairing of vectors");
            return None;
        };
        Some(e)
    }

    /// A state of first order, an input: the rate of what contains them is not that of coordinates and velocities.
    fn reports_moving(&mut self, value: ExprId, place: &str, span: Option<Span>) -> bool {
        let free = self.graph.free_symbols(value);
        let inputs = self.inputs.iter().map(|input| ("input", input.symbol));
        let states = self.first_order.iter().flat_map(|s| &s.components).map(|(_, s)| ("state", *s));
        let Some((what, symbol)) = inputs.chain(states).find(|(_, s)| free.contains(s)) else { return false };
        let message = format!("{place} contains the {what} `{}`", self.graph.name(symbol));
        self.problem(span, message, "it is a function of coordinates, velocities, parameters and the time");
        true
    }

    /// `du/dy` of the velocity that an actuator acts along.
    fn one_form_of(&mut self, actuator: &Actuator) -> Option<Vec<ExprId>> {
        let (place, span) = (format!("the velocity of the actuator `{}`", actuator.name), actuator.span);
        let along = self.number(actuator.along.as_ref()?, &place, span)?;
        let along = self.simple_in_frame(along);
        if self.reports_stray(along, span, &place, &[]) {
            return None;
        }
        let velocities = self.velocity_symbols();
        let own: BTreeSet<SymbolId> = velocities.iter().copied().collect();
        let one_form: Vec<ExprId> = velocities.iter().map(|y| self.graph.diff(along, *y)).collect();
        let is_curved = one_form.iter().any(|e| self.graph.depends_on(*e, &own));
        if is_curved || one_form.iter().all(|e| *e == self.graph.zero()) {
            let what = if is_curved { "is not linear in velocities" } else { "contains no velocity" };
            self.problem(span, format!("{place} {what}"), "write `actuate u along x_dot;`");
            return None;
        }
        Some(one_form)
    }
}
