//! Build-time generator for mechanics with symmetry.
//!
//! A model file is parsed and checked ([`spec`]), reduced to a Lie algebroid with Lagrangian, constraint and force
//! ([`reduction`]), its equations of motion are derived once and for all kinds of systems ([`mechanics`]), a [`scene`]
//! says what is wanted of them, [`lower`] makes a flat [`program`] and [`emit`] writes Rust. [`Config`] runs all of it
//! from a build script.
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
//!
//! # What is promised
//!
//! [`compile`], [`Config`], [`read`](config::read), [`spec`], [`scene`] and [`error`]. The modules in between are
//! public with the feature `internals`, for hamel's own crates: they change without notice.

// What the inner modules offer is for the crates that turn the feature on; with it, these lints look at everything.
#![cfg_attr(not(feature = "internals"), allow(dead_code, unreachable_pub, unused_imports))]

pub mod config;
pub mod error;
mod parallel;
pub mod scene;
pub mod spec;

#[cfg(feature = "internals")]
pub mod algebra;
#[cfg(feature = "internals")]
pub mod certify;
#[cfg(feature = "internals")]
pub mod differentiate;
#[cfg(feature = "internals")]
pub mod emit;
#[cfg(feature = "internals")]
pub mod explain;
#[cfg(feature = "internals")]
pub mod expr;
#[cfg(feature = "internals")]
pub mod lower;
#[cfg(feature = "internals")]
pub mod mechanics;
#[cfg(feature = "internals")]
pub mod program;
#[cfg(feature = "internals")]
pub mod reduction;

#[cfg(not(feature = "internals"))]
mod algebra;
#[cfg(not(feature = "internals"))]
mod certify;
#[cfg(not(feature = "internals"))]
mod differentiate;
#[cfg(not(feature = "internals"))]
mod emit;
#[cfg(not(feature = "internals"))]
mod explain;
#[cfg(not(feature = "internals"))]
mod expr;
#[cfg(not(feature = "internals"))]
mod lower;
#[cfg(not(feature = "internals"))]
mod mechanics;
#[cfg(not(feature = "internals"))]
mod program;
#[cfg(not(feature = "internals"))]
mod reduction;

pub use config::{Config, compile};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
