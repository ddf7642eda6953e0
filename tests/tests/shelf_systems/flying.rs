//! Bodies in air and water, with coordinates `x, R`: a place and a rotation matrix.
//!
//! Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::{
    M3, V3, body_rate, constant, cross, diagonal, difference, dot, kinetic_energy, matrix, orthogonality,
    random_numbers, random_rotation, scaled, times, transposed, vector,
};
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

fn place_and_rotation(random: &mut Random) -> Vec<f64> {
    random_numbers(3, random).into_iter().chain(random_rotation(random)).collect()
}

fn split<R: Real>(q: &[R]) -> (V3<R>, M3<R>) {
    (vector(q), matrix(&q[3..]))
}

/// Angular velocity and velocity in the body.
fn in_body<R: Real>(q: &[R], v: &[R]) -> (V3<R>, V3<R>) {
    let ((_, r), (x_dot, rate)) = (split(q), split(v));
    (body_rate(r, rate), times(transposed(r), x_dot))
}

/// Force and torque in the body, paired with `xdot, Rdot`: their power is that of the entries of `R^T Rdot`.
pub(super) fn in_space(r: M3<f64>, force: V3<f64>, torque: V3<f64>) -> Vec<f64> {
    let rows = r.into_iter().flat_map(|row| [torque[2] * row[1], torque[0] * row[2], torque[1] * row[0]]);
    times(r, force).into_iter().chain(rows).collect()
}

/// `h = sum (a M^2/2 + b M p + c p^2/2)` in angular momentum and impulse.
pub(crate) struct Kirchhoff<const CASE: char> {
    a: [f64; 3],
    b: [f64; 3],
    c: [f64; 3],
}

/// Clebsch's case.
pub(crate) type Clebsch = Kirchhoff<'C'>;
/// Steklov's case.
pub(crate) type Steklov = Kirchhoff<'S'>;

impl<const CASE: char> Unreduced for Kirchhoff<CASE> {
    fn new(p: &Parameters) -> Self {
        let a: [f64; 3] = p.vector("a");
        let others = |i: usize| (a[(i + 1) % 3], a[(i + 2) % 3]);
        if CASE == 'C' {
            let k = p.get("k");
            let c = [0, 1, 2].map(|i| k * others(i).0 * others(i).1);
            return Kirchhoff { a, b: [0.0; 3], c };
        }
        let mu = p.get("mu");
        let b = [0, 1, 2].map(|i| mu * others(i).0 * others(i).1);
        let c = [0, 1, 2].map(|i| mu * mu * a[i] * (others(i).0 - others(i).1).powi(2));
        Kirchhoff { a, b, c }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        place_and_rotation(random)
    }

    /// With `Omega = a M + b p`, `V = b M + c p`, axis by axis.
    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let (omega, velocity) = in_body(q, v);
        (0..3).fold(R::from_f64(0.0), |l, i| {
            let half = R::from_f64(0.5 / (self.a[i] * self.c[i] - self.b[i] * self.b[i]));
            let [a, b, c] = [self.a[i], 2.0 * self.b[i], self.c[i]].map(R::from_f64);
            let (w, u) = (omega[i], velocity[i]);
            l + half * (c * w * w - b * w * u + a * u * u)
        })
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        orthogonality(matrix(&q[3..]))
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (omega, velocity) = in_body(q, v);
        let factor = |i: usize| R::from_f64(1.0 / (self.a[i] * self.c[i] - self.b[i] * self.b[i]));
        let [a, b, c] = [self.a, self.b, self.c].map(constant::<R, 3>);
        let angular = [0, 1, 2].map(|i| factor(i) * (c[i] * omega[i] - b[i] * velocity[i]));
        let impulse = [0, 1, 2].map(|i| factor(i) * (a[i] * velocity[i] - b[i] * omega[i]));
        Variables::new().vector("M", &angular).vector("p", &impulse)
    }
}

/// A heavy body in water.
pub(crate) struct Underwater {
    m: f64,
    masses: [f64; 3],
    moments: [f64; 3],
    l: f64,
    drag: [f64; 3],
    damping: [f64; 3],
    controls: [f64; 3],
    g: f64,
}

