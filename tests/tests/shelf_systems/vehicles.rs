//! Plates on wheels in the plane, each by place and heading.
//!
//! Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::random_numbers;
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

/// Components along a heading and across it.
fn in_frame<R: Real>(heading: R, [a, b]: [R; 2]) -> [R; 2] {
    let (sin, cos) = (heading.sin(), heading.cos());
    [cos * a + sin * b, cos * b - sin * a]
}

/// Coordinates: places of the axles and headings of both plates, `x1, y1, a1, x2, y2, a2`.
pub(crate) struct RollerRacer {
    masses: [f64; 2],
    moments: [f64; 2],
    lengths: [f64; 2],
    steering: [f64; 4],
}

impl Unreduced for RollerRacer {
    fn new(p: &Parameters) -> Self {
        let steering = ["A", "nu", "k", "c"].map(|name| p.get(name));
        RollerRacer { masses: p.vector("m"), moments: p.vector("J"), lengths: p.vector("L"), steering }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_numbers(6, random)
    }

    fn lagrangian<R: Real>(&self, _q: &[R], v: &[R], _t: R) -> R {
        (0..2).fold(R::from_f64(0.0), |energy, k| {
            let [x, y, a] = [v[3 * k], v[3 * k + 1], v[3 * k + 2]];
            let (m, j) = (R::from_f64(0.5 * self.masses[k]), R::from_f64(0.5 * self.moments[k]));
            energy + m * (x * x + y * y) + j * a * a
        })
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let [l1, l2] = self.lengths.map(R::from_f64);
        vec![q[3] - q[0] - l1 * q[2].cos() - l2 * q[5].cos(), q[4] - q[1] - l1 * q[2].sin() - l2 * q[5].sin()]
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        vec![in_frame(q[2], [v[0], v[1]])[1], in_frame(q[5], [v[3], v[4]])[1]]
    }

    fn force(&self, q: &[f64], v: &[f64], t: f64) -> Vec<f64> {
        let [amplitude, nu, k, c] = self.steering;
        let (angle, rate) = (q[5] - q[2], v[5] - v[2]);
        let torque = k * (amplitude * (nu * t).sin() - angle) - c * rate;
        vec![0.0, 0.0, -torque, 0.0, 0.0, torque]
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (phi, phi_dot) = (q[5] - q[2], v[5] - v[2]);
        let [l1, l2] = self.lengths.map(R::from_f64);
        let forward = in_frame(q[2], [v[0], v[1]])[0];
        // What is left of speed and turning when the share of the steering is taken away, along (L1 cos + L2, L1 sin).
        let (c, s) = (l1 * phi.cos() + l2, l1 * phi.sin());
        let square = c * c + s * s;
        let rest = [forward - l1 * l2 * s / square * phi_dot, l1 * v[2] + l1 * l2 * c / square * phi_dot];
        let along = (rest[0] * c + rest[1] * s) / square;
        Variables::new().number("phi", phi).number("phi_dot", phi_dot).number("s", along)
    }
}

/// Coordinates: places of the axles and headings of car and trailers, `x, y, a` of each, and the heading of the steered
/// axle.
pub(crate) struct CarWithTrailers {
    /// Of the car and of each trailer, as `lengths`.
    masses: Vec<f64>,
    moments: Vec<f64>,
    lengths: Vec<f64>,
    axle: f64,
    motor: [f64; 2],
    steering: [f64; 4],
}

impl CarWithTrailers {
    /// Bodies, of which the first is the car; the steered axle has the coordinate behind theirs.
    fn n_bodies(&self) -> usize {
        self.masses.len()
    }
}

impl Unreduced for CarWithTrailers {
    fn new(p: &Parameters) -> Self {
        CarWithTrailers {
            masses: p.from_index("m", 0),
            moments: p.from_index("J", 0),
            lengths: p.from_index("d", 0),
            axle: p.get("Js"),
            motor: ["push", "drag"].map(|name| p.get(name)),
            steering: ["A", "nu", "k", "c"].map(|name| p.get(name)),
        }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_numbers(3 * self.n_bodies() + 1, random)
    }

    fn lagrangian<R: Real>(&self, _q: &[R], v: &[R], _t: R) -> R {
        let steered = v[3 * self.n_bodies()];
        (0..self.n_bodies()).fold(R::from_f64(0.5 * self.axle) * steered * steered, |energy, k| {
            let [x, y, a] = [v[3 * k], v[3 * k + 1], v[3 * k + 2]];
            let (m, j) = (R::from_f64(0.5 * self.masses[k]), R::from_f64(0.5 * self.moments[k]));
            energy + m * (x * x + y * y) + j * a * a
        })
    }

    /// Each trailer is hitched to the axle before it.
    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let hitch = |k: usize| {
            let d = R::from_f64(self.lengths[k]);
            let (a, before) = (q[3 * k + 2], 3 * (k - 1));
            [q[3 * k] + d * a.cos() - q[before], q[3 * k + 1] + d * a.sin() - q[before + 1]]
        };
        (1..self.n_bodies()).flat_map(hitch).collect()
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        let across = |k: usize| in_frame(q[3 * k + 2], [v[3 * k], v[3 * k + 1]])[1];
        let d = R::from_f64(self.lengths[0]);
        let front = [v[0] - d * q[2].sin() * v[2], v[1] + d * q[2].cos() * v[2]];
        let steered = in_frame(q[3 * self.n_bodies()], front)[1];
        (0..self.n_bodies()).map(across).chain([steered]).collect()
    }

    fn force(&self, q: &[f64], v: &[f64], t: f64) -> Vec<f64> {
        let [push, drag] = self.motor;
        let [amplitude, nu, k, c] = self.steering;
        let steered = 3 * self.n_bodies();
        let speed = in_frame(q[2], [v[0], v[1]])[0];
        let motor = push - drag * speed;
        let torque = k * (amplitude * (nu * t).sin() - q[steered] + q[2]) - c * (v[steered] - v[2]);
        let mut force = vec![0.0; steered + 1];
        (force[0], force[1]) = (motor * q[2].cos(), motor * q[2].sin());
        (force[2], force[steered]) = (-torque, torque);
        force
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let steered = 3 * self.n_bodies();
        let headings: Vec<R> = (1..self.n_bodies()).map(|k| q[3 * k + 2] - q[3 * k - 1]).collect();
        Variables::new()
            .number("phi", q[steered] - q[2])
            .vector("psi", &headings)
            .number("phi_dot", v[steered] - v[2])
            .number("v1", in_frame(q[2], [v[0], v[1]])[0])
    }
}

