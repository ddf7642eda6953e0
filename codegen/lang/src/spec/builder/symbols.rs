//! Symbols that only some items may contain: quasi-velocities, displacements, accelerations.
//!
//! Deliberately does not know: what the items with these symbols mean.

use std::collections::BTreeMap;

use super::draft::{DeclaredAs, ModelBuilder};
use crate::spec::diagnostic::Span;
use crate::spec::limits::MAX_DIM;
use crate::spec::model::*;
use crate::spec::shape::ValueError;
use crate::spec::value::Value;
use hamel_expr::{ExprId, SymbolId};

/// Symbols that only some items may contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Special {
    QuasiVelocity,
    Momentum,
    Reconstructed,
    Displacement,
    Acceleration,
    Jerk,
    Multiplier,
    Feedback,
}

impl ModelBuilder {
    /// A further independent velocity that only parametrises the constraints.
    pub fn quasi_velocity(&mut self, name: &str, doc: &str) -> Value {
        let (symbol, expr) = self.new_symbol(name, DeclaredAs::QuasiVelocity);
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
        velocity.image("delta", &self.displacement_table())
    }

    /// The acceleration that belongs to a velocity, or the rate of an acceleration, of the same shape; for
    /// [`ModelBuilder::constraint`] and, as far as accelerations, coefficients in [`ModelBuilder::virtual_constraint`].
    ///
    /// # Errors
    /// [`ValueError::NotAVelocity`] unless every entry is a velocity of the base or of the algebra or an acceleration,
    /// [`ValueError::OrderTooHigh`] for the rate of an acceleration.
    pub fn ddt(&mut self, velocity: &Value) -> Result<Value, ValueError> {
        let mut table = self.acceleration_table();
        let is_acceleration = |e: &ExprId| table.values().any(|image| image == e);
        if !self.jerks.is_empty() || velocity.entries().iter().any(is_acceleration) {
            table = self.jerk_table();
        }
        velocity.image("ddt", &table)
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

    /// [`ModelBuilder::acceleration_table`] and, for accelerations, their rates.
    pub(in crate::spec) fn jerk_table(&mut self) -> BTreeMap<ExprId, ExprId> {
        let mut table = self.acceleration_table();
        let mut rates = BTreeMap::from([(self.time, self.graph.one())]);
        let coordinates: Vec<SymbolId> = self.base.iter().map(|c| c.symbol).collect();
        rates.extend(coordinates.into_iter().zip(self.coordinate_rates()));
        for velocity in self.velocity_symbols() {
            let acceleration = self.accelerations[&velocity];
            let name = format!("ddt(ddt({}))", self.graph.name(velocity));
            let jerk = *self.jerks.entry(velocity).or_insert_with(|| self.graph.symbol(&name));
            rates.insert(velocity, self.graph.sym(acceleration));
            rates.insert(acceleration, self.graph.sym(jerk));
        }
        let accelerations: Vec<ExprId> = table.values().copied().collect();
        for e in accelerations {
            let rate = self.graph.derivative_along(e, &rates);
            table.entry(e).or_insert(rate);
        }
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
        // Velocities that a frame replaces, and rates that an anchor gives, are combinations of these.
        let rates = self.coordinate_rates();
        for e in self.images.clone() {
            let mut terms = Vec::new();
            for velocity in self.velocity_symbols() {
                let (slope, derived) = (self.graph.diff(e, velocity), self.graph.sym(symbols[&velocity]));
                terms.push(self.graph.mul(slope, derived));
            }
            if function == "ddt" {
                terms.push(self.graph.diff(e, self.time));
                for (i, rate) in rates.iter().enumerate() {
                    let slope = self.graph.diff(e, self.base[i].symbol);
                    terms.push(self.graph.mul(slope, *rate));
                }
            }
            let image = self.graph.sum(&terms);
            table.entry(e).or_insert(image);
        }
        table
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
            && self.momenta.is_empty()
            && self.reconstructions.is_empty()
            && self.displacements.is_empty()
            && self.accelerations.is_empty()
            && self.multiplier_symbols.is_empty()
            && !self.has_feedback();
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
            } else if self.momenta.iter().any(|m| m.components.iter().any(|(_, own, _)| own == s)) {
                Some((
                    Special::Momentum,
                    "the momentum",
                    "write it in the velocities; momenta belong in outputs, casimirs and a hamiltonian",
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
            } else if self.jerks.values().any(|d| d == s) {
                Some((Special::Jerk, "the rate of an acceleration", "it belongs in `constraint`"))
            } else if self.of_feedback(*s) {
                let help = "forces of actuators and what a Lyapunov function has from them belong in outputs, \
                            events and the rate of the function";
                Some((Special::Feedback, "the force or response", help))
            } else if self.multiplier_symbols.iter().any(|(_, own)| own == s) {
                Some((Special::Multiplier, "the multiplier", "multipliers belong in functions of events"))
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
        const OF_CASIMIR: &[Special] = &[Special::QuasiVelocity, Special::Momentum];
        const OF_OUTPUT: &[Special] = &[Special::QuasiVelocity, Special::Momentum, Special::Feedback];
        let casimirs = self.casimirs.iter().map(|c| (c.name.clone(), c.expr, OF_CASIMIR));
        let outputs = self
            .outputs
            .iter()
            .flat_map(|o| o.components.iter().map(|(_, e)| (o.name.clone(), *e, OF_OUTPUT)));
        let values: Vec<(String, ExprId, &[Special])> = casimirs.chain(outputs).collect();
        for (name, e, allowed) in values {
            let span = self.output_names.get(&name).copied().flatten();
            self.reports_stray(e, span, &format!("output `{name}`"), allowed);
        }
    }
}
