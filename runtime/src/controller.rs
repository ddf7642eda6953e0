//! Choice of the next step size from the error of the last.
//!
//! The module deliberately does not know states or methods: it sees sizes and norms.

use crate::math;

/// Proportional-integral control of the step size.
///
/// ```text
/// h_new = h / clamp(err^(1/q - 0.75 beta) / err_previous^beta / safety)
/// ```
///
/// # Source
///
/// Hairer and Wanner, Solving Ordinary Differential Equations II (1996), section IV.2; beta = 0.2/q,
/// which is the 0.04 of their code DOPRI5 with q = 5.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Controller {
    exponent: f64,
    beta: f64,
    previous_error: f64,
    after_rejection: bool,
}

impl Controller {
    const SAFETY: f64 = 0.9;
    const SHRINK: f64 = 0.2;
    const GROW: f64 = 10.0;
    /// A smaller error of the step before is luck, and not to be built upon.
    const LEAST_ERROR: f64 = 1e-4;

    /// A controller for an error estimate which is `O(h^order)`.
    pub(crate) fn new(order: u32) -> Self {
        let order = f64::from(order);
        let beta = 0.2 / order;
        Self {
            exponent: 1.0 / order - 0.75 * beta,
            beta,
            previous_error: Self::LEAST_ERROR,
            after_rejection: false,
        }
    }

    /// The step to take after a step `h` with `error <= 1`.
    pub(crate) fn accept(&mut self, h: f64, error: f64) -> f64 {
        let divisor =
            math::pow(error, self.exponent) / math::pow(self.previous_error, self.beta) / Self::SAFETY;
        let next = h / divisor.clamp(1.0 / Self::GROW, 1.0 / Self::SHRINK);
        self.previous_error = error.max(Self::LEAST_ERROR);
        if core::mem::take(&mut self.after_rejection) { next.min(h) } else { next }
    }

    /// The step to try after a step `h` with `error > 1`, infinite included.
    pub(crate) fn reject(&mut self, h: f64, error: f64) -> f64 {
        self.after_rejection = true;
        h / (math::pow(error, self.exponent) / Self::SAFETY).min(1.0 / Self::SHRINK)
    }

    /// The step to try after a step `h` which left the domain of the equations.
    pub(crate) fn reject_non_finite(&mut self, h: f64) -> f64 {
        self.after_rejection = true;
        h * Self::SHRINK
    }
}

#[cfg(test)]
mod tests {
    use super::Controller;

    #[test]
    fn steps_follow_errors() {
        let mut controller = Controller::new(5);
        assert!(controller.reject(1.0, 32.0) < 0.9);
        assert_eq!(controller.reject(1.0, f64::INFINITY), Controller::SHRINK);
        // After a rejection the step does not grow at once, though the error would allow it.
        assert_eq!(controller.accept(1.0, 1e-9), 1.0);
        assert_eq!(controller.accept(1.0, 0.0), Controller::GROW);
        assert!(controller.accept(1.0, 1.0) < 1.0);
    }
}
