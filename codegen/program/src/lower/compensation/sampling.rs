//! Places at which functions are measured: ordinary ones, next to ends of intervals and to axes, slow and fast ones.
//!
//! Does not know: programs, what is measured.

use std::f64::consts::{FRAC_PI_2, PI};

use hamel_expr::uniform;

/// What a component of the state is, as far as its values depend on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VariableKind {
    /// A coordinate in an open interval.
    Bounded {
        /// Lower end.
        from: f64,
        /// Upper end.
        to: f64,
    },
    /// An angle or a coordinate on the real line.
    Unbounded,
    /// A velocity or a momentum.
    Velocity,
    /// A coordinate of the group.
    Group,
    /// A component of a vector, the index counted in the vector.
    Vector {
        /// Which component.
        index: usize,
        /// Of how many.
        n: usize,
    },
}

/// Where a scene is measured: defaults of its parameters, kinds of the components of its state.
#[derive(Clone, Debug)]
pub struct Sampling {
    /// Whether functions that lose digits carry their rounding errors; otherwise their losses are told.
    pub carries_errors: bool,
    /// Values of the parameters, in the order of the program.
    pub params: Vec<f64>,
    /// The state, component by component.
    pub state: Vec<VariableKind>,
}

/// One place.
#[derive(Clone, Debug)]
pub(super) struct Place {
    pub(super) params: Vec<f64>,
    /// Whether parameters are moved by decades.
    pub(super) is_machine: bool,
    pub(super) t: f64,
    pub(super) state: Vec<f64>,
    pub(super) others: Vec<f64>,
}

/// Where in the space of states.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Region {
    Ordinary,
    Magnitudes,
    Edge,
    FastEdge,
    /// Some velocities, and what a function takes besides the state, are zero.
    Still,
}

const REGIONS: [Region; 5] =
    [Region::Ordinary, Region::Magnitudes, Region::Edge, Region::FastEdge, Region::Still];
/// Decades of velocities, of distances from singular places, and of parameters that are not near their defaults.
const SPEEDS: [f64; 2] = [-8.0, 8.0];
const DISTANCES: [f64; 2] = [-12.0, -1.0];
const MACHINES: [f64; 2] = [-3.0, 3.0];
/// One place of so many has parameters by [`MACHINES`]; the others have them within a factor of two of the defaults.
const MACHINES_EVERY: usize = 3;

/// Reproducible random numbers.
pub(super) struct Draw(pub(super) u64);

impl Draw {
    /// In `[-1, 1)`.
    fn number(&mut self) -> f64 {
        2.0 * uniform(&mut self.0) - 1.0
    }

    /// Of either sign, log-uniform.
    fn magnitude(&mut self, [from, to]: [f64; 2]) -> f64 {
        let sign = if self.number() < 0.0 { -1.0 } else { 1.0 };
        sign * 10f64.powf(from + (to - from) * uniform(&mut self.0))
    }

    /// A unit vector, near an axis with `edge`.
    fn vector(&mut self, n: usize, edge: bool) -> Vec<f64> {
        let spread = if edge { self.magnitude(DISTANCES) } else { 1.0 };
        let mut x: Vec<f64> = (0..n).map(|_| spread * self.number()).collect();
        if edge {
            let axis = (n as f64 * uniform(&mut self.0)) as usize;
            x[axis.min(n - 1)] = if self.number() < 0.0 { -1.0 } else { 1.0 };
        }
        let length = x.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        x.iter().map(|x| x / length).collect()
    }

    /// The place of a number, with so many values besides parameters, time and state.
    pub(super) fn place(&mut self, k: usize, sampling: &Sampling, n_others: usize) -> Place {
        let region = REGIONS[k % REGIONS.len()];
        let edge = matches!(region, Region::Edge | Region::FastEdge);
        let is_machine = (k / REGIONS.len()).is_multiple_of(MACHINES_EVERY);
        let params = sampling
            .params
            .iter()
            .map(|p| p * if is_machine { self.magnitude(MACHINES).abs() } else { 2f64.powf(self.number()) });
        let params = params.collect();
        let mut vector = Vec::new();
        let state = sampling.state.iter().map(|kind| match *kind {
            VariableKind::Bounded { from, to } if edge => {
                let distance = (to - from) * self.magnitude(DISTANCES);
                if distance > 0.0 { from + distance } else { to + distance }
            }
            VariableKind::Bounded { from, to } => from + (to - from) * uniform(&mut self.0),
            VariableKind::Unbounded if edge => {
                FRAC_PI_2 * (4.0 * self.number()).round() + self.magnitude(DISTANCES)
            }
            VariableKind::Unbounded => PI * self.number(),
            VariableKind::Vector { index, n } => {
                if index == 0 {
                    vector = self.vector(n, edge);
                }
                vector.get(index).copied().unwrap_or_default()
            }
            VariableKind::Velocity if matches!(region, Region::Magnitudes | Region::FastEdge) => {
                self.magnitude(SPEEDS)
            }
            VariableKind::Velocity if region == Region::Still && self.number() < 0.0 => 0.0,
            VariableKind::Velocity => 3.0 * self.number(),
            VariableKind::Group => self.number(),
        });
        let state = state.collect();
        let others =
            (0..n_others).map(|_| if region == Region::Still { 0.0 } else { self.number() }).collect();
        Place { params, is_machine, t: self.number(), state, others }
    }
}

/// Numbers by their bits.
impl PartialEq for Sampling {
    fn eq(&self, other: &Sampling) -> bool {
        self.params.iter().map(|x| x.to_bits()).eq(other.params.iter().map(|x| x.to_bits()))
            && (self.carries_errors, &self.state) == (other.carries_errors, &other.state)
    }
}
impl Eq for Sampling {}
