//! The events of a step: looked for part by part, told in the order of time, and carried out.
//!
//! Does not know how a step is taken or interpolated, what an event does.

use super::Integrator;
use super::dense::Dense;
use super::norms::copy;
use super::parts::{N_PLACES, PLACES};
use super::sampling::Samples;
use super::watch::{Ends, Judgement, Part, Watch, Within, finite_values};
use crate::controller::Controller;
use crate::error::Error;
use crate::events::{Action, Observer};
use crate::methods::Method;
use crate::options::signed;
use crate::real::Real;
use crate::system::{StateVector, System};

/// Most parts of one step.
const MAX_PARTS: u32 = 1 << 20;

/// Shortest part, in roundings of time: a function that is not resolved in it jumps.
const SHORTEST: f64 = 64.0;

/// How much longer than a part the next one may be.
const LONGER: f64 = 4.0;

/// What has come of the events of a step.
pub(super) enum Told {
    /// The motion goes on.
    Nothing,
    /// It goes on from a changed state.
    Restart,
    /// It stops.
    Stop,
}

/// Where functions are looked at between the ends of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Along {
    /// On the motion, which costs evaluations with some methods.
    Motion,
    /// On the cubic between the ends.
    Cubic,
    /// At the state of the end.
    Nowhere,
}

