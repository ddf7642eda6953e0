//! Least squares: the minimum, and how well the data determine where it is.
//!
//! Deliberately does not know: what the residuals are residuals of, scenes, integrators.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt, TerminationReason};
use nalgebra::{DMatrix, DVector, Dyn, Owned};

/// Residuals and their derivatives at a point.
#[derive(Clone, Debug)]
pub(super) struct Linearised {
    /// `r_i`, finite.
    pub(super) residuals: DVector<f64>,
    /// `dr_i/dx_j`, finite.
    pub(super) jacobian: DMatrix<f64>,
}

/// How the search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// At a point where nothing changes in first order.
    Minimum,
    /// At the edge of where the residuals have values: the sum of squares falls towards points that have none.
    Edge,
    /// After too many evaluations.
    Patience,
}

/// The point that was found.
#[derive(Clone, Debug)]
pub(super) struct Found {
    pub(super) x: Vec<f64>,
    pub(super) at: Linearised,
    pub(super) end: End,
}

/// What residuals are made of at a point, or why they have no values there.
pub(super) type Evaluate<'a, E> = dyn FnMut(&[f64]) -> Result<Linearised, E> + 'a;

/// Cosine between the residuals and a column of the Jacobian below which the two count as orthogonal. At a minimum the
/// cosine is the rounding error of the integrations, some 1e-9 at the default tolerances; a search that is stopped by
/// an edge ends with cosines of the order of one.
pub(super) const ORTHOGONAL: f64 = 1e-4;

/// The cosine of the angle between the residuals and a column of their Jacobian: the sum of squares falls towards
/// smaller values of an unknown where it is positive.
pub(super) fn slope_by(at: &Linearised, k: usize) -> f64 {
    let column = at.jacobian.column(k);
    let sizes = at.residuals.norm() * column.norm();
    if sizes > 0.0 { column.dot(&at.residuals) / sizes } else { 0.0 }
}

/// The largest `|cos|` of the angles between the residuals and the columns of their Jacobian.
fn slope(at: &Linearised) -> f64 {
    (0..at.jacobian.ncols()).fold(0.0, |max: f64, k| max.max(slope_by(at, k).abs()))
}

/// Whether residuals are errors of their computation: data without noise are met, and the residuals have no direction.
fn is_rounding(at: &Linearised, x: &DVector<f64>) -> bool {
    let columns = at.jacobian.column_iter().zip(x.iter());
    let size = columns.fold(0.0, |max: f64, (column, x)| max.max(column.norm() * x.abs()));
    at.residuals.norm() <= 1e-8 * size
}

/// A residual so large that a step to it is refused and shortened, and whose square is still a number: the sum of
/// squares of as many as fit into memory, too.
const REFUSED: f64 = 1e100;

/// The problem as the method of Levenberg and Marquardt asks for it.
struct Problem<'p, 'e, E> {
    evaluate: &'p mut Evaluate<'e, E>,
    x: DVector<f64>,
    /// None where the residuals have no values.
    at: Option<Linearised>,
    n_residuals: usize,
    /// Why the last point without values has none.
    refused: &'p mut Option<E>,
}

impl<E> LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_, '_, E> {
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;
    type ParameterStorage = Owned<f64, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        // The search goes back to the best point before it ends.
        if self.at.is_some() && self.x == *x {
            return;
        }
        self.x.copy_from(x);
        self.at = match (self.evaluate)(x.as_slice()) {
            Ok(at) => Some(at),
            Err(error) => {
                *self.refused = Some(error);
                None
            }
        };
    }

    fn params(&self) -> DVector<f64> {
        self.x.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let refused = || DVector::from_element(self.n_residuals, REFUSED);
        Some(self.at.as_ref().map_or_else(refused, |at| at.residuals.clone()))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        self.at.as_ref().map(|at| at.jacobian.clone())
    }
}

/// Evaluations for each unknown and one more after which a search is given up.
pub(super) const PATIENCE: usize = 100;

