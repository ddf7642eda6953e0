//! Whether equations between coordinates, or constraints that multipliers keep, have lost their rank on the way of a
//! step, where a motion may go on in more than one way.
//!
//! With gradients `G(q)`, of constraints by velocities, the determinants of the largest minors of `G` are a vector `n`,
//! and by Cauchy and Binet `n(a) . n(b) = det G(a) G(b)^T`. Along a smooth path `n` turns as the gradients do; where
//! they become dependent and independent again it goes through zero, and its direction jumps: to the opposite one, or
//! to that of another branch. A factor that all entries of a row share turns it round and loses nothing: accelerations
//! are solved for without it.
//!
//! Does not know: how steps are made, what is said about it.
//!
//! # Source
//! Gantmacher 1959, The theory of matrices, chapter I, section 2 (Binet and Cauchy).

use super::dynamics::{Dynamics, VecState};

/// Parts of a step in which the direction is followed where its ends say that it has turned.
const PARTS: u32 = 16;

/// The cosine of an angle by which the direction does not turn on such a part: more than two turns on the step.
const TURNED: f64 = 0.5;

/// The square of the distance of a gradient of length one from the span of others below which it depends on them:
/// reactions are in inverse proportion to it, and have four digits left.
const DEPENDENT: f64 = 1e-12;

/// The cosine above which rows around a zero of one are in one direction, that of all but a factor.
const PARALLEL: f64 = 0.9;

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
}

impl Rank {
    /// None where nothing can become dependent.
    pub(super) fn new(dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Option<Rank> {
        // Derivatives of equations between coordinates are among the constraints.
        let constraints = affine_constraints(dynamics, t, y);
        let of = match dynamics.positions() {
            _ if !constraints.is_empty() => Rows::Constraints(constraints),
            Some(p) if p.n_equations > 0 => Rows::Positions(p.n_equations, p.n_functions),
            _ => return None,
        };
        let rows = of.at(dynamics, t, y);
        Some(Rank { of, t, y: y.to_vec(), rows })
    }

    /// What depends on each other.
    pub(super) fn name(&self) -> &'static str {
        match self.of {
            Rows::Positions(..) => "equations between coordinates",
            Rows::Constraints(_) => "constraints",
        }
    }

    /// Goes on from another state, as after an event.
    pub(super) fn restart(&mut self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) {
        self.t = t;
        self.y.copy_from_slice(y);
        self.rows = self.of.at(dynamics, t, y);
    }

    /// Whether the rank is lost on the way to a state, or there; the next step begins from it.
    pub(super) fn is_lost(&mut self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> bool {
        let next = self.of.at(dynamics, t, y);
        let (before, after) = ((self.t, self.y.as_slice()), (t, y));
        // A row of zeros has a direction next to them where only a factor vanishes.
        let has_direction =
            |k: usize| next[k].0.iter().any(|x| *x != 0.0) || !self.has_factor(dynamics, k, [before, after]);
        let with_direction: Vec<VecState> =
            (0..next.len()).filter(|k| has_direction(*k)).map(|k| next[k].clone()).collect();
        let are_dependent = distance(&with_direction) < DEPENDENT;
        let is_lost = are_dependent || is_turned(&self.rows, &next) && self.jumps(dynamics, t, y);
        self.t = t;
        self.y.copy_from_slice(y);
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
        let step = from.iter().zip(to).fold(0.0_f64, |max, (a, b)| max.max((b - a).abs()));
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

    /// Whether the direction jumps on the cubic through both ends with their slopes.
    fn jumps(&self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> bool {
        let h = t - self.t;
        let mut slopes = [vec![0.0; y.len()], vec![0.0; y.len()]];
        let [first, last] = &mut slopes;
        dynamics.rhs(self.t, &self.y, first);
        dynamics.rhs(t, y, last);
        let mut before = (self.t, self.y.clone(), self.rows.clone());
        (1..=PARTS).any(|part| {
            let s = f64::from(part) / f64::from(PARTS);
            // Hermite's cubic.
            let weights = [
                (1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s),
                s * s * (3.0 - 2.0 * s),
                h * s * (1.0 - s) * (1.0 - s),
                h * s * s * (s - 1.0),
            ];
            let at = |k: usize| {
                let values = [self.y[k], y[k], slopes[0][k], slopes[1][k]];
                weights.iter().zip(values).map(|(weight, value)| weight * value).sum::<f64>()
            };
            let state: Vec<f64> = (0..y.len()).map(at).collect();
            let time = self.t + s * h;
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

/// Whether the direction at one state is far from that at another one.
fn is_turned(a: &[VecState], b: &[VecState]) -> bool {
    let [along, own, other] = [(a, b), (a, a), (b, b)].map(|(a, b)| product(a, b));
    along < TURNED * (own * other).sqrt()
}

fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// The square of the least distance of a row of length one from the span of those before it, the farthest one first.
fn distance(rows: &[VecState]) -> f64 {
    let mut left: Vec<Vec<f64>> = Vec::new();
    for VecState(row) in rows {
        let length = dot(row, row).sqrt();
        left.push(row.iter().map(|x| x / length).collect());
    }
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
