//! Collocation at eight Gauss points, its stages side by side in the lanes of two scalars.
//!
//! Does not know how steps are chosen, or what the system is beyond its right-hand side.

use super::loops::{OwnLoops, STAGES, StageLoops, StageRow, stages};
use crate::error::Error;
use crate::lanes::F64x4;
use crate::methods::iteration::{ROUND_OFF, not_converged};
use crate::methods::{Estimate, Method, Step, Tableau, c, two_sum};
use crate::options::Options;
use crate::real::Real;
use crate::system::{OverScalar, StateVector, System};

/// The implicit method of order 16 that collocates at the eight Gauss points, for fixed steps and long runs: energy
/// errors grow as the square root of time.
///
/// ```text
/// L_i = h b_i f(t + c_i h, Y_i),   Y_i = y + sum_j mu_ij L_j,   mu_ij + mu_ji = 1       y_1 = y + sum_i L_i
/// ```
///
/// The stages fill the lanes of two [`F64x4`]; the second four are computed with the first four of the same sweep. It
/// is symmetric and symplectic as [`Gauss8`](crate::Gauss8) is, in the numbers that are stored: `mu_ij + mu_ji` is one
/// without rounding, and the weights of a step have the sum `h`. Its steps are so long and so accurate that round-off
/// is all that is left; nothing in the iteration prefers a sign of it, and it adds up as a random walk does (Brouwer's
/// law), wherever the motion itself does not multiply it.
///
/// The fixed-point iteration starts from the polynomial through all derivatives of the last step. It ends when no
/// stage changes, or when two sweeps have changed no component by less than a sweep before did: what is left is
/// round-off. Steps have to be well below the time scales of the system.
///
/// Continuous output is a step of its own from the same start, as accurate as the step; its iteration starts from the
/// stages of the whole step.
///
/// # Source
///
/// Antonana, Makazaga and Murua, Reducing and monitoring round-off error propagation for symplectic implicit
/// Runge-Kutta schemes (2017), sections 3 and 4; Hairer, McLachlan and Razakarivony, Achieving Brouwer's law with
/// implicit Runge-Kutta methods (2008).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gauss16;

/// [`Gauss16`] with inner loops of somebody else, whose numbers have the same bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gauss16With<W>(pub W);

/// What [`Gauss16`] keeps: the system in lanes, the last step, and room for one.
#[derive(Clone, Debug)]
pub struct Halves<P, L, V> {
    system: P,
    /// `L_i` of the last step.
    last: [L; 2],
    /// `L_i` of a step inside of it.
    inside: [L; 2],
    /// `Y_i`.
    points: [L; 2],
    slope: L,
    /// Largest changes of each component in a sweep.
    changes: L,
    /// The least of all sweeps before.
    least: V,
    fit: Fit,
}

const TABLEAU: Tableau = Tableau {
    name: "gauss16",
    order: 16,
    nodes: &[c(0.0, 0.0)],
    stages: &[&[]],
    weights: &[],
    estimate: Estimate::None,
    dense_nodes: &[],
    dense_stages: &[],
    dense: &[],
};

/// The nodes `c_i`.
const NODES: [f64; STAGES] = [
    0.019855071751231884,
    0.10166676129318664,
    0.2372337950418355,
    0.4082826787521751,
    0.591717321247825,
    0.7627662049581645,
    0.8983332387068134,
    0.9801449282487681,
];

/// The weights `b_i` of the first four; the others are the same in reverse.
const WEIGHTS: [f64; 4] = [0.05061426814518813, 0.11119051722668724, 0.15685332293894363, 0.181341891689181];

/// `mu_ij = a_ij / b_j` for `i < j`, rounded to multiples of 2^-52, so that the difference from one is exact; `mu_ij`
/// is also that of `8 - j, 8 - i`, counted from one less.
const LATER: [&[f64]; 4] = [
    &[
        -0.08189496310558142,
        0.040042703777944944,
        -0.02472134580320029,
        0.016976173236371128,
        -0.012225914113298098,
        0.00874856676919733,
        -0.005482808253215898,
    ],
    &[
        -0.08695892430083263,
        0.04494112630262559,
        -0.028759775474749283,
        0.020017127636408727,
        -0.014074355889166945,
    ],
    &[-0.08809383873230825, 0.046165464814799995, -0.029603873064977915],
    &[-0.08834716110982788],
];

