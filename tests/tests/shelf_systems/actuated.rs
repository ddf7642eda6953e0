//! Mechanisms with states beside those of mechanics.
//!
//! Deliberately does not know: the models.

use hamel_runtime::Real;
use hamel_tests::random::Random;
use hamel_tests::unreduced::bodies::random_numbers;
use hamel_tests::unreduced::{Parameters, Unreduced, Variables};

/// An arm on a motor: coordinates are its angle and the charge that has passed the windings, whose inductance is the
/// inertia of the charge. The field of the magnets couples both by a term linear in the velocity of the charge.
///
/// Source: Maxwell 1873, A treatise on electricity and magnetism, part IV, chapter VI.
pub(crate) struct MotorArm {
    inertia: f64,
    weight: f64,
    coupling: f64,
    friction: f64,
    resistance: f64,
    inductance: f64,
}

/// The default of the voltage, at which scenes hold it.
const VOLTAGE: f64 = 6.0;

impl Unreduced for MotorArm {
    fn new(p: &Parameters) -> Self {
        let [m, l, n] = ["m", "l", "n"].map(|name| p.get(name));
        MotorArm {
            inertia: m * l * l + n * n * p.get("J"),
            weight: m * p.get("g") * l,
            coupling: n * p.get("k"),
            friction: p.get("b"),
            resistance: p.get("R"),
            inductance: p.get("L"),
        }
    }

    fn place(&self, random: &mut Random) -> Vec<f64> {
        random_numbers(2, random)
    }

    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], _t: R) -> R {
        let half = R::from_f64(0.5);
        let [inertia, weight, coupling, inductance] =
            [self.inertia, self.weight, self.coupling, self.inductance].map(R::from_f64);
        half * (inertia * v[0] * v[0] + inductance * v[1] * v[1])
            + weight * q[0].cos()
            + coupling * q[0] * v[1]
    }

    fn force(&self, _q: &[f64], v: &[f64], _t: f64) -> Vec<f64> {
        vec![-self.friction * v[0], VOLTAGE - self.resistance * v[1]]
    }

    fn state<R: Real>(&self, q: &[R], v: &[R], _t: R) -> Variables<R> {
        Variables::new().number("theta", q[0]).number("theta_dot", v[0]).number("i", v[1])
    }

    /// That of the field in the windings is none of the model's.
    fn has_energy(&self) -> bool {
        false
    }
}
