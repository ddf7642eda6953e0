//! The one driver and stepping loop of all methods.
//!
//! The module deliberately does not know any method: it reads a tableau and has the stages, or a series, computed.

use core::fmt;
use core::ops::ControlFlow;

use crate::controller::Controller;
use crate::error::{Error, Failure};
use crate::events::{Direction, Event, locate};
use crate::methods::{
    Constant, Derivatives, Estimate, Method, Point, Start, Step, Tolerances, increments, larger,
    square_of_norm, two_sum,
};
use crate::options::{Norm, Options, StepSize, signed, validate_tolerances};
use crate::real::Real;
use crate::system::{StateVector, System};

/// Counts of work done since the integrator was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stats {
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected: u64,
    /// Evaluations of the right-hand side, those for dense output included; of methods by series, expansions.
    pub rhs_evals: u64,
    /// Evaluations of the Jacobian, of implicit methods only.
    pub jacobian_evals: u64,
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
    /// The square of the norm of the error, above one.
    Inaccurate(f64),
    /// Something was not finite, the state left its domain, or the stages could not be computed.
    Failed(Error),
}

/// Integrates a system with a method from an initial state, step by step in either direction of time.
///
/// Time and state are summed with compensation, so that round-off does not grow with the number of steps.
/// After an error the last accepted time and state are kept.
///
/// ```
/// use hamel_runtime::{Integrator, Options, System, Tsit5};
///
/// struct Growth;
///
/// impl System<f64> for Growth {
///     type State = [f64; 1];
///     fn rhs(&self, _t: f64, y: &[f64; 1], dy: &mut [f64; 1]) {
///         *dy = *y;
///     }
/// }
///
/// let mut solver = Integrator::new(&Growth, Tsit5, 0.0, [1.0], Options::adaptive(1e-8, 1e-10))?;
/// while !solver.step_towards(1.0)?.reached() {
///     println!("{}: {}", solver.t(), solver.state()[0]);
/// }
/// assert!((solver.state()[0] - 1.0_f64.exp()).abs() < 1e-7);
/// assert!(solver.stats().steps > 1);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
///
/// # Source
///
/// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.4; Knuth, The Art
/// of Computer Programming 2 (1997), section 4.2.2, theorem B, for the sums.
pub struct Integrator<'s, R: Real, S: System<R>, M: Method<R, S>> {
    system: &'s S,
    method: M,
    options: Options<R>,
    /// Relative tolerances of the components.
    rtol: S::State,
    /// Absolute tolerances of the components.
    atol: S::State,
    control: Controller,
    /// Size of the next adaptive step, positive; none before the first.
    next_step: Option<f64>,
    t: R,
    t_previous: R,
    /// What the sum `t` lacks.
    t_residue: R,
    /// The last accepted step, signed.
    h: R,
    /// The last accepted state and, unless a step has failed since, the one before.
    points: [Point<S::State>; 2],
    /// Which of `points` is the last accepted state.
    current: bool,
    /// Reciprocal scales of the components of an error.
    scales: S::State,
    work: S::State,
    storage: M::Storage,
    dense: Dense,
    /// [`System::signature`] of the initial state, which all accepted states have.
    signature: R,
    stats: Stats,
}

