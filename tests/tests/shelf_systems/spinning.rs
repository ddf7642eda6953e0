//! Bodies with wheels and rotors, each with a rotation matrix of its own.
//!
//! Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::{
    M3, body_rate, cross, diagonal, dot, kinetic_energy, matrix, matrix_sum, orthogonality, product,
    random_numbers, random_rotation, scaled, turned,
};
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

const AXES: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Moment of inertia of a wheel about a diameter, by that about its axle.
const THIN: f64 = 0.6;

/// The energy of a rotor on a body: coordinates `R` of the body and the angle, with their rates.
fn rotor_energy<R: Real>(axis: usize, moment: f64, (r, rate): (M3<R>, M3<R>), (phi, phi_dot): (R, R)) -> R {
    let (turn, slope) = turned(AXES[axis], phi);
    let turning = matrix_sum(product(rate, turn), product(r, slope.map(|row| scaled(phi_dot, row))));
    let mut moments = [THIN * moment; 3];
    moments[axis] = moment;
    let zero = R::from_f64(0.0);
    kinetic_energy(0.0, diagonal(moments), [zero; 3], turning)
}

/// A body with three wheels: coordinates `R, phi1, phi2, phi3`.
pub(crate) struct Satellite {
    whole: [f64; 3],
    wheels: [f64; 3],
    k: f64,
    c: f64,
}

impl Unreduced for Satellite {
    fn new(p: &Parameters) -> Self {
        Satellite { whole: p.vector("J"), wheels: p.vector("j"), k: p.get("k"), c: p.get("c") }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_rotation(random).into_iter().chain(random_numbers(3, random)).collect()
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let at = (matrix(q), matrix(v));
        let mut carrier = self.whole;
        let mut energy = R::from_f64(0.0);
        for (k, moment) in self.wheels.into_iter().enumerate() {
            for (i, carried) in carrier.iter_mut().enumerate() {
                *carried -= if i == k { moment } else { THIN * moment };
            }
            energy += rotor_energy(k, moment, at, (q[9 + k], v[9 + k]));
        }
        energy + kinetic_energy(0.0, diagonal(carrier), [R::from_f64(0.0); 3], at.1)
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        orthogonality(matrix(q))
    }

    /// The sun is along the first axis of space.
    fn force(&self, q: &[f64], v: &[f64], _t: f64) -> Vec<f64> {
        let (r, rate) = (matrix(q), matrix(v));
        let (to_sun, omega) = (cross(r[0], AXES[2]), body_rate(r, rate));
        let mut force = vec![0.0; 12];
        for k in 0..3 {
            force[9 + k] = self.k * to_sun[k] + self.c * omega[k];
        }
        force
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (r, rate) = (matrix(q), matrix(v));
        Variables::new().vector("Omega", &body_rate(r, rate)).vector("w", &v[9..]).vector("S", &r[0])
    }
}

/// A heavy body with a rotor about its third axis: coordinates `R, psi`.
pub(crate) struct Gyrostat {
    moment: f64,
    k: f64,
    lambda: f64,
}

impl Gyrostat {
    /// Moment of inertia of the rotor; what it is does not matter.
    const ROTOR: f64 = 0.3;
}

impl Unreduced for Gyrostat {
    fn new(p: &Parameters) -> Self {
        Gyrostat { moment: p.get("J"), k: p.get("k"), lambda: p.get("lambda") }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_rotation(random).into_iter().chain([random.number()]).collect()
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let at = (matrix(q), matrix(v));
        let across = 2.0 * self.moment - THIN * Gyrostat::ROTOR;
        let carrier = diagonal([across, across, self.moment]);
        rotor_energy(2, Gyrostat::ROTOR, at, (q[9], v[9]))
            + kinetic_energy(0.0, carrier, [R::from_f64(0.0); 3], at.1)
            - R::from_f64(self.k) * q[6]
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        orthogonality(matrix(q))
    }

    /// The momentum of the rotor, which the motion conserves by itself: it says how the rotor has been spun up.
    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        let omega = body_rate(matrix(q), matrix(v));
        vec![R::from_f64(Gyrostat::ROTOR) * (omega[2] + v[9]) - R::from_f64(self.lambda)]
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let (r, rate) = (matrix(q), matrix(v));
        Variables::new().vector("Omega", &body_rate(r, rate)).vector("Gamma", &r[2])
    }
}

/// A charged particle on a sphere: coordinates `R` of a frame with the particle on its third axis.
pub(crate) struct MagneticPendulum {
    m: f64,
    r: f64,
    kappa: f64,
    g: f64,
}

impl Unreduced for MagneticPendulum {
    fn new(p: &Parameters) -> Self {
        MagneticPendulum { m: p.get("m"), r: p.get("r"), kappa: p.get("kappa"), g: p.get("g") }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_rotation(random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let velocity = [v[2], v[5], v[8]];
        R::from_f64(0.5 * self.m * self.r * self.r) * dot(velocity, velocity)
            - R::from_f64(self.m * self.g * self.r) * q[8]
    }

    fn holonomic<R: Real>(&self, q: &[R]) -> Vec<R> {
        orthogonality(matrix(q))
    }

    /// The frame has no inertia about its third axis, about which it does not turn.
    fn nonholonomic<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Vec<R> {
        vec![body_rate(matrix(q), matrix(v))[2]]
    }

    /// `kappa x x xdot/r^3` on the particle at `x = r R e3`.
    fn force(&self, q: &[f64], v: &[f64], _t: f64) -> Vec<f64> {
        let force = cross([q[2], q[5], q[8]], [v[2], v[5], v[8]]).map(|f| self.kappa / self.r * f);
        let mut paired = vec![0.0; 9];
        for (i, f) in force.into_iter().enumerate() {
            paired[3 * i + 2] = self.r * f;
        }
        paired
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        let omega = body_rate(matrix(q), matrix(v));
        Variables::new().vector("Omega", &omega[..2]).vector("Gamma", &q[6..9])
    }
}
