//! Velocities that keep the constraints: those nearest to others.
//!
//! Deliberately does not know: who evaluates a scene, which velocities somebody meant.

use std::ops::Range;

/// A residual counts as rounding up to this part of the size of its terms, see [`Linear::sizes`].
///
/// States come from text with some ten digits, from other programs, and from the end of earlier integrations; their
/// residuals reach some 1e-10 of the terms at the default tolerances. Whoever left a component out or mistook a sign
/// is off by more than a billionth.
pub const ROUNDING: f64 = 1e-9;
/// Residual, relative to the size of its terms, beyond which Newton's method goes on as long as it helps.
const MET: f64 = 1e-12;
/// Most steps of Newton's method: far from the constraint, one that is quadratic in the velocities halves the
/// distance at first.
const MAX_ROUNDS: usize = 60;

/// All outputs at several states at once, one after the other.
pub type Outputs<'a, E> = dyn FnMut(Vec<Vec<f64>>) -> Result<Vec<Vec<f64>>, E> + 'a;

/// Where residuals, velocities and momenta are.
#[derive(Clone, Debug)]
pub struct Places {
    /// Positions of the residuals among all outputs.
    pub constraint: Range<usize>,
    /// Positions of the velocities in the state.
    pub velocities: Vec<usize>,
    /// Positions of the momenta of these velocities among all outputs; none for the Euclidean metric.
    pub momenta: Option<Vec<usize>>,
}

/// Whether a residual with these slopes has no velocity in it: no change of velocities makes it smaller.
pub fn is_of_positions(slopes: &[f64]) -> bool {
    slopes.iter().all(|slope| *slope == 0.0)
}

/// Residuals at a state and what they depend on.
#[derive(Debug)]
pub struct Linear {
    /// `phi_A`.
    pub residual: Vec<f64>,
    /// `dphi_A/dv_i`.
    pub jacobian: Vec<Vec<f64>>,
    /// `S_A = max |v| sum_i |dphi_A/dv_i|`.
    pub sizes: Vec<f64>,
    /// `M_ij = dp_i/dv_j`.
    mass: Option<Vec<Vec<f64>>>,
}

/// Derivatives by central differences, which are exact up to rounding where residuals and momenta are at most
/// quadratic.
///
/// # Errors
/// That of `outputs`.
pub fn linearise<E>(outputs: &mut Outputs<'_, E>, places: &Places, y: &[f64]) -> Result<Linear, E> {
    let largest = places.velocities.iter().fold(0.0, |max: f64, k| max.max(y[*k].abs()));
    let step = if largest > 0.0 { largest / 1024.0 } else { 1.0 };
    let mut states = vec![y.to_vec()];
    for &k in &places.velocities {
        for x in [y[k] + step, y[k] - step] {
            let mut moved = y.to_vec();
            moved[k] = x;
            states.push(moved);
        }
    }
    let values = outputs(states)?;
    let slope = |at: usize, i: usize| {
        let (above, below) = (&values[2 * i + 1], &values[2 * i + 2]);
        (above[at] - below[at]) / (2.0 * step)
    };
    let n = places.velocities.len();
    let row = |at: usize| (0..n).map(|i| slope(at, i)).collect::<Vec<f64>>();
    let jacobian: Vec<Vec<f64>> = places.constraint.clone().map(row).collect();
    let size = |slopes: &Vec<f64>| largest * slopes.iter().map(|x| x.abs()).sum::<f64>();
    Ok(Linear {
        residual: values[0][places.constraint.clone()].to_vec(),
        sizes: jacobian.iter().map(size).collect(),
        jacobian,
        mass: places.momenta.as_ref().map(|momenta| momenta.iter().map(|at| row(*at)).collect()),
    })
}

impl Linear {
    /// Keeps the residuals that velocities change.
    fn leave_out_positions(&mut self) {
        let kept: Vec<bool> = self.jacobian.iter().map(|row| !is_of_positions(row)).collect();
        for list in [&mut self.residual, &mut self.sizes] {
            let mut each = kept.iter();
            list.retain(|_| each.next() == Some(&true));
        }
        self.jacobian.retain(|row| !is_of_positions(row));
    }
}

/// What became of a state that was to be moved onto the constraint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outcome {
    /// It keeps the constraint.
    Met,
    /// It does not, and this is the largest residual.
    Missed {
        /// Its place among the residuals.
        index: usize,
        /// Its absolute value.
        largest: f64,
    },
}

