//! Constraints on velocities, conditions on virtual displacements, independent velocities.
//!
//! Deliberately does not know: how constraints are solved.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::{ConstraintDraft, DeclaredAs, ModelBuilder};
use super::symbols::Special;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::shape::{Operation, Shape, ValueError};
use crate::spec::value::Value;
use hamel_expr::{ExprId, Style, SymbolId};

/// Characters of a combination of accelerations that are shown where it is documented.
const MAX_SHOWN: usize = 60;

impl ModelBuilder {
    /// A constraint `left = right` on velocities, or on accelerations and their rates made by [`ModelBuilder::ddt`]; a
    /// vector equation gives one constraint per component, and the number 0 on one side stands for a zero of any shape.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, ModelBuilder, Value};
    ///
    /// let mut b = ModelBuilder::new("sleigh");
    /// let [omega, v] = b.velocities(LieAlgebra::se(2).unwrap(), &["omega", "v"]).try_into().unwrap();
    /// let square = omega.mul(b.graph(), &omega).unwrap();
    /// let energy = v.dot(b.graph(), &v).unwrap().add(b.graph(), &square).unwrap();
    /// let zero = Value::Scalar(b.graph().zero());
    /// b.lagrangian(&energy).constraint(Some("skate"), "v2 = 0", &v.row(2).unwrap(), &zero);
    /// b.independent(&["omega", "v1"]).force("v1", &zero);
    /// assert_eq!(b.build().unwrap().constraints[0].name, "skate");
    /// ```
    pub fn constraint(&mut self, name: Option<&str>, text: &str, left: &Value, right: &Value) -> &mut Self {
        let span = self.here;
        self.constraints.push(ConstraintDraft {
            name: name.map(str::to_owned),
            gives: Vec::new(),
            text: text.to_owned(),
            left: left.clone(),
            right: right.clone(),
            mode: self.current_mode,
            span,
        });
        self
    }

    /// The velocities (vectors or components) that the last constraint is solved for, one for each component, after
    /// those of constraints before it. What is divided by there has to stay different from zero; without, linear
    /// constraints are solved together, which divides by less.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, ModelBuilder, Value};
    ///
    /// let mut b = ModelBuilder::new("point");
    /// let [v] = b.velocities(LieAlgebra::abelian(3), &["v"]).try_into().unwrap();
    /// let energy = v.dot(b.graph(), &v).unwrap();
    /// let zero = Value::Scalar(b.graph().zero());
    /// let sum = v.row(1).unwrap().add(b.graph(), &v.row(2).unwrap()).unwrap();
    /// b.lagrangian(&energy).constraint(None, "v1 + v2 = 0", &sum, &zero).solved_for(&["v2"]);
    /// assert_eq!(b.build().unwrap().constraints[0].gives, Some(1));
    /// ```
    pub fn solved_for(&mut self, names: &[&str]) -> &mut Self {
        let located: Vec<(String, Option<Span>)> =
            names.iter().map(|n| ((*n).to_owned(), self.here)).collect();
        self.located_solved_for(located)
    }

    pub(in crate::spec) fn located_solved_for(&mut self, names: Vec<(String, Option<Span>)>) -> &mut Self {
        if let Some(draft) = self.constraints.last_mut() {
            draft.gives = names;
        }
        self
    }

    /// The velocities (vectors or components) to be kept as independent.
    pub fn independent(&mut self, names: &[&str]) -> &mut Self {
        let located: Vec<(String, Option<Span>)> =
            names.iter().map(|n| ((*n).to_owned(), self.here)).collect();
        self.located_independent(located)
    }

    pub(in crate::spec) fn located_independent(&mut self, names: Vec<(String, Option<Span>)>) -> &mut Self {
        let here = self.here;
        match &self.independent {
            Some((_, first)) => self.twice("independent", *first),
            None => self.independent = Some((names, here)),
        }
        self
    }

