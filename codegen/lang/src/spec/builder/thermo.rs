//! Virtual displacements of thermodynamic type: each constraint as a power, with displacements in the place of
//! velocities.
//!
//! A constraint `phi(x, y) = A_a(x, y) y^a + b(x) = 0` says what becomes of a power, `b` being power from outside. Its
//! displacements are `A_a(x, y) delta^a = 0`. A term of degree `k` in the velocities is `1/k` of its derivative along
//! them (Euler), so that `A` is the sum of `1/k dphi_k/dy` over the parts of degree `k`: `T S' = lambda x'^2` gives
//! `T delta S = lambda x' delta x`.
//!
//! Deliberately does not know: which coordinates are entropies.
//!
//! # Source
//! Gay-Balmaz, Yoshimura 2017, A Lagrangian variational formulation for nonequilibrium thermodynamics I, section 3.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Rational, Style, SymbolId, rational_relations};
use num_traits::Zero;

use super::draft::ModelBuilder;
use crate::spec::diagnostic::Span;
use crate::spec::model::{Constraint, ConstraintKind, VirtualConstraint};

impl ModelBuilder {
    /// Virtual displacements of thermodynamic type, `A(x, y) delta = 0` for each constraint
    /// `A(x, y) y + b(x) = 0` between velocities, whose terms are homogeneous in them.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("heated");
    /// let (_, v) = b.coordinate("x", Domain::Real, "");
    /// let (s, rate) = b.coordinate("S", Domain::Real, "");
    /// let square = v.mul(b.graph(), &v).unwrap();
    /// let energy = square.sub(b.graph(), &s).unwrap();
    /// b.lagrangian(&energy).constraint(None, "S_dot = x_dot^2", &rate, &square).virtual_thermo();
    /// assert_eq!(b.build().unwrap().virtual_constraints[0].text, "delta(S_dot) - x_dot*delta(x_dot) = 0");
    /// ```
    pub fn virtual_thermo(&mut self) -> &mut Self {
        let here = self.here;
        match self.thermo {
            Some(first) => self.twice("virtual thermo", first),
            None => self.thermo = Some(here),
        }
        self
    }

    /// The displacements of [`ModelBuilder::virtual_thermo`].
    pub(super) fn thermo_displacements(
        &mut self,
        constraints: &[Constraint],
        span: Option<Span>,
    ) -> Vec<VirtualConstraint> {
        if let Some(given) = self.virtual_constraints.first().map(|draft| draft.span) {
            let message = "`virtual thermo` has displacements beside these";
            self.problem(given.or(span), message, "keep one of them");
            return Vec::new();
        }
        if let Some(quasi) = self.quasi_velocities.first().map(|v| v.name.clone()) {
            let message =
                format!("`virtual thermo` does not know the power of quasi-velocities, as `{quasi}` is one");
            let help = "write the constraints by velocities, or give their displacements by `virtual`";
            self.problem(span, message, help);
            return Vec::new();
        }
        let table = self.displacement_table();
        let velocities = self.velocity_symbols();
        let mut result = Vec::new();
        for constraint in constraints {
            let help = "say which by `virtual .. delta(v) .. = 0;`, one for each constraint";
            if !matches!(constraint.kind, ConstraintKind::Linear | ConstraintKind::Nonlinear) {
                let message = format!("constraint `{}` on accelerations is no power", constraint.text);
                self.problem(constraint.span.or(span), message, help);
                continue;
            }
            let one_form = match self.power(constraint.residual, &velocities) {
                Ok(one_form) => one_form,
                Err(term) => {
                    let term = self.graph.display(term, Style::Plain);
                    let message = format!(
                        "the displacements of `{}` are not seen: `{term}` has no degree above zero in the velocities",
                        constraint.text
                    );
                    self.problem(constraint.span.or(span), message, help);
                    continue;
                }
            };
            let mut terms = Vec::new();
            for (y, slope) in velocities.iter().zip(&one_form) {
                let y = self.graph.sym(*y);
                if let Some(displacement) = table.get(&y) {
                    terms.push(self.graph.mul(*displacement, *slope));
                }
            }
            let sum = self.graph.sum(&terms);
            let text = format!("{} = 0", self.graph.display(sum, Style::Plain));
            let name = constraint.name.clone();
            let power_of = Some(name.clone());
            result.push(VirtualConstraint { power_of, name, text, one_form, mode: None, span });
        }
        result
    }

    /// `A` of `phi = A_a y^a + b`, or a term of `phi` that has no degree.
    fn power(&mut self, phi: ExprId, velocities: &[SymbolId]) -> Result<Vec<ExprId>, ExprId> {
        let g = &mut self.graph;
        let along: BTreeMap<SymbolId, ExprId> = velocities.iter().map(|y| (*y, g.sym(*y))).collect();
        let of_velocities = velocities.iter().copied().collect();
        let expanded = g.expand(phi);
        let mut parts: Vec<(ExprId, Rational)> = Vec::new();
        for (term, q) in g.summands(expanded) {
            if !g.depends_on(term, &of_velocities) {
                continue;
            }
            let slope = g.derivative_along(term, &along);
            let relation = rational_relations(g, &[vec![term], vec![slope]]).pop();
            // `c term + slope = 0`.
            let degree = relation.map(|c| -c[0].clone()).filter(|k| !k.is_zero()).ok_or(term)?;
            let scaled = g.scale(term, &degree);
            let rest = g.sub(slope, scaled);
            if !g.is_zero(rest) {
                return Err(term);
            }
            parts.push((term, q / degree));
        }
        let mut one_form = Vec::with_capacity(velocities.len());
        for y in velocities {
            let mut terms = Vec::with_capacity(parts.len());
            for (term, weight) in &parts {
                terms.push((g.diff(*term, *y), weight.clone()));
            }
            one_form.push(g.linear_combination(&terms));
        }
        Ok(one_form)
    }
}
