//! Accelerations as the solution of the equations of motion, for those who differentiate them.
//!
//! Deliberately does not know: how equations are derived, by what anything is differentiated.

use hamel_expr::differentiate::Linear;
use hamel_expr::{ExprId, Graph, SectionWriter, SymbolId};

use super::solve::Factorisation;

/// What forces accelerations leave over.
#[derive(Clone, Debug)]
pub struct Balance {
    /// Symbols of accelerations, which stand for no value, and their values along the motion.
    pub accelerations: Vec<(SymbolId, ExprId)>,
    /// `r`, along the directions of `matrix`, by the state, the definitions and the accelerations.
    pub residual: Vec<ExprId>,
    /// `A = dr/dwdot`.
    pub matrix: Vec<Vec<ExprId>>,
    /// `wdot`, as the rates have it.
    pub solution: Vec<ExprId>,
    /// Names of `w`.
    pub names: Vec<String>,
}

impl Balance {
    /// The values that belong to the equations.
    pub(super) fn values_mut(&mut self) -> impl Iterator<Item = &mut ExprId> {
        let Balance { accelerations, residual, matrix, solution, names: _ } = self;
        let accelerations = accelerations.iter_mut().map(|(_, value)| value);
        accelerations.chain(residual).chain(matrix.iter_mut().flatten()).chain(solution)
    }
}

/// Other right-hand sides by the same factors.
impl Linear for Factorisation {
    fn solve(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        labels: &[String],
        b: &[ExprId],
    ) -> Vec<ExprId> {
        Factorisation::solve(self, g, writer, labels, b)
    }

    fn solve_transposed(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        labels: &[String],
        b: &[ExprId],
    ) -> Vec<ExprId> {
        self.transposed().solve(g, writer, labels, b)
    }
}
