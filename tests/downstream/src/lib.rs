//! What a crate does with a model of its own, under stricter lints than most crates have.

#![forbid(unsafe_code)]
#![deny(missing_docs, unreachable_pub, warnings)]
#![deny(clippy::all)]

/// All scenes, as the file of `Config::include_file` lists them.
pub mod models {
    hamel_runtime::include_model!("models");
}

/// A scene in the types of `nalgebra`, as `Config::nalgebra` writes it.
pub mod kite {
    hamel_runtime::include_model!("kite_flight");
}

/// A module that nobody else sees and of which one function uses a part.
mod private {
    include!(concat!(env!("OUT_DIR"), "/suslov_gyrostat.rs"));
}

/// Angular momentum of the rotor about its axis with the model's own parameters, in kg m^2/s.
#[must_use]
pub fn spin(alpha_dot: f64) -> f64 {
    private::Params::<f64>::default().J * alpha_dot
}
