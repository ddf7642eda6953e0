//! The one driver and stepping loop of all methods.
//!
//! The module deliberately does not know any method: it reads a tableau.

use core::fmt;

use crate::controller::Controller;
use crate::error::{Error, Failure};
use crate::methods::{Estimate, Method};
use crate::options::{Norm, Options, StepSize, signed};
use crate::real::Real;
use crate::system::{StateVector, System};

/// Counts of work done since the integrator was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected: u64,
    /// Evaluations of the right-hand side, those for dense output included.
    pub rhs_evals: u64,
}

/// Where a step led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Progress {
    /// The end is still ahead.
    Running,
    /// The time is exactly the end asked for.
    Reached,
}

impl Progress {
    /// Whether the end was reached.
    #[must_use]
    pub fn reached(self) -> bool {
        self == Self::Reached
    }
}

/// What dense output needs before it can be evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dense {
    /// No step was taken yet.
    NoStep,
    /// The stages of dense output alone have not been computed.
    StagesMissing,
    /// Everything is there.
    Ready,
    /// A failed step has overwritten the stages.
    Lost,
}

/// Why a trial step is not taken.
enum Rejection {
    /// The norm of the error, above one.
    Inaccurate(f64),
    /// Something was not finite.
    NonFinite(Failure),
}

/// Integrates a system with a method from an initial state, step by step in either direction of time.
///
/// Time and state are summed with compensation, so that round-off does not grow with the number of steps.
/// After an error the last accepted time and state are kept.
///
/// # Source
///
/// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.4; Knuth, The Art
/// of Computer Programming 2 (1997), section 4.2.2, theorem B, for the sums.
pub struct Integrator<'s, R: Real, S: System<R>, M: Method> {
    system: &'s S,
    options: Options<R>,
    control: Controller,
    /// Size of the next adaptive step, positive; none before the first.
    next_step: Option<f64>,
    t: R,
    t_previous: R,
    /// What the sum `t` lacks.
    t_residue: R,
    /// The last accepted step, signed.
    h: R,
    y: S::State,
    y_previous: S::State,
    /// What the sum `y` lacks.
    y_residue: S::State,
    trial: S::State,
    trial_residue: S::State,
    work: S::State,
    stages: M::Stages<S::State>,
    /// Whether the derivative at `y` is the last stage of the step before, and not yet the first of the next.
    derivative_is_last: bool,
    dense: Dense,
    stats: Stats,
}