impl<'s, R: Real, S: System<R>, M: Method<R, S>> Integrator<'s, R, S, M> {
    /// Places `system` at the state `y0` at time `t0`.
    ///
    /// # Errors
    ///
    /// Those of [`Options::validate`]; [`Error::NoErrorEstimate`] for adaptive steps with a method for fixed
    /// ones; [`Error::Order`]; [`Error::TimeNotFinite`]; [`Error::Failure`] if the right-hand side has no value at `y0`.
    pub fn new(system: &'s S, method: M, t0: R, y0: S::State, options: Options<R>) -> Result<Self, Error> {
        options.validate()?;
        method.validate(&options)?;
        let estimate_order = match (M::TABLEAU.estimate_order(), options.step) {
            (Some(order), _) => order,
            // Unused with fixed steps.
            (None, StepSize::Fixed(_)) => M::TABLEAU.order,
            (None, StepSize::Adaptive { .. }) => {
                return Err(Error::NoErrorEstimate { method: M::TABLEAU.name });
            }
        };
        if !t0.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t0) });
        }
        if let Some(index) = non_finite(&y0) {
            return Err(Failure::NonFinite { t: signed(t0), index }.into());
        }
        system.domain(t0, &y0)?;
        system.check(t0, &y0)?;
        let signature = system.signature(t0, &y0);
        let zeros = y0.zeros_like();
        let storage = method.storage(system, t0, &y0, &options);
        let mut slope = zeros.clone();
        system.rhs(t0, &y0, &mut slope);
        if let Some(index) = non_finite(&slope) {
            return Err(Failure::NonFinite { t: signed(t0), index }.into());
        }
        let filled = |value: R| {
            let mut state = zeros.clone();
            state.as_mut_slice().fill(value);
            state
        };
        let start = Point { state: y0, residue: zeros.clone(), slope };
        Ok(Self {
            system,
            method,
            options,
            rtol: filled(options.rtol),
            atol: filled(options.atol),
            control: Controller::new(estimate_order),
            next_step: None,
            t: t0,
            t_previous: t0,
            t_residue: R::ZERO,
            h: R::ZERO,
            points: [start.clone(), start],
            current: false,
            scales: zeros.clone(),
            work: zeros,
            storage,
            dense: Dense::NoStep,
            signature,
            stats: Stats { rhs_evals: 1, ..Stats::default() },
        })
    }

    /// Replaces the tolerances of the options by those of each component; no effect with fixed steps.
    ///
    /// # Errors
    ///
    /// [`Error::ComponentTolerances`] for the first component whose tolerances [`Options::validate`] would reject.
    pub fn with_tolerances(mut self, rtol: S::State, atol: S::State) -> Result<Self, Error> {
        for (index, (&rtol, &atol)) in rtol.as_slice().iter().zip(atol.as_slice()).enumerate() {
            validate_tolerances(rtol, atol).map_err(|_| Error::ComponentTolerances {
                index,
                rtol: signed(rtol),
                atol: signed(atol),
            })?;
        }
        (self.rtol, self.atol) = (rtol, atol);
        Ok(self)
    }

    /// Time of the last accepted state.
    pub fn t(&self) -> R {
        self.t
    }

    /// The last accepted state.
    pub fn state(&self) -> &S::State {
        &self.here().state
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
        output: impl FnMut(R, &S::State),
    ) -> Result<(), Error> {
        let never = |_: Event<'_, R, S::State>| ControlFlow::Continue(());
        self.sample_with_events(t_end, times, output, [], |_, _| [], never).map(|_| ())
    }

    /// Integrates to `t_end` and calls `on_event` wherever one of `functions` changes its sign in the
    /// direction asked for.
    ///
    /// Events are located on dense output up to the spacing of times, and told in the order of time, just after the
    /// change of sign; where a function is zero over a stretch of time, at its start. Where `on_event` breaks, the integration stops: time and state are those of the event, and
    /// the answer is [`Progress::Running`] unless that is the end. A function that is zero at the start has no
    /// event there. Of several changes of one function within one step, an even number is overlooked and one of an
    /// odd number is found; [`Options::with_max_step`] bounds the step.
    ///
    /// With a scalar of several lanes, the lanes are to change sign together.
    ///
    /// # Errors
    ///
    /// As [`step_towards`](Self::step_towards); [`Error::EventNotFinite`] if a function has no value.
    pub fn integrate_with_events<const K: usize>(
        &mut self,
        t_end: R,
        directions: [Direction; K],
        functions: impl FnMut(R, &S::State) -> [R; K],
        on_event: impl FnMut(Event<'_, R, S::State>) -> ControlFlow<()>,
    ) -> Result<Progress, Error> {
        self.sample_with_events(t_end, [], |_, _| {}, directions, functions, on_event)
    }

    /// [`sample`](Self::sample) and [`integrate_with_events`](Self::integrate_with_events) at once: states and
    /// events are told in the order of time.
    ///
    /// # Errors
    ///
    /// Those of both.
    pub fn sample_with_events<const K: usize>(
        &mut self,
        t_end: R,
        times: impl IntoIterator<Item = R>,
        mut output: impl FnMut(R, &S::State),
        directions: [Direction; K],
        mut functions: impl FnMut(R, &S::State) -> [R; K],
        mut on_event: impl FnMut(Event<'_, R, S::State>) -> ControlFlow<()>,
    ) -> Result<Progress, Error> {
        let mut budget = self.options.max_steps;
        if !t_end.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        let mut samples =
            Samples { times: times.into_iter(), next: None, t_end, backward: self.t.all_gt(t_end) };
        samples.draw(self.t)?;
        self.output_until(self.t, &mut samples, &mut output)?;
        let mut before = finite_values(self.t, functions(self.t, self.state()))?;
        loop {
            let progress = self.step_within(t_end, &mut budget)?;
            let after = finite_values(self.t, functions(self.t, self.state()))?;
            let mut found = [None; K];
            for (index, found) in found.iter_mut().enumerate() {
                if directions[index].is_change(before[index], after[index]) {
                    *found = Some(self.locate_event(&mut functions, index, (before[index], after[index]))?);
                }
            }
            while let Some((index, t)) = earliest(&found, samples.backward) {
                found[index] = None;
                self.output_until(t, &mut samples, &mut output)?;
                self.evaluate_dense(t)?;
                if on_event(Event { index, t, state: &self.work }).is_break() {
                    self.stop_at(t)?;
                    return Ok(if t == t_end { Progress::Reached } else { Progress::Running });
                }
            }
            self.output_until(self.t, &mut samples, &mut output)?;
            before = after;
            if progress.reached() {
                return Ok(Progress::Reached);
            }
        }
    }

    /// Writes the state at a time within the last step to `out`.
    ///
    /// The first call in a step computes the stages which the method needs for dense output alone.
    ///
    /// # Errors
    ///
    /// [`Error::OutsideInterval`] unless `t` lies between [`previous_t`](Self::previous_t) and
    /// [`t`](Self::t); [`Error::NoDenseOutput`] after a failed step or a stop at an event; [`Error::Failure`] if a
    /// stage for dense output has no value.
    pub fn interpolate(&mut self, t: R, out: &mut S::State) -> Result<(), Error> {
        self.evaluate_dense(t)?;
        copy(&self.work, out);
        Ok(())
    }

    /// The last accepted state.
    fn here(&self) -> &Point<S::State> {
        &self.points[usize::from(self.current)]
    }

    /// Calls `output` at the times up to `t`.
    fn output_until(
        &mut self,
        t: R,
        samples: &mut Samples<R, impl Iterator<Item = R>>,
        output: &mut impl FnMut(R, &S::State),
    ) -> Result<(), Error> {
        while let Some(time) = samples.next.filter(|&time| !samples.is_ahead(time, t)) {
            self.evaluate_dense(time)?;
            output(time, &self.work);
            samples.draw(self.t)?;
        }
        Ok(())
    }

    /// The first time known to be after a change of sign of a function within the last step.
    fn locate_event<const K: usize>(
        &mut self,
        functions: &mut impl FnMut(R, &S::State) -> [R; K],
        index: usize,
        (before, after): (R, R),
    ) -> Result<R, Error> {
        let (from, to) = (self.t_previous, self.t);
        let time = |x: R| if x == R::ONE { to } else { from + x * (to - from) };
        let resolution = R::EPSILON * (1.0 + from.magnitude().max(to.magnitude()) / (to - from).magnitude());
        let value = |x: R| {
            let t = time(x);
            self.evaluate_dense(t)?;
            finite_values(t, functions(t, &self.work)).map(|values| signed(values[index]))
        };
        locate(value, (signed(before), signed(after)), resolution).map(time)
    }

    /// Makes the state in `work` the last accepted one, at a time within the last step.
    fn stop_at(&mut self, t: R) -> Result<(), Error> {
        if t == self.t {
            return Ok(());
        }
        let point = &mut self.points[usize::from(self.current)];
        copy(&self.work, &mut point.state);
        point.residue.as_mut_slice().fill(R::ZERO);
        (self.t, self.t_residue, self.dense) = (t, R::ZERO, Dense::Lost);
        self.system.rhs(t, &point.state, &mut point.slope);
        self.stats.rhs_evals += 1;
        let here = self.here();
        self.point_failure(t, &here.state, Some(&here.slope)).map_or(Ok(()), |failure| Err(failure.into()))
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
            let (t, t_residue) = if landing { (t_end, R::ZERO) } else { two_sum(self.t, h + self.t_residue) };
            if !landing && !self.changes_time(h) {
                return Err(self.too_small(h, failure));
            }
            match self.attempt(h, t) {
                Ok(square) => {
                    self.accept(h, t, t_residue);
                    if let StepSize::Adaptive { .. } = self.options.step {
                        let mut control = self.control;
                        let next = control.accept(h.magnitude(), square);
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

    /// The longest step that the method knows to be accurate; infinity if it knows none.
    #[inline]
    fn longest_step(&mut self) -> f64 {
        if const { !M::TABLEAU.is_series() } {
            return f64::INFINITY;
        }
        // The series at the current point takes the place of that of the last step.
        self.dense = Dense::Lost;
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
        self.method.longest_step(&mut self.storage, start)
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
            rhs_evals: &mut self.stats.rhs_evals,
            jacobian_evals: &mut self.stats.jacobian_evals,
        };
        self.method.advance(&mut self.storage, &mut step).map_err(Rejection::Failed)?;
        let Step { to, work, rhs_evals, .. } = step;
        let has_slopes = const { !M::TABLEAU.is_series() };
        if has_slopes {
            self.system.rhs(t_new, &to.state, &mut to.slope);
            *rhs_evals += 1;
        }
        if !all_finite(&to.state) || has_slopes && !all_finite(&to.slope) {
            return Err(Rejection::Failed(self.diagnose(h, t_new).into()));
        }
        self.system.domain(t_new, &to.state).map_err(|failure| Rejection::Failed(failure.into()))?;
        if !all_moderate(&to.state) {
            self.system.check(t_new, &to.state).map_err(|failure| Rejection::Failed(failure.into()))?;
        }
        if matches!(self.options.step, StepSize::Fixed(_)) || !has_slopes {
            return self.keeps_signature(t_new).map(|()| 0.0);
        }
        let k = Derivatives {
            n_stages: const { M::TABLEAU.n_stages() },
            first: &from.slope,
            stored: M::stages(&self.storage),
            last: &to.slope,
        };
        let tolerances = tolerances(&self.rtol, &self.atol, [&from.state, &to.state], &mut self.scales);
        let norm = self.options.norm;
        let estimate = |[first, second]: [f64; 2]| match M::TABLEAU.estimate {
            Estimate::None | Estimate::Series => 0.0,
            Estimate::Embedded { .. } => first,
            Estimate::Combined { .. } if first == 0.0 => 0.0,
            Estimate::Combined { .. } => first * (first / (first + 0.01 * second)),
        };
        let rows = const { M::TABLEAU.error_weights() };
        let first = weighted_square(norm, const { M::TABLEAU.error_weights()[0] }, &k, &tolerances, work);
        let second = weighted_square(norm, const { M::TABLEAU.error_weights()[1] }, &k, &tolerances, work);
        let mut square = estimate([first, second]) * (h.magnitude() * h.magnitude());
        if !square.is_finite() {
            square = estimate(rows.map(|row| square_within_range(norm, row, &k, &tolerances, h, work)));
        }
        if square <= 1.0 {
            self.keeps_signature(t_new).map(|()| square)
        } else if square.is_finite() {
            Err(Rejection::Inaccurate(square))
        } else {
            Err(Rejection::Inaccurate(f64::INFINITY))
        }
    }

    /// Whether no pivot has passed through zero on the way to the trial state.
    #[inline]
    fn keeps_signature(&self, t_new: R) -> Result<(), Rejection> {
        let to = &self.points[usize::from(!self.current)];
        let signature = self.system.signature(t_new, &to.state);
        if signature.all_ge(self.signature) && self.signature.all_ge(signature) {
            return Ok(());
        }
        Err(Rejection::Failed(self.crossed(t_new).into()))
    }

    /// Which pivot has passed through zero on the way to the trial state, or has no value there.
    #[cold]
    fn crossed(&self, t_new: R) -> Failure {
        let to = &self.points[usize::from(!self.current)].state;
        if let Err(failure) = self.system.check(t_new, to) {
            return failure;
        }
        // The signature has changed, and with it the sign of a pivot.
        let pivot = self.first_pivot((t_new, to), changes_sign).unwrap_or("of a linear system");
        Failure::ChangedSign { t: signed(t_new), pivot }
    }

    /// The name of the first pivot whose values at the last accepted state and at another one are as `is_such` says.
    fn first_pivot(&self, (t, y): (R, &S::State), is_such: impl Fn(R, R) -> bool) -> Option<&'static str> {
        let (mut found, mut index) = (None, 0_usize);
        self.system.pivots(self.t, &self.here().state, &mut |here| {
            let mut other = 0;
            // As there is no storage for the values, they are computed again for each.
            self.system.pivots(t, y, &mut |there| {
                if other == index && found.is_none() && is_such(here.value, there.value) {
                    found = Some(here.name);
                }
                other += 1;
            });
            index += 1;
        });
        found
    }

    /// The first pivot that is as `is_such` says somewhere on the tangent of the solution: at one of the distances
    /// `h, 2 h, 4 h, ..`.
    #[cold]
    fn pivot_ahead(
        &mut self,
        h: R,
        n_distances: u32,
        is_such: impl Fn(R, R) -> bool,
    ) -> Option<&'static str> {
        // The trial point is free.
        self.dense = Dense::Lost;
        let [one, two] = &mut self.points;
        let (here, free) = if self.current { (two, one) } else { (one, two) };
        self.system.rhs(self.t, &here.state, &mut free.slope);
        self.stats.rhs_evals += 1;
        let mut distance = h;
        for _ in 0..n_distances {
            let (here, free) =
                (&self.points[usize::from(self.current)], &self.points[usize::from(!self.current)]);
            let components = self.work.as_mut_slice().iter_mut().zip(here.state.as_slice());
            for ((out, &y), &slope) in components.zip(free.slope.as_slice()) {
                *out = slope.mul_add(distance, y);
            }
            let found = self.first_pivot((self.t + distance, &self.work), &is_such);
            if found.is_some() {
                return found;
            }
            distance += distance;
        }
        None
    }

    /// Why steps became too small: a pivot that is about to vanish where there is one.
    #[cold]
    fn too_small(&mut self, h: R, failure: Option<Error>) -> Error {
        let unnamed =
            |e: &Error| matches!(e, Error::Failure(Failure::NonFinite { .. }) | Error::NotConverged { .. });
        if let Some(named) = failure.filter(|e| !unnamed(e)) {
            return named;
        }
        // Next to a singular point steps are a small fraction of the distance to it.
        const DOUBLINGS: u32 = 20;
        let half = R::from_f64(0.5);
        let is_vanishing = |here: R, there: R| {
            let ratio = there / here;
            ratio.all_finite() && !ratio.all_gt(half)
        };
        match self.pivot_ahead(h, DOUBLINGS, is_vanishing) {
            Some(pivot) => Failure::Singular { t: signed(self.t), pivot }.into(),
            None => failure.unwrap_or(Error::StepTooSmall { t: signed(self.t), h: signed(h) }),
        }
    }

    /// Why a fixed step failed: a pivot that passes through zero on it where there is one, and the system has not said so.
    #[cold]
    fn named(&mut self, h: R, reason: Error) -> Error {
        if !matches!(reason, Error::Failure(Failure::NonFinite { .. }) | Error::NotConverged { .. }) {
            return reason;
        }
        let t = signed(self.t + h);
        // The motion runs ahead of its tangent there.
        self.pivot_ahead(h, 2, changes_sign).map_or(reason, |pivot| Failure::ChangedSign { t, pivot }.into())
    }

    fn accept(&mut self, h: R, t: R, t_residue: R) {
        self.current = !self.current;
        self.t_previous = self.t;
        self.t = t;
        self.t_residue = t_residue;
        self.h = h;
        self.dense = if M::TABLEAU.dense_stages.is_empty() { Dense::Ready } else { Dense::StagesMissing };
        self.stats.steps += 1;
    }

    /// Finds the first point of a trial step where something is not finite, and asks the system why.
    #[cold]
    fn diagnose(&mut self, h: R, t_new: R) -> Failure {
        let tableau = M::TABLEAU;
        let (from, to) = (&self.points[usize::from(self.current)], &self.points[usize::from(!self.current)]);
        let stored = M::stages(&self.storage);
        if tableau.is_series() {
            let coefficients = stored.iter().find(|coefficient| non_finite(*coefficient).is_some());
            let failure = self.point_failure(self.t, &from.state, coefficients);
            return failure
                .or_else(|| self.point_failure(t_new, &to.state, None))
                .unwrap_or(Failure::NonFinite { t: signed(t_new), index: 0 });
        }
        let k = Derivatives { n_stages: tableau.n_stages(), first: &from.slope, stored, last: &to.slope };
        for (index, (row, node)) in tableau.stages.iter().zip(tableau.nodes).enumerate() {
            stage_point(&k, row, &from.state, h, &mut self.work);
            let t = self.t + node.get::<R>() * h;
            if let Some(failure) = self.point_failure(t, &self.work, Some(k.get(index))) {
                return failure;
            }
        }
        self.point_failure(t_new, &to.state, Some(&to.slope))
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
        let distance = remaining.magnitude();
        let small = 1e-6 * distance;
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
        let order = M::TABLEAU.estimate_order().unwrap_or(M::TABLEAU.order);
        let refined = if steepest <= 1e-15 {
            small.max(guess * 1e-3)
        } else {
            crate::math::pow(0.01 / steepest, 1.0 / f64::from(order))
        };
        let step = (100.0 * guess).min(refined).min(distance);
        // Where a norm overflowed or the probe left the domain, start small and let the control decide. The
        // first step must pass the test of `changes_time`, whatever the norms say.
        let least = (100.0 * R::EPSILON * self.t.magnitude()).max(R::MIN_POSITIVE).min(distance);
        if bend_norm.is_finite() && step.is_finite() { step.max(least) } else { guess.max(least) }
    }

    /// Writes the state at a time within the last step to `work`, which is free between steps.
    fn evaluate_dense(&mut self, t: R) -> Result<(), Error> {
        let (here, other) = (usize::from(self.current), usize::from(!self.current));
        if t == self.t {
            copy(&self.points[here].state, &mut self.work);
            return Ok(());
        }
        let (from, to) = (self.t_previous, self.t);
        let inside = (t.all_ge(from) && to.all_ge(t)) || (from.all_ge(t) && t.all_ge(to));
        if !inside {
            return Err(Error::OutsideInterval { t: signed(t), from: signed(from), to: signed(to) });
        }
        match self.dense {
            Dense::Ready | Dense::StagesMissing => {}
            Dense::NoStep | Dense::Lost => return Err(Error::NoDenseOutput { t: signed(self.t) }),
        }
        if t == from {
            copy(&self.points[other].state, &mut self.work);
            return Ok(());
        }
        if self.dense == Dense::StagesMissing {
            self.complete_dense_stages()?;
        }
        let tableau = M::TABLEAU;
        let (start, end) = (&self.points[other], &self.points[here]);
        let stored = M::stages(&self.storage);
        if tableau.is_series() {
            let (out, y) = (self.work.as_mut_slice(), start.state.as_slice());
            let terms = stored.get(1..).unwrap_or_default();
            increments(terms, t - from, y.len(), |c, increment| out[c] = y[c] + increment);
            return Ok(());
        }
        let k = Derivatives { n_stages: tableau.n_stages(), first: &start.slope, stored, last: &end.slope };
        let x = (t - from) / (to - from);
        let rest = R::ONE - x;
        let out = self.work.as_mut_slice();
        out.fill(R::ZERO);
        for &(index, coefficients) in tableau.dense {
            let weight = alternating(coefficients, x, rest);
            for (out, &derivative) in out.iter_mut().zip(k.get(index).as_slice()) {
                *out += weight * derivative;
            }
        }
        let ends = start.state.as_slice().iter().zip(end.state.as_slice());
        let slopes = start.slope.as_slice().iter().zip(end.slope.as_slice());
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
        let (end, start) =
            (&self.points[usize::from(self.current)], &self.points[usize::from(!self.current)]);
        let offset = tableau.n_stages() - 1;
        for (index, (row, node)) in tableau.dense_stages.iter().zip(tableau.dense_nodes).enumerate() {
            let (stored, next) = M::stages_mut(&mut self.storage).split_at_mut(offset + index);
            let k = Derivatives { n_stages: offset + 1, first: &start.slope, stored, last: &end.slope };
            stage_point(&k, row, &start.state, self.h, &mut self.work);
            let t = self.t_previous + node.get::<R>() * self.h;
            self.system.rhs(t, &self.work, &mut next[0]);
            self.stats.rhs_evals += 1;
            let stage = &M::stages(&self.storage)[offset + index];
            if let Some(failure) = self.point_failure(t, &self.work, Some(stage)) {
                return Err(failure.into());
            }
        }
        self.dense = Dense::Ready;
        Ok(())
    }
}

impl<R: Real, S: System<R>, M: Method<R, S>> fmt::Debug for Integrator<'_, R, S, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Integrator")
            .field("method", &M::TABLEAU.name)
            .field("t", &self.t)
            .field("state", &self.state().as_slice())
            .field("options", &self.options)
            .field("stats", &self.stats)
            .finish_non_exhaustive()
    }
}

