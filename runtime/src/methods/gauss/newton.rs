//! Newton's iteration for the stages: one matrix of all stages, factored with the largest pivots.
//!
//! Does not know starting values, or when an iteration ends.

use core::ops::Range;

use super::tableaux::{GAUSS4, GAUSS6, GAUSS8, MIDPOINT};
use super::{Gauss, GaussStorage, Newton, evaluate_stage, finish, weigh};
use crate::error::Error;
use crate::methods::iteration::{Change, iterate, not_converged};
use crate::methods::{Method, Step, Tableau};
use crate::options::Options;
use crate::real::Real;
use crate::system::{Differentiable, SquareStorage, StateVector};

/// What Newton's iteration needs: the Jacobian, the matrix `1 - h A x J` and its factors, and residuals.
#[derive(Clone, Debug)]
pub struct NewtonWorkspace<R: Real, V: SquareStorage<R>, const STAGES: usize> {
    jacobian: V::Rows,
    /// Blocks of the rows of a stage and the columns of another.
    factors: [[V::Rows; STAGES]; STAGES],
    /// Row that was exchanged with each row.
    pivots: [V::Positions; STAGES],
    /// The row of the pivot.
    pivot_row: [V; STAGES],
    residuals: [V; STAGES],
}

/// Stages and components from a place on, in the order of the rows.
fn places<const STAGES: usize>(from: (usize, usize), n: usize) -> impl Iterator<Item = (usize, usize)> {
    let first = move |i: usize| if i == from.0 { from.1 } else { 0 };
    (from.0..STAGES).flat_map(move |i| (first(i)..n).map(move |row| (i, row)))
}

impl<R: Real, V: SquareStorage<R>, const STAGES: usize> NewtonWorkspace<R, V, STAGES> {
    fn new(y0: &V) -> Self {
        let states = || core::array::from_fn(|_| y0.zeros_like());
        Self {
            jacobian: y0.rows_like(),
            factors: core::array::from_fn(|_| core::array::from_fn(|_| y0.rows_like())),
            pivots: core::array::from_fn(|_| y0.positions_like()),
            pivot_row: states(),
            residuals: states(),
        }
    }

    /// Number of components of a state.
    fn n(&self) -> usize {
        self.residuals[0].as_slice().len()
    }

    /// The columns of a row that belong to a stage.
    fn row(&mut self, (i, row): (usize, usize), j: usize) -> &mut [R] {
        self.factors[i][j].as_mut()[row].as_mut_slice()
    }

    /// Writes `1 - h A x J` and factors it by elimination with the largest pivots; false if one vanishes.
    fn factor(&mut self, h: R, tableau: &Tableau) -> bool {
        let n = self.n();
        for i in 0..STAGES {
            for j in 0..STAGES {
                let a = h * tableau.stages[i + 1][j].1.get();
                let rows = self.factors[i][j].as_mut().iter_mut().zip(self.jacobian.as_ref());
                for (row, (factors, jacobian)) in rows.enumerate() {
                    let entries = factors.as_mut_slice().iter_mut().zip(jacobian.as_slice());
                    for (column, (factor, &entry)) in entries.enumerate() {
                        let one = if i == j && row == column { R::ONE } else { R::ZERO };
                        *factor = one - a * entry;
                    }
                }
            }
        }
        for (i, row) in places::<STAGES>((0, 0), n) {
            let mut largest = (i, row, self.row((i, row), i)[row].magnitude());
            for (target, target_row) in places::<STAGES>((i, row), n).skip(1) {
                let size = self.row((target, target_row), i)[row].magnitude();
                if size > largest.2 {
                    largest = (target, target_row, size);
                }
            }
            let largest = (largest.0, largest.1);
            self.pivots[i].as_mut()[row] = largest.0 * n + largest.1;
            if largest != (i, row) {
                for j in 0..STAGES {
                    for column in 0..n {
                        let saved = self.row((i, row), j)[column];
                        let other = core::mem::replace(&mut self.row(largest, j)[column], saved);
                        self.row((i, row), j)[column] = other;
                    }
                }
            }
            for j in 0..STAGES {
                self.pivot_row[j].as_mut_slice().copy_from_slice(self.factors[i][j].as_ref()[row].as_slice());
            }
            let pivot = self.pivot_row[i].as_slice()[row];
            if !pivot.all_ne(R::ZERO) || !pivot.all_finite() {
                return false;
            }
            for (target, target_row) in places::<STAGES>((i, row), n).skip(1) {
                let entry = &mut self.factors[target][i].as_mut()[target_row].as_mut_slice()[row];
                let ratio = *entry / pivot;
                *entry = ratio;
                for j in i..STAGES {
                    let first = if j == i { row + 1 } else { 0 };
                    let out = &mut self.factors[target][j].as_mut()[target_row].as_mut_slice()[first..];
                    for (out, &entry) in out.iter_mut().zip(&self.pivot_row[j].as_slice()[first..]) {
                        *out -= ratio * entry;
                    }
                }
            }
        }
        true
    }