impl Unreduced for Underwater {
    fn new(p: &Parameters) -> Self {
        Underwater {
            m: p.get("m"),
            masses: p.vector("M"),
            moments: p.vector("I"),
            l: p.get("l"),
            drag: p.vector("d"),
            damping: p.vector("c"),
            controls: ["thrust", "elevator", "rudder"].map(|name| p.get(name)),
            g: p.get("g"),
        }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        place_and_rotation(random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let (_, r) = split(q);
        let (omega, velocity) = in_body(q, v);
        let half = R::from_f64(0.5);
        let masses: V3<R> = constant(self.masses);
        let moments: V3<R> = constant(self.moments);
        let mut l = R::from_f64(0.0);
        for i in 0..3 {
            l += half * (masses[i] * velocity[i] * velocity[i] + moments[i] * omega[i] * omega[i]);
        }
        // The mass centre is below the place, where the buoyancy acts.
        let centre: V3<R> = constant([0.0, 0.0, -self.l]);
        l + R::from_f64(self.m) * dot(velocity, cross(omega, centre))
            - R::from_f64(self.m * self.g) * times(r, centre)[2]
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        orthogonality(matrix(&q[3..]))
    }

    fn force(&self, q: &[f64], v: &[f64], _t: f64) -> Vec<f64> {
        let (_, r) = split(q);
        let (omega, velocity) = in_body(q, v);
        let [thrust, elevator, rudder] = self.controls;
        let mut force = [0, 1, 2].map(|i| -self.drag[i] * velocity[i].abs() * velocity[i]);
        force[0] += thrust;
        let steering = velocity[0] * velocity[0].abs();
        let fins = [0.0, elevator * steering, rudder * steering];
        in_space(r, force, [0, 1, 2].map(|i| fins[i] - self.damping[i] * omega[i]))
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (_, r) = split(q);
        let (omega, velocity) = in_body(q, v);
        Variables::new().vector("Omega", &omega).vector("V", &velocity).vector("Gamma", &r[2])
    }
}

/// A body and a load on a cable: coordinates `x, R` and the place of the load.
pub(crate) struct Quadrotor {
    m: f64,
    moments: [f64; 3],
    load: f64,
    l: f64,
    thrust: f64,
    control: [f64; 3],
    g: f64,
}

impl Unreduced for Quadrotor {
    fn new(p: &Parameters) -> Self {
        Quadrotor {
            m: p.get("m"),
            moments: p.vector("J"),
            load: p.get("mL"),
            l: p.get("l"),
            thrust: p.get("thrust"),
            control: ["k", "c", "drag"].map(|name| p.get(name)),
            g: p.get("g"),
        }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        let body = place_and_rotation(random);
        // Anywhere but near the first axis of the body, where the angles of the cable end.
        let (x, r) = split(&body);
        let [a, b, c] = [0, 1, 2].map(|_| random.number());
        let arm = times(r, [0.5 * a, b, c - 1.5]);
        body.iter().copied().chain([x[0] + arm[0], x[1] + arm[1], x[2] + arm[2]]).collect()
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let (x_dot, rate) = split(v);
        let load = vector(&v[12..]);
        let height = R::from_f64(self.m) * q[2] + R::from_f64(self.load) * q[14];
        kinetic_energy(self.m, diagonal(self.moments), x_dot, rate)
            + R::from_f64(0.5 * self.load) * dot(load, load)
            - R::from_f64(self.g) * height
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        let (x, r) = split(q);
        let cable = difference(vector(&q[12..]), x);
        let mut equations = orthogonality(r);
        equations.push(dot(cable, cable) - R::from_f64(self.l * self.l));
        equations
    }

    fn force(&self, q: &[f64], v: &[f64], _t: f64) -> Vec<f64> {
        let (_, r) = split(q);
        let (omega, velocity) = in_body(q, v);
        let [k, c, drag] = self.control;
        let up = [0.0, 0.0, 1.0];
        let push = scaled(self.thrust * (self.m + self.load) * self.g, up);
        let torque = difference(scaled(k, cross(up, r[2])), scaled(c, omega));
        let mut force = in_space(r, difference(push, scaled(drag, velocity)), torque);
        force.extend([0.0; 3]);
        force
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (x, r) = split(q);
        let (omega, velocity) = in_body(q, v);
        let back = transposed(r);
        let p = times(back, difference(vector(&q[12..]), x));
        let rate = difference(times(back, difference(vector(&v[12..]), vector(v))), cross(omega, p));
        let l = R::from_f64(self.l);
        let alpha = (p[0] / l).asin();
        let beta_dot = (p[2] * rate[1] - p[1] * rate[2]) / (p[1] * p[1] + p[2] * p[2]);
        let angles = Variables::new().number("alpha", alpha).number("beta", (-p[1]).atan2(-p[2]));
        let rates = angles.number("alpha_dot", rate[0] / (l * alpha.cos())).number("beta_dot", beta_dot);
        let body = rates.vector("Omega", &omega).vector("V", &velocity);
        body.vector("Gamma", &r[2]).number("height", x[2])
    }
}