/// `mu_ij`.
const MU: [[f64; STAGES]; STAGES] = {
    let mut mu = [[0.5; STAGES]; STAGES];
    let mut i = 0;
    while i < 4 {
        let mut j = i + 1;
        while j < STAGES - i {
            let value = LATER[i][j - i - 1];
            let mirrored = (STAGES - 1 - j, STAGES - 1 - i);
            (mu[i][j], mu[j][i]) = (value, 1.0 - value);
            (mu[mirrored.0][mirrored.1], mu[mirrored.1][mirrored.0]) = (value, 1.0 - value);
            j += 1;
        }
        i += 1;
    }
    mu
};

/// `mu_ij` with `i` in the lanes of a half, by half and `j`.
const COLUMNS: [StageRow; 2] = {
    let mut columns = [[F64x4::splat(0.0); STAGES]; 2];
    let mut j = 0;
    while j < STAGES {
        columns[0][j] = F64x4::new([MU[0][j], MU[1][j], MU[2][j], MU[3][j]]);
        columns[1][j] = F64x4::new([MU[4][j], MU[5][j], MU[6][j], MU[7][j]]);
        j += 1;
    }
    columns
};

/// The nodes in the lanes of both halves.
const PLACES: [F64x4; 2] = [
    F64x4::new([NODES[0], NODES[1], NODES[2], NODES[3]]),
    F64x4::new([NODES[4], NODES[5], NODES[6], NODES[7]]),
];

/// The nodes at which a step knows derivatives: its start, those of the stages, its end.
const KNOWN: [f64; STAGES + 2] = {
    let mut known = [0.0; STAGES + 2];
    let mut j = 0;
    while j < STAGES {
        known[j + 1] = NODES[j];
        j += 1;
    }
    known[STAGES + 1] = 1.0;
    known
};

/// `prod_(m != j) (x - x_m)` over the [`KNOWN`] nodes.
const fn product_without(j: usize, x: f64) -> f64 {
    let (mut product, mut m) = (1.0, 0);
    while m < KNOWN.len() {
        if m != j {
            product *= x - KNOWN[m];
        }
        m += 1;
    }
    product
}

/// The products at the node that they lack.
const OWN: [f64; STAGES + 2] = {
    let (mut own, mut j) = ([0.0; STAGES + 2], 0);
    while j < KNOWN.len() {
        own[j] = product_without(j, KNOWN[j]);
        j += 1;
    }
    own
};

/// The weights `h b_i` of a step; their sum is `h` but for the two roundings of the sum in it.
fn weights(h: f64) -> [f64; STAGES] {
    let [_, b, c, d] = WEIGHTS.map(|weight| h * weight);
    let a = 0.5 * h - (b + c + d);
    [a, b, c, d, d, c, b, a]
}

/// Numbers in the lanes of both halves.
fn halves(x: [f64; STAGES]) -> [F64x4; 2] {
    let [a, b, c, d, e, f, g, h] = x;
    [F64x4::new([a, b, c, d]), F64x4::new([e, f, g, h])]
}

/// A step beside one whose derivatives are known, or within it from its start.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    h: f64,
    last_h: f64,
    is_inside: bool,
}

/// Weights of what is known of the last step in the `L_i` of a step: of its `L_j`, and of the slopes at its ends.
#[derive(Clone, Debug)]
struct Fit {
    place: Place,
    stages: [StageRow; 2],
    ends: [[F64x4; 2]; 2],
}

impl Fit {
    const NONE: Fit = Fit {
        place: Place { h: 0.0, last_h: 0.0, is_inside: false },
        stages: [[F64x4::splat(0.0); STAGES]; 2],
        ends: [[F64x4::splat(0.0); 2]; 2],
    };

