//! Choices of an integration of matrices, and counts of its work.
//!
//! Does not know: steps.

use super::carried::MAX_CARRIED;
use super::iteration::MAX_HISTORY;
use crate::error::Error;

/// Choices of an integration by [`IsospectralMidpoint`](super::IsospectralMidpoint).
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// The step, positive.
    pub step: f64,
    /// The iteration ends when it changes the vorticity by less than this part of it, in the norm of Frobenius; with
    /// zero it ends where round-off stops its progress.
    pub tolerance: f64,
    /// Limit on iterations of a step.
    pub max_iterations: u32,
    /// How many steps before may be extrapolated to start the iteration, 8 unless told; each takes room for one more
    /// matrix. As many are as would have come nearest to the last step: fewer where iterations end early.
    pub history: usize,
    /// Whether there is a constant stream function beside that of the vorticity, and a constant current of each carried
    /// field; each takes room for one more matrix.
    pub has_background: bool,
    /// Fields that the flow carries, 4 at most; each takes room for seven matrices and the history.
    pub n_carried: usize,
}

impl Options {
    /// Steps of the size `h > 0`, iterated to round-off, so that Casimirs are kept to it.
    #[must_use]
    pub const fn fixed(h: f64) -> Self {
        Self {
            step: h,
            tolerance: 0.0,
            max_iterations: 100,
            history: MAX_HISTORY,
            has_background: false,
            n_carried: 0,
        }
    }

    /// Sets the change at which the iteration ends, relative to the vorticity.
    #[must_use]
    pub const fn with_tolerance(mut self, tolerance: f64) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// Sets the limit on iterations of a step.
    #[must_use]
    pub const fn with_max_iterations(mut self, limit: u32) -> Self {
        self.max_iterations = limit;
        self
    }

    /// Sets the largest number of steps that are extrapolated, up to 8.
    #[must_use]
    pub const fn with_history(mut self, steps: usize) -> Self {
        self.history = if steps < MAX_HISTORY { steps } else { MAX_HISTORY };
        self
    }

    /// Makes room for a [background](super::IsospectralMidpoint::background_mut), and for
    /// [constant currents](super::IsospectralMidpoint::constant_current_mut).
    #[must_use]
    pub const fn with_background(mut self) -> Self {
        self.has_background = true;
        self
    }

    /// Makes room for [fields](super::IsospectralMidpoint::carried_mut) that the flow carries, up to 4.
    #[must_use]
    pub const fn with_carried(mut self, n_fields: usize) -> Self {
        self.n_carried = n_fields;
        self
    }

    /// Checks every number of the options.
    ///
    /// # Errors
    ///
    /// [`Error::StepSize`], [`Error::RelativeTolerance`], [`Error::Number`] for the number of carried fields.
    pub fn validate(&self) -> Result<(), Error> {
        if !(self.step > 0.0 && self.step.is_finite()) {
            return Err(Error::StepSize { value: self.step });
        }
        if !(self.tolerance >= 0.0 && self.tolerance.is_finite()) {
            return Err(Error::RelativeTolerance { value: self.tolerance, least: 0.0 });
        }
        if self.n_carried > MAX_CARRIED {
            let needs = "number of carried fields: that is 4 at most";
            return Err(Error::Number { value: self.n_carried as f64, needs });
        }
        Ok(())
    }
}

/// Counts of work done since the solver was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Stats {
    /// Steps.
    pub steps: u64,
    /// Iterations of all steps: solutions for the stream function, and products `P W`.
    pub iterations: u64,
    /// Products `P W P`.
    pub second_products: u64,
}
