//! The principal connection, given by components or derived.
//!
//! Deliberately does not know: curvature, how a connection is derived.

use std::collections::{BTreeMap, BTreeSet};

use super::draft::ModelBuilder;
use crate::spec::diagnostic::Span;
use crate::spec::layout::short_list;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::value::Value;
use crate::spec::want::Want;
use hamel_expr::{ExprId, SymbolId};

impl ModelBuilder {
    /// Components of the principal connection along a velocity of the algebra (a vector or a component): the velocity
    /// is `v = xi + A(x, t) xdot` and `value` is `A(x, t) xdot`.
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

    /// A scene that wants the connection of a model that has none.
    pub(super) fn wants_no_connection(&mut self, scene: &str, want: &str, span: Option<Span>) -> bool {
        let items = ["connection", "velocity", "coordinate", "field", "constraint"];
        if want != Want::Connection.name() || items.iter().any(|item| self.broken.contains(item)) {
            return false;
        }
        let is_kinematic = !self.given.is_empty() && self.n_constraints() > 0;
        let (has_bundle, has_connection) = (
            self.n_shape() > 0 && !self.velocities.is_empty(),
            !self.connection.is_empty() || self.derived_connection.is_some() || is_kinematic,
        );
        if has_bundle && has_connection {
            return false;
        }
        let message = format!("scene `{scene}` wants `connection`, and the model has none");
        let help = match has_bundle {
            true => "write `connection mechanical;` or `connection nonholonomic;`, or one by its components",
            false => "it takes coordinates of the base and velocities of an algebra",
        };
        self.problem(span, message, help);
        true
    }

    /// `A^a_i`, by element of the algebra and base coordinate.
    pub(super) fn check_connection(&mut self) -> Option<Vec<Vec<ExprId>>> {
        let n_base = self.n_shape();
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
            let indices = self.original_indices(name);
            if indices.is_empty() {
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
                if rows[k].replace(row).is_some() {
                    let taken = self.original_velocities()[k].name.clone();
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
        let (value, _) = Value::fit_zero(&self.graph, value, &target);
        if value.shape() == target.shape() {
            return Some(value);
        }
        let message = format!("{what} `{name}` must be {}, found {}", target.shape(), value.shape());
        self.problem(span, message, "it has the same components");
        None
    }

    pub(super) fn connection_row(
        &mut self,
        name: &str,
        e: ExprId,
        span: Option<Span>,
    ) -> Option<Vec<ExprId>> {
        let e = self.in_original(e);
        let rates: Vec<SymbolId> = self.original_symbols()[..self.n_shape()].to_vec();
        let allowed: BTreeSet<SymbolId> = self
            .params
            .iter()
            .map(|p| p.symbol)
            .chain(self.base.iter().map(|c| c.symbol))
            .chain(rates.iter().copied())
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
            let rates: Vec<String> = rates.iter().map(|s| self.graph.name(*s).to_owned()).collect();
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
    pub(super) fn spread(
        &self,
        occurring: &[SymbolId],
        slopes: Vec<ExprId>,
        unknowns: &[SymbolId],
    ) -> Vec<ExprId> {
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
}
