//! States at given times and at events on the way to an end.
//!
//! Does not know how a step is taken or interpolated.

use core::ops::ControlFlow;

use super::dense::Dense;
use super::norms::copy;
use super::{Integrator, Progress};
use crate::error::Error;
use crate::events::{Direction, Event, locate};
use crate::methods::Method;
use crate::options::signed;
use crate::real::Real;
use crate::system::{StateVector, System};

impl<R: Real, S: System<R>, M: Method<R, S>> Integrator<'_, R, S, M> {
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
    /// change of sign; where a function is zero over a stretch of time, at its start. Where `on_event` breaks, the
    /// integration stops: time and state are those of the event, and the answer is [`Progress::Running`] unless that
    /// is the end. A function that is zero at the start has no event there. Of several changes of one function within
    /// one step, an even number is overlooked and one of an odd number is found;
    /// [`Options::with_max_step`](crate::Options::with_max_step) bounds the step.
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
        let mut function =
            |t: R, y: &S::State| finite_values(t, functions(t, y)).map(|values| signed(values[index]));
        let mut bracket = [(R::ZERO, signed(before)), (R::ONE, signed(after))];
        if const { M::DENSE_BY_STEPS } {
            bracket = self.bracket_by_cubics(&mut function, (bracket[0].1, bracket[1].1), resolution)?;
        }
        let [(a, before), (b, after)] = bracket;
        let value = |x: R| {
            let t = time(a + x * (b - a));
            self.evaluate_dense(t)?;
            function(t, &self.work)
        };
        let x = locate(value, (before, after), resolution / (b - a).magnitude())?;
        Ok(time(if x == R::ONE { b } else { a + x * (b - a) }))
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
