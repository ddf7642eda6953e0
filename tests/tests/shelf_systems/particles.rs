//! Particles.
//!
//! Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::{cross, dot, random_numbers, scaled, sum, vector};
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

/// Vortices on a sphere: coordinates are their places. They have no inertia, the Lagrangian is less the energy of the
/// flow, and each moves with the flow of the others: about a vortex `Gamma/(4 pi R) cot(gamma/2)` at the angle `gamma`
/// from it.
///
/// Source: Bogomolov 1977.
pub(crate) struct Vortices {
    radius: f64,
    circulations: Vec<f64>,
}

impl Unreduced for Vortices {
    fn new(p: &Parameters) -> Self {
        Vortices { radius: p.get("R"), circulations: p.from_index("Gamma", 1) }
    }

    /// On the sphere, where the equations between velocities keep them.
    fn place(&self, random: &mut Random) -> Vec<f64> {
        let place = |_| {
            let x: [f64; 3] = vector(&random_numbers(3, random));
            scaled(self.radius / dot(x, x).sqrt(), x)
        };
        self.circulations.iter().flat_map(place).collect()
    }

    fn lagrangian<R: Real>(&self, q: &[R], _v: &[R], _t: R) -> R {
        let mut energy = R::from_f64(0.0);
        for (i, a) in self.circulations.iter().enumerate() {
            for (j, b) in self.circulations.iter().enumerate().take(i) {
                let chord = [0, 1, 2].map(|k| q[3 * i + k] - q[3 * j + k]);
                energy -= R::from_f64(a * b / (4.0 * std::f64::consts::PI)) * dot(chord, chord).ln();
            }
        }
        -energy
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        let radius = R::from_f64(self.radius);
        let direction = |i: usize| scaled(radius.recip(), vector(&q[3 * i..]));
        let n = self.circulations.len();
        let off = |i: usize| {
            let mut off = vector(&v[3 * i..]);
            for (j, circulation) in self.circulations.iter().enumerate().filter(|(j, _)| *j != i) {
                let about = cross(direction(j), direction(i));
                let sin = dot(about, about).sqrt();
                let cot = (R::from_f64(1.0) + dot(direction(j), direction(i))) / sin;
                let speed = R::from_f64(-circulation / (4.0 * std::f64::consts::PI)) / radius * cot;
                off = sum(off, scaled(speed / sin, about));
            }
            off
        };
        (0..n).flat_map(off).collect()
    }

    fn state<R: Real>(&self, q: &[R], _v: &[R], _t: R) -> Variables<R> {
        let momenta = self.circulations.iter().enumerate().map(|(i, circulation)| {
            let scale = R::from_f64(self.radius * circulation);
            (format!("M{}", i + 1), scaled(scale, vector(&q[3 * i..])))
        });
        momenta.fold(Variables::new(), |all, (name, momentum)| all.vector(&name, &momentum))
    }
}
