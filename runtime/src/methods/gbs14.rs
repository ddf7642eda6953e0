//! The explicit midpoint rule, extrapolated to order 14, its rows side by side in the lanes of one scalar.
//!
//! Does not know how steps are chosen, or what the system is beyond its right-hand side.

use super::{Estimate, Method, Step, Tableau, c, two_sum};
use crate::error::Error;
use crate::lanes::F64x4;
use crate::options::{Options, StepSize};
use crate::real::Real;
use crate::system::{OverScalar, StateVector, System};

/// The explicit midpoint rule, extrapolated to order 14 from rows of 2, 4, .., 14 substeps: the fastest method for
/// smooth systems at any tolerance down to 1e-14.
///
/// ```text
/// d_0 = 0,  d_1 = eta f(t, y),  d_(i+1) = d_(i-1) + 2 eta f(t + i eta, y + d_i),  eta = h/n      row n: d_n
/// y_1 = y + sum_n w_n d_n,  w_n = prod_(m != n) n^2/(n^2 - m^2)
/// ```
///
/// Two rows share a lane of [`F64x4`], (14) (12, 2) (10, 4) (8, 6), so that a step takes 14 evaluations one after the
/// other: the least that an explicit method of order 14 can take. The recurrence is one of increments, which keeps the
/// round-off of a step near that of `y + h f`; the weights are up to 56 in sum, and tolerances below 1e-14 are out of
/// reach. The estimate is the difference from the extrapolation without the row of two substeps.
///
/// Continuous output is a step of its own from the same start, as accurate as the step: 13 evaluations a state. For
/// many of them in a step [`Vern9`](crate::Vern9) is the better choice.
///
/// # Source
///
/// Gragg 1965; Bulirsch and Stoer 1966; Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993),
/// section II.9.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gbs14;

/// What [`Gbs14`] keeps: the system in lanes, and room for a step.
#[derive(Clone, Debug)]
pub struct Rows<P, L, V> {
    system: P,
    zeros: L,
    /// The estimate of the error, divided by the step.
    estimate: [V; 1],
}

const TABLEAU: Tableau = Tableau {
    name: "gbs14",
    order: 14,
    nodes: &[c(0.0, 0.0), c(1.0, 0.0)],
    stages: &[&[], &[]],
    weights: &[],
    // The one derivative that is stored is the estimate.
    estimate: Estimate::Embedded { order: 13, weights: &[(1, c(1.0, 0.0))] },
    dense_nodes: &[],
    dense_stages: &[],
    dense: &[],
};

/// Least tolerance: the weights of the rows multiply round-off.
const LEAST_TOLERANCE: f64 = 1e-14;

/// The weight of the row of `2 j` substeps, the nearest number: `prod_(i != j) j^2/(j^2 - i^2)`.
const fn weight(j: i64) -> f64 {
    let (mut numerator, mut denominator, mut i) = (1, 1, 1);
    while i <= 7 {
        if i != j {
            numerator *= j * j;
            denominator *= j * j - i * i;
        }
        i += 1;
    }
    numerator as f64 / denominator as f64
}

/// What the weight of the row of `2 j` substeps is more than in the extrapolation without the row of two.
const fn excess(j: i64) -> f64 {
    weight(j) / (j * j) as f64
}

/// Weights of the rows and of the estimate, by half their substeps; the first is none.
const WEIGHTS: [[f64; 2]; 8] = {
    let (mut weights, mut j) = ([[0.0; 2]; 8], 1);
    while j < 8 {
        weights[j] = [weight(j as i64), excess(j as i64)];
        j += 1;
    }
    weights
};

/// Half the substeps of the long row of each lane, and of the short one that follows it; the first lane has none.
const LONG: [usize; 4] = [7, 6, 5, 4];
const SHORT: [usize; 4] = [0, 1, 2, 3];

/// Reciprocals of the numbers of substeps.
const fn parts(rows: [usize; 4]) -> F64x4 {
    let (mut parts, mut lane) = ([0.0; 4], 0);
    while lane < 4 {
        if rows[lane] > 0 {
            parts[lane] = 1.0 / (2 * rows[lane]) as f64;
        }
        lane += 1;
    }
    F64x4::new(parts)
}

/// Weights of rows, or with `k = 1` those of the estimate.
const fn weights(rows: [usize; 4], k: usize) -> F64x4 {
    F64x4::new([WEIGHTS[rows[0]][k], WEIGHTS[rows[1]][k], WEIGHTS[rows[2]][k], WEIGHTS[rows[3]][k]])
}

/// The lane `LANE` of `b`, the others of `a`.
#[inline(always)]
fn on_lane<const LANE: usize>(a: F64x4, b: F64x4) -> F64x4 {
    let (mut lanes, b) = (a.to_array(), b.to_array());
    lanes[LANE] = b[LANE];
    F64x4::new(lanes)
}

/// The sum of the lanes, in an order that is the same everywhere.
#[inline(always)]
fn sum_of_lanes(x: F64x4) -> f64 {
    let x = x.to_array();
    (x[0] + x[2]) + (x[1] + x[3])
}