impl<'s, R: Real, S: System<R>, M: Method> Integrator<'s, R, S, M> {
    /// Places `system` at the state `y0` at time `t0`.
    ///
    /// # Errors
    ///
    /// Those of [`Options::validate`]; [`Error::NoErrorEstimate`] for adaptive steps with a method for fixed
    /// ones; [`Error::TimeNotFinite`]; [`Error::Failure`] if the right-hand side has no value at `y0`.
    pub fn new(system: &'s S, _method: M, t0: R, y0: S::State, options: Options<R>) -> Result<Self, Error> {
        options.validate()?;
        let estimate_order = match (M::TABLEAU.estimate, options.step) {
            (Estimate::Embedded { order, .. } | Estimate::Combined { order, .. }, _) => order,
            // Unused with fixed steps.
            (Estimate::None, StepSize::Fixed(_)) => M::TABLEAU.order,
            (Estimate::None, StepSize::Adaptive { .. }) => {
                return Err(Error::NoErrorEstimate { method: M::TABLEAU.name });
            }
        };
        if !t0.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t0) });
        }
        if let Some(index) = non_finite(&y0) {
            return Err(Failure::NonFinite { t: signed(t0), index }.into());
        }
        system.check(t0, &y0)?;
        let zeros = y0.zeros_like();
        let mut stages = M::stages(&zeros);
        system.rhs(t0, &y0, &mut stages.as_mut()[0]);
        if let Some(index) = non_finite(&stages.as_ref()[0]) {
            return Err(Failure::NonFinite { t: signed(t0), index }.into());
        }
        Ok(Self {
            system,
            options,
            control: Controller::new(estimate_order),
            next_step: None,
            t: t0,
            t_previous: t0,
            t_residue: R::ZERO,
            h: R::ZERO,
            y_previous: y0.clone(),
            y: y0,
            y_residue: zeros.clone(),
            trial: zeros.clone(),
            trial_residue: zeros.clone(),
            work: zeros,
            stages,
            derivative_is_last: false,
            dense: Dense::NoStep,
            stats: Stats { rhs_evals: 1, ..Stats::default() },
        })
    }

    /// Time of the last accepted state.
    pub fn t(&self) -> R {
        self.t
    }

    /// The last accepted state.
    pub fn state(&self) -> &S::State {
        &self.y
    }

    /// Time of the state before the last step; [`t`](Self::t) before the first.
    pub fn previous_t(&self) -> R {
        self.t_previous
    }

    /// The system that is integrated.
    pub fn system(&self) -> &'s S {
        self.system
    }

    /// Counts of the work done so far.
    pub fn stats(&self) -> Stats {
        self.stats
    }

    /// Takes one accepted step towards `t_end`, with as many trials as it needs, and never beyond.
    ///
    /// At `t_end` nothing is done.
    ///
    /// # Errors
    ///
    /// [`Error::TimeNotFinite`] for `t_end`; [`Error::Failure`], [`Error::StepTooSmall`] and
    /// [`Error::TooManySteps`] if there is no acceptable step.
    pub fn step_towards(&mut self, t_end: R) -> Result<Progress, Error> {
        let mut budget = self.options.max_steps;
        self.step_within(t_end, &mut budget)
    }

    /// Takes steps until the time is exactly `t_end`.
    ///
    /// # Errors
    ///
    /// As [`step_towards`](Self::step_towards).
    pub fn integrate_to(&mut self, t_end: R) -> Result<(), Error> {
        let mut budget = self.options.max_steps;
        while !self.step_within(t_end, &mut budget)?.reached() {}
        Ok(())
    }

    /// Integrates to `t_end` and calls `output` with the state at each of `times`, from dense output.
    ///
    /// The times lie between the current time and `t_end`, in the direction of integration.
    ///
    /// # Errors
    ///
    /// As [`step_towards`](Self::step_towards); [`Error::OutsideInterval`] for a time beyond `t_end` or one
    /// that the integration has already left behind.
    pub fn sample(
        &mut self,
        t_end: R,
        times: impl IntoIterator<Item = R>,
        mut output: impl FnMut(R, &S::State),
    ) -> Result<(), Error> {
        let mut budget = self.options.max_steps;
        if !t_end.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        let backward = self.t.all_gt(t_end);
        let ahead = |time: R, of: R| if backward { of.all_gt(time) } else { time.all_gt(of) };
        for time in times {
            if !time.all_finite() {
                return Err(Error::TimeNotFinite { value: signed(time) });
            }
            if ahead(time, t_end) {
                return Err(Error::OutsideInterval {
                    t: signed(time),
                    from: signed(self.t),
                    to: signed(t_end),
                });
            }
            while ahead(time, self.t) {
                let _ = self.step_within(t_end, &mut budget)?;
            }
            self.evaluate_dense(time)?;
            output(time, &self.trial);
        }
        while !self.step_within(t_end, &mut budget)?.reached() {}
        Ok(())
    }

    /// Writes the state at a time within the last step to `out`.
    ///
    /// The first call in a step computes the stages which the method needs for dense output alone.
    ///
    /// # Errors
    ///
    /// [`Error::OutsideInterval`] unless `t` lies between [`previous_t`](Self::previous_t) and
    /// [`t`](Self::t); [`Error::NoDenseOutput`] after a failed step; [`Error::Failure`] if a stage for dense
    /// output has no value.
    pub fn interpolate(&mut self, t: R, out: &mut S::State) -> Result<(), Error> {
        self.evaluate_dense(t)?;
        copy(&self.trial, out);
        Ok(())
    }

    fn step_within(&mut self, t_end: R, budget: &mut u64) -> Result<Progress, Error> {
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
        let remaining = (t_end - self.t) - self.t_residue;
        if !remaining.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        let mut step = match self.options.step {
            StepSize::Fixed(h) => h.magnitude(),
            StepSize::Adaptive { initial, max } => {
                let step = match (self.next_step, initial) {
                    (Some(step), _) => step,
                    (None, Some(initial)) => initial.magnitude(),
                    (None, None) => self.select_initial_step(remaining),
                };
                max.map_or(step, |max| step.min(max.magnitude()))
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
            let (t, t_residue) = if landing { (t_end, R::ZERO) } else { two_sum(self.t, h + self.t_residue) };
            if !landing && !self.changes_time(h) {
                return Err(failure.unwrap_or(Error::StepTooSmall { t: signed(self.t), h: signed(h) }));
            }
            self.dense = Dense::Lost;
            if self.derivative_is_last {
                let (first, last) = self.stages.as_mut().split_at_mut(M::TABLEAU.n_stages());
                copy(&last[0], &mut first[0]);
                self.derivative_is_last = false;
            }
            match self.attempt(h, t) {
                Ok(error) => {
                    self.accept(h, t, t_residue);
                    if let StepSize::Adaptive { .. } = self.options.step {
                        let mut control = self.control;
                        let next = control.accept(h.magnitude(), error);
                        if landing {
                            // A shortened step says nothing against longer ones: keep at least the size it was
                            // cut from, and the memory of the control.
                            self.next_step = Some(next.max(step));
                        } else {
                            self.next_step = Some(next);
                            self.control = control;
                        }
                    }
                    return Ok(if landing { Progress::Reached } else { Progress::Running });
                }
                Err(Rejection::NonFinite(reason)) => {
                    if let StepSize::Fixed(_) = self.options.step {
                        return Err(reason.into());
                    }
                    failure = Some(reason.into());
                    step = self.control.reject_non_finite(h.magnitude());
                }
                Err(Rejection::Inaccurate(error)) => {
                    // The equations hold here; only a reason that the system itself has named is kept.
                    if let Some(Error::Failure(Failure::NonFinite { .. })) = failure {
                        failure = None;
                    }
                    step = self.control.reject(h.magnitude(), error);
                }
            }
            self.stats.rejected += 1;
        }
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
                size > 10.0 * R::EPSILON * self.t.magnitude() && size >= TINY && (self.t + h).all_ne(self.t)
            }
        }
    }

    /// Computes stages, the trial state and the norm of its error.
    fn attempt(&mut self, h: R, t_new: R) -> Result<f64, Rejection> {
        let tableau = M::TABLEAU;
        let n_stages = tableau.n_stages();
        let stages = self.stages.as_mut();
        for (index, (row, node)) in tableau.stages.iter().zip(tableau.nodes).enumerate().skip(1) {
            let (known, next) = stages.split_at_mut(index);
            weighted_sum(row, known, &mut self.work);
            advance(&self.y, h, &mut self.work);
            self.system.rhs(self.t + R::from_f64(*node) * h, &self.work, &mut next[0]);
        }
        weighted_sum(tableau.weights, stages, &mut self.work);
        compensated_advance(
            (&self.y, &self.y_residue),
            h,
            &self.work,
            (&mut self.trial, &mut self.trial_residue),
        );
        self.stats.rhs_evals += n_stages as u64 - 1;
        if !all_finite(&self.trial) {
            return Err(Rejection::NonFinite(self.diagnose(h, t_new)));
        }
        self.system.rhs(t_new, &self.trial, &mut stages[n_stages]);
        self.stats.rhs_evals += 1;
        if !all_finite(&stages[n_stages]) {
            return Err(Rejection::NonFinite(self.diagnose(h, t_new)));
        }
        if let StepSize::Fixed(_) = self.options.step {
            return Ok(0.0);
        }
        let error = match tableau.estimate {
            Estimate::None => 0.0,
            Estimate::Embedded { weights, .. } => self.error_norm(weights),
            Estimate::Combined { fifth, third, .. } => {
                let fifth = self.error_norm(fifth);
                if fifth == 0.0 {
                    0.0
                } else {
                    let ratio = self.error_norm(third) / fifth;
                    fifth / crate::math::sqrt(1.0 + 0.01 * ratio * ratio)
                }
            }
        } * h.magnitude();
        if error <= 1.0 {
            Ok(error)
        } else if error.is_finite() {
            Err(Rejection::Inaccurate(error))
        } else {
            Err(Rejection::Inaccurate(f64::INFINITY))
        }
    }

    /// Norm of `sum_i e_i k_i` relative to the tolerances.
    fn error_norm(&mut self, weights: &[(usize, f64)]) -> f64 {
        weighted_sum(weights, self.stages.as_ref(), &mut self.work);
        scaled_norm(&self.options, &self.work, &self.y, &self.trial)
    }

    fn accept(&mut self, h: R, t: R, t_residue: R) {
        copy(&self.y, &mut self.y_previous);
        copy(&self.trial, &mut self.y);
        copy(&self.trial_residue, &mut self.y_residue);
        self.t_previous = self.t;
        self.t = t;
        self.t_residue = t_residue;
        self.h = h;
        self.derivative_is_last = true;
        self.dense = if M::TABLEAU.dense_stages.is_empty() { Dense::Ready } else { Dense::StagesMissing };
        self.stats.steps += 1;
    }

    /// Finds the first point of a trial step where something is not finite, and asks the system why.
    #[cold]
    fn diagnose(&mut self, h: R, t_new: R) -> Failure {
        let tableau = M::TABLEAU;
        let stages = self.stages.as_ref();
        for (index, (row, node)) in tableau.stages.iter().zip(tableau.nodes).enumerate() {
            weighted_sum(row, stages, &mut self.work);
            advance(&self.y, h, &mut self.work);
            let t = self.t + R::from_f64(*node) * h;
            if let Some(failure) = self.point_failure(t, &self.work, Some(&stages[index])) {
                return failure;
            }
        }
        self.point_failure(t_new, &self.trial, Some(&stages[tableau.n_stages()]))
            .unwrap_or(Failure::NonFinite { t: signed(t_new), index: 0 })
    }

    /// Why a point, or the derivative there, is not finite; none if both are.
    fn point_failure(&self, t: R, y: &S::State, derivative: Option<&S::State>) -> Option<Failure> {
        if let Some(index) = non_finite(y) {
            return Some(Failure::NonFinite { t: signed(t), index });
        }
        let index = non_finite(derivative?)?;
        Some(self.system.check(t, y).err().unwrap_or(Failure::NonFinite { t: signed(t), index }))
    }

    /// A first step whose error is about that of an explicit Euler step of one per cent of the tolerance.
    ///
    /// # Source
    ///
    /// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), algorithm II.4.14.
    fn select_initial_step(&mut self, remaining: R) -> f64 {
        const SMALL: f64 = 1e-6;
        let distance = remaining.magnitude();
        let n_stages = M::TABLEAU.n_stages();
        let (first, last) = self.stages.as_mut().split_at_mut(n_stages);
        let (slope, probe) = (&first[0], &mut last[0]);
        let state_norm = scaled_norm(&self.options, &self.y, &self.y, &self.y);
        let slope_norm = scaled_norm(&self.options, slope, &self.y, &self.y);
        let quotient = 0.01 * (state_norm / slope_norm);
        let usable = state_norm >= 1e-5 && slope_norm >= 1e-5 && quotient.is_finite() && quotient > 0.0;
        let guess = (if usable { quotient } else { SMALL }).min(distance);
        let h = if R::ZERO.all_gt(remaining) { R::from_f64(-guess) } else { R::from_f64(guess) };
        copy(slope, &mut self.work);
        advance(&self.y, h, &mut self.work);
        self.system.rhs(self.t + h, &self.work, probe);
        self.stats.rhs_evals += 1;
        for ((out, &probe), &slope) in
            self.work.as_mut_slice().iter_mut().zip(probe.as_slice()).zip(slope.as_slice())
        {
            *out = probe - slope;
        }
        let bend_norm = scaled_norm(&self.options, &self.work, &self.y, &self.y) / guess;
        let steepest = if bend_norm > slope_norm { bend_norm } else { slope_norm };
        let order = match M::TABLEAU.estimate {
            Estimate::Embedded { order, .. } | Estimate::Combined { order, .. } => order,
            Estimate::None => M::TABLEAU.order,
        };
        let refined = if steepest <= 1e-15 {
            SMALL.max(guess * 1e-3)
        } else {
            crate::math::pow(0.01 / steepest, 1.0 / f64::from(order))
        };
        let step = (100.0 * guess).min(refined).min(distance);
        // Where a norm overflowed or the probe left the domain, start small and let the control decide. The
        // first step must pass the test of `changes_time`, whatever the norms say.
        let least = (100.0 * R::EPSILON * self.t.magnitude()).max(TINY).min(distance);
        if bend_norm.is_finite() && step.is_finite() { step.max(least) } else { guess.max(least) }
    }

    /// Writes the state at a time within the last step to `trial`, which is free between steps.
    fn evaluate_dense(&mut self, t: R) -> Result<(), Error> {
        if t == self.t {
            copy(&self.y, &mut self.trial);
            return Ok(());
        }
        let (from, to) = (self.t_previous, self.t);
        let inside = (t.all_ge(from) && to.all_ge(t)) || (from.all_ge(t) && t.all_ge(to));
        if !inside {
            return Err(Error::OutsideInterval { t: signed(t), from: signed(from), to: signed(to) });
        }
        if t == from {
            copy(&self.y_previous, &mut self.trial);
            return Ok(());
        }
        match self.dense {
            Dense::Ready => {}
            Dense::StagesMissing => self.complete_dense_stages()?,
            Dense::NoStep | Dense::Lost => return Err(Error::NoDenseOutput { t: signed(self.t) }),
        }
        let tableau = M::TABLEAU;
        let x = (t - from) / (to - from);
        let rest = R::ONE - x;
        let stages = self.stages.as_ref();
        let out = self.trial.as_mut_slice();
        out.fill(R::ZERO);
        for &(index, d) in tableau.dense {
            let [d0, d1, d2, d3] = d.map(R::from_f64);
            let weight = d0 + x * (d1 + rest * (d2 + x * d3));
            for (out, &derivative) in out.iter_mut().zip(stages[index].as_slice()) {
                *out += weight * derivative;
            }
        }
        let ends = self.y_previous.as_slice().iter().zip(self.y.as_slice());
        let slopes = stages[0].as_slice().iter().zip(stages[tableau.n_stages()].as_slice());
        for ((out, (&start, &end)), (&first, &last)) in out.iter_mut().zip(ends).zip(slopes) {
            let difference = end - start;
            let (first, last) = (self.h * first, self.h * last);
            let cubic = difference + difference - first - last + rest * (self.h * *out);
            *out = start + x * (difference + rest * (first - difference + x * cubic));
        }
        Ok(())
    }

    fn complete_dense_stages(&mut self) -> Result<(), Error> {
        let tableau = M::TABLEAU;
        let start = tableau.n_stages() + 1;
        for (offset, (row, node)) in tableau.dense_stages.iter().zip(tableau.dense_nodes).enumerate() {
            let (known, next) = self.stages.as_mut().split_at_mut(start + offset);
            weighted_sum(row, known, &mut self.work);
            advance(&self.y_previous, self.h, &mut self.work);
            let t = self.t_previous + R::from_f64(*node) * self.h;
            self.system.rhs(t, &self.work, &mut next[0]);
            self.stats.rhs_evals += 1;
            let stage = &self.stages.as_ref()[start + offset];
            if let Some(failure) = self.point_failure(t, &self.work, Some(stage)) {
                return Err(failure.into());
            }
        }
        self.dense = Dense::Ready;
        Ok(())
    }
}

