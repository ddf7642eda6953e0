//! Right-hand sides to be measured: the generated ones, and the same equations written by other means.
//!
//! Every right-hand side is a [`Kernel`]: a function that is called through a pointer, so that nothing of it is moved
//! out of the loop that measures it. The opponents are derived by hand from the model files, and the tests compare all
//! of them with the generated code and the reference data before any number about them means something.
//!
//! Deliberately does not know: the generator, operation counts, how results are shown.

#[cfg(any(feature = "drift", feature = "nonholonomic"))]
pub mod body;
#[cfg(feature = "drift")]
pub mod drift;
#[cfg(feature = "measure")]
pub mod expert;
#[cfg(feature = "measure")]
pub mod fluids;
/// The systems of the benchmark of nonholonomic integration, one module a scene.
#[cfg(feature = "measure")]
#[macro_use]
#[rustfmt::skip]
pub mod generated;
#[cfg(feature = "measure")]
pub mod kernel;
#[cfg(feature = "measure")]
pub mod multipliers;
#[cfg(feature = "measure")]
pub mod naive;
#[cfg(feature = "nonholonomic")]
pub mod nonholonomic;
#[cfg(feature = "rhs")]
pub mod ours;
#[cfg(feature = "integrators")]
pub mod wp;

#[cfg(feature = "measure")]
pub use kernel::{Kernel, Timing};

/// All right-hand sides: the copy that is the floor of every measurement, the generated ones, the opponents.
#[cfg(feature = "measure")]
pub fn kernels() -> Vec<Kernel> {
    let mut kernels = vec![kernel::copy()];
    #[cfg(feature = "rhs")]
    kernels.extend(ours::kernels());
    kernels.extend([expert::kernels(), naive::kernels(), multipliers::kernels()].into_iter().flatten());
    kernels
}
