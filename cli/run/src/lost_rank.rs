//! Whether equations between coordinates have lost their rank on the way of a step, where a motion may go on in more
//! than one way.
//!
//! With gradients `G(q)` the determinants of the largest minors of `G` are a vector `n`, and by Cauchy and Binet
//! `n(a) . n(b) = det G(a) G(b)^T`. Along a smooth path `n` turns as the gradients do; where they become dependent and
//! independent again it goes through zero, and its direction jumps: to the opposite one, or to that of another branch.
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

/// The last state, with the gradients there.
pub(super) struct Rank {
    n: usize,
    t: f64,
    y: Vec<f64>,
    gradients: Vec<VecState>,
}

impl Rank {
    /// None where there are no equations between coordinates.
    pub(super) fn new(dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Option<Rank> {
        let (n, n_functions) = dynamics.positions().map(|p| (p.n_equations, p.n_functions))?;
        let gradients = vec![VecState(vec![0.0; y.len()]); n_functions];
        let mut rank = Rank { n, t, y: y.to_vec(), gradients };
        dynamics.position_gradients(t, y, &mut rank.gradients);
        (n > 0).then_some(rank)
    }

    /// Goes on from another state, as after an event.
    pub(super) fn restart(&mut self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) {
        self.t = t;
        self.y.copy_from_slice(y);
        dynamics.position_gradients(t, y, &mut self.gradients);
    }

    /// Whether the rank is lost on the way to a state, or there; the next step begins from it.
    pub(super) fn is_lost(&mut self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> bool {
        let mut next = self.gradients.clone();
        dynamics.position_gradients(t, y, &mut next);
        let has_turned = self.is_turned(&self.gradients, &next);
        let are_dependent = distance(&next[..self.n]) < DEPENDENT;
        let is_lost = are_dependent || has_turned && self.jumps(dynamics, t, y);
        self.t = t;
        self.y.copy_from_slice(y);
        self.gradients = next;
        is_lost
    }

    /// Whether the direction at one state is far from that at another one.
    fn is_turned(&self, a: &[VecState], b: &[VecState]) -> bool {
        let [along, own, other] = [(a, b), (a, a), (b, b)].map(|(a, b)| product(a, b, self.n));
        along < TURNED * (own * other).sqrt()
    }

    /// Whether the direction jumps on the cubic through both ends with their slopes.
    fn jumps(&self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> bool {
        let h = t - self.t;
        let mut slopes = [vec![0.0; y.len()], vec![0.0; y.len()]];
        let [first, last] = &mut slopes;
        dynamics.rhs(self.t, &self.y, first);
        dynamics.rhs(t, y, last);
        let mut before = self.gradients.clone();
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
            let mut here = before.clone();
            dynamics.position_gradients(self.t + s * h, &state, &mut here);
            let jumps = self.is_turned(&before, &here);
            before = here;
            jumps
        })
    }
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

/// `det A B^T` of the first `n` rows.
fn product(a: &[VecState], b: &[VecState], n: usize) -> f64 {
    let mut rows: Vec<Vec<f64>> =
        a.iter().take(n).map(|x| b.iter().take(n).map(|y| dot(&x.0, &y.0)).collect()).collect();
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
