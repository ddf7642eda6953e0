//! Choices of an integration and their validation.

use crate::error::Error;
use crate::real::Real;

/// How the errors of the components are gathered into one number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Norm {
    /// Root of the mean square, as in Hairer, Norsett and Wanner (1993), equation II.4.11.
    #[default]
    Rms,
    /// Largest component.
    Max,
}

/// How the step size is chosen. All sizes are positive; their sign follows from the direction of time.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum StepSize<R> {
    /// From the error estimate of the method.
    Adaptive {
        /// First step to try; without it, one is derived from the right-hand side.
        initial: Option<R>,
        /// Upper bound on every step.
        max: Option<R>,
    },
    /// The same size for every step; only the last one before the end is shortened.
    Fixed(R),
}

/// Tolerances, step sizes and limits of an integration.
///
/// A step is accepted if the norm of `error_i / (atol + rtol max(|y0_i|, |y1_i|))` is at most one, with `0/0 = 0`, so
/// that a component may be zero where `atol` is. No constant is added: with a zero `atol`, or one scaled with the
/// state, results do not depend on the scale of the state.
///
/// ```
/// use hamel_runtime::{Error, Norm, Options};
///
/// let options = Options::adaptive(1e-9, 1e-12).with_max_step(0.1).with_norm(Norm::Max);
/// assert_eq!(options.validate(), Ok(()));
/// assert!(matches!(Options::fixed(-0.1).validate(), Err(Error::StepSize { .. })));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Options<R> {
    /// Relative tolerance; unused with fixed steps.
    pub rtol: R,
    /// Absolute tolerance, the same for every component; unused with fixed steps.
    pub atol: R,
    /// Choice of step sizes.
    pub step: StepSize<R>,
    /// Norm of the error.
    pub norm: Norm,
    /// Limit on attempted steps, accepted and rejected, of one call of the integrator.
    pub max_steps: u64,
    /// Limit on events that are told in one call of the integrator.
    pub max_events: u64,
}

impl<R: Real> Options<R> {
    const MAX_STEPS: u64 = 10_000_000;
    const MAX_EVENTS: u64 = 1_000_000;

    /// Steps chosen such that the estimated local error stays within the tolerances.
    ///
    /// A relative tolerance of zero asks for absolute tolerance alone. A zero absolute tolerance is allowed
    /// too, and slow where a component passes through zero.
    #[must_use]
    pub fn adaptive(rtol: R, atol: R) -> Self {
        let step = StepSize::Adaptive { initial: None, max: None };
        Self { rtol, atol, step, norm: Norm::Rms, max_steps: Self::MAX_STEPS, max_events: Self::MAX_EVENTS }
    }

    /// Steps of the size `h > 0`.
    #[must_use]
    pub fn fixed(h: R) -> Self {
        let step = StepSize::Fixed(h);
        Self {
            rtol: R::ZERO,
            atol: R::ZERO,
            step,
            norm: Norm::Rms,
            max_steps: Self::MAX_STEPS,
            max_events: Self::MAX_EVENTS,
        }
    }

    /// Sets the first step to try; no effect with fixed steps.
    #[must_use]
    pub fn with_initial_step(mut self, h: R) -> Self {
        if let StepSize::Adaptive { initial, .. } = &mut self.step {
            *initial = Some(h);
        }
        self
    }

    /// Sets the upper bound on every step; no effect with fixed steps.
    #[must_use]
    pub fn with_max_step(mut self, h: R) -> Self {
        if let StepSize::Adaptive { max, .. } = &mut self.step {
            *max = Some(h);
        }
        self
    }

    /// Sets the norm of the error.
    #[must_use]
    pub fn with_norm(mut self, norm: Norm) -> Self {
        self.norm = norm;
        self
    }

    /// Sets the limit on attempted steps of one call.
    #[must_use]
    pub fn with_max_steps(mut self, limit: u64) -> Self {
        self.max_steps = limit;
        self
    }

    /// Sets the limit on events that are told in one call.
    #[must_use]
    pub fn with_max_events(mut self, limit: u64) -> Self {
        self.max_events = limit;
        self
    }

    /// The same options for another scalar, each number by `convert`.
    ///
    /// ```
    /// use hamel_runtime::Options;
    ///
    /// let options = Options::adaptive(1e-6, 1e-9).with_max_step(0.5);
    /// assert_eq!(options.map(|x| x as f32), Options::adaptive(1e-6, 1e-9).with_max_step(0.5_f32));
    /// ```
    #[must_use]
    pub fn map<Q: Real>(self, convert: impl Fn(R) -> Q) -> Options<Q> {
        let Self { rtol, atol, step, norm, max_steps, max_events } = self;
        let step = match step {
            StepSize::Fixed(h) => StepSize::Fixed(convert(h)),
            StepSize::Adaptive { initial, max } => {
                StepSize::Adaptive { initial: initial.map(&convert), max: max.map(&convert) }
            }
        };
        Options { rtol: convert(rtol), atol: convert(atol), step, norm, max_steps, max_events }
    }

