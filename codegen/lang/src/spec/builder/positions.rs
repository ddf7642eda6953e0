//! Equations between coordinates: constraints without velocities, and what coordinates are given by.
//!
//! Such an equation `f(x, a, t) = 0` is the linear constraint `df/dt = 0` on velocities together with itself, which
//! initial values have to satisfy and a motion keeps.
//!
//! Deliberately does not know: how constraints are solved, who keeps the equations, how text is read.

use std::collections::BTreeMap;

use super::draft::{ConstraintDraft, ModelBuilder};
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::model::*;
use crate::spec::shape::{Operation, ValueError};
use crate::spec::value::Value;
use hamel_expr::{ExprId, SymbolId};

impl ModelBuilder {
    /// Coordinates that are given by equations `left = right` between coordinates, as many as they have components.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder, Value};
    ///
    /// // A ladder: its foot x and its top y at the length one.
    /// let mut b = ModelBuilder::new("ladder");
    /// let (x, x_dot) = b.coordinate("x", Domain::Real, "");
    /// let (y, _) = b.coordinate("y", Domain::Real, "");
    /// let square = x.mul(b.graph(), &x).unwrap();
    /// let other = y.mul(b.graph(), &y).unwrap();
    /// let length = square.add(b.graph(), &other).unwrap();
    /// let energy = x_dot.mul(b.graph(), &x_dot).unwrap();
    /// let one = Value::Scalar(b.graph().one());
    /// b.determined(&["y"], "x^2 + y^2 = 1", &length, &one).lagrangian(&energy);
    /// let model = b.build().unwrap();
    /// assert_eq!(model.constraints[0].position.unwrap().determines, Some(1));
    /// ```
    pub fn determined(&mut self, names: &[&str], text: &str, left: &Value, right: &Value) -> &mut Self {
        let span = self.here;
        let (text, left, right) = (text.to_owned(), left.clone(), right.clone());
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        self.determined.push((
            names,
            ConstraintDraft { name: None, gives: Vec::new(), text, left, right, mode: None, span },
        ));
        self
    }

    /// The constraints that follow from what coordinates are given by, named after them.
    pub(super) fn check_determined(&mut self, rates: &BTreeMap<SymbolId, ExprId>) -> Vec<Constraint> {
        let mut result = Vec::new();
        for (names, draft) in std::mem::take(&mut self.determined) {
            let ConstraintDraft { text, left, right, span, .. } = draft;
            let coordinates: Vec<usize> = names.iter().flat_map(|name| self.coordinates_of(name)).collect();
            if coordinates.is_empty() {
                continue;
            }
            let (left, right) = Value::fit_zero(&self.graph, &left, &right);
            let Ok(residual) = left.sub(&mut self.graph, &right) else {
                let (left, right) = (left.shape(), right.shape());
                self.value_error(span, &ValueError::Shapes { operation: Operation::Equate, left, right });
                continue;
            };
            let (n, n_equations) = (coordinates.len(), residual.entries().len());
            if n != n_equations {
                let counted = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
                let message =
                    format!("{} for {}", counted(n_equations, "equation"), counted(n, "coordinate"));
                self.problem(
                    span,
                    message,
                    "give as many equations as coordinates, as a list `[f, g] = [0, 0]`",
                );
                continue;
            }
            for (k, (coordinate, e)) in coordinates.iter().zip(residual.entries().to_vec()).enumerate() {
                let component = if n > 1 { format!("component {} of ", k + 1) } else { String::new() };
                let place = format!("{component}equation `{text}`");
                if !self.is_of_positions(e, &place, span) {
                    continue;
                }
                // A frame may have another velocity in its place.
                let Coordinate { name, velocity_name, .. } = &self.base[*coordinate];
                let is_own = self.algebroid.is_none() && *velocity_name == format!("{name}_dot");
                let position =
                    PositionEquation { residual: e, determines: Some(*coordinate).filter(|_| is_own) };
                let (name, text) = (name.clone(), text.clone());
                let residual = self.along(e, rates);
                if self.reports_rigid(residual, &place, span) {
                    continue;
                }
                let kind = ConstraintKind::Linear;
                let position = Some(position);
                let (gives, mode) = (None, None);
                result.push(Constraint { name, text, kind, residual, position, gives, mode, span });
            }
        }
        result
    }

