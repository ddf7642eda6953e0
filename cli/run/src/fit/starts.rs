//! Points from which a search starts again.
//!
//! Does not know: residuals.

use hamel_expr::split_mix;

use super::request::{FitRequest, Known};

/// Other points than the one of the request, always the same: within intervals and within two standard deviations of
/// priors; a value that nothing is known of lies within a factor of three, one that is zero between -1 and 1.
///
/// # Source
/// McKay, Beckman and Conover, A comparison of three methods for selecting values of input variables (1979): each
/// unknown has one value in each of as many strata as there are points.
pub(super) fn others(request: &FitRequest, start: &[f64]) -> Vec<Vec<f64>> {
    let n = request.restarts;
    let mut seed = 0x5eed;
    let mut points = vec![Vec::with_capacity(start.len()); n];
    for (known, start) in request.known.iter().zip(start) {
        let mut strata: Vec<usize> = (0..n).collect();
        for k in (1..n).rev() {
            strata.swap(k, (split_mix(&mut seed) % (k as u64 + 1)) as usize);
        }
        for (point, stratum) in points.iter_mut().zip(strata) {
            let part = (split_mix(&mut seed) >> 11) as f64 / (1_u64 << 53) as f64;
            point.push(value(known, *start, (stratum as f64 + part) / n as f64));
        }
    }
    points
}

/// The value of an unknown at a part of its range.
fn value(known: &Known, start: f64, part: f64) -> f64 {
    let Known { least, most, prior } = *known;
    let value = match prior {
        Some(prior) => prior.mean + prior.deviation * (4.0 * part - 2.0),
        None if least > 0.0 && most < f64::INFINITY && most > 10.0 * least => {
            least * (most / least).powf(part)
        }
        None if least > f64::NEG_INFINITY && most < f64::INFINITY => least + (most - least) * part,
        None if start == 0.0 => 2.0 * part - 1.0,
        None => start * 3.0_f64.powf(2.0 * part - 1.0),
    };
    value.clamp(least, most)
}
