//! Dependent velocities taken out of the equations one by one, each by the row that gives it.
//!
//! `A = Psi^T M Psi` and `f = Psi^T n` are made of the velocities that are left. A row with few others, such as that of
//! a point which rolls, makes the matrix of these little fuller than it was, and saves its velocity a row of `Psi` and
//! of momenta along every unknown; a row with many others costs more than that. Which are taken out is found out by
//! counting. Deliberately does not know: how rows are solved, where the matrix and the forces come from.
//!
//! # Source
//! Guyan 1965, Reduction of stiffness and mass matrices, AIAA Journal 3 (a congruence that leaves out coordinates).

use crate::reduction::SolvedConstraint;
use hamel_expr::{ExprId, Trials};
use hamel_lang::algebra::tableau::QuadraticForm;

use super::answers::Direct;
use super::derive::Derivation;
use super::rows::Answered;

/// `A` and `f` along the unknowns.
pub(super) type Condensed = (Vec<Vec<ExprId>>, Vec<ExprId>);

impl Derivation<'_> {
    /// `A = Psi^T M Psi` and `f = Psi^T n` with those velocities taken out that leave the fewest operations.
    pub(super) fn condensed(
        &mut self,
        solved: &SolvedConstraint,
        answered: &Answered,
        net: &[ExprId],
    ) -> Condensed {
        let rows = self.direct_rows(&answered.rows);
        let mut trials = Trials::new(self);
        let mut best = vec![false; rows.len()];
        let mut attempt = |d: &mut Self, taken: Vec<bool>| {
            let is_kept = trials.attempt(d, 0, |d| {
                let condensed = d.without(solved, &rows, net, &taken);
                let roots: Vec<ExprId> = condensed.0.iter().flatten().chain(&condensed.1).copied().collect();
                Some((d.n_operations(&roots), condensed))
            });
            if is_kept {
                best = taken;
            }
            best.clone()
        };
        attempt(self, vec![false; rows.len()]);
        let mut taken = attempt(self, vec![true; rows.len()]);
        for k in 0..rows.len() {
            taken[k] = !taken[k];
            taken = attempt(self, taken);
        }
        trials.finish(self).unwrap_or_else(|| self.without(solved, &rows, net, &best))
    }

    /// `A` and `f` without the velocities of rows that are `taken`.
    fn without(
        &mut self,
        solved: &SolvedConstraint,
        rows: &[Direct],
        net: &[ExprId],
        taken: &[bool],
    ) -> Condensed {
        let mut form = QuadraticForm::new(&self.g, &self.hessian, net.to_vec());
        let mut is_left = vec![true; self.y.len()];
        self.writer.begin("dependent velocities taken out, M += c M_d + M_d c + c M_dd c, n += c n_d");
        let names = self.names.clone();
        for (Direct { own, by }, _) in rows.iter().zip(taken).filter(|(_, taken)| **taken) {
            is_left[*own] = false;
            form.substitute(&mut self.pen(&names, ["M", "n"]), &[(*own, by)]);
        }
        self.along_what_is_left(solved, &is_left, &form)
    }

    /// `Psi^T M Psi` and `Psi^T n` over the velocities that are left.
    fn along_what_is_left(
        &mut self,
        solved: &SolvedConstraint,
        is_left: &[bool],
        form: &QuadraticForm,
    ) -> Condensed {
        let zero = self.g.zero();
        let psi = self.psi_by_names(solved);
        let left: Vec<usize> = (0..psi.len()).filter(|alpha| is_left[*alpha]).collect();
        let names: Vec<String> = solved.unknowns.iter().map(|u| u.name.clone()).collect();
        let k = names.len();
        let column = |a: usize| -> Vec<ExprId> { left.iter().map(|alpha| psi[*alpha][a]).collect() };
        self.writer.begin("mass matrix A = Psi^T M Psi");
        let mut momenta = Vec::with_capacity(k);
        for (a, name) in names.iter().enumerate() {
            let mut along = Vec::with_capacity(left.len());
            for alpha in &left {
                let row: Vec<ExprId> =
                    left.iter().map(|beta| form.entry(*alpha, *beta).unwrap_or(zero)).collect();
                let sum = self.g.dot(&row, &column(a));
                along.push(self.define(&format!("P_{}_{name}", self.names[*alpha]), sum));
            }
            momenta.push(along);
        }
        let mut matrix = vec![vec![zero; k]; k];
        for b in 0..k {
            for a in b..k {
                let sum = self.g.dot(&column(b), &momenta[a]);
                matrix[b][a] = self.define(&format!("A_{}_{}", names[b], names[a]), sum);
                matrix[a][b] = matrix[b][a];
            }
        }
        self.writer.begin("right side f = Psi^T n");
        let net: Vec<ExprId> = left.iter().map(|alpha| form.g[*alpha]).collect();
        let force = (0..k).map(|b| {
            let sum = self.g.dot(&column(b), &net);
            self.define(&format!("f_{}", names[b]), sum)
        });
        let force = force.collect();
        (matrix, force)
    }
}