    /// Whether an equation is one between coordinates and advected parameters; says what is wrong where it is not.
    fn is_of_positions(&mut self, e: ExprId, place: &str, span: Option<Span>) -> bool {
        if self.graph.is_zero(e) {
            self.problem(span, format!("{place} always holds"), "remove it");
            return false;
        }
        if self.reports_stray(e, span, place, &[]) || self.reports_first_order(e, place, span) {
            return false;
        }
        if let Some(velocity) = self.velocity_symbols().into_iter().find(|v| self.mentions(e, *v)) {
            let message = format!("{place} contains the velocity `{}`", self.graph.name(velocity));
            self.problem(
                span,
                message,
                "a coordinate is given by coordinates; restrict velocities by `constraint`",
            );
            return false;
        }
        self.has_positions(e) || {
            self.problem(
                span,
                format!("{place} contains no coordinate"),
                "write it in the coordinate it gives",
            );
            false
        }
    }

    /// Whether coordinates or advected parameters are in an expression.
    pub(super) fn has_positions(&self, e: ExprId) -> bool {
        let base = self.base.iter().map(|c| c.symbol);
        let advected = self.advected.iter().flat_map(|a| a.components.iter().map(|(_, symbol)| *symbol));
        base.chain(advected).any(|symbol| self.mentions(e, symbol))
    }

    /// An equation whose derivative vanishes restricts no motion.
    pub(super) fn reports_rigid(&mut self, rate: ExprId, place: &str, span: Option<Span>) -> bool {
        let is_rigid = self.graph.is_zero(rate);
        if is_rigid {
            let message =
                format!("{place} restricts no velocity: the motion keeps both sides apart as they are");
            self.problem(span, message, "remove it, and choose initial values that satisfy it");
        }
        is_rigid
    }

    fn mentions(&self, e: ExprId, symbol: SymbolId) -> bool {
        self.graph.free_symbols(e).contains(&symbol)
    }

    /// Rates of coordinates and advected parameters by the velocities of the model:
    /// `xdot` by the anchor, `adot = -xi . a` with `xi = v - A(x, t) xdot` (the other sign for a right action).
    pub(super) fn rates_of_positions(
        &mut self,
        advected: &[Advected],
        connection: Option<&[Vec<ExprId>]>,
    ) -> BTreeMap<SymbolId, ExprId> {
        let n_shape = self.n_shape();
        let mut rates = BTreeMap::new();
        let mut shape = Vec::with_capacity(n_shape);
        for i in 0..self.base.len() {
            let rate = if i < n_shape {
                self.velocity_value(i)
            } else {
                match self.values.get(&self.base[i].velocity_name) {
                    Some(Value::Scalar(e)) => *e,
                    _ => continue,
                }
            };
            shape.push(rate);
            rates.insert(self.base[i].symbol, rate);
        }
        let fibre = self.original_symbols()[n_shape..].to_vec();
        let mut group: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
        for (a, symbol) in fibre.into_iter().enumerate() {
            let mut value = self.velocity_value(n_shape + a);
            if let Some(rows) = connection {
                let along = self.graph.dot(&rows[a], &shape);
                value = self.graph.sub(value, along);
            }
            group.insert(symbol, value);
        }
        let is_left = self.action.is_none_or(|(side, _)| side == Side::Left);
        for (moved, action) in advected.iter().flat_map(|a| a.components.iter().zip(&a.action)) {
            // What is linear in velocities divides by none of them.
            let Ok(rate) = self.graph.subs(*action, &group) else { continue };
            let rate = if is_left { self.graph.neg(rate) } else { rate };
            rates.insert(moved.1, rate);
        }
        rates
    }

    /// The derivative `df/dt + df/dx^i xdot^i + df/da . adot`.
    pub(super) fn along(&mut self, f: ExprId, rates: &BTreeMap<SymbolId, ExprId>) -> ExprId {
        let mut terms = vec![self.graph.diff(f, self.time)];
        for (symbol, rate) in rates {
            let slope = self.graph.diff(f, *symbol);
            terms.push(self.graph.mul(slope, *rate));
        }
        let sum = self.graph.sum(&terms);
        let sum = self.graph.cancel_zero(sum);
        self.simple_in_frame(sum)
    }

    /// Base coordinates of that name, a component or a vector.
    fn coordinates_of(&self, name: &str) -> Vec<usize> {
        match self.values.get(name) {
            Some(value) => {
                let at = |e: &ExprId| self.base.iter().position(|c| self.is_symbol(*e, c.symbol));
                value.entries().iter().filter_map(at).collect()
            }
            None => Vec::new(),
        }
    }

    /// Names of constraints that are those of coordinates given by equations.
    pub(super) fn reports_taken(&mut self, given: &[Constraint], taken: &BTreeMap<String, Option<Span>>) {
        for constraint in given {
            let Some(first) = taken.get(&constraint.name) else { continue };
            let message = format!("constraint `{}` is declared twice", constraint.name);
            let problem = Diagnostic::new(*first, message)
                .with_place(constraint.span, "the equation that gives the coordinate of this name")
                .with_help("rename the constraint");
            self.problems.push(problem);
        }
    }
}
