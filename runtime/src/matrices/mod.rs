//! Fluids as products of matrices: su(N) for any `N`, on the torus and on the sphere, with steps that keep the
//! spectrum of the vorticity; friction and constant forces beside them ([`Damped`]).
//!
//! Straight-line code and tables of structure constants take a number of operations that grows with `N^4`; commutators
//! of matrices take `N^3` of them, and a Laplacian that acts along diagonals next to nothing. The vorticity is a
//! Hermitian matrix `W`, and moves by
//!
//! ```text
//! W' = i kappa [P, W],   P = Delta_N^-1 W
//! ```
//!
//! Other [`Stream`]s have a radius of deformation, and [`Options::with_background`] adds a constant stream function, as
//! that of a sphere that turns. A flow may carry fields `A` ([`Options::with_carried`]), whose energy has the
//! derivative `J`, the [`Current`], and acts on the vorticity: magnetohydrodynamics, buoyancy, tracers.
//!
//! ```text
//! W' = i kappa ([P, W] + sum of [J, A]),   A' = i kappa [P, A]
//! ```
//!
//! | surface | `N` | matrices of | Laplacian |
//! |---|---|---|---|
//! | [`Torus`] | odd | waves, in the order and with the signs of the models `zeitlin_euler_N` | diagonal in the waves |
//! | [`Sphere`] | any | spherical harmonics | tridiagonal along each diagonal |
//!
//! Nothing allocates: a surface and a solver are given room for as many numbers as they say, in an array, a slice or a
//! vector.
//!
//! ```
//! use hamel_runtime::matrices::{IsospectralMidpoint, Options, Sphere};
//!
//! let n = 32;
//! let sphere = Sphere::new(n, vec![0.0; Sphere::<Vec<f64>>::storage(n)])?;
//! let options = Options::fixed(0.02);
//! let room = IsospectralMidpoint::<Sphere<Vec<f64>>, Vec<f64>>::storage(n, &options);
//! let mut solver = IsospectralMidpoint::new(&sphere, vec![0.0; room], 0.0, options)?;
//! // A wave of Rossby and Haurwitz on a turning sphere.
//! sphere.add_mode((1, 0), [1.0, 0.0], solver.vorticity_mut());
//! sphere.add_mode((5, 4), [0.3, 0.0], solver.vorticity_mut());
//! let energy = solver.energy();
//! solver.integrate_to(1.0)?;
//! // Energy and wave are kept up to a power of the step, Casimirs to round-off.
//! assert!((solver.energy() / energy - 1.0).abs() < 1e-9);
//! let [re, im] = sphere.mode((5, 4), solver.vorticity());
//! assert!((re.hypot(im) - 0.3).abs() < 1e-6);
//! # Ok::<(), hamel_runtime::Error>(())
//! ```
//!
//! The module deliberately does not know generated code.

mod carried;
mod damped;
mod dft;
mod diagonals;
mod harmonics;
mod iteration;
mod midpoint;
mod options;
mod panels;
mod sphere;
mod stream;
mod torus;

pub use carried::Current;
pub use damped::{Damped, Friction};
pub use midpoint::IsospectralMidpoint;
pub use options::{Options, Stats};
pub use sphere::Sphere;
pub use stream::Stream;
pub use torus::Torus;

use crate::error::Error;
use panels::{Row, element, set_element};

/// A quantised surface: what the flow of its vorticity needs to know.
pub trait Laplacian: sealed::Spectral {
    /// Size of the matrices.
    fn n(&self) -> usize;

    /// The factor `kappa` of `W' = i kappa [P, W]`.
    fn rate(&self) -> f64;

    /// The area of the surface, of which a matrix takes the mean: the energy is `area/(2 N) tr(P W)`.
    ///
    /// The torus has the area one, so that energy and Casimirs are sums over coefficients.
    fn area(&self) -> f64;
}

/// What no other crate can write, because it is about the layout of matrices.
mod sealed {
    use super::panels::Row;

    /// Functions of the Laplacian on matrices in panels.
    pub trait Spectral {
        /// Rows that [`invert`](Self::invert) needs room for.
        fn n_work(n: usize) -> usize;

        /// Writes the stream matrix of a vorticity, without a background; of both, all elements are there.
        fn invert(&self, vorticity: &[Row], stream: &mut [Row], work: &mut [Row]);

        /// Rows that [`apply`](Self::apply) needs room for.
        fn n_apply_work(n: usize) -> usize;

        /// Writes `sum over k of c_k (-Delta)^k` of a matrix, without its constant part; of both, all elements are
        /// there.
        fn apply(&self, coefficients: &[f64], matrix: &[Row], out: &mut [Row], work: &mut [Row]);

        /// Numbers of a table for [`filter`](Self::filter).
        fn n_factors(n: usize) -> usize;

        /// Writes the table of a function of the eigenvalues of minus the Laplacian.
        fn write_factors(&self, factor: &mut dyn FnMut(f64) -> f64, table: &mut [f64]);

        /// Rows that [`filter`](Self::filter) needs room for.
        fn n_filter_work(n: usize) -> usize;

        /// Multiplies each mode of a matrix by the factor of its eigenvalue; constants go.
        fn filter(&self, table: &[f64], matrix: &mut [Row], work: &mut [Row]);
    }
}

/// A Hermitian matrix to read.
#[derive(Clone, Copy, Debug)]
pub struct MatrixRef<'a> {
    n: usize,
    rows: &'a [Row],
}

impl MatrixRef<'_> {
    /// Number of rows, and of columns.
    #[must_use]
    pub const fn n(&self) -> usize {
        self.n
    }

    /// Real and imaginary part of an element.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    #[must_use]
    pub fn get(&self, i: usize, j: usize) -> [f64; 2] {
        assert!(i < self.n && j < self.n);
        element(self.n, self.rows, i, j)
    }
}

/// A Hermitian matrix to write.
#[derive(Debug)]
pub struct MatrixMut<'a> {
    n: usize,
    rows: &'a mut [Row],
}

impl MatrixMut<'_> {
    /// Number of rows, and of columns.
    #[must_use]
    pub const fn n(&self) -> usize {
        self.n
    }

    /// Sets the element `(i, j)` and the conjugate one `(j, i)`; on the diagonal the imaginary part counts as zero.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn set(&mut self, i: usize, j: usize, [re, im]: [f64; 2]) {
        assert!(i < self.n && j < self.n);
        let im = if i == j { 0.0 } else { im };
        set_element(self.n, self.rows, (j, i), [re, -im]);
        set_element(self.n, self.rows, (i, j), [re, im]);
    }
}
