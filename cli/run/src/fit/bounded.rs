//! Least squares with unknowns that are kept in intervals.
//!
//! Does not know: what the residuals are residuals of.

use nalgebra::DVector;

use crate::least_squares::{End, Evaluate, Found, Linearised, ORTHOGONAL, PATIENCE, minimise, slope_by};

/// A minimum within intervals.
#[derive(Clone, Debug)]
pub(super) struct Bounded<E> {
    pub(super) x: Vec<f64>,
    pub(super) at: Linearised,
    pub(super) end: End,
    /// Which unknowns are at an end of their interval, with a sum of squares that falls beyond it.
    pub(super) is_held: Vec<bool>,
    /// Why the last point without residuals has none.
    pub(super) refused: Option<E>,
}

/// Why a point has no residuals.
enum Refused<E> {
    Outside,
    Model(E),
}

/// The minimum of `sum_i r_i(x)^2` for `a_j <= x_j <= b_j` near the point of the intervals that is nearest to a start.
///
/// Where the search is stopped by an end of an interval, the unknown of the first end on the way of Gauss and Newton's
/// step is held there; it is let go where the sum of squares falls into the interval (Nocedal and Wright 2006, section
/// 16.5, the active set).
///
/// # Errors
/// That of `evaluate` at the start.
pub(super) fn minimise_within<E>(
    start: &[f64],
    intervals: &[[f64; 2]],
    evaluate: &mut Evaluate<'_, E>,
) -> Result<Bounded<E>, E> {
    let n = start.len();
    let within = start.iter().zip(intervals).map(|(x, [least, most])| x.clamp(*least, *most));
    let (mut x, mut refused) = (within.collect::<Vec<f64>>(), None);
    let mut is_held = vec![false; n];
    // Each unknown is held and let go a few times at most, unless the search goes in circles.
    for _ in 0..4 * n + 4 {
        let loose: Vec<usize> = (0..n).filter(|k| !is_held[*k]).collect();
        let found = minimise_along(&loose, &x, intervals, (&mut refused, evaluate))?;
        let was_outside = matches!(refused, Some(Refused::Outside));
        loose.iter().zip(&found.x).for_each(|(k, value)| x[*k] = *value);
        let at = if loose.len() == n { found.at } else { evaluate(&x)? };
        let next = match found.end {
            End::Edge if was_outside => first_end(&x, &loose, &at, intervals).map(|(k, end)| {
                x[k] = end;
                (k, true)
            }),
            End::Minimum => (0..n).filter(|k| is_held[*k]).find_map(|k| falls_inward(&x, k, &at, intervals)),
            End::Edge | End::Patience => None,
        };
        match next {
            Some((k, holds)) => is_held[k] = holds,
            None => {
                let refused = match refused {
                    Some(Refused::Model(error)) => Some(error),
                    Some(Refused::Outside) | None => None,
                };
                return Ok(Bounded { x, at, end: found.end, is_held, refused });
            }
        }
        refused = None;
    }
    let at = evaluate(&x)?;
    Ok(Bounded { x, at, end: End::Patience, is_held, refused: None })
}

