//! Particles.
//!
//! Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::random_numbers;
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

/// Four particles on a line: coordinates are their places.
pub(crate) struct Toda;

impl Unreduced for Toda {
    fn new(_: &Parameters) -> Self {
        Toda
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_numbers(4, random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let kinetic = v.iter().fold(R::from_f64(0.0), |sum, v| sum + R::from_f64(0.5) * *v * *v);
        q.windows(2).fold(kinetic, |l, pair| l - (pair[0] - pair[1]).exp())
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let half = R::from_f64(0.5);
        let a: Vec<R> = q.windows(2).map(|pair| half * (half * (pair[0] - pair[1])).exp()).collect();
        let b: Vec<R> = v.iter().map(|v| -half * *v).collect();
        Variables::new().vector("a", &a).vector("b", &b)
    }
}

/// A particle that turns a wheel by the area that it sweeps: coordinates `a1, a2` and the angle of the wheel.
pub(crate) struct Flywheel {
    m: f64,
    moment: f64,
    c: f64,
    k: [f64; 2],
}

impl Unreduced for Flywheel {
    fn new(p: &Parameters) -> Self {
        Flywheel { m: p.get("m"), moment: p.get("J"), c: p.get("c"), k: p.vector("k") }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_numbers(3, random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let half = R::from_f64(0.5);
        let [m, j, a, b] = [self.m, self.moment, self.k[0], self.k[1]].map(|x| half * R::from_f64(x));
        m * (v[0] * v[0] + v[1] * v[1]) + j * v[2] * v[2] - a * q[0] * q[0] - b * q[1] * q[1]
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        vec![R::from_f64(self.c) * v[2] - q[0] * v[1] + q[1] * v[0]]
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let place = Variables::new().vector("a", &q[..2]);
        place.number("a1_dot", v[0]).number("a2_dot", v[1])
    }
}
