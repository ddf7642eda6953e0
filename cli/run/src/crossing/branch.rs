//! The set of positions and velocities that equations between coordinates and constraints leave, near a state: how near
//! it is to a place where the equations depend on each other, and the nearest state in it.
//!
//! Does not know: how a motion goes on.

use nalgebra::{DMatrix, DVector};

use crate::dynamics::{Dynamics, VecState};

/// A time and a state.
pub(crate) type Point = (f64, Vec<f64>);

/// Most steps of Newton's method.
const MAX_ROUNDS: usize = 12;

/// A change of a component, relative to its size or one, that is rounding.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Where Newton's method stops short of that, so little is left next to a singular position.
const LEFT: f64 = 1e-9;

/// Equations between coordinates of a scene and constraints on its velocities, near one state.
pub(super) struct Branch<'d> {
    pub(super) dynamics: &'d dyn Dynamics,
    n_equations: usize,
    /// What the functions are kept at.
    levels: Vec<f64>,
    /// The greatest length of each gradient on the way.
    lengths: Vec<f64>,
}

impl<'d> Branch<'d> {
    /// Through a state, with the greatest lengths of gradients on the way. None where there are no equations between
    /// coordinates.
    pub(super) fn through(
        dynamics: &'d dyn Dynamics,
        (t, y): (f64, &[f64]),
        lengths: &[f64],
    ) -> Option<Branch<'d>> {
        let mut branch = Branch::of(dynamics)?;
        dynamics.position_residuals(t, y, &mut branch.levels);
        branch.levels[..branch.n_equations].fill(0.0);
        branch.lengths.copy_from_slice(lengths);
        branch.lengths.iter().all(|length| length.is_finite() && *length > 0.0).then_some(branch)
    }

    /// Of no state in particular, with gradients as they are.
    fn of(dynamics: &'d dyn Dynamics) -> Option<Branch<'d>> {
        let found = dynamics.positions().filter(|found| found.n_equations > 0)?;
        let (n_equations, n_functions) = (found.n_equations, found.n_functions);
        Some(Branch {
            dynamics,
            n_equations,
            levels: vec![0.0; n_functions],
            lengths: vec![1.0; n_functions],
        })
    }

    /// Makes the greatest lengths of gradients those at some states, too.
    pub(super) fn lengthen(dynamics: &'d dyn Dynamics, states: &[Point], lengths: &mut Vec<f64>) {
        let Some(branch) = Branch::of(dynamics) else { return };
        lengths.resize(branch.lengths.len(), 0.0);
        for (t, y) in states {
            let gradients = branch.gradients(*t, y);
            lengths.iter_mut().zip(gradients.row_iter()).for_each(|(most, row)| *most = most.max(row.norm()));
        }
    }

    /// A row for each function, by the components of the state.
    fn gradients(&self, t: f64, y: &[f64]) -> DMatrix<f64> {
        let mut rows = vec![VecState(vec![0.0; y.len()]); self.levels.len()];
        self.dynamics.position_gradients(t, y, &mut rows);
        DMatrix::from_fn(rows.len(), y.len(), |i, j| rows[i].0[j] / self.lengths[i])
    }

    /// Singular values of the gradients of the equations, in lengths that these have elsewhere, in ascending order.
    pub(super) fn singular_values(&self, t: f64, y: &[f64]) -> Vec<f64> {
        let gradients = self.gradients(t, y);
        let equations = gradients.rows(0, self.n_equations).into_owned();
        if !equations.iter().all(|x| x.is_finite()) {
            return vec![f64::NAN; self.n_equations];
        }
        let mut values: Vec<f64> = equations.singular_values().iter().copied().collect();
        values.sort_by(f64::total_cmp);
        values
    }

    /// The least of them.
    pub(super) fn distance(&self, t: f64, y: &[f64]) -> f64 {
        self.singular_values(t, y).first().copied().unwrap_or(f64::NAN)
    }

    /// Moves a state to the nearest one that meets the equations, and its velocities to the nearest ones that meet the
    /// constraints; false where that fails.
    pub(super) fn meet(&self, t: f64, y: &mut [f64]) -> bool {
        self.meet_equations(t, y) && self.meet_constraints(t, y)
    }

    fn meet_equations(&self, t: f64, y: &mut [f64]) -> bool {
        let mut last = f64::INFINITY;
        for _ in 0..MAX_ROUNDS {
            let mut values = vec![0.0; self.levels.len()];
            self.dynamics.position_residuals(t, y, &mut values);
            let defects = DVector::from_iterator(
                values.len(),
                values.iter().zip(&self.levels).zip(&self.lengths).map(|((x, level), l)| (level - x) / l),
            );
            let Some(change) = least_change(self.gradients(t, y), &defects) else { return false };
            let size = moved(y, &change);
            if size <= ROUNDING || size >= last {
                return size <= LEFT;
            }
            last = size;
        }
        last <= LEFT
    }

    /// The constraints are linear in the velocities, with terms of their own where equations contain the time.
    fn meet_constraints(&self, t: f64, y: &mut [f64]) -> bool {
        for _ in 0..2 {
            let rows = self.dynamics.constraint_rows(t, y);
            let values = self.dynamics.constraint_residuals(t, y);
            let in_use: Vec<usize> =
                (0..rows.len().min(values.len())).filter(|k| rows[*k].0.iter().any(|x| *x != 0.0)).collect();
            if in_use.is_empty() {
                return true;
            }
            let jacobian = DMatrix::from_fn(in_use.len(), y.len(), |i, j| rows[in_use[i]].0[j]);
            let defects = DVector::from_iterator(in_use.len(), in_use.iter().map(|k| -values[*k]));
            let Some(change) = least_change(jacobian, &defects) else { return false };
            if moved(y, &change) <= ROUNDING {
                break;
            }
        }
        true
    }
}

/// The shortest solution of a system with fewer equations than unknowns, or as many.
fn least_change(rows: DMatrix<f64>, defects: &DVector<f64>) -> Option<DVector<f64>> {
    let is_finite = rows.iter().chain(defects.iter()).all(|x| x.is_finite());
    if !is_finite {
        return None;
    }
    let parts = rows.svd(true, true);
    let least = parts.singular_values.max() * 1e-13;
    parts.solve(defects, least).ok()
}

/// Moves a state and says by how much, relative to the size of each component or one.
fn moved(y: &mut [f64], change: &DVector<f64>) -> f64 {
    let mut most = 0.0_f64;
    for (y, change) in y.iter_mut().zip(change.iter()) {
        most = most.max(change.abs() / y.abs().max(1.0));
        *y += change;
    }
    most
}