    /// Keeps all velocities and computes multipliers.
    pub fn multipliers(&mut self) -> &mut Self {
        let here = self.here;
        match self.multipliers {
            Some(first) => self.twice("multipliers", first),
            None => self.multipliers = Some(here),
        }
        self
    }

    /// A condition `left = right` on virtual displacements, linear in [`ModelBuilder::delta`]; a vector equation gives
    /// one condition per component. Without any, the displacements are those that the constraints allow.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, ModelBuilder, Value};
    ///
    /// let mut b = ModelBuilder::new("servo");
    /// let v = b.velocities(LieAlgebra::abelian(2), &["v"]).remove(0);
    /// let energy = v.dot(b.graph(), &v).unwrap();
    /// let zero = Value::Scalar(b.graph().zero());
    /// let (first, second) = (v.row(1).unwrap(), v.row(2).unwrap());
    /// let (acceleration, displacement) = (b.ddt(&first).unwrap(), b.delta(&second).unwrap());
    /// b.lagrangian(&energy).constraint(None, "ddt(v1) = 0", &acceleration, &zero);
    /// b.virtual_constraint(None, "delta(v2) = 0", &displacement, &zero);
    /// assert_eq!(b.build().unwrap().virtual_constraints.len(), 1);
    /// ```
    pub fn virtual_constraint(
        &mut self,
        name: Option<&str>,
        text: &str,
        left: &Value,
        right: &Value,
    ) -> &mut Self {
        let span = self.here;
        self.virtual_constraints.push(ConstraintDraft {
            name: name.map(str::to_owned),
            gives: Vec::new(),
            text: text.to_owned(),
            left: left.clone(),
            right: right.clone(),
            mode: self.current_mode,
            span,
        });
        self
    }

    /// Left minus right of an equation, by component, with names; `prefix` counts the unnamed ones.
    pub(super) fn rows(
        &mut self,
        draft: &ConstraintDraft,
        what: &str,
        prefix: &str,
        taken: &mut BTreeMap<String, Option<Span>>,
        n_unnamed: &mut usize,
    ) -> Vec<(String, String, ExprId)> {
        let (left, right) = Value::fit_zero(&self.graph, &draft.left, &draft.right);
        let Ok(residual) = left.sub(&mut self.graph, &right) else {
            let (left, right) = (draft.left.shape(), draft.right.shape());
            self.value_error(draft.span, &ValueError::Shapes { operation: Operation::Equate, left, right });
            return Vec::new();
        };
        let n = residual.entries().len();
        let mut rows = Vec::with_capacity(n);
        for (k, e) in residual.entries().iter().enumerate() {
            let name = match (&draft.name, residual.shape()) {
                (Some(name), Shape::Scalar) => name.clone(),
                (Some(name), _) => format!("{name}{}", k + 1),
                (None, _) => {
                    *n_unnamed += 1;
                    format!("{prefix}{n_unnamed}")
                }
            };
            if let Some(reason) = names::refusal(&name) {
                self.problem(draft.span, format!("`{name}` cannot be used as a name"), reason);
            }
            if let Some(first) = taken.insert(name.clone(), draft.span) {
                let problem = Diagnostic::new(draft.span, format!("{what} `{name}` is declared twice"))
                    .with_place(first, "first here")
                    .with_help("rename one of them");
                self.problems.push(problem);
            }
            let text = &draft.text;
            let place = if n > 1 {
                format!("component {} of {what} `{text}`", k + 1)
            } else {
                format!("{what} `{text}`")
            };
            if self.graph.is_zero(*e) {
                if n > 1 && self.is_between_positions([&left, &right]) {
                    let told =
                        Diagnostic::warning(draft.span, format!("{place} always holds: it is left out"));
                    self.left_out.push(told.with_help("write the other components alone"));
                    continue;
                }
                self.problem(draft.span, format!("{place} always holds"), "remove it");
                continue;
            }
            rows.push((name, place, *e));
        }
        rows
    }

