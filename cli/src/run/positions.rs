//! Coordinates that satisfy the equations between coordinates of a model, found by Newton's method.
//!
//! Does not know: who evaluates a scene, velocities, requests.

use std::collections::BTreeMap;
use std::ops::Range;

use super::admissible::{Outcome, Outputs, least_change};
use crate::error::Error;
use crate::model::Model;
use crate::model::roles::Role;

/// Most steps of Newton's method, and halvings of one of them.
const MAX_ROUNDS: usize = 60;
/// Part of the unit of a coordinate over which slopes are measured, a power of two near the third root of rounding.
const STEP: f64 = 1.0 / 131_072.0;
/// Residual, by the size of its slopes and a unit of the coordinates, up to which an equation is met.
const MET: f64 = 1e-12;

/// How many equations between coordinates a model has, and the coordinates that it gives by some of them.
#[derive(Clone, Debug, Default)]
pub struct Equations {
    n: usize,
    determined: Vec<String>,
}

impl Equations {
    /// Those of a model.
    pub fn of(model: &Model) -> Equations {
        let positions: Vec<_> = model.constraints.iter().filter_map(|c| c.position).collect();
        let coordinates = positions.iter().filter_map(|p| p.determines);
        let determined = coordinates.map(|k| model.base[k].name.clone()).collect();
        Equations { n: positions.len(), determined }
    }

    /// Where their residuals are among outputs, given where those of all constraints are: behind the others.
    pub(crate) fn residuals(&self, constraint: &Range<usize>) -> Option<Range<usize>> {
        (self.n > 0 && self.n <= constraint.len()).then(|| constraint.end - self.n..constraint.end)
    }

    /// The components of a state that may be moved: coordinates that the equations give where these are enough, and
    /// otherwise all coordinates but those of groups and advected parameters; `is_given` are left alone.
    pub(crate) fn free(
        &self,
        names: &[String],
        roles: &BTreeMap<String, Role>,
        is_given: &dyn Fn(&str) -> bool,
    ) -> Vec<usize> {
        let is_free = |k: &usize| !is_given(&names[*k]);
        let own = (0..names.len()).filter(|k| self.determined.contains(&names[*k]));
        let own: Vec<usize> = own.filter(is_free).collect();
        if own.len() == self.n {
            return own;
        }
        let is_coordinate = |k: &usize| {
            matches!(roles.get(&names[*k]), Some(Role::Bounded { .. } | Role::Unbounded)) && is_free(k)
        };
        (0..names.len()).filter(is_coordinate).collect()
    }
}

/// Moves the components `free` of a state until the outputs at `residuals` vanish, each step by the least change:
///
/// ```text
/// d = -J^T (J J^T)^-1 f,    y <- y + d/2^k    with the least k >= 0 that brings f down
/// ```
///
/// # Errors
/// That of `outputs`.
pub(crate) fn meet(
    outputs: &mut Outputs<'_>,
    residuals: &Range<usize>,
    y: &mut [f64],
    free: &[usize],
) -> Result<Outcome, Error> {
    let largest =
        |f: &[f64]| f.iter().fold(0.0, |max: f64, r| if r.is_nan() { f64::NAN } else { max.max(r.abs()) });
    let mut residual = at(outputs, residuals, vec![y.to_vec()])?.remove(0);
    for _ in 0..MAX_ROUNDS {
        let jacobian = slopes(outputs, residuals, y, free)?;
        let is_met = |(f, row): (&f64, &Vec<f64>)| f.abs() <= MET * row.iter().map(|x| x.abs()).sum::<f64>();
        let was_met = residual.iter().zip(&jacobian).all(is_met);
        let Some(change) = least_change(&jacobian, &residual, None) else {
            return Ok(if was_met { Outcome::Met } else { Outcome::Missed { largest: largest(&residual) } });
        };
        let mut part = 1.0;
        let better = loop {
            let mut moved = y.to_vec();
            free.iter().zip(&change).for_each(|(k, d)| moved[*k] += part * d);
            let found = at(outputs, residuals, vec![moved.clone()])?.remove(0);
            if largest(&found) < largest(&residual) {
                break Some((moved, found));
            }
            part /= 2.0;
            // Rounding ends the progress.
            if was_met || part < 1e-6 {
                break None;
            }
        };
        match better {
            Some((moved, found)) => {
                y.copy_from_slice(&moved);
                residual = found;
            }
            None if was_met => return Ok(Outcome::Met),
            None => return Ok(Outcome::Missed { largest: largest(&residual) }),
        }
        if residual.iter().all(|f| *f == 0.0) {
            return Ok(Outcome::Met);
        }
    }
    Ok(Outcome::Missed { largest: largest(&residual) })
}

