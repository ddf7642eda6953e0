//! States at given times and at events on the way to an end.
//!
//! Does not know how a step is taken or interpolated.

use core::ops::ControlFlow;

use super::crossing::PROBES;
use super::dense::Dense;
use super::norms::copy;
use super::watch::{Ends, Watch, Within, finite_values};
use super::{Integrator, Progress};
use crate::controller::Controller;
use crate::error::Error;
use crate::events::{Action, Direction, Event, Events, Observer};
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
    /// Events are located as [`integrate_with_events`](Self::integrate_with_events) says. A function that changes its
    /// sign twice within a step is seen where it has the other sign at a quarter, the half or three quarters of the
    /// step. Several at one time are told
    /// in the order of their functions, each with the state that the one before has left. Where one answers
    /// [`Action::Restart`], the motion goes on from the changed state at the time of the event: the step after it
    /// starts anew, samples at that time have the state before, and what a change of the state does to the sign of a
    /// function is no event. A function that its own event leaves at zero does not fire again until it has left zero.
    ///
    /// # Errors
    ///
    /// As [`sample`](Self::sample); [`Error::EventNotFinite`] if a function has no value; [`Error::Failure`] for a
    /// changed state outside of the domain, or without a derivative; [`Error::EventsAccumulate`] where events that
    /// change the state follow each other within the rounding of time; [`Error::TooManyEvents`].
    pub fn observe<const K: usize>(
        &mut self,
        t_end: R,
        times: impl IntoIterator<Item = R>,
        directions: [Direction; K],
        observer: &mut impl Observer<R, S::State, K>,
    ) -> Result<Progress, Error> {
        let mut budget = self.options.max_steps;
        if !t_end.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        let backward = self.t.all_gt(t_end);
        let mut samples = Samples { times: times.into_iter(), next: None, t_end, backward };
        samples.draw(self.t)?;
        self.output_until(self.t, &mut samples, observer)?;
        let values = observer.values(self.t, self.state());
        let mut watch = Watch::new(directions, self.options.max_events, (self.t, values))?;
        let mut start = self.t;
        loop {
            let progress = self.step_within(t_end, &mut budget)?;
            let after = observer.values(self.t, self.state());
            match self.tell_step(&mut watch, &mut samples, observer, (start, after))? {
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
            self.output_until(self.t, &mut samples, observer)?;
            if observer.step(self.t, self.state()).is_break() {
                return Ok(progress);
            }
            if progress.reached() {
                return Ok(Progress::Reached);
            }
        }
    }

    /// Finds and tells the events of the last step, at whose end the functions have the values `after`, up to one that
    /// stops or changes the motion since `start`: part by part where functions turn within it.
    fn tell_step<const K: usize>(
        &mut self,
        watch: &mut Watch<R, K>,
        samples: &mut Samples<R, impl Iterator<Item = R>>,
        observer: &mut impl Observer<R, S::State, K>,
        (start, after): (R, [R; K]),
    ) -> Result<Told, Error> {
        // Nothing of what follows is compiled without functions.
        if const { K == 0 } {
            return Ok(Told::Nothing);
        }
        let (begin, end) = (self.t_previous, self.t);
        let turns = self.turns(watch.before(), after, |t, y| observer.values(t, y))?;
        let mut ends = Ends { from: begin, to: end };
        for part in PROBES.into_iter().filter(|_| turns) {
            ends.to = begin + R::from_f64(part) * (end - begin);
            self.evaluate_dense(ends.to)?;
            let values = observer.values(ends.to, &self.work);
            let told = self.tell_part(watch, samples, observer, (start, ends, values))?;
            if !matches!(told, Told::Nothing) {
                return Ok(told);
            }
            ends.from = ends.to;
        }
        ends.to = end;
        self.tell_part(watch, samples, observer, (start, ends, after))
    }

    fn tell_part<const K: usize>(
        &mut self,
        watch: &mut Watch<R, K>,
        samples: &mut Samples<R, impl Iterator<Item = R>>,
        observer: &mut impl Observer<R, S::State, K>,
        (start, ends, after): (R, Ends<R>, [R; K]),
    ) -> Result<Told, Error> {
        let is_whole = ends.from == self.t_previous && ends.to == self.t;
        let mut within = LastStep { integrator: &mut *self, observer: &mut *observer, is_whole };
        watch.search(ends, after, &mut within)?;
        self.tell_events(watch, samples, observer, start)
    }

    /// Tells the events found last, up to one that stops or changes the motion since `start`.
    fn tell_events<const K: usize>(
        &mut self,
        watch: &mut Watch<R, K>,
        samples: &mut Samples<R, impl Iterator<Item = R>>,
        observer: &mut impl Observer<R, S::State, K>,
        start: R,
    ) -> Result<Told, Error> {
        // The values where the first event that changes the state has found it.
        let mut changed: Option<[R; K]> = None;
        while let Some((index, t)) = watch.next(samples.backward)? {
            if changed.is_none() {
                self.output_until(t, samples, observer)?;
                self.evaluate_dense(t)?;
            }
            let before = match changed {
                Some(values) => values,
                None => observer.values(t, &self.work),
            };
            match observer.event(index, t, &mut self.work) {
                Action::Continue => {}
                Action::Restart => changed = Some(before),
                Action::Stop if changed.is_none() => {
                    self.stop_at(t)?;
                    return Ok(Told::Stop);
                }
                Action::Stop | Action::ChangeAndStop => {
                    self.restart_at(t)?;
                    return Ok(Told::Stop);
                }
            }
            let Some(before) = changed.filter(|_| !watch.has_another_at(t)) else { continue };
            self.restart_at(t)?;
            self.control = Controller::new(M::TABLEAU.estimate_order().unwrap_or(M::TABLEAU.order));
            // The motion until now says how soon the next event may be; a step has to change the time.
            let least = 1e4 * R::EPSILON * t.magnitude();
            let longest = (t - start).magnitude().max(least);
            self.next_step = self.next_step.map(|step| step.min(longest));
            watch.restart(t, before, observer.values(t, self.state()))?;
            return Ok(Told::Restart);
        }
        Ok(Told::Nothing)
    }

    /// Tells the samples at the times up to `t`.
    fn output_until<const K: usize>(
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

    /// Makes the state in `work` the last accepted one, at a time within the last step.
    fn stop_at(&mut self, t: R) -> Result<(), Error> {
        if t == self.t {
            return Ok(());
        }
        self.place_at(t)
    }

    /// The same with a state that has been changed.
    fn restart_at(&mut self, t: R) -> Result<(), Error> {
        if let Some(failure) = self.point_failure(t, &self.work, None) {
            return Err(failure.into());
        }
        self.system.domain(t, &self.work)?;
        self.place_at(t)?;
        let state = &self.points[usize::from(self.current)].state;
        self.signature = self.system.signature(t, state);
        self.method.restart(&mut self.storage, self.system, t, state);
        Ok(())
    }

    fn place_at(&mut self, t: R) -> Result<(), Error> {
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

/// What has come of the events of a step.
enum Told {
    /// The motion goes on.
    Nothing,
    /// It goes on from a changed state.
    Restart,
    /// It stops.
    Stop,
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

/// The last step of an integrator, as an observer sees it.
struct LastStep<'i, I, O> {
    integrator: &'i mut I,
    observer: &'i mut O,
    /// Whether all of it is searched.
    is_whole: bool,
}

impl<R, S, M, O, const K: usize> Within<R, K> for LastStep<'_, Integrator<'_, R, S, M>, O>
where
    R: Real,
    S: System<R>,
    M: Method<R, S>,
    O: Observer<R, S::State, K>,
{
    fn values(&mut self, t: R) -> Result<[R; K], Error> {
        self.integrator.evaluate_dense(t)?;
        Ok(self.observer.values(t, &self.integrator.work))
    }

    fn bracket(
        &mut self,
        (index, level): (usize, R),
        (before, after): (f64, f64),
        resolution: f64,
    ) -> Result<[(R, f64); 2], Error> {
        if const { !M::DENSE_BY_STEPS } || !self.is_whole {
            return Ok([(R::ZERO, before), (R::ONE, after)]);
        }
        let mut function = |t: R, y: &S::State| {
            finite_values(t, self.observer.values(t, y)).map(|values| signed(values[index] - level))
        };
        self.integrator.bracket_by_cubics(&mut function, (before, after), resolution)
    }
}
