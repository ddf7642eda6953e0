//! The bracket along the velocities that a solved constraint allows.
//!
//! Does not know: which coordinates a state has.

use crate::reduction::SolvedConstraint;
use hamel_expr::ExprId;
use hamel_expr::error::Error;

use super::builder::{Builder, MomentumForm};

impl Builder<'_> {
    /// The bracket along the columns of `Psi`:
    ///
    /// ```text
    /// R_x = rho psi0 + r,   R_b = W_b F + <p, dW_b/dt + N W_b> - <p, [W_b, psi0]>
    /// ```
    pub(super) fn of_solved(&mut self, solved: &SolvedConstraint) -> Result<MomentumForm, Error> {
        let (m, k) = (self.momentum.len(), solved.unknowns.len());
        let is_hamiltonian = self.equations.system.hamiltonian.is_some();
        let sections: Vec<Vec<ExprId>> =
            (0..k).map(|a| solved.psi.iter().map(|row| row[a]).collect()).collect();
        let velocities: Vec<ExprId> = (0..m).map(|alpha| solved.velocity(self.g, alpha)).collect();
        let structure = self.lie_poisson();
        self.writer.begin("brackets {x, pi} = rho W");
        let anchors: Vec<Vec<ExprId>> = sections.iter().map(|w| self.anchor_of(w)).collect();
        let mut momenta = vec![vec![self.g.zero(); k]; k];
        let mut turning = vec![vec![self.g.zero(); k]; k];
        // <p, rho(W_a) W_b>, and rho(W_a) p_alpha with the velocities that the constraint determines.
        let mut turned_sections = momenta.clone();
        let along_p = |b: &mut Self, direction: &[ExprId]| -> Result<Vec<ExprId>, Error> {
            let mut changes = Vec::new();
            for y in &velocities {
                changes.push(b.along(*y, direction)?);
            }
            let mut slopes = Vec::new();
            for alpha in 0..m {
                let explicit = b.along(b.raw_momentum[alpha], direction)?;
                let row = b.hessian[alpha].clone();
                let implicit = b.g.dot(&row, &changes);
                slopes.push(b.g.add(explicit, implicit));
            }
            Ok(slopes)
        };
        let on_p = |b: &mut Self, section: &[ExprId]| {
            let momentum = b.momentum.clone();
            b.g.dot(section, &momentum)
        };
        for a in 0..k {
            let slopes = if is_hamiltonian { Vec::new() } else { along_p(self, &anchors[a])? };
            for b in 0..k {
                let mut turned = Vec::new();
                for e in &sections[b] {
                    turned.push(self.along(*e, &anchors[a])?);
                }
                turned_sections[a][b] = on_p(self, &turned);
                let change = self.g.dot(&sections[b], &slopes);
                turning[a][b] = self.g.add(turned_sections[a][b], change);
            }
        }
        self.writer.begin("brackets {pi_a, pi_b} = -<p, [W_a, W_b]>");
        for a in 0..k {
            for b in a + 1..k {
                let algebraic = self.bilinear(&structure, &sections[a], &sections[b]);
                let plus = self.g.neg(algebraic);
                let minus = self.g.neg(turned_sections[a][b]);
                let sum = self.g.sum(&[plus, minus, turned_sections[b][a]]);
                let [first, second] = [a, b].map(|a| &solved.unknowns[a].name);
                let named = self.writer.define(self.g, &format!("c_{first}_{second}"), sum);
                momenta[a][b] = named;
                momenta[b][a] = self.g.neg(named);
            }
        }
        let forces = self.forces()?;
        let psi0 = &solved.psi0;
        let mut along_x = self.anchor_of(psi0);
        self.add_own_rates(&mut along_x)?;
        let is_affine = psi0.iter().any(|e| *e != self.g.zero());
        let (mut along_pi, mut lag) = (Vec::new(), Vec::new());
        let drift_of_p = if is_hamiltonian { Vec::new() } else { along_p(self, &along_x)? };
        for b in 0..k {
            let w = &sections[b];
            let mut by_time = Vec::new();
            let mut turned = Vec::new();
            for e in w {
                by_time.push(self.by_time(*e)?);
                turned.push(self.along(*e, &along_x)?);
            }
            let by_time = on_p(self, &by_time);
            let turned = on_p(self, &turned);
            let mut terms = vec![self.g.dot(w, &forces), by_time, turned];
            if is_affine {
                let algebraic = self.bilinear(&structure, w, psi0);
                terms.push(self.g.neg(algebraic));
                let mut along_psi0 = Vec::new();
                for e in psi0 {
                    along_psi0.push(self.along(*e, &anchors[b])?);
                }
                let along_psi0 = on_p(self, &along_psi0);
                terms.push(self.g.neg(along_psi0));
            }
            along_pi.push(self.g.sum(&terms));
            // d pi_b at fixed u, along R_x and time.
            let mut terms = vec![by_time, turned, self.g.dot(w, &drift_of_p)];
            if !is_hamiltonian {
                for (alpha, w) in w.iter().enumerate() {
                    let explicit = self.by_time(self.raw_momentum[alpha])?;
                    terms.push(self.g.mul(*w, explicit));
                    for (beta, y) in velocities.iter().enumerate() {
                        let change = self.by_time(*y)?;
                        terms.push(self.g.product(&[*w, self.hessian[alpha][beta], change]));
                    }
                }
            }
            lag.push(self.g.sum(&terms));
        }
        let moving_energy = on_p(self, psi0);
        let anchor = (0..along_x.len()).map(|i| anchors.iter().map(|v| v[i]).collect()).collect();
        Ok(MomentumForm { anchor, momenta, turning, remainder: [along_x, along_pi], lag, moving_energy })
    }
}