/// Times still to be sampled.
struct Samples<R, I> {
    times: I,
    next: Option<R>,
    t_end: R,
    backward: bool,
}

impl<R: Real, I: Iterator<Item = R>> Samples<R, I> {
    fn is_ahead(&self, time: R, of: R) -> bool {
        if self.backward { of.all_gt(time) } else { time.all_gt(of) }
    }

    /// Takes the next time from the iterator.
    fn draw(&mut self, now: R) -> Result<(), Error> {
        self.next = self.times.next();
        match self.next {
            Some(time) if !time.all_finite() => Err(Error::TimeNotFinite { value: signed(time) }),
            Some(time) if self.is_ahead(time, self.t_end) => {
                Err(Error::OutsideInterval { t: signed(time), from: signed(now), to: signed(self.t_end) })
            }
            _ => Ok(()),
        }
    }
}

/// Passes values of event functions on if they are finite.
fn finite_values<R: Real, const K: usize>(t: R, values: [R; K]) -> Result<[R; K], Error> {
    match values.iter().position(|value| !value.all_finite()) {
        Some(index) => Err(Error::EventNotFinite { t: signed(t), index }),
        None => Ok(values),
    }
}

/// The first of the times in the direction of integration, and its position.
fn earliest<R: Real>(times: &[Option<R>], backward: bool) -> Option<(usize, R)> {
    let times = times.iter().enumerate().filter_map(|(index, time)| time.map(|time| (index, time)));
    times.reduce(|best, next| {
        let sooner = if backward { next.1.all_gt(best.1) } else { best.1.all_gt(next.1) };
        if sooner { next } else { best }
    })
}

