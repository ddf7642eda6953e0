//! Dependent velocities taken out of the equations one by one, each by the row that gives it.
//!
//! `A = Psi^T M Psi` and `f = Psi^T n` are made of the velocities that are left. A row with few others, such as that of
//! a point which rolls, makes the matrix of these little fuller than it was, and saves its velocity a row of `Psi` and
//! of momenta along every unknown; a row with many others costs more than that. Which are taken out is found out by
//! counting. Deliberately does not know: how rows are solved, where the matrix and the forces come from.
//!
//! # Source
//! Guyan 1965, Reduction of stiffness and mass matrices, AIAA Journal 3 (a congruence that leaves out coordinates).

use crate::reduction::{Response, SolvedConstraint};
use hamel_expr::{ExprId, Graph, SectionWriter};

use super::answers::Direct;
use super::derive::Derivation;

/// `A` and `f` along the unknowns.
pub(super) type Condensed = (Vec<Vec<ExprId>>, Vec<ExprId>);

/// A choice that was tried: operations, whether each row is used, and everything that was made.
struct Trial {
    n: usize,
    taken: Vec<bool>,
    graph: Graph,
    writer: SectionWriter,
    condensed: Condensed,
}

impl Derivation<'_> {
    /// `A = Psi^T M Psi` and `f = Psi^T n` with those velocities taken out that leave the fewest operations.
    pub(super) fn condensed(
        &mut self,
        solved: &SolvedConstraint,
        response: &Response,
        net: &[ExprId],
    ) -> Condensed {
        let rows = self.direct_rows(response);
        let before = (self.g.clone(), self.writer.clone());
        let mut best = self.tried(solved, &rows, net, &vec![false; rows.len()], &before);
        let all = self.tried(solved, &rows, net, &vec![true; rows.len()], &before);
        if all.n < best.n {
            best = all;
        }
        for k in 0..rows.len() {
            let mut taken = best.taken.clone();
            taken[k] = !taken[k];
            let other = self.tried(solved, &rows, net, &taken, &before);
            if other.n < best.n {
                best = other;
            }
        }
        let spent = std::mem::replace(&mut self.g, best.graph);
        self.g.take_over(&spent);
        self.writer = best.writer;
        best.condensed
    }

    /// A choice, written after what there was `before`.
    fn tried(
        &mut self,
        solved: &SolvedConstraint,
        rows: &[Direct],
        net: &[ExprId],
        taken: &[bool],
        before: &(Graph, SectionWriter),
    ) -> Trial {
        let spent = std::mem::replace(&mut self.g, before.0.clone());
        self.g.take_over(&spent);
        self.writer = before.1.clone();
        let (mut mass, mut net) = (self.hessian.clone(), net.to_vec());
        let mut is_left = vec![true; self.y.len()];
        self.writer.begin("dependent velocities taken out, M += c M_d + M_d c + c M_dd c, n += c n_d");
        for (row, _) in rows.iter().zip(taken).filter(|(_, taken)| **taken) {
            is_left[row.own] = false;
            self.take_out(row, &is_left, &mut mass, &mut net);
        }
        let condensed = self.along_what_is_left(solved, &is_left, &mass, &net);
        let roots: Vec<ExprId> = condensed.0.iter().flatten().chain(&condensed.1).copied().collect();
        Trial {
            n: self.n_operations(&roots),
            taken: taken.to_vec(),
            graph: self.g.clone(),
            writer: self.writer.clone(),
            condensed,
        }
    }

    /// `M_ab += c_a M_db + M_ad c_b + c_a M_dd c_b` and `n_a += c_a n_d` for `y_d = c^a y_a`.
    fn take_out(&mut self, row: &Direct, is_left: &[bool], mass: &mut [Vec<ExprId>], net: &mut [ExprId]) {
        let zero = self.g.zero();
        let own = mass[row.own].clone();
        let name = self.names[row.own].clone();
        let mut along = vec![zero; own.len()];
        for (a, c) in &row.by {
            along[*a] = *c;
        }
        // M_da + c_a M_dd.
        let mut moved = vec![zero; own.len()];
        for a in (0..own.len()).filter(|a| is_left[*a]) {
            let carried = self.g.mul(along[a], own[row.own]);
            let sum = self.g.add(own[a], carried);
            moved[a] = self.define(&format!("M_{name}_{}", self.names[a]), sum);
        }
        for a in (0..own.len()).filter(|a| is_left[*a]) {
            for b in (0..=a).filter(|b| is_left[*b]) {
                let forward = self.g.mul(along[a], moved[b]);
                let backward = self.g.mul(along[b], own[a]);
                let sum = self.g.sum(&[mass[a][b], forward, backward]);
                if sum != mass[a][b] {
                    mass[a][b] = self.define(&format!("M_{}_{}", self.names[a], self.names[b]), sum);
                    mass[b][a] = mass[a][b];
                }
            }
        }
        for (a, c) in &row.by {
            let carried = self.g.mul(*c, net[row.own]);
            let sum = self.g.add(net[*a], carried);
            net[*a] = self.define(&format!("n_{}", self.names[*a]), sum);
        }
    }

    /// `Psi^T M Psi` and `Psi^T n` over the velocities that are left.
    fn along_what_is_left(
        &mut self,
        solved: &SolvedConstraint,
        is_left: &[bool],
        mass: &[Vec<ExprId>],
        net: &[ExprId],
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
                let row: Vec<ExprId> = left.iter().map(|beta| mass[*alpha][*beta]).collect();
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
        let net: Vec<ExprId> = left.iter().map(|alpha| net[*alpha]).collect();
        let force = (0..k).map(|b| {
            let sum = self.g.dot(&column(b), &net);
            self.define(&format!("f_{}", names[b]), sum)
        });
        let force = force.collect();
        (matrix, force)
    }
}
