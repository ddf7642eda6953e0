//! Functions of a scene at states that are rows of an array.
//!
//! Deliberately does not know: scenes of Python, where the numbers of an array are.

use hamel_run::dynamics::{Dynamics, VecState};
use hamel_run::error::Error;
use hamel_run::evaluate::{derivative, unusable_states};
use hamel_runtime::F64x8;
use numpy::ndarray::{ArrayView2, ArrayViewD, ArrayViewMut2, ArrayViewMutD, Ix2};
use pyo3::prelude::*;

use crate::arrays::{Rows, RowsMut};
use crate::prepared::Prepared;

/// An array of states or results with the last axis of each; more axes in front are one.
pub(crate) fn two_axes(array: ArrayViewD<'_, f64>) -> PyResult<ArrayView2<'_, f64>> {
    array.into_dimensionality::<Ix2>().map_err(|_| two_axes_needed())
}

pub(crate) fn two_axes_mut(array: ArrayViewMutD<'_, f64>) -> PyResult<ArrayViewMut2<'_, f64>> {
    array.into_dimensionality::<Ix2>().map_err(|_| two_axes_needed())
}

pub(crate) fn two_axes_needed() -> PyErr {
    pyo3::exceptions::PyValueError::new_err("arrays of two axes are needed")
}

pub(crate) fn other_shapes() -> PyErr {
    pyo3::exceptions::PyValueError::new_err("arrays of other shapes than the scene's")
}

/// Groups of eight rows that are read before the first of them is evaluated. A lane is written at a time, and a
/// processor that reads all of them right afterwards waits.
const AT_ONCE: usize = 8;

/// The rates of all rows, eight at a time.
pub(crate) fn rates(
    scene: &Prepared,
    t: f64,
    rows: &Rows<'_>,
    out: &mut RowsMut<'_>,
    n_rows: usize,
    n: usize,
) -> bool {
    let Some(lanes) = scene.eight().filter(|_| n_rows >= F64x8::LANES) else {
        let dynamics = scene.one();
        return by_row(rows, out, n_rows, (n, n), |y, result| dynamics.rhs(t, y, result));
    };
    let zeros = VecState(vec![F64x8::splat(0.0); n]);
    let mut groups = vec![(0, zeros.clone(), zeros); AT_ONCE];
    let on_lanes = F64x8::splat(t);
    let mut is_finite = true;
    for first in (0..n_rows).step_by(AT_ONCE * F64x8::LANES) {
        let n_groups = (n_rows - first).div_ceil(F64x8::LANES).min(AT_ONCE);
        let groups = &mut groups[..n_groups];
        for (k, (at, y, _)) in groups.iter_mut().enumerate() {
            // The last eight have some rows of the eight before.
            *at = (first + k * F64x8::LANES).min(n_rows - F64x8::LANES);
            rows.lanes(*at, &mut y.0);
        }
        groups.iter_mut().for_each(|(_, y, dy)| lanes.rhs(on_lanes, y, dy));
        for (at, _, dy) in groups {
            is_finite &= out.set_lanes(*at, &dy.0);
        }
    }
    is_finite
}

/// Calls `f` with each row and the row of results.
pub(crate) fn by_row(
    rows: &Rows<'_>,
    out: &mut RowsMut<'_>,
    n_rows: usize,
    (n, width): (usize, usize),
    mut f: impl FnMut(&[f64], &mut [f64]),
) -> bool {
    let (mut y, mut result) = (vec![0.0; n], vec![0.0; width]);
    let mut is_finite = true;
    for k in 0..n_rows {
        rows.row(k, &mut y);
        f(&y, &mut result);
        is_finite &= out.set_row(k, &result);
    }
    is_finite
}

/// Writes numbers, or that there are none, which no result may be.
pub(crate) fn write(found: Option<&[f64]>, result: &mut [f64]) {
    match found {
        Some(found) => result.copy_from_slice(found),
        None => result.fill(f64::NAN),
    }
}

/// Why some of the states have no values: of the right-hand side, and if that has, then those that were asked for.
pub(crate) fn refuse(dynamics: &dyn Dynamics, states: ArrayView2<'_, f64>, t: f64) -> Result<(), Error> {
    check(dynamics, states, t)?;
    let reasons = vec![(0, "a result of one of the states is not finite".to_owned())];
    Err(unusable_states(reasons, states.nrows()))
}

/// Whether the equations can be evaluated at all states, or why not at some of them.
pub(crate) fn check(dynamics: &dyn Dynamics, states: ArrayView2<'_, f64>, t: f64) -> Result<(), Error> {
    let mut row = vec![0.0; states.ncols()];
    let rows = Rows::of(states);
    let mut reasons = Vec::new();
    for k in 0..states.nrows() {
        rows.row(k, &mut row);
        if let Err(reason) = derivative(dynamics, t, &row) {
            reasons.push((k, reason));
        }
    }
    if reasons.is_empty() { Ok(()) } else { Err(unusable_states(reasons, states.nrows())) }
}
