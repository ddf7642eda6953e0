//! Families of equilibria and orbits by a parameter, an input, or a quantity: pseudo-arclength continuation.
//!
//! Steps go along the curve of solutions, so that it may turn back. Where the tangent turns the sign of its parameter
//! there is a fold; where the number of growing deviations changes, the place is found by bisection.
//!
//! Does not know: the equations, how a family is shown.
//!
//! # Source
//! Keller 1977, Numerical solution of bifurcation and nonlinear eigenvalue problems

use nalgebra::DVector;

use super::search::{Missed, Solvable, Svd};
use super::stability::Stability;

/// The part of the way along which a step is taken at most, in units of the unknowns' own sizes.
const MAX_TURN: f64 = 0.25;
/// The smallest step, in parts of the largest.
const MIN_STEP: f64 = 1e-6;
/// A curve has at most so many times the points that were asked for.
const MAX_POINTS: usize = 20;
/// Halvings that locate a change: as far as numbers go.
pub(super) const HALVINGS: usize = 45;

/// A solution on the curve.
#[derive(Clone, Debug)]
pub(super) struct OnCurve {
    /// The unknowns; the last is what the family goes along, as a part of the way.
    pub(super) x: DVector<f64>,
    pub(super) stability: Stability,
    /// Direction of the curve.
    tangent: DVector<f64>,
}

/// What happens on the way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The family turns back.
    Fold,
    /// A real eigenvalue goes through zero, a multiplier through one.
    Divergence,
    /// A pair of eigenvalues crosses the imaginary axis, or leaves it; a pair of multipliers the unit circle.
    Flutter,
    /// A multiplier goes through minus one: an orbit of twice the period begins.
    Doubling,
}

impl Change {
    /// One word for tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Change::Fold => "fold",
            Change::Divergence => "divergence",
            Change::Flutter => "flutter",
            Change::Doubling => "doubling",
        }
    }
}

/// How a family ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// At the last value.
    Reached,
    /// Back at the first value.
    Returned,
    /// Steps became too small: the equations have no value further on.
    Stuck,
    /// After too many points.
    Long,
}

impl End {
    /// One word for tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            End::Reached => "reached",
            End::Returned => "returned",
            End::Stuck => "stuck",
            End::Long => "long",
        }
    }
}

/// The curve.
pub(super) struct Curve {
    pub(super) points: Vec<OnCurve>,
    /// Changes, each behind the point of this number.
    pub(super) changes: Vec<(usize, Change, OnCurve)>,
    pub(super) end: End,
}

/// What a curve is followed with; the value of what it goes along is a part of the way, from 0 to 1.
pub(super) struct Follower<'a> {
    pub(super) equations: &'a dyn Solvable,
    /// The stability of a solution.
    pub(super) judge: &'a dyn Fn(&DVector<f64>) -> Option<Stability>,
    pub(super) first: f64,
    pub(super) last: f64,
    pub(super) n_points: usize,
    /// Halvings that locate a change.
    pub(super) n_halvings: usize,
}

