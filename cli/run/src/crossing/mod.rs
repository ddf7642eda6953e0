//! Singular positions that a motion passes: where equations between coordinates depend on each other at one instant, as
//! in a parallelogram that folds flat.
//!
//! Two branches of positions cross there. The motion goes on along the one on which its positions and velocities are
//! smooth functions of the time. [`find`] locates the instant, solves for the motion on both sides of it together
//! ([`path`]), and holds the result to the equations.
//!
//! Does not know: samples, events, what stopped the motion.

mod branch;
mod legendre;
pub(crate) mod path;
#[cfg(test)]
mod tests;

use hamel_runtime::{Integrator, Method, Options};

use self::branch::Branch;
pub(crate) use self::branch::Point;
use self::legendre::Nodes;
use self::path::{Path, Solved, Span, difference, solve};
use super::dynamics::{Dynamics, PreparedScene, VecState};
use super::scale::energy_scale;

/// Nodes of the path, and of one that checks it.
const NODES: (usize, usize) = (16, 12);

/// Nodes of the polynomials that go on from the motion before a path.
const NODES_BEFORE: usize = 9;

/// Parts of the way in which a singular value is looked for that falls to zero.
const PARTS: u32 = 16;

/// A zero that moves by this part of its distance from one secant to the next is settled.
const SETTLED: f64 = 0.01;

/// So many such parts behind the time that was told, at most.
const BEYOND: f64 = 16.0;

/// The least singular value at the ends of the first path that is tried, relative to what gradients are elsewhere.
const OPENING: f64 = 0.2;

/// Steps from one state that is looked at to the next, at most: next to the position they shrink without end.
const MAX_STEPS: u64 = 500;

/// Paths that are tried, each half as long as the one before.
const MAX_PATHS: u32 = 9;

/// So near the middle, relative to half the length, the position has to be.
const CENTRED: f64 = 0.02;

/// Where a zero is not settled before the least singular value is so small, it does not fall as the distance in time.
const UNSETTLED: f64 = 1e-5;

/// A path is not made shorter whose error is this part of the tolerated one.
const PRECISE: f64 = 1e-2;

/// The largest error of a path, unless the tolerance is larger: what states have by their tolerance.
const TOLERATED: f64 = 1e-10;

/// Errors of the rates between the nodes, and of the motion by the method beside the path, in units of that.
const LOOSER: f64 = 1e3;

/// The least singular value over the distance in time is constant next to a crossing of branches, up to this factor;
/// where branches touch it vanishes there.
const STEADY: f64 = 3.0;

/// A singular value that falls to this part of what it is at the ends is one that vanishes.
const VANISHING: f64 = 0.35;

/// A passage of a singular position.
#[derive(Clone, Debug)]
pub(crate) struct Crossing {
    /// When the equations depend on each other.
    pub(crate) t: f64,
    /// How many more of them there are than independent ones.
    pub(crate) n_lost: usize,
    /// The mark that the motion before the path goes on from.
    pub(crate) mark: usize,
    /// The times of the path.
    pub(crate) ends: [f64; 2],
    /// The state at its end.
    pub(crate) end: Vec<f64>,
    pub(crate) path: Path,
}

/// Why a position is not passed; what follows "the singular position is not passed: ".
pub(crate) type Refusal = &'static str;

pub(crate) const NOT_THERE: Refusal = "the equations between coordinates keep their rank next to it";
pub(crate) const NOT_REACHED: Refusal = "the motion comes to it without speed, or not on one branch";
const NOISY: Refusal = "noise moves the motion, so that none through it is smooth";
const TOUCHING: Refusal =
    "branches touch there, or the motion turns round next to it, so that no smooth motion tells them apart";
const NOT_SMOOTH: Refusal = "the motion beside it does not go on as one that is smooth";
const NOT_KEPT: Refusal = "a smooth motion through it does not keep the energy";

/// How a motion goes on, with what it has cost.
pub(crate) struct Way<'w, 'f, M> {
    pub(crate) scene: &'w PreparedScene<'f>,
    pub(crate) method: M,
    pub(crate) options: Options<f64>,
    /// The relative tolerance, unless steps are fixed.
    pub(crate) rtol: Option<f64>,
    /// The fixed step, if there is one.
    pub(crate) step: Option<f64>,
    /// Evaluations of the rates.
    pub(crate) evaluations: u64,
    /// The greatest lengths of gradients on the way.
    pub(crate) lengths: Vec<f64>,
}

