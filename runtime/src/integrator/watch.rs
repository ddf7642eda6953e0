//! Which event functions change sign within a step, and where: what is known of them from one step to the next.
//!
//! Does not know how a step is taken or interpolated, what an event does.

use super::parts::{N_PLACES, PLACES, Verdict, judge, vertex};
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

/// So do those that are closer than so many roundings of the whole time of a motion: nobody lives to see its end.
const SHORTEST: f64 = 16.0;

/// Events that are closer than so many roundings of the times of a step are at one time.
const TOGETHER: f64 = 4.0;

/// The same where the functions of the later ones are zero up to rounding at the time of the first.
const NEARLY_TOGETHER: f64 = 4096.0;

/// Values of a function up to so many roundings of its largest one are rounding.
const NOISE: f64 = 64.0;

/// First part of a step at which a function that starts on zero shows where it goes, and how much later it is looked at
/// next.
const FIRST: f64 = 1.0 / 16_777_216.0;
const NEXT: f64 = 16.0;

/// What is known of a function at the start of a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// It has a sign.
    Apart,
    /// It is on its level: its sign right after says nothing.
    Departs,
    /// So it is after its own event.
    Restarted,
    /// It is zero, and has its event at once where it goes on in the direction of its events.
    Starts,
}

/// How a function goes on that its own event has left on zero, and that is behind zero later.
#[derive(Clone, Copy, Debug)]
enum Behind<R> {
    /// No two values tell yet.
    Unknown,
    /// At a rate: the event lets it through.
    Passes,
    /// From a rate of zero: the event has taken all of the rate, and does not hold the function.
    Rests,
    /// Not at once: it has this value before zero at a place of the part.
    Returned(R, R),
}

/// The event functions between two steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Watch<R, const K: usize> {
    directions: [Direction; K],
    /// Values at the start of the step.
    before: [R; K],
    /// Zero, or the value, zero but for rounding, that a function has after a restart by its own event, until it has
    /// left zero. A ball that starts an ulp below the ground and does not rise above it falls back to that level.
    levels: [R; K],
    phases: [Phase; K],
    /// The largest magnitudes seen.
    largest: [f64; K],
    /// Times of events in the last step that are still to be told.
    found: [Option<R>; K],
    /// To which side of zero functions have gone where they were found.
    sides: [f64; K],
    /// Which functions have an event at the time that is being told.
    due: [bool; K],
    /// Which of these were told.
    fired: [bool; K],
    /// Times of the last restart by each event.
    restarts: [Option<R>; K],
    /// Whether a function was never off zero by more than rounding between its last event and the one before: the last
    /// one may be none.
    is_blind: [bool; K],
    /// Shortest distance of times that matters beside the whole of the motion.
    shortest: f64,
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
    pub(super) fn time(self, x: R) -> R {
        if x == R::ONE { self.to } else { self.from + x * (self.to - self.from) }
    }

    /// Rounding of the times, in parts of the step.
    fn rounding(self) -> f64 {
        self.spacing() / (self.to - self.from).magnitude()
    }

    /// Rounding of the times.
    pub(super) fn spacing(self) -> f64 {
        R::EPSILON * ((self.to - self.from).magnitude() + self.from.magnitude().max(self.to.magnitude()))
    }

    /// Places in the step at which functions that start on zero are looked at.
    fn departures(self) -> impl Iterator<Item = f64> {
        core::iter::successors(Some(DEPARTURE * self.rounding()), |x| Some(x * LATER))
            .take_while(|x| *x < 1.0)
    }
}

/// A part of the last step, and the values of the event functions in it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Part<R, const K: usize> {
    pub(super) ends: Ends<R>,
    /// At [`PLACES`].
    pub(super) values: [[R; K]; N_PLACES],
    /// Whether those between the ends are on the motion.
    pub(super) is_exact: bool,
}

