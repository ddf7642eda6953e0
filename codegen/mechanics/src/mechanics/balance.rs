//! Accelerations as the solution of the equations of motion, for those who differentiate them.
//!
//! Deliberately does not know: how equations are derived, by what anything is differentiated.

use hamel_expr::differentiate::Linear;
use hamel_expr::{ExprId, Graph, SectionWriter, SymbolId};

use super::solve::Factorisation;

/// What forces accelerations leave over, `r = A wdot - Lambda^T lambda - f`, and the constraint `w wdot + w0` that
/// multipliers keep.
///
/// # Shapes
/// With `n` rates and `k` multipliers, none where the constraint has been solved: accelerations, residual, solution
/// `[n + k]`; forces, names `[n]`; matrix `[n][n]`.
#[derive(Clone, Debug)]
pub struct Balance {
    /// Symbols of accelerations, which stand for no value, and their values along the motion.
    pub accelerations: Vec<(SymbolId, ExprId)>,
    /// `r`, along the directions of `matrix`, by the state, the definitions and the accelerations.
    pub residual: Vec<ExprId>,
    /// `r` along the velocities of the state, where `accelerations` begin with the rates of these.
    pub forces: Vec<ExprId>,
    /// `A = dr/dwdot`.
    pub matrix: Vec<Vec<ExprId>>,
    /// Where multipliers keep a constraint: after `wdot` come the multipliers, after the residual along `w` that of the
    /// constraint.
    pub kept: Option<Kept>,
    /// `wdot` and the multipliers, as the rates have them.
    pub solution: Vec<ExprId>,
    /// Names of `w`.
    pub names: Vec<String>,
}

/// A constraint `w wdot + w0 + slack lambda = 0` and the one-forms that its multipliers act along.
///
/// # Shapes
/// rows, forms: `[k][n]`; slack: `[k]`.
#[derive(Clone, Debug)]
pub struct Kept {
    /// `w`, a row for each multiplier.
    pub rows: Vec<Vec<ExprId>>,
    /// `Lambda`, a row for each multiplier.
    pub forms: Vec<Vec<ExprId>>,
    /// `1 - s` for a constraint that holds while a mode is on, zero for others.
    pub slack: Vec<ExprId>,
}

impl Balance {
    /// The values that belong to the equations.
    pub(super) fn values_mut(&mut self) -> impl Iterator<Item = &mut ExprId> {
        let Balance { accelerations, residual, forces, matrix, kept, solution, names: _ } = self;
        let accelerations = accelerations.iter_mut().map(|(_, value)| value);
        let kept = kept
            .iter_mut()
            .flat_map(|Kept { rows, forms, slack }| rows.iter_mut().chain(forms).flatten().chain(slack));
        accelerations
            .chain(residual)
            .chain(forces)
            .chain(matrix.iter_mut().flatten())
            .chain(kept)
            .chain(solution)
    }
}

/// Factors of the linear system of a [`Balance`].
#[derive(Clone, Debug)]
pub struct Factors {
    /// Of `A`.
    pub(super) inertia: Factorisation,
    pub(super) border: Option<Border>,
}

/// What multipliers add: `S = w A^-1 Lambda^T + slack`.
#[derive(Clone, Debug)]
pub(super) struct Border {
    pub(super) kept: Kept,
    /// `A^-1 Lambda^T`, a row for each multiplier.
    pub(super) response: Vec<Vec<ExprId>>,
    /// Of `S`.
    pub(super) schur: Factorisation,
}

/// Other right-hand sides by the same factors: `A x - Lambda^T mu = b`, `w x + slack mu = c`, so that
/// `S mu = c - w A^-1 b`, `x = A^-1 b + (A^-1 Lambda^T) mu`.
impl Linear for Factors {
    fn solve(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        labels: &[String],
        b: &[ExprId],
    ) -> Vec<ExprId> {
        let Some(Border { kept, response, schur }) = &self.border else {
            return self.inertia.solve(g, writer, labels, b);
        };
        let n = b.len() - response.len();
        let of_free: Vec<String> = labels[..n].iter().map(|label| format!("free_{label}")).collect();
        let free = self.inertia.solve(g, writer, &of_free, &b[..n]);
        let mut right = Vec::with_capacity(response.len());
        for (row, b) in kept.rows.iter().zip(&b[n..]) {
            let along = g.dot(row, &free);
            right.push(g.sub(*b, along));
        }
        let multipliers = schur.solve(g, writer, &labels[n..], &right);
        let mut x = Vec::with_capacity(b.len());
        for (k, free) in free.into_iter().enumerate() {
            let column: Vec<ExprId> = response.iter().map(|of_form| of_form[k]).collect();
            let pushed = g.dot(&column, &multipliers);
            let sum = g.add(free, pushed);
            x.push(writer.define(g, &labels[k], sum));
        }
        x.extend(multipliers);
        x
    }

    /// `A^T p + w^T q = b`, `-Lambda p + slack q = c`, so that `S^T q = c + Lambda A^-T b`.
    fn solve_transposed(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        labels: &[String],
        b: &[ExprId],
    ) -> Vec<ExprId> {
        let inertia = self.inertia.transposed();
        let Some(Border { kept, schur, .. }) = &self.border else {
            return inertia.solve(g, writer, labels, b);
        };
        let n = b.len() - kept.forms.len();
        let of_free: Vec<String> = labels[..n].iter().map(|label| format!("free_{label}")).collect();
        let free = inertia.solve(g, writer, &of_free, &b[..n]);
        let mut right = Vec::with_capacity(kept.forms.len());
        for (form, c) in kept.forms.iter().zip(&b[n..]) {
            let along = g.dot(form, &free);
            right.push(g.add(*c, along));
        }
        let multipliers = schur.transposed().solve(g, writer, &labels[n..], &right);
        let mut left = Vec::with_capacity(n);
        for (k, b) in b[..n].iter().enumerate() {
            let column: Vec<ExprId> = kept.rows.iter().map(|row| row[k]).collect();
            let pushed = g.dot(&column, &multipliers);
            left.push(g.sub(*b, pushed));
        }
        let mut x = inertia.solve(g, writer, &labels[..n], &left);
        x.extend(multipliers);
        x
    }
}
