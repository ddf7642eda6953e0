//! Bodies that touch a plane.
//!
//! Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::{
    self, M3, V3, body_rate, constant, difference, dot, kinetic_energy, matrix, orthogonality,
    random_numbers, random_rotation, scaled, times, transposed, vector,
};
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

/// `x, R`: a place and a rotation.
fn place_and_rotation(random: &mut Random) -> Vec<f64> {
    random_numbers(3, random).into_iter().chain(random_rotation(random)).collect()
}

fn split<R: Real>(q: &[R]) -> (V3<R>, M3<R>) {
    (vector(q), matrix(&q[3..]))
}

/// From the centre of an ellipsoid to the place above which a plane touches it from below, `D gamma/|..|`, in the body.
fn to_centre<R: Real>(semi_axes: [f64; 3], gamma: V3<R>) -> V3<R> {
    let moved: V3<R> = [0, 1, 2].map(|i| R::from_f64(semi_axes[i] * semi_axes[i]) * gamma[i]);
    scaled(dot(gamma, moved).sqrt().recip(), moved)
}

/// Coordinates `x, R`; the material point at the contact does not move.
pub(crate) struct Rattleback {
    m: f64,
    g: f64,
    h: f64,
    semi_axes: [f64; 3],
    inertia: M3<f64>,
}

impl Rattleback {
    /// From the contact to the mass centre, in the body.
    fn arm<R: Real>(&self, gamma: V3<R>) -> V3<R> {
        difference(to_centre(self.semi_axes, gamma), constant([0.0, 0.0, self.h]))
    }
}

impl Unreduced for Rattleback {
    fn new(p: &Parameters) -> Self {
        let inertia = bodies::symmetric(p.symmetric("I"));
        Rattleback { m: p.get("m"), g: p.get("g"), h: p.get("h"), semi_axes: p.vector("a"), inertia }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        place_and_rotation(random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        kinetic_energy(self.m, self.inertia, vector(v), matrix(&v[3..])) - R::from_f64(self.m * self.g) * q[2]
    }

    /// The height too: the velocity of the contact vanishes, and what that integrates to is said once.
    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let (x, r) = split(q);
        let mut equations = orthogonality(r);
        equations.push(x[2] - dot(r[2], self.arm(r[2])));
        equations
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        let (_, r) = split(q);
        let (x_dot, rate) = split(v);
        difference(x_dot, times(rate, self.arm(r[2])))[..2].to_vec()
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (_, r) = split(q);
        Variables::new().vector("Omega", &body_rate(r, matrix(&v[3..]))).vector("Gamma", &r[2])
    }
}

/// Coordinates `x, R`; the height of the centre is kept by a force on the contact that leans against its velocity.
pub(crate) struct TippeTop {
    m: f64,
    g: f64,
    r: f64,
    l: f64,
    mu: f64,
    inertia: M3<f64>,
}

impl TippeTop {
    fn arm<R: Real>(&self, gamma: V3<R>) -> V3<R> {
        difference(scaled(R::from_f64(self.r), gamma), constant([0.0, 0.0, self.l]))
    }
}

impl Unreduced for TippeTop {
    fn new(p: &Parameters) -> Self {
        let inertia = bodies::diagonal([p.get("I1"), p.get("I1"), p.get("I3")]);
        TippeTop { m: p.get("m"), g: p.get("g"), r: p.get("r"), l: p.get("l"), mu: p.get("mu"), inertia }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        place_and_rotation(random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        kinetic_energy(self.m, self.inertia, vector(v), matrix(&v[3..])) - R::from_f64(self.m * self.g) * q[2]
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let (x, r) = split(q);
        let mut equations = orthogonality(r);
        equations.push(x[2] - R::from_f64(self.r) + R::from_f64(self.l) * r[2][2]);
        equations
    }

    /// The force `N (e3 - mu u)` on the material point at the contact: its work on a displacement `dx, dR`.
    fn redirect(&self, q: &[f64], v: &[f64], reactions: &mut [Vec<f64>]) {
        let (_, r) = split(q);
        let (x_dot, rate) = split(v);
        let arm = self.arm(r[2]);
        let u = difference(x_dot, times(rate, arm));
        let force = difference([0.0, 0.0, 1.0], scaled(self.mu, u));
        let work_of_turning = force.iter().flat_map(|f| arm.map(|a| -f * a));
        reactions[6] = force.into_iter().chain(work_of_turning).collect();
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (_, r) = split(q);
        let (x_dot, rate) = split(v);
        let velocity = times(transposed(r), x_dot);
        Variables::new().vector("Omega", &body_rate(r, rate)).vector("X", &velocity).vector("Gamma", &r[2])
    }

    /// The model has the weight as a force.
    fn has_energy(&self) -> bool {
        false
    }
}

/// Coordinates `x, R`; the plane is smooth.
pub(crate) struct Ellipsoid {
    m: f64,
    g: f64,
    semi_axes: [f64; 3],
    inertia: M3<f64>,
}

impl Unreduced for Ellipsoid {
    fn new(p: &Parameters) -> Self {
        let inertia = bodies::diagonal(p.vector("I"));
        Ellipsoid { m: p.get("m"), g: p.get("g"), semi_axes: p.vector("a"), inertia }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        place_and_rotation(random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        kinetic_energy(self.m, self.inertia, vector(v), matrix(&v[3..])) - R::from_f64(self.m * self.g) * q[2]
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let (x, r) = split(q);
        let mut equations = orthogonality(r);
        equations.push(x[2] - dot(r[2], to_centre(self.semi_axes, r[2])));
        equations
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (_, r) = split(q);
        Variables::new().vector("Omega", &body_rate(r, matrix(&v[3..]))).vector("Gamma", &r[2])
    }

    /// That of the uniform motion along the plane is no part of the model's.
    fn has_energy(&self) -> bool {
        false
    }
}