    fn new(place: Place) -> Fit {
        let ratio = place.h / place.last_h;
        let start = if place.is_inside { 0.0 } else { 1.0 };
        let (weights, old) = (weights(place.h), weights(place.last_h));
        // Interpolation at the stage `i` from the node `j`.
        let row = |j: usize, scale: f64| {
            let at = |i: usize| scale * weights[i] * product_without(j, start + ratio * NODES[i]) / OWN[j];
            halves(core::array::from_fn(at))
        };
        let stages: [_; STAGES] = core::array::from_fn(|j| row(j + 1, old[j].recip()));
        let ends = [row(0, 1.0), row(STAGES + 1, 1.0)];
        Fit {
            place,
            stages: core::array::from_fn(|half| stages.map(|row| row[half])),
            ends: core::array::from_fn(|half| ends.map(|row| row[half])),
        }
    }
}

/// The components of both halves.
fn slices<L: StateVector<F64x4>>(halves: &[L; 2]) -> [&[F64x4]; 2] {
    halves.each_ref().map(L::as_slice)
}

impl<P, L, V> Halves<P, L, V>
where
    P: System<F64x4, State = L>,
    L: StateVector<F64x4>,
    V: StateVector<f64>,
{
    /// Writes starting values to the `L_i` of the step.
    fn predict<S: System<f64, State = V>>(&mut self, step: &Step<'_, f64, S>, loops: impl StageLoops) {
        let slope = step.from.slope.as_slice();
        let last_h = step.last_h.filter(|last| step.h / last > 0.0 && step.h / last < 1.5);
        let Some(last_h) = last_h else {
            let out = if step.is_inside { &mut self.inside } else { &mut self.last };
            for (half, weight) in out.iter_mut().zip(halves(weights(step.h))) {
                for (increment, slope) in half.as_mut_slice().iter_mut().zip(slope) {
                    *increment = weight * F64x4::splat(*slope);
                }
            }
            return;
        };
        let place = Place { h: step.h, last_h, is_inside: step.is_inside };
        if place != self.fit.place {
            self.fit = Fit::new(place);
        }
        // What is at both ends of the last step: within it, the slope at its end is that of `to`.
        let other = step.to.slope.as_slice();
        let slopes = if step.is_inside { [slope, other] } else { [other, slope] };
        let out = if step.is_inside {
            for (inside, last) in self.inside.iter_mut().zip(&self.last) {
                inside.as_mut_slice().copy_from_slice(last.as_slice());
            }
            &mut self.inside
        } else {
            &mut self.last
        };
        loops.extrapolate(&self.fit.stages, &self.fit.ends, slopes, out.each_mut().map(L::as_mut_slice));
    }

    /// Sweeps over the stages until round-off is all that changes.
    #[inline(always)]
    fn iterate<S: System<f64, State = V>>(
        &mut self,
        step: &mut Step<'_, f64, S>,
        loops: impl StageLoops,
    ) -> Result<(), Error> {
        const MAX_SWEEPS: u32 = 100;
        /// Changes may grow at first.
        const PATIENCE: u32 = 10;
        /// Sweeps in succession without progress.
        const STALLED: u32 = 2;
        let Self { system, last, inside, points, slope, changes, least, .. } = self;
        let increments = if step.is_inside { inside } else { last };
        let (y, residue) = (step.from.state.as_slice(), step.from.residue.as_slice());
        let h = F64x4::splat(step.h);
        let weights = halves(weights(step.h));
        least.as_mut_slice().fill(f64::INFINITY);
        let mut stalled = 0;
        for sweep in 1..=MAX_SWEEPS {
            changes.as_mut_slice().fill(F64x4::ZERO);
            let (mut has_moved, mut is_finite) = (false, true);
            for half in 0..2 {
                let (points, known) = (&mut points[half], slices(increments));
                let to = (points.as_mut_slice(), changes.as_mut_slice());
                let moved = loops.points(&COLUMNS[half], (y, residue), known, to.0, to.1);
                is_finite &= moved.is_finite;
                if sweep == 1 || moved.has_moved {
                    has_moved = true;
                    system.rhs(F64x4::splat(step.t) + PLACES[half] * h, points, slope);
                    *step.rhs_evals += 1;
                    loops.weigh(weights[half], slope.as_slice(), increments[half].as_mut_slice());
                }
            }
            if !has_moved {
                return Ok(());
            }
            // The points before were those of another step.
            if sweep == 1 {
                continue;
            }
            // What is not finite is found, and explained, by the integrator.
            if !is_finite {
                return Ok(());
            }
            let has_progress = loops.progress(changes.as_slice(), least.as_mut_slice());
            stalled = if has_progress { 0 } else { stalled + 1 };
            if stalled == STALLED {
                let largest = changes.as_slice().iter().fold(F64x4::ZERO, |max, change| max.max(*change));
                let largest = largest.magnitude();
                let sizes = y.iter().zip(step.from.slope.as_slice());
                let size = sizes.fold(0.0_f64, |max, (y, slope)| max.max(y.abs() + (step.h * slope).abs()));
                if largest <= ROUND_OFF * f64::EPSILON * size {
                    return Ok(());
                }
                if sweep > PATIENCE {
                    return Err(not_converged(TABLEAU.name, step, sweep));
                }
                stalled = 0;
            }
        }
        Err(not_converged(TABLEAU.name, step, MAX_SWEEPS))
    }

    /// The new state from the stages.
    fn finish<S: System<f64, State = V>>(&self, step: &mut Step<'_, f64, S>) {
        let increments = if step.is_inside { &self.inside } else { &self.last };
        let (y, lacks) = (step.from.state.as_slice(), step.from.residue.as_slice());
        let ends = step.to.state.as_mut_slice().iter_mut().zip(step.to.residue.as_mut_slice());
        for (c, (state, residue)) in ends.enumerate() {
            let x = stages(slices(increments), c);
            // Pairs that change places when time is reversed, the lightest first.
            let pairs = [x[0] + x[7], x[1] + x[6], x[2] + x[5], x[3] + x[4]];
            let increment = pairs.into_iter().fold(lacks[c], |sum, pair| sum + pair);
            (*state, *residue) = two_sum(y[c], increment);
        }
    }
}

