//! Build-time generator for mechanics with symmetry.
//!
//! A model file is parsed and checked ([`spec`]), reduced to a Lie algebroid with Lagrangian, constraint and force
//! ([`reduction`]), its equations of motion are derived once and for all kinds of systems ([`mechanics`]), a [`scene`]
//! says what is wanted of them, [`lower`] makes a flat [`program`] and [`emit`] writes Rust. [`Config`] runs all of it from a
//! build script.
//!
//! ```
//! use hamel_codegen::{scene, spec};
//!
//! let text = "model top {
//!     param I: diagonal(3) = [2, 1.5, 0.8] where I1 > 0, I2 > 0, I3 > 0;
//!     velocity Omega in so(3);
//!     lagrangian = 1/2*dot(Omega, I*Omega);
//! }";
//! let model = spec::parse("top.hamel", text)?;
//! let scene = scene::build(&model, scene::DEFAULT)?;
//! let mut derivative = [0.0; 3];
//! scene.prepare(&[2.0, 1.5, 0.8]).unwrap().rhs(0.0, &[1.0, 2.0, 3.0], &mut derivative);
//! assert_eq!(derivative[0], (1.5 - 0.8) * 2.0 * 3.0 / 2.0);
//! # Ok::<(), spec::Diagnostics>(())
//! ```

pub mod algebra;
pub mod config;
pub mod differentiate;
pub mod emit;
pub mod error;
pub mod explain;
pub mod expr;
pub mod lower;
pub mod mechanics;
mod parallel;
pub mod program;
pub mod reduction;
pub mod scene;
pub mod spec;

pub use config::{Config, compile};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