fn copy<R: Real, V: StateVector<R>>(from: &V, to: &mut V) {
    for (to, from) in to.as_mut_slice().iter_mut().zip(from.as_slice()) {
        *to = *from;
    }
}

/// Whether no component is infinite or NaN, without branches.
fn all_finite<R: Real, V: StateVector<R>>(v: &V) -> bool {
    v.as_slice().iter().fold(true, |finite, x| finite & x.all_finite())
}

/// Whether small powers of all components are finite, without branches.
fn all_moderate<R: Real, V: StateVector<R>>(v: &V) -> bool {
    // The fourth power of the first is finite in `f64`, that of the second in `f32`.
    let [large, single] = [1e75, 1e9].map(R::from_f64);
    let bound = if large.all_finite() { large } else { single };
    v.as_slice().iter().fold(true, |moderate, x| moderate & bound.all_ge(x.abs()))
}

/// Whether a pivot has another sign on some lane.
fn changes_sign<R: Real>(here: R, there: R) -> bool {
    let signs = (here / here.abs()) * (there / there.abs());
    signs.all_finite() && !signs.all_gt(R::ZERO)
}

/// Position of the first component that is infinite or NaN.
fn non_finite<R: Real, V: StateVector<R>>(v: &V) -> Option<usize> {
    v.as_slice().iter().position(|x| !x.all_finite())
}