impl Follower<'_> {
    /// Unknowns with the value itself in the place of the part of the way.
    pub(super) fn unscaled(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut own = x.clone();
        let k = x.len() - 1;
        own[k] = self.first + x[k] * (self.last - self.first);
        own
    }

    fn scaled(&self, x: &DVector<f64>) -> DVector<f64> {
        let mut own = x.clone();
        let k = x.len() - 1;
        own[k] = (x[k] - self.first) / (self.last - self.first);
        own
    }

    /// Solves with one more linear equation `row . (x - at) = 0` in scaled unknowns.
    fn corrected(&self, at: &DVector<f64>, row: &DVector<f64>) -> Result<DVector<f64>, Missed> {
        let k = at.len() - 1;
        // The same equation in the unknowns themselves.
        let mut own = row.clone();
        own[k] /= self.last - self.first;
        let start = self.unscaled(at);
        let value = own.dot(&start);
        self.equations.solve(&start, &[(own, value)]).map(|x| self.scaled(&x))
    }

    /// The solution with a value of what the family goes along.
    fn at_part(&self, near: &DVector<f64>, part: f64) -> Result<DVector<f64>, Missed> {
        let k = near.len() - 1;
        let mut at = near.clone();
        at[k] = part;
        let row = DVector::from_fn(near.len(), |i, _| f64::from(i == k));
        self.corrected(&at, &row).map(|mut x| {
            x[k] = part;
            x
        })
    }

    /// The direction of the curve at a solution that is nearest to another one.
    fn tangent(&self, x: &DVector<f64>, near: &DVector<f64>) -> Option<DVector<f64>> {
        let k = x.len() - 1;
        let mut jacobian = self.equations.linear(&self.unscaled(x))?.jacobian;
        jacobian.column_mut(k).scale_mut(self.last - self.first);
        let along = Svd::of_rank(&jacobian, self.equations.rank())?.null_part(near);
        (along.norm() > 1e-6).then(|| along.normalize())
    }

    fn on_curve(&self, x: DVector<f64>, near: &DVector<f64>) -> Option<OnCurve> {
        let stability = (self.judge)(&self.unscaled(&x))?;
        let tangent = self.tangent(&x, near)?;
        Some(OnCurve { x, stability, tangent })
    }

    /// Follows the curve from a solution at the first value.
    pub(super) fn follow(&self, start: &DVector<f64>) -> Option<Curve> {
        let k = start.len() - 1;
        let ahead = DVector::from_fn(start.len(), |i, _| f64::from(i == k));
        let mut here = self.on_curve(self.scaled(start), &ahead)?;
        let mut curve = Curve { points: vec![here.clone()], changes: Vec::new(), end: End::Long };
        let largest = 1.0 / (self.n_points.max(2) - 1) as f64;
        let mut step = largest;
        while curve.points.len() < MAX_POINTS * self.n_points {
            let reach = self.reach(&here, largest);
            step = step.min(reach);
            let Some(next) = self.step(&here, step) else {
                step /= 2.0;
                if step < MIN_STEP * largest {
                    curve.end = End::Stuck;
                    break;
                }
                continue;
            };
            let ended = match next.x[k] {
                part if part >= 1.0 - 1e-12 => Some((1.0, End::Reached)),
                part if part <= 0.0 => Some((0.0, End::Returned)),
                _ => None,
            };
            let next = match ended {
                Some((part, _)) => self
                    .at_part(&next.x, part)
                    .ok()
                    .and_then(|x| self.on_curve(x, &here.tangent))
                    .unwrap_or(next),
                None => next,
            };
            self.note_changes(&mut curve, &here, &next);
            curve.points.push(next.clone());
            here = next;
            step *= 1.5;
            if let Some((_, end)) = ended {
                curve.end = end;
                break;
            }
        }
        Some(curve)
    }

    /// How long a step may be: the value goes one point further, and other unknowns change by a part of their size.
    fn reach(&self, here: &OnCurve, largest: f64) -> f64 {
        let k = here.x.len() - 1;
        let others = here.tangent.rows(0, k).norm();
        let size = 1.0 + here.x.rows(0, k).norm();
        let by_value = if here.tangent[k] == 0.0 { f64::INFINITY } else { largest / here.tangent[k].abs() };
        by_value.min(if others > 0.0 { MAX_TURN * size / others } else { f64::INFINITY })
    }

    fn step(&self, here: &OnCurve, step: f64) -> Option<OnCurve> {
        let predicted = &here.x + &here.tangent * step;
        let x = self.corrected(&predicted, &here.tangent).ok()?;
        let moved = &x - &predicted;
        // Another branch, or a turn that is too sharp for the step.
        if moved.norm() > 0.5 * step {
            return None;
        }
        let next = self.on_curve(x, &here.tangent)?;
        (next.tangent.dot(&here.tangent) > 0.5).then_some(next)
    }

    /// What happens between two neighbours.
    fn note_changes(&self, curve: &mut Curve, here: &OnCurve, next: &OnCurve) {
        let (k, behind) = (here.x.len() - 1, curve.points.len() - 1);
        if here.tangent[k] * next.tangent[k] < 0.0 {
            let sign = |on: &OnCurve| on.tangent[k] * here.tangent[k] > 0.0;
            let at = self.located(here, next, &sign);
            curve.changes.push((behind, Change::Fold, at));
        }
        if here.stability.n_growing() != next.stability.n_growing() {
            let at = self.crossing(here, next);
            let change = match () {
                () if at.stability.is_doubling() => Change::Doubling,
                () if at.stability.is_divergence(&here.stability) => Change::Divergence,
                () => Change::Flutter,
            };
            curve.changes.push((behind, change, at));
        }
    }

    /// Where a real part changes its sign between two neighbours. Around the place it counts as zero: that is in the
    /// middle between where this begins and where it ends. Pairs that leave the axis have no sign on one side.
    fn crossing(&self, here: &OnCurve, next: &OnCurve) -> OnCurve {
        let k = here.stability.n_growing().min(next.stability.n_growing());
        let n_neutral = here.stability.n_neutral;
        let real_part = |on: &OnCurve| {
            let is_regular = on.stability.n_neutral == n_neutral;
            on.stability.eigenvalues.get(k).filter(|_| is_regular).map(|z| z[0])
        };
        let crosses = |on: &OnCurve| real_part(on).is_some_and(|x| x.abs() > on.stability.cut());
        if !crosses(here) || !crosses(next) {
            let same = |on: &OnCurve| on.stability.n_growing() == here.stability.n_growing();
            return self.located(here, next, &same);
        }
        let is_as = |on: &OnCurve, other: &OnCurve| {
            real_part(on).zip(real_part(other)).is_some_and(|(x, y)| x * y > 0.0)
        };
        let first = self.located(here, next, &|on| is_as(on, here));
        let last = self.located(here, next, &|on| !is_as(on, next));
        let middle = (&first.x + &last.x) * 0.5;
        let solved = self.corrected(&middle, &here.tangent).ok();
        solved.and_then(|x| self.on_curve(x, &here.tangent)).unwrap_or(last)
    }

    /// The place between two neighbours where something is true no longer.
    fn located(&self, here: &OnCurve, next: &OnCurve, is_before: &dyn Fn(&OnCurve) -> bool) -> OnCurve {
        let whole = (&next.x - &here.x).dot(&here.tangent);
        let (mut below, mut above, mut found) = (0.0, whole, next.clone());
        for _ in 0..self.n_halvings {
            let middle = 0.5 * (below + above);
            let guess = &here.x + (&next.x - &here.x) * (middle / whole);
            let solved = self.corrected(&guess, &here.tangent).ok();
            let Some(at) = solved.and_then(|x| self.on_curve(x, &here.tangent)) else { break };
            match is_before(&at) {
                true => below = middle,
                false => (above, found) = (middle, at),
            }
        }
        found
    }
}
