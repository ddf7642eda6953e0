//! The scale to which changes of an energy are relative.
//!
//! Does not know: motions.

use super::dynamics::Dynamics;

/// Scale to which the drift of the energy is relative: `|E0|`, or a thousandth of the size of the terms that `E0` is
/// the sum of, whichever is larger.
///
/// ```text
/// scale = max(|E0|, 1e-3 sum_i |y_i dE/dy_i|)
/// ```
///
/// The zero of a potential is a convention, and where `E0` nearly cancels a drift relative to `|E0|` alone says nothing
/// about the integration. A state at rest in the zero of the potential has the scale one, so that its drift is
/// absolute.
pub fn energy_scale(dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> f64 {
    let energy = |y: &[f64]| dynamics.energy(t, y).unwrap_or(0.0);
    let mut terms = 0.0;
    let mut moved = y.to_vec();
    for (k, &x) in y.iter().enumerate() {
        let h = 1e-6;
        moved[k] = x * (1.0 + h);
        let above = energy(&moved);
        moved[k] = x * (1.0 - h);
        let below = energy(&moved);
        moved[k] = x;
        let term = ((above - below) / (2.0 * h)).abs();
        if term.is_finite() {
            terms += term;
        }
    }
    let scale = energy(y).abs().max(1e-3 * terms).min(f64::MAX);
    if scale >= f64::MIN_POSITIVE { scale } else { 1.0 }
}