/// Moves the velocities at positions `free` to the nearest that keep the constraint, in the metric of the mass matrix
/// at the start, or the Euclidean one.
///
/// Each round takes the constraint as linear at the last point `v` and finds the nearest to the start `v0` again,
/// which is the end of it where the constraint is affine:
///
/// ```text
/// d = v' - v0 has the least d^T M d with J d = -(phi - J (v - v0))
/// ```
///
/// Where a constraint is so curved that this does not settle, each round starts from the last one (Newton's method),
/// which ends on the constraint near the start.
///
/// # Errors
/// That of `outputs`.
pub fn project<E>(
    outputs: &mut Outputs<'_, E>,
    places: &Places,
    y: &mut [f64],
    free: &[usize],
) -> Result<Outcome, E> {
    let start = y.to_vec();
    let outcome = approach(outputs, places, y, free, true)?;
    if outcome == Outcome::Met {
        return Ok(outcome);
    }
    y.copy_from_slice(&start);
    approach(outputs, places, y, free, false)
}

/// The rounds of [`project`], each from the start or each from the last one.
fn approach<E>(
    outputs: &mut Outputs<'_, E>,
    places: &Places,
    y: &mut [f64],
    free: &[usize],
    is_anchored: bool,
) -> Result<Outcome, E> {
    let columns: Vec<usize> =
        (0..places.velocities.len()).filter(|i| free.contains(&places.velocities[*i])).collect();
    let start: Vec<f64> = columns.iter().map(|i| y[places.velocities[*i]]).collect();
    let mut metric = None;
    let mut best = Missed { off: f64::INFINITY, index: 0, largest: f64::INFINITY, y: y.to_vec() };
    for _ in 0..MAX_ROUNDS {
        let mut linear = linearise(outputs, places, y)?;
        let moving = (0..linear.jacobian.len()).filter(|k| !is_of_positions(&linear.jacobian[*k]));
        let moving: Vec<usize> = moving.collect();
        linear.leave_out_positions();
        let relative = |(r, s): (&f64, &f64)| if *r == 0.0 { 0.0 } else { r.abs() / s };
        let off = linear.residual.iter().zip(&linear.sizes).map(relative).fold(0.0, f64::max);
        // Rounding lets no residual fall for ever.
        if off >= best.off && best.off <= MET {
            break;
        }
        if off < best.off {
            let each = linear.residual.iter().zip(&moving);
            let larger = |(index, most): (usize, f64), (r, k): (&f64, &usize)| match r.abs() > most {
                true => (*k, r.abs()),
                false => (index, most),
            };
            let (index, largest) = each.fold((0, 0.0), larger);
            best = Missed { off, index, largest, y: y.to_vec() };
        }
        if off <= f64::EPSILON {
            break;
        }
        let of_free = |rows: &[Vec<f64>]| -> Vec<Vec<f64>> {
            rows.iter().map(|row| columns.iter().map(|i| row[*i]).collect()).collect()
        };
        let metric = metric.get_or_insert_with(|| {
            let rows = linear.mass.as_ref()?;
            Some(of_free(&columns.iter().map(|i| rows[*i].clone()).collect::<Vec<_>>()))
        });
        let jacobian = of_free(&linear.jacobian);
        let from: Vec<f64> = if is_anchored {
            start.clone()
        } else {
            columns.iter().map(|i| y[places.velocities[*i]]).collect()
        };
        let moved = |row: &Vec<f64>| -> f64 {
            let each = row.iter().zip(&columns).zip(&from);
            each.map(|((slope, i), from)| slope * (y[places.velocities[*i]] - from)).sum()
        };
        let residual: Vec<f64> =
            linear.residual.iter().zip(&jacobian).map(|(r, row)| r - moved(row)).collect();
        let Some(change) = least_change(&jacobian, &residual, metric.as_deref()) else { break };
        for ((i, from), change) in columns.iter().zip(&from).zip(change) {
            y[places.velocities[*i]] = from + change;
        }
        if y.iter().any(|x| !x.is_finite()) {
            break;
        }
    }
    let Missed { off, index, largest, y: found } = best;
    y.copy_from_slice(&found);
    Ok(if off <= ROUNDING { Outcome::Met } else { Outcome::Missed { index, largest } })
}