impl<R: Real, S: System<R>, M: Method> fmt::Debug for Integrator<'_, R, S, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Integrator")
            .field("method", &M::TABLEAU.name)
            .field("t", &self.t)
            .field("state", &self.y.as_slice())
            .field("options", &self.options)
            .field("stats", &self.stats)
            .finish_non_exhaustive()
    }
}

/// Smallest step, and smallest scale of a component: the least normal `f32`, so that it exists in any scalar.
pub(crate) const TINY: f64 = f32::MIN_POSITIVE as f64;

pub(crate) fn copy<R: Real, V: StateVector<R>>(from: &V, to: &mut V) {
    for (to, from) in to.as_mut_slice().iter_mut().zip(from.as_slice()) {
        *to = *from;
    }
}

/// Whether no component is infinite or NaN, without branches.
fn all_finite<R: Real, V: StateVector<R>>(v: &V) -> bool {
    v.as_slice().iter().fold(true, |finite, x| finite & x.all_finite())
}

/// Position of the first component that is infinite or NaN.
pub(crate) fn non_finite<R: Real, V: StateVector<R>>(v: &V) -> Option<usize> {
    v.as_slice().iter().position(|x| !x.all_finite())
}

/// The rounded sum and its rounding error: `a + b = sum + residue` exactly.
pub(crate) fn two_sum<R: Real>(a: R, b: R) -> (R, R) {
    let sum = a + b;
    let b_part = sum - a;
    (sum, (a - (sum - b_part)) + (b - b_part))
}

