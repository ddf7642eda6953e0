//! Models against their unreduced motion, at random states and parameters.
//!
//! Deliberately does not know: any system.

use hamel_codegen::scene::BuiltScene;
use hamel_runtime::Dual;

use super::motion::{Motion, Unreduced, random_motion};
use super::parameters::Parameters;
use crate::random::Random;

/// States with parameters of their own.
const N_STATES: u64 = 20;

/// Rates relative to the largest one. Both sides are computed in double precision, the unreduced one by elimination in
/// a matrix with up to forty rows, whose condition (inertias of a small body beside ones of equations) costs digits;
/// 6e-14 is the most that was seen, and 1.2e-12 where multipliers carry a weight.
const BOUND: f64 = 1e-11;

/// What was compared.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The largest difference of a rate, relative to the largest rate of its state.
    pub worst: f64,
    /// The largest difference of a change of the energy between states, relative to the energies.
    pub worst_energy: f64,
    /// Parameters of which one hundredth more changes neither a rate nor the energy.
    pub idle: Vec<String>,
}

/// Rates of a scene at a state, and its energy.
fn rates(scene: &BuiltScene, parameters: &[f64], (t, y): (f64, &[f64])) -> (Vec<f64>, Option<f64>) {
    let prepared = scene.prepare(parameters).unwrap_or_else(|e| panic!("{e}"));
    let mut dy = vec![0.0; y.len()];
    prepared.rhs(t, y, &mut dy);
    (dy, prepared.energy(t, y))
}

/// The model's state along a motion, and its rates.
fn seen<S: Unreduced>(system: &S, motion: &Motion, names: &[String]) -> (Vec<f64>, Vec<f64>) {
    let dual = |x: &[f64], rate: &[f64]| -> Vec<Dual> {
        x.iter().zip(rate).map(|(x, rate)| Dual::new(*x, *rate)).collect()
    };
    let (q, v) = (dual(&motion.q, &motion.v), dual(&motion.v, &motion.a));
    let state = system.state(&q, &v, Dual::variable(motion.t)).in_order(names);
    (state.iter().map(|x| x.value).collect(), state.iter().map(|x| x.derivative).collect())
}

/// Holds the motion of a scene to that of a system in redundant coordinates.
///
/// # Panics
/// When a rate or the energy differs by more than rounding, or when the two have other variables.
pub fn check<S: Unreduced>(scene: &BuiltScene, seed: u64) -> Compared {
    let names = scene.state_names();
    let mut random = Random(seed);
    let mut compared = Compared { worst: 0.0, worst_energy: 0.0, idle: Vec::new() };
    let mut matters = vec![false; scene.params().len()];
    for k in 0..N_STATES {
        let parameters = Parameters::near_defaults(scene, &mut random);
        let system = S::new(&parameters);
        // Two states of one system: energies are compared up to a number.
        let mut differences: Vec<(f64, f64)> = Vec::new();
        for _ in 0..2 {
            let motion = random_motion(&system, &mut random);
            let (state, expected) = seen(&system, &motion, &names);
            let at = (motion.t, state.as_slice());
            let (found, energy) = rates(scene, parameters.values(), at);
            let largest = expected.iter().fold(f64::MIN_POSITIVE, |a: f64, x| a.max(x.abs()));
            for ((name, found), expected) in names.iter().zip(&found).zip(&expected) {
                let off = (found - expected).abs() / largest;
                assert!(off < BOUND, "state {k}: d{name}/dt is {found}, unreduced {expected}; {at:?}");
                compared.worst = compared.worst.max(off);
            }
            let offset = energy.filter(|_| system.has_energy()).map_or(0.0, |e| e - motion.energy);
            differences.push((offset, motion.energy.abs()));
            for (j, matters) in matters.iter_mut().enumerate() {
                let mut other = parameters.values().to_vec();
                other[j] *= 1.01;
                let (changed, changed_energy) = rates(scene, &other, at);
                let apart = |a: f64, b: f64, scale: f64| (a - b).abs() > 1e5 * BOUND * scale;
                *matters |= found.iter().zip(&changed).any(|(a, b)| apart(*a, *b, largest));
                *matters |= energy.zip(changed_energy).is_some_and(|(a, b)| apart(a, b, a.abs()));
            }
        }
        if let [(a, scale), (b, other)] = differences[..] {
            let off = (a - b).abs() / scale.max(other).max(f64::MIN_POSITIVE);
            assert!(off < BOUND, "state {k}: the change of the energy is off by {off:e}");
            compared.worst_energy = compared.worst_energy.max(off);
        }
    }
    let idle = scene.params().iter().zip(matters).filter(|(_, matters)| !matters);
    compared.idle = idle.map(|(p, _)| p.name.clone()).collect();
    compared
}
