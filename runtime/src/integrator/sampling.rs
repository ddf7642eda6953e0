//! States at given times and at events on the way to an end.
//!
//! Does not know how a step is taken or interpolated, how events are found.

use core::ops::ControlFlow;

use super::telling::Told;
use super::watch::Watch;
use super::{Integrator, Progress};
use crate::error::Error;
use crate::events::{Action, Direction, Event, Events, Observer};
use crate::methods::Method;
use crate::options::signed;
use crate::real::Real;
use crate::system::System;

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
    /// integration stops once the other events of that time are told: time and state are those of the event, and the
    /// answer is [`Progress::Running`] unless that is the end. A function of one direction that is zero at the start,
    /// and goes on in that direction, has an event there; one of either direction has none, nor has one where the
    /// integration goes on from the end of another with events.
    ///
    /// Within a step functions are looked at along the motion in seven places, and in parts of the step where these
    /// values do not tell how they go on in between: a function that oscillates within a step is followed through all
    /// of its changes of sign, and an error says where it does so more often than can be followed. Overlooked is a
    /// function that leaves its sign for a small part of a step without having turned towards zero beside it; where
    /// one may do so, [`Options::with_max_step`](crate::Options::with_max_step) bounds the step.
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
        output: impl FnMut(R, &S::State),
        directions: [Direction; K],
        functions: impl FnMut(R, &S::State) -> [R; K],
        on_event: impl FnMut(Event<'_, R, S::State>) -> ControlFlow<()>,
    ) -> Result<Progress, Error> {
        struct Closures<O, F, E> {
            output: O,
            functions: F,
            on_event: E,
        }
        impl<R, V, O, F, E, const K: usize> Observer<R, V, K> for Closures<O, F, E>
        where
            R: Real,
            O: FnMut(R, &V),
            F: FnMut(R, &V) -> [R; K],
            E: FnMut(Event<'_, R, V>) -> ControlFlow<()>,
        {
            fn sample(&mut self, t: R, state: &V) {
                (self.output)(t, state);
            }

            fn values(&mut self, t: R, state: &V) -> [R; K] {
                (self.functions)(t, state)
            }

            fn event(&mut self, index: usize, t: R, state: &mut V) -> Action {
                let stops = (self.on_event)(Event { index, t, state }).is_break();
                if stops { Action::Stop } else { Action::Continue }
            }
        }
        self.observe(t_end, times, directions, &mut Closures { output, functions, on_event })
    }

    /// Integrates to `t_end` through the events of the system, which may change the state or end the motion, and tells
    /// them to `on_event` with the state just before they have done so; where it breaks, the integration stops there.
    ///
    /// ```
    /// use core::ops::ControlFlow;
    /// use hamel_runtime::{Action, Direction, Events, Integrator, Options, Progress, System, Vern9};
    ///
    /// /// A billiard ball between two walls, in one dimension.
    /// struct Billiard;
    ///
    /// impl System<f64> for Billiard {
    ///     type State = [f64; 2];
    ///     fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
    ///         *dy = [y[1], 0.0];
    ///     }
    /// }
    ///
    /// impl Events<f64, 2> for Billiard {
    ///     const DIRECTIONS: [Direction; 2] = [Direction::Falling, Direction::Rising];
    ///     fn event_values(&self, _t: f64, y: &[f64; 2]) -> [f64; 2] {
    ///         [y[0], y[0] - 1.0]
    ///     }
    ///     fn event_apply(&self, _index: usize, _t: f64, y: &mut [f64; 2]) -> Action {
    ///         y[1] = -y[1];
    ///         Action::Restart
    ///     }
    /// }
    ///
    /// let mut walls = [0; 2];
    /// let mut solver = Integrator::new(&Billiard, Vern9, 0.0, [0.5, 1.0], Options::adaptive(1e-12, 1e-12))?;
    /// let progress = solver.integrate_through_events(10.0, |event| {
    ///     walls[event.index] += 1;
    ///     ControlFlow::Continue(())
    /// })?;
    /// assert_eq!((progress, walls), (Progress::Reached, [5, 5]));
    /// assert!((solver.state()[0] - 0.5).abs() < 1e-12);
    /// # Ok::<(), hamel_runtime::Error>(())
    /// ```
    ///
    /// # Errors
    ///
    /// As [`observe`](Self::observe).
    pub fn integrate_through_events<const K: usize>(
        &mut self,
        t_end: R,
        on_event: impl FnMut(Event<'_, R, S::State>) -> ControlFlow<()>,
    ) -> Result<Progress, Error>
    where
        S: Events<R, K>,
    {
        struct Through<'s, S, E> {
            system: &'s S,
            on_event: E,
        }
        impl<R, S, E, const K: usize> Observer<R, S::State, K> for Through<'_, S, E>
        where
            R: Real,
            S: Events<R, K>,
            E: FnMut(Event<'_, R, S::State>) -> ControlFlow<()>,
        {
            fn values(&mut self, t: R, state: &S::State) -> [R; K] {
                self.system.event_values(t, state)
            }

            fn event(&mut self, index: usize, t: R, state: &mut S::State) -> Action {
                let stops = (self.on_event)(Event { index, t, state }).is_break();
                match self.system.event_apply(index, t, state) {
                    Action::Continue if stops => Action::Stop,
                    Action::Restart if stops => Action::ChangeAndStop,
                    action => action,
                }
            }
        }
        self.observe(t_end, [], S::DIRECTIONS, &mut Through { system: self.system, on_event })
    }

    /// Integrates to `t_end` and tells an observer the states at `times`, the ends of steps and the events, in the
    /// order of time.
    ///
    /// Events are found as [`integrate_with_events`](Self::integrate_with_events) says. Several at one time, up to
    /// rounding, are told in the order of their functions, each with the state that the one before has left, unless
    /// that one has moved its function off zero, to where it came from. All of them are told, also where one stops.
    /// Where one answers [`Action::Restart`], the motion goes on from the changed state at the time of the event: the
    /// step after it starts anew, samples at that time have the state before, and what a change of the state does to
    /// the sign of a function is no event, unless it is left at zero and goes on in the direction of its events. A
    /// function that its own event leaves at zero does not fire again until it has left zero.
    ///
    /// # Errors
    ///
    /// As [`sample`](Self::sample); [`Error::EventNotFinite`] if a function has no value; [`Error::Failure`] for a
    /// changed state outside of the domain, or without a derivative; [`Error::EventsAccumulate`] where events that
    /// change the state follow each other within the rounding of time, or where one takes the whole rate of its own
    /// function and does not hold it there; [`Error::EventsUnresolved`]; [`Error::TooManyEvents`].
    pub fn observe<const K: usize>(
        &mut self,
        t_end: R,
        times: impl IntoIterator<Item = R>,
        directions: [Direction; K],
        observer: &mut impl Observer<R, S::State, K>,
    ) -> Result<Progress, Error> {
        if !t_end.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        let backward = self.t.all_gt(t_end);
        let mut samples = Samples { times: times.into_iter(), next: None, t_end, backward };
        samples.draw(self.t)?;
        self.output_until(self.t, &mut samples, observer)?;
        let values = observer.values(self.t, self.state());
        let begin = self.t;
        let is_told = self.told_until == Some(begin);
        let mut watch = Watch::new(directions, self.options.max_events, (self.t, t_end, values), is_told)?;
        let progress = self.observe_on(t_end, (&mut watch, &mut samples), observer)?;
        // Without a step nothing was looked for.
        if const { K > 0 } && self.t != begin {
            self.told_until = Some(self.t);
        }
        Ok(progress)
    }

    /// Goes on to `t_end`, or to an event that stops.
    fn observe_on<const K: usize>(
        &mut self,
        t_end: R,
        (watch, samples): (&mut Watch<R, K>, &mut Samples<R, impl Iterator<Item = R>>),
        observer: &mut impl Observer<R, S::State, K>,
    ) -> Result<Progress, Error> {
        let (mut start, mut budget) = (self.t, self.options.max_steps);
        loop {
            let progress = self.step_within(t_end, &mut budget)?;
            let after = observer.values(self.t, self.state());
            match self.tell_step(watch, samples, observer, (start, after))? {
                Told::Nothing => {}
                Told::Stop => {
                    return Ok(if self.t == t_end { Progress::Reached } else { Progress::Running });
                }
                Told::Restart if self.t == t_end => return Ok(Progress::Reached),
                Told::Restart => {
                    start = self.t;
                    continue;
                }
            }
            self.output_until(self.t, samples, observer)?;
            if observer.step(self.t, self.state()).is_break() {
                return Ok(progress);
            }
            if progress.reached() {
                return Ok(Progress::Reached);
            }
        }
    }

    /// Tells the samples at the times up to `t`.
    pub(super) fn output_until<const K: usize>(
        &mut self,
        t: R,
        samples: &mut Samples<R, impl Iterator<Item = R>>,
        observer: &mut impl Observer<R, S::State, K>,
    ) -> Result<(), Error> {
        while let Some(time) = samples.next.filter(|&time| !samples.is_ahead(time, t)) {
            self.evaluate_dense(time)?;
            observer.sample(time, &self.work);
            samples.draw(self.t)?;
        }
        Ok(())
    }
}

/// Times still to be sampled.
pub(super) struct Samples<R, I> {
    times: I,
    next: Option<R>,
    t_end: R,
    pub(super) backward: bool,
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
