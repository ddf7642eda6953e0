//! Functions that the group moves, as combinations of finitely many: the matrices are a representation, its dual is what
//! advects.
//!
//! With `X_a v_i = sum_j D_a,ij v_j` and `f = sum_i c_i v_i + f_0`, `f_0` invariant, at `g sigma` the function is
//! `sum_i a_i v_i(sigma) + f_0(sigma)` with `a(e) = c` and `a_k' = sum_a xi^a sum_j D_a,jk a_j`.
//!
//! Does not know: which functions these are.

use hamel_expr::{ExprId, Rational};
use num_traits::{One, Signed, Zero};

use super::group::SymmetryGroup;
use super::setting::Setting;

/// A function that the group moves.
pub(super) struct Module {
    /// `v_i`.
    pub(super) basis: Vec<ExprId>,
    /// `D_a,ij`, by field.
    pub(super) matrices: Vec<Vec<Vec<Rational>>>,
    /// `c_i`.
    pub(super) start: Vec<Rational>,
    /// `f_0`.
    pub(super) rest: ExprId,
}

/// Modules of more functions are taken for infinite ones.
const MAX_DIM: usize = 12;

impl Setting<'_> {
    /// The module of a function; none where it is larger than is looked at.
    pub(super) fn module(&mut self, group: &SymmetryGroup, f: ExprId) -> Option<Module> {
        let slopes = self.slopes(group, f);
        let (basis, matrices) = self.span(group, slopes.clone(), Vec::new())?;
        // The part of `f` that moves, where a combination of what its derivatives make moves as it does.
        let columns: Vec<Vec<ExprId>> = basis.iter().map(|v| self.slopes(group, *v)).collect();
        if let Some(start) = self.combination_of_rows(&columns, &slopes) {
            // One sign for all, so that the first that is there at the start is positive.
            let first = start.iter().find(|c| !c.is_zero());
            let sign = if first.is_some_and(Signed::is_negative) { -Rational::one() } else { Rational::one() };
            let basis: Vec<ExprId> = basis.into_iter().map(|v| self.graph.scale(v, &sign)).collect();
            let start: Vec<Rational> = start.into_iter().map(|c| c * &sign).collect();
            let mut terms: Vec<(ExprId, Rational)> =
                basis.iter().zip(&start).map(|(v, c)| (*v, -c.clone())).collect();
            terms.push((f, Rational::from_integer(1.into())));
            let rest = self.graph.linear_combination(&terms);
            return Some(Module { basis, matrices, start, rest });
        }
        let (basis, matrices) = self.span(group, vec![f], Vec::new())?;
        let start = (0..basis.len()).map(|i| Rational::from_integer(i64::from(i == 0).into())).collect();
        Some(Module { basis, matrices, start, rest: self.graph.zero() })
    }

    fn slopes(&mut self, group: &SymmetryGroup, f: ExprId) -> Vec<ExprId> {
        group.fields.iter().map(|field| self.graph.derivative_along(f, &field.images)).collect()
    }

    /// A basis of the functions and of what the fields make of them, with the matrices.
    #[allow(clippy::type_complexity, reason = "two results that belong together")]
    fn span(
        &mut self,
        group: &SymmetryGroup,
        mut pending: Vec<ExprId>,
        mut basis: Vec<ExprId>,
    ) -> Option<(Vec<ExprId>, Vec<Vec<Vec<Rational>>>)> {
        let mut next = 0;
        loop {
            for h in std::mem::take(&mut pending) {
                if !self.vanishes(h) && self.combination(&basis, h).is_none() {
                    if basis.len() == MAX_DIM {
                        return None;
                    }
                    basis.push(h);
                }
            }
            let Some(v) = basis.get(next).copied() else { break };
            next += 1;
            pending = self.slopes(group, v);
        }
        let mut matrices = vec![Vec::new(); group.fields.len()];
        for v in basis.clone() {
            for (a, slope) in self.slopes(group, v).into_iter().enumerate() {
                let row = match self.vanishes(slope) {
                    true => vec![Rational::zero(); basis.len()],
                    false => self.combination(&basis, slope)?,
                };
                matrices[a].push(row);
            }
        }
        Some((basis, matrices))
    }
}
