//! Lagrangian and forces.
//!
//! Deliberately does not know: constraints, equations of motion.

use super::draft::ModelBuilder;
use crate::expr::ExprId;
use crate::spec::layout::short_list;
use crate::spec::shape::Shape;
use crate::spec::value::Value;

impl ModelBuilder {
    /// The reduced Lagrangian.
    pub fn lagrangian(&mut self, value: &Value) -> &mut Self {
        let here = self.here;
        match &self.lagrangian {
            Some((_, first)) => self.twice("lagrangian", *first),
            None => self.lagrangian = Some((value.clone(), here)),
        }
        self
    }

    /// An external force paired with a velocity (a vector or a component).
    pub fn force(&mut self, velocity: &str, value: &Value) -> &mut Self {
        let here = self.here;
        self.forces.push((velocity.to_owned(), value.clone(), here));
        self
    }

    pub(super) fn check_lagrangian(&mut self) -> ExprId {
        let zero = self.graph.zero();
        let broken = ["velocity", "coordinate"].iter().any(|item| self.broken.contains(item));
        if self.algebra.is_none() && self.base.is_empty() && !broken {
            self.problem(
                self.place,
                format!("model `{}` has no velocity", self.name),
                "declare `velocity Omega in so(3);` or a `coordinate`",
            );
        }
        let Some((value, span)) = self.lagrangian.clone() else {
            if !self.broken.contains("lagrangian") {
                self.problem(
                    self.place,
                    format!("model `{}` has no lagrangian", self.name),
                    "add `lagrangian = ..;`",
                );
            }
            return zero;
        };
        let e = match value.scalar("lagrangian") {
            Ok(e) => e,
            Err(_) => {
                let message = format!("the lagrangian must be a number, found {}", value.shape());
                self.problem(span, message, "use `dot(a, b)` for the pairing of vectors");
                return zero;
            }
        };
        self.reports_stray(e, span, "the lagrangian", &[]);
        let velocities = self.velocity_symbols();
        if !velocities.is_empty()
            && self.occurring(e, &velocities).is_empty()
            && !self.broken.contains("velocity")
        {
            let names = self.velocity_names();
            self.problem(
                span,
                "the lagrangian contains no velocity",
                short_list("the velocities are", &names),
            );
        }
        e
    }

    pub(super) fn check_forces(&mut self) -> Vec<ExprId> {
        let n = self.base.len() + self.velocities.len();
        let mut forces: Vec<Option<ExprId>> = vec![None; n];
        for (name, value, span) in self.forces.clone() {
            let indices = self.velocity_indices(&name);
            if indices.is_empty() {
                self.unknown_velocity(&name, span);
                continue;
            }
            let wanted = self.values.get(&name).map_or(Shape::Scalar, Value::shape);
            if value.shape() != wanted {
                let message = format!("force on `{name}` must be {wanted}, found {}", value.shape());
                self.problem(span, message, "a force pairs with its velocity component by component");
                continue;
            }
            for (k, e) in indices.into_iter().zip(value.into_entries()) {
                if self.reports_stray(e, span, &format!("force on `{name}`"), &[]) {
                    break;
                }
                if forces[k].is_some() {
                    let taken = self.velocity_names()[k].clone();
                    self.problem(span, format!("force on `{taken}` is given twice"), "add them in one item");
                    break;
                }
                forces[k] = Some(e);
            }
        }
        let zero = self.graph.zero();
        forces.into_iter().map(|f| f.unwrap_or(zero)).collect()
    }
}
