//! Balls that roll on surfaces, with coordinates `x, R`: the centre and a rotation matrix.
//!
//! Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::{
    M3, V3, body_rate, constant, cross, diagonal, difference, dot, kinetic_energy, matrix, matrix_sum,
    orthogonality, product, random_numbers, random_rotation, scaled, space_rate, sum, times, transposed,
    turned, vector,
};
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

fn place_and_rotation(random: &mut Random) -> Vec<f64> {
    random_numbers(3, random).into_iter().chain(random_rotation(random)).collect()
}

fn split<R: Real>(q: &[R]) -> (V3<R>, M3<R>) {
    (vector(q), matrix(&q[3..]))
}

/// The velocity of the material point at `arm` from the centre, in space.
fn velocity_at<R: Real>(q: &[R], v: &[R], arm: V3<R>) -> V3<R> {
    let ((_, r), (x_dot, rate)) = (split(q), split(v));
    sum(x_dot, times(rate, times(transposed(r), arm)))
}

/// A ball inside a vertical cylinder that turns.
pub(crate) struct InCylinder {
    m: f64,
    r: f64,
    moment: f64,
    cylinder: f64,
    nu: f64,
    g: f64,
}

impl Unreduced for InCylinder {
    fn new(p: &Parameters) -> Self {
        let [m, r, moment, cylinder, nu, g] = ["m", "r", "I", "R", "nu", "g"].map(|name| p.get(name));
        InCylinder { m, r, moment, cylinder, nu, g }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        place_and_rotation(random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let (x_dot, rate) = split(v);
        kinetic_energy(self.m, diagonal([self.moment; 3]), x_dot, rate) - R::from_f64(self.m * self.g) * q[2]
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let distance = self.cylinder - self.r;
        let mut equations = orthogonality(matrix(&q[3..]));
        equations.push(q[0] * q[0] + q[1] * q[1] - R::from_f64(distance * distance));
        equations
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        let distance = R::from_f64(self.cylinder - self.r);
        let out = [q[0] / distance, q[1] / distance, R::from_f64(0.0)];
        let around = [-out[1], out[0], R::from_f64(0.0)];
        let slip = velocity_at(q, v, scaled(R::from_f64(self.r), out));
        let wall = R::from_f64(self.nu * self.cylinder);
        vec![dot(slip, around) - wall, slip[2]]
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let ((_, r), (_, rate)) = (split(q), split(v));
        let w = space_rate(r, rate);
        let phi_dot = (q[0] * v[1] - q[1] * v[0]) / (q[0] * q[0] + q[1] * q[1]);
        let place = Variables::new().number("phi", q[1].atan2(q[0])).number("z", q[2]);
        place.number("phi_dot", phi_dot).number("w1", w[0]).number("w2", w[1])
    }
}

/// A ball in a bowl that turns; the centre is on a paraboloid.
pub(crate) struct InBowl {
    m: f64,
    r: f64,
    moment: f64,
    kappa: f64,
    nu: f64,
    g: f64,
}

impl Unreduced for InBowl {
    fn new(p: &Parameters) -> Self {
        let [m, r, moment, kappa, nu, g] = ["m", "r", "I", "kappa", "nu", "g"].map(|name| p.get(name));
        InBowl { m, r, moment, kappa, nu, g }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        place_and_rotation(random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let (x_dot, rate) = split(v);
        kinetic_energy(self.m, diagonal([self.moment; 3]), x_dot, rate) - R::from_f64(self.m * self.g) * q[2]
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let mut equations = orthogonality(matrix(&q[3..]));
        equations.push(q[2] - R::from_f64(0.5 * self.kappa) * (q[0] * q[0] + q[1] * q[1]));
        equations
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        let kappa = R::from_f64(self.kappa);
        let up = [-kappa * q[0], -kappa * q[1], R::from_f64(1.0)];
        let arm = scaled(-R::from_f64(self.r) / dot(up, up).sqrt(), up);
        let contact = sum(vector(q), arm);
        let bowl = cross(constant([0.0, 0.0, self.nu]), contact);
        difference(velocity_at(q, v, arm), bowl)[..2].to_vec()
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let ((_, r), (_, rate)) = (split(q), split(v));
        let kappa = R::from_f64(self.kappa);
        let up = [-kappa * q[0], -kappa * q[1], R::from_f64(1.0)];
        let spin = dot(space_rate(r, rate), up) / dot(up, up).sqrt();
        let place = Variables::new().vector("a", &q[..2]);
        place.number("a1_dot", v[0]).number("a2_dot", v[1]).number("spin", spin)
    }
}

/// A shell with a pendulum inside: coordinates `x, R, phi`.
pub(crate) struct Robot {
    masses: [f64; 2],
    r: f64,
    moments: [f64; 2],
    l: f64,
    j: f64,
    motor: [f64; 2],
    g: f64,
}

impl Unreduced for Robot {
    fn new(p: &Parameters) -> Self {
        Robot {
            masses: p.vector("m"),
            r: p.get("r"),
            moments: p.vector("J"),
            l: p.get("l"),
            j: p.get("j"),
            motor: ["torque", "c"].map(|name| p.get(name)),
            g: p.get("g"),
        }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        place_and_rotation(random).into_iter().chain([3.0 * random.number()]).collect()
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let ((x, r), (x_dot, rate)) = (split(q), split(v));
        let [along, across] = self.moments;
        let (turn, slope) = turned([1.0, 0.0, 0.0], q[12]);
        // The bob is a body of its own: its attitude, and its place below the axle.
        let attitude = product(r, turn);
        let turning = matrix_sum(product(rate, turn), product(r, slope.map(|row| scaled(v[12], row))));
        let down = constant([0.0, 0.0, -self.l]);
        let place = sum(x, times(attitude, down));
        kinetic_energy(self.masses[0], diagonal([along, across, across]), x_dot, rate)
            + kinetic_energy(self.masses[1], diagonal([self.j; 3]), sum(x_dot, times(turning, down)), turning)
            - R::from_f64(self.g)
                * (R::from_f64(self.masses[0]) * x[2] + R::from_f64(self.masses[1]) * place[2])
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let mut equations = orthogonality(matrix(&q[3..]));
        equations.push(q[2] - R::from_f64(self.r));
        equations
    }

    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        velocity_at(q, v, constant([0.0, 0.0, -self.r]))[..2].to_vec()
    }

    fn force(&self, _q: &[f64], v: &[f64], _t: f64) -> Vec<f64> {
        let mut force = vec![0.0; 13];
        force[12] = self.motor[0] - self.motor[1] * v[12];
        force
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let ((_, r), (_, rate)) = (split(q), split(v));
        let angle = Variables::new().number("phi", q[12]).number("phi_dot", v[12]);
        angle.vector("Omega", &body_rate(r, rate)).vector("Gamma", &r[2])
    }
}
