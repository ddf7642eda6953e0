//! Accelerations where the constraint has been solved: `A udot = f` for the independent velocities, multipliers
//! afterwards; in a frame beside them where that is what the equations are written in.
//!
//! Does not know: how the constraint was solved, how a matrix is factored.

use crate::reduction::{Frame, SolvedConstraint};
use hamel_expr::ExprId;
use hamel_expr::error::Error;

use super::balance::Balance;
use super::derive::{Derivation, Motion};
use super::equations::LinearSystem;
use super::solve::{Factorisation, Pivot};

impl Derivation<'_> {
    /// `A udot = f` with `A = W^T L_yy Psi`, `f = W^T (drive - L_yy (dPsi u + dpsi0))`.
    pub(super) fn solve_reduced(&mut self, solved: &SolvedConstraint) -> Result<Motion, Error> {
        if let Some(recursion) = self.way.recursion() {
            return self.solve_linked(&recursion, solved);
        }
        if let (Some(lift), Some(lifted)) = (&self.system.lift, self.way.lifted()) {
            return self.solve_by_lift(solved, (lift, &lifted));
        }
        if let Some(frame) = self.frame_of_displacements(solved) {
            return self.solve_in_frame(solved, &frame);
        }
        let (m, k) = (self.y.len(), solved.unknowns.len());
        let unknowns: Vec<String> = solved.unknowns.iter().map(|u| u.name.clone()).collect();
        let (lag, known) = match self.forces.at_rest.clone() {
            Some((lag, net)) => (lag, Some(net)),
            None => (self.lag_of_columns(solved)?, None),
        };
        let answered = self.way.answered().filter(|_| solved.virtual_displacements == solved.psi);
        let (mass_matrix, force) = match (answered, &known) {
            (Some(answered), Some(net)) => self.condensed(solved, &answered, net),
            _ => {
                let known_matrix = self.transform.as_ref().map(|transform| transform.matrix.clone());
                let mass_matrix = known_matrix.map_or_else(|| self.mass_matrix(solved), Ok)?;
                let displacements = self.displacements(solved)?;
                self.writer.begin("right side f = W^T (r - L_yy lag)");
                let hessian = self.hessian.clone();
                let net = known.unwrap_or_else(|| self.net(&self.forces.drive.clone(), &hessian, &lag));
                let mut force = Vec::new();
                for b in 0..k {
                    let mut terms = Vec::new();
                    for alpha in 0..m {
                        terms.push(self.g.mul(displacements[alpha][b], net[alpha]));
                    }
                    let sum = self.g.sum(&terms);
                    force.push(self.define(&format!("f_{}", unknowns[b]), sum));
                }
                (mass_matrix, force)
            }
        };
        let (udot, pivots) = self.solve_assembled(solved, &mass_matrix, &force)?;
        // Momenta in the state have rates of their own.
        let is_solved = self.transform.is_none();
        let balance = is_solved.then(|| Box::new(self.balance_of(&mass_matrix, &force, &unknowns, &udot)));
        let system = Some(LinearSystem { mass_matrix, force, unknowns, balance });
        let psi = self.psi_by_names(solved);
        let added = self.along(&psi, &udot);
        self.motion_of(solved, system, (udot, pivots), (&added, &lag))
    }

    /// The frame, where its velocities are free and the state has those of the model: `u = T eta`.
    fn frame_of_displacements(&self, solved: &SolvedConstraint) -> Option<Frame> {
        let (zero, one) = (self.g.zero(), self.g.one());
        let rows = solved.virtual_displacements.iter().enumerate();
        let is_whole = solved.unknowns.len() == self.y.len()
            && rows
                .flat_map(|(i, row)| row.iter().enumerate().map(move |(j, e)| (i == j, *e)))
                .all(|(is_diagonal, e)| e == if is_diagonal { one } else { zero });
        let is_free = solved.reactions.names.is_empty() && self.system.momenta.is_empty();
        let frame = self.system.frame.as_ref()?;
        (is_whole && is_free && solved.psi != solved.virtual_displacements).then(|| frame.clone())
    }

    /// `L_eta_eta etadot = r`, which is symmetric and couples no levels of stages where the metric does not, and
    /// `udot = T etadot + dT/dt eta`: `L_eta_eta T^-1 udot = ..` is neither.
    fn solve_in_frame(&mut self, solved: &SolvedConstraint, frame: &Frame) -> Result<Motion, Error> {
        let names = self.names.clone();
        let labels: Vec<String> = names.iter().map(|n| format!("dot_{n}")).collect();
        let (hessian, drive) = (self.hessian.clone(), self.forces.drive.clone());
        let pivot_names = inertias(&names);
        let (acceleration, mut pivots) =
            self.solve_linear("A", &hessian, &drive, &names, &labels, (&pivot_names, true))?;
        pivots.extend(solved.pivots.iter().map(|(name, expr)| Pivot::of_coefficients(name, *expr)));
        self.writer.begin("rates of the velocities of the model udot = T etadot + dT/dt eta");
        let eta: Vec<ExprId> = self.system.velocities.iter().map(|s| self.g.sym(*s)).collect();
        // Forces along the frame are none along the velocities of the model.
        let balance = self.balance_of(&hessian, &drive, &names, &acceleration);
        let balance = Some(Box::new(Balance { forces: Vec::new(), ..balance }));
        let mut unknown_rates = Vec::new();
        for unknown in &solved.unknowns {
            let of_model = frame.original.iter().position(|u| u.symbol == unknown.symbol);
            let row = of_model.and_then(|k| frame.matrix.get(k)).cloned().unwrap_or_default();
            let velocity = self.g.dot(&row, &eta);
            let turning = self.drift(velocity)?;
            let along = self.g.dot(&row, &acceleration);
            let sum = self.g.add(along, turning);
            unknown_rates.push(self.define(&format!("dot_{}", unknown.name), sum));
        }
        Ok(Motion {
            acceleration,
            unknown_rates,
            multipliers: Vec::new(),
            reactions: Vec::new(),
            system: Some(LinearSystem { mass_matrix: hessian, force: drive, unknowns: names, balance }),
            pivots,
            momentum_rates: Vec::new(),
            after: Vec::new(),
        })
    }

    /// The accelerations of the dependent velocities at `udot = 0`: `dPsi u + dpsi0`.
    fn lag_of_columns(&mut self, solved: &SolvedConstraint) -> Result<Vec<ExprId>, Error> {
        self.writer.begin("accelerations of the dependent velocities at udot = 0");
        let mut lag = vec![self.g.zero(); self.y.len()];
        for &alpha in &solved.dependent {
            let value = solved.velocity(&mut self.g, alpha);
            let drift = self.drift(value)?;
            lag[alpha] = self.define(&format!("lag_{}", self.names[alpha]), drift);
        }
        Ok(lag)
    }

    /// `r - h lag`, by velocity.
    pub(super) fn net(&mut self, drive: &[ExprId], hessian: &[Vec<ExprId>], lag: &[ExprId]) -> Vec<ExprId> {
        let mut net = Vec::new();
        for alpha in 0..lag.len() {
            let mut terms = vec![drive[alpha]];
            for (beta, lag) in lag.iter().enumerate() {
                let product = self.g.mul(hessian[alpha][beta], *lag);
                terms.push(self.g.neg(product));
            }
            let sum = self.g.sum(&terms);
            net.push(self.define(&format!("n_{}", self.names[alpha]), sum));
        }
        net
    }

    /// `A udot = f`, and the pivots.
    pub(super) fn solve_assembled(
        &mut self,
        solved: &SolvedConstraint,
        mass_matrix: &[Vec<ExprId>],
        force: &[ExprId],
    ) -> Result<(Vec<ExprId>, Vec<Pivot>), Error> {
        let unknowns: Vec<String> = solved.unknowns.iter().map(|u| u.name.clone()).collect();
        let symmetric_form = solved.virtual_displacements == solved.psi;
        let labels: Vec<String> = unknowns.iter().map(|n| format!("dot_{n}")).collect();
        let names = inertias(&unknowns);
        let known = self.transform.as_ref().map(|transform| transform.factors.clone());
        let (udot, mut pivots) = match known {
            None => {
                self.solve_linear("A", mass_matrix, force, &unknowns, &labels, (&names, symmetric_form))?
            }
            Some(factors) => {
                self.writer.begin("substitution through the factors of A");
                let udot = factors.solve(&mut self.g, &mut self.writer, &labels, force);
                (udot, factors.pivots(&names, symmetric_form))
            }
        };
        pivots.extend(solved.pivots.iter().map(|(name, expr)| Pivot::of_coefficients(name, *expr)));
        Ok((udot, pivots))
    }

    /// `psi x`, by rows.
    pub(super) fn along(&mut self, psi: &[Vec<ExprId>], x: &[ExprId]) -> Vec<ExprId> {
        psi.iter().map(|row| self.g.dot(row, x)).collect()
    }

    /// Everything that follows from `udot`, with `ydot = added + lag`.
    pub(super) fn motion_of(
        &mut self,
        solved: &SolvedConstraint,
        system: Option<LinearSystem>,
        (unknown_rates, pivots): (Vec<ExprId>, Vec<Pivot>),
        (added, lag): (&[ExprId], &[ExprId]),
    ) -> Result<Motion, Error> {
        let m = self.y.len();
        self.writer.begin("accelerations ydot = Psi udot + lag");
        let mut acceleration = vec![self.g.zero(); m];
        for alpha in 0..m {
            let sum = self.g.add(lag[alpha], added[alpha]);
            acceleration[alpha] = self.define(&format!("dot_{}", self.names[alpha]), sum);
        }
        let multipliers = self.multipliers_of(solved, &acceleration)?;
        let reactions = solved.reactions.one_forms.clone();
        Ok(Motion {
            acceleration,
            unknown_rates,
            multipliers,
            reactions,
            system,
            pivots,
            momentum_rates: Vec::new(),
            after: Vec::new(),
        })
    }

    /// `Psi`, by names where they have any.
    pub(super) fn psi_by_names(&self, solved: &SolvedConstraint) -> Vec<Vec<ExprId>> {
        self.way.answered().map_or_else(|| solved.psi.clone(), |answered| answered.partial.clone())
    }

    /// The columns of `W` on the state.
    pub(super) fn displacements(&mut self, solved: &SolvedConstraint) -> Result<Vec<Vec<ExprId>>, Error> {
        if let Some(answered) = self.way.answered().filter(|_| solved.virtual_displacements == solved.psi) {
            return Ok(answered.partial.clone());
        }
        let rows = solved.virtual_displacements.iter();
        rows.map(|row| row.iter().map(|e| self.replace(*e)).collect()).collect()
    }

    /// `A = W^T L_yy Psi`.
    pub(super) fn mass_matrix(&mut self, solved: &SolvedConstraint) -> Result<Vec<Vec<ExprId>>, Error> {
        self.writer.begin("mass matrix A = W^T L_yy Psi");
        let (m, k) = (self.y.len(), solved.unknowns.len());
        let mut mass_matrix = vec![vec![self.g.zero(); k]; k];
        let symmetric_form = solved.virtual_displacements == solved.psi;
        let displacements = self.displacements(solved)?;
        let psi = self.psi_by_names(solved);
        for b in 0..k {
            for a in 0..k {
                if symmetric_form && a < b {
                    mass_matrix[b][a] = mass_matrix[a][b];
                    continue;
                }
                let mut terms = Vec::new();
                for alpha in 0..m {
                    for beta in 0..m {
                        let (w, h) = (displacements[alpha][b], self.hessian[alpha][beta]);
                        if w != self.g.zero() && h != self.g.zero() {
                            terms.push(self.g.product(&[w, h, psi[beta][a]]));
                        }
                    }
                }
                let sum = self.g.sum(&terms);
                let name = format!("A_{}_{}", solved.unknowns[b].name, solved.unknowns[a].name);
                mass_matrix[b][a] = self.define(&name, sum);
            }
        }
        Ok(mass_matrix)
    }

    /// Factors and solves, writing both as sections. Solutions are called `labels`; of the pivots the names are given,
    /// and whether they follow the Hessian.
    pub(super) fn solve_linear(
        &mut self,
        prefix: &str,
        matrix: &[Vec<ExprId>],
        right: &[ExprId],
        unknowns: &[String],
        labels: &[String],
        (pivot_names, follows_hessian): (&[String], bool),
    ) -> Result<(Vec<ExprId>, Vec<Pivot>), Error> {
        self.writer.begin(&format!("factors of {prefix}"));
        let factors = Factorisation::new(
            &mut self.g,
            &mut self.writer,
            prefix,
            matrix,
            unknowns,
            &self.system.signs,
            &[],
        )?;
        self.writer.begin(&format!("substitution through the factors of {prefix}"));
        let x = factors.solve(&mut self.g, &mut self.writer, labels, right);
        Ok((x, factors.pivots(pivot_names, follows_hessian)))
    }

    /// `E_alpha = sum_A lambda_A form_A,alpha`, solved on components that determine the multipliers.
    fn multipliers_of(
        &mut self,
        solved: &SolvedConstraint,
        acceleration: &[ExprId],
    ) -> Result<Vec<(String, ExprId)>, Error> {
        let reactions = &solved.reactions;
        if reactions.names.is_empty() || !self.is_whole() {
            return Ok(Vec::new());
        }
        self.writer.begin("multipliers E = lambda a");
        if let Some(response) =
            solved.response.as_ref().filter(|_| solved.virtual_displacements == solved.psi)
        {
            let mut reaction = vec![self.g.zero(); self.y.len()];
            for &alpha in &solved.dependent {
                let mut terms = vec![self.g.neg(self.forces.drive[alpha])];
                for (beta, ydot) in acceleration.iter().enumerate() {
                    terms.push(self.g.mul(self.hessian[alpha][beta], *ydot));
                }
                reaction[alpha] = self.g.sum(&terms);
            }
            let values = self.multipliers_by_rows(response, &reaction);
            let names = reactions.names.iter().map(|name| format!("lambda_{name}"));
            return Ok(names.zip(values).collect());
        }
        let mut matrix = Vec::new();
        let mut right = Vec::new();
        for &alpha in &reactions.on {
            let mut row = Vec::new();
            for form in &reactions.one_forms {
                row.push(self.replace(form[alpha])?);
            }
            matrix.push(row);
            let mut terms = vec![self.g.neg(self.forces.drive[alpha])];
            for (beta, ydot) in acceleration.iter().enumerate() {
                terms.push(self.g.mul(self.hessian[alpha][beta], *ydot));
            }
            right.push(vec![self.g.sum(&terms)]);
        }
        let solution = hamel_lang::algebra::solve_symbolic(&mut self.g, &matrix, &right)
            .map_err(|_| Error::DivisionByZero { place: "the multipliers".into() })?;
        let rows = reactions.names.iter().zip(solution);
        Ok(rows.map(|(name, value)| (format!("lambda_{name}"), self.g.cancel_zero(value[0]))).collect())
    }
}

/// Names of pivots of the mass matrix.
pub(super) fn inertias(names: &[String]) -> Vec<String> {
    names.iter().map(|n| format!("inertia along {n}")).collect()
}