/// `out = y + h sum_j row_j k_j`, for rows that are not known to the compiler.
fn stage_point<R: Real, V: StateVector<R>>(
    k: &Derivatives<'_, V>,
    row: &[(usize, Constant)],
    y: &V,
    h: R,
    out: &mut V,
) {
    let (y, out) = (y.as_slice(), out.as_mut_slice());
    k.for_each_sum(row, y.len(), |c, slope| out[c] = h.mul_add(slope, y[c]));
}

/// `d_0 + x (d_1 + rest (d_2 + x (d_3 + ...)))`.
fn alternating<R: Real>(coefficients: &[Constant], x: R, rest: R) -> R {
    let terms = coefficients.iter().enumerate().rev();
    terms.fold(R::ZERO, |sum, (index, d)| sum.mul_add(if index % 2 == 0 { x } else { rest }, d.get()))
}

/// The tolerances `atol_i + rtol_i max(|a_i|, |b_i|)`, whose reciprocals are written to `reciprocals`.
#[inline(always)]
fn tolerances<'a, R: Real, V: StateVector<R>>(
    rtol: &'a V,
    atol: &'a V,
    ends: [&'a V; 2],
    reciprocals: &'a mut V,
) -> Tolerances<'a, V> {
    let tolerances = rtol.as_slice().iter().zip(atol.as_slice());
    let states = ends[0].as_slice().iter().zip(ends[1].as_slice());
    for ((out, (&rtol, &atol)), (&a, &b)) in reciprocals.as_mut_slice().iter_mut().zip(tolerances).zip(states)
    {
        *out = rtol.mul_add(larger(a, b), atol).recip();
    }
    Tolerances { rtol, atol, ends, reciprocals }
}

