//! An initial state for those who do not give one: moderate, deterministic, on the constraint.
//!
//! Deliberately does not know: who evaluates the scene.

use std::collections::BTreeMap;

use crate::backend::Backend;
use crate::codegen_bridge::Role;
use crate::dynamics::Info;
use crate::error::Error;
use crate::eval::EvalRequest;

/// How often other values are tried when the scene has no value at the first ones.
const N_ATTEMPTS: usize = 4;
/// Residual of the constraint that counts as met, relative to the velocities, which are of order one.
const MET: f64 = 1e-12;

/// A state of a scene in which `given` components have the given values, and others the `preferred` ones of the model.
///
/// The rest is chosen: velocities get distinct moderate values, coordinates the middle of their interval (others a small value), advected
/// parameters unit vectors. Where the scene keeps velocities that a constraint relates, the ones that were not given
/// are moved by the least amount onto it; `constraint` answers for the scene's output group of that name.
///
/// # Errors
/// Why no such state could be found.
pub fn state(
    backend: &mut dyn Backend,
    constraint: Option<&mut dyn Backend>,
    params: (&[f64], &[f64]),
    roles: &BTreeMap<String, Role>,
    preferred: &BTreeMap<String, f64>,
    given: &BTreeMap<String, f64>,
) -> Result<Vec<f64>, Error> {
    let info = backend.info().clone();
    let mut constraint = constraint;
    let mut start = preferred.clone();
    start.extend(given.iter().map(|(name, value)| (name.clone(), *value)));
    let mut failure = None;
    for attempt in 0..N_ATTEMPTS {
        let mut y = first_guess(&info, roles, &start, attempt);
        let free: Vec<usize> = (0..y.len())
            .filter(|&k| {
                let name = &info.state[k];
                roles.get(name) == Some(&Role::Velocity) && !given.contains_key(name)
            })
            .collect();
        let met = if free.is_empty() {
            Ok(())
        } else {
            match &mut constraint {
                Some(other) => meet_constraint(&mut **other, params.1, &mut y, &free),
                None => meet_constraint(backend, params.0, &mut y, &free),
            }
        };
        let request = EvalRequest { params: params.0.to_vec(), t: 0.0, states: vec![y.clone()] };
        match met.and_then(|()| backend.eval(&request)) {
            Ok(_) => return Ok(y),
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    // The loop runs at least once.
    Err(match failure.expect("an attempt") {
        Error::State { reason, .. } | Error::Remote { message: reason, .. }
            if given.len() < info.state.len() =>
        {
            let reason = format!("{reason}; choose another state with --initial name=value ..");
            Error::State { path: "the default initial state".into(), reason }
        }
        other => other,
    })
}

/// Values without regard to the constraint.
fn first_guess(
    info: &Info,
    roles: &BTreeMap<String, Role>,
    start: &BTreeMap<String, f64>,
    attempt: usize,
) -> Vec<f64> {
    // A fixed sequence of signs and sizes, none equal to another.
    const SIZES: [f64; 7] = [0.8, -0.5, 1.1, 0.6, -0.9, 0.4, -0.7];
    let shift = 0.15 * attempt as f64;
    let mut n_velocities = 0;
    let mut n_coordinates = 0;
    let value = |name: &String| {
        if let Some(value) = start.get(name) {
            return *value;
        }
        match roles.get(name) {
            Some(Role::Bounded { from, to }) => from + (to - from) * (0.5 + shift / 2.0),
            // Coordinates of the group start at its identity.
            Some(Role::Group { identity }) => *identity,
            Some(Role::Unbounded) => {
                n_coordinates += 1;
                shift * (1.0 + 0.3 * f64::from(n_coordinates))
            }
            Some(Role::Advected { index, n }) => unit_vector(*index, *n, attempt),
            Some(Role::Velocity) | None => {
                let round = n_velocities / SIZES.len();
                let size = SIZES[n_velocities % SIZES.len()] / (1.0 + 0.37 * round as f64);
                n_velocities += 1;
                size + shift
            }
        }
    };
    info.state.iter().map(value).collect()
}

/// A component of a unit vector that is along no axis.
fn unit_vector(index: usize, n: usize, attempt: usize) -> f64 {
    let component = |k: usize| 0.48 + 0.16 * ((k + attempt) % n) as f64 - if k == 0 { 0.12 } else { 0.0 };
    if n == 3 && attempt == 0 {
        return [0.36, 0.48, 0.8][index];
    }
    component(index) / (0..n).map(|k| component(k).powi(2)).sum::<f64>().sqrt()
}

/// Moves the velocities at positions `free` onto the constraint, by Newton's method with the least change.
fn meet_constraint(
    backend: &mut dyn Backend,
    params: &[f64],
    y: &mut [f64],
    free: &[usize],
) -> Result<(), Error> {
    let Some(range) = backend.info().output_range("constraint") else { return Ok(()) };
    let mut largest = f64::INFINITY;
    for round in 0..8 {
        // The state itself, then one velocity after the other moved by one: constraints are affine in them.
        let mut states = vec![y.to_vec()];
        for &k in free {
            let mut moved = y.to_vec();
            moved[k] += 1.0;
            states.push(moved);
        }
        let answer = backend.eval(&EvalRequest { params: params.to_vec(), t: 0.0, states })?;
        let residuals: Vec<&[f64]> = answer.outputs.iter().map(|all| &all[range.clone()]).collect();
        largest = residuals[0].iter().fold(0.0, |max: f64, r| max.max(r.abs()));
        if largest <= f64::EPSILON || (round == 0 && largest <= MET) {
            return Ok(());
        }
        let jacobian: Vec<Vec<f64>> = (0..range.len())
            .map(|c| residuals[1..].iter().map(|moved| moved[c] - residuals[0][c]).collect())
            .collect();
        let Some(change) = least_change(&jacobian, residuals[0]) else { break };
        for (&k, change) in free.iter().zip(change) {
            y[k] += change;
        }
    }
    if largest <= MET {
        return Ok(());
    }
    let reason = format!(
        "the constraint is violated by {largest:e} and the velocities that were not given cannot meet it: give others"
    );
    Err(Error::State { path: "initial".into(), reason })
}

/// The shortest `x` with `J x = -r`, from `J J^T z = -r`, `x = J^T z`; none when `J` has not full rank.
fn least_change(jacobian: &[Vec<f64>], residual: &[f64]) -> Option<Vec<f64>> {
    let n = jacobian.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut rows: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| dot(&jacobian[i], &jacobian[j])).chain([-residual[i]]).collect())
        .collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs()))?;
        rows.swap(k, pivot);
        if rows[k][k].abs() < 1e-14 {
            return None;
        }
        let (done, below) = rows.split_at_mut(k + 1);
        let pivot_row = &done[k];
        for row in below {
            let factor = row[k] / pivot_row[k];
            for (entry, above) in row.iter_mut().zip(pivot_row).skip(k) {
                *entry -= factor * above;
            }
        }
    }
    let mut z = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| rows[k][j] * z[j]).sum();
        z[k] = (rows[k][n] - known) / rows[k][k];
    }
    let n_free = jacobian.first().map_or(0, Vec::len);
    Some((0..n_free).map(|j| (0..n).map(|i| jacobian[i][j] * z[i]).sum()).collect())
}

#[cfg(test)]
mod tests {
    use super::{least_change, unit_vector};

    #[test]
    fn the_least_change_solves_the_equations() {
        let jacobian = vec![vec![1.0, 2.0, 0.0], vec![0.0, 1.0, -1.0]];
        let x = least_change(&jacobian, &[3.0, -1.0]).unwrap();
        assert!((x[0] + 2.0 * x[1] + 3.0).abs() < 1e-14);
        assert!((x[1] - x[2] - 1.0).abs() < 1e-14);
        // Orthogonal to the null direction (2, -1, -1) of the equations.
        assert!((2.0 * x[0] - x[1] - x[2]).abs() < 1e-14);
        assert!(least_change(&[vec![1.0], vec![1.0]], &[1.0, 1.0]).is_none());
    }

    #[test]
    fn advected_vectors_are_unit_vectors() {
        for n in [2, 3, 5] {
            for attempt in 0..3 {
                let square: f64 = (0..n).map(|k| unit_vector(k, n, attempt).powi(2)).sum();
                assert!((square - 1.0).abs() < 1e-15);
            }
        }
    }
}