/// Looks for the singular position that a motion comes to beyond the last of the marks, about the time `told`, and
/// passes it.
///
/// # Errors
/// Why it is not passed.
pub(crate) fn find<'f, M>(
    way: &mut Way<'_, 'f, M>,
    marks: &[Point],
    told: f64,
    backward: bool,
) -> Result<Crossing, Refusal>
where
    M: Method<f64, PreparedScene<'f>>,
{
    // Within one interval of the noise's grid there is a smooth path, but the motion would leave that grid behind it.
    if !way.scene.info().noises.is_empty() {
        return Err(NOISY);
    }
    Branch::lengthen(&**way.scene, marks, &mut way.lengths);
    let approach = way.approach(marks, told).ok_or(NOT_THERE)?;
    if !approach.is_settled {
        return Err(TOUCHING);
    }
    let first = marks.first().ok_or(NOT_THERE)?.0;
    let room = 0.9 * (approach.t - first).abs();
    let longest = (OPENING / approach.rate).min(room);
    let tolerated = way.rtol.unwrap_or(0.0).max(TOLERATED);
    let mut best: Result<Attempt, Refusal> = Err(NOT_SMOOTH);
    for k in 0..MAX_PATHS {
        let half = longest / f64::from(1 << k);
        let found = way.attempt(marks, (approach.t, half), backward);
        let error = |attempt: &Result<Attempt, Refusal>| {
            attempt.as_ref().map_or(f64::INFINITY, |attempt| attempt.error)
        };
        let (new, old) = (error(&found), error(&best));
        // Of refusals, that by the order in which rank is lost says most.
        let says_more = old.is_infinite() && !matches!(best, Err(TOUCHING));
        if new < old || says_more {
            best = found;
        }
        if new <= PRECISE * tolerated || old <= tolerated && new > old {
            break;
        }
    }
    let attempt = best?;
    if attempt.error > tolerated {
        return Err(NOT_SMOOTH);
    }
    way.hold(attempt, tolerated)
}

/// What the way to a singular position tells of it.
struct Approach {
    t: f64,
    /// Of the least singular value, by the time.
    rate: f64,
    /// Whether the value falls as the distance in time.
    is_settled: bool,
}

/// A path through a singular position.
struct Attempt {
    t: f64,
    n_lost: usize,
    mark: usize,
    span: Span,
    start: Vec<f64>,
    solved: Solved,
    error: f64,
}

impl<'f, M: Method<f64, PreparedScene<'f>>> Way<'_, 'f, M> {
    /// The state at another time.
    fn go(&mut self, (t, y): (f64, &[f64]), to: f64) -> Option<Vec<f64>> {
        if t == to {
            return Some(y.to_vec());
        }
        let start = VecState(y.to_vec());
        let n_fixed = self.step.map_or(0.0, |step| (to - t).abs() / step);
        let options = self.options.with_max_steps(MAX_STEPS + n_fixed as u64);
        let mut solver = Integrator::new(self.scene, self.method, t, start, options).ok()?;
        let reached = solver.integrate_to(to);
        self.evaluations += solver.stats().rhs_evals;
        reached.ok()?;
        Some(solver.state().0.clone())
    }

