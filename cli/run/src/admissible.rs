//! States that keep the constraints: how far a state is from keeping them, and the nearest one that does.
//!
//! A constraint that was solved for velocities cannot be broken: the state has no component for what it determines.
//! One in multiplier form can, because the state carries all velocities; a scene has its residual as the output
//! `constraint`. Constraints on accelerations hold in every state.
//!
//! Does not know: who evaluates a scene, requests, how a motion is integrated.

use hamel_codegen::scene::nearest::{Linear, Outcome, Places, ROUNDING, is_of_positions, linearise, project};
use hamel_codegen::spec::Want;

use super::dynamics::Dynamics;
use super::info::Info;
use crate::error::Error;

/// From the names of a scene; none unless it computes residuals of constraints and momenta, which tell what is a
/// velocity. Momenta of the state count as velocities, without a metric.
fn places(info: &Info) -> Option<Places> {
    if info.momenta.is_empty() && info.output_range(Want::Velocities.name()).is_some() {
        return None;
    }
    let constraint = info.output_range(Want::Constraint.name())?;
    let range = info.output_range(Want::Momentum.name())?;
    let names = &info.outputs.iter().find(|group| group.name == Want::Momentum.name())?.components;
    // A momentum is called after its velocity.
    let of = |(at, name): (usize, &String)| {
        Some((info.state.iter().position(|velocity| momentum_name(velocity) == *name)?, at))
    };
    let (mut velocities, momenta): (Vec<usize>, Vec<usize>) = range.zip(names).filter_map(of).unzip();
    if info.momenta.is_empty() {
        return Some(Places { constraint, velocities, momenta: Some(momenta) });
    }
    let of_state = info.momenta.iter().filter_map(|name| info.state.iter().position(|own| own == name));
    velocities.extend(of_state);
    Some(Places { constraint, velocities, momenta: None })
}

/// Name of the momentum of a velocity, as the generator calls it.
fn momentum_name(velocity: &str) -> String {
    format!("p_{velocity}")
}

/// Whether a scene can tell by itself whether a state keeps the constraints.
pub fn is_judged_by(info: &Info) -> bool {
    places(info).is_some()
}

/// Checks that a state at time zero keeps the constraints up to rounding; the last `n_group` components of the state
/// are coordinates of the group, which are left out of the message.
///
/// A residual `phi_A` is rounding if
///
/// ```text
/// |phi_A| <= 1e-9 S_A + 16 eps sum_x |x dphi_A/dx|,    S_A = max |v| sum_v |dphi_A/dv|
/// ```
///
/// with the velocities `v` and everything else `x`. What is left of a component that vanishes is rounding of the
/// largest velocity, so that the sum of the terms' sizes would be no measure. Of a residual without velocities it is
/// `1e-9 sum_x max(|x|, 1) |dphi_A/dx|`: coordinates come from text too, and many of them are zero.
///
/// # Errors
/// [`Error::Inadmissible`] with the residuals that are more, and the nearest state with the same positions that keeps
/// the constraints: the change `d` of the velocities has the least `d^T M d`, with the mass matrix `M = d^2 L/dv^2`
/// there.
pub fn check(dynamics: &dyn Dynamics, y: &[f64], n_group: usize) -> Result<(), Error> {
    let info = dynamics.info();
    let Some(places) = places(info) else { return Ok(()) };
    let mut outputs = |states: Vec<Vec<f64>>| -> Result<Vec<Vec<f64>>, Error> {
        Ok(states.iter().map(|y| dynamics.outputs(0.0, y)).collect())
    };
    let is_kept = |linear: &Linear, y: &[f64]| -> Vec<bool> {
        let is_near = |(r, s): (&f64, &f64)| r.abs() <= ROUNDING * s;
        let near: Vec<bool> = linear.residual.iter().zip(&linear.sizes).map(is_near).collect();
        if near.iter().all(|near| *near) {
            return near;
        }
        let of_positions = slopes_of_positions(dynamics, &places, y);
        let each = linear.residual.iter().zip(&linear.sizes).zip(of_positions).zip(&linear.jacobian);
        let rounding = |s: f64, Slopes { terms, unit }: Slopes, row: &[f64]| match is_of_positions(row) {
            true => ROUNDING * unit,
            false => ROUNDING * s + 16.0 * f64::EPSILON * terms,
        };
        // What is not finite is no matter of the constraint: the integrator says what it is.
        each.map(|(((r, s), of), row)| r.abs() <= rounding(*s, of, row) || !(r.is_finite() && s.is_finite()))
            .collect()
    };
    let linear = linearise(&mut outputs, &places, y)?;
    let kept = is_kept(&linear, y);
    if kept.iter().all(|kept| *kept) {
        return Ok(());
    }
    let names = info.outputs.iter().find(|group| group.name == Want::Constraint.name());
    let names = names.map(|group| group.components.clone()).unwrap_or_default();
    let each = names.into_iter().zip(linear.residual.iter().zip(&linear.sizes)).zip(&kept);
    let broken = each.filter(|(_, kept)| !**kept).map(|((name, (r, s)), _)| (name, *r, *s)).collect();
    let mut nearest = y.to_vec();
    let free = places.velocities.clone();
    let of_positions = linear.jacobian.iter().zip(&kept).any(|(row, kept)| !kept && is_of_positions(row));
    let found =
        !of_positions && matches!(project(&mut outputs, &places, &mut nearest, &free), Ok(Outcome::Met));
    let n_own = y.len() - n_group;
    let nearest = found.then(|| info.state[..n_own].iter().cloned().zip(nearest).collect());
    Err(Error::Inadmissible { broken, nearest })
}

/// What a residual is by components that are no velocities.
#[derive(Clone, Copy, Debug, Default)]
struct Slopes {
    /// `sum_x |x dphi_A/dx|`.
    terms: f64,
    /// `sum_x max(|x|, 1) |dphi_A/dx|`.
    unit: f64,
}

/// The slopes of each residual.
fn slopes_of_positions(dynamics: &dyn Dynamics, places: &Places, y: &[f64]) -> Vec<Slopes> {
    let mut sums = vec![Slopes::default(); places.constraint.len()];
    let mut moved = y.to_vec();
    for k in (0..y.len()).filter(|k| !places.velocities.contains(k)) {
        // Of an angle after many turns, no more than a thousandth; of zero with rounding, more than that is.
        let step = if y[k] == 0.0 { 1e-6 } else { 1e-6 * y[k].abs().clamp(1e-6, 1e3) };
        let mut at = |x: f64| {
            moved[k] = x;
            dynamics.outputs(0.0, &moved)
        };
        let (above, below) = (at(y[k] + step), at(y[k] - step));
        moved[k] = y[k];
        for (sum, at) in sums.iter_mut().zip(places.constraint.clone()) {
            let slope = ((above[at] - below[at]) / (2.0 * step)).abs();
            // At zero a function may have no slope.
            if y[k] != 0.0 || slope.is_finite() {
                sum.terms += y[k].abs() * slope;
                sum.unit += y[k].abs().max(1.0) * slope;
            }
        }
    }
    sums
}