impl<S: OverScalar<F64x4>, W: StageLoops> Method<f64, S> for Gauss16With<W> {
    const TABLEAU: &'static Tableau = &TABLEAU;

    const DENSE_BY_STEPS: bool = true;

    type Storage = Halves<S::Over, <S::Over as System<F64x4>>::State, S::State>;

    fn storage(&self, system: &S, _t0: f64, y0: &S::State, _options: &Options<f64>) -> Self::Storage {
        let pair = || core::array::from_fn(|_| S::state_over(y0, |_| F64x4::ZERO));
        Halves {
            system: system.over(F64x4::splat),
            last: pair(),
            inside: pair(),
            points: pair(),
            slope: S::state_over(y0, |_| F64x4::ZERO),
            changes: S::state_over(y0, |_| F64x4::ZERO),
            least: y0.zeros_like(),
            fit: Fit::NONE,
        }
    }

    #[inline]
    fn stages(_storage: &Self::Storage) -> &[S::State] {
        &[]
    }

    #[inline]
    fn stages_mut(_storage: &mut Self::Storage) -> &mut [S::State] {
        &mut []
    }

    #[inline]
    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, f64, S>) -> Result<(), Error> {
        storage.predict(step, self.0);
        storage.iterate(step, self.0)?;
        storage.finish(step);
        Ok(())
    }
}

impl<S: OverScalar<F64x4>> Method<f64, S> for Gauss16 {
    const TABLEAU: &'static Tableau = &TABLEAU;

    const DENSE_BY_STEPS: bool = true;

    type Storage = <Gauss16With<OwnLoops> as Method<f64, S>>::Storage;

    fn storage(&self, system: &S, t0: f64, y0: &S::State, options: &Options<f64>) -> Self::Storage {
        Gauss16With(OwnLoops).storage(system, t0, y0, options)
    }

    #[inline]
    fn stages(storage: &Self::Storage) -> &[S::State] {
        <Gauss16With<OwnLoops> as Method<f64, S>>::stages(storage)
    }

    #[inline]
    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
        <Gauss16With<OwnLoops> as Method<f64, S>>::stages_mut(storage)
    }

    #[inline]
    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, f64, S>) -> Result<(), Error> {
        Gauss16With(OwnLoops).advance(storage, step)
    }
}

#[cfg(test)]
mod tests {
    use super::{Fit, MU, NODES, OwnLoops, Place, STAGES, StageLoops, WEIGHTS, halves, stages, weights};
    use crate::{DoubleDouble, Real};

    fn exact(x: f64) -> DoubleDouble {
        DoubleDouble::from(x)
    }

