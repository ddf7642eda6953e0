//! Functions that the group moves, as combinations of finitely many: the matrices are a representation, its dual is
//! what advects.
//!
//! Of constraints that the group mixes with numbers `lambda_a`, only `X_a phi - lambda_a phi` moves: at `g
//! sigma` they are a matrix times what advects, and the matrix is divided by. `X_a` below is `X_a - lambda_a` then.
//!
//! With `X_a v_i = sum_j D_a,ij v_j` and `f = sum_i c_i v_i + f_0`, `f_0` invariant, at `g sigma` the function is
//! `sum_i a_i v_i(sigma) + f_0(sigma)` with `a(e) = c` and `a_k' = sum_a xi^a sum_j D_a,jk a_j`.
//!
//! Does not know: which functions these are.

use hamel_expr::{ExprId, Rational, SymbolId};
use num_traits::{One, Signed, Zero};

use super::group::SymmetryGroup;
use super::setting::{Images, Setting};

/// `lambda_a` by field, rows and columns by function.
pub(super) type Twist = Vec<Vec<Vec<Rational>>>;

/// Functions that the group moves together: one representation for all of them, which is never larger than theirs one
/// by one.
#[derive(Clone)]
pub(super) struct Module {
    /// What mixes the functions.
    pub(super) twist: Twist,
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
    pub(super) fn module(
        &mut self,
        group: &SymmetryGroup,
        functions: &[ExprId],
        twist: Twist,
    ) -> Option<Module> {
        let slopes = self.slopes((group, &twist), functions);
        let (basis, matrices) = self.span((group, &twist), slopes.clone())?;
        // The part that moves, where a combination of what its derivatives make moves as it does.
        let columns: Vec<Vec<ExprId>> =
            basis.iter().map(|v| self.slopes((group, &twist), v).concat()).collect();
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
            return Some(Module { twist, basis, matrices, start, rest });
        }
        let (basis, matrices) = self.span((group, &twist), vec![functions.to_vec()])?;
        let start = (0..basis.len()).map(|i| Rational::from_integer(i64::from(i == 0).into())).collect();
        Some(Module { twist, basis, matrices, start, rest: vec![self.graph.zero(); functions.len()] })
    }

    /// `X_a f - lambda_a f` for each field, an entry for each function.
    fn slopes(&mut self, (group, twist): (&SymmetryGroup, &Twist), functions: &[ExprId]) -> Vec<Vec<ExprId>> {
        let mut all = Vec::with_capacity(group.fields.len());
        for (field, lambda) in group.fields.iter().zip(twist) {
            let mut slopes = Vec::with_capacity(functions.len());
            for (f, row) in functions.iter().zip(lambda) {
                slopes.push(self.twisted_slope(&field.images, *f, (functions, row)));
            }
            all.push(slopes);
        }
        all
    }

    /// `X f - sum_d lambda_d f_d`.
    pub(super) fn twisted_slope(
        &mut self,
        field: &Images,
        f: ExprId,
        (functions, lambda): (&[ExprId], &[Rational]),
    ) -> ExprId {
        let slope = self.graph.derivative_along(f, field);
        let mut terms = vec![(slope, Rational::one())];
        terms.extend(functions.iter().zip(lambda).map(|(f, q)| (*f, -q.clone())));
        self.graph.linear_combination(&terms)
    }

    /// Numbers that mix constraints as the group mixes their parts along velocities of coordinates, where it does.
    pub(super) fn twist(&mut self, group: &SymmetryGroup, constraints: &[ExprId]) -> Option<Twist> {
        let n_base = self.model.base.len();
        let at_rest =
            |s: &Self, all: &[SymbolId]| -> Images { all.iter().map(|y| (*y, s.graph.zero())).collect() };
        let rest = at_rest(self, &self.velocities);
        let of_groups = at_rest(self, &self.velocities[n_base..]);
        let mut parts = Vec::with_capacity(constraints.len());
        for phi in constraints {
            let [along, offset] = [&of_groups, &rest].map(|values| self.graph.subs(*phi, values).ok());
            parts.push(self.graph.sub(along?, offset?));
        }
        let mut twist = Vec::with_capacity(group.fields.len());
        for field in &group.fields {
            let mut rows = Vec::with_capacity(parts.len());
            for part in &parts {
                let slope = self.graph.derivative_along(*part, &field.images);
                rows.push(match self.vanishes(slope) {
                    true => vec![Rational::zero(); parts.len()],
                    false => self.combination(&parts, slope)?,
                });
            }
            twist.push(rows);
        }
        Some(twist)
    }

    /// A basis of the functions and of what the fields make of them, with the matrices.
    fn span(
        &mut self,
        (group, twist): (&SymmetryGroup, &Twist),
        mut pending: Vec<Vec<ExprId>>,
    ) -> Option<Span> {
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
            pending = self.slopes((group, twist), &v);
        }
        let mut matrices = vec![Vec::new(); group.fields.len()];
        for v in basis.clone() {
            for (a, slope) in self.slopes((group, twist), &v).into_iter().enumerate() {
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
