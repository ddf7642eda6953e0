//! The inner loops of collocation with its stages in lanes, over the components of a state.
//!
//! Does not know the coefficients, when an iteration ends, or which registers the processor has.

use crate::lanes::F64x4;
use crate::real::Real;

/// Number of stages, in the lanes of two halves.
pub(super) const STAGES: usize = 8;

/// Weights of all stages in the stages of a half.
pub type StageRow = [F64x4; STAGES];

/// What a sweep over the points of a half has found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moved {
    /// Whether a point is not what it was.
    pub has_moved: bool,
    /// Whether all changes are finite.
    pub is_finite: bool,
}

/// The inner loops of [`Gauss16`](crate::Gauss16), for programs that find at run time which registers a processor has:
/// a method with loops of one's own is a [`Gauss16With`](crate::Gauss16With).
///
/// Every number is to have the bits that the loops of the crate give, [`OwnLoops`]: the same sums in the same order. In
///
/// ```text
/// sum(s, w, x) = (s + w_0 x_0 + .. + w_3 x_3) + (w_4 x_4 + .. + w_7 x_7)
/// ```
///
/// a term is added to the sum of those before, and `x_j` is a component of the stage `j`: lane `j mod 4` of half
/// `j/4`. All slices of a call have the same length, the dimension of the state.
pub trait StageLoops: Copy {
    /// Points of a half, and by how much they change:
    ///
    /// ```text
    /// points = y + sum(residue, row, increments),    changes = max(changes, |points - points before|)
    /// ```
    ///
    /// Changes are of no account where one is not finite.
    fn points(
        self,
        row: &StageRow,
        from: (&[f64], &[f64]),
        increments: [&[F64x4]; 2],
        points: &mut [F64x4],
        changes: &mut [F64x4],
    ) -> Moved;

    /// `increments = weight slopes`.
    fn weigh(self, weight: F64x4, slopes: &[F64x4], increments: &mut [F64x4]);

    /// Increments of the halves of a step by the increments of another:
    ///
    /// ```text
    /// increments = sum(ends_0 slopes_0 + ends_1 slopes_1, rows, increments before)
    /// ```
    fn extrapolate(
        self,
        rows: &[StageRow; 2],
        ends: &[[F64x4; 2]; 2],
        slopes: [&[f64]; 2],
        increments: [&mut [F64x4]; 2],
    );

    /// Writes the largest change of each component to `least` where that is larger and the change is not zero; whether
    /// it has written any. The changes are finite.
    fn progress(self, changes: &[F64x4], least: &mut [f64]) -> bool;
}

/// The loops of the crate, in the registers it was compiled for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OwnLoops;

/// All stages of a component.
#[inline(always)]
pub(super) fn stages(halves: [&[F64x4]; 2], c: usize) -> [f64; STAGES] {
    let [[a, b, c, d], [e, f, g, h]] = halves.map(|half| half[c].to_array());
    [a, b, c, d, e, f, g, h]
}

/// `start + sum_j row_j x_j`, in two sums that need not wait for each other.
#[inline(always)]
fn sum(start: F64x4, row: &StageRow, x: &[f64; STAGES]) -> F64x4 {
    let (mut first, mut second) = (start, row[4] * F64x4::splat(x[4]));
    for j in 0..4 {
        first = row[j].mul_add(F64x4::splat(x[j]), first);
    }
    for j in 5..STAGES {
        second = row[j].mul_add(F64x4::splat(x[j]), second);
    }
    first + second
}

impl StageLoops for OwnLoops {
    #[inline(always)]
    fn points(
        self,
        row: &StageRow,
        (y, residue): (&[f64], &[f64]),
        increments: [&[F64x4]; 2],
        points: &mut [F64x4],
        changes: &mut [F64x4],
    ) -> Moved {
        let (mut has_moved, mut is_finite) = (false, true);
        for (c, (point, largest)) in points.iter_mut().zip(changes).enumerate() {
            let before = *point;
            *point = F64x4::splat(y[c]) + sum(F64x4::splat(residue[c]), row, &stages(increments, c));
            let change = (*point - before).abs();
            has_moved |= change != F64x4::ZERO;
            is_finite &= change.all_finite();
            *largest = largest.max(change);
        }
        Moved { has_moved, is_finite }
    }

    #[inline(always)]
    fn weigh(self, weight: F64x4, slopes: &[F64x4], increments: &mut [F64x4]) {
        for (increment, slope) in increments.iter_mut().zip(slopes) {
            *increment = weight * *slope;
        }
    }

    #[inline(always)]
    fn extrapolate(
        self,
        rows: &[StageRow; 2],
        ends: &[[F64x4; 2]; 2],
        [start, end]: [&[f64]; 2],
        [low, high]: [&mut [F64x4]; 2],
    ) {
        for c in 0..low.len() {
            let known = stages([low, high], c);
            let of_half = |half: usize| {
                let [first, last] = ends[half];
                sum(first * F64x4::splat(start[c]) + last * F64x4::splat(end[c]), &rows[half], &known)
            };
            (low[c], high[c]) = (of_half(0), of_half(1));
        }
    }

    #[inline(always)]
    fn progress(self, changes: &[F64x4], least: &mut [f64]) -> bool {
        let mut has_progress = false;
        for (change, least) in changes.iter().zip(least) {
            let change = change.magnitude();
            if change > 0.0 && change < *least {
                (*least, has_progress) = (change, true);
            }
        }
        has_progress
    }
}