/// The minimum along some of the unknowns.
fn minimise_along<E>(
    loose: &[usize],
    x: &[f64],
    intervals: &[[f64; 2]],
    (refused, evaluate): (&mut Option<Refused<E>>, &mut Evaluate<'_, E>),
) -> Result<Found, E> {
    if loose.is_empty() {
        return Ok(Found { x: Vec::new(), at: evaluate(x)?, end: End::Minimum });
    }
    let start: Vec<f64> = loose.iter().map(|k| x[*k]).collect();
    let mut whole = x.to_vec();
    let found = minimise(&start, PATIENCE, refused, &mut |values: &[f64]| {
        loose.iter().zip(values).for_each(|(k, value)| whole[*k] = *value);
        if loose.iter().any(|k| whole[*k] < intervals[*k][0] || whole[*k] > intervals[*k][1]) {
            return Err(Refused::Outside);
        }
        let at = evaluate(&whole).map_err(Refused::Model)?;
        let jacobian =
            if loose.len() == whole.len() { at.jacobian } else { at.jacobian.select_columns(loose) };
        Ok(Linearised { residuals: at.residuals, jacobian })
    });
    found.map_err(|error| match error {
        Refused::Model(error) => error,
        // The start was moved into the intervals.
        Refused::Outside => unreachable!("the search starts within the intervals"),
    })
}

/// The end of an interval that the step of Gauss and Newton comes to first.
fn first_end(x: &[f64], loose: &[usize], at: &Linearised, intervals: &[[f64; 2]]) -> Option<(usize, f64)> {
    let jacobian = at.jacobian.select_columns(loose);
    let right: DVector<f64> = -&at.residuals;
    let least = f64::EPSILON * jacobian.amax() * jacobian.nrows() as f64;
    let step = jacobian.svd(true, true).solve(&right, least).ok()?;
    let ends = loose.iter().zip(step.iter()).filter_map(|(k, step)| {
        let end = intervals[*k][usize::from(*step > 0.0)];
        let part = (end - x[*k]) / step;
        (part.is_finite() && part <= 1.0).then_some((*k, end, part))
    });
    ends.min_by(|one, other| one.2.total_cmp(&other.2)).map(|(k, end, _)| (k, end))
}

/// An unknown that is held where the sum of squares falls into its interval.
fn falls_inward(x: &[f64], k: usize, at: &Linearised, intervals: &[[f64; 2]]) -> Option<(usize, bool)> {
    let slope = slope_by(at, k);
    let is_inward = if x[k] == intervals[k][0] { slope < 0.0 } else { slope > 0.0 };
    (is_inward && slope.abs() > ORTHOGONAL).then_some((k, false))
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::minimise_within;
    use crate::least_squares::{End, Linearised};

    /// `a + b i + c i^2` through points whose parabola is `1 - 2 i + i^2/2`.
    fn parabola(x: &[f64]) -> Result<Linearised, String> {
        let row = |i: usize| [1.0, i as f64, (i * i) as f64];
        let value = |x: &[f64], i: usize| row(i).iter().zip(x).map(|(r, x)| r * x).sum::<f64>();
        Ok(Linearised {
            residuals: DVector::from_fn(6, |i, _| value(x, i) - value(&[1.0, -2.0, 0.5], i)),
            jacobian: DMatrix::from_fn(6, 3, |i, j| row(i)[j]),
        })
    }

    /// The minimum within intervals is that of the ends it is held at, by the equations of the others.
    #[test]
    fn ends_of_intervals_hold_what_falls_beyond_them_alone() {
        let free = [f64::NEG_INFINITY, f64::INFINITY];
        let found = minimise_within(&[0.0; 3], &[free; 3], &mut parabola).unwrap();
        assert_eq!((found.end, found.is_held), (End::Minimum, vec![false; 3]));
        for (x, exact) in found.x.iter().zip([1.0, -2.0, 0.5]) {
            assert!((x - exact).abs() < 1e-9, "{:?}", found.x);
        }
        let intervals = [free, [-1.5, 4.0], [0.0, 10.0]];
        let found = minimise_within(&[0.0, 3.0, 9.0], &intervals, &mut parabola).unwrap();
        assert_eq!((found.end, &found.is_held), (End::Minimum, &vec![false, true, false]), "{:?}", found.x);
        assert_eq!(found.x[1], -1.5);
        let slopes = found.at.jacobian.transpose() * &found.at.residuals;
        // The sum falls towards smaller b, and is level along a and c.
        assert!(slopes[1] > 1e-3 && slopes[0].abs() < 1e-9 && slopes[2].abs() < 1e-9, "{slopes:?}");
        // Everything is held.
        let found =
            minimise_within(&[3.0, 3.0, 3.0], &[[2.0, 4.0], [2.0, 4.0], [2.0, 4.0]], &mut parabola).unwrap();
        assert_eq!((found.x, found.is_held), (vec![2.0; 3], vec![true; 3]));
    }

    /// A minimum of a convex sum is one where no slope leads into an interval (Karush, Kuhn and Tucker), whatever was
    /// held and let go on the way.
    #[test]
    fn minima_within_random_intervals_have_no_slope_inward() {
        let mut seed = 7;
        let mut random = move || (hamel_expr::split_mix(&mut seed) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0;
        let mut n_held = 0;
        for _ in 0..200 {
            let jacobian = DMatrix::from_fn(6, 4, |_, _| random());
            let data = DVector::from_fn(6, |_, _| 3.0 * random());
            let ends: Vec<[f64; 2]> = (0..4).map(|_| [random() - 1.0, random() + 1.0]).collect();
            let start: Vec<f64> = ends.iter().map(|[a, b]| (a + b) / 2.0).collect();
            let mut linear = |x: &[f64]| -> Result<Linearised, String> {
                let residuals = &jacobian * DVector::from_column_slice(x) - &data;
                Ok(Linearised { residuals, jacobian: jacobian.clone() })
            };
            let found = minimise_within(&start, &ends, &mut linear).unwrap();
            assert_eq!(found.end, End::Minimum, "{:?} {:?}", found.x, ends);
            let slopes = found.at.jacobian.transpose() * &found.at.residuals;
            for (k, [a, b]) in ends.iter().enumerate() {
                let (x, slope) = (found.x[k], slopes[k]);
                let is_right = match found.is_held[k] {
                    true if x == *a => slope >= 0.0,
                    true => x == *b && slope <= 0.0,
                    // Cosines of 1e-4 are level.
                    false => slope.abs() < 1e-2 && (*a..=*b).contains(&x),
                };
                assert!(is_right, "{k}: {:?} {:?} {ends:?} {slopes:?}", found.x, found.is_held);
                n_held += usize::from(found.is_held[k]);
            }
        }
        assert!(n_held > 100, "{n_held}");
    }
}
