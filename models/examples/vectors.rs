//! At which spin does a top sleep? Jacobians as matrices of nalgebra, and an integration on vectors.
//!
//! `cargo run --release -p hamel-models --example vectors`
//!
//! A symmetric top that stands upright on its point and spins with `w` about its axis is a steady motion. It is
//! stable where no eigenvalue of the Jacobian has a positive real part: above `I3 w = 2 sqrt(I1 m g l)`, says
//! Lagrange.

use hamel_models::generated::heavy_top_derivatives::{Params, Prepared, State};
use hamel_runtime::nalgebra::Vector3;
use hamel_runtime::{Dop853, Integrator, OnVectors, Options};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let params: Params = Params { I1: 1.5, I2: 1.5, chi1: 0.0, chi2: 0.0, chi3: 1.0, ..Params::default() };
    let system = OnVectors::new(Prepared::new(&params)?);
    let critical = 2.0 * (params.I1 * params.m * params.g * params.l).sqrt() / params.I3;
    println!("Lagrange's bound: {critical:.4} rad/s\n\n  spin  growth   tilt after 20 s from 0.001 rad");
    for percent in [80, 90, 99, 101, 110, 120] {
        let spin = critical * f64::from(percent) / 100.0;
        let upright = state(spin, 0.0);
        assert!(system.derivative(0.0, &upright).norm() < 1e-12, "a steady motion");
        let eigenvalues = system.jacobian_matrix(0.0, &upright).complex_eigenvalues();
        let growth = eigenvalues.iter().map(|value| value.re).fold(0.0, f64::max);

        let options = Options::adaptive(1e-10, 1e-12);
        let mut solver = Integrator::new(&system, Dop853, 0.0, state(spin, 1e-3), options)?;
        let mut tilt = 0.0_f64;
        solver.sample(20.0, (1..=2000).map(|k| f64::from(k) / 100.0), |_, y| {
            tilt = tilt.max(Vector3::new(y[3], y[4], y[5]).angle(&Vector3::z()));
        })?;
        println!("{spin:6.2}  {growth:6.3}   {tilt:.4}");
    }
    Ok(())
}

/// Spin about the axis of a top that is tilted against the vertical.
fn state(spin: f64, tilt: f64) -> hamel_runtime::nalgebra::SVector<f64, 6> {
    let (sine, cosine) = tilt.sin_cos();
    State { Omega1: 0.0, Omega2: 0.0, Omega3: spin, Gamma1: sine, Gamma2: 0.0, Gamma3: cosine }
        .to_array()
        .into()
}