    /// Replaces the residuals by the solution.
    fn solve(&mut self) {
        let n = self.n();
        for (i, row) in places::<STAGES>((0, 0), n) {
            let pivot = self.pivots[i].as_ref()[row];
            let (other, other_row) = (pivot / n, pivot % n);
            let saved = self.residuals[i].as_slice()[row];
            let exchanged = core::mem::replace(&mut self.residuals[other].as_mut_slice()[other_row], saved);
            self.residuals[i].as_mut_slice()[row] = exchanged;
            // Exchanges before elimination: later exchanges have permuted the multipliers too.
        }
        for (i, row) in places::<STAGES>((0, 0), n) {
            let known = self.known((i, row), 0..i, 0..row);
            self.residuals[i].as_mut_slice()[row] -= known;
        }
        for i in (0..STAGES).rev() {
            for row in (0..n).rev() {
                let known = self.known((i, row), i + 1..STAGES, row + 1..n);
                let pivot = self.factors[i][i].as_ref()[row].as_slice()[row];
                let residual = &mut self.residuals[i].as_mut_slice()[row];
                *residual = (*residual - known) / pivot;
            }
        }
    }

    /// The sum of a row over the residuals of other stages and of components of its own, in the order of components.
    fn known(&self, (i, row): (usize, usize), stages: Range<usize>, own: Range<usize>) -> R {
        let n = self.n();
        let add = |sum: R, j: usize, columns: Range<usize>| {
            let factors = &self.factors[i][j].as_ref()[row].as_slice()[columns.clone()];
            let terms = factors.iter().zip(&self.residuals[j].as_slice()[columns]);
            terms.fold(sum, |sum, (&factor, &residual)| sum + factor * residual)
        };
        if stages.start <= i {
            let sum = stages.fold(R::ZERO, |sum, j| add(sum, j, 0..n));
            add(sum, i, own)
        } else {
            stages.fold(add(R::ZERO, i, own), |sum, j| add(sum, j, 0..n))
        }
    }
}

impl<R: Real, S: Differentiable<R>, const STAGES: usize> Method<R, S> for Gauss<STAGES, Newton>
where
    S::State: SquareStorage<R>,
{
    const TABLEAU: &'static Tableau = match STAGES {
        1 => &Tableau { name: "midpoint-newton", ..MIDPOINT },
        2 => &Tableau { name: "gauss4-newton", ..GAUSS4 },
        3 => &Tableau { name: "gauss6-newton", ..GAUSS6 },
        4 => &Tableau { name: "gauss8-newton", ..GAUSS8 },
        _ => panic!("Gauss methods have 1, 2, 3 or 4 stages"),
    };

    type Storage = GaussStorage<R, S::State, NewtonWorkspace<R, S::State, STAGES>, STAGES>;

    fn storage(&self, _system: &S, _t0: R, y0: &S::State, _options: &Options<R>) -> Self::Storage {
        GaussStorage::new(y0, NewtonWorkspace::new(y0))
    }

    fn stages(storage: &Self::Storage) -> &[S::State] {
        &storage.stages[..STAGES + 1]
    }

    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
        &mut storage.stages[..STAGES + 1]
    }

    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        storage.predict::<S, Newton>(step);
        let GaussStorage { stages, increments, workspace, .. } = storage;
        let method = <Self as Method<R, S>>::TABLEAU.name;
        step.system.jacobian(step.t, &step.from.state, workspace.jacobian.as_mut());
        *step.jacobian_evals += 1;
        if !workspace.factor(step.h, Self::TABLEAU) {
            return Err(not_converged(method, step, 0));
        }
        let h = step.h.magnitude();
        iterate(method, step, |step| {
            let mut sum = Change::default();
            for (i, (residual, stage)) in workspace.residuals.iter_mut().zip(&*stages).enumerate() {
                evaluate_stage::<R, S, STAGES, Newton>(increments, i, step, residual);
                for (residual, &stage) in residual.as_mut_slice().iter_mut().zip(stage.as_slice()) {
                    *residual -= stage;
                }
            }
            workspace.solve();
            for (i, (stage, correction)) in stages.iter_mut().zip(&workspace.residuals).enumerate() {
                let corrections = correction.as_slice().iter().zip(step.from.state.as_slice());
                for (k, (&correction, &y)) in stage.as_mut_slice().iter_mut().zip(corrections) {
                    *k += correction;
                    sum.add(h, y, *k, correction);
                }
                weigh::<R, _, STAGES, Newton>(i, stage, &mut increments[i]);
            }
            sum
        })?;
        finish(Self::TABLEAU, stages, step);
        Ok(())
    }
}
