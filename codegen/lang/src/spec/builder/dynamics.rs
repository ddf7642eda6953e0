//! Lagrangian and forces.
//!
//! Deliberately does not know: constraints, equations of motion.

use std::collections::BTreeSet;

use super::draft::ModelBuilder;
use super::symbols::Special;
use crate::spec::diagnostic::Diagnostic;
use crate::spec::layout::short_list;
use crate::spec::shape::Shape;
use crate::spec::value::Value;
use hamel_expr::ExprId;

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

    /// The Hamiltonian in the place of a Lagrangian, in the momenta of all velocities.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("body");
    /// b.velocities(LieAlgebra::so(3).unwrap(), &["Omega"]);
    /// let pi = b.momentum("Pi", "Omega", "").unwrap();
    /// let h = pi.dot(b.graph(), &pi).unwrap();
    /// b.hamiltonian(&h);
    /// assert!(b.build().unwrap().hamiltonian.is_some());
    /// ```
    pub fn hamiltonian(&mut self, value: &Value) -> &mut Self {
        let here = self.here;
        match &self.hamiltonian {
            Some((_, first)) => self.twice("hamiltonian", *first),
            None => self.hamiltonian = Some((value.clone(), here)),
        }
        self
    }

    /// An external force paired with a velocity (a vector or a component).
    pub fn force(&mut self, velocity: &str, value: &Value) -> &mut Self {
        let here = self.here;
        let value = self.while_on(value);
        self.forces.push((velocity.to_owned(), value, here));
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
            if !self.broken.contains("lagrangian")
                && !self.broken.contains("hamiltonian")
                && self.hamiltonian.is_none()
                && !self.is_given()
                && !self.is_part
            {
                self.problem(
                    self.place,
                    format!("model `{}` has no lagrangian", self.name),
                    "add `lagrangian = ..;`, or `hamiltonian = ..;` in momenta",
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
        let e = self.simple_in_frame(e);
        let e = self.simple_on_groups(e);
        self.reports_stray(e, span, "the lagrangian", &[]);
        let velocities = self.velocity_symbols();
        // Constraints that determine every velocity leave nothing to be derived, as for a swimmer without inertia.
        if !self.is_part
            && self.n_constraints() < velocities.len()
            && self.occurring(e, &velocities).is_empty()
            && !self.broken.contains("velocity")
            && !self.broken.contains("constraint")
        {
            let names = self.velocity_names();
            let known = short_list("the velocities are", &names);
            let help =
                format!("{known}; without inertia as many constraints as velocities determine the motion");
            self.problem(span, "the lagrangian contains no velocity", help);
        }
        e
    }

    pub(super) fn check_hamiltonian(&mut self) -> Option<ExprId> {
        let (value, span) = self.hamiltonian.clone()?;
        if let Some((_, first)) = &self.lagrangian {
            let problem = Diagnostic::new(span, "the model has a lagrangian and a hamiltonian")
                .with_place(*first, "the lagrangian")
                .with_help("keep one of them; `carry` gives the momenta of a lagrangian");
            self.problems.push(problem);
            return None;
        }
        let Ok(e) = value.scalar("hamiltonian") else {
            let message = format!("the hamiltonian must be a number, found {}", value.shape());
            self.problem(span, message, "use `dot(a, b)` for the pairing of vectors");
            return None;
        };
        self.reports_stray(e, span, "the hamiltonian", &[Special::Momentum]);
        let velocities = self.velocity_symbols();
        if let Some(velocity) = self.occurring(e, &velocities).first() {
            let message = format!("the hamiltonian contains the velocity `{}`", self.graph.name(*velocity));
            self.problem(span, message, "it is a function of momenta: `momentum Pi of Omega;`");
        }
        if let Some(velocity) = self.quasi_velocities.first().map(|v| v.name.clone()) {
            let message = format!("a hamiltonian has no use for the quasi-velocity `{velocity}`");
            self.problem(span, message, "write the constraint as an equation in velocities");
        }
        if let Some((_, at)) = self.derived_connection {
            let message = "a connection is derived from a lagrangian, and the model has a hamiltonian";
            self.problem(at, message, "write the connection down: `connection v = A*x_dot;`");
        }
        if !self.broken.contains("momentum") && !self.broken.contains("velocity") {
            for (k, name) in self.velocity_names().into_iter().enumerate() {
                if !self.momenta.iter().any(|m| m.components.iter().any(|(.., velocity)| *velocity == k)) {
                    let message = format!("the hamiltonian needs the momentum of `{name}`");
                    self.problem(span, message, format!("declare it: `momentum p_{name} of {name};`"));
                }
            }
        }
        Some(e)
    }

    pub(super) fn check_forces(&mut self) -> Vec<ExprId> {
        let velocities = self.velocity_symbols();
        let mut forces: Vec<Option<ExprId>> = vec![None; velocities.len()];
        let mut added = vec![self.graph.zero(); velocities.len()];
        let mut replaced: BTreeSet<String> = BTreeSet::new();
        for (name, value, span) in self.forces.clone() {
            let indices = self.velocity_indices(&name);
            let image = self.value_of_replaced(&name).filter(|_| indices.is_empty());
            if indices.is_empty() && image.is_none() {
                self.unknown_velocity(&name, span);
                continue;
            }
            let wanted = self.values.get(&name).map_or(Shape::Scalar, Value::shape);
            if value.shape() != wanted {
                let message = format!("force on `{name}` must be {wanted}, found {}", value.shape());
                self.problem(span, message, "a force pairs with its velocity component by component");
                continue;
            }
            let allowed: &[Special] = if self.hamiltonian.is_some() { &[Special::Momentum] } else { &[] };
            if let Some(image) = image {
                if !replaced.insert(name.clone()) {
                    self.problem(span, format!("force on `{name}` is given twice"), "add them in one item");
                    continue;
                }
                for (velocity, e) in image.into_iter().zip(value.into_entries()) {
                    if self.reports_stray(e, span, &format!("force on `{name}`"), allowed) {
                        break;
                    }
                    // F . v = F . (dv/dy) y for a velocity v that is a combination of the model's.
                    for (sum, y) in added.iter_mut().zip(&velocities) {
                        let slope = self.graph.diff(velocity, *y);
                        let along = self.graph.mul(e, slope);
                        *sum = self.graph.add(*sum, along);
                    }
                }
                continue;
            }
            for (k, e) in indices.into_iter().zip(value.into_entries()) {
                if self.reports_stray(e, span, &format!("force on `{name}`"), allowed) {
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
        self.add_applied(&mut added);
        let zero = self.graph.zero();
        let pairs = forces.into_iter().zip(added);
        pairs.map(|(force, added)| self.graph.add(force.unwrap_or(zero), added)).collect()
    }
}