    /// Where the least singular value vanishes first, about the time `told` or before.
    fn approach(&mut self, marks: &[Point], told: f64) -> Option<Approach> {
        let dynamics: &dyn Dynamics = &**self.scene;
        let last = marks.last()?;
        let branch = Branch::through(dynamics, (last.0, &last.1), &self.lengths)?;
        // Far enough from the position that the state has all its digits.
        let is_far = |(t, y): &&Point| branch.distance(*t, y) >= OPENING / 4.0;
        let mut way = vec![marks.iter().rev().find(is_far).or(marks.first())?.clone()];
        let part = (told - way[0].0) / f64::from(PARTS);
        for k in 1..=PARTS {
            let next = way[0].0 + part * f64::from(k);
            let Some((t, y)) = way.last() else { break };
            let Some(state) = self.go((*t, y), next) else { break };
            let is_close = branch.distance(next, &state) < OPENING / 20.0;
            way.push((next, state));
            if is_close {
                break;
            }
        }
        Branch::lengthen(dynamics, &way, &mut self.lengths);
        let branch = Branch::through(dynamics, (last.0, &last.1), &self.lengths)?;
        let distances: Vec<f64> = way.iter().map(|(t, y)| branch.distance(*t, y)).collect();
        for (k, point) in way.into_iter().enumerate() {
            let rises = distances.get(k + 1).is_some_and(|next| *next >= distances[k]);
            let found = if rises { None } else { self.fall(&branch, point, (part, told)) };
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// Follows the least singular value down to zero, by secants.
    fn fall(
        &mut self,
        branch: &Branch<'_>,
        (mut t, mut y): Point,
        (part, told): (f64, f64),
    ) -> Option<Approach> {
        let mut distance = branch.distance(t, &y);
        let (mut step, mut expected) = (part / 4.0, f64::NAN);
        for _ in 0..80 {
            if step.abs() <= 1e-9 * part.abs() {
                return None;
            }
            let next = t + step;
            let found = self.go((t, &y), next).map(|state| (branch.distance(next, &state), state));
            let Some((smaller, state)) = found.filter(|(smaller, _)| *smaller < distance) else {
                step /= 4.0;
                continue;
            };
            let rate = (distance - smaller) / step.abs();
            let left = smaller / rate * step.signum();
            let zero = next + left;
            (t, y, distance) = (next, state, smaller);
            // That of later ones is found from later states.
            if (next - told) / part > BEYOND {
                return None;
            }
            let is_settled = (zero - expected).abs() <= SETTLED * left.abs() && smaller < OPENING;
            if is_settled || smaller <= UNSETTLED {
                return Some(Approach { t: zero, rate, is_settled });
            }
            expected = zero;
            step = 0.5 * left.abs().min(part.abs()).copysign(left);
        }
        None
    }

    /// A path of half a length with the singular position in its middle, from where it is about.
    fn attempt(
        &mut self,
        marks: &[Point],
        (mut middle, half): (f64, f64),
        backward: bool,
    ) -> Result<Attempt, Refusal> {
        let sign = if backward { -1.0 } else { 1.0 };
        for _ in 0..6 {
            let span = Span { middle, half: sign * half };
            let before =
                |x: f64| marks.iter().rposition(|(t, _)| sign * (span.time(x) - t) >= 0.0).ok_or(NOT_REACHED);
            let mark = before(-1.0)?;
            let earliest = before(-2.0).map_or_else(|_| span.place(marks[0].0), |_| -2.0);
            let (t, y) = &marks[mark];
            let mut start = self.go((*t, y), span.time(-1.0)).ok_or(NOT_REACHED)?;
            let branch =
                Branch::through(&**self.scene, (span.time(-1.0), &start), &self.lengths).ok_or(NOT_THERE)?;
            if !branch.meet(span.time(-1.0), &mut start) {
                return Err(NOT_REACHED);
            }
            let before = self.before(marks, span, earliest).ok_or(NOT_REACHED)?;
            let solved = solve(&branch, span, &start, NODES.1, &*before).ok_or(NOT_SMOOTH)?;
            self.evaluations += solved.evaluations;
            let zero = zero_of(&branch, span, &solved)?;
            if zero.abs() > CENTRED {
                middle = span.time(zero.clamp(-1.0, 1.0));
                continue;
            }
            let (n_lost, t) = judged(&branch, span, &solved, zero)?;
            let finer = solve(&branch, span, &start, NODES.0, &|x| solved.motion.at(x)).ok_or(NOT_SMOOTH)?;
            self.evaluations += finer.evaluations;
            let places = [-0.5, 0.0, 0.5, 1.0];
            let error = places.map(|x| difference(&finer.motion.at(x), &solved.motion.at(x)));
            // Off the branch rates have a pole, so that the path has to be on it.
            let off = |(x, met): (&f64, &Vec<f64>)| difference(&finer.motion.at(*x), met);
            let off = finer.nodes.places.iter().zip(&finer.states).map(off).fold(0.0, f64::max);
            let error = error.into_iter().fold(off.max(finer.rates.tail() * half), f64::max);
            return Ok(Attempt { t, n_lost, mark, span, start, solved: finer, error });
        }
        Err(NOT_SMOOTH)
    }

    /// The motion before a span, as polynomials that go on beyond.
    fn before(&mut self, marks: &[Point], span: Span, earliest: f64) -> Option<Box<dyn Fn(f64) -> Vec<f64>>> {
        let latest = -0.3;
        let (middle, half) = ((latest + earliest) / 2.0, (latest - earliest) / 2.0);
        let nodes = Nodes::new(NODES_BEFORE);
        let first = span.time(middle + half * nodes.places[0]);
        let sign = span.half.signum();
        let mark = marks.iter().rposition(|(t, _)| sign * (first - t) >= 0.0)?;
        let (mut t, mut y) = marks[mark].clone();
        let mut rows = Vec::with_capacity(NODES_BEFORE);
        for x in &nodes.places {
            let next = span.time(middle + half * x);
            y = self.go((t, &y), next)?;
            t = next;
            rows.push(y.clone());
        }
        let series = nodes.interpolated(&rows);
        Some(Box::new(move |x| series.at((x - middle) / half)))
    }

    /// Holds a path to the equations: between its nodes, behind its end by the method of the motion, and by the energy.
    fn hold(&mut self, attempt: Attempt, tolerated: f64) -> Result<Crossing, Refusal> {
        let Attempt { t, n_lost, mark, span, start, solved, .. } = attempt;
        let dynamics: &dyn Dynamics = &**self.scene;
        let branch = Branch::through(dynamics, (span.time(-1.0), &start), &self.lengths).ok_or(NOT_THERE)?;
        let loose = LOOSER * tolerated;
        for x in [-1.0, -0.7, -0.4, 0.4, 0.7, 1.0] {
            let time = span.time(x);
            let mut state = solved.motion.at(x);
            let own = state.clone();
            let mut rates = vec![0.0; state.len()];
            if !branch.meet(time, &mut state) || difference(&state, &own) > loose {
                return Err(NOT_SMOOTH);
            }
            dynamics.rhs(time, &state, &mut rates);
            if difference(&rates, &solved.rates.at(x)) > loose {
                return Err(NOT_SMOOTH);
            }
        }
        let mut end = solved.motion.at(1.0);
        if !branch.meet(span.time(1.0), &mut end) {
            return Err(NOT_SMOOTH);
        }
        if dynamics.info().conserves_energy {
            let energy = |x: f64, y: &[f64]| dynamics.energy(span.time(x), y);
            if let (Some(before), Some(after)) = (energy(-1.0, &start), energy(1.0, &end)) {
                let scale = energy_scale(dynamics, span.time(-1.0), &start);
                let change = (after - before).abs();
                if change.is_nan() || change > loose * scale {
                    return Err(NOT_KEPT);
                }
            }
        }
        let back = self.go((span.time(1.0), &end), span.time(0.4)).ok_or(NOT_SMOOTH)?;
        if difference(&back, &solved.motion.at(0.4)) > loose {
            return Err(NOT_SMOOTH);
        }
        let path = Path::new(&**self.scene, span, solved);
        Ok(Crossing { t, n_lost, mark, ends: [span.time(-1.0), span.time(1.0)], end, path })
    }
}

/// Where the least singular value, with a sign that changes in the middle, is zero: by the polynomial through the six
/// nodes there.
fn zero_of(branch: &Branch<'_>, span: Span, solved: &Solved) -> Result<f64, Refusal> {
    let places = &solved.nodes.places;
    let after = places.partition_point(|x| *x < 0.0);
    let around = &places[after - 3..after + 3];
    let value =
        |k: usize| around[k].signum() * branch.distance(span.time(around[k]), &solved.states[after - 3 + k]);
    // Inverse interpolation: places by values.
    let values: Vec<f64> = (0..6).map(value).collect();
    let term = |k: usize| {
        let others = (0..6).filter(|j| *j != k);
        around[k] * others.map(|j| values[j] / (values[j] - values[k])).product::<f64>()
    };
    let zero: f64 = (0..6).map(term).sum();
    if zero.is_finite() { Ok(zero) } else { Err(NOT_THERE) }
}

/// How many singular values vanish at a place, and when; each has to do so as the distance in time.
fn judged(branch: &Branch<'_>, span: Span, solved: &Solved, zero: f64) -> Result<(usize, f64), Refusal> {
    let places = &solved.nodes.places;
    let values: Vec<Vec<f64>> =
        places.iter().zip(&solved.states).map(|(x, y)| branch.singular_values(span.time(*x), y)).collect();
    let after = places.partition_point(|x| *x < 0.0);
    let (first, last) = (&values[0], &values[values.len() - 1]);
    let (near_before, near_after) = (&values[after - 1], &values[after]);
    let vanishes = |k: usize| near_before[k] <= VANISHING * first[k] && near_after[k] <= VANISHING * last[k];
    let n_lost = (0..first.len()).take_while(|k| vanishes(*k)).count();
    if n_lost == 0 {
        return Err(NOT_THERE);
    }
    for k in 0..n_lost {
        let slopes = places.iter().zip(&values).map(|(x, row)| row[k] / (x - zero).abs());
        let (least, most) = slopes.fold((f64::INFINITY, 0.0_f64), |(a, b), x| (a.min(x), b.max(x)));
        if most.is_nan() || most > STEADY * least {
            return Err(TOUCHING);
        }
    }
    Ok((n_lost, span.time(zero)))
}