/// Square of the norm of the scaled `sum_j row_j k_j`; infinite or NaN where a reciprocal is not in range.
#[inline(always)]
fn weighted_square<R: Real, V: StateVector<R>>(
    norm: Norm,
    row: &[(usize, Constant)],
    k: &Derivatives<'_, V>,
    tolerances: &Tolerances<'_, V>,
    work: &mut V,
) -> f64 {
    // The second estimate of methods that have one.
    if row.is_empty() {
        return 0.0;
    }
    let (scales, out) = (tolerances.reciprocals.as_slice(), work.as_mut_slice());
    k.for_each_sum(row, scales.len(), |c, error| out[c] = error * scales[c]);
    square_of_norm(norm, out)
}

/// The same of `h sum_j row_j k_j`, for states and times of any scale.
#[cold]
#[inline(never)]
fn square_within_range<R: Real, V: StateVector<R>>(
    norm: Norm,
    row: &[(usize, Constant)],
    k: &Derivatives<'_, V>,
    tolerances: &Tolerances<'_, V>,
    h: R,
    work: &mut V,
) -> f64 {
    let out = work.as_mut_slice();
    k.for_each_sum(row, out.len(), |c, error| out[c] = tolerances.scaled_within_range(c, h * error));
    square_of_norm(norm, out)
}

/// Norm of `component(c)` after scaling.
fn scaled_norm<R: Real, V: StateVector<R>>(
    norm: Norm,
    tolerances: &Tolerances<'_, V>,
    out: &mut [R],
    component: impl Fn(usize) -> R,
) -> f64 {
    for (c, out) in out.iter_mut().enumerate() {
        *out = tolerances.scaled(c, component(c));
    }
    crate::math::sqrt(square_of_norm(norm, out))
}