    /// Checks every number of the options.
    ///
    /// # Errors
    ///
    /// [`Error::RelativeTolerance`], [`Error::AbsoluteTolerance`] and [`Error::ZeroTolerances`] for adaptive
    /// steps, [`Error::StepSize`] for any step size that is not positive and finite.
    pub fn validate(&self) -> Result<(), Error> {
        let positive = |h: R| {
            if h.all_finite() && h.all_gt(R::ZERO) {
                Ok(())
            } else {
                Err(Error::StepSize { value: signed(h) })
            }
        };
        let (initial, max) = match self.step {
            StepSize::Fixed(h) => return positive(h),
            StepSize::Adaptive { initial, max } => (initial, max),
        };
        validate_tolerances(self.rtol, self.atol)?;
        initial.map_or(Ok(()), positive)?;
        max.map_or(Ok(()), positive)
    }
}

/// Checks a pair of tolerances.
pub(crate) fn validate_tolerances<R: Real>(rtol: R, atol: R) -> Result<(), Error> {
    let least = 10.0 * R::EPSILON;
    let rtol_is_zero = rtol == R::ZERO;
    if !rtol.all_finite() || !(rtol_is_zero || rtol.all_ge(R::from_f64(least))) {
        return Err(Error::RelativeTolerance { value: signed(rtol), least });
    }
    if !atol.all_finite() || !atol.all_ge(R::ZERO) {
        return Err(Error::AbsoluteTolerance { value: signed(atol), least: 0.0 });
    }
    if rtol_is_zero && !atol.all_gt(R::ZERO) {
        return Err(Error::ZeroTolerances { least });
    }
    Ok(())
}

/// The value with the largest magnitude and its sign, for messages.
pub(crate) fn signed<R: Real>(x: R) -> f64 {
    if R::ZERO.all_gt(x) { -x.magnitude() } else { x.magnitude() }
}

#[cfg(test)]
mod tests {
    use super::{Options, signed};
    use crate::error::Error;

    #[test]
    fn tolerances_are_validated() {
        let least = 10.0 * f64::EPSILON;
        assert_eq!(
            Options::adaptive(1e-16, 1e-9).validate(),
            Err(Error::RelativeTolerance { value: 1e-16, least })
        );
        assert_eq!(
            Options::adaptive(-1.0, 1e-9).validate(),
            Err(Error::RelativeTolerance { value: -1.0, least })
        );
        let infinite = Options::adaptive(f64::INFINITY, 1e-9).validate();
        assert_eq!(infinite, Err(Error::RelativeTolerance { value: f64::INFINITY, least }));
        assert!(matches!(
            Options::adaptive(f64::NAN, 1e-9).validate(),
            Err(Error::RelativeTolerance { value, .. }) if value.is_nan()
        ));
        assert_eq!(
            Options::adaptive(1e-9, -1e-9).validate(),
            Err(Error::AbsoluteTolerance { value: -1e-9, least: 0.0 })
        );
        assert!(Options::adaptive(1e-9, f64::NAN).validate().is_err());
        assert_eq!(Options::adaptive(0.0, 0.0).validate(), Err(Error::ZeroTolerances { least }));
        assert_eq!(Options::adaptive(0.0, 1e-9).validate(), Ok(()));
        assert_eq!(Options::adaptive(1e-9, 0.0).validate(), Ok(()));
        assert_eq!(Options::adaptive(2.3e-15, 0.0).validate(), Ok(()));
        let narrow = Options::adaptive(1e-7_f32, 0.0).validate();
        assert!(matches!(narrow, Err(Error::RelativeTolerance { least, .. }) if least > 1e-6));
    }

    #[test]
    fn step_sizes_are_validated() {
        for value in [0.0, -0.1, f64::INFINITY] {
            let expected = Err(Error::StepSize { value });
            assert_eq!(Options::fixed(value).validate(), expected);
            assert_eq!(Options::adaptive(1e-6, 1e-6).with_initial_step(value).validate(), expected);
            assert_eq!(Options::adaptive(1e-6, 1e-6).with_max_step(value).validate(), expected);
        }
        assert!(Options::fixed(f64::NAN).validate().is_err());
        assert_eq!(Options::fixed(0.1).validate(), Ok(()));
    }

    #[test]
    fn signed_keeps_sign_and_nan() {
        assert_eq!((signed(-2.0), signed(3.0_f32)), (-2.0, 3.0));
        assert!(signed(f64::NAN).is_nan());
    }
}
