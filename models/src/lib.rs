//! Systems of geometric and nonholonomic mechanics as allocation-free right-hand sides.
//!
//! One module per scene under [`generated`], written by `cargo xtask generate` from the model files in `specs/`:
//! `Params`, `State`, and `Prepared` with `rhs`, `energy` and the outputs of the scene. [`for_each_scene!`] visits all
//! of them. No equation of motion here is written by hand.
//!
//! ```
//! use hamel_models::generated::heavy_top::{Params, Prepared, State};
//!
//! let top = Prepared::<f64>::new(&Params::default())?;
//! let state = State { Omega1: 0.4, Omega2: -0.3, Omega3: 2.0, Gamma1: 0.0, Gamma2: 0.6, Gamma3: 0.8 };
//! let mut derivative = [0.0; 6];
//! top.rhs(0.0, &state.to_array(), &mut derivative);
//! assert!(derivative.iter().all(|d| d.is_finite()));
//! # Ok::<(), hamel_runtime::ParamError>(())
//! ```
#![no_std]
#![forbid(unsafe_code)]

/// The generated modules, one per scene.
#[rustfmt::skip]
pub mod generated;