    /// Whether nothing is in an equation that moves by itself: no velocity, no acceleration. A component of it that
    /// always holds is a loop in the plane that is written in space, and no mistake.
    fn is_between_positions(&self, sides: [&Value; 2]) -> bool {
        let base = self.base.iter().map(|c| c.symbol).chain(self.params.iter().map(|p| p.symbol));
        let advected = self.advected.iter().flat_map(|a| a.components.iter().map(|(_, symbol)| *symbol));
        let known: BTreeSet<SymbolId> = base.chain(advected).chain([self.time]).collect();
        sides
            .into_iter()
            .flat_map(|side| side.entries())
            .all(|e| self.graph.free_symbols(*e).is_subset(&known))
    }

    /// `dL/dv` by the names that momenta have; nothing beside a Hamiltonian.
    pub(super) fn momenta_of(&mut self, lagrangian: ExprId) -> BTreeMap<SymbolId, ExprId> {
        if self.lagrangian.is_none() {
            return BTreeMap::new();
        }
        let velocities = self.velocity_symbols();
        let components = self.momenta.iter().flat_map(|m| &m.components);
        let along: Vec<(SymbolId, SymbolId)> =
            components.filter_map(|(_, p, k)| Some((*p, *velocities.get(*k)?))).collect();
        along.into_iter().map(|(p, v)| (p, self.graph.diff(lagrangian, v))).collect()
    }

    /// An expression with momenta by velocities.
    pub(super) fn in_velocities(&mut self, e: ExprId, momenta: &BTreeMap<SymbolId, ExprId>) -> ExprId {
        let free = self.graph.free_symbols(e);
        if !free.iter().any(|s| momenta.contains_key(s)) {
            return e;
        }
        // A division by what vanishes stays as it is written, and is told with the name of the momentum.
        self.graph.subs(e, momenta).unwrap_or(e)
    }

    /// `advected` and `connection` say how positions move; `lagrangian` what momenta are.
    pub(super) fn check_constraints(
        &mut self,
        advected: &[Advected],
        connection: Option<&[Vec<ExprId>]>,
        lagrangian: ExprId,
    ) -> Vec<Constraint> {
        let rates = self.rates_of_positions(advected, connection);
        let momenta = self.momenta_of(lagrangian);
        let given = self.check_determined(&rates);
        let mut result = Vec::new();
        let mut taken = BTreeMap::new();
        let mut n_unnamed = 0;
        let mut all_given: BTreeMap<usize, Option<Span>> = BTreeMap::new();
        for draft in self.constraints.clone() {
            let first = result.len();
            for (name, place, e) in self.rows(&draft, "constraint", "c", &mut taken, &mut n_unnamed) {
                let e = self.in_velocities(e, &momenta);
                let classified = self.classify(e, &name, &place, draft.span, &rates);
                let Some((residual, kind, position)) = classified else { continue };
                let (text, mode, span) = (draft.text.clone(), draft.mode, draft.span);
                let gives = None;
                let constraint = Constraint { name, text, kind, residual, position, gives, mode, span };
                result.extend(self.constraint_of_mode(constraint, &place));
            }
            self.give(&draft, &mut result[first..], &mut all_given);
        }
        self.reports_taken(&given, &taken);
        let all: Vec<Constraint> = given.into_iter().chain(result).collect();
        self.check_kinematic(&all);
        all
    }

