//! The search for the minimum: from several points, over longer and longer parts of the time, or by pieces of it.
//!
//! Does not know: tables, the texts of a fit.

use super::bounded::{Bounded, minimise_within};
use super::request::{Column, FitRequest, Started};
use super::residuals::{Motions, cells};
use super::verdict::{Judged, Verdict};
use super::{segments, starts};
use crate::direction::Direction;
use crate::error::Error;
use crate::least_squares::{End, Linearised, precision};

/// Parts of the time of a table that are fitted before all of it: over a tenth of it, and then over a third.
const HORIZONS: [f64; 2] = [0.1, 1.0 / 3.0];

/// Difference of two sums of squares, relative to them, below which two searches have found one minimum.
const SAME: f64 = 1e-6;

/// The end of a search, or why its start has no residuals.
type Outcome = Result<Bounded<Error>, Error>;

/// The best minimum of the searches from all starts, and how each of them ended.
///
/// # Errors
/// Why the first start has no residuals, where no search has found a minimum.
pub(super) fn search(
    motions: &mut Motions<'_>,
    request: &FitRequest,
) -> Result<(Bounded<Error>, Vec<Started>), Error> {
    let first = start(request);
    let all = std::iter::once(first.clone()).chain(starts::others(request, &first));
    let found: Vec<(Vec<f64>, Outcome)> =
        all.map(|from| (from.clone(), search_from(motions, request, from))).collect();
    let sum = |found: &Outcome| match found {
        Ok(found) if found.end == End::Minimum => Some(found.at.residuals.norm_squared()),
        _ => None,
    };
    let sums: Vec<Option<f64>> = found.iter().map(|(_, found)| sum(found)).collect();
    let rank = |k: &usize| sums[*k].unwrap_or(f64::INFINITY);
    let best = (0..found.len()).min_by(|i, j| rank(i).total_cmp(&rank(j))).unwrap_or_default();
    let is_same = |own: &Option<f64>| match (own, sums[best]) {
        (Some(own), Some(best)) => own - best <= SAME * best + f64::MIN_POSITIVE,
        _ => false,
    };
    let of_starts = found.iter().zip(&sums);
    let started = of_starts
        .map(|((from, _), sum)| Started { from: from.clone(), sum_of_squares: *sum, is_same: is_same(sum) })
        .collect();
    let (_, best) = found.into_iter().nth(best).expect("the first start is always there");
    Ok((best?, started))
}

/// The minimum near one start.
fn search_from(motions: &mut Motions<'_>, request: &FitRequest, start: Vec<f64>) -> Outcome {
    let intervals: Vec<[f64; 2]> = request.known.iter().map(|known| [known.least, known.most]).collect();
    let near = match request.segments {
        0 | 1 => over_horizons(motions, request, &start, &intervals),
        _ => segments::by_segments(motions, request, &start),
    };
    let mut from =
        |near: &[f64]| minimise_within(near, &intervals, &mut |x: &[f64]| motions.linearised(request, x));
    match from(&near) {
        Ok(found) if found.end == End::Minimum && !verdict(request, &found.at).is_poor => Ok(found),
        found if near == start => found,
        // The long motion alone may know better.
        found => better(found, from(&start)),
    }
}

/// Over a short time the sum of squares has few minima, of which the one that is found is near the right one of the
/// next longer time.
fn over_horizons(
    motions: &mut Motions<'_>,
    request: &FitRequest,
    start: &[f64],
    intervals: &[[f64; 2]],
) -> Vec<f64> {
    let mut near = start.to_vec();
    for part in HORIZONS {
        let Some(shorter) = until(request, part) else { continue };
        let found = minimise_within(&near, intervals, &mut |x: &[f64]| motions.linearised(&shorter, x));
        // A short motion may not determine everything.
        let found =
            found.ok().filter(|found| found.end == End::Minimum && precision(&found.at.jacobian).is_ok());
        near = found.map_or(near, |found| found.x);
    }
    near
}

/// The request with the first part of its table, unless it has too few values for the unknowns.
fn until(request: &FitRequest, part: f64) -> Option<FitRequest> {
    let end = part * request.times.last()?;
    let n = request.times.iter().take_while(|t| **t <= end).count();
    let (times, values) = (request.times[..n].to_vec(), request.values[..n].to_vec());
    let shorter = FitRequest { times, values, ..request.clone() };
    (cells(&shorter).count() > 2 * request.free.len()).then_some(shorter)
}

/// The one of two ends of a search with the smaller sum of squares at a minimum.
fn better(one: Outcome, other: Outcome) -> Outcome {
    let (one, other) = match (one, other) {
        (Ok(one), Ok(other)) => (one, other),
        (found, Err(_)) | (Err(_), found) => return found,
    };
    let rank = |found: &Bounded<Error>| (found.end != End::Minimum, found.at.residuals.norm_squared());
    Ok(if rank(&other) < rank(&one) { other } else { one })
}

/// What the residuals of a minimum say.
pub(super) fn verdict(request: &FitRequest, at: &Linearised) -> Verdict {
    let left = |c: usize, column: &Column| -> Vec<(f64, f64)> {
        let sigma = column.sigma.unwrap_or(1.0);
        let cells = cells(request).zip(at.residuals.iter()).filter(|((_, at, _), _)| *at == c);
        cells.map(|((_, _, value), r)| (value, r * sigma)).collect()
    };
    let columns = request.columns.iter().enumerate();
    let judged = columns.map(|(c, column)| Judged { cells: left(c, column), sigma: column.sigma });
    Verdict::of(&judged.collect::<Vec<_>>())
}

/// Values of the unknowns where the search starts.
fn start(request: &FitRequest) -> Vec<f64> {
    let value = |direction: &Direction| match direction {
        Direction::Param(k) => request.params[*k],
        Direction::Initial(k) => request.initial[*k],
    };
    request.free.iter().map(value).collect()
}
