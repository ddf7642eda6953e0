//! Many trajectories of one scene: other initial states, other parameters, or both.
//!
//! Inside a core several trajectories are integrated side by side in vector registers (SIMD lanes), and the cores share
//! the work by threads. The crate deliberately does not know mechanics, nor where parameters and states come from.
//!
//! ```
//! use hamel_ensemble::{Dop853, Ensemble, Options, family};
//!
//! family! {
//!     /// The heavy top, on any scalar.
//!     HeavyTop, 6 = hamel_models::generated::heavy_top::Prepared
//! }
//!
//! // One body, and a hundred spins.
//! let params = [[1.3, 1.7, 0.6, 1.1, 9.81, 0.35, 0.0, 0.6, 0.8]];
//! let initial: Vec<[f64; 6]> = (0..100).map(|k| [0.1, 0.2, 0.1 * f64::from(k), 0.0, 0.6, 0.8]).collect();
//!
//! let ensemble = Ensemble::new(Dop853, Options::adaptive(1e-9, 1e-11));
//! let trajectories = ensemble.run::<HeavyTop, _>(&params, &initial, 2.0, &[0.5, 1.0])?;
//! for trajectory in &trajectories {
//!     assert!(trajectory.stop.is_none());
//!     assert_eq!((trajectory.t, trajectory.samples.len()), (2.0, 2));
//! }
//! # Ok::<(), hamel_ensemble::Error>(())
//! ```
//!
//! # What the results depend on
//!
//! Trajectories `k L` to `k L + L - 1` of the input are the lanes of one integration, with `L` the number of lanes; the
//! last group is filled up with copies of its last trajectory. The lanes have one step size, for which the error of
//! each component is the largest of all lanes, so that the tolerances hold for every one of them. Hence
//!
//! - results depend on the order of the input and on the number of lanes, and on nothing else: not on threads, their
//!   number or their timing, and not on the target's registers;
//! - with fixed steps, or with `with_lanes::<f64>()`, each trajectory has the bits of an
//!   [`Integrator`](hamel_runtime::Integrator) of its own, whatever is integrated beside it;
//! - a group in which anything fails is integrated again, one trajectory after the other: those that do not fail have
//!   the bits of an integrator of their own, and those that fail keep the state, the samples and the reason.
//!
//! Trajectories whose steps differ much in size are best sorted, so that neighbours are alike, or integrated on one
//! lane.

#![forbid(unsafe_code)]

mod error;
mod lanes;
mod motions;
mod run;
mod space;

pub use error::{Error, Stop};
pub use hamel_runtime::{Dop853, Dopri5, F64x4, F64x8, Gbs14, Options, Rk4, Stats, Tsit5, Vern9};
pub use lanes::{Family, Lanes, Source};
pub use motions::{Members, Motions, Stopped, Trajectory};
pub use run::Ensemble;

/// Not part of the interface: what [`family!`] writes down.
#[doc(hidden)]
pub use hamel_runtime as __runtime;

/// The example of the page compiles and runs.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
