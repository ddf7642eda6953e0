//! Whether equations between coordinates have lost their rank on the way of a step, where a motion may go on in more
//! than one way.
//!
//! With gradients `G(q)` the determinants of the largest minors of `G` are a vector `n`, and by Cauchy and Binet `n(a) .
//! n(b) = det G(a) G(b)^T`. Along a smooth path `n` turns as the gradients do; where they become dependent and
//! independent again it goes through zero, and its direction flips.
//!
//! Does not know: how steps are made, what is said about it.
//!
//! # Source
//! Gantmacher 1959, The theory of matrices, chapter I, section 2 (Binet and Cauchy).

use super::dynamics::{Dynamics, VecState};

/// Parts of a step in which the direction is followed where its ends say that it has turned.
const PARTS: u32 = 16;

/// A cosine of the directions at the ends of such a part, by which it has flipped and not turned.
const FLIPPED: f64 = -0.5;

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

    /// Whether the rank is lost on the way to a state, from which the next step begins.
    pub(super) fn is_lost(&mut self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> bool {
        let mut next = self.gradients.clone();
        dynamics.position_gradients(t, y, &mut next);
        let has_turned = product(&self.gradients, &next, self.n) < 0.0;
        let is_lost = has_turned && self.flips(dynamics, t, y);
        self.t = t;
        self.y.copy_from_slice(y);
        self.gradients = next;
        is_lost
    }

    /// Whether the direction flips on the cubic through both ends with their slopes.
    fn flips(&self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> bool {
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
            let sizes = product(&before, &before, self.n) * product(&here, &here, self.n);
            let flips = product(&before, &here, self.n) < FLIPPED * sizes.sqrt();
            before = here;
            flips
        })
    }
}

/// `det A B^T` of the first `n` rows.
fn product(a: &[VecState], b: &[VecState], n: usize) -> f64 {
    let dot = |x: &VecState, y: &VecState| x.0.iter().zip(&y.0).map(|(x, y)| x * y).sum::<f64>();
    let mut rows: Vec<Vec<f64>> =
        a.iter().take(n).map(|x| b.iter().take(n).map(|y| dot(x, y)).collect()).collect();
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
