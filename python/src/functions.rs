//! Functions of scenes that take more than a state: forces at accelerations, images of the states of a total system.
//!
//! Deliberately does not know: scenes as objects of Python.

use hamel_codegen::scene::{Executable, Role};
use hamel_codegen::spec::{self, Want};
use hamel_expr::rational_to_f64;
use hamel_run::dynamics::Dynamics;
use hamel_run::error::Error;
use hamel_run::model::Checked;
use numpy::ndarray::{ArrayViewD, ArrayViewMutD, s};
use pyo3::prelude::*;

use crate::arrays::{Rows, RowsMut, in_pieces};
use crate::errors::OrRaise as _;
use crate::rows::{by_row, other_shapes, refuse, two_axes, two_axes_mut, write};

/// Names of the components of a state, and parameters with their defaults.
pub(crate) type TotalVariables = (Vec<String>, Vec<(String, f64)>);
/// Rows of numbers, the time, and the rows that results go to.
type At<'a> = (ArrayViewD<'a, f64>, f64, ArrayViewMutD<'a, f64>);
/// The cost of a row, and whether there may be threads.
type How = (u64, Option<bool>);

/// Writes `m` numbers for each row of a state, `n` numbers, with a vector behind it.
pub(crate) fn of_pairs(
    py: Python<'_>,
    dynamics: &dyn Dynamics,
    (n, m): (usize, usize),
    (pairs, t, out): At<'_>,
    how: How,
    of: impl Fn(&[f64], &[f64]) -> Option<Vec<f64>> + Send + Sync,
) -> PyResult<()> {
    let (pairs, out) = (two_axes(pairs)?, two_axes_mut(out)?);
    if pairs.ncols() != n + m || out.dim() != (pairs.nrows(), m) {
        return Err(other_shapes());
    }
    let write = |row: &[f64], result: &mut [f64]| {
        write(of(&row[..n], &row[n..]).filter(|found| found.len() == m).as_deref(), result);
    };
    let done = py.detach(|| {
        let work = |rows: &Rows<'_>, out: &mut RowsMut<'_>, n_rows: usize| {
            by_row(rows, out, n_rows, (n + m, m), write)
        };
        match in_pieces(pairs, out, how, work) {
            Ok(true) => Ok(()),
            Ok(false) => refuse(dynamics, pairs.slice(s![.., ..n]), t),
            Err(error) => Err(error),
        }
    });
    done.or_raise(py)
}

/// Files of the models that a model is the quotient of, and the variables of the map, where its scene has it.
pub(crate) fn total(
    model: &Checked,
    scene: &Executable,
) -> Result<(Vec<String>, Option<TotalVariables>), Error> {
    let files = model.totals.iter().map(|total| total.file.clone()).collect();
    let role = Role::OfVariables(Want::Quotient.name().to_owned());
    let origin = model.totals.iter().find_map(|total| total.origin.as_ref());
    let (Some(function), Some(origin)) = (scene.program.function(&role), origin) else {
        return Ok((files, None));
    };
    let total = spec::parse(&origin.file, &origin.text)?;
    let (names, n) = (&function.argument, function.argument.len().saturating_sub(total.params.len()));
    let default = |name: &String| {
        let param = total.params.iter().find(|param| param.name == *name);
        Some((name.clone(), rational_to_f64(&param?.default)))
    };
    Ok((files, Some((names[..n].to_vec(), names[n..].iter().filter_map(default).collect()))))
}

/// Writes the states, or the parameters, that the map of a quotient gives for rows of total states and parameters.
pub(crate) fn images(
    py: Python<'_>,
    dynamics: &dyn Dynamics,
    of_params: bool,
    (total, t, out): At<'_>,
    how: How,
) -> PyResult<()> {
    let (total, out) = (two_axes(total)?, two_axes_mut(out)?);
    let (n, m) = (total.ncols(), out.ncols());
    if total.nrows() != out.nrows() {
        return Err(other_shapes());
    }
    let image = |row: &[f64], result: &mut [f64]| {
        let found = dynamics.quotient(of_params, t, row).filter(|found| found.len() == m);
        write(found.as_deref(), result);
    };
    let done = py.detach(|| {
        let work =
            |rows: &Rows<'_>, out: &mut RowsMut<'_>, n_rows: usize| by_row(rows, out, n_rows, (n, m), image);
        match in_pieces(total, out, how, work) {
            Ok(true) => Ok(()),
            Ok(false) => Err(Error::unusable("y", "has a state without an image: one is not finite")),
            Err(error) => Err(error),
        }
    });
    done.or_raise(py)
}
