//! How much the values of a function at a few places say about it: that it is not zero in between, that it changes its
//! sign once at most, or nothing.
//!
//! Does not know where the values come from, directions of events.

/// Places in a part of a step at which event functions are looked at, both ends included: at distances of no common
/// measure, so that no oscillation looks the same at all of them.
pub(super) const PLACES: [f64; 7] = [0.0, 0.0871, 0.2764, 0.4913, 0.7183, 0.9098, 1.0];

/// Number of [`PLACES`].
pub(super) const N_PLACES: usize = PLACES.len();

/// Largest difference of a value and the cubic through others, in parts of the spread of all, of a function that is
/// resolved. A sine has it over half a period.
const RESOLVED: f64 = 0.05;

/// Distance from zero, in parts of the spread, from which on a resolved function does not reach zero.
const FAR: f64 = 0.5;

/// The same of a function that is not known to be resolved. A sine has seven values that are so far from zero, compared
/// with their spread, once in a hundred thousand times.
const FAR_WHATEVER: f64 = 4.0;

/// Weights of the values at places 0, 2, 4 and 6 in that of the cubic through them at places 1, 3 and 5.
const WEIGHTS: [[f64; 4]; 3] = [weights(1), weights(3), weights(5)];

const fn weights(place: usize) -> [f64; 4] {
    let (mut weights, mut k) = ([1.0; 4], 0);
    while k < 4 {
        let mut other = 0;
        while other < 4 {
            if other != k {
                weights[k] *= (PLACES[place] - PLACES[2 * other]) / (PLACES[2 * k] - PLACES[2 * other]);
            }
            other += 1;
        }
        k += 1;
    }
    weights
}

/// What the values of a function at [`PLACES`] say about its zeros.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// It has none.
    Clear,
    /// It changes its sign once at most.
    Simple,
    /// It has one sign, and comes close to zero around this place, between places of the same sign.
    Turns(f64),
    /// The places are too far apart.
    Rough,
}

/// Judges a function by its values, of which a spread up to `noise` is rounding.
pub(super) fn judge(values: [f64; N_PLACES], noise: f64) -> Verdict {
    if values.iter().any(|value| !value.is_finite()) {
        return Verdict::Rough;
    }
    let largest = values.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b));
    let least = values.iter().fold(f64::INFINITY, |a, b| a.min(*b));
    let (spread, distance) = (largest - least, least.max(-largest));
    if distance > FAR_WHATEVER * spread {
        return Verdict::Clear;
    }
    let error = WEIGHTS.iter().zip([1, 3, 5]).map(|(weights, place)| {
        let cubic: f64 = weights.iter().zip([0, 2, 4, 6]).map(|(w, k)| w * values[k]).sum();
        (values[place] - cubic).abs()
    });
    let error = error.fold(0.0, f64::max);
    if spread <= noise {
        return Verdict::Simple;
    }
    if error > RESOLVED * spread {
        return Verdict::Rough;
    }
    if distance > FAR * spread {
        return Verdict::Clear;
    }
    if distance > 0.0 {
        return nearest(&values).map_or(Verdict::Clear, Verdict::Turns);
    }
    if n_changes(&values) > 1 { Verdict::Rough } else { Verdict::Simple }
}

/// How often the sign changes; zeros have none.
fn n_changes(values: &[f64; N_PLACES]) -> usize {
    let mut signs = values.iter().filter(|value| **value != 0.0).map(|value| *value > 0.0);
    let Some(mut last) = signs.next() else { return 0 };
    signs.filter(|sign| core::mem::replace(&mut last, *sign) != *sign).count()
}

/// Where values of one sign seem to come closest to zero, or to pass it, between their places: the lowest vertex of a
/// parabola through three of them that is closer than a quarter of these.
fn nearest(values: &[f64; N_PLACES]) -> Option<f64> {
    let mut best: Option<(f64, f64)> = None;
    for k in 1..N_PLACES - 1 {
        let at = |j: usize| (PLACES[j], values[j].abs());
        let triple = [at(k - 1), at(k), at(k + 1)];
        let least = triple.iter().fold(f64::INFINITY, |a, (_, y)| a.min(*y));
        let Some((x, y)) = vertex(triple) else { continue };
        let is_inside = x > triple[0].0 && x < triple[2].0;
        if is_inside && y < 0.25 * least && best.is_none_or(|(_, lowest)| y < lowest) {
            best = Some((x, y));
        }
    }
    best.map(|(x, _)| x)
}

/// The vertex of the parabola through three points, if it opens upwards.
pub(super) fn vertex([(a, at_a), (b, at_b), (c, at_c)]: [(f64, f64); 3]) -> Option<(f64, f64)> {
    let (first, second) = ((at_b - at_a) / (b - a), (at_c - at_b) / (c - b));
    let bend = (second - first) / (c - a);
    // Slope at `b`.
    let slope = first + bend * (b - a);
    (bend > 0.0).then(|| (b - 0.5 * slope / bend, at_b - 0.25 * slope * slope / bend))
}

#[cfg(test)]
mod tests {
    use super::{PLACES, Verdict, judge};

    fn judged(f: impl Fn(f64) -> f64) -> Verdict {
        judge(PLACES.map(f), 0.0)
    }

    #[test]
    fn functions_are_judged_by_their_values() {
        assert_eq!(judged(|_| 1.0), Verdict::Clear);
        assert_eq!(judged(|x| x + 0.6), Verdict::Clear);
        assert_eq!(judged(|x| -10.0 - x * x), Verdict::Clear);
        assert_eq!(judged(|x| x - 0.3), Verdict::Simple);
        assert_eq!(judged(|x| (3.0 * x).cos()), Verdict::Simple);
        assert_eq!(judged(|x| (x - 0.3) * (x - 0.6)), Verdict::Rough);
        assert_eq!(judged(|x| (x - 0.3).abs() + 1e-9), Verdict::Rough);
        assert_eq!(judge(PLACES.map(|x| -x), 0.0), Verdict::Simple);
        for sign in [1.0, -1.0] {
            let Verdict::Turns(x) = judged(|x| sign * ((x - 0.38) * (x - 0.38) - 1e-4)) else { panic!() };
            assert!((x - 0.38).abs() < 1e-12);
        }
        assert_eq!(judged(|x| x.powi(7)), Verdict::Rough);
        assert_eq!(judged(|x| (x - 0.5).sqrt()), Verdict::Rough);
    }

    #[test]
    fn an_oscillation_is_rough_whatever_its_frequency() {
        let mut n = 0;
        for k in 1..20_000 {
            let (w, phase) = (6.0 + 0.37 * f64::from(k), 0.61 * f64::from(k));
            n += u32::from(judged(|x| (w * x + phase).sin()) != Verdict::Rough);
        }
        // By chance, where the first periods are those that are almost resolved.
        assert!(n < 40, "{n}");
    }
}
