//! One accepted step: its size, trials, and the error of each.
//!
//! Does not know why a trial has failed beyond what the system says at its end: `failure` finds the reason.

use super::dense::Dense;
use super::norms::{all_finite, all_moderate, scaled_norm, square_within_range, tolerances, weighted_square};
use super::{Integrator, Progress};
use crate::error::{Error, Failure};
use crate::methods::{Derivatives, Estimate, Method, Start, Step, Tolerances, two_sum};
use crate::options::{Norm, StepSize, signed};
use crate::real::Real;
use crate::system::{StateVector, System};

/// Why a trial step is not taken.
enum Rejection {
    /// The square of the norm of the error, above one.
    Inaccurate(f64),
    /// Something was not finite, the state left its domain, or the stages could not be computed.
    Failed(Error),
}

impl<R: Real, S: System<R>, M: Method<R, S>> Integrator<'_, R, S, M> {
    pub(super) fn step_within(&mut self, t_end: R, budget: &mut u64) -> Result<Progress, Error> {
        if !t_end.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        if t_end == self.t {
            return Ok(Progress::Reached);
        }
        let backward = self.t.all_gt(t_end);
        if !backward && !t_end.all_gt(self.t) {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        let t_last = self.last_time(t_end);
        let remaining = (t_last - self.t) - self.t_residue;
        if !remaining.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        let mut step = match self.options.step {
            StepSize::Fixed(h) => h.magnitude(),
            StepSize::Adaptive { initial, max } => {
                let longest = self.longest_step();
                let step = match (self.next_step, initial) {
                    (Some(step), _) => step,
                    (None, Some(initial)) => initial.magnitude(),
                    (None, None) if longest.is_finite() => longest,
                    (None, None) => self.select_initial_step(remaining),
                };
                max.map_or(step, |max| step.min(max.magnitude())).min(longest)
            }
        };
        let mut failure = None;
        loop {
            if *budget == 0 {
                return Err(Error::TooManySteps { t: signed(self.t), limit: self.options.max_steps });
            }
            *budget -= 1;
            let landing = remaining.magnitude() <= self.landing_range(step);
            let h = match self.options.step {
                _ if landing => remaining,
                StepSize::Fixed(h) if backward => -h,
                StepSize::Fixed(h) => h,
                StepSize::Adaptive { .. } if backward => R::from_f64(-step),
                StepSize::Adaptive { .. } => R::from_f64(step),
            };
            let (t, t_residue) =
                if landing { (t_last, R::ZERO) } else { two_sum(self.t, h + self.t_residue) };
            if !landing && !self.changes_time(h) {
                return Err(self.too_small(h, failure));
            }
            match self.attempt(h, t) {
                Ok(square) => {
                    self.accept(h, t, t_residue);
                    if let StepSize::Adaptive { .. } = self.options.step {
                        self.next_step = Some(if landing {
                            // A shortened step says nothing against longer ones: keep at least the size it was
                            // cut from, and the memory of the control.
                            self.control.accept_cut(h.magnitude(), square).max(step)
                        } else {
                            self.control.accept(h.magnitude(), square)
                        });
                    }
                    let is_reached = landing && t_last == t_end;
                    return Ok(if is_reached { Progress::Reached } else { Progress::Running });
                }
                Err(Rejection::Failed(reason)) => {
                    if let StepSize::Fixed(_) = self.options.step {
                        return Err(self.named(h, reason));
                    }
                    failure = Some(reason);
                    step = self.control.reject_non_finite(h.magnitude());
                }
                Err(Rejection::Inaccurate(square)) => {
                    // The equations hold here; only a reason that the system itself has named is kept.
                    if let Some(Error::Failure(Failure::NonFinite { .. })) = failure {
                        failure = None;
                    }
                    step = self.control.reject(h.magnitude(), square);
                }
            }
            self.stats.rejected += 1;
        }
    }

    /// The time at which the step ends at the latest: `t_end`, unless the method knows of an earlier one.
    #[inline]
    fn last_time(&mut self, t_end: R) -> R {
        if !self.method.tableau().is_series() {
            return t_end;
        }
        // The series at the current point takes the place of that of the last step.
        self.dense = Dense::Lost;
        self.ask(|method, storage, start| method.last_time(storage, start, t_end))
    }

    /// The longest step that the method knows to be accurate; infinity if it knows none.
    #[inline]
    fn longest_step(&mut self) -> f64 {
        if !self.method.tableau().is_series() {
            return f64::INFINITY;
        }
        self.ask(M::longest_step)
    }

    /// What the method answers at the current point.
    #[inline]
    fn ask<T>(&mut self, question: impl FnOnce(&M, &mut M::Storage, Start<'_, R, S>) -> T) -> T {
        let point = &self.points[usize::from(self.current)];
        let ends = [&point.state, &point.state];
        let start = Start {
            system: self.system,
            t: self.t,
            point,
            tolerances: tolerances(&self.rtol, &self.atol, ends, &mut self.scales),
            norm: self.options.norm,
            work: &mut self.work,
            rhs_evals: &mut self.stats.rhs_evals,
        };
        question(&self.method, &mut self.storage, start)
    }

    /// The largest distance to the end that a step of size `step` is stretched to cover, so that no sliver
    /// of a step is left.
    fn landing_range(&self, step: f64) -> f64 {
        match self.options.step {
            // Besides a sum of steps, the end itself is rounded.
            StepSize::Fixed(_) => step * (1.0 + 1e-9) + 2.0 * R::EPSILON * self.t.magnitude(),
            StepSize::Adaptive { max: None, .. } => step * 1.01,
            StepSize::Adaptive { max: Some(max), .. } => (step * 1.01).min(max.magnitude()),
        }
    }

    /// Whether a step is well above the spacing of numbers around the time.
    fn changes_time(&self, h: R) -> bool {
        let size = h.magnitude();
        match self.options.step {
            StepSize::Fixed(_) => (self.t + h).all_ne(self.t),
            StepSize::Adaptive { .. } => {
                size > 10.0 * R::EPSILON * self.t.magnitude()
                    && size >= R::MIN_POSITIVE
                    && (self.t + h).all_ne(self.t)
            }
        }
    }

    /// Computes stages, the trial state and the square of the norm of its error.
    ///
    /// The square, since the steps wait for it: every root on this way costs ten nanoseconds.
    fn attempt(&mut self, h: R, t_new: R) -> Result<f64, Rejection> {
        let last_h = matches!(self.dense, Dense::Ready | Dense::StagesMissing).then_some(self.h);
        self.dense = Dense::Lost;
        let [one, two] = &mut self.points;
        let (from, to) = if self.current { (two, one) } else { (one, two) };
        let from = &*from;
        let mut step = Step {
            system: self.system,
            t: self.t,
            h,
            from,
            to,
            work: &mut self.work,
            last_h,
            is_inside: false,
            rhs_evals: &mut self.stats.rhs_evals,
            jacobian_evals: &mut self.stats.jacobian_evals,
        };
        self.method.advance(&mut self.storage, &mut step).map_err(Rejection::Failed)?;
        let Step { to, work, rhs_evals, .. } = step;
        let has_slopes = !self.method.tableau().is_series();
        if has_slopes {
            *rhs_evals += 1;
            self.method.slope(&mut self.storage, self.system, t_new, to);
        }
        if !all_finite(&to.state) || has_slopes && !all_finite(&to.slope) {
            return Err(Rejection::Failed(self.diagnose(h, t_new).into()));
        }
        self.system.domain(t_new, &to.state).map_err(|failure| Rejection::Failed(failure.into()))?;
        if !all_moderate(&to.state) {
            self.system.check(t_new, &to.state).map_err(|failure| Rejection::Failed(failure.into()))?;
        }
        if matches!(self.options.step, StepSize::Fixed(_)) || !has_slopes {
            return self.stays_regular(t_new).map(|()| 0.0);
        }
        let k = Derivatives {
            n_stages: self.method.tableau().n_stages(),
            first: &from.slope,
            stored: M::stages(&self.storage),
            last: &to.slope,
        };
        let norm = self.options.norm;
        let ends = [&from.state, &to.state];
        let known = match norm {
            Norm::Rms => M::mean_square_error(&self.storage, h, &self.rtol, &self.atol, ends),
            Norm::Max => None,
        };
        let square = known.filter(|square| square.is_finite()).unwrap_or_else(|| {
            let tolerances = tolerances(&self.rtol, &self.atol, ends, &mut self.scales);
            let tableau = self.method.tableau();
            let rows = tableau.error_weights();
            let estimate = |[first, second]: [f64; 2]| match tableau.estimate {
                Estimate::None | Estimate::Series => 0.0,
                Estimate::Embedded { .. } => first,
                Estimate::Combined { .. } if first == 0.0 => 0.0,
                Estimate::Combined { .. } => first * (first / (first + 0.01 * second)),
            };
            let first = weighted_square(norm, rows[0], &k, &tolerances, work);
            let second = weighted_square(norm, rows[1], &k, &tolerances, work);
            let square = estimate([first, second]) * (h.magnitude() * h.magnitude());
            if square.is_finite() {
                return square;
            }
            estimate(rows.map(|row| square_within_range(norm, row, &k, &tolerances, h, work)))
        });
        if square <= 1.0 {
            self.stays_regular(t_new).map(|()| square)
        } else if square.is_finite() {
            Err(Rejection::Inaccurate(square))
        } else {
            Err(Rejection::Inaccurate(f64::INFINITY))
        }
    }

    /// Whether no pivot has passed through zero on the way to the trial state, no single divisor through a pole of the
    /// slope, and no constraint has become dependent on others.
    #[inline]
    fn stays_regular(&mut self, t_new: R) -> Result<(), Rejection> {
        let to = &self.points[usize::from(!self.current)];
        let signature = self.system.signature(t_new, &to.state);
        if !(signature.all_ge(self.signature) && self.signature.all_ge(signature)) {
            self.takes_signature(t_new, signature)?;
        }
        let [from, to] = [self.current, !self.current].map(|at| &self.points[usize::from(at)].state);
        match self.system.keeps_rank((self.t, from), (t_new, to)) {
            true => Ok(()),
            false => Err(Rejection::Failed(Failure::RankLost { t: signed(t_new) }.into())),
        }
    }

    /// Takes the signature of the trial state where single divisors alone have passed through zero, and the slope has
    /// no pole there: `sin(x)/x` has a value at zero.
    #[cold]
    fn takes_signature(&mut self, t_new: R, signature: R) -> Result<(), Rejection> {
        // A NaN is not smaller.
        if (signature - self.signature).magnitude() < 1.0 && !self.has_pole(t_new) {
            self.signature = signature;
            return Ok(());
        }
        Err(Rejection::Failed(self.crossed(t_new).into()))
    }

    fn accept(&mut self, h: R, t: R, t_residue: R) {
        self.current = !self.current;
        self.t_previous = self.t;
        self.t = t;
        self.t_residue = t_residue;
        self.h = h;
        let has_stages = !self.method.tableau().dense_stages.is_empty();
        self.dense = if has_stages { Dense::StagesMissing } else { Dense::Ready };
        self.stats.steps += 1;
    }

    /// A first step whose error is about that of an explicit Euler step of one per cent of the tolerance.
    ///
    /// # Source
    ///
    /// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), algorithm II.4.14.
    fn select_initial_step(&mut self, remaining: R) -> f64 {
        let distance = remaining.magnitude();
        let small = 1e-6 * distance;
        // The first step must pass the test of `changes_time`, whatever the norms say.
        let least = (100.0 * R::EPSILON * self.t.magnitude()).max(R::MIN_POSITIVE).min(distance);
        let [one, two] = &mut self.points;
        let (here, free) = if self.current { (two, one) } else { (one, two) };
        let (y, slope) = (here.state.as_slice(), here.slope.as_slice());
        let tolerances = tolerances(&self.rtol, &self.atol, [&here.state; 2], &mut self.scales);
        let (norm, out) = (self.options.norm, self.work.as_mut_slice());
        let state_norm = scaled_norm(norm, &tolerances, out, |c| y[c]);
        let slope_norm = scaled_norm(norm, &tolerances, out, |c| slope[c]);
        let quotient = 0.01 * (state_norm / slope_norm);
        let usable = state_norm >= 1e-5 && slope_norm >= 1e-5 && quotient.is_finite() && quotient > 0.0;
        let guess = (if usable { quotient } else { small }).min(distance);
        let h = if R::ZERO.all_gt(remaining) { R::from_f64(-guess) } else { R::from_f64(guess) };
        if usable {
            let trial = (100.0 * guess).min(distance);
            let trial = if R::ZERO.all_gt(remaining) { R::from_f64(-trial) } else { R::from_f64(trial) };
            let start = Start {
                system: self.system,
                t: self.t,
                point: here,
                tolerances: Tolerances { ..tolerances },
                norm,
                work: &mut self.work,
                rhs_evals: &mut self.stats.rhs_evals,
            };
            if let Some(step) = self.method.first_step(&mut self.storage, start, trial) {
                self.dense = Dense::Lost;
                return step.min(distance).max(least);
            }
        }
        for (c, out) in self.work.as_mut_slice().iter_mut().enumerate() {
            *out = y[c] + h * slope[c];
        }
        // The point that a first step overwrites, and which no dense output needs any more.
        self.dense = Dense::Lost;
        self.system.rhs(self.t + h, &self.work, &mut free.slope);
        self.stats.rhs_evals += 1;
        let probe = free.slope.as_slice();
        let out = self.work.as_mut_slice();
        let bend_norm = scaled_norm(norm, &tolerances, out, |c| probe[c] - slope[c]) / guess;
        let steepest = if bend_norm > slope_norm { bend_norm } else { slope_norm };
        let tableau = self.method.tableau();
        let order = tableau.estimate_order().unwrap_or(tableau.order);
        let refined = if steepest <= 1e-15 {
            small.max(guess * 1e-3)
        } else {
            crate::math::pow(0.01 / steepest, 1.0 / f64::from(order))
        };
        let step = (100.0 * guess).min(refined).min(distance);
        // Where a norm overflowed or the probe left the domain, start small and let the control decide.
        if bend_norm.is_finite() && step.is_finite() { step.max(least) } else { guess.max(least) }
    }
}
