//! A piece of a motion as polynomials of the time, through a singular position: [`Path`].
//!
//! A motion that passes a singular position with a speed is analytic in the time there, as the branch of positions is
//! that it moves along, though its equations have no values. The rates of the equations at Gauss' nodes on both sides,
//! none of them in the middle, determine it: the polynomial `P` with
//!
//! ```text
//! P(-1) = y0,    P'(x_i) = d f(t_i, M P(x_i)),    t = middle + d x
//! ```
//!
//! where `M` moves a state to the nearest one that meets all equations. Off the branch the rates have a pole, on it
//! they have none, so that passes of the iteration converge as for regular equations.
//!
//! Does not know: where the singular position is, uses of the path.
//!
//! # Source
//! Hairer, Lubich and Wanner 2006, Geometric numerical integration, section II.1.3 (collocation).

use hamel_runtime::{Failure, System};

use super::branch::Branch;
use super::legendre::{Nodes, Series};
use crate::dynamics::{Dynamics, VecState};

/// Most passes of the iteration.
const MAX_PASSES: usize = 60;

/// A change from one pass to the next that is rounding, relative to the size of a component or one.
const ROUNDING: f64 = 1e-15;

/// The change at which passes may stop short of that: rates next to the position have fewer digits.
const CONVERGED: f64 = 1e-11;

/// A quantity whose polynomial misses its values at the ends by more than this part of its size is not smooth on the
/// path, as a reaction that grows beyond all bounds there.
const SMOOTH: f64 = 1e-7;

/// The times of a piece of a motion, as the middle and half the length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Span {
    pub(super) middle: f64,
    /// Negative for a motion backward in time.
    pub(super) half: f64,
}

impl Span {
    pub(super) fn time(self, x: f64) -> f64 {
        self.middle + self.half * x
    }

    pub(super) fn place(self, t: f64) -> f64 {
        (t - self.middle) / self.half
    }
}

/// States at the nodes of a path, and the polynomials through them.
pub(super) struct Solved {
    pub(super) nodes: Nodes,
    /// States at the nodes, which meet all equations.
    pub(super) states: Vec<Vec<f64>>,
    pub(super) rates: Series,
    pub(super) motion: Series,
    /// Evaluations of the rates.
    pub(super) evaluations: u64,
}

/// Solves for the path from a state at the beginning of a span; `guess` has states near it at places in it. None where
/// the passes do not converge.
pub(super) fn solve(
    branch: &Branch<'_>,
    span: Span,
    start: &[f64],
    n_nodes: usize,
    guess: &dyn Fn(f64) -> Vec<f64>,
) -> Option<Solved> {
    let nodes = Nodes::new(n_nodes);
    let mut points: Vec<Vec<f64>> = nodes.places.iter().map(|x| guess(*x)).collect();
    let (mut last, mut evaluations) = (f64::INFINITY, 0);
    for _ in 0..MAX_PASSES {
        let (mut slopes, mut states) = (Vec::with_capacity(n_nodes), points.clone());
        for (x, state) in nodes.places.iter().zip(&mut states) {
            let t = span.time(*x);
            if !branch.meet(t, state) {
                return None;
            }
            let mut slope = vec![0.0; state.len()];
            branch.dynamics.rhs(t, state, &mut slope);
            evaluations += 1;
            if !slope.iter().all(|x| x.is_finite()) {
                return None;
            }
            slopes.push(slope);
        }
        let rates = nodes.interpolated(&slopes);
        let motion = rates.integral(span.half, start);
        let next: Vec<Vec<f64>> = nodes.places.iter().map(|x| motion.at(*x)).collect();
        let change = points.iter().zip(&next).map(|(a, b)| difference(a, b)).fold(0.0, f64::max);
        let is_done = change <= ROUNDING || change >= last && last <= CONVERGED;
        if is_done {
            return Some(Solved { nodes, states, rates, motion, evaluations });
        }
        if !change.is_finite() {
            return None;
        }
        (points, last) = (next, change);
    }
    None
}

/// The largest difference of two states, relative to the size of each component or one.
pub(super) fn difference(a: &[f64], b: &[f64]) -> f64 {
    let each = a.iter().zip(b).map(|(a, b)| (a - b).abs() / a.abs().max(1.0));
    each.fold(0.0, |max: f64, x| if x.is_nan() { f64::INFINITY } else { max.max(x) })
}

/// A motion through a singular position, with its energy and its outputs.
#[derive(Clone, Debug)]
pub(crate) struct Path {
    span: Span,
    rates: Series,
    energy: Option<Series>,
    /// Which of the outputs are smooth on the path, and these.
    outputs: (Vec<bool>, Series),
}

impl Path {
    /// By the states at the nodes.
    pub(super) fn new(dynamics: &dyn Dynamics, span: Span, solved: Solved) -> Path {
        let Solved { nodes, states, rates, motion, .. } = solved;
        let times = || nodes.places.iter().map(|x| span.time(*x)).zip(&states);
        let of_energy = |t: f64, y: &[f64]| dynamics.energy(t, y).map(|energy| vec![energy]);
        let energies: Option<Vec<Vec<f64>>> = times().map(|(t, y)| of_energy(t, y)).collect();
        let energy = energies.map(|rows| nodes.interpolated(&rows));
        let rows: Vec<Vec<f64>> = times().map(|(t, y)| dynamics.outputs(t, y)).collect();
        let series = nodes.interpolated(&rows);
        let n = rows.first().map_or(0, Vec::len);
        let mut is_smooth = vec![true; n];
        for x in [-1.0, 1.0] {
            let (found, own) = (series.at(x), dynamics.outputs(span.time(x), &motion.at(x)));
            for (k, is_smooth) in is_smooth.iter_mut().enumerate() {
                let size = rows.iter().fold(1.0_f64, |max, row| max.max(row[k].abs()));
                *is_smooth &= (found[k] - own[k]).abs() <= SMOOTH * size;
            }
        }
        Path { span, rates, energy, outputs: (is_smooth, series) }
    }

    /// The energy at a time, which dependent velocities enter that have no values in the singular position.
    pub(crate) fn energy(&self, t: f64) -> Option<f64> {
        self.energy.as_ref().and_then(|series| series.at(self.span.place(t)).first().copied())
    }

    /// The outputs at a time and a state of the path: by polynomials where they are smooth, and by themselves.
    pub(crate) fn outputs(&self, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Vec<f64> {
        let (is_smooth, series) = &self.outputs;
        let smooth = series.at(self.span.place(t));
        if is_smooth.iter().all(|is_smooth| *is_smooth) {
            return smooth;
        }
        let own = dynamics.outputs(t, y);
        own.into_iter().zip(smooth).zip(is_smooth).map(|((own, s), is)| if *is { s } else { own }).collect()
    }
}

/// A path as a system, so that samples and events are found on it as on any motion.
pub(crate) struct OnPath<'p> {
    path: &'p Path,
    dynamics: &'p dyn Dynamics,
}

impl<'p> OnPath<'p> {
    pub(crate) fn new(path: &'p Path, dynamics: &'p dyn Dynamics) -> Self {
        OnPath { path, dynamics }
    }
}

impl System<f64> for OnPath<'_> {
    type State = VecState;

    fn rhs(&self, t: f64, _: &VecState, dy: &mut VecState) {
        dy.0 = self.path.rates.at(self.path.span.place(t));
    }

    fn domain(&self, t: f64, y: &VecState) -> Result<(), Failure> {
        self.dynamics.domain(t, &y.0)
    }
}