/// What the event functions ask for in a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Judgement {
    /// Nothing: none is zero in it.
    Clear,
    /// To be searched.
    Simple,
    /// To end before: a function, and the place at which it may have the other sign.
    Cut(usize, f64),
    /// To be divided, for the function of this position.
    Divide(usize),
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
    /// Watches from a time on, where the functions have these values. One that is zero there, and goes on in the one
    /// direction of its events, has its event, unless `is_told` says that all events of this time were told.
    pub(super) fn new(
        directions: [Direction; K],
        limit: u64,
        (t, t_end, values): (R, R, [R; K]),
        is_told: bool,
    ) -> Result<Self, Error> {
        let before = finite_values(t, values)?;
        let mut phases = [Phase::Apart; K];
        for ((phase, value), direction) in phases.iter_mut().zip(before).zip(directions) {
            if value == R::ZERO {
                let says_nothing = is_told || direction == Direction::Either;
                *phase = if says_nothing { Phase::Departs } else { Phase::Starts };
            }
        }
        Ok(Self {
            directions,
            before,
            levels: [R::ZERO; K],
            phases,
            largest: before.map(|value| value.magnitude()),
            found: [None; K],
            sides: [0.0; K],
            due: [false; K],
            fired: [false; K],
            restarts: [None; K],
            is_blind: [false; K],
            shortest: SHORTEST * R::EPSILON * (t_end - t).magnitude(),
            left: limit,
            limit,
        })
    }

    /// Values at the start of the step.
    pub(super) fn before(&self) -> [R; K] {
        self.before
    }

    /// What the values of a part say about the functions.
    pub(super) fn judge(&mut self, part: &Part<R, K>) -> Judgement {
        let mut judgement = Judgement::Clear;
        for index in 0..K {
            if part.values.iter().all(|at| at[index] == self.before[index])
                && self.phases[index] == Phase::Apart
            {
                continue;
            }
            match self.judge_one(part, index) {
                Verdict::Clear if self.phases[index] == Phase::Apart => {}
                Verdict::Clear | Verdict::Simple if judgement == Judgement::Clear => {
                    judgement = Judgement::Simple
                }
                Verdict::Clear | Verdict::Simple => {}
                Verdict::Turns(x) => judgement = Judgement::Cut(index, x),
                Verdict::Rough => return Judgement::Divide(index),
            }
        }
        judgement
    }

    /// What the values of a part say about one function.
    fn judge_one(&mut self, part: &Part<R, K>, index: usize) -> Verdict {
        let level = self.levels[index];
        let values = part.values.map(|at| signed(at[index] - level));
        if part.is_exact {
            self.largest[index] = values.iter().fold(self.largest[index], |a, b| a.max(b.abs()));
        }
        judge(values, NOISE * R::EPSILON * self.largest[index])
    }

    /// Whether the functions that are not clear in a part have the same values there at another state.
    pub(super) fn is_of_time_alone(&mut self, part: &Part<R, K>, elsewhere: &[[R; K]; N_PLACES]) -> bool {
        (0..K).all(|index| {
            let is_same = part.values.iter().zip(elsewhere).all(|(a, b)| a[index] == b[index]);
            is_same || self.judge_one(part, index) == Verdict::Clear
        })
    }

    /// Whether no function changes in a part, and none starts it on its level.
    pub(super) fn is_constant(&self, part: &Part<R, K>) -> bool {
        let is_apart = self.phases.iter().all(|phase| *phase == Phase::Apart);
        is_apart && part.values.iter().all(|values| *values == self.before)
    }

    /// Goes on from the end of a part in which nothing is found.
    pub(super) fn pass(&mut self, t: R, after: [R; K]) -> Result<(), Error> {
        let after = finite_values(t, after)?;
        for (index, value) in after.into_iter().enumerate() {
            self.pass_one(index, value);
        }
        Ok(())
    }

    fn pass_one(&mut self, index: usize, value: R) {
        self.before[index] = value;
        self.largest[index] = self.largest[index].max(value.magnitude());
        // Off zero, on the other side of it.
        if !(value * self.levels[index]).all_ge(R::ZERO) {
            self.levels[index] = R::ZERO;
        }
    }

    /// Where around a place of a part a function that turns there has the other sign, if it has.
    pub(super) fn turn(
        &self,
        part: &Part<R, K>,
        (index, place): (usize, f64),
        within: &mut impl Within<R, K>,
    ) -> Result<Option<R>, Error> {
        const TRIALS: usize = 6;
        let sign = signed(part.values[0][index]).signum();
        let after = PLACES.iter().position(|x| *x > place).unwrap_or(N_PLACES - 1);
        let k = after.clamp(2, N_PLACES - 1) - 1;
        let mut triple = [k - 1, k, k + 1].map(|j| (PLACES[j], sign * signed(part.values[j][index])));
        let mut x = place;
        for _ in 0..TRIALS {
            let t = part.ends.time(R::from_f64(x));
            let value = sign * signed(finite_values(t, within.values(t)?)?[index]);
            if value < 0.0 {
                return Ok(Some(t));
            }
            // The three lowest of four that are neighbours.
            let mut four = [triple[0], triple[1], triple[2], (x, value)];
            four.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            let is_first = four[1].1 < four[2].1;
            let next = if is_first { [four[0], four[1], four[2]] } else { [four[1], four[2], four[3]] };
            let Some((at, lowest)) = vertex(next) else { break };
            let is_new = at > next[0].0 && at < next[2].0 && next.iter().all(|(x, _)| *x != at);
            let least = next.iter().fold(f64::INFINITY, |a, (_, y)| a.min(*y));
            if !is_new || lowest > 0.5 * least {
                break;
            }
            (triple, x) = (next, at);
        }
        Ok(None)
    }

    /// Finds the changes of sign within a part of a step.
    pub(super) fn search(&mut self, part: &Part<R, K>, within: &mut impl Within<R, K>) -> Result<(), Error> {
        let ends = part.ends;
        let after = finite_values(ends.to, part.values[N_PLACES - 1])?;
        for index in 0..K {
            self.found[index] = self.find(index, part, within)?;
            self.pass_one(index, after[index]);
        }
        Ok(())
    }

    /// Finds the change of sign of one function within a part of a step.
    fn find(
        &mut self,
        index: usize,
        part: &Part<R, K>,
        within: &mut impl Within<R, K>,
    ) -> Result<Option<R>, Error> {
        let (ends, direction) = (part.ends, self.directions[index]);
        let (own, last) = (self.levels[index], part.values[N_PLACES - 1][index]);
        let (mut start, mut first, mut level) = (R::ZERO, self.before[index], own);
        let phase = self.phases[index];
        if phase == Phase::Starts {
            let Some((_, value)) = self.leaves(index, part, within)? else { return Ok(None) };
            self.phases[index] = Phase::Departs;
            if direction.may_end(value) {
                self.phases[index] = Phase::Apart;
                self.sides[index] = signed(value).signum();
                return Ok(Some(ends.from));
            }
        }
        if self.phases[index] != Phase::Apart {
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
            if start == R::ZERO {
                let is_behind = last != own && direction.may_end(last - own);
                if phase == Phase::Restarted && is_behind {
                    match self.behind(index, part, within)? {
                        Behind::Unknown => return Ok(None),
                        Behind::Passes if !self.is_blind[index] => {}
                        Behind::Passes | Behind::Rests => {
                            let t = self.restarts[index].unwrap_or(ends.from);
                            return Err(Error::EventsAccumulate { t: signed(t), index });
                        }
                        Behind::Returned(x, value) => (start, first) = (x, value),
                    }
                }
                if last == own {
                    return Ok(None);
                }
            }
            self.phases[index] = Phase::Apart;
        }
        let found = self.change(index, part, (start, first, level), within)?;
        let (Some(t), Phase::Restarted) = (found, phase) else { return Ok(found) };
        self.is_blind[index] = self.is_rounding(index, part, t);
        if !self.is_blind[index] {
            return Ok(found);
        }
        // Rounding has a sign of its own; the function may leave zero later.
        let noise = self.noise(index);
        for x in ends.departures() {
            let later = ends.time(R::from_f64(x));
            if (later - ends.from).magnitude() <= (t - ends.from).magnitude() {
                continue;
            }
            let value = finite_values(later, within.values(later)?)?[index] - own;
            if value.magnitude() > noise && direction.is_change(value, last - own) {
                self.is_blind[index] = false;
                return self.change(index, part, (R::from_f64(x), value + own, own), within);
            }
        }
        Ok(found)
    }

    /// The first change of sign of a function less a level in a part behind a place, where the function has a value.
    fn change(
        &mut self,
        index: usize,
        part: &Part<R, K>,
        (start, first, level): (R, R, R),
        within: &mut impl Within<R, K>,
    ) -> Result<Option<R>, Error> {
        let (ends, direction) = (part.ends, self.directions[index]);
        // The first two places between which the sign changes; one at which there is none is passed over.
        let (mut from, mut change) = ((start, first - level), None);
        let places = PLACES.iter().zip(&part.values).skip(1);
        for (place, values) in places.filter(|(place, _)| part.is_exact || **place == 1.0) {
            let to = (R::from_f64(*place), values[index] - level);
            if !to.0.all_gt(from.0) {
                continue;
            }
            if direction.is_change(from.1, to.1) {
                change = Some((from, to));
                break;
            }
            if to.1 != R::ZERO {
                from = to;
            }
        }
        let Some(((a, at_a), (b, at_b))) = change else { return Ok(None) };
        self.sides[index] = signed(at_b - at_a).signum();
        let ends = Ends { from: ends.time(a), to: ends.time(b) };
        let (at_a, at_b) = (signed(at_a), signed(at_b));
        let [(a, at_a), (b, at_b)] = match a == R::ZERO && b == R::ONE {
            true => within.bracket((index, level), (at_a, at_b), ends.rounding())?,
            false => [(R::ZERO, at_a), (R::ONE, at_b)],
        };
        let time = |x: R| ends.time(if x == R::ONE { b } else { a + x * (b - a) });
        let value = |x: R| {
            let t = time(x);
            finite_values(t, within.values(t)?).map(|values| signed(values[index] - level))
        };
        let x = locate(value, (at_a, at_b), ends.rounding() / (b - a).magnitude())?;
        Ok(Some(time(x)))
    }

    /// The first place at which a function that is on its level at the start of a part is off it, by more than
    /// rounding, and how far.
    fn leaves(
        &self,
        index: usize,
        part: &Part<R, K>,
        within: &mut impl Within<R, K>,
    ) -> Result<Option<(f64, R)>, Error> {
        let last = part.values[N_PLACES - 1][index];
        let (level, noise) = (self.levels[index], self.noise(index));
        let noise = noise.min(0.5 * (last - level).magnitude());
        let mut x = FIRST;
        while x < 1.0 {
            let t = part.ends.time(R::from_f64(x));
            let value = finite_values(t, within.values(t)?)?[index] - level;
            if value.magnitude() > noise {
                return Ok(Some((x, value)));
            }
            x *= NEXT;
        }
        Ok((last != level).then(|| (1.0, last - level)))
    }

    /// Values of a function up to this size are rounding.
    fn noise(&self, index: usize) -> f64 {
        NOISE * R::EPSILON * self.largest[index]
    }

    /// Whether a function that comes back to its level at a time after a restart has been off it by rounding alone.
    ///
    /// ```text
    /// b s (s - T):   at most b T^2/4 in between, and near b h^2 at the end of a part of length h
    /// ```
    fn is_rounding(&self, index: usize, part: &Part<R, K>, t: R) -> bool {
        let Some(restart) = self.restarts[index] else { return false };
        let last = part.values[N_PLACES - 1][index] - self.levels[index];
        let ratio = (t - restart).magnitude() / (part.ends.to - part.ends.from).magnitude();
        last.magnitude() * ratio * ratio <= 4.0 * self.noise(index)
    }

    /// How a function that its own event has left on zero goes on behind it.
    ///
    /// ```text
    /// a s + b s^2:   as a power of the time s since the restart, 1 where a is not zero, and 2 where it is
    /// ```
    fn behind(
        &self,
        index: usize,
        part: &Part<R, K>,
        within: &mut impl Within<R, K>,
    ) -> Result<Behind<R>, Error> {
        let (ends, level) = (part.ends, self.levels[index]);
        let noise = self.noise(index);
        let Some(restart) = self.restarts[index] else { return Ok(Behind::Passes) };
        let [from, to] = [ends.from, ends.to].map(|t| (t - restart).magnitude());
        let mut value = |s: f64| {
            let t = ends.time(R::from_f64((s - from) / (to - from)));
            finite_values(t, within.values(t)?).map(|values| signed(values[index] - level))
        };
        // The first time at which it is off its level by more than rounding.
        let start = signed(self.before[index] - level);
        let mut first = (from > 0.0 && start.abs() > noise).then_some((from, start));
        let mut x = FIRST;
        while x < 1.0 && first.is_none() {
            let s = from + x * (to - from);
            first = Some((s, value(s)?)).filter(|(_, value)| value.abs() > noise);
            x *= NEXT;
        }
        let Some((s, at_s)) = first else { return Ok(Behind::Unknown) };
        if at_s * self.sides[index] < 0.0 {
            return Ok(Behind::Returned(R::from_f64((s - from) / (to - from)), R::from_f64(at_s) + level));
        }
        let later = (NEXT * s).min(to);
        if later < 2.0 * s {
            return Ok(Behind::Unknown);
        }
        let at_later =
            if later < to { value(later)? } else { signed(part.values[N_PLACES - 1][index] - level) };
        let (growth, ratio) = (at_later / at_s, later / s);
        let square = growth * growth;
        let cube = ratio * ratio * ratio;
        let is_square = growth > 0.0 && square > cube && square < cube * ratio * ratio;
        Ok(if is_square { Behind::Rests } else { Behind::Passes })
    }

    /// The time of the first event that is still to be told.
    pub(super) fn next(&self, backward: bool) -> Option<R> {
        earliest(&self.found, backward)
    }

    /// Gathers the events of one time: those within rounding of the first, at `t` where the functions have these
    /// values. Gives the time just after all of them.
    pub(super) fn gather(&mut self, (t, values): (R, [R; K]), spacing: f64, backward: bool) -> R {
        self.fired = [false; K];
        let mut latest = t;
        for index in 0..K {
            self.due[index] = self.found[index].is_some_and(|own| {
                let (distance, value) = ((own - t).magnitude(), signed(values[index]));
                let is_near = distance <= NEARLY_TOGETHER * spacing;
                let is_zero = value.abs() <= NOISE * R::EPSILON * self.largest[index];
                let has_changed = value * self.sides[index] > 0.0;
                let is_due = distance <= TOGETHER * spacing || is_near && is_zero || has_changed;
                let is_later = if backward { latest.all_gt(own) } else { own.all_gt(latest) };
                if is_due && is_near && is_later {
                    latest = own;
                }
                is_due
            });
        }
        latest
    }

    /// Whether the function has an event at the time that is told, where it had the value `before` before any, and has
    /// the value `now` after those that are told already: one that they have moved away from zero has none.
    pub(super) fn take(&mut self, index: usize, t: R, values: Option<(R, R)>) -> Result<bool, Error> {
        if !core::mem::take(&mut self.due[index]) {
            return Ok(false);
        }
        self.found[index] = None;
        if let Some((before, now)) = values {
            let noise = NOISE * R::EPSILON * self.largest[index];
            let is_behind = signed(now) * self.sides[index] >= 0.0;
            let is_zero = now.magnitude() <= before.magnitude() + noise;
            if !(is_behind || is_zero) {
                return Ok(false);
            }
        }
        if self.left == 0 {
            return Err(Error::TooManyEvents { t: signed(t), limit: self.limit });
        }
        self.left -= 1;
        self.fired[index] = true;
        Ok(true)
    }

    /// Watches on after the events of the time `t` have changed the state, and the functions from `before` to `after`.
    ///
    /// What was found later in the step is forgotten, as the motion does not go there.
    pub(super) fn restart(&mut self, t: R, before: [R; K], after: [R; K]) -> Result<(), Error> {
        let (before, after) = (finite_values(t, before)?, finite_values(t, after)?);
        self.found = [None; K];
        for index in 0..K {
            let (was, is) = (before[index], after[index]);
            self.before[index] = is;
            if !self.fired[index] {
                let stays = is == was && is == self.levels[index] && self.phases[index] != Phase::Apart;
                if !stays {
                    self.levels[index] = R::ZERO;
                    let has_direction = self.directions[index] != Direction::Either;
                    self.phases[index] = match is == R::ZERO {
                        true if has_direction => Phase::Starts,
                        true => Phase::Departs,
                        false => Phase::Apart,
                    };
                }
                continue;
            }
            let rounding = (ACCUMULATED * R::EPSILON * t.magnitude()).max(self.shortest);
            if self.restarts[index].is_some_and(|last| (t - last).magnitude() <= rounding) {
                return Err(Error::EventsAccumulate { t: signed(t), index });
            }
            self.restarts[index] = Some(t);
            // Elsewhere the event has moved the state away from its own zero.
            let noise = NOISE * R::EPSILON * self.largest[index];
            let is_level = is.magnitude() <= was.magnitude() + noise;
            self.levels[index] = if is_level { is } else { R::ZERO };
            self.phases[index] = if is_level { Phase::Restarted } else { Phase::Apart };
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

/// The first of the times in the direction of integration.
fn earliest<R: Real>(times: &[Option<R>], backward: bool) -> Option<R> {
    times.iter().flatten().copied().reduce(|best, next| {
        let sooner = if backward { next.all_gt(best) } else { best.all_gt(next) };
        if sooner { next } else { best }
    })
}
