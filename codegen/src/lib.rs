//! Build-time generator for mechanics with symmetry.
//!
//! A model file is parsed and checked ([`spec`]), reduced to a Lie algebroid with Lagrangian, constraint and force
//! ([`reduction`]), its equations of motion are derived once and for all kinds of systems ([`mechanics`]), a [`scene`]
//! says what is wanted of them, [`lower`] makes a flat [`program`] and [`emit`] writes Rust. Every scene is held to the
//! definition of its functions ([`certify`]) before anything is done with it. [`Config`] runs all of it from a build
//! script.
//!
//! [`reduction`]: hamel_mechanics::reduction
//! [`mechanics`]: hamel_mechanics::mechanics
//! [`lower`]: hamel_program::lower
//! [`program`]: hamel_program::program
//! [`emit`]: hamel_program::emit
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
//! [`compile`], [`Config`], [`read`](config::read), [`import()`](config::import), [`spec`], [`scene`] and [`error`].
//! [`certify`], [`explain`] and the crates below (`hamel-expr`, `hamel-lang`, `hamel-import`, `hamel-mechanics`,
//! `hamel-program`) serve hamel's own programs: they
//! change without notice, and every version asks for exactly its own.

pub mod certify;
pub mod config;
pub mod explain;
pub mod files;
pub mod fluid;
pub mod quotient;
pub mod scene;
pub mod symmetry;

pub use config::{Config, compile};
pub use hamel_expr::error;
pub use hamel_import as import;
pub use hamel_lang::spec;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
