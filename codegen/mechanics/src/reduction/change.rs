//! A change of frame: the matrices, and what becomes of velocities, one-forms and momenta.
//!
//! Does not know: systems, which frame is wanted and why.

use std::ops::Range;

use hamel_expr::{ExprId, Graph, SymbolId};

use super::constraint::Unknown;
use super::stages::Stages;

/// The frame of a system by the one that its model is written in: `y^alpha = T^alpha_a eta^a` for the velocities `y` of
/// the model and `eta` of the system.
///
/// # Shapes
/// `matrix`, `inverse`: `[m][m]`, the identity in the rows of velocities that are those of the model.
#[derive(Clone, Debug)]
pub struct Frame {
    /// The velocities `y` of the model, base velocities first.
    pub original: Vec<Unknown>,
    /// `T`: column `a` has the components of section `a` in the frame of the model.
    pub matrix: Vec<Vec<ExprId>>,
    /// The inverse of `T`.
    pub inverse: Vec<Vec<ExprId>>,
}

/// A velocity that the model does not have, as a function of the model's own variables.
#[derive(Clone, Debug)]
pub struct Change {
    /// Its name.
    pub name: String,
    /// Its symbol.
    pub symbol: SymbolId,
    /// Its value, in the independent velocities of the model, base coordinates, parameters and time.
    pub value: ExprId,
}

impl Frame {
    /// The frame that is adapted to stages behind `n_shape` base velocities: `T = [[1, 0], [-F A, F]]` with the adapted
    /// elements for the columns of `F` and the connections `A` of the stages.
    pub(super) fn adapted(g: &mut Graph, stages: &Stages, original: Vec<Unknown>) -> Frame {
        let (m, r) = (original.len(), stages.basis.len());
        let n = m - r;
        let unit = |i: usize, j: usize| if i == j { g.one() } else { g.zero() };
        let mut matrix: Vec<Vec<ExprId>> = (0..m).map(|i| (0..m).map(|j| unit(i, j)).collect()).collect();
        let mut inverse = matrix.clone();
        for a in 0..r {
            for k in 0..r {
                matrix[n + a][n + k] = stages.basis[k][a];
                inverse[n + k][n + a] = stages.inverse[a][k];
            }
        }
        for (k, row) in stages.connection.iter().flatten().enumerate() {
            inverse[n + k][..n].copy_from_slice(row);
            for a in 0..r {
                for (i, e) in row.iter().enumerate() {
                    let along = g.mul(stages.basis[k][a], *e);
                    matrix[n + a][i] = g.sub(matrix[n + a][i], along);
                }
            }
        }
        Frame { original, matrix, inverse }
    }

    /// Every coefficient.
    pub(super) fn expressions_mut(&mut self) -> impl Iterator<Item = &mut ExprId> {
        let Frame { original: _, matrix, inverse } = self;
        matrix.iter_mut().flatten().chain(inverse.iter_mut().flatten())
    }

    /// Whether the velocities in a range are those of the model, and no other one depends on them.
    pub(super) fn keeps(&self, g: &Graph, range: Range<usize>) -> bool {
        let unit = |i: usize, j: usize| if i == j { g.one() } else { g.zero() };
        let m = self.matrix.len();
        range
            .into_iter()
            .all(|k| (0..m).all(|i| self.matrix[i][k] == unit(i, k) && self.matrix[k][i] == unit(k, i)))
    }

    /// `y = T eta`.
    pub fn velocities(&self, g: &mut Graph, eta: &[ExprId]) -> Vec<ExprId> {
        self.matrix.iter().map(|row| contract(g, row, eta)).collect()
    }

    /// The components of a section in the frame of the system: `s^a = (T^-1)^a_alpha s^alpha`.
    pub(super) fn components(&self, g: &mut Graph, section: &[ExprId]) -> Vec<ExprId> {
        self.inverse.iter().map(|row| tidied(g, |g| contract(g, row, section))).collect()
    }

    /// The components of a one-form in the frame of the system: `w_a = w_alpha T^alpha_a`.
    pub(super) fn one_form(&self, g: &mut Graph, form: &[ExprId]) -> Vec<ExprId> {
        (0..form.len()).map(|a| tidied(g, |g| contract_column(g, form, &self.matrix, a))).collect()
    }

    /// The components of momenta in the frame of the model: `p_alpha = (T^-1)^a_alpha p_a`.
    pub fn momenta(&self, g: &mut Graph, p: &[ExprId]) -> Vec<ExprId> {
        (0..p.len()).map(|alpha| contract_column(g, p, &self.inverse, alpha)).collect()
    }
}

/// `sum_k a_k b_k`.
pub(super) fn contract(g: &mut Graph, a: &[ExprId], b: &[ExprId]) -> ExprId {
    let pairs = a.iter().zip(b).filter(|(x, y)| **x != g.zero() && **y != g.zero());
    let pairs: Vec<(ExprId, ExprId)> = pairs.map(|(x, y)| (*x, *y)).collect();
    let terms: Vec<ExprId> = pairs.into_iter().map(|(x, y)| g.mul(x, y)).collect();
    g.sum(&terms)
}

/// `sum_k a_k rows[k][column]`.
pub(super) fn contract_column(g: &mut Graph, a: &[ExprId], rows: &[Vec<ExprId>], column: usize) -> ExprId {
    let column: Vec<ExprId> = rows.iter().map(|row| row[column]).collect();
    contract(g, a, &column)
}

/// What is made, as zero where it vanishes.
pub(super) fn tidied(g: &mut Graph, make: impl FnOnce(&mut Graph) -> ExprId) -> ExprId {
    let e = make(g);
    g.cancel_zero(e)
}
