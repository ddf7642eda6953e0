//! Norms of errors in units of their tolerances, and passes over the components of a state.
//!
//! Does not know the integrator, or what a norm decides.

use crate::methods::{Constant, Derivatives, Tolerances, larger, square_of_norm};
use crate::options::Norm;
use crate::real::Real;
use crate::system::StateVector;

#[inline]
pub(super) fn copy<R: Real, V: StateVector<R>>(from: &V, to: &mut V) {
    for (to, from) in to.as_mut_slice().iter_mut().zip(from.as_slice()) {
        *to = *from;
    }
}

/// Whether no component is infinite or NaN, without branches.
#[inline]
pub(super) fn all_finite<R: Real, V: StateVector<R>>(v: &V) -> bool {
    v.as_slice().iter().fold(true, |finite, x| finite & x.all_finite())
}

/// Whether small powers of all components are finite, without branches.
#[inline]
pub(super) fn all_moderate<R: Real, V: StateVector<R>>(v: &V) -> bool {
    // The fourth power of the first is finite in `f64`, that of the second in `f32`.
    let [large, single] = [1e75, 1e9].map(R::from_f64);
    let bound = if large.all_finite() { large } else { single };
    v.as_slice().iter().fold(true, |moderate, x| moderate & bound.all_ge(x.abs()))
}

/// Position of the first component that is infinite or NaN.
pub(super) fn non_finite<R: Real, V: StateVector<R>>(v: &V) -> Option<usize> {
    v.as_slice().iter().position(|x| !x.all_finite())
}

/// `out = y + h sum_j row_j k_j`, for rows that are not known to the compiler.
pub(super) fn stage_point<R: Real, V: StateVector<R>>(
    k: &Derivatives<'_, V>,
    row: &[(usize, Constant)],
    y: &V,
    h: R,
    out: &mut V,
) {
    let (y, out) = (y.as_slice(), out.as_mut_slice());
    k.for_each_sum(row, y.len(), |c, slope| out[c] = h.mul_add(slope, y[c]));
}

/// The tolerances `atol_i + rtol_i max(|a_i|, |b_i|)`, whose reciprocals are written to `reciprocals`.
#[inline(always)]
pub(super) fn tolerances<'a, R: Real, V: StateVector<R>>(
    rtol: &'a V,
    atol: &'a V,
    ends: [&'a V; 2],
    reciprocals: &'a mut V,
) -> Tolerances<'a, V> {
    let tolerances = rtol.as_slice().iter().zip(atol.as_slice());
    let states = ends[0].as_slice().iter().zip(ends[1].as_slice());
    for ((out, (&rtol, &atol)), (&a, &b)) in reciprocals.as_mut_slice().iter_mut().zip(tolerances).zip(states)
    {
        *out = rtol.mul_add(larger(a, b), atol).recip();
    }
    Tolerances { rtol, atol, ends, reciprocals }
}

/// Square of the norm of the scaled `sum_j row_j k_j`; infinite or NaN where a reciprocal is not in range.
#[inline(always)]
pub(super) fn weighted_square<R: Real, V: StateVector<R>>(
    norm: Norm,
    row: &[(usize, Constant)],
    k: &Derivatives<'_, V>,
    tolerances: &Tolerances<'_, V>,
    work: &mut V,
) -> f64 {
    // The second estimate of methods that have one.
    if row.is_empty() {
        return 0.0;
    }
    let (scales, out) = (tolerances.reciprocals.as_slice(), work.as_mut_slice());
    k.for_each_sum(row, scales.len(), |c, error| out[c] = error * scales[c]);
    square_of_norm(norm, out)
}

/// The same of `h sum_j row_j k_j`, for states and times of any scale.
#[cold]
#[inline(never)]
pub(super) fn square_within_range<R: Real, V: StateVector<R>>(
    norm: Norm,
    row: &[(usize, Constant)],
    k: &Derivatives<'_, V>,
    tolerances: &Tolerances<'_, V>,
    h: R,
    work: &mut V,
) -> f64 {
    let out = work.as_mut_slice();
    k.for_each_sum(row, out.len(), |c, error| out[c] = tolerances.scaled_within_range(c, h * error));
    square_of_norm(norm, out)
}

/// Norm of `component(c)` after scaling.
pub(super) fn scaled_norm<R: Real, V: StateVector<R>>(
    norm: Norm,
    tolerances: &Tolerances<'_, V>,
    out: &mut [R],
    component: impl Fn(usize) -> R,
) -> f64 {
    for (c, out) in out.iter_mut().enumerate() {
        *out = tolerances.scaled(c, component(c));
    }
    crate::math::sqrt(square_of_norm(norm, out))
}
