//! The rate of a function that an actuator gives it, along the rates of a program.
//!
//! Does not know: forces, how they were solved for.

use hamel_mechanics::mechanics::Decrease;
use hamel_runtime::Real;

use super::definition::Missing;
use super::motion::{Motion, RATES};
use super::point::Setting;
use super::sheet::Sheet;
use super::tape::Tape;
use super::wide::Wide;

/// `dV/dt - mu`, with the derivative of `V` as written by a dual number in time.
///
/// # Source
/// Grillo, Marsden, Nair 2011, Lyapunov constraints and global asymptotic stabilization, section 3.
pub(super) fn check(motion: &Motion, setting: &Setting<'_>, sheet: &mut Sheet) -> Result<(), Missing> {
    let model = setting.definition.model;
    let Some(own) = &model.lyapunov else { return Ok(()) };
    let value = Tape::new(&model.graph, &[own.value]).eval(&motion.moving.env)?.roots[0];
    let rate = Tape::new(&model.graph, &[own.rate]).eval(&motion.at.env)?.roots[0];
    sheet.equal(RATES, format!("the rate of the function {}", own.name), value.derivative, rate);
    if setting.claim.equations.facts.decrease == Some(Decrease::Proved) {
        let growth = if rate.to_f64() > 0.0 { rate } else { Wide::ZERO };
        sheet.vanishes(RATES, format!("the growth of the function {}", own.name), growth, rate.size());
    }
    Ok(())
}