fn at(
    outputs: &mut Outputs<'_>,
    residuals: &Range<usize>,
    states: Vec<Vec<f64>>,
) -> Result<Vec<Vec<f64>>, Error> {
    Ok(outputs(states)?.iter().map(|values| values[residuals.clone()].to_vec()).collect())
}

/// Slopes of the residuals by central differences: they steer the steps, and say nothing about where these end.
fn slopes(
    outputs: &mut Outputs<'_>,
    residuals: &Range<usize>,
    y: &[f64],
    free: &[usize],
) -> Result<Vec<Vec<f64>>, Error> {
    let step = |k: usize| STEP * y[k].abs().max(1.0);
    let mut states = Vec::with_capacity(2 * free.len());
    for &k in free {
        for x in [y[k] + step(k), y[k] - step(k)] {
            let mut moved = y.to_vec();
            moved[k] = x;
            states.push(moved);
        }
    }
    let values = at(outputs, residuals, states)?;
    let row = |equation: usize| {
        let along = |(i, k): (usize, &usize)| {
            (values[2 * i][equation] - values[2 * i + 1][equation]) / (2.0 * step(*k))
        };
        free.iter().enumerate().map(along).collect()
    };
    Ok((0..residuals.len()).map(row).collect())
}

#[cfg(test)]
mod tests {
    use super::{Outcome, meet};
    use crate::error::Error;

    /// `x^2 + y^2 = 1` and `z = x y`, with another output before.
    fn outputs(states: Vec<Vec<f64>>) -> Result<Vec<Vec<f64>>, Error> {
        let of = |y: &Vec<f64>| vec![7.0, y[0] * y[0] + y[1] * y[1] - 1.0, y[2] - y[0] * y[1]];
        Ok(states.iter().map(of).collect())
    }

    #[test]
    fn coordinates_meet_their_equations() {
        let mut y = [0.6, 0.5, 0.0];
        assert_eq!(meet(&mut outputs, &(1..3), &mut y, &[1, 2]).unwrap(), Outcome::Met);
        assert!((y[1] - 0.8).abs() < 1e-15 && (y[2] - 0.48).abs() < 1e-15, "{y:?}");
        assert_eq!(y[0], 0.6);
        // More coordinates than equations: the least change, along the radius.
        let mut y = [3.0, 4.0, 0.48];
        assert_eq!(meet(&mut outputs, &(1..2), &mut y, &[0, 1]).unwrap(), Outcome::Met);
        assert!((y[0] * y[0] + y[1] * y[1] - 1.0).abs() < 1e-15, "{y:?}");
        // Which of the states that meet it is a matter of directions, and these are differences.
        assert!((y[0] - 0.6).abs() < 1e-10 && (y[1] - 0.8).abs() < 1e-10, "{y:?}");
    }

    #[test]
    fn what_cannot_be_met_says_by_how_much() {
        let mut y = [2.0, 0.3, 0.0];
        let Outcome::Missed { largest } = meet(&mut outputs, &(1..2), &mut y, &[1]).unwrap() else {
            panic!("{y:?}");
        };
        assert!((largest - 3.0).abs() < 1e-6, "{largest}");
    }
}