    /// Notes which velocities the components of a constraint give; `all` are those that any constraint gives.
    fn give(
        &mut self,
        draft: &ConstraintDraft,
        components: &mut [Constraint],
        all: &mut BTreeMap<usize, Option<Span>>,
    ) {
        let before = self.problems.len();
        let mut given = Vec::new();
        for (name, span) in &draft.gives {
            let indices = self.velocity_indices(name);
            if indices.is_empty() {
                self.unknown_velocity(name, *span);
            }
            for k in &indices {
                if let Some(first) = all.insert(*k, *span) {
                    let problem = Diagnostic::new(*span, format!("two constraints give `{name}`"))
                        .with_place(first, "here, too")
                        .with_help("solve each constraint for a velocity of its own");
                    self.problems.push(problem);
                }
            }
            given.extend(indices);
        }
        if given.is_empty() || self.problems.len() > before {
            return;
        }
        let span = draft.gives.first().and_then(|(_, span)| *span);
        if let Some(c) = components.iter().find(|c| c.kind != ConstraintKind::Linear || c.position.is_some())
        {
            let what = if c.position.is_some() { "an equation between positions" } else { "not linear" };
            let message = format!("constraint `{}` is {what}: it is not solved for velocities", c.text);
            self.problem(span, message, "remove `for`");
        } else if given.len() != components.len() {
            let (n, m) = (given.len(), components.len());
            let counted =
                |n: usize, one: &str, many: &str| format!("{n} {}", if n == 1 { one } else { many });
            let message = format!(
                "constraint `{}` has {}, and {} to give",
                draft.text,
                counted(m, "component", "components"),
                counted(n, "velocity", "velocities")
            );
            self.problem(span, message, "name a velocity for each component");
        } else {
            components.iter_mut().zip(given).for_each(|(c, k)| c.gives = Some(k));
        }
    }

    /// The part without accelerations and the kind; the derivative of an equation between positions, and that.
    fn classify(
        &mut self,
        e: ExprId,
        name: &str,
        place: &str,
        span: Option<Span>,
        rates: &BTreeMap<SymbolId, ExprId>,
    ) -> Option<(ExprId, ConstraintKind, Option<PositionEquation>)> {
        let e = self.simple_in_frame(e);
        let special = [Special::QuasiVelocity, Special::Acceleration, Special::Jerk];
        if self.reports_stray(e, span, place, &special) {
            return None;
        }
        let velocities = self.velocity_symbols();
        let jerks: Vec<SymbolId> = velocities.iter().filter_map(|v| self.jerks.get(v)).copied().collect();
        let highest = self.occurring(e, &jerks);
        if !highest.is_empty() {
            let (residual, kind) = self.third_order(e, (name, place), span, (&highest, &jerks))?;
            return Some((residual, kind, None));
        }
        let accelerations: Vec<SymbolId> =
            velocities.iter().filter_map(|v| self.accelerations.get(v)).copied().collect();
        let occurring = self.occurring(e, &accelerations);
        if !occurring.is_empty() {
            let Some((slopes, residual)) = self.graph.affine_parts(e, &occurring) else {
                self.problem(
                    span,
                    format!("{place} is not affine in the accelerations"),
                    "accelerations `ddt(v)` appear in the first power only",
                );
                return None;
            };
            if self.reports_stray(e, span, place, &[Special::Acceleration]) {
                return None;
            }
            let acceleration = self.spread(&occurring, slopes, &accelerations);
            return Some((residual, ConstraintKind::SecondOrder { acceleration }, None));
        }
        let unknowns: Vec<SymbolId> =
            velocities.into_iter().chain(self.quasi_velocities.iter().map(|v| v.symbol)).collect();
        let occurring = self.occurring(e, &unknowns);
        if occurring.is_empty() && self.reports_first_order(e, place, span) {
            return None;
        }
        if occurring.is_empty() && self.has_positions(e) {
            let position = PositionEquation { residual: e, determines: None };
            let rate = self.along(e, rates);
            return (!self.reports_rigid(rate, place, span)).then_some((
                rate,
                ConstraintKind::Linear,
                Some(position),
            ));
        }
        match self.graph.affine_parts(e, &occurring) {
            Some((slopes, _)) if slopes.iter().all(|s| *s == self.graph.zero()) => {
                if !self.broken.contains("velocity") {
                    self.problem(
                        span,
                        format!("{place} contains neither a velocity nor a coordinate"),
                        "a condition on parameters is a `require`",
                    );
                }
                None
            }
            Some(_) => Some((e, ConstraintKind::Linear, None)),
            None if self.reports_stray(e, span, &format!("nonlinear {place}"), &[]) => None,
            None => Some((e, ConstraintKind::Nonlinear, None)),
        }
    }