impl<P, L, V> Rows<P, L, V>
where
    P: System<F64x4, State = L>,
    L: StateVector<F64x4>,
    V: StateVector<f64>,
{
    #[inline(always)]
    fn advance<S: System<f64, State = V>>(&mut self, step: &mut Step<'_, f64, S>) {
        let (y, f) = (step.from.state.as_slice(), step.from.slope.as_slice());
        let h = F64x4::splat(step.h);
        let t = F64x4::splat(step.t);
        let mut eta = h * const { parts(LONG) };
        // Copies, which stay in registers as far as there are any.
        let [mut start, mut even, mut odd, mut long, mut point, mut slope] =
            core::array::from_fn(|_| self.zeros.clone());
        for (lanes, y) in start.as_mut_slice().iter_mut().zip(y) {
            *lanes = F64x4::splat(*y);
        }
        for (odd, f) in odd.as_mut_slice().iter_mut().zip(f) {
            *odd = eta * F64x4::splat(*f);
        }
        let mut elapsed = eta;
        macro_rules! to_even {
            () => {
                Self::substep(
                    &self.system,
                    (t + elapsed, eta),
                    (&start, &odd, &mut even),
                    (&mut point, &mut slope),
                );
                elapsed += eta;
            };
        }
        macro_rules! to_odd {
            () => {
                Self::substep(
                    &self.system,
                    (t + elapsed, eta),
                    (&start, &even, &mut odd),
                    (&mut point, &mut slope),
                );
                elapsed += eta;
            };
        }
        // A lane has its long row, and begins its short one.
        macro_rules! restart {
            ($lane:literal) => {
                let fresh = h * const { parts(SHORT) };
                eta = on_lane::<$lane>(eta, fresh);
                elapsed = on_lane::<$lane>(elapsed, fresh);
                let increments =
                    even.as_mut_slice().iter_mut().zip(odd.as_mut_slice()).zip(long.as_mut_slice());
                for (((even, odd), long), f) in increments.zip(f) {
                    *long = on_lane::<$lane>(*long, *even);
                    *even = on_lane::<$lane>(*even, fresh * F64x4::splat(*f));
                    *odd = on_lane::<$lane>(*odd, F64x4::ZERO);
                }
            };
        }
        to_even!();
        for pair in 0..6 {
            match pair {
                3 => {
                    restart!(3);
                }
                4 => {
                    restart!(2);
                }
                5 => {
                    restart!(1);
                }
                _ => {}
            }
            to_odd!();
            to_even!();
        }
        let increments = even.as_slice().iter().zip(odd.as_slice()).zip(long.as_slice());
        let ends = step.to.state.as_mut_slice().iter_mut().zip(step.to.residue.as_mut_slice());
        let ends = ends.zip(y.iter().zip(step.from.residue.as_slice())).zip(self.estimate[0].as_mut_slice());
        for (((even, odd), long), (((state, residue), (y, lacks)), estimate)) in increments.zip(ends) {
            let long = on_lane::<0>(*long, *even);
            let sum = |k: [F64x4; 2]| sum_of_lanes(k[0].mul_add(long, k[1] * *odd));
            let increment = sum(const { [weights(LONG, 0), weights(SHORT, 0)] });
            (*state, *residue) = two_sum(*y, increment + *lacks);
            *estimate = sum(const { [weights(LONG, 1), weights(SHORT, 1)] }) / step.h;
        }
    }

    /// `to += 2 eta f(t, start + at)`.
    #[inline(always)]
    fn substep(
        system: &P,
        (t, eta): (F64x4, F64x4),
        (start, at, to): (&L, &L, &mut L),
        (point, slope): (&mut L, &mut L),
    ) {
        for (point, (start, at)) in
            point.as_mut_slice().iter_mut().zip(start.as_slice().iter().zip(at.as_slice()))
        {
            *point = *start + *at;
        }
        system.rhs(t, point, slope);
        let twice = eta + eta;
        for (to, slope) in to.as_mut_slice().iter_mut().zip(slope.as_slice()) {
            *to = twice.mul_add(*slope, *to);
        }
    }
}

impl<S: OverScalar<F64x4>> Method<f64, S> for Gbs14 {
    const TABLEAU: &'static Tableau = &TABLEAU;

    const DENSE_BY_STEPS: bool = true;

    type Storage = Rows<S::Over, <S::Over as System<F64x4>>::State, S::State>;

    fn validate(&self, options: &Options<f64>) -> Result<(), Error> {
        let is_adaptive = matches!(options.step, StepSize::Adaptive { .. });
        if is_adaptive && options.rtol > 0.0 && options.rtol < LEAST_TOLERANCE {
            return Err(Error::RelativeTolerance { value: options.rtol, least: LEAST_TOLERANCE });
        }
        Ok(())
    }

    fn storage(&self, system: &S, _t0: f64, y0: &S::State, _options: &Options<f64>) -> Self::Storage {
        let zeros = S::state_over(y0, |_| F64x4::ZERO);
        Rows { system: system.over(F64x4::splat), zeros, estimate: [y0.zeros_like()] }
    }

    #[inline]
    fn stages(storage: &Self::Storage) -> &[S::State] {
        &storage.estimate
    }

    #[inline]
    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
        &mut storage.estimate
    }

    #[inline]
    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, f64, S>) -> Result<(), Error> {
        storage.advance(step);
        *step.rhs_evals += 13;
        Ok(())
    }
}
