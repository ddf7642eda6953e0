//! What the property and identity tests share: exact oracles, random algebras, random systems.
//!
//! Nothing here is used by the generator; the oracles are written from the formulas, not from its code.

pub mod algebras;
pub mod bundle;
pub mod derived;
pub mod draws;
pub mod errata;
pub mod latex;
pub mod linear;
pub mod models;
pub mod problem;
pub mod reference;
pub mod stages;
pub mod tracked;
pub mod unreduced;
pub use hamel_measure::random;

/// Whether tests take as long as they like: every model where a few stand for all. `cargo xtask test --all` says so.
pub fn at_length() -> bool {
    std::env::var_os("HAMEL_TEST_ALL").is_some()
}

/// The heavy top's generated file under `include!`, the other way of using it besides `mod`.
pub mod included {
    include!("../../models/src/generated/heavy_top.rs");
}

/// The examples of the documentation compile and run.
#[cfg(doctest)]
mod docs {
    #[doc = include_str!("../../docs/build-rs.md")]
    pub struct BuildScripts;
    #[doc = include_str!("../../docs/book/start.md")]
    pub struct Start;
    #[doc = include_str!("../../docs/book/scenes.md")]
    pub struct Scenes;
    #[doc = include_str!("../../docs/book/momenta.md")]
    pub struct Momenta;
    #[doc = include_str!("../../docs/book/emitted-code.md")]
    pub struct EmittedCode;
    #[doc = include_str!("../../docs/book/controls.md")]
    pub struct Controls;
    #[doc = include_str!("../../docs/book/noise.md")]
    pub struct Noise;
    #[doc = include_str!("../../docs/book/stages.md")]
    pub struct Stages;
    #[doc = include_str!("../../docs/book/fluids.md")]
    pub struct Fluids;
    #[doc = include_str!("../../docs/book/integrators.md")]
    pub struct Integrators;
    #[doc = include_str!("../../docs/book/derivatives.md")]
    pub struct Derivatives;
    #[doc = include_str!("../../docs/book/no-std.md")]
    pub struct NoStd;
    #[doc = include_str!("../../docs/book/wasm.md")]
    pub struct Wasm;
    #[doc = include_str!("../../docs/book/site.md")]
    pub struct Site;
    #[doc = include_str!("../../docs/book/theory.md")]
    pub struct Theory;
    #[doc = include_str!("../../docs/book/accuracy.md")]
    pub struct Accuracy;
    #[doc = include_str!("../../docs/ensembles.md")]
    pub struct Ensembles;
}