    /// A constraint on the rates of accelerations that occur in it, `highest` of `jerks`.
    fn third_order(
        &mut self,
        e: ExprId,
        (name, place): (&str, &str),
        span: Option<Span>,
        (highest, jerks): (&[SymbolId], &[SymbolId]),
    ) -> Option<(ExprId, ConstraintKind)> {
        if self.reports_stray(e, span, place, &[Special::Acceleration, Special::Jerk]) {
            return None;
        }
        let Some((slopes, residual)) = self.graph.affine_parts(e, highest) else {
            let help = "rates of accelerations `ddt(ddt(v))` appear in the first power only";
            self.problem(span, format!("{place} is not affine in the rates of accelerations"), help);
            return None;
        };
        let accelerations: BTreeSet<SymbolId> = self.accelerations.values().copied().collect();
        let factor = slopes.iter().flat_map(|slope| self.graph.free_symbols(*slope));
        if let Some(factor) = factor.into_iter().find(|s| accelerations.contains(s)) {
            let message =
                format!("{place} has the factor `{}` on a rate of an acceleration", self.graph.name(factor));
            let help = "factors of `ddt(ddt(v))` are functions of coordinates, velocities and time: the state has the combination of accelerations that they make";
            self.problem(span, message, help);
            return None;
        }
        let jerk = self.spread(highest, slopes, jerks);
        let along: Vec<ExprId> = self
            .velocity_symbols()
            .iter()
            .map(|v| self.accelerations[v])
            .map(|s| self.graph.sym(s))
            .collect();
        let combination = self.graph.dot(&jerk, &along);
        let shown = self.graph.display(combination, Style::Plain);
        let shown = if shown.len() <= MAX_SHOWN { format!("`{shown}`, the ") } else { String::new() };
        let own = format!("acceleration_{name}");
        let here = std::mem::replace(&mut self.here, span);
        let (symbol, _) = self.new_symbol(&own, DeclaredAs::CarriedAcceleration);
        self.here = here;
        self.carried_accelerations.push((symbol, own.clone()));
        let doc = format!("{shown}acceleration along constraint `{name}`");
        let carried = CarriedAcceleration { name: own, symbol, offset: self.graph.zero(), doc };
        Some((residual, ConstraintKind::ThirdOrder { jerk, carried }))
    }

    /// What stands for accelerations, where constraints of third order or conditions on displacements mention any.
    pub(super) fn used_accelerations(
        &mut self,
        constraints: &[Constraint],
        conditions: &[VirtualConstraint],
    ) -> Vec<SymbolId> {
        let velocities = self.velocity_symbols();
        let symbols: Vec<SymbolId> =
            velocities.iter().filter_map(|v| self.accelerations.get(v)).copied().collect();
        let all: BTreeSet<SymbolId> = symbols.iter().copied().collect();
        let is_third = |c: &Constraint| matches!(c.kind, ConstraintKind::ThirdOrder { .. });
        let is_used = constraints.iter().any(is_third)
            || conditions.iter().flat_map(|c| &c.one_form).any(|e| self.graph.depends_on(*e, &all));
        if is_used { symbols } else { Vec::new() }
    }

