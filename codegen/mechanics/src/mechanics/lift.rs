//! Equations with a mechanical connection that nobody multiplies out.
//!
//! With `K A = L_vx`, `w = v + A xdot` in the state and `r` the forces along the frame without the connection, the
//! equations along the horizontal lifts `D_i = d_i - A_i` and along the algebra are
//!
//! ```text
//! (L_xx - L_xv A) xddot = r_x - A^T r_v
//! K wdot                = r_v + dL_vx/dt xdot - dK/dt A xdot
//! ```
//!
//! because `K dA/dt = dL_vx/dt - dK/dt A`: no derivative of an inverse is needed. Deliberately does not know: where `K`
//! and `L_vx` come from, how forces are made.

use crate::reduction::{Lift, SolvedConstraint};
use hamel_expr::ExprId;
use hamel_expr::error::Error;

use super::constrained::inertias;
use super::derive::{Derivation, Motion};
use super::equations::LinearSystem;
use super::lifted::Lifted;
use super::solve::Factorisation;

impl Derivation<'_> {
    /// `K`, `L_vx`, `A`, and the velocities `v = w - A xdot`.
    pub(super) fn velocities_by_lift(
        &mut self,
        solved: &SolvedConstraint,
        lift: &Lift,
    ) -> Result<Lifted, Error> {
        let (n, dim) = (self.y.len() - lift.inertia.len(), lift.inertia.len());
        self.writer.begin("locked inertia K = L_vv, coupling L_vx");
        let mut inertia = vec![vec![self.g.zero(); dim]; dim];
        for a in 0..dim {
            for b in a..dim {
                inertia[a][b] = self.define(&format!("K_{}_{}", a + 1, b + 1), lift.inertia[a][b]);
                inertia[b][a] = inertia[a][b];
            }
        }
        let base: Vec<String> =
            self.system.algebroid.base()[..n].iter().map(|x| self.g.name(*x).to_owned()).collect();
        let mut coupling = vec![vec![self.g.zero(); n]; dim];
        for (a, row) in coupling.iter_mut().enumerate() {
            for (i, entry) in row.iter_mut().enumerate() {
                *entry = self.define(&format!("L{}_{}", a + 1, base[i]), lift.coupling[a][i]);
            }
        }
        self.writer.begin("factors of K");
        let names: Vec<String> = solved.unknowns[n..].iter().map(|u| u.name.clone()).collect();
        let signs = &self.system.signs;
        let factors = Factorisation::new(&mut self.g, &mut self.writer, "K", &inertia, &names, signs, &[])?;
        self.writer.begin("mechanical connection A = K^-1 L_vx");
        let mut connection = vec![Vec::with_capacity(n); dim];
        for (i, x) in base.iter().enumerate() {
            let labels: Vec<String> = (1..=dim).map(|a| format!("A{a}_{x}")).collect();
            let column: Vec<ExprId> = coupling.iter().map(|row| row[i]).collect();
            let column = factors.solve(&mut self.g, &mut self.writer, &labels, &column);
            connection.iter_mut().zip(column).for_each(|(row, e)| row.push(e));
        }
        self.writer.begin("velocities v = w - A xdot");
        let mut along = Vec::with_capacity(dim);
        for (a, row) in connection.iter().enumerate() {
            let sum = self.g.dot(row, &self.y[..n]);
            along.push(self.define(&format!("a{}", a + 1), sum));
        }
        for (a, unknown) in solved.unknowns[n..].iter().enumerate() {
            let w = self.g.sym(unknown.symbol);
            let value = self.g.sub(w, along[a]);
            let named = self.define(&self.names[n + a].clone(), value);
            self.replacement.insert(self.system.velocities[n + a], named);
            self.y[n + a] = named;
        }
        Ok(Lifted { factors, inertia, coupling, connection, along })
    }

    /// The equations along the horizontal lifts and along the algebra, solved for `xddot` and `wdot`.
    pub(super) fn solve_by_lift(
        &mut self,
        solved: &SolvedConstraint,
        (lift, lifted): (&Lift, &Lifted),
    ) -> Result<Motion, Error> {
        let (m, dim) = (self.y.len(), lift.inertia.len());
        let n = m - dim;
        let drive = self.forces.drive.clone();
        let names: Vec<String> = solved.unknowns.iter().map(|u| u.name.clone()).collect();
        let labels: Vec<String> = names.iter().map(|name| format!("dot_{name}")).collect();
        let turning = self.turning_of_lift(lift, lifted)?;
        self.writer.begin("right side f_x = r_x - A^T r_v, f_w = r_v + dL_vx/dt xdot - dK/dt A xdot");
        let mut force = Vec::with_capacity(m);
        for i in 0..n {
            let column: Vec<ExprId> = lifted.connection.iter().map(|row| row[i]).collect();
            let vertical = self.g.dot(&column, &drive[n..]);
            let value = self.g.sub(drive[i], vertical);
            force.push(self.define(&format!("f_{}", names[i]), value));
        }
        for (a, turning) in turning.into_iter().enumerate() {
            let value = self.g.add(drive[n + a], turning);
            force.push(self.define(&format!("f_{}", names[n + a]), value));
        }
        let horizontal = self.horizontal_inertia(lifted, &names[..n]);
        let inertial = inertias(&names);
        let (mut rates, mut pivots) = self.solve_linear(
            "A",
            &horizontal,
            &force[..n],
            &names[..n],
            &labels[..n],
            (&inertial[..n], true),
        )?;
        self.writer.begin("substitution through the factors of K");
        rates.extend(lifted.factors.solve(&mut self.g, &mut self.writer, &labels[n..], &force[n..]));
        pivots.extend(lifted.factors.pivots(&inertial[n..], true));
        self.writer.begin("accelerations vdot, K vdot = r_v - L_vx xddot");
        let mut right = Vec::with_capacity(dim);
        for (a, row) in lifted.coupling.iter().enumerate() {
            let along = self.g.dot(row, &rates[..n]);
            right.push(self.g.sub(drive[n + a], along));
        }
        let of_frame: Vec<String> = self.names[n..].iter().map(|name| format!("dot_{name}")).collect();
        let vertical = lifted.factors.solve(&mut self.g, &mut self.writer, &of_frame, &right);
        let acceleration = [&rates[..n], &vertical].concat();
        let zero = self.g.zero();
        let entry = |i: usize, j: usize| match (i < n, j < n) {
            (true, true) => horizontal[i][j],
            (false, false) => lifted.inertia[i - n][j - n],
            _ => zero,
        };
        let mass_matrix = (0..m).map(|i| (0..m).map(|j| entry(i, j)).collect()).collect();
        Ok(Motion {
            acceleration,
            unknown_rates: rates,
            multipliers: Vec::new(),
            reactions: Vec::new(),
            system: Some(LinearSystem { mass_matrix, force, unknowns: names, balance: None }),
            pivots,
            momentum_rates: Vec::new(),
            after: Vec::new(),
        })
    }

    /// The momenta along the horizontal lifts, `p_i - A^a_i p_a`, and along the algebra.
    pub(super) fn momenta_over_lift(&mut self, lifted: &Lifted) -> Vec<ExprId> {
        let n = self.y.len() - lifted.connection.len();
        let mut momenta = self.momentum.clone();
        let (along_base, along_algebra) = momenta.split_at_mut(n);
        for (i, p) in along_base.iter_mut().enumerate() {
            let column: Vec<ExprId> = lifted.connection.iter().map(|row| row[i]).collect();
            let vertical = self.g.dot(&column, along_algebra);
            *p = self.g.sub(*p, vertical);
        }
        momenta
    }

    /// `dL_vx/dt xdot - dK/dt A xdot`, which is `K dA/dt xdot`.
    fn turning_of_lift(&mut self, lift: &Lift, lifted: &Lifted) -> Result<Vec<ExprId>, Error> {
        let dim = lift.inertia.len();
        self.writer.begin("rates dK/dt");
        let mut rates = vec![vec![self.g.zero(); dim]; dim];
        for a in 0..dim {
            for b in a..dim {
                let rate = self.drift(lift.inertia[a][b])?;
                rates[a][b] = self.define(&format!("dot_K_{}_{}", a + 1, b + 1), rate);
                rates[b][a] = rates[a][b];
            }
        }
        let mut turning = Vec::with_capacity(dim);
        for (rates, coupling) in rates.iter().zip(&lift.coupling) {
            let mut along = Vec::with_capacity(coupling.len());
            for e in coupling {
                along.push(self.drift(*e)?);
            }
            let moved = self.g.dot(&along, &self.y[..along.len()]);
            let turned = self.g.dot(rates, &lifted.along);
            turning.push(self.g.sub(moved, turned));
        }
        Ok(turning)
    }

    /// `L_xx - L_xv A`, the kinetic energy of horizontal velocities.
    fn horizontal_inertia(&mut self, lifted: &Lifted, names: &[String]) -> Vec<Vec<ExprId>> {
        let n = names.len();
        self.writer.begin("mass matrix A = L_xx - L_xv A along the horizontal lifts");
        let mut matrix = vec![vec![self.g.zero(); n]; n];
        for i in 0..n {
            for j in i..n {
                // A sum of squares of sines and cosines is seen to be constant alone.
                let mut terms =
                    vec![self.define(&format!("L_{}_{}", names[i], names[j]), self.hessian[i][j])];
                for (coupling, connection) in lifted.coupling.iter().zip(&lifted.connection) {
                    let product = self.g.mul(coupling[i], connection[j]);
                    terms.push(self.g.neg(product));
                }
                let sum = self.g.sum(&terms);
                matrix[i][j] = self.define(&format!("A_{}_{}", names[i], names[j]), sum);
                matrix[j][i] = matrix[i][j];
            }
        }
        matrix
    }
}