/// `out = sum_j row_j k_j`.
fn weighted_sum<R: Real, V: StateVector<R>>(row: &[(usize, f64)], stages: &[V], out: &mut V) {
    let out = out.as_mut_slice();
    out.fill(R::ZERO);
    for &(index, weight) in row {
        let weight = R::from_f64(weight);
        for (out, &derivative) in out.iter_mut().zip(stages[index].as_slice()) {
            *out += weight * derivative;
        }
    }
}

/// `slope = y + h slope`.
fn advance<R: Real, V: StateVector<R>>(y: &V, h: R, slope: &mut V) {
    for (slope, &y) in slope.as_mut_slice().iter_mut().zip(y.as_slice()) {
        *slope = y + h * *slope;
    }
}

/// `out + out_residue = y + y_residue + h slope`.
fn compensated_advance<R: Real, V: StateVector<R>>(
    (y, y_residue): (&V, &V),
    h: R,
    slope: &V,
    (out, out_residue): (&mut V, &mut V),
) {
    let from = y.as_slice().iter().zip(y_residue.as_slice()).zip(slope.as_slice());
    let to = out.as_mut_slice().iter_mut().zip(out_residue.as_mut_slice());
    for (((&y, &y_residue), &slope), (out, out_residue)) in from.zip(to) {
        (*out, *out_residue) = two_sum(y, h * slope + y_residue);
    }
}

/// Norm of `v_i / (atol + rtol max(|a_i|, |b_i|))`; NaN if a component is.
fn scaled_norm<R: Real, V: StateVector<R>>(options: &Options<R>, v: &V, a: &V, b: &V) -> f64 {
    let half = R::from_f64(0.5);
    let tiny = R::from_f64(TINY);
    let components = v.as_slice().iter().zip(a.as_slice()).zip(b.as_slice()).map(|((&v, &a), &b)| {
        let (a, b) = (a.abs(), b.abs());
        // The larger of the two on every lane.
        let larger = half * (a + b + (a - b).abs());
        (v / (options.atol + options.rtol * larger + tiny)).magnitude()
    });
    match options.norm {
        Norm::Rms => {
            let (sum, n) = components.fold((0.0, 0u32), |(sum, n), x| (sum + x * x, n + 1));
            if n == 0 { 0.0 } else { crate::math::sqrt(sum / f64::from(n)) }
        }
        Norm::Max => components.fold(0.0, |max: f64, x| if x.is_nan() || x > max { x } else { max }),
    }
}