    pub(super) fn check_virtual_constraints(&mut self, constraints: &[Constraint]) -> Vec<VirtualConstraint> {
        if let Some(span) = self.thermo {
            return self.thermo_displacements(constraints, span);
        }
        let velocities = self.velocity_symbols();
        let unknowns: Vec<SymbolId> =
            velocities.iter().filter_map(|v| self.displacements.get(v)).copied().collect();
        let mut result = Vec::new();
        let mut taken = BTreeMap::new();
        let mut n_unnamed = 0;
        for draft in self.virtual_constraints.clone() {
            let span = draft.span;
            for (name, place, e) in self.rows(&draft, "condition", "d", &mut taken, &mut n_unnamed) {
                if self.reports_stray(e, span, &place, &[Special::Displacement, Special::Acceleration]) {
                    continue;
                }
                let occurring = self.occurring(e, &unknowns);
                if occurring.is_empty() {
                    self.problem(
                        span,
                        format!("{place} contains no displacement"),
                        "write the displacement of a velocity `v` as `delta(v)`",
                    );
                    continue;
                }
                let parts = self.graph.affine_parts(e, &occurring);
                let Some((slopes, _)) = parts.filter(|(_, offset)| *offset == self.graph.zero()) else {
                    self.problem(
                        span,
                        format!("{place} is not linear in the displacements"),
                        "every term has one factor `delta(..)`",
                    );
                    continue;
                };
                let mut one_form = self.spread(&occurring, slopes, &unknowns);
                self.scale_by_mode(draft.mode, &mut one_form);
                let (text, mode) = (draft.text.clone(), draft.mode);
                result.push(VirtualConstraint { name, text, one_form, power_of: None, mode, span });
            }
        }
        self.check_pairs_of_modes(constraints, &result);
        result
    }

    pub(super) fn check_independent(&mut self, constraints: &[Constraint]) -> Option<Vec<usize>> {
        let (names, span) = self.independent.clone()?;
        let n_velocities = self.n_shape() + self.velocities.len();
        let mut chosen = Vec::new();
        let before = self.problems.len();
        for (name, span) in names {
            let quasi = self.quasi_velocities.iter().position(|v| v.name == name);
            let indices = match quasi {
                Some(k) => vec![n_velocities + k],
                None => self.velocity_indices(&name),
            };
            if indices.is_empty() {
                self.unknown_velocity(&name, span);
                continue;
            }
            if indices.iter().any(|k| chosen.contains(k)) {
                self.problem(span, format!("`{name}` is named twice"), "name every velocity once");
                continue;
            }
            chosen.extend(indices);
        }
        if self.problems.len() > before {
            return None;
        }
        // Broken constraints are not counted, so the count means nothing then.
        if !self.problems.is_empty() {
            return Some(chosen);
        }
        let of_mode = constraints.iter().find(|c| c.mode.is_some());
        let general = constraints.iter().find(|c| c.kind != ConstraintKind::Linear);
        if let Some(c) = of_mode.or(general) {
            let what = match c.mode {
                Some(_) => "a constraint of a mode",
                None => "a nonlinear or higher-order constraint",
            };
            let problem = Diagnostic::new(span, format!("{what} leaves all velocities in the state"))
                .with_place(c.span, "this one")
                .with_help("remove `independent`");
            self.problems.push(problem);
            return None;
        }
        let all = n_velocities + self.quasi_velocities.len();
        let left = all.saturating_sub(constraints.len());
        // Whether an equation between positions restricts velocities beyond the others is found later.
        let n_open =
            constraints.iter().filter(|c| c.position.is_some_and(|p| p.determines.is_none())).count();
        if !(left..=left + n_open).contains(&chosen.len()) {
            let message = format!("{} independent velocities, the constraints leave {left}", chosen.len());
            let help = format!("velocities: {all}, scalar constraints: {}", constraints.len());
            self.problem(span, message, help);
        }
        for (constraint, k) in constraints.iter().filter_map(|c| Some((c, c.gives?))) {
            if chosen.contains(&k) {
                let message =
                    format!("constraint `{}` gives a velocity that is independent", constraint.text);
                let problem = Diagnostic::new(constraint.span, message)
                    .with_place(span, "named here")
                    .with_help("name another velocity after `for`, or leave `for` out");
                self.problems.push(problem);
            }
        }
        Some(chosen)
    }
}
