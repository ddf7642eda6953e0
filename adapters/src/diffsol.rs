//! The closures that the crate `diffsol` builds a problem from.
//!
//! ```
//! use diffsol::{MatrixCommon as _, NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod as _};
//! use hamel_adapters::diffsol::{initial, jacobian_times, rhs};
//! use hamel_models::generated::heavy_top_derivatives as heavy_top;
//!
//! let top = heavy_top::Prepared::new(&heavy_top::Params::default())?;
//! let problem = OdeBuilder::<NalgebraMat<f64>>::new()
//!     .rtol(1e-8)
//!     .atol([1e-10])
//!     .rhs_implicit(rhs(&top), jacobian_times(&top))
//!     .init(initial([0.1, 0.2, 5.0, 0.0, 0.6, 0.8]), 6)
//!     .build()?;
//! let (states, times, _) = problem.bdf::<NalgebraLU<f64>>()?.solve(1.0)?;
//! assert_eq!(times.last(), Some(&1.0));
//! # assert_eq!(states.ncols(), times.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Explicit methods take `OdeBuilder::rhs`, and need no derivatives.
//!
//! A scene that wants its implicit form gives equations with a mass matrix, whose algebraic equations the solver
//! satisfies at every step:
//!
//! ```
//! use diffsol::{MatrixCommon as _, NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod as _};
//! use hamel_adapters::diffsol::{consistent, implicit_jacobian_times, implicit_rhs, mass};
//! use hamel_models::generated::chaplygin_sleigh_implicit as sleigh;
//!
//! let body = sleigh::Prepared::new(&sleigh::Params::default())?;
//! let problem = OdeBuilder::<NalgebraMat<f64>>::new()
//!     .rtol(1e-8)
//!     .atol([1e-10])
//!     .rhs_implicit(implicit_rhs(&body), implicit_jacobian_times(&body))
//!     .mass(mass(&body))
//!     .init(consistent(&body, [0.4, -0.9]), sleigh::IMPLICIT.variables.len())
//!     .build()?;
//! let (variables, ..) = problem.bdf::<NalgebraLU<f64>>()?.solve(1.0)?;
//! assert_eq!(variables.nrows(), 5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use std::cell::RefCell;

use hamel_runtime::{Differentiable, Implicit, System};

/// States come from `diffsol` with the dimension that its `init` was given.
const DIMENSION: &str = "OdeBuilder::init is given the dimension of the system";

/// The right-hand side, for `OdeBuilder::rhs` and `OdeBuilder::rhs_implicit`.
///
/// # Panics
///
/// When called, if `OdeBuilder::init` was given another dimension than the system's.
pub fn rhs<const N: usize, S: System<f64, State = [f64; N]>>(
    system: &S,
) -> impl Fn(&[f64], &[f64], f64, &mut [f64]) {
    |y, _parameters, t, dy| {
        system.rhs(t, y.try_into().expect(DIMENSION), dy.try_into().expect(DIMENSION));
    }
}

/// A Jacobian and where it was computed.
struct Kept<const N: usize> {
    t: f64,
    y: [f64; N],
    rows: [[f64; N]; N],
}

/// The Jacobian times a vector, for `OdeBuilder::rhs_implicit`.
///
/// `diffsol` asks for the columns of a Jacobian one after the other: the matrix is computed once for all of them and
/// kept until time or state change.
///
/// # Panics
///
/// As [`rhs`].
pub fn jacobian_times<const N: usize, S: Differentiable<f64> + System<f64, State = [f64; N]>>(
    system: &S,
) -> impl Fn(&[f64], &[f64], f64, &[f64], &mut [f64]) {
    rows_times(|t, y, rows: &mut [[f64; N]; N]| system.jacobian(t, y, rows))
}

/// A matrix times a vector, computed once for all vectors at one time and state.
fn rows_times<const N: usize>(
    compute: impl Fn(f64, &[f64; N], &mut [[f64; N]; N]),
) -> impl Fn(&[f64], &[f64], f64, &[f64], &mut [f64]) {
    let kept = RefCell::new(None);
    move |y, _parameters, t, v, out| {
        let y: &[f64; N] = y.try_into().expect(DIMENSION);
        let mut kept = kept.borrow_mut();
        let rows = match &mut *kept {
            Some(Kept { t: of_t, y: of_y, rows }) if *of_t == t && of_y == y => rows,
            other => {
                let mut rows = [[0.0; N]; N];
                compute(t, y, &mut rows);
                &mut other.insert(Kept { t, y: *y, rows }).rows
            }
        };
        for (out, row) in out.iter_mut().zip(&*rows) {
            *out = row.iter().zip(v).map(|(a, b)| a * b).sum();
        }
    }
}

/// The initial state, for `OdeBuilder::init`.
///
/// # Panics
///
/// As [`rhs`].
pub fn initial<const N: usize>(y0: [f64; N]) -> impl Fn(&[f64], f64, &mut [f64]) {
    move |_parameters, _t, y| y.copy_from_slice(&y0)
}

/// The right-hand side of the implicit form, for `OdeBuilder::rhs_implicit`.
///
/// # Panics
///
/// When called, if `OdeBuilder::init` was given another dimension than the number of variables.
pub fn implicit_rhs<const N: usize, S: Implicit<f64, Variables = [f64; N]>>(
    system: &S,
) -> impl Fn(&[f64], &[f64], f64, &mut [f64]) {
    |z, _parameters, t, f| {
        system.implicit_rhs(t, z.try_into().expect(DIMENSION), f.try_into().expect(DIMENSION));
    }
}

/// The Jacobian of the implicit form times a vector, for `OdeBuilder::rhs_implicit`; kept as that of
/// [`jacobian_times`].
///
/// # Panics
///
/// As [`implicit_rhs`].
pub fn implicit_jacobian_times<const N: usize, S: Implicit<f64, Variables = [f64; N]>>(
    system: &S,
) -> impl Fn(&[f64], &[f64], f64, &[f64], &mut [f64]) {
    rows_times(|t, z, rows: &mut [[f64; N]; N]| system.implicit_jacobian(t, z, rows))
}

/// `M v + beta y`, written to `y`, for `OdeBuilder::mass`.
///
/// # Panics
///
/// As [`implicit_rhs`].
pub fn mass<const N: usize, S: Implicit<f64, Variables = [f64; N]>>(
    system: &S,
) -> impl Fn(&[f64], &[f64], f64, f64, &mut [f64]) {
    |v, _parameters, _t, beta, y| {
        let mut product = [0.0; N];
        system.mass_times(v.try_into().expect(DIMENSION), &mut product);
        for (y, product) in y.iter_mut().zip(product) {
            *y = product + beta * *y;
        }
    }
}

/// The variables of the implicit form at a state, for `OdeBuilder::init`.
///
/// # Panics
///
/// As [`implicit_rhs`].
pub fn consistent<const N: usize, S: Implicit<f64, Variables = [f64; N]>>(
    system: &S,
    y0: S::State,
) -> impl Fn(&[f64], f64, &mut [f64]) {
    move |_parameters, t, z| z.copy_from_slice(&system.consistent(t, &y0))
}
