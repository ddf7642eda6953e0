//! A pendulum integrated without the standard library, as on a microcontroller.
//!
//! For a bare-metal target: `cargo build --lib --target thumbv7em-none-eabihf`.

#![no_std]
#![forbid(unsafe_code)]

use hamel_runtime::{Dop853, Error, Failure, Integrator, Options, Rk4, System, Tsit5, math};

/// `theta'' = -g/l sin theta`.
#[derive(Clone, Copy, Debug)]
pub struct Pendulum {
    /// Gravity over length, in 1/s^2.
    pub g_over_l: f64,
}

impl System<f64> for Pendulum {
    type State = [f64; 2];

    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [y[1], -self.g_over_l * math::sin(y[0])];
    }

    fn check(&self, t: f64, _y: &[f64; 2]) -> Result<(), Failure> {
        if self.g_over_l.is_finite() {
            Ok(())
        } else {
            Err(Failure::OutsideDomain { t, condition: "g_over_l is finite" })
        }
    }
}

/// Largest deviation of the energy, relative to its value, over ten seconds with each kind of method.
///
/// ```text
/// E = theta'^2/2 - g/l cos theta
/// ```
///
/// # Errors
///
/// Those of the integrator.
pub fn energy_drift(system: &Pendulum) -> Result<f64, Error> {
    let energy = |y: &[f64; 2]| 0.5 * y[1] * y[1] - system.g_over_l * math::cos(y[0]);
    let start = [0.5, 1.0];
    let initial = energy(&start);
    let mut worst = 0.0_f64;
    let mut note = |y: &[f64; 2]| worst = worst.max(math::abs(energy(y) / initial - 1.0));

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
