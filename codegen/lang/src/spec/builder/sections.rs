//! Sections of the velocities along which momenta are wanted.
//!
//! Does not know: momenta, whether they are conserved.

use std::collections::BTreeSet;

use super::draft::{ModelBuilder, SectionDraft};
use super::symbols::Special;
use crate::algebra::LieAlgebra;
use crate::spec::diagnostic::Span;
use crate::spec::model::*;
use crate::spec::shape::Shape;
use crate::spec::value::Value;
use hamel_expr::{Number, SymbolId};

impl ModelBuilder {
    /// A section `s` of the velocities, by one coefficient for each of them, base velocities first: functions of base
    /// coordinates, advected parameters, time and parameters. The momentum `<p, s> = s^a dL/dy^a` is an output of that
    /// name, and is told to be conserved or not.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder, Value};
    ///
    /// let mut b = ModelBuilder::new("plane");
    /// let (x, u) = b.coordinate("x", Domain::Real, "");
    /// let (y, v) = b.coordinate("y", Domain::Real, "");
    /// let velocity = Value::list(vec![u, v]).unwrap();
    /// let energy = velocity.dot(b.graph(), &velocity).unwrap();
    /// let turning = Value::list(vec![y.neg(b.graph()), x]).unwrap();
    /// let model = b.lagrangian(&energy).section("turning", &turning, "").clone().build().unwrap();
    /// assert_eq!(model.sections[0].coefficients.len(), 2);
    /// ```
    pub fn section(&mut self, name: &str, coefficients: &Value, doc: &str) -> &mut Self {
        let here = self.here;
        self.located_section(name, None, (coefficients, here), doc)
    }

    pub(in crate::spec) fn located_section(
        &mut self,
        name: &str,
        algebra: Option<LieAlgebra<Number>>,
        (value, of_value): (&Value, Option<Span>),
        doc: &str,
    ) -> &mut Self {
        self.output_name(name);
        let (name, value, doc, span) = (name.to_owned(), value.clone(), doc.to_owned(), self.here);
        self.sections.push(SectionDraft { name, algebra, value, doc, span, of_value });
        self
    }

    pub(super) fn check_sections(&mut self) -> Vec<VelocitySection> {
        let declares = ["velocity", "coordinate", "frame", "algebroid"];
        if declares.iter().any(|item| self.broken.contains(item)) {
            return Vec::new();
        }
        let names = self.velocity_names();
        let velocities: BTreeSet<SymbolId> = self.velocity_symbols().into_iter().collect();
        let mut result = Vec::new();
        for SectionDraft { name, algebra, value, doc, span, of_value } in self.sections.clone() {
            let before = match &algebra {
                None => 0,
                Some(algebra) if self.is_own_algebra(algebra) => self.n_shape(),
                Some(algebra) => {
                    let message = format!("section `{name}` has values in {}", algebra.name());
                    let help = "write the algebra of the velocities, or the coefficients of all velocities: \
                                `section s = [..];`";
                    self.problem(of_value, message, help);
                    continue;
                }
            };
            let along = &names[before..];
            let is_number = value.shape() == Shape::Scalar && along.len() == 1;
            if value.shape() != Shape::Vector(along.len()) && !is_number {
                let expected = Shape::Vector(along.len());
                let message = format!("section `{name}` must be {expected}, found {}", value.shape());
                self.problem(
                    of_value,
                    message,
                    format!("it has a coefficient for each of {}", along.join(", ")),
                );
                continue;
            }
            let place = format!("section `{name}`");
            let none: &[Special] = &[];
            if value.entries().iter().any(|e| self.reports_stray(*e, of_value, &place, none)) {
                continue;
            }
            let moving = value.entries().iter().find_map(|e| {
                let free = self.graph.free_symbols(*e);
                free.into_iter().find(|s| velocities.contains(s))
            });
            if let Some(velocity) = moving {
                let message = format!("{place} contains the velocity `{}`", self.graph.name(velocity));
                let help = "its coefficients are functions of base coordinates, advected parameters and time";
                self.problem(of_value, message, help);
                continue;
            }
            let mut coefficients = vec![self.graph.zero(); before];
            coefficients.extend(value.into_entries());
            result.push(VelocitySection { name, coefficients, doc, span });
        }
        result
    }

    /// Whether the velocities of the model, without those of the base, are those of an algebra.
    fn is_own_algebra(&self, algebra: &LieAlgebra<Number>) -> bool {
        let own = self.algebra.as_ref().map(|(own, _)| own);
        !self.has_algebroid() && self.frame.is_none() && own.is_some_and(|own| own == algebra)
    }
}
