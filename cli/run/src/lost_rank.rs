//! Whether equations between coordinates, or constraints that multipliers keep, have lost their rank on the way of a
//! step, where a motion may go on in more than one way.
//!
//! With gradients `G(q)`, of constraints by velocities, the determinants of the largest minors of `G` are a vector `n`,
//! and by Cauchy and Binet `n(a) . n(b) = det G(a) G(b)^T`. Along a smooth path `n` turns as the gradients do; where
//! they become dependent and independent again it goes through zero, and its direction jumps: to the opposite one, or
//! to that of another branch. Where two directions are lost at once, `n` keeps its own: with the factors `G = S Q` of
//! positive definite `S` and orthonormal rows `Q`, `Q` turns these two round. A factor that all
//! entries of a row share turns it round and loses nothing: accelerations are solved for without it.
//!
//! Does not know: how steps are made.
//!
//! # Source
//! Gantmacher 1959, The theory of matrices, chapter I, section 2 (Binet and Cauchy), chapter IX, section 14 (`S Q`).

use std::ops::ControlFlow;

use hamel_runtime::{Action, Observer};
use nalgebra::DMatrix;

use super::dynamics::{Dynamics, VecState};
use super::simulation::stopped_because;
use crate::error::Error;

/// Parts of a step in which the direction is followed where its ends say that it has turned, at least.
const PARTS: u32 = 16;

/// So far a coordinate moves on a part that rows depend on: an angle that turns a direction round does so in many of
/// them.
const PART: f64 = 0.25;

/// Parts of a step, at most.
const MAX_PARTS: f64 = 256.0;

/// Where small steps from one end miss the other one by more than this part of the way, they are not the motion.
const MISSED: f64 = 0.1;

/// The cosine of an angle by which the direction does not turn on such a part: more than two turns on the step.
const TURNED: f64 = 0.5;

/// The square of the distance of a gradient of length one from the span of others below which it depends on them:
/// reactions are in inverse proportion to it, and have four digits left.
const DEPENDENT: f64 = 1e-12;

/// A gradient shorter than this part of the longest one on the way vanishes, unless a factor of it does: the square of
/// the distance from such a place, and with it that of the branches there, is below the residuals of equations.
const VANISHING: f64 = 1e-6;

/// So far beside a state, in parts of its size, a gradient shows whether it vanishes with a factor alone.
const BESIDE: f64 = 1e-4;

/// The cosine above which rows around a zero of one are in one direction, that of all but a factor.
const PARALLEL: f64 = 0.9;

/// A distance of a row from the span of others, in the greatest lengths of rows and relative to the greatest distance
/// on the way, below which a motion comes near to a place where they are dependent.
const NEAR: f64 = 0.05;

/// Where rows change by less than this part of the distances at both ends, directions do not turn round: a singular
/// value changes by no more than they do.
const APART: f64 = 0.5;

/// A place that was looked at in vain is one again when the distance is so much smaller.
const NEARER: f64 = 0.25;

/// So many steps like the last one before such a place, it is looked at.
const STEPS_BEFORE: f64 = 2.0;

/// What may become dependent.
#[derive(Clone, Debug)]
enum Rows {
    /// So many equations between coordinates, of so many functions.
    Positions(usize, usize),
    /// These constraints.
    Constraints(Vec<usize>),
}

