//! Velocities after impacts: impulses along the constraints of modes in the kinetic metric.
//!
//! Deliberately does not know: how a matrix is factored, which events there are.

use std::collections::BTreeMap;

use crate::reduction::{AccelerationRow, AccelerationSource};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, SymbolId};
use hamel_lang::spec::{Event, Impact};

use super::derive::Derivation;
use super::solve::Factorisation;

impl Derivation<'_> {
    /// `y+ = y + L_yy^-1 Lambda^T mu`, `(w L_yy^-1 Lambda^T + 1 - s) mu = -(1 + e) phi(y)`, with rows `w`, `phi` and
    /// forms `Lambda` as the modes are at the impact, `s` for each row; `e` is zero for constraints that hold.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a Lagrangian that is not quadratic in the velocities, and where the state has other
    /// velocities than the model.
    ///
    /// # Source
    /// Brogliato, Nonsmooth Mechanics (2016), chapter 6 (Newton's law of impacts in the kinetic metric).
    pub(super) fn velocities_after_impacts(
        &mut self,
        constraint: (&[AccelerationRow], &[Vec<ExprId>]),
        factors: &Factorisation,
    ) -> Result<Vec<(SymbolId, ExprId)>, Error> {
        let mut after = Vec::new();
        for event in &self.system.events {
            let Some(impact) = &event.impact else { continue };
            self.requires_quadratic(event)?;
            let values = self.after_impact(event, impact, constraint, factors)?;
            after.extend(impact.velocities.iter().copied().zip(values));
        }
        Ok(after)
    }

    fn requires_quadratic(&self, event: &Event) -> Result<(), Error> {
        let velocities = self.system.velocities.iter().copied().collect();
        let what = if self.system.frame.is_some() || !self.system.momenta.is_empty() {
            "in other velocities than the model has, or in momenta"
        } else if self.hessian.iter().flatten().any(|e| self.g.depends_on(*e, &velocities)) {
            "with a Lagrangian that is not quadratic in the velocities"
        } else {
            return Ok(());
        };
        Err(Error::Unsupported {
            what: format!("the impact of event `{}` {what}", event.name),
            possible:
                "a Lagrangian that is quadratic in the velocities of the model, which the state carries"
                    .into(),
        })
    }

    fn after_impact(
        &mut self,
        event: &Event,
        impact: &Impact,
        (rows, reactions): (&[AccelerationRow], &[Vec<ExprId>]),
        factors: &Factorisation,
    ) -> Result<Vec<ExprId>, Error> {
        self.writer.begin(&format!("velocities after {}: y + L_yy^-1 Lambda^T mu", event.name));
        let there: BTreeMap<SymbolId, ExprId> = impact.modes.iter().copied().collect();
        let struck: BTreeMap<SymbolId, ExprId> = impact.restitution.iter().copied().collect();
        let names = self.names.clone();
        let (mut response, mut forms) = (Vec::new(), Vec::new());
        for (c, form) in reactions.iter().enumerate() {
            let form = self.at_impact(form, &there)?;
            let labels: Vec<String> =
                names.iter().map(|n| format!("Z{}_{n}_{}", c + 1, event.name)).collect();
            response.push(factors.solve(&mut self.g, &mut self.writer, &labels, &form));
            forms.push(form);
        }
        let (mut matrix, mut right, mut is_congruent) = (Vec::new(), Vec::new(), true);
        for (c, row) in rows.iter().enumerate() {
            let AccelerationSource::Differentiated(residual) = row.source else {
                let what =
                    format!("the impact of event `{}` beside constraints on accelerations", event.name);
                let possible = "constraints on velocities".into();
                return Err(Error::Unsupported { what, possible });
            };
            let form = self.at_impact(&row.one_form, &there)?;
            is_congruent &= forms[c] == form;
            let slack = self.slack(row.mode);
            let [slack, residual] = [slack, residual].map(|e| self.at_impact(&[e], &there));
            let (slack, residual) = (slack?[0], residual?[0]);
            let mut entries = Vec::new();
            for (other, z) in response.iter().enumerate() {
                let mut entry = self.g.dot(&form, z);
                if other == c {
                    entry = self.g.add(entry, slack);
                }
                entries.push(self.define(&format!("S_{}_{}_{}", c + 1, other + 1, event.name), entry));
            }
            matrix.push(entries);
            let mut factor = self.g.one();
            if let Some(e) = row.mode.and_then(|mode| struck.get(&mode)) {
                factor = self.g.add(factor, *e);
            }
            let change = self.g.mul(factor, residual);
            right.push(self.g.neg(change));
        }
        let labels: Vec<String> = rows.iter().map(|r| format!("mu_{}_{}", r.name, event.name)).collect();
        let pivots: Vec<String> = rows.iter().map(|r| format!("response to constraint {}", r.text)).collect();
        let (mu, _) = self.solve_for_multipliers(&matrix, &right, &labels, (&pivots, is_congruent))?;
        let mut values = Vec::new();
        for alpha in 0..self.y.len() {
            let mut terms = vec![self.y[alpha]];
            for (z, mu) in response.iter().zip(&mu) {
                terms.push(self.g.mul(z[alpha], *mu));
            }
            let sum = self.g.sum(&terms);
            values.push(self.define(&format!("after_{}_{}", event.name, names[alpha]), sum));
        }
        Ok(values)
    }

    /// With the modes as they are at the impact.
    fn at_impact(
        &mut self,
        values: &[ExprId],
        there: &BTreeMap<SymbolId, ExprId>,
    ) -> Result<Vec<ExprId>, Error> {
        let found = self.g.subs_all(values, there);
        found.map_err(|_| Error::DivisionByZero { place: "the constraint at an impact".into() })
    }
}