    #[test]
    fn stages_are_exactly_symplectic_and_symmetric() {
        for i in 0..STAGES {
            for j in 0..STAGES {
                assert_eq!(exact(MU[i][j]) + exact(MU[j][i]), DoubleDouble::ONE, "{i} {j}");
                assert_eq!(MU[i][j].to_bits(), MU[STAGES - 1 - j][STAGES - 1 - i].to_bits(), "{i} {j}");
            }
        }
        for h in [1.0, 0.1, 1.0 / 3.0, -0.7, 1e-300] {
            let weights = weights(h);
            let sum = weights.into_iter().fold(DoubleDouble::ZERO, |sum, weight| sum + exact(weight));
            assert!((sum - exact(h)).magnitude() <= 0.75 * f64::EPSILON * h.abs(), "{h}: {sum:?}");
            assert!((0..4).all(|i| weights[i].to_bits() == weights[STAGES - 1 - i].to_bits()));
        }
    }

    /// `sum_i b_i c_i^(q-1) = 1/q` for `q <= 16`, `sum_j a_ij c_j^(q-1) = c_i^q/q` and `sum_i b_i c_i^(q-1) a_ij =
    /// b_j (1 - c_j^q)/q` for `q <= 8`: order 16 by Butcher's theorem.
    #[test]
    fn coefficients_satisfy_the_simplifying_conditions() {
        let c = NODES.map(exact);
        let b: [DoubleDouble; STAGES] = core::array::from_fn(|i| exact(WEIGHTS[i.min(STAGES - 1 - i)]));
        let a = |i: usize, j: usize| b[j] * exact(MU[i][j]);
        let power = |x: DoubleDouble, q: usize| (0..q).fold(DoubleDouble::ONE, |power, _| power * x);
        let all =
            |term: &dyn Fn(usize) -> DoubleDouble| (0..STAGES).fold(DoubleDouble::ZERO, |s, j| s + term(j));
        let mut worst = 0.0_f64;
        let mut meet = |found: DoubleDouble, due: DoubleDouble| worst = worst.max((found - due).magnitude());
        for q in 1..=2 * STAGES {
            let part = exact(q as f64).recip();
            meet(all(&|i| b[i] * power(c[i], q - 1)), part);
            if q > STAGES {
                continue;
            }
            for i in 0..STAGES {
                meet(all(&|j| a(i, j) * power(c[j], q - 1)), part * power(c[i], q));
                let due = part * b[i] * (DoubleDouble::ONE - power(c[i], q));
                meet(all(&|j| b[j] * power(c[j], q - 1) * a(j, i)), due);
            }
        }
        // Rounded coefficients of the size of one, by at most half a unit each.
        assert!(worst < f64::EPSILON, "{worst:e}");
        let next = all(&|i| b[i] * power(c[i], 2 * STAGES)) - exact(17.0).recip();
        assert!(next.magnitude() > 1e-11, "order higher than stated: {next:?}");
    }

    /// Polynomials of degree nine are met, beside the last step and inside of it.
    #[test]
    fn starting_values_are_those_of_the_polynomial_through_all_that_is_known() {
        for (h, is_inside) in [(0.5, false), (0.4, false), (0.2, true), (-0.3, false)] {
            let last_h = if h < 0.0 { -0.5 } else { 0.5 };
            let fit = Fit::new(Place { h, last_h, is_inside });
            let slope = |t: f64| 1.0 + t * (2.0 - t.powi(8));
            let begin = if is_inside { 0.0 } else { last_h };
            let (old, new) = (weights(last_h), weights(h));
            let [mut low, mut high] =
                halves(core::array::from_fn(|j| old[j] * slope(last_h * NODES[j]))).map(|half| [half]);
            let slopes = [[slope(0.0)], [slope(last_h)]];
            OwnLoops.extrapolate(
                &fit.stages,
                &fit.ends,
                slopes.each_ref().map(|x| &x[..]),
                [&mut low, &mut high],
            );
            for (i, found) in stages([&low, &high], 0).into_iter().enumerate() {
                let due = new[i] * slope(begin + h * NODES[i]);
                assert!((found - due).abs() < 1e-8 * due.abs(), "{h} {is_inside} {i}: {found} and {due}");
            }
        }
    }
}