impl Rows {
    fn at(&self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Vec<VecState> {
        match self {
            Rows::Positions(n, n_functions) => {
                let mut gradients = vec![VecState(vec![0.0; y.len()]); *n_functions];
                dynamics.position_gradients(t, y, &mut gradients);
                gradients.truncate(*n);
                gradients
            }
            Rows::Constraints(kept) => {
                let rows = dynamics.constraint_rows(t, y);
                kept.iter().filter_map(|k| rows.get(*k).cloned()).collect()
            }
        }
    }
}

/// The last state, with the rows there.
pub(super) struct Rank {
    of: Rows,
    t: f64,
    y: Vec<f64>,
    rows: Vec<VecState>,
    /// The greatest length of each row on the way.
    longest: Vec<f64>,
    /// Components of the state that rows depend on.
    moving: Vec<usize>,
    /// The least distance of a row from the span of others, with its time.
    nearness: Option<(f64, f64)>,
    /// The greatest such distance on the way.
    farthest: f64,
    /// The distance at a place that was looked at in vain.
    dismissed: f64,
}

impl Rank {
    /// None where nothing can become dependent.
    pub(super) fn new(dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Option<Rank> {
        // Derivatives of equations between coordinates are among the constraints.
        let constraints = affine_constraints(dynamics, t, y);
        let of = match dynamics.watched_positions() {
            _ if !constraints.is_empty() => Rows::Constraints(constraints),
            Some(p) if p.n_equations > 0 => Rows::Positions(p.n_equations, p.n_functions),
            _ => return None,
        };
        let rows = of.at(dynamics, t, y);
        let longest = rows.iter().map(|row| length(&row.0)).collect();
        // At a place of no symmetry, where nothing hides that rows depend on a component.
        let beside: Vec<f64> = y.iter().enumerate().map(|(k, y)| y + 0.1 * (k as f64 + 1.0).sqrt()).collect();
        let there = of.at(dynamics, t, &beside);
        let depend = |k: &usize| {
            let mut moved = beside.clone();
            moved[*k] += PART;
            of.at(dynamics, t, &moved) != there
        };
        let moving = (0..y.len()).filter(depend).collect();
        let (y, nearness, farthest, dismissed) = (y.to_vec(), None, 0.0, f64::INFINITY);
        Some(Rank { of, t, y, rows, longest, moving, nearness, farthest, dismissed })
    }

    /// Whether a motion of a scene may lose a rank, whatever its start is.
    pub(super) fn may_be_lost(dynamics: &dyn Dynamics, y: &[f64]) -> bool {
        !dynamics.constraint_rows(0.0, y).is_empty()
            || dynamics.watched_positions().is_some_and(|p| p.n_equations > 0)
    }

    /// That the rank is lost on the way to a state.
    pub(super) fn lost(&self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Error {
        let name = match self.of {
            Rows::Positions(..) => "equations between coordinates",
            Rows::Constraints(_) => "constraints",
        };
        let reason = format!(
            "the {name} depend on each other on the way of the last step: the motion may go on in more than one way \
             there"
        );
        stopped_because(dynamics.info(), t, y, reason)
    }

    /// Goes on from another state, as after an event.
    pub(super) fn restart(&mut self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) {
        self.t = t;
        self.y.copy_from_slice(y);
        self.rows = self.of.at(dynamics, t, y);
        self.nearness = None;
    }

    /// About when the rank is lost, where the last step has come near to such a place.
    pub(super) fn nears(&mut self) -> Option<f64> {
        let distance = least_distance(&self.rows, &self.longest);
        let (t, last) = (self.t, self.nearness.replace((self.t, distance)));
        self.farthest = self.farthest.max(distance);
        if distance > self.dismissed / NEARER {
            self.dismissed = f64::INFINITY;
        }
        let (t_last, larger) = last?;
        let is_near = distance < NEAR * self.farthest && distance < NEARER * self.dismissed;
        let left = distance * (t - t_last) / (larger - distance);
        let comes_next = distance < larger && left.abs() <= STEPS_BEFORE * (t - t_last).abs();
        (is_near && comes_next).then_some(t + left)
    }

    /// Says that the place that was come near to is none.
    pub(super) fn dismiss(&mut self) {
        self.dismissed = self.nearness.map_or(f64::INFINITY, |(_, distance)| distance);
    }

    /// Whether the rank is lost on the way to a state, or there; the next step begins from it.
    pub(super) fn is_lost(&mut self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> bool {
        let next = self.of.at(dynamics, t, y);
        let (before, after) = ((self.t, self.y.as_slice()), (t, y));
        // A row of zeros has a direction next to them where only a factor vanishes.
        let is_short = |k: usize| length(&next[k].0) <= VANISHING * self.longest[k];
        let has_factor: Vec<bool> =
            (0..next.len()).map(|k| is_short(k) && self.has_factor(dynamics, k, [before, after])).collect();
        let vanishes = (0..next.len()).any(|k| is_short(k) && !has_factor[k]);
        let has_direction = |k: usize| next[k].0.iter().any(|x| *x != 0.0) || !has_factor[k];
        let with_direction: Vec<VecState> =
            (0..next.len()).filter(|k| has_direction(*k)).map(|k| next[k].clone()).collect();
        let are_dependent = distance(&with_direction) < DEPENDENT;
        let parts = self.parts(&next, y);
        let is_lost = vanishes || are_dependent || parts > 1 && self.jumps(dynamics, (t, y), parts);
        self.t = t;
        self.y.copy_from_slice(y);
        self.longest.iter_mut().zip(&next).for_each(|(max, row)| *max = max.max(length(&row.0)));
        self.rows = next;
        is_lost
    }

    /// Whether the row `k` has one direction on both sides of a zero between two states, and beside it.
    fn has_factor(
        &self,
        dynamics: &dyn Dynamics,
        k: usize,
        [(_, from), (t, to)]: [(f64, &[f64]); 2],
    ) -> bool {
        let size = to.iter().fold(1.0_f64, |max, y| max.max(y.abs()));
        let step = from.iter().zip(to).fold(BESIDE * size, |max, (a, b)| max.max((b - a).abs()));
        let mut first: Option<Vec<f64>> = None;
        (0..to.len()).flat_map(|j| [(j, step), (j, -step)]).all(|(j, by)| {
            let mut beside = to.to_vec();
            beside[j] += by;
            let rows = self.of.at(dynamics, t, &beside);
            let row = &rows[k].0;
            let size = dot(row, row).sqrt();
            if size == 0.0 {
                return true;
            }
            let first = first.get_or_insert_with(|| row.clone());
            dot(first, row).abs() > PARALLEL * size * dot(first, first).sqrt()
        })
    }

    /// Parts of the way to a state in which the direction is followed, so that it cannot turn round and back unseen.
    fn parts(&self, next: &[VecState], y: &[f64]) -> u32 {
        let farthest = self.moving.iter().map(|k| (y[*k] - self.y[*k]).abs()).fold(0.0, f64::max);
        let parts = (farthest / PART).min(MAX_PARTS) as u32;
        if is_turned(&self.rows, next) { parts.max(PARTS) } else { parts }
    }

    /// Whether the direction jumps on the way to a state: by small steps of Runge and Kutta's method, or on the cubic
    /// through both ends with their slopes where these steps lead elsewhere.
    fn jumps(&self, dynamics: &dyn Dynamics, (t, y): (f64, &[f64]), parts: u32) -> bool {
        let mut way = small_steps(dynamics, (self.t, &self.y), t, parts);
        let distance =
            |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0_f64, |max, (a, b)| max.max((a - b).abs()));
        let is_motion = way.last().is_some_and(|end| distance(end, y) <= MISSED * distance(&self.y, y));
        if !is_motion {
            way = cubic(dynamics, (self.t, &self.y), (t, y), parts);
        }
        let mut before = (self.t, self.y.clone(), self.rows.clone());
        way.into_iter().zip(1..).any(|(state, part)| {
            let time = self.t + (t - self.t) * f64::from(part) / f64::from(parts);
            let rows = self.of.at(dynamics, time, &state);
            let jumps = is_turned(&before.2, &rows) && {
                let ends = [(before.0, before.1.as_slice()), (time, state.as_slice())];
                let aligned = rows.iter().zip(&before.2).enumerate().map(|(k, (row, old))| {
                    let is_turned_round = dot(&row.0, &old.0) < 0.0 && self.has_factor(dynamics, k, ends);
                    VecState(row.0.iter().map(|x| if is_turned_round { -x } else { *x }).collect())
                });
                is_turned(&before.2, &aligned.collect::<Vec<_>>())
            };
            before = (time, state, rows);
            jumps
        })
    }
}

/// States on the way of small steps of Runge and Kutta's method, without the first one.
fn small_steps(dynamics: &dyn Dynamics, (from, y): (f64, &[f64]), to: f64, n: u32) -> Vec<Vec<f64>> {
    let h = (to - from) / f64::from(n);
    let rate = |t: f64, y: &[f64], by: f64, k: &[f64]| {
        let moved: Vec<f64> = y.iter().zip(k).map(|(y, k)| y + by * k).collect();
        let mut rates = vec![0.0; y.len()];
        dynamics.rhs(t + by, &moved, &mut rates);
        rates
    };
    let mut y = y.to_vec();
    let mut step = |part: u32| {
        let t = from + h * f64::from(part);
        let a = rate(t, &y, 0.0, &y);
        let b = rate(t, &y, h / 2.0, &a);
        let c = rate(t, &y, h / 2.0, &b);
        let d = rate(t, &y, h, &c);
        for k in 0..y.len() {
            y[k] += h / 6.0 * (a[k] + 2.0 * (b[k] + c[k]) + d[k]);
        }
        y.clone()
    };
    (0..n).map(&mut step).collect()
}

/// States on Hermite's cubic through two of them with their slopes, without the first one.
fn cubic(
    dynamics: &dyn Dynamics,
    (from, start): (f64, &[f64]),
    (to, end): (f64, &[f64]),
    n: u32,
) -> Vec<Vec<f64>> {
    let h = to - from;
    let mut slopes = [vec![0.0; end.len()], vec![0.0; end.len()]];
    let [first, last] = &mut slopes;
    dynamics.rhs(from, start, first);
    dynamics.rhs(to, end, last);
    let at = |s: f64| {
        let weights = [
            (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s),
            s * s * (3.0 - 2.0 * s),
            h * s * (1.0 - s) * (1.0 - s),
            h * s * s * (s - 1.0),
        ];
        let value = |k: usize| {
            let values = [start[k], end[k], slopes[0][k], slopes[1][k]];
            weights.iter().zip(values).map(|(weight, value)| weight * value).sum::<f64>()
        };
        (0..end.len()).map(value).collect()
    };
    (1..=n).map(|part| at(f64::from(part) / f64::from(n))).collect()
}

/// A motion that ends where its rank is lost, for integrations that look at nothing else on the way.
pub(super) struct Held<'a, F, G> {
    dynamics: &'a dyn Dynamics,
    rank: Option<Rank>,
    /// Is told the samples.
    sample: F,
    /// Whether the motion goes on after a step.
    go_on: G,
    error: Option<Error>,
}

impl<'a, F: FnMut(f64, &VecState), G: FnMut() -> ControlFlow<()>> Held<'a, F, G> {
    /// From a state on.
    pub(super) fn new(dynamics: &'a dyn Dynamics, (t, y): (f64, &[f64]), sample: F, go_on: G) -> Self {
        Held { dynamics, rank: Rank::new(dynamics, t, y), sample, go_on, error: None }
    }

