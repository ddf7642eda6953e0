//! Iterations of implicit methods: repeated until round-off stops the progress.
//!
//! Deliberately does not know: which method iterates, what is solved for.

use super::Step;
use crate::error::Error;
use crate::options::signed;
use crate::real::Real;
use crate::system::System;

/// Size of a change of what is solved for, and of what it changes: both of the order of a state.
#[derive(Clone, Copy, Default)]
pub(super) struct Change {
    change: f64,
    size: f64,
    /// Whether a change is NaN.
    is_lost: bool,
}

impl Change {
    /// Whether the change is less than the last digit of what it changes.
    pub(super) fn is_rounding<R: Real>(&self) -> bool {
        !self.is_lost && self.change <= 0.25 * R::EPSILON * self.size
    }

    #[inline(always)]
    pub(super) fn add<R: Real>(&mut self, h: f64, y: R, k: R, difference: R) {
        let change = h * difference.magnitude();
        let size = y.magnitude() + h * k.magnitude();
        // Without a branch, as changes come and go.
        self.change = if change > self.change { change } else { self.change };
        self.is_lost |= change.is_nan();
        self.size = if size > self.size { size } else { self.size };
    }
}

/// Changes that stop to decrease above this many units of round-off are no round-off.
pub(super) const ROUND_OFF: f64 = 1e3;

/// Repeats `sweep` until nothing changes, or until the changes stop to decrease in round-off.
///
/// # Source
///
/// Hairer, McLachlan and Razakarivony, Achieving Brouwer's law with implicit Runge-Kutta methods (2008), section 4.
pub(super) fn iterate<R: Real, S: System<R>>(
    method: &'static str,
    step: &mut Step<'_, R, S>,
    mut sweep: impl FnMut(&mut Step<'_, R, S>) -> Change,
) -> Result<(), Error> {
    const MAX_ITERATIONS: u32 = 100;
    /// Changes may grow at first.
    const PATIENCE: u32 = 10;
    let mut previous = f64::INFINITY;
    for iterations in 1..=MAX_ITERATIONS {
        let Change { change, size, is_lost } = sweep(step);
        // What is not finite is found, and explained, by the integrator.
        if is_lost || change == 0.0 || !change.is_finite() {
            return Ok(());
        }
        if change >= previous {
            if change <= ROUND_OFF * R::EPSILON * size {
                return Ok(());
            }
            if iterations > PATIENCE {
                return Err(not_converged(method, step, iterations));
            }
        }
        previous = change;
    }
    Err(not_converged(method, step, MAX_ITERATIONS))
}

#[cold]
pub(super) fn not_converged<R: Real, S: System<R>>(
    method: &'static str,
    step: &Step<'_, R, S>,
    iterations: u32,
) -> Error {
    Error::NotConverged { method, t: signed(step.t), h: signed(step.h), iterations }
}
