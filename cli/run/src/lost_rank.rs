//! Whether equations between coordinates, or constraints that multipliers keep, have lost their rank on the way of a
//! step, where a motion may go on in more than one way.
//!
//! The runtime follows rows from one end of a step to the other ([`keeps_rank`]).
//!
//! Does not know: how steps are made.

use std::ops::ControlFlow;

use hamel_runtime::{Action, IndependentRows, Observer, System, keeps_rank};

use super::dynamics::{Dynamics, VecState};
use super::simulation::stopped_because;
use crate::error::Error;

/// How far a coordinate is moved to see whether rows depend on it.
const MOVED: f64 = 0.25;

/// A distance of a row from the span of others, in the greatest lengths of rows and relative to the greatest distance
/// on the way, below which a motion comes near to a place where they are dependent.
const NEAR: f64 = 0.05;

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
    y: VecState,
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
            moved[*k] += MOVED;
            of.at(dynamics, t, &moved) != there
        };
        let moving = (0..y.len()).filter(depend).collect();
        let (y, nearness, farthest, dismissed) = (VecState(y.to_vec()), None, 0.0, f64::INFINITY);
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
        self.y.0.copy_from_slice(y);
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
        let to = VecState(y.to_vec());
        let next = self.of.at(dynamics, t, y);
        let followed = Followed { dynamics, rank: self, end: (t, y, &next) };
        let is_lost = !keeps_rank(&followed, (self.t, &self.y), (t, &to));
        self.longest.iter_mut().zip(&next).for_each(|(max, row)| *max = max.max(length(&row.0)));
        (self.t, self.y, self.rows) = (t, to, next);
        is_lost
    }
}

/// A motion with its rows on the way of a step, at whose ends they are known: rows of constraints cost much.
struct Followed<'a> {
    dynamics: &'a dyn Dynamics,
    /// Where the step begins.
    rank: &'a Rank,
    /// Where it ends, with the rows there.
    end: (f64, &'a [f64], &'a [VecState]),
}

impl System<f64> for Followed<'_> {
    type State = VecState;

    fn rhs(&self, t: f64, y: &VecState, dy: &mut VecState) {
        self.dynamics.rhs(t, &y.0, &mut dy.0);
    }
}

impl IndependentRows<f64> for Followed<'_> {
    type Row = VecState;

    type Rows = Vec<VecState>;

    fn moving(&self) -> &[usize] {
        &self.rank.moving
    }

    fn rows(&self, t: f64, y: &VecState) -> Vec<VecState> {
        let (t_end, end, rows) = self.end;
        match (t, y.0.as_slice()) {
            here if here == (self.rank.t, self.rank.y.0.as_slice()) => self.rank.rows.clone(),
            there if there == (t_end, end) => rows.to_vec(),
            (t, y) => self.rank.of.at(self.dynamics, t, y),
        }
    }
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
