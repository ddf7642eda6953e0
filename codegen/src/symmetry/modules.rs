//! Functions that the group moves, as combinations of finitely many: the matrices are a representation, its dual is
//! what advects.
//!
//! With `X_a v_i = sum_j D_a,ij v_j` and `f = sum_i c_i v_i + f_0`, `f_0` invariant, at `g sigma` the function is
//! `sum_i a_i v_i(sigma) + f_0(sigma)` with `a(e) = c` and `a_k' = sum_a xi^a sum_j D_a,jk a_j`.
//!
//! Does not know: which functions these are.

use hamel_expr::{ExprId, Rational};
use num_traits::{One, Signed, Zero};

use super::group::SymmetryGroup;
use super::setting::{Images, Setting};

/// Functions that the group moves together: one representation for all of them, which is never larger than theirs one
/// by one.
pub(super) struct Module {
    /// `v_i`, an entry for each function.
    pub(super) basis: Vec<Vec<ExprId>>,
    /// `D_a,ij`, by field.
    pub(super) matrices: Vec<Vec<Vec<Rational>>>,
    /// `c_i`.
    pub(super) start: Vec<Rational>,
    /// `f_0`, an entry for each function.
    pub(super) rest: Vec<ExprId>,
}

/// Modules of more functions are taken for infinite ones.
pub(super) const MAX_DIM: usize = 16;

/// A basis, and the matrices of the fields in it.
type Span = (Vec<Vec<ExprId>>, Vec<Vec<Vec<Rational>>>);

impl Setting<'_> {
    /// The module of functions, unless it is larger than [`MAX_DIM`].
    pub(super) fn module(&mut self, group: &SymmetryGroup, functions: &[ExprId]) -> Option<Module> {
        let slopes = self.slopes(group, functions);
        let (basis, matrices) = self.span(group, slopes.clone())?;
        // The part that moves, where a combination of what its derivatives make moves as it does.
        let columns: Vec<Vec<ExprId>> = basis.iter().map(|v| self.slopes(group, v).concat()).collect();
        if let Some(start) = self.combination_of_rows(&columns, &slopes.concat()) {
            // One sign for all, so that the first that is there at the start is positive.
            let first = start.iter().find(|c| !c.is_zero());
            let sign =
                if first.is_some_and(Signed::is_negative) { -Rational::one() } else { Rational::one() };
            let basis: Vec<Vec<ExprId>> = (basis.into_iter())
                .map(|v| v.into_iter().map(|e| self.graph.scale(e, &sign)).collect())
                .collect();
            let start: Vec<Rational> = start.into_iter().map(|c| c * &sign).collect();
            let rest = functions.iter().enumerate().map(|(r, f)| {
                let moved = basis.iter().zip(&start).map(|(v, c)| (v[r], -c.clone()));
                let terms: Vec<(ExprId, Rational)> = moved.chain([(*f, Rational::one())]).collect();
                self.graph.linear_combination(&terms)
            });
            let rest = rest.collect();
            return Some(Module { basis, matrices, start, rest });
        }
        let (basis, matrices) = self.span(group, vec![functions.to_vec()])?;
        let start = (0..basis.len()).map(|i| Rational::from_integer(i64::from(i == 0).into())).collect();
        Some(Module { basis, matrices, start, rest: vec![self.graph.zero(); functions.len()] })
    }

    /// `X_a f` for each field, an entry for each function.
    fn slopes(&mut self, group: &SymmetryGroup, functions: &[ExprId]) -> Vec<Vec<ExprId>> {
        let along = |s: &mut Self, field: &Images| {
            functions.iter().map(|f| s.graph.derivative_along(*f, field)).collect()
        };
        group.fields.iter().map(|field| along(self, &field.images)).collect()
    }

    /// A basis of the functions and of what the fields make of them, with the matrices.
    fn span(&mut self, group: &SymmetryGroup, mut pending: Vec<Vec<ExprId>>) -> Option<Span> {
        let mut basis: Vec<Vec<ExprId>> = Vec::new();
        let mut next = 0;
        loop {
            for h in std::mem::take(&mut pending) {
                let is_zero = h.iter().all(|e| self.vanishes(*e));
                if !is_zero && self.combination_of_rows(&basis, &h).is_none() {
                    if basis.len() == MAX_DIM {
                        return None;
                    }
                    basis.push(h);
                }
            }
            let Some(v) = basis.get(next).cloned() else { break };
            next += 1;
            pending = self.slopes(group, &v);
        }
        let mut matrices = vec![Vec::new(); group.fields.len()];
        for v in basis.clone() {
            for (a, slope) in self.slopes(group, &v).into_iter().enumerate() {
                let row = match slope.iter().all(|e| self.vanishes(*e)) {
                    true => vec![Rational::zero(); basis.len()],
                    false => self.combination_of_rows(&basis, &slope)?,
                };
                matrices[a].push(row);
            }
        }
        Some((basis, matrices))
    }
}