/// The minimum of `sum_i r_i(x)^2` near a start, by the method of Levenberg and Marquardt; a step to a point where the
/// residuals have no values is shortened. Why the last of these points has none is left in `refused`. After `patience`
/// evaluations for each unknown and one more the search ends where it is.
///
/// # Errors
/// That of `evaluate` at the start.
///
/// # Source
/// Moré, The Levenberg-Marquardt algorithm: implementation and theory (1978), in the crate `levenberg-marquardt`.
pub(super) fn minimise<E>(
    start: &[f64],
    patience: usize,
    refused: &mut Option<E>,
    evaluate: &mut Evaluate<'_, E>,
) -> Result<Found, E> {
    let at = evaluate(start)?;
    let n_residuals = at.residuals.len();
    let x = DVector::from_column_slice(start);
    let problem = Problem { evaluate, x, at: Some(at), n_residuals, refused };
    let (mut problem, report) = LevenbergMarquardt::new().with_patience(patience).minimize(problem);
    let is_patient = report.termination != TerminationReason::LostPatience;
    let at = match problem.at.take() {
        Some(at) => at,
        // The search ends at a point with values, unless numbers overflow on the way: then at the start.
        None => {
            problem.x = DVector::from_column_slice(start);
            (problem.evaluate)(start)?
        }
    };
    let is_level = slope(&at) <= ORTHOGONAL || is_rounding(&at, &problem.x);
    let end = match (is_patient, is_level || problem.refused.is_none()) {
        (false, _) => End::Patience,
        (true, true) => End::Minimum,
        (true, false) => End::Edge,
    };
    Ok(Found { x: problem.x.as_slice().to_vec(), at, end })
}

/// How well the unknowns are determined at a minimum.
#[derive(Clone, Debug)]
pub(super) struct Precision {
    /// `sqrt((J^T J)^-1_jj)`: standard deviations of the unknowns where those of the residuals are one.
    pub(super) deviations: Vec<f64>,
    /// Their correlations, row by row.
    pub(super) correlation: Vec<Vec<f64>>,
}

/// Singular values of the Jacobian with columns of length one, relative to the largest, up to which a direction counts
/// as undetermined. Derivatives along a motion have errors of some 1e-9 of their size at the default tolerances.
const UNDETERMINED: f64 = 1e-8;

