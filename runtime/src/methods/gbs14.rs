//! The explicit midpoint rule, extrapolated to order 14, its rows side by side in the lanes of one scalar.
//!
//! Does not know how steps are chosen, or what the system is beyond its right-hand side.

use super::{Estimate, Method, Point, Start, Step, Tableau, c, square_of_norm, two_sum};
use crate::controller::{exp2, log2};
use crate::error::Error;
use crate::lanes::F64x4;
use crate::options::{Options, StepSize, signed};
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
/// Where the trial that chooses the first step tells that the rows of 2, 4, 6 and 8 substeps are enough for all of a
/// short run, it takes one step with these.
///
/// On the scalars [`F64x4`] and [`F64x8`](crate::F64x8), whose lanes are trajectories, the rows are computed one after
/// the other, in 49 evaluations a step and the next derivative: for cheap right-hand sides less time than the sums of
/// stages of [`Vern9`](crate::Vern9).
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
    /// From where and how far four rows are enough, as far as the trial of the first step told.
    short: Option<Short>,
}

/// A time, and the longest step from there that is accurate with four rows.
#[derive(Clone, Copy, Debug)]
struct Short {
    t: f64,
    longest: f64,
}

pub(super) const TABLEAU: Tableau = Tableau {
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

/// Whether the tolerances can be met.
pub(super) fn validate<R: Real>(options: &Options<R>) -> Result<(), Error> {
    let least = R::from_f64(LEAST_TOLERANCE);
    let is_adaptive = matches!(options.step, StepSize::Adaptive { .. });
    if is_adaptive && options.rtol.all_gt(R::ZERO) && !options.rtol.all_ge(least) {
        return Err(Error::RelativeTolerance { value: signed(options.rtol), least: LEAST_TOLERANCE });
    }
    Ok(())
}

/// The weight of the row of `2 j` substeps among `n` rows, the nearest number: `prod_(i != j) j^2/(j^2 - i^2)`.
const fn weight(j: i64, n: i64) -> f64 {
    let (mut numerator, mut denominator, mut i) = (1, 1, 1);
    while i <= n {
        if i != j {
            numerator *= j * j;
            denominator *= j * j - i * i;
        }
        i += 1;
    }
    numerator as f64 / denominator as f64
}

/// What the weight of the row of `2 j` substeps is more than in the extrapolation without the row of two.
const fn excess(j: i64, n: i64) -> f64 {
    weight(j, n) / (j * j) as f64
}

/// Weights of `n` rows and of their estimate, by half their substeps; the first is none.
const fn weights_of(n: usize) -> [[f64; 2]; 8] {
    let (mut weights, mut j) = ([[0.0; 2]; 8], 1);
    while j <= n {
        weights[j] = [weight(j as i64, n as i64), excess(j as i64, n as i64)];
        j += 1;
    }
    weights
}

/// Weights of all rows.
pub(super) const WEIGHTS: [[f64; 2]; 8] = weights_of(7);

/// Rows of a step that the trial of the first step has found to be short.
const FEW: usize = 4;

/// Weights of those.
const WEIGHTS_OF_FEW: [[f64; 2]; 8] = weights_of(FEW);

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

/// The reciprocals of `2 n`, `2 n - 2`, .. on the lanes, zero from the end of the row of the lane on: for the first
/// substep, and for each pair after it.
const fn parts_with_ends(n: usize) -> [F64x4; 4] {
    let (mut parts, mut pair) = ([F64x4::ZERO; 4], 0);
    while pair < n {
        let mut rows = [0; 4];
        let mut lane = 0;
        while lane + pair < n {
            rows[lane] = n - lane;
            lane += 1;
        }
        parts[pair] = self::parts(rows);
        pair += 1;
    }
    parts
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

/// The sums of the lanes of four numbers, in an order that is the same everywhere.
#[inline(always)]
fn sums_of_lanes(rows: [F64x4; 4]) -> F64x4 {
    let [a, b, c, d] = rows.map(F64x4::to_array);
    let ab = [a[0] + a[2], a[1] + a[3], b[0] + b[2], b[1] + b[3]];
    let cd = [c[0] + c[2], c[1] + c[3], d[0] + d[2], d[1] + d[3]];
    F64x4::new([ab[0] + ab[1], ab[2] + ab[3], cd[0] + cd[1], cd[2] + cd[3]])
}

/// Squares of `WIDTH` errors from `c` on, in units of their tolerances.
#[inline(always)]
fn squares<const WIDTH: usize>(
    errors: &[f64],
    tolerances: [&[f64]; 2],
    ends: [&[f64]; 2],
    c: usize,
) -> F64x4 {
    let (mut error, mut relative, mut absolute) = ([0.0; 4], [0.0; 4], [1.0; 4]);
    let (mut from, mut to) = ([0.0; 4], [0.0; 4]);
    for k in 0..WIDTH {
        error[k] = errors[c + k];
        (relative[k], absolute[k]) = (tolerances[0][c + k], tolerances[1][c + k]);
        (from[k], to[k]) = (ends[0][c + k], ends[1][c + k]);
    }
    let larger = F64x4::new(from).abs().max(F64x4::new(to).abs());
    let scaled = F64x4::new(error) / F64x4::new(relative).mul_add(larger, F64x4::new(absolute));
    scaled * scaled
}

impl<P, L, V> Rows<P, L, V>
where
    P: System<F64x4, State = L>,
    L: StateVector<F64x4>,
    V: StateVector<f64>,
{
    /// Whether the system has so few numbers that its right-hand side is short: a step is written out then. The
    /// compiler inlines a long one where it stands in loops only; either is up to a tenth slower with the other
    /// (measured on systems of 18 to 58 numbers).
    const IS_SMALL: bool = size_of::<P>() <= 44 * size_of::<F64x4>();

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
        macro_rules! pair {
            () => {
                to_odd!();
                to_even!();
            };
        }
        to_even!();
        if const { Self::IS_SMALL } {
            pair!();
            pair!();
            pair!();
            restart!(3);
            pair!();
            restart!(2);
            pair!();
            restart!(1);
            pair!();
        } else {
            let mut pairs = 3;
            for begun in 0..4 {
                match begun {
                    1 => {
                        restart!(3);
                    }
                    2 => {
                        restart!(2);
                    }
                    3 => {
                        restart!(1);
                    }
                    _ => {}
                }
                for _ in 0..pairs {
                    pair!();
                }
                pairs = 1;
            }
        }
        let rows = (even.as_slice(), odd.as_slice(), long.as_slice());
        let (n, mut c, per_h) = (y.len(), 0, step.h.recip());
        while n - c >= 4 {
            self.combine::<4>(rows, (step.from, step.to), c, per_h);
            c += 4;
        }
        match n - c {
            3 => self.combine::<3>(rows, (step.from, step.to), c, per_h),
            2 => self.combine::<2>(rows, (step.from, step.to), c, per_h),
            1 => self.combine::<1>(rows, (step.from, step.to), c, per_h),
            _ => {}
        }
    }

    /// The end and the estimate of `WIDTH` components from `c` on, whose sums over lanes are as many operations as that
    /// of one.
    #[inline(always)]
    fn combine<const WIDTH: usize>(
        &mut self,
        (even, odd, long): (&[F64x4], &[F64x4], &[F64x4]),
        (from, to): (&Point<V>, &mut Point<V>),
        c: usize,
        per_h: f64,
    ) {
        let (mut increments, mut errors) = ([F64x4::ZERO; 4], [F64x4::ZERO; 4]);
        let (mut starts, mut residues) = ([0.0; 4], [0.0; 4]);
        for k in 0..WIDTH {
            let long = on_lane::<0>(long[c + k], even[c + k]);
            let sum = |weights: [F64x4; 2]| weights[0].mul_add(long, weights[1] * odd[c + k]);
            increments[k] = sum(const { [weights(LONG, 0), weights(SHORT, 0)] });
            errors[k] = sum(const { [weights(LONG, 1), weights(SHORT, 1)] });
            (starts[k], residues[k]) = (from.state.as_slice()[c + k], from.residue.as_slice()[c + k]);
        }
        let increments = sums_of_lanes(increments) + F64x4::new(residues);
        let (ends, residues) = two_sum(F64x4::new(starts), increments);
        let errors = sums_of_lanes(errors) * F64x4::splat(per_h);
        let (ends, residues, errors) = (ends.to_array(), residues.to_array(), errors.to_array());
        for k in 0..WIDTH {
            (to.state.as_mut_slice()[c + k], to.residue.as_mut_slice()[c + k]) = (ends[k], residues[k]);
            self.estimate[0].as_mut_slice()[c + k] = errors[k];
        }
    }

    /// The mean of the squares of the errors in units of their tolerances, four at a time.
    #[inline(always)]
    fn mean_square_error(&self, h: f64, tolerances: [&V; 2], ends: [&V; 2]) -> f64 {
        let (errors, n) = (self.estimate[0].as_slice(), ends[0].as_slice().len());
        let (tolerances, ends) = (tolerances.map(V::as_slice), ends.map(V::as_slice));
        let (mut c, mut sum) = (0, F64x4::ZERO);
        while n - c >= 4 {
            sum += squares::<4>(errors, tolerances, ends, c);
            c += 4;
        }
        sum = match n - c {
            3 => sum + squares::<3>(errors, tolerances, ends, c),
            2 => sum + squares::<2>(errors, tolerances, ends, c),
            1 => sum + squares::<1>(errors, tolerances, ends, c),
            _ => sum,
        };
        let [a, b, c, d] = sum.to_array();
        ((a + c) + (b + d)) * (h * h * (n.max(1) as f64).recip())
    }

    /// The first step, from the errors of the extrapolations of two rows and of three over a trial.
    ///
    /// ```text
    /// e_k = e_(k-1) (lambda h)^2/(2 k)
    /// ```
    ///
    /// is the ratio of the leading terms of the errors of `k` rows and of one less, where the derivatives of order `m`
    /// are those of a function between `lambda^m` and `m! lambda^m`, at the geometric mean of both. It goes on to the
    /// error of all rows, which is to be one.
    fn first_step<S: System<f64, State = V>>(
        &mut self,
        start: &mut Start<'_, f64, S>,
        trial: f64,
    ) -> Option<f64> {
        let even = self.side_by_side::<3>(start.t, trial, start.point);
        *start.rhs_evals += 5;
        // What the extrapolations have that those without the row of two substeps have not.
        let (out, further) = (start.work.as_mut_slice(), self.estimate[0].as_mut_slice());
        for (c, even) in even.as_slice().iter().enumerate() {
            let [six, four, two, _] = even.to_array();
            out[c] = start.tolerances.scaled(c, (-1.0 / 3.0) * two + (1.0 / 3.0) * four);
            let error = (1.0 / 24.0) * two + (-4.0 / 15.0) * four + (9.0 / 40.0) * six;
            further[c] = start.tolerances.scaled(c, error);
        }
        let (two, three) = (square_of_norm(start.norm, out), square_of_norm(start.norm, further));
        let is_converging = three > 0.0 && three < two && two.is_finite();
        if !is_converging {
            return None;
        }
        // Logarithms of the squares; 6 e_3/e_2 is the square of lambda h.
        let (two, three) = (log2(two), log2(three));
        let growth = 2.0 * log2(6.0) + three - two;
        let seven = three + 4.0 * growth - 2.0 * log2(8.0 * 10.0 * 12.0 * 14.0);
        let four = three + growth - 2.0 * log2(8.0);
        let longest = trial.abs() * (0.8 * exp2(-four / 14.0)).min(20.0);
        self.short = Some(Short { t: start.t, longest });
        // Safer than later on, since no step has told how true this is.
        Some(trial.abs() * (0.8 * exp2(-seven / 26.0)).min(20.0))
    }

    /// The increments of rows of `2 N`, `2 N - 2`, .., 2 substeps over a step from a point, each in a lane of its own,
    /// which stands still at its end; `N` is at most four. Takes `2 N - 1` evaluations.
    #[inline(always)]
    fn side_by_side<const N: usize>(&self, t: f64, h: f64, from: &Point<V>) -> L {
        let (y, f) = (from.state.as_slice(), from.slope.as_slice());
        let (t, h) = (F64x4::splat(t), F64x4::splat(h));
        let [mut start, mut even, mut odd, mut point, mut slope] =
            core::array::from_fn(|_| self.zeros.clone());
        let parts = const { parts_with_ends(N) };
        let mut eta = h * parts[0];
        let mut elapsed = eta;
        for (lanes, y) in start.as_mut_slice().iter_mut().zip(y) {
            *lanes = F64x4::splat(*y);
        }
        for (odd, f) in odd.as_mut_slice().iter_mut().zip(f) {
            *odd = eta * F64x4::splat(*f);
        }
        let ends = (&mut point, &mut slope);
        Self::substep(&self.system, (t + elapsed, eta), (&start, &odd, &mut even), ends);
        for part in &parts[1..N] {
            eta = h * *part;
            elapsed += eta;
            let ends = (&mut point, &mut slope);
            Self::substep(&self.system, (t + elapsed, eta), (&start, &even, &mut odd), ends);
            elapsed += eta;
            let ends = (&mut point, &mut slope);
            Self::substep(&self.system, (t + elapsed, eta), (&start, &odd, &mut even), ends);
        }
        even
    }

    /// A step with [`FEW`] rows.
    #[inline(never)]
    fn advance_with_few<S: System<f64, State = V>>(&mut self, step: &mut Step<'_, f64, S>) {
        let even = self.side_by_side::<FEW>(step.t, step.h, step.from);
        let per_h = step.h.recip();
        let from = step.from.state.as_slice().iter().zip(step.from.residue.as_slice());
        let to = step.to.state.as_mut_slice().iter_mut().zip(step.to.residue.as_mut_slice());
        let out = to.zip(self.estimate[0].as_mut_slice());
        for (((y, lacks), ((state, residue), estimate)), even) in from.zip(out).zip(even.as_slice()) {
            let even = even.to_array();
            let sum = |k: usize| {
                let terms = even.iter().enumerate();
                terms.fold(0.0, |sum, (lane, row)| sum + WEIGHTS_OF_FEW[FEW - lane][k] * row)
            };
            (*state, *residue) = two_sum(*y, sum(0) + lacks);
            *estimate = sum(1) * per_h;
        }
    }

    /// The derivative at the end of a step; all lanes have it.
    #[inline(always)]
    fn slope(&self, t: f64, end: &mut Point<V>) {
        let [mut state, mut slope] = [self.zeros.clone(), self.zeros.clone()];
        for (lanes, y) in state.as_mut_slice().iter_mut().zip(end.state.as_slice()) {
            *lanes = F64x4::splat(*y);
        }
        self.system.rhs(F64x4::splat(t), &state, &mut slope);
        for (slope, lanes) in end.slope.as_mut_slice().iter_mut().zip(slope.as_slice()) {
            *slope = lanes.lane(0);
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
        validate(options)
    }

    fn storage(&self, system: &S, _t0: f64, y0: &S::State, _options: &Options<f64>) -> Self::Storage {
        let zeros = S::state_over(y0, |_| F64x4::ZERO);
        Rows { system: system.over(F64x4::splat), zeros, estimate: [y0.zeros_like()], short: None }
    }

    #[inline]
    fn stages(storage: &Self::Storage) -> &[S::State] {
        &storage.estimate
    }

    #[inline]
    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
        &mut storage.estimate
    }

    fn restart(&self, storage: &mut Self::Storage, _system: &S, _t: f64, _y: &S::State) {
        storage.short = None;
    }

    /// In lanes, which wait less than a scalar whose operations the compiler packs into registers.
    #[inline]
    fn slope(&self, storage: &mut Self::Storage, _system: &S, t: f64, end: &mut Point<S::State>) {
        storage.slope(t, end);
    }

    #[inline]
    fn first_step(&self, storage: &mut Self::Storage, start: Start<'_, f64, S>, trial: f64) -> Option<f64> {
        // Where the rows do not converge, the trial is too long.
        let mut start = start;
        storage.first_step(&mut start, trial).or_else(|| storage.first_step(&mut start, 0.2 * trial))
    }

    #[inline]
    fn mean_square_error(
        storage: &Self::Storage,
        h: f64,
        rtol: &S::State,
        atol: &S::State,
        ends: [&S::State; 2],
    ) -> Option<f64> {
        Some(storage.mean_square_error(h, [rtol, atol], ends))
    }

    #[inline]
    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, f64, S>) -> Result<(), Error> {
        let is_short = |short: Short| step.t == short.t && step.h.abs() <= short.longest;
        if storage.short.is_some_and(is_short) {
            storage.advance_with_few(step);
            *step.rhs_evals += 2 * FEW as u64 - 1;
        } else {
            storage.advance(step);
            *step.rhs_evals += 13;
        }
        Ok(())
    }
}
