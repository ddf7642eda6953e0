//! Motions on groups of matrices, with the entries as coordinates.
//!
//! Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::{cross, dot, matrix, product, random_numbers, scaled, transposed};
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

/// A left-invariant metric on SO(4): coordinates are the sixteen entries, row by row.
pub(crate) struct Manakov {
    a: [f64; 4],
    b: [f64; 4],
}

impl Manakov {
    /// Momenta by angular velocities `(R^T Rdot)_ij`, `i < j`.
    fn momenta<R: Real>(&self, q: &[R], v: &[R]) -> [(R, R); 6] {
        [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)].map(|(i, j)| {
            let inertia = (self.a[i] - self.a[j]) / (self.b[i] - self.b[j]);
            let omega = (0..4).fold(R::from_f64(0.0), |sum, k| sum + q[4 * k + i] * v[4 * k + j]);
            (omega, R::from_f64(inertia) * omega)
        })
    }
}

impl Unreduced for Manakov {
    fn new(p: &Parameters) -> Self {
        Manakov { a: p.vector("a"), b: p.vector("b") }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        let near = |(k, x): (usize, f64)| 0.5 * x + f64::from(u8::from(k % 5 == 0));
        random_numbers(16, random).into_iter().enumerate().map(near).collect()
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let half = R::from_f64(0.5);
        self.momenta(q, v).iter().fold(R::from_f64(0.0), |l, (omega, m)| l + half * *omega * *m)
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let mut equations = Vec::new();
        for i in 0..4 {
            for j in i..4 {
                let product = (0..4).fold(R::from_f64(0.0), |sum, k| sum + q[4 * k + i] * q[4 * k + j]);
                equations.push(product - R::from_f64(f64::from(u8::from(i == j))));
            }
        }
        equations
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        Variables::new().vector("M", &self.momenta(q, v).map(|(_, m)| m))
    }
}

/// A body that deforms alike everywhere: coordinates are the nine entries of `F`, row by row.
pub(crate) struct PseudoRigid {
    second_moments: [f64; 3],
    mu: f64,
    lambda: f64,
}

impl Unreduced for PseudoRigid {
    fn new(p: &Parameters) -> Self {
        PseudoRigid { second_moments: p.vector("E"), mu: p.get("mu"), lambda: p.get("lambda") }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        let near = |(k, x): (usize, f64)| 0.3 * x + f64::from(u8::from(k % 4 == 0));
        random_numbers(9, random).into_iter().enumerate().map(near).collect()
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let f = matrix(q);
        let (mu, lambda) = (R::from_f64(0.5 * self.mu), R::from_f64(0.5 * self.lambda));
        let stretch = q.iter().fold(R::from_f64(-3.0), |sum, x| sum + *x * *x);
        let ln = dot(f[0], cross(f[1], f[2])).ln();
        let moved = v.iter().enumerate().fold(R::from_f64(0.0), |sum, (k, v)| {
            sum + R::from_f64(0.5 * self.second_moments[k % 3]) * *v * *v
        });
        moved - mu * stretch + R::from_f64(self.mu) * ln - lambda * ln * ln
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let f = matrix(q);
        let det = dot(f[0], cross(f[1], f[2]));
        let columns = [cross(f[1], f[2]), cross(f[2], f[0]), cross(f[0], f[1])];
        let inverse = transposed(columns.map(|column| scaled(det.recip(), column)));
        let xi = product(inverse, matrix(v));
        let c = product(transposed(f), f);
        let upper = [c[0][0], c[0][1], c[0][2], c[1][1], c[1][2], c[2][2]];
        Variables::new().vector("xi", xi.as_flattened()).vector("c", &upper)
    }
}

/// A left-invariant metric and constraint on the matrices `[[exp z, 0, x], [0, exp(z/2), y], [0, 0, 1]]`: coordinates
/// `x, y, z`.
pub(crate) struct SuslovOnBianchi {
    metric: [f64; 6],
    normal: [f64; 3],
}

/// `g^-1 gdot`.
fn left<R: Real>(q: &[R], v: &[R]) -> [R; 3] {
    let half = R::from_f64(0.5);
    [(-q[2]).exp() * v[0], (-half * q[2]).exp() * v[1], v[2]]
}

impl Unreduced for SuslovOnBianchi {
    fn new(p: &Parameters) -> Self {
        SuslovOnBianchi { metric: p.symmetric("G"), normal: p.vector("n") }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_numbers(3, random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let w = left(q, v);
        let [a, b, c, d, e, f] = self.metric.map(R::from_f64);
        let half = R::from_f64(0.5);
        half * (a * w[0] * w[0] + d * w[1] * w[1] + f * w[2] * w[2])
            + b * w[0] * w[1]
            + c * w[0] * w[2]
            + e * w[1] * w[2]
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        vec![dot(self.normal.map(R::from_f64), left(q, v))]
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let w = left(q, v);
        Variables::new().number("w1", w[0]).number("w3", w[2])
    }
}
