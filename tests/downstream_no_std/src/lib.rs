//! A pendulum evaluated and integrated without the standard library, as on a microcontroller.
//!
//! For a bare-metal target: `cargo build --lib -p hamel-downstream-no-std --target thumbv7em-none-eabihf`.

#![no_std]
#![forbid(unsafe_code)]
#![deny(missing_docs, unreachable_pub, warnings)]
#![deny(clippy::all)]

use hamel_runtime::{math, Dop853, Error, Integrator, Options, Rk4, Tsit5};

/// The generated module.
pub mod pendulum {
    hamel_runtime::include_model!("pendulum");
}

use pendulum::Prepared;

/// Deviation of the generated right-hand side from `(theta', -k sin theta)`, at a hundred states.
#[must_use]
pub fn rhs_error(system: &Prepared, k: f64) -> f64 {
    let mut worst = 0.0_f64;
    for i in 0..100 {
        let y = [0.06 * f64::from(i) - 3.0, 1.0 - 0.02 * f64::from(i)];
        let mut dy = [f64::NAN; 2];
        system.rhs(0.0, &y, &mut dy);
        let error = math::abs(dy[0] - y[1]) + math::abs(dy[1] + k * math::sin(y[0]));
        worst = if error <= worst { worst } else { error };
    }
    worst
}

/// Largest deviation of the energy, relative to its value, over ten seconds with each kind of method.
///
/// # Errors
///
/// Those of the integrator.
pub fn energy_drift(system: &Prepared) -> Result<f64, Error> {
    let start = [0.5, 1.0];
    let initial = system.energy(0.0, &start);
    let mut worst = 0.0_f64;
    let mut note = |y: &[f64; 2]| worst = worst.max(math::abs(system.energy(0.0, y) / initial - 1.0));

    let adaptive = Options::adaptive(1e-11, 1e-11);
    let mut solver = Integrator::new(system, Dop853, 0.0, start, adaptive)?;
    solver.sample(10.0, (0..1000).map(|i| f64::from(i) * 0.01), |_, y| note(y))?;
    note(solver.state());
    let mut solver = Integrator::new(system, Tsit5, 0.0, start, adaptive)?;
    solver.integrate_to(-10.0)?;
    note(solver.state());
    let mut solver = Integrator::new(system, Rk4, 0.0, start, Options::fixed(1e-3))?;
    solver.integrate_to(10.0)?;
    note(solver.state());
    Ok(worst)
}
