//! Which event functions change sign within a step, and where: what is known of them from one step to the next.
//!
//! Does not know how a step is taken or interpolated, what an event does.

use crate::error::Error;
use crate::events::{Direction, locate};
use crate::options::signed;
use crate::real::Real;

/// Roundings of time after a restart from which on the functions that have just changed sign are watched.
///
/// They are zero up to rounding there, and their sign right after says nothing.
const DEPARTURE: f64 = 4.0;

/// How much later a departing function is looked at next.
const LATER: f64 = 8.0;

/// Restarts by one event that are closer than so many roundings of time accumulate. Each of them has to be seen before,
/// so that it is many times [`DEPARTURE`]: a flight may be a few hundredths of the one before.
const ACCUMULATED: f64 = 4096.0;

/// The event functions between two steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watch<R, const K: usize> {
    directions: [Direction; K],
    /// Values at the start of the step.
    before: [R; K],
    /// Zero, or the value, zero but for rounding, that a function has after a restart by its own event, until it has
    /// left zero. A ball that starts an ulp below the ground and does not rise above it falls back to that level.
    levels: [R; K],
    /// Which functions start the step on their level.
    departs: [bool; K],
    /// Times of events in the last step that are still to be told.
    found: [Option<R>; K],
    /// Which functions have an event at the time of the last event that was told.
    fired: [bool; K],
    last: Option<R>,
    /// Times of the last restart by each event.
    restarts: [Option<R>; K],
    left: u64,
    limit: u64,
}

/// The last step, or a part of it: its ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ends<R> {
    pub(super) from: R,
    pub(super) to: R,
}

impl<R: Real> Ends<R> {
    fn time(self, x: R) -> R {
        if x == R::ONE { self.to } else { self.from + x * (self.to - self.from) }
    }

    /// Rounding of the times, in parts of the step.
    fn rounding(self) -> f64 {
        let largest = self.from.magnitude().max(self.to.magnitude());
        R::EPSILON * (1.0 + largest / (self.to - self.from).magnitude())
    }

    /// Places in the step at which functions that start on zero are looked at.
    fn departures(self) -> impl Iterator<Item = f64> {
        core::iter::successors(Some(DEPARTURE * self.rounding()), |x| Some(x * LATER))
            .take_while(|x| *x < 1.0)
    }
}

/// The event functions within the last step.
pub(super) trait Within<R, const K: usize> {
    /// Their values at a time.
    fn values(&mut self, t: R) -> Result<[R; K], Error>;

    /// A part of that, with the values of a function less a level at its ends, in which the function changes its
    /// sign; at the ends of the whole it has these values.
    fn bracket(
        &mut self,
        of: (usize, R),
        values: (f64, f64),
        resolution: f64,
    ) -> Result<[(R, f64); 2], Error>;
}

impl<R: Real, const K: usize> Watch<R, K> {
    /// Watches from a time on, where the functions have these values; one that is zero there has no event.
    pub(super) fn new(
        directions: [Direction; K],
        limit: u64,
        (t, values): (R, [R; K]),
    ) -> Result<Self, Error> {
        let before = finite_values(t, values)?;
        Ok(Self {
            directions,
            before,
            levels: [R::ZERO; K],
            departs: before.map(|value| value == R::ZERO),
            found: [None; K],
            fired: [false; K],
            last: None,
            restarts: [None; K],
            left: limit,
            limit,
        })
    }

    /// Values at the start of the step.
    pub(super) fn before(&self) -> [R; K] {
        self.before
    }

    /// Finds the changes of sign within a step, or a part of one, at whose end the functions have the values `after`.
    pub(super) fn search(
        &mut self,
        ends: Ends<R>,
        after: [R; K],
        within: &mut impl Within<R, K>,
    ) -> Result<(), Error> {
        let after = finite_values(ends.to, after)?;
        self.last = None;
        for index in 0..K {
            let (direction, last) = (self.directions[index], after[index]);
            let own = self.levels[index];
            let (mut start, mut first, mut level) = (R::ZERO, self.before[index], own);
            if core::mem::take(&mut self.departs[index]) {
                // It may have come back to zero within the step: where has it been in between? Back to its own level
                // only, if it has never been on the other side of zero.
                for x in ends.departures().filter(|_| direction.may_end(last - own)) {
                    let t = ends.time(R::from_f64(x));
                    let value = finite_values(t, within.values(t)?)?[index];
                    if direction.is_change(value - own, last - own) {
                        (start, first) = (R::from_f64(x), value);
                        level = if direction.is_change(value, last) { R::ZERO } else { own };
                        if level == R::ZERO {
                            break;
                        }
                    }
                }
            }
            if direction.is_change(first - level, last - level) {
                let (at_start, at_end) = (signed(first - level), signed(last - level));
                let [(a, at_a), (b, at_b)] = match start == R::ZERO {
                    true => within.bracket((index, level), (at_start, at_end), ends.rounding())?,
                    false => [(start, at_start), (R::ONE, at_end)],
                };
                let time = |x: R| ends.time(if x == R::ONE { b } else { a + x * (b - a) });
                let value = |x: R| {
                    let t = time(x);
                    finite_values(t, within.values(t)?).map(|values| signed(values[index] - level))
                };
                let x = locate(value, (at_a, at_b), ends.rounding() / (b - a).magnitude())?;
                self.found[index] = Some(time(x));
            }
            self.before[index] = last;
            // Off zero, on the other side of it.
            if !(last * own).all_ge(R::ZERO) {
                self.levels[index] = R::ZERO;
            }
        }
        Ok(())
    }

    /// The next event of the last step: position of its function, and its time.
    pub(super) fn next(&mut self, backward: bool) -> Result<Option<(usize, R)>, Error> {
        let Some((index, t)) = earliest(&self.found, backward) else { return Ok(None) };
        if self.left == 0 {
            return Err(Error::TooManyEvents { t: signed(t), limit: self.limit });
        }
        self.left -= 1;
        self.found[index] = None;
        if self.last != Some(t) {
            self.fired = [false; K];
        }
        self.last = Some(t);
        self.fired[index] = true;
        Ok(Some((index, t)))
    }

    /// Whether another event has the time of the last one that was told.
    pub(super) fn has_another_at(&self, t: R) -> bool {
        self.found.contains(&Some(t))
    }

    /// Watches on after the events of the time `t` have changed the state, and the functions from `before` to `after`.
    ///
    /// What was found later in the step is forgotten, as the motion does not go there.
    pub(super) fn restart(&mut self, t: R, before: [R; K], after: [R; K]) -> Result<(), Error> {
        let (before, after) = (finite_values(t, before)?, finite_values(t, after)?);
        self.found = [None; K];
        for index in 0..K {
            (self.levels[index], self.before[index]) = (R::ZERO, after[index]);
            if !self.fired[index] {
                continue;
            }
            let rounding = ACCUMULATED * R::EPSILON * t.magnitude();
            if self.restarts[index].is_some_and(|last| (t - last).magnitude() <= rounding) {
                return Err(Error::EventsAccumulate { t: signed(t), index });
            }
            self.restarts[index] = Some(t);
            // Elsewhere the event has moved the state away from its own zero.
            if before[index].abs().all_ge(after[index].abs()) {
                self.levels[index] = after[index];
                self.departs[index] = true;
            }
        }
        Ok(())
    }
}

/// Passes values of event functions on if they are finite.
pub(super) fn finite_values<R: Real, const K: usize>(t: R, values: [R; K]) -> Result<[R; K], Error> {
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
