//! Connection, quasi-velocities, displacements and accelerations.

use std::collections::{BTreeMap, BTreeSet};

use super::{ConstraintDraft, ModelBuilder, broadcast_zero, short_list};
use crate::expr::{ExprId, SymbolId};
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::parser::MAX_DIM;
use crate::spec::value::{Shape, Value, ValueError};

/// Symbols that only some items may contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Special {
    QuasiVelocity,
    Reconstructed,
    Displacement,
    Acceleration,
}

impl ModelBuilder {
    /// Components of the principal connection along a velocity of the algebra (a vector or a component): the velocity is
    /// `v = xi + A(x, t) xdot` and `value` is `A(x, t) xdot`.
    pub fn connection(&mut self, velocity: &str, value: &Value) -> &mut Self {
        let here = self.here;
        self.connection.push((velocity.to_owned(), value.clone(), here));
        self
    }

    /// Asks for a derived connection: the model is written with the group velocity `xi`, the state holds
    /// `v = xi + A(x, t) xdot`.
    pub fn derived_connection(&mut self, kind: ConnectionKind) -> &mut Self {
        let here = self.here;
        if let Some((_, first)) = self.derived_connection.replace((kind, here)) {
            let place = here.or(first);
            self.problem(place, "the connection is derived twice", "a model has one connection");
        }
        self
    }

    /// A further independent velocity that only parametrises the constraints.
    pub fn quasi_velocity(&mut self, name: &str, doc: &str) -> Value {
        let (symbol, expr) = self.new_symbol(name, "a quasi-velocity");
        if self.quasi_velocities.len() == MAX_DIM {
            let message = format!("the model has more than {MAX_DIM} quasi-velocities");
            self.problem(self.here, message, "one per independent velocity is enough");
        }
        if self.quasi_velocities.len() >= MAX_DIM {
            return Value::Scalar(expr);
        }
        let (name, doc) = (name.to_owned(), doc.to_owned());
        self.quasi_velocities.push(Velocity { block: name.clone(), name, symbol, doc });
        Value::Scalar(expr)
    }

    /// The virtual displacement of a velocity, of the same shape; for [`ModelBuilder::virtual_constraint`].
    ///
    /// # Errors
    /// [`ValueError::NotAVelocity`] unless every entry is a velocity of the base or of the algebra.
    pub fn delta(&mut self, velocity: &Value) -> Result<Value, ValueError> {
        look_up("delta", velocity, &self.displacement_table())
    }

    /// The acceleration that belongs to a velocity, of the same shape; for [`ModelBuilder::constraint`].
    ///
    /// # Errors
    /// [`ValueError::NotAVelocity`] unless every entry is a velocity of the base or of the algebra.
    pub fn ddt(&mut self, velocity: &Value) -> Result<Value, ValueError> {
        look_up("ddt", velocity, &self.acceleration_table())
    }

    pub(in crate::spec) fn displacement_table(&mut self) -> BTreeMap<ExprId, ExprId> {
        let mut symbols = std::mem::take(&mut self.displacements);
        let table = self.derived_table("delta", &mut symbols);
        self.displacements = symbols;
        table
    }

    pub(in crate::spec) fn acceleration_table(&mut self) -> BTreeMap<ExprId, ExprId> {
        let mut symbols = std::mem::take(&mut self.accelerations);
        let table = self.derived_table("ddt", &mut symbols);
        self.accelerations = symbols;
        table
    }

    fn derived_table(
        &mut self,
        function: &str,
        symbols: &mut BTreeMap<SymbolId, SymbolId>,
    ) -> BTreeMap<ExprId, ExprId> {
        let mut table = BTreeMap::new();
        for velocity in self.velocity_symbols() {
            let name = format!("{function}({})", self.graph.name(velocity));
            let derived = *symbols.entry(velocity).or_insert_with(|| self.graph.symbol(&name));
            table.insert(self.graph.sym(velocity), self.graph.sym(derived));
        }
        table
    }