/// The state that came nearest to the constraint.
struct Missed {
    /// Largest residual relative to the size of its terms.
    off: f64,
    /// Place of the largest residual, and its absolute value.
    index: usize,
    largest: f64,
    y: Vec<f64>,
}

/// The `x` with `J x = -r` and the least `x^T M x`; the Euclidean metric unless `M` is given.
///
/// ```text
/// x = -W (J W)^-1 r,    W = M^-1 J^T
/// ```
///
/// None when `J` has not full rank, or `M` is singular or not positive on the solution.
pub fn least_change(
    jacobian: &[Vec<f64>],
    residual: &[f64],
    metric: Option<&[Vec<f64>]>,
) -> Option<Vec<f64>> {
    let (n, n_free) = (jacobian.len(), jacobian.first().map_or(0, Vec::len));
    // Column by column.
    let columns: Vec<Vec<f64>> = match metric {
        None => jacobian.to_vec(),
        Some(m) => jacobian.iter().map(|row| solve(m, row)).collect::<Option<_>>()?,
    };
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let gram: Vec<Vec<f64>> =
        jacobian.iter().map(|row| columns.iter().map(|column| dot(row, column)).collect()).collect();
    let right: Vec<f64> = residual.iter().map(|r| -r).collect();
    let z = solve(&gram, &right)?;
    Some((0..n_free).map(|k| (0..n).map(|i| columns[i][k] * z[i]).sum()).collect())
}

/// Solves `A x = b` for a symmetric `A` with a positive diagonal by elimination with pivots; none for any other
/// matrix, or one that is singular up to rounding.
///
/// Rows and columns are brought to a diagonal of ones first, because their units may differ.
fn solve(matrix: &[Vec<f64>], right: &[f64]) -> Option<Vec<f64>> {
    let n = matrix.len();
    let scale: Vec<f64> = (0..n).map(|i| matrix[i][i].sqrt()).collect();
    if !scale.iter().all(|s| *s > 0.0 && s.is_finite()) {
        return None;
    }
    let row =
        |i: usize| (0..n).map(|j| matrix[i][j] / scale[i] / scale[j]).chain([right[i] / scale[i]]).collect();
    let mut rows: Vec<Vec<f64>> = (0..n).map(row).collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs()))?;
        rows.swap(k, pivot);
        // Entries are at most one; a NaN is no pivot either.
        if rows[k][k].abs() <= 1e-14 || rows[k][k].is_nan() {
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
    Some(z.iter().zip(&scale).map(|(z, s)| z / s).collect())
}

#[cfg(test)]
mod tests {
    use super::least_change;

    #[test]
    fn the_least_change_solves_the_equations() {
        let jacobian = vec![vec![1.0, 2.0, 0.0], vec![0.0, 1.0, -1.0]];
        let x = least_change(&jacobian, &[3.0, -1.0], None).unwrap();
        assert!((x[0] + 2.0 * x[1] + 3.0).abs() < 1e-14);
        assert!((x[1] - x[2] - 1.0).abs() < 1e-14);
        // Orthogonal to the null direction (2, -1, -1) of the equations.
        assert!((2.0 * x[0] - x[1] - x[2]).abs() < 1e-14);
        assert!(least_change(&[vec![1.0], vec![1.0]], &[1.0, 1.0], None).is_none());
        assert!(least_change(&[vec![0.0, 0.0]], &[1.0], None).is_none());
    }

    #[test]
    fn the_least_change_is_least_in_the_metric() {
        let (mass, jacobian) = ([vec![2.0, 0.5], vec![0.5, 4.0]], [vec![1.0, 3.0]]);
        let x = least_change(&jacobian, &[7.0], Some(&mass)).unwrap();
        assert!((x[0] + 3.0 * x[1] + 7.0).abs() < 1e-13);
        // M x has no component along the null direction (3, -1).
        let p = [2.0 * x[0] + 0.5 * x[1], 0.5 * x[0] + 4.0 * x[1]];
        assert!((3.0 * p[0] - p[1]).abs() < 1e-13);
        // Units do not matter.
        let tiny = least_change(&[vec![1e-150, 3e-150]], &[7e-150], Some(&mass)).unwrap();
        assert!(x.iter().zip(&tiny).all(|(x, y)| (x - y).abs() < 1e-13), "{tiny:?}");
    }
}
