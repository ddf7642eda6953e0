//! Accelerations that the model gives: nothing is derived from a Lagrangian, and nothing is solved.
//!
//! Does not know: where the rates came from.

use crate::reduction::SolvedConstraint;
use hamel_expr::ExprId;
use hamel_expr::error::Error;

use super::derive::{Derivation, Motion};
use super::solve::Pivot;

impl Derivation<'_> {
    /// `udot` as it is given, and `ydot = Psi udot + lag` for velocities that are functions of the base.
    pub(super) fn given_motion(
        &mut self,
        solved: &SolvedConstraint,
        rates: &[ExprId],
    ) -> Result<Motion, Error> {
        self.writer.begin("accelerations of velocities that are functions of the base");
        let mut acceleration = vec![self.g.zero(); self.y.len()];
        for &alpha in &solved.dependent {
            let drift = self.drift(solved.psi0[alpha])?;
            acceleration[alpha] = self.define(&format!("dot_{}", self.names[alpha]), drift);
        }
        self.writer.begin("accelerations, as given");
        let mut unknown_rates = Vec::new();
        for (alpha, rate) in solved.independent().into_iter().zip(rates) {
            let value = self.replace(*rate)?;
            acceleration[alpha] = self.define(&format!("dot_{}", self.names[alpha]), value);
            unknown_rates.push(acceleration[alpha]);
        }
        Ok(Motion {
            acceleration,
            unknown_rates,
            multipliers: Vec::new(),
            reactions: Vec::new(),
            system: None,
            pivots: solved.pivots.iter().map(|(name, e)| Pivot::of_coefficients(name, *e)).collect(),
            momentum_rates: Vec::new(),
            after: Vec::new(),
        })
    }
}
