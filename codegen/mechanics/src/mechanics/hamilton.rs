//! A Hamiltonian in the place of a Lagrangian: velocities `dh/dp`, and what holds constraints on them.
//!
//! Does not know: the momentum equation, which is that of a Lagrangian.

use crate::reduction::{AccelerationSource, Hamiltonian, KinematicConstraint};
use hamel_expr::ExprId;
use hamel_expr::error::Error;

use super::derive::{Derivation, Motion};

impl Derivation<'_> {
    /// `y = dh/dp` for all velocities.
    pub(super) fn velocities_of(&mut self, hamiltonian: &Hamiltonian) -> Result<(), Error> {
        let system = self.system;
        for momentum in &system.momenta {
            let symbol = hamiltonian.momenta[momentum.unknown];
            if momentum.symbol.is_none() {
                self.replacement.insert(symbol, momentum.value);
            }
            self.momentum.push(momentum.value);
        }
        self.writer.begin("velocities y = dh/dp");
        for (alpha, p) in hamiltonian.momenta.iter().enumerate() {
            let slope = self.g.diff(hamiltonian.h, *p);
            let value = self.replace(slope)?;
            let named = self.writer.define(&mut self.g, &self.names[alpha], value);
            self.replacement.insert(system.velocities[alpha], named);
            self.y[alpha] = named;
        }
        Ok(())
    }

    /// `pdot = (N - C y) p - rho dh/dx + F + Lambda^T lambda` with the multipliers that keep the conditions on
    /// accelerations, `ydot = h_pp pdot + h_px xdot + h_pt`:
    ///
    /// ```text
    /// w h_pp Lambda^T lambda = -(w (h_pp r + h_px xdot + h_pt) + w0)
    /// ```
    pub(super) fn solve_on_dual(&mut self, hamiltonian: &Hamiltonian) -> Result<Motion, Error> {
        let system = self.system;
        let m = self.y.len();
        let (rows, reactions) = match &system.constraint {
            KinematicConstraint::Solved(_) => (Vec::new(), Vec::new()),
            KinematicConstraint::Multipliers { rows, reactions } => {
                (self.rows_on_state(rows)?, self.forms_on_state(reactions)?)
            }
        };
        self.writer.begin("forces F - rho dh/dx - C y p");
        let slopes = self.slopes_by_base()?;
        let momentum = self.momentum.clone();
        let mut net = Vec::new();
        for alpha in 0..m {
            let force = self.applied_force(alpha, &momentum, &slopes)?;
            net.push(self.define(&format!("r_{}", self.names[alpha].clone()), force));
        }
        let mut curvature = Vec::new();
        let mut lag = Vec::new();
        for p in &hamiltonian.momenta {
            let y = self.g.diff(hamiltonian.h, *p);
            let mut row = Vec::new();
            for q in &hamiltonian.momenta {
                let second = self.g.diff(y, *q);
                row.push(self.replace(second)?);
            }
            curvature.push(row);
            lag.push(self.drift(y)?);
        }
        let mut multipliers = Vec::new();
        let mut pivots = Vec::new();
        let mut rates = net.clone();
        if !rows.is_empty() {
            self.writer
                .begin("multipliers S lambda = -(w (h_pp r + h_px xdot + h_pt) + w0), S = w h_pp Lambda^T");
            let mut matrix = Vec::new();
            let mut right = Vec::new();
            for (c, row) in rows.iter().enumerate() {
                let columns: Vec<ExprId> = (0..m)
                    .map(|beta| {
                        let column: Vec<ExprId> = curvature.iter().map(|row| row[beta]).collect();
                        self.g.dot(&row.one_form, &column)
                    })
                    .collect();
                let mut entries = Vec::new();
                for (other, form) in reactions.iter().enumerate() {
                    let product = self.g.dot(&columns, form);
                    entries.push(self.define(&format!("S_{}_{}", c + 1, other + 1), product));
                }
                matrix.push(entries);
                let rate = match row.source {
                    AccelerationSource::Differentiated(residual) => self.drift(residual)?,
                    AccelerationSource::Servo(remainder) => remainder,
                };
                let along = self.g.dot(&columns, &net);
                let lagging = self.g.dot(&row.one_form, &lag);
                let sum = self.g.sum(&[along, lagging, rate]);
                let value = self.g.neg(sum);
                right.push(self.define(&format!("g_{}", c + 1), value));
            }
            let labels: Vec<String> = rows.iter().map(|r| format!("lambda_{}", r.name)).collect();
            let names: Vec<String> =
                rows.iter().map(|r| format!("response to constraint {}", r.text)).collect();
            let (lambda, found) = self.solve_for_multipliers(&matrix, &right, &labels, (&names, false))?;
            pivots = found;
            for (alpha, rate) in rates.iter_mut().enumerate() {
                let mut terms = vec![*rate];
                for (form, lambda) in reactions.iter().zip(&lambda) {
                    terms.push(self.g.mul(form[alpha], *lambda));
                }
                *rate = self.g.sum(&terms);
            }
            multipliers = labels.into_iter().zip(lambda).collect();
        }
        self.writer.begin("accelerations ydot = h_pp pdot + h_px xdot + h_pt");
        let mut acceleration = Vec::new();
        for alpha in 0..m {
            let along = self.g.dot(&curvature[alpha], &rates);
            let sum = self.g.add(along, lag[alpha]);
            acceleration.push(self.define(&format!("dot_{}", self.names[alpha].clone()), sum));
        }
        let unknown_rates = acceleration.clone();
        Ok(Motion {
            acceleration,
            unknown_rates,
            multipliers,
            reactions,
            system: None,
            pivots,
            momentum_rates: Vec::new(),
            after: Vec::new(),
        })
    }
}