    /// A condition `left = right` on virtual displacements, linear in [`ModelBuilder::delta`]; a vector equation gives one
    /// condition per component. Without any, the displacements are those that the constraints allow.
    ///
    /// ```
    /// use hamel_codegen::algebra::LieAlgebra;
    /// use hamel_codegen::spec::{ModelBuilder, Value};
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
            text: text.to_owned(),
            left: left.clone(),
            right: right.clone(),
            span,
        });
        self
    }

    /// Reports a symbol that has no meaning in `e`; true when there is one.
    pub(super) fn reports_stray(
        &mut self,
        e: ExprId,
        span: Option<Span>,
        place: &str,
        allowed: &[Special],
    ) -> bool {
        let none = self.quasi_velocities.is_empty()
            && self.reconstructions.is_empty()
            && self.displacements.is_empty()
            && self.accelerations.is_empty();
        if none {
            return false;
        }
        let special = |s: &SymbolId| {
            if self.quasi_velocities.iter().any(|v| v.symbol == *s) {
                Some((
                    Special::QuasiVelocity,
                    "the quasi-velocity",
                    "a quasi-velocity only parametrises linear constraints",
                ))
            } else if self.reconstructions.iter().any(|r| r.symbols.contains(s)) {
                Some((
                    Special::Reconstructed,
                    "the reconstructed coordinate",
                    "declare it with `coordinate` when the equations depend on it",
                ))
            } else if self.displacements.values().any(|d| d == s) {
                Some((Special::Displacement, "the displacement", "displacements belong in `virtual`"))
            } else if self.accelerations.values().any(|d| d == s) {
                Some((Special::Acceleration, "the acceleration", "accelerations belong in `constraint`"))
            } else {
                None
            }
        };
        let free = self.graph.free_symbols(e);
        let stray = free.iter().find_map(|s| {
            let (kind, what, help) = special(s)?;
            (!allowed.contains(&kind)).then(|| (self.graph.name(*s).to_owned(), what, help))
        });
        let Some((name, what, help)) = stray else { return false };
        self.problem(span, format!("{place} contains {what} `{name}`"), help);
        true
    }

    pub(super) fn check_named_values(&mut self) {
        let casimirs = self.casimirs.iter().map(|c| (c.name.clone(), c.expr));
        let outputs =
            self.outputs.iter().flat_map(|o| o.components.iter().map(|(_, e)| (o.name.clone(), *e)));
        let values: Vec<(String, ExprId)> = casimirs.chain(outputs).collect();
        for (name, e) in values {
            let span = self.output_names.get(&name).copied().flatten();
            self.reports_stray(e, span, &format!("output `{name}`"), &[Special::QuasiVelocity]);
        }
    }

    /// `A^a_i`, by element of the algebra and base coordinate.
    pub(super) fn check_connection(&mut self) -> Option<Vec<Vec<ExprId>>> {
        let n_base = self.base.len();
        let zero = self.graph.zero();
        let mut rows: Vec<Option<Vec<ExprId>>> = vec![None; self.velocities.len()];
        let items = self.connection.clone();
        if let Some((_, span)) = self.derived_connection {
            if n_base == 0 && !self.broken.contains("coordinate") {
                self.problem(
                    span,
                    "a derived connection without a base has no use",
                    "declare the base with `coordinate`",
                );
            } else if !items.is_empty() {
                self.problem(span, "the connection is both given and derived", "keep one of them");
            }
        }
        for (name, value, span) in &items {
            let indices = self.velocity_indices(name);
            if indices.is_empty() || indices.iter().any(|k| *k < n_base) {
                self.unknown_algebra_velocity(name, *span);
                continue;
            }
            if n_base == 0 && !self.broken.contains("coordinate") {
                self.problem(
                    *span,
                    format!("connection on `{name}` without a base has no use"),
                    "declare the base with `coordinate`",
                );
                continue;
            }
            let Some(value) = self.fitted("connection on", name, value, *span) else { continue };
            for (k, e) in indices.into_iter().zip(value.into_entries()) {
                let Some(row) = self.connection_row(name, e, *span) else { break };
                if rows[k - n_base].replace(row).is_some() {
                    let taken = self.velocities[k - n_base].name.clone();
                    self.problem(
                        *span,
                        format!("connection on `{taken}` is given twice"),
                        "keep one of them",
                    );
                    break;
                }
            }
        }
        if items.is_empty() {
            return None;
        }
        Some(rows.into_iter().map(|row| row.unwrap_or_else(|| vec![zero; n_base])).collect())
    }

    /// The value with the shape of the named velocity or state variable; the number 0 has every shape.
    pub(super) fn fitted(
        &mut self,
        what: &str,
        name: &str,
        value: &Value,
        span: Option<Span>,
    ) -> Option<Value> {
        let target = self.values.get(name)?.clone();
        let (value, _) = broadcast_zero(&mut self.graph, value, &target);
        if value.shape() == target.shape() {
            return Some(value);
        }
        let message = format!("{what} `{name}` must be {}, found {}", target.shape(), value.shape());
        self.problem(span, message, "it has the same components");
        None
    }

    fn connection_row(&mut self, name: &str, e: ExprId, span: Option<Span>) -> Option<Vec<ExprId>> {
        let rates: Vec<SymbolId> = self.base.iter().map(|c| c.velocity).collect();
        let allowed: BTreeSet<SymbolId> = self
            .params
            .iter()
            .map(|p| p.symbol)
            .chain(self.base.iter().flat_map(|c| [c.symbol, c.velocity]))
            .chain([self.time])
            .collect();
        if let Some(wrong) = self.graph.free_symbols(e).iter().find(|s| !allowed.contains(s)) {
            let message = format!("connection on `{name}` contains `{}`", self.graph.name(*wrong));
            self.problem(
                span,
                message,
                "it is made of base velocities, base coordinates, time and parameters",
            );
            return None;
        }
        let occurring = self.occurring(e, &rates);
        let parts = self.graph.affine_parts(e, &occurring);
        let Some((slopes, _)) = parts.filter(|(_, offset)| *offset == self.graph.zero()) else {
            let rates: Vec<String> = self.base.iter().map(|c| c.velocity_name.clone()).collect();
            self.problem(
                span,
                format!("connection on `{name}` is not linear in the base velocities"),
                short_list("the base velocities are", &rates),
            );
            return None;
        };
        Some(self.spread(&occurring, slopes, &rates))
    }

    /// Coefficients of some of the unknowns, with zeros for the others.
    fn spread(&self, occurring: &[SymbolId], slopes: Vec<ExprId>, unknowns: &[SymbolId]) -> Vec<ExprId> {
        let slopes: BTreeMap<SymbolId, ExprId> = occurring.iter().copied().zip(slopes).collect();
        let zero = self.graph.zero();
        unknowns.iter().map(|s| slopes.get(s).copied().unwrap_or(zero)).collect()
    }

    pub(super) fn unknown_algebra_velocity(&mut self, name: &str, span: Option<Span>) {
        if self.broken.contains("velocity") {
            return;
        }
        let known: BTreeSet<&str> =
            self.velocities.iter().flat_map(|v| [v.name.as_str(), v.block.as_str()]).collect();
        let help = names::suggest(name, known);
        self.problem(span, format!("`{name}` is not a velocity of the algebra"), help);
    }

    /// Left minus right of an equation, by component, with names; `prefix` counts the unnamed ones.
    fn rows(
        &mut self,
        draft: &ConstraintDraft,
        what: &str,
        prefix: &str,
        taken: &mut BTreeMap<String, Option<Span>>,
        n_unnamed: &mut usize,
    ) -> Vec<(String, String, ExprId)> {
        let (left, right) = broadcast_zero(&mut self.graph, &draft.left, &draft.right);
        let Ok(residual) = left.sub(&mut self.graph, &right) else {
            let (left, right) = (draft.left.shape(), draft.right.shape());
            self.value_error(draft.span, &ValueError::Shapes { operation: "equate", left, right });
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
                self.problem(draft.span, format!("{place} always holds"), "remove it");
                continue;
            }
            rows.push((name, place, *e));
        }
        rows
    }

    pub(super) fn check_constraints(&mut self) -> Vec<Constraint> {
        let mut result = Vec::new();
        let mut taken = BTreeMap::new();
        let mut n_unnamed = 0;
        for draft in self.constraints.clone() {
            for (name, place, e) in self.rows(&draft, "constraint", "c", &mut taken, &mut n_unnamed) {
                if let Some((residual, kind)) = self.classify(e, &place, draft.span) {
                    let (text, span) = (draft.text.clone(), draft.span);
                    result.push(Constraint { name, text, kind, residual, span });
                }
            }
        }
        result
    }

    /// The part without accelerations and the kind.
    fn classify(&mut self, e: ExprId, place: &str, span: Option<Span>) -> Option<(ExprId, ConstraintKind)> {
        let special = [Special::QuasiVelocity, Special::Acceleration];
        if self.reports_stray(e, span, place, &special) {
            return None;
        }
        let velocities = self.velocity_symbols();
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
            return Some((residual, ConstraintKind::SecondOrder { acceleration }));
        }
        let unknowns: Vec<SymbolId> =
            velocities.into_iter().chain(self.quasi_velocities.iter().map(|v| v.symbol)).collect();
        let occurring = self.occurring(e, &unknowns);
        match self.graph.affine_parts(e, &occurring) {
            Some((slopes, _)) if slopes.iter().all(|s| *s == self.graph.zero()) => {
                if !self.broken.contains("velocity") {
                    self.problem(
                        span,
                        format!("{place} contains no velocity"),
                        "choose coordinates that satisfy it, or write its time derivative",
                    );
                }
                None
            }
            Some(_) => Some((e, ConstraintKind::Linear)),
            None if self.reports_stray(e, span, &format!("nonlinear {place}"), &[]) => None,
            None => Some((e, ConstraintKind::Nonlinear)),
        }
    }

    pub(super) fn check_virtual_constraints(&mut self) -> Vec<VirtualConstraint> {
        let velocities = self.velocity_symbols();
        let unknowns: Vec<SymbolId> =
            velocities.iter().filter_map(|v| self.displacements.get(v)).copied().collect();
        let mut result = Vec::new();
        let mut taken = BTreeMap::new();
        let mut n_unnamed = 0;
        for draft in self.virtual_constraints.clone() {
            let span = draft.span;
            for (name, place, e) in self.rows(&draft, "condition", "d", &mut taken, &mut n_unnamed) {
                if self.reports_stray(e, span, &place, &[Special::Displacement]) {
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
                let one_form = self.spread(&occurring, slopes, &unknowns);
                result.push(VirtualConstraint { name, text: draft.text.clone(), one_form, span });
            }
        }
        result
    }

    pub(super) fn check_independent(&mut self, constraints: &[Constraint]) -> Option<Vec<usize>> {
        let (names, span) = self.independent.clone()?;
        let n_velocities = self.base.len() + self.velocities.len();
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
        if let Some(c) = constraints.iter().find(|c| c.kind != ConstraintKind::Linear) {
            let problem = Diagnostic::new(
                span,
                "a nonlinear or second-order constraint leaves all velocities in the state",
            )
            .with_place(c.span, "this one")
            .with_help("remove `independent`");
            self.problems.push(problem);
            return None;
        }
        let all = n_velocities + self.quasi_velocities.len();
        let left = all.saturating_sub(constraints.len());
        if chosen.len() != left {
            let message = format!("{} independent velocities, the constraints leave {left}", chosen.len());
            let help = format!("velocities: {all}, scalar constraints: {}", constraints.len());
            self.problem(span, message, help);
        }
        Some(chosen)
    }
}

/// The image of a value whose entries are all in the table.
pub(in crate::spec) fn look_up(
    function: &'static str,
    value: &Value,
    table: &BTreeMap<ExprId, ExprId>,
) -> Result<Value, ValueError> {
    if value.entries().iter().any(|e| !table.contains_key(e)) {
        return Err(ValueError::NotAVelocity { function });
    }
    Ok(value.map(|e| table.get(&e).copied().unwrap_or(e)))
}