impl<R: Real, S: System<R>, M: Method<R, S>> Integrator<'_, R, S, M> {
    /// Whether the inside of a step costs evaluations.
    fn dense_costs(&self) -> bool {
        self.method.dense_by_steps() || !self.method.tableau().dense_stages.is_empty()
    }

    /// Finds and tells the events of the last step, at whose end the functions have the values `after`, up to one that
    /// stops or changes the motion since `start`.
    pub(super) fn tell_step<const K: usize>(
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
        let after = finite_values(self.t, after)?;
        let whole = Ends { from: self.t_previous, to: self.t };
        let mut along = Along::Motion;
        if self.dense_costs() {
            let part = self.look(watch, (whole, after), Along::Cubic, observer)?;
            if watch.is_constant(&part) {
                watch.pass(self.t, after)?;
                return Ok(Told::Nothing);
            }
            if self.is_cubic_close() {
                match watch.judge(&part) {
                    Judgement::Clear => {
                        watch.pass(self.t, after)?;
                        return Ok(Told::Nothing);
                    }
                    Judgement::Simple => {
                        return self.tell_part(watch, samples, observer, (start, &part, Along::Motion));
                    }
                    Judgement::Cut(..) | Judgement::Divide(_) => {
                        let elsewhere = self.look(watch, (whole, after), Along::Nowhere, observer)?;
                        if watch.is_of_time_alone(&part, &elsewhere.values) {
                            along = Along::Cubic;
                        }
                    }
                }
            }
        }
        let (mut ends, mut rough) = (whole, 0);
        for _ in 0..MAX_PARTS {
            let part = self.look(watch, (ends, after), along, observer)?;
            match watch.judge(&part) {
                Judgement::Divide(index)
                    if (ends.to - ends.from).magnitude() > SHORTEST * whole.spacing() =>
                {
                    rough = index;
                    ends.to = ends.time(R::from_f64(0.5));
                    continue;
                }
                Judgement::Cut(index, place) => {
                    let mut within =
                        LastStep { integrator: &mut *self, observer: &mut *observer, along, is_whole: false };
                    if let Some(t) = watch.turn(&part, (index, place), &mut within)? {
                        ends.to = t;
                        continue;
                    }
                }
                Judgement::Clear | Judgement::Simple | Judgement::Divide(_) => {}
            }
            let told = self.tell_part(watch, samples, observer, (start, &part, along))?;
            if !matches!(told, Told::Nothing) || ends.to == whole.to {
                return Ok(told);
            }
            let length = R::from_f64(LONGER) * (ends.to - ends.from);
            let is_last = length.magnitude() >= (whole.to - ends.to).magnitude();
            ends = Ends { from: ends.to, to: if is_last { whole.to } else { ends.to + length } };
        }
        Err(Error::EventsUnresolved { t: signed(ends.from), index: rough })
    }

    /// The values of the functions in a part of the last step, which has the values `after` at its end.
    fn look<const K: usize>(
        &mut self,
        watch: &Watch<R, K>,
        (ends, after): (Ends<R>, [R; K]),
        along: Along,
        observer: &mut impl Observer<R, S::State, K>,
    ) -> Result<Part<R, K>, Error> {
        let mut values = [watch.before(); N_PLACES];
        for (values, place) in values.iter_mut().zip(PLACES).skip(1) {
            let t = ends.time(R::from_f64(place));
            *values = if t == self.t { after } else { self.values_at(t, along, observer)? };
        }
        Ok(Part {
            ends,
            values,
            is_exact: along == Along::Motion || ends.to != self.t || ends.from != self.t_previous,
        })
    }

    fn values_at<const K: usize>(
        &mut self,
        t: R,
        along: Along,
        observer: &mut impl Observer<R, S::State, K>,
    ) -> Result<[R; K], Error> {
        match along {
            Along::Motion => self.evaluate_dense(t)?,
            Along::Cubic => self.evaluate_cubic(t),
            Along::Nowhere => copy(&self.points[usize::from(self.current)].state, &mut self.work),
        }
        Ok(observer.values(t, &self.work))
    }

    fn tell_part<const K: usize>(
        &mut self,
        watch: &mut Watch<R, K>,
        samples: &mut Samples<R, impl Iterator<Item = R>>,
        observer: &mut impl Observer<R, S::State, K>,
        (start, part, along): (R, &Part<R, K>, Along),
    ) -> Result<Told, Error> {
        let is_whole = part.ends.from == self.t_previous && part.ends.to == self.t;
        let mut within = LastStep { integrator: &mut *self, observer: &mut *observer, along, is_whole };
        if let Err(error) = watch.search(part, &mut within) {
            if let Error::EventsAccumulate { .. } = error {
                // The motion has ended at the event.
                self.evaluate_dense(part.ends.from)?;
                self.place_at(part.ends.from)?;
            }
            return Err(error);
        }
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
        let spacing = Ends { from: self.t_previous, to: self.t }.spacing();
        while let Some(first) = watch.next(samples.backward) {
            let mut before = self.values_at(first, Along::Motion, observer)?;
            let t = watch.gather((first, before), spacing, samples.backward);
            self.output_until(t, samples, observer)?;
            if t != first {
                before = self.values_at(t, Along::Motion, observer)?;
            } else {
                self.evaluate_dense(t)?;
            }
            let (mut changed, mut stops) = (None, false);
            for index in 0..K {
                if !watch.take(index, t, changed.map(|now: [R; K]| (before[index], now[index])))? {
                    continue;
                }
                let action = observer.event(index, t, &mut self.work);
                stops |= matches!(action, Action::Stop | Action::ChangeAndStop);
                if matches!(action, Action::Restart | Action::ChangeAndStop) {
                    changed = Some(observer.values(t, &self.work));
                }
            }
            match (changed, stops) {
                (None, false) => continue,
                (None, true) => self.stop_at(t)?,
                (Some(_), _) => self.restart_at(t)?,
            }
            if stops {
                return Ok(Told::Stop);
            }
            let tableau = self.method.tableau();
            self.control = Controller::new(tableau.estimate_order().unwrap_or(tableau.order));
            // The motion until now says how soon the next event may be; a step has to change the time.
            let least = 1e4 * R::EPSILON * t.magnitude();
            let longest = (t - start).magnitude().max(least);
            if longest > 0.0 {
                self.next_step = self.next_step.map(|step| step.min(longest));
            }
            watch.restart(t, before, observer.values(t, self.state()))?;
            return Ok(Told::Restart);
        }
        Ok(Told::Nothing)
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

/// The last step of an integrator, as an observer sees it.
struct LastStep<'i, I, O> {
    integrator: &'i mut I,
    observer: &'i mut O,
    along: Along,
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
        self.integrator.values_at(t, self.along, self.observer)
    }

    fn bracket(
        &mut self,
        (index, level): (usize, R),
        (before, after): (f64, f64),
        resolution: f64,
    ) -> Result<[(R, f64); 2], Error> {
        if !self.integrator.method.dense_by_steps() || !self.is_whole || self.along != Along::Motion {
            return Ok([(R::ZERO, before), (R::ONE, after)]);
        }
        let mut function = |t: R, y: &S::State| {
            finite_values(t, self.observer.values(t, y)).map(|values| signed(values[index] - level))
        };
        self.integrator.bracket_by_cubics(&mut function, (before, after), resolution)
    }
}
