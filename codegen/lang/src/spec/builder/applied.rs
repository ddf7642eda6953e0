//! Forces at places and along velocities, as forces on the velocities of the model.
//!
//! Deliberately does not know: text, constraints, equations of motion.

use std::collections::BTreeSet;

use super::draft::{AppliedForce, ModelBuilder};
use super::symbols::Special;
use crate::spec::diagnostic::Diagnostic;
use crate::spec::rates::{Rates, rate_of};
use crate::spec::value::Value;
use hamel_expr::{ExprId, SymbolId};

impl ModelBuilder {
    /// A force along a velocity `u` that is linear in the velocities `y` of the model, such as that of a place of a
    /// body in any frame, or its angular velocity for a moment: its power is `F . u`, so that the force on `y^a` has
    /// the term
    /// `F . du/dy^a`. There may be several, beside those of [`ModelBuilder::force`].
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("slide");
    /// let (_, rate) = b.coordinate("x", Domain::Real, "");
    /// let energy = rate.mul(b.graph(), &rate).unwrap();
    /// let friction = rate.neg(b.graph());
    /// b.lagrangian(&energy).force_along(&rate, &friction);
    /// let model = b.build().unwrap();
    /// assert!(!model.graph.free_symbols(model.forces[0]).is_empty());
    /// ```
    pub fn force_along(&mut self, velocity: &Value, force: &Value) -> &mut Self {
        let span = self.here;
        let force = self.while_on(force);
        self.applied.push(AppliedForce { velocity: velocity.clone(), force, span });
        self
    }

    /// A force at a place, or with any function of coordinates, time and parameters in its stead: along the rate of it.
    pub fn force_at(&mut self, place: &Value, force: &Value) -> &mut Self {
        let span = self.here;
        match self.rate(place) {
            Ok(velocity) => {
                let force = self.while_on(force);
                self.applied.push(AppliedForce { velocity, force, span });
            }
            Err(symbol) => {
                let name = self.graph.name(symbol).to_owned();
                let message = format!("the place of the force contains `{name}`, whose rate is not known");
                let help = "a place is made of coordinates; `force along` takes the velocity of any place";
                self.problem(span, message, help);
            }
        }
        self
    }

    /// The rate of a value that is made of coordinates, time and parameters.
    ///
    /// # Errors
    /// The first symbol in it that is none of these.
    pub fn rate(&mut self, value: &Value) -> Result<Value, SymbolId> {
        let rates = self.rates();
        let entries: Result<Vec<ExprId>, SymbolId> =
            value.entries().iter().map(|e| rate_of(&mut self.graph, *e, &rates)).collect();
        Ok(value.with_entries(entries?))
    }

    /// Rates of coordinates and configurations by the velocities of the model, of the time, and of parameters.
    pub(in crate::spec) fn rates(&mut self) -> Rates {
        let (zero, one) = (self.graph.zero(), self.graph.one());
        let mut rates = Rates::from([(self.time, one)]);
        rates.extend(self.params.iter().map(|param| (param.symbol, zero)));
        let coordinates: Vec<SymbolId> = self.base.iter().map(|c| c.symbol).collect();
        rates.extend(coordinates.into_iter().zip(self.coordinate_rates()));
        self.add_configuration_rates(&mut rates);
        rates
    }

    /// Adds what the forces along velocities are on those of the model.
    pub(super) fn add_applied(&mut self, sums: &mut [ExprId]) {
        let velocities = self.velocity_symbols();
        let own: BTreeSet<SymbolId> = velocities.iter().copied().collect();
        let allowed: &[Special] = if self.hamiltonian.is_some() { &[Special::Momentum] } else { &[] };
        for AppliedForce { velocity, force, span } in self.applied.clone() {
            if velocity.shape() != force.shape() {
                let message = format!("the force must be {}, found {}", velocity.shape(), force.shape());
                self.problem(span, message, "a force pairs with its velocity component by component");
                continue;
            }
            for (u, f) in velocity.into_entries().into_iter().zip(force.into_entries()) {
                if self.reports_stray(f, span, "the force", allowed)
                    || self.reports_stray(u, span, "the velocity of the force", &[])
                {
                    break;
                }
                let slopes: Vec<ExprId> = velocities.iter().map(|y| self.graph.diff(u, *y)).collect();
                let curved = |e: &ExprId| !self.graph.free_symbols(*e).is_disjoint(&own);
                if slopes.iter().any(curved) {
                    let problem =
                        Diagnostic::new(span, "the velocity of the force is not linear in velocities");
                    self.problems
                        .push(problem.with_help("write `force at p: F` with a place, or its velocity"));
                    break;
                }
                for (sum, slope) in sums.iter_mut().zip(slopes) {
                    let along = self.graph.mul(f, slope);
                    *sum = self.graph.add(*sum, along);
                }
            }
        }
    }
}