/// How well the data determine the unknowns, to first order around a minimum.
///
/// # Errors
/// A direction `dx` along which the residuals do not change, its largest component one.
pub(super) fn precision(jacobian: &DMatrix<f64>) -> Result<Precision, Vec<f64>> {
    let n = jacobian.ncols();
    if n == 0 {
        return Ok(Precision { deviations: Vec::new(), correlation: Vec::new() });
    }
    let lengths: Vec<f64> = jacobian.column_iter().map(|column| column.norm()).collect();
    if let Some(k) = lengths.iter().position(|length| *length == 0.0) {
        return Err((0..n).map(|j| f64::from(u8::from(j == k))).collect());
    }
    let scaled = DMatrix::from_fn(jacobian.nrows(), n, |i, j| jacobian[(i, j)] / lengths[j]);
    let parts = scaled.svd(false, true);
    // Asked for in the line above.
    let rows = parts.v_t.unwrap_or_else(|| DMatrix::zeros(0, n));
    let least = parts.singular_values.imin();
    if parts.singular_values[least] <= UNDETERMINED * parts.singular_values.max() {
        let direction: Vec<f64> = (0..n).map(|j| rows[(least, j)] / lengths[j]).collect();
        let largest =
            direction.iter().fold(0.0, |max: f64, x| if x.abs() > f64::abs(max) { *x } else { max });
        return Err(direction.iter().map(|x| x / largest).collect());
    }
    let covariance = |i: usize, j: usize| -> f64 {
        let terms = parts.singular_values.iter().enumerate();
        let sum: f64 = terms.map(|(k, s)| rows[(k, i)] * rows[(k, j)] / (s * s)).sum();
        sum / (lengths[i] * lengths[j])
    };
    let deviations: Vec<f64> = (0..n).map(|j| covariance(j, j).sqrt()).collect();
    let correlation = |i: usize, j: usize| {
        if i == j { 1.0 } else { (covariance(i, j) / (deviations[i] * deviations[j])).clamp(-1.0, 1.0) }
    };
    let correlation = (0..n).map(|i| (0..n).map(|j| correlation(i, j)).collect()).collect();
    Ok(Precision { deviations, correlation })
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::{End, Linearised, PATIENCE, minimise, precision};

    /// `a exp(-b t)` at five times, without values unless `b > 0`.
    fn decay(x: &[f64], data: &[f64; 5]) -> Result<Linearised, String> {
        let [a, b] = [x[0], x[1]];
        if b <= 0.0 {
            return Err(format!("b = {b}"));
        }
        let value = |i: usize| (-b * i as f64).exp();
        Ok(Linearised {
            residuals: DVector::from_fn(5, |i, _| a * value(i) - data[i]),
            jacobian: DMatrix::from_fn(5, 2, |i, j| [value(i), -a * i as f64 * value(i)][j]),
        })
    }

    #[test]
    fn exact_data_give_back_what_they_were_made_of() {
        let data = std::array::from_fn(|i| 3.0 * (-0.7 * i as f64).exp());
        let mut refused = None;
        let found = minimise(&[1.0, 0.1], PATIENCE, &mut refused, &mut |x| decay(x, &data)).unwrap();
        assert_eq!(found.end, End::Minimum);
        assert!((found.x[0] - 3.0).abs() < 1e-12 && (found.x[1] - 0.7).abs() < 1e-12, "{:?}", found.x);
    }

    #[test]
    fn steps_out_of_the_domain_are_shortened() {
        let data = std::array::from_fn(|i| 3.0 * (-0.05 * i as f64).exp());
        let (mut refused, mut n_refused) = (None, 0);
        let mut evaluate = |x: &[f64]| {
            let at = decay(x, &data);
            n_refused += usize::from(at.is_err());
            at
        };
        // The decay is so flat at b = 0.6 that Newton's first step is to a negative b.
        let found = minimise(&[3.0, 0.6], PATIENCE, &mut refused, &mut evaluate).unwrap();
        assert_eq!(found.end, End::Minimum);
        assert!((found.x[1] - 0.05).abs() < 1e-12, "{:?}", found.x);
        assert!(n_refused > 0 && refused.is_some());
    }

    #[test]
    fn a_minimum_beyond_the_edge_is_told_apart_and_a_start_without_values_is_an_error() {
        let data = std::array::from_fn(|i| 3.0 * (0.2 * i as f64).exp());
        let mut refused = None;
        let found = minimise(&[1.0, 0.4], PATIENCE, &mut refused, &mut |x| decay(x, &data)).unwrap();
        assert_eq!(found.end, End::Edge);
        assert!(found.x[1] > 0.0 && found.x[1] < 0.05, "{:?}", found.x);
        let start = minimise(&[1.0, -0.4], PATIENCE, &mut None, &mut |x| decay(x, &data));
        assert_eq!(start.unwrap_err(), "b = -0.4");
    }

    /// A line `a + b t` through points at 0, 1, 2, 3: the covariance of a textbook.
    #[test]
    fn a_line_has_the_covariance_of_its_normal_equations() {
        let jacobian = DMatrix::from_fn(4, 2, |i, j| if j == 0 { 1.0 } else { i as f64 });
        // J^T J = [[4, 6], [6, 14]], whose inverse is [[14, -6], [-6, 4]] / 20.
        let found = precision(&jacobian).unwrap();
        assert!((found.deviations[0] - 0.7_f64.sqrt()).abs() < 1e-14);
        assert!((found.deviations[1] - 0.2_f64.sqrt()).abs() < 1e-14);
        assert!((found.correlation[0][1] + 6.0 / 56.0_f64.sqrt()).abs() < 1e-14);
        assert_eq!(found.correlation[0][1], found.correlation[1][0]);
    }

    #[test]
    fn what_is_not_determined_is_named() {
        // Three columns, the last of which is twice the first.
        let jacobian =
            DMatrix::from_fn(5, 3, |i, j| [1.0 + i as f64, (i * i) as f64, 2.0 + 2.0 * i as f64][j]);
        let direction = precision(&jacobian).unwrap_err();
        for (found, expected) in direction.iter().zip([1.0, 0.0, -0.5]) {
            assert!((found - expected).abs() < 1e-12, "{direction:?}");
        }
        let jacobian = DMatrix::from_fn(5, 2, |i, j| if j == 0 { i as f64 } else { 0.0 });
        assert_eq!(precision(&jacobian).unwrap_err(), [0.0, 1.0]);
    }
}