/// A plate on a blade, on an incline: coordinates are the place of the blade, the first downhill, and the heading.
pub(crate) struct Skate {
    m: f64,
    moment: f64,
    a: f64,
    alpha: f64,
    g: f64,
}

impl Unreduced for Skate {
    fn new(p: &Parameters) -> Self {
        let [m, moment, a, alpha, g] = ["m", "J", "a", "alpha", "g"].map(|name| p.get(name));
        Skate { m, moment, a, alpha, g }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_numbers(3, random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let (sin, cos) = (q[2].sin(), q[2].cos());
        let [half, a, m] = [0.5, self.a, self.m].map(R::from_f64);
        let centre = [v[0] - a * sin * v[2], v[1] + a * cos * v[2]];
        let moment = R::from_f64(self.moment - self.m * self.a * self.a);
        half * m * (centre[0] * centre[0] + centre[1] * centre[1])
            + half * moment * v[2] * v[2]
            + R::from_f64(self.m * self.g * self.alpha.sin()) * (q[0] + a * cos)
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        vec![in_frame(q[2], [v[0], v[1]])[1]]
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let down = in_frame(q[2], [R::from_f64(1.0), R::from_f64(0.0)]);
        let rates = Variables::new().number("omega", v[2]).number("v1", in_frame(q[2], [v[0], v[1]])[0]);
        rates.vector("d", &down).number("descent", q[0])
    }
}

/// `LINKS` links in a chain with friction on the ground: coordinates are `x, y, a` of each.
pub(crate) struct SnakeWithFriction<const LINKS: usize> {
    m: f64,
    moment: f64,
    l: f64,
    friction: [f64; 2],
    motor: [f64; 5],
}

impl<const LINKS: usize> Unreduced for SnakeWithFriction<LINKS> {
    fn new(p: &Parameters) -> Self {
        let [m, moment, l] = ["m", "J", "l"].map(|name| p.get(name));
        let friction = ["ct", "cn"].map(|name| p.get(name));
        SnakeWithFriction {
            m,
            moment,
            l,
            friction,
            motor: ["A", "nu", "beta", "k", "c"].map(|name| p.get(name)),
        }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_numbers(3 * LINKS, random)
    }

    fn lagrangian<R: Real>(&self, _q: &[R], v: &[R], _t: R) -> R {
        let (m, j) = (R::from_f64(0.5 * self.m), R::from_f64(0.5 * self.moment));
        v.chunks_exact(3)
            .fold(R::from_f64(0.0), |sum, v| sum + m * (v[0] * v[0] + v[1] * v[1]) + j * v[2] * v[2])
    }

    /// The rear end of a link is the front end of the next.
    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let l = R::from_f64(self.l);
        let pins = q.chunks_exact(3).zip(q.chunks_exact(3).skip(1));
        pins.flat_map(|(p, q)| {
            [p[0] - q[0] - l * (p[2].cos() + q[2].cos()), p[1] - q[1] - l * (p[2].sin() + q[2].sin())]
        })
        .collect()
    }

    /// Friction by Gauss's rule of two points, which is exact for forces that are linear along a link.
    fn force(&self, q: &[f64], v: &[f64], t: f64) -> Vec<f64> {
        let [along, across] = self.friction;
        let [amplitude, nu, beta, k, c] = self.motor;
        let mut force = vec![0.0; 3 * LINKS];
        for (i, (q, v)) in q.chunks_exact(3).zip(v.chunks_exact(3)).enumerate() {
            let (sin, cos) = q[2].sin_cos();
            for x in [-self.l / 3.0_f64.sqrt(), self.l / 3.0_f64.sqrt()] {
                let [u, s] = in_frame(q[2], [v[0] - x * sin * v[2], v[1] + x * cos * v[2]]);
                let [fu, fs] = [-0.5 * along * u, -0.5 * across * s];
                force[3 * i] += cos * fu - sin * fs;
                force[3 * i + 1] += sin * fu + cos * fs;
                force[3 * i + 2] += x * fs;
            }
        }
        for i in 1..LINKS {
            let (angle, rate) = (q[3 * i + 2] - q[3 * i - 1], v[3 * i + 2] - v[3 * i - 1]);
            let wave = amplitude * (nu * t - (i as f64 - 1.0) * beta).sin();
            let torque = k * (wave - angle) - c * rate;
            force[3 * i + 2] += torque;
            force[3 * i - 1] -= torque;
        }
        force
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let differences = |q: &[R]| -> Vec<R> { (1..LINKS).map(|i| q[3 * i + 2] - q[3 * i - 1]).collect() };
        let rates = differences(v);
        let first = in_frame(q[2], [v[0], v[1]]);
        let mut state =
            Variables::new().vector("a", &differences(q)).number("omega", v[2]).vector("v", &first);
        for (i, rate) in rates.into_iter().enumerate() {
            state = state.number(&format!("a{}_dot", i + 1), rate);
        }
        state
    }
}
