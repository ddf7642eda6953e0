//! From brackets of momenta to those of the coordinates that a state has.
//!
//! Does not know: how the brackets of momenta were found.

use crate::mechanics::solve::Factorisation;
use crate::reduction::{KinematicConstraint, StateKind};
use hamel_expr::differentiate::Linearisation;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Section, SymbolId, needed_sections};

use super::builder::{Builder, MomentumForm};

/// A bracket of the state variables: entries `i < j` that do not vanish identically, the remainder, definitions.
pub(super) struct OnState {
    pub(super) entries: Vec<(usize, usize, ExprId)>,
    pub(super) remainder: Vec<ExprId>,
    pub(super) sections: Vec<Section>,
}

/// All entries of an antisymmetric matrix of `n` rows.
pub(super) fn dense(g: &mut Graph, n: usize, entries: &[(usize, usize, ExprId)]) -> Vec<Vec<ExprId>> {
    let mut matrix = vec![vec![g.zero(); n]; n];
    for &(i, j, e) in entries {
        matrix[i][j] = e;
        matrix[j][i] = g.neg(e);
    }
    matrix
}

impl Builder<'_> {
    /// `d pi/du`: `A = W^T L_yy Psi`, or `L_yy`.
    fn mass_matrix(&mut self) -> Vec<Vec<ExprId>> {
        let hessian = self.hessian.clone();
        let KinematicConstraint::Solved(solved) = &self.equations.system.constraint else { return hessian };
        let k = solved.unknowns.len();
        self.writer.begin("mass matrix A = W^T L_yy Psi");
        let columns: Vec<Vec<ExprId>> =
            (0..k).map(|a| solved.psi.iter().map(|row| row[a]).collect()).collect();
        let mut matrix = vec![vec![self.g.zero(); k]; k];
        for b in 0..k {
            for a in b..k {
                let value = self.bilinear(&hessian, &columns[b], &columns[a]);
                let [first, second] = [b, a].map(|a| &solved.unknowns[a].name);
                let named = self.writer.define(self.g, &format!("A_{first}_{second}"), value);
                (matrix[b][a], matrix[a][b]) = (named, named);
            }
        }
        matrix
    }

    /// From momenta to the coordinates of the state:
    ///
    /// ```text
    /// A {u, x} = {pi, x},   A {u, pi_b} = {pi, pi_b} - rho(W_b) pi,
    /// A {u, u} A^T = {pi_a, pi_b} + rho(W_a) pi_b - rho(W_b) pi_a,   A R_u = R_pi - d pi(R_x) - d pi/dt
    /// ```
    pub(super) fn on_state(&mut self, form: &MomentumForm) -> Result<OnState, Error> {
        let system = &self.equations.system;
        let k = system.unknowns.len();
        let (n, zero) = (self.equations.state.len(), self.g.zero());
        let kinds: Vec<StateKind> = system.state.iter().map(|(kind, _)| *kind).collect();
        let carries_velocities = kinds.iter().any(|kind| matches!(kind, StateKind::Unknown(_)));
        let mut of_velocities = Vec::new();
        let mut mixed = Vec::new();
        let mut by_x = Vec::new();
        let mut rates = Vec::new();
        if carries_velocities {
            let matrix = self.mass_matrix();
            let names: Vec<String> = system.unknowns.iter().map(|u| u.name.clone()).collect();
            self.writer.begin("factors of A");
            let (g, writer) = (&mut *self.g, &mut self.writer);
            let factors = Factorisation::new(g, writer, "A", &matrix, &names, &system.signs, &[])?;
            let solve = |b: &mut Self, stem: &str, right: &[ExprId]| -> Vec<ExprId> {
                let labels: Vec<String> = names.iter().map(|name| format!("{stem}_{name}")).collect();
                factors.solve(b.g, &mut b.writer, &labels, right)
            };
            self.writer.begin("brackets {u, x} = A^-1 {pi, x}");
            let base = system.algebroid.base().to_vec();
            for (row, x) in form.anchor.iter().zip(base) {
                let right: Vec<ExprId> = row.iter().map(|e| self.g.neg(*e)).collect();
                let name = format!("u_{}", self.g.name(x));
                by_x.push(solve(self, &name, &right));
            }
            if kinds.iter().any(|kind| matches!(kind, StateKind::Momentum { .. })) {
                self.writer.begin("brackets {u, pi}");
                for b in 0..k {
                    let right: Vec<ExprId> =
                        (0..k).map(|c| self.g.sub(form.momenta[c][b], form.turning[b][c])).collect();
                    mixed.push(solve(self, &format!("u_pi_{}", names[b]), &right));
                }
            }
            self.writer.begin("brackets {u, u} = A^-1 ({pi_a, pi_b} + rho(W_a) pi_b - rho(W_b) pi_a) A^-T");
            let mut columns = Vec::new();
            for b in 0..k {
                let mut right = Vec::new();
                for a in 0..k {
                    let back = self.g.neg(form.turning[b][a]);
                    let sum = self.g.sum(&[form.momenta[a][b], form.turning[a][b], back]);
                    let (first, second) = (&names[a.min(b)], &names[a.max(b)]);
                    right.push(match a.cmp(&b) {
                        std::cmp::Ordering::Equal => zero,
                        std::cmp::Ordering::Less => self.define(&format!("k_{first}_{second}"), sum),
                        std::cmp::Ordering::Greater => {
                            let back = self.g.neg(sum);
                            let named = self.define(&format!("k_{first}_{second}"), back);
                            self.g.neg(named)
                        }
                    });
                }
                columns.push(solve(self, &format!("k_{}", names[b]), &right));
            }
            // A^-1 on row a of A^-1 K gives row a of A^-1 K A^-T.
            for a in 0..k {
                let row: Vec<ExprId> = columns.iter().map(|column| column[a]).collect();
                of_velocities.push(solve(self, &format!("u_{}", names[a]), &row));
            }
            self.writer.begin("remainder R along velocities");
            let right: Vec<ExprId> =
                form.remainder[1].iter().zip(&form.lag).map(|(r, lag)| self.g.sub(*r, *lag)).collect();
            rates = solve(self, "r", &right);
        }
        let unknown_of = |place: usize| system.momenta[place].unknown;
        let mut entries = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                use StateKind::{Base, Momentum, Unknown};
                let value = match (kinds[i], kinds[j]) {
                    (Base(_), Base(_)) => zero,
                    (Base(x), Momentum { place, .. }) => form.anchor[x][unknown_of(place)],
                    (Momentum { place, .. }, Base(x)) => self.g.neg(form.anchor[x][unknown_of(place)]),
                    (Base(x), Unknown(a)) => self.g.neg(by_x[x][a]),
                    (Unknown(a), Base(x)) => by_x[x][a],
                    (Momentum { place: a, .. }, Momentum { place: b, .. }) => {
                        form.momenta[unknown_of(a)][unknown_of(b)]
                    }
                    (Unknown(a), Momentum { place, .. }) => mixed[unknown_of(place)][a],
                    (Momentum { place, .. }, Unknown(a)) => self.g.neg(mixed[unknown_of(place)][a]),
                    (Unknown(a), Unknown(b)) => of_velocities[a][b],
                };
                let value = self.g.cancel_zero(value);
                if value != zero {
                    entries.push((i, j, value));
                }
            }
        }
        let remainder = kinds.iter().map(|kind| match *kind {
            StateKind::Base(x) => form.remainder[0][x],
            StateKind::Unknown(a) => rates[a],
            StateKind::Momentum { place, .. } => form.remainder[1][unknown_of(place)],
        });
        let remainder: Vec<ExprId> = remainder.collect();
        let mut bracket = OnState { entries, remainder, sections: Vec::new() };
        if form.moving_energy != zero {
            self.take_moving_energy(form.moving_energy, &mut bracket);
        }
        bracket.remainder = bracket.remainder.iter().map(|e| self.g.cancel_zero(*e)).collect();
        self.g.within_budget()?;
        bracket.sections = std::mem::take(&mut self.writer).finish().0;
        Ok(bracket)
    }

    /// `R - Pi d<p, psi0>`: the energy is that of the velocities `Psi u` and `<p, psi0>`.
    fn take_moving_energy(&mut self, moving_energy: ExprId, bracket: &mut OnState) {
        let by: Vec<SymbolId> = self.equations.state.iter().map(|s| s.symbol).collect();
        let own = self.writer.clone().finish().0;
        let all: Vec<Section> = self.equations.sections.iter().cloned().chain(own).collect();
        let sections = needed_sections(self.g, &all, &[moving_energy]);
        let linear = Linearisation::new(self.g, &sections, &[moving_energy], &by);
        let name = |v: &str, x: &str| format!("d_{v}_d_{x}");
        let title = |section: &str| format!("derivatives of: {section}");
        let slopes = linear.jacobian(self.g, &mut self.writer, name, title).remove(0);
        let matrix = dense(self.g, bracket.remainder.len(), &bracket.entries);
        for (r, row) in bracket.remainder.iter_mut().zip(&matrix) {
            let sum = self.g.dot(row, &slopes);
            *r = self.g.sub(*r, sum);
        }
    }
}