    /// Whether the rank was kept.
    ///
    /// # Errors
    /// [`Error::Stopped`] after the step on whose way it was lost.
    pub(super) fn kept(self) -> Result<(), Error> {
        self.error.map_or(Ok(()), Err)
    }
}

impl<F, G> Observer<f64, VecState, 0> for Held<'_, F, G>
where
    F: FnMut(f64, &VecState),
    G: FnMut() -> ControlFlow<()>,
{
    fn sample(&mut self, t: f64, state: &VecState) {
        (self.sample)(t, state);
    }

    fn step(&mut self, t: f64, state: &VecState) -> ControlFlow<()> {
        let Some(rank) = &mut self.rank else { return (self.go_on)() };
        if rank.is_lost(self.dynamics, t, &state.0) {
            self.error = Some(rank.lost(self.dynamics, t, &state.0));
            return ControlFlow::Break(());
        }
        (self.go_on)()
    }

    fn values(&mut self, _: f64, _: &VecState) -> [f64; 0] {
        []
    }

    fn event(&mut self, _: usize, _: f64, _: &mut VecState) -> Action {
        Action::Continue
    }
}

/// The constraints that are affine in velocities: of others a direction may turn with these.
fn affine_constraints(dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Vec<usize> {
    let rows = dynamics.constraint_rows(t, y);
    let reads = |row: &VecState| row.0.iter().any(|x| *x != 0.0);
    let mut moved = y.to_vec();
    for k in (0..y.len()).filter(|k| rows.iter().any(|row| row.0[*k] != 0.0)) {
        moved[k] = 0.7 + 1.9 * moved[k];
    }
    let other = dynamics.constraint_rows(t, &moved);
    let is_affine = |k: &usize| {
        let (a, b) = (&rows[*k].0, &other[*k].0);
        let size = a.iter().chain(b).fold(0.0_f64, |max, x| max.max(x.abs()));
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-12 * size)
    };
    (0..rows.len()).filter(|k| reads(&rows[*k])).filter(is_affine).collect()
}

/// Whether the direction at one state is far from that at another one, or two directions of rows are turned round.
fn is_turned(a: &[VecState], b: &[VecState]) -> bool {
    let [along, own, other] = [(a, b), (a, a), (b, b)].map(|(a, b)| product(a, b));
    along < TURNED * (own * other).sqrt() || turns_rows_round(a, b)
}

/// Whether `Q(a) Q(b)^T` has a negative part.
fn turns_rows_round(a: &[VecState], b: &[VecState]) -> bool {
    let n = a.len();
    if n < 2 {
        return false;
    }
    let longest: Vec<f64> = a.iter().zip(b).map(|(a, b)| length(&a.0).max(length(&b.0))).collect();
    let distances: f64 = [a, b].iter().map(|rows| least_distance(rows, &longest)).sum();
    let change = a.iter().zip(b).zip(&longest).map(|((a, b), length)| {
        let squares = a.0.iter().zip(&b.0).map(|(a, b)| ((b - a) / length).powi(2));
        squares.sum::<f64>()
    });
    if change.sum::<f64>().sqrt() < APART * distances {
        return false;
    }
    let orthonormal = |rows: &[VecState]| {
        let rows = DMatrix::from_fn(n, rows[0].0.len(), |i, j| rows[i].0[j] / longest[i]);
        let is_finite = rows.iter().all(|x| x.is_finite());
        let parts = is_finite.then(|| rows.svd(true, true))?;
        Some(parts.u? * parts.v_t?)
    };
    let (Some(a), Some(b)) = (orthonormal(a), orthonormal(b)) else { return false };
    let turn = a * b.transpose();
    let both = &turn + turn.transpose();
    both.symmetric_eigenvalues().iter().any(|x| *x < 0.0)
}

/// The least distance of a row from the span of those before it, the farthest one first, in these lengths.
fn least_distance(rows: &[VecState], lengths: &[f64]) -> f64 {
    let scaled = rows.iter().zip(lengths).map(|(row, length)| row.0.iter().map(|x| x / length).collect());
    successive(scaled.collect()).sqrt()
}

fn length(x: &[f64]) -> f64 {
    dot(x, x).sqrt()
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// The square of the least distance of a row of length one from the span of those before it, the farthest one first.
fn distance(rows: &[VecState]) -> f64 {
    let mut left: Vec<Vec<f64>> = Vec::new();
    for VecState(row) in rows {
        let own = length(row);
        left.push(row.iter().map(|x| x / own).collect());
    }
    successive(left)
}

/// The square of the least distance of a row from the span of those before it, the farthest one first, and one at most.
fn successive(mut left: Vec<Vec<f64>>) -> f64 {
    let mut least = 1.0_f64;
    while let Some(farthest) = (0..left.len()).max_by(|i, j| {
        let [a, b] = [i, j].map(|k| dot(&left[*k], &left[*k]));
        a.total_cmp(&b)
    }) {
        let row = left.swap_remove(farthest);
        let size = dot(&row, &row);
        // A row of zeros has no direction.
        least = if size.is_nan() { 0.0 } else { size.min(least) };
        if least == 0.0 {
            break;
        }
        for other in &mut left {
            let part = dot(other, &row) / size;
            other.iter_mut().zip(&row).for_each(|(x, y)| *x -= part * y);
        }
    }
    least
}

/// `det A B^T`.
fn product(a: &[VecState], b: &[VecState]) -> f64 {
    let n = a.len();
    let mut rows: Vec<Vec<f64>> = a.iter().map(|x| b.iter().map(|y| dot(&x.0, &y.0)).collect()).collect();
    let mut determinant = 1.0;
    for k in 0..n {
        let best = (k..n).max_by(|i, j| rows[*i][k].abs().total_cmp(&rows[*j][k].abs())).unwrap_or(k);
        if best != k {
            rows.swap(best, k);
            determinant = -determinant;
        }
        let pivot = rows[k].clone();
        determinant *= pivot[k];
        if pivot[k] == 0.0 {
            return 0.0;
        }
        for row in rows.iter_mut().skip(k + 1) {
            let factor = row[k] / pivot[k];
            row.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
        }
    }
    determinant
}
