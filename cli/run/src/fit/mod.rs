//! Parameters and initial values of a scene from measured motions, by least squares with exact derivatives.
//!
//! Does not know: whether the scene is compiled or interpreted, tables, how a request was written.

mod bounded;
mod request;
mod residuals;
mod search;
mod segments;
mod starts;
mod verdict;

use super::dynamics::Factory;
use super::integrate::has_state;
use super::least_squares::{End, precision};
use super::noise;
use crate::error::Error;

pub use self::request::{
    Column, Estimate, FitRequest, FitResponse, Follows, Known, Prior, Progress, Quantity, Started, place_of,
};

pub use self::residuals::Watch;
use self::residuals::{Motions, cells, curves};
pub use self::verdict::{ChiSquare, Verdict};

/// Finds the parameters and initial values whose motion is nearest to what was measured.
///
/// ```text
/// minimum of sum_c sum_k ((g_c(t_k, y(t_k); p) - d_ck) / sigma_c)^2 + sum_j ((p_j - m_j) / s_j)^2,  a_j <= p_j <= b_j
/// ```
///
/// with the derivatives of `y` and of the outputs `g_c` by dual numbers, and the second sum over priors. Steps to
/// values that the model does not allow, or from which no motion reaches the last time, are shortened. Standard
/// deviations come from the derivatives at the minimum, `(J^T J)^-1`, times the mean square of what is left where no
/// `sigma` is known. `progress` is told how many motions were integrated, and the sum of squares of the last; where it
/// breaks, the fit is called off. With a `follower`, what nobody gave of the start stays on its equations.
///
/// # Errors
/// [`Error::NoState`]; [`Error::Options`] for a method without derivatives, for priors without the standard deviations
/// of the data, for segments of a motion whose starts equations restrict; what is wrong with the start, as for a
/// simulation; [`Error::Unidentifiable`] and [`Error::NotFitted`]; that it was called off.
pub fn fit<'a>(
    factory: &'a dyn Factory,
    request: &FitRequest,
    follower: Option<&'a dyn Follows>,
    progress: &'a mut Watch<'a>,
) -> Result<FitResponse, Error> {
    let info = factory.info();
    has_state(info)?;
    noise::refuse(info, "whose paths no fit follows")?;
    check(request, follower.is_some_and(Follows::is_on_equations))?;
    let mut motions = Motions::new((factory, follower), request, progress)?;
    let found = search::search(&mut motions, request);
    motions.go_on()?;
    let (found, starts) = found?;
    let n = motions.n_integrated();
    let free = || request.free.iter().map(|direction| direction.name(info).to_owned());
    let by_name = || free().zip(found.x.iter().copied()).collect();
    let not_fitted = |reason: String| Error::NotFitted { reason, reached: by_name() };
    match found.end {
        End::Minimum => {}
        End::Edge => {
            let why = found.refused.as_ref().map(ToString::to_string).unwrap_or_default();
            return Err(not_fitted(format!(
                "the search ended where smaller residuals need values that are not possible ({why}); start elsewhere, \
                 or fit less"
            )));
        }
        End::Patience => {
            let reason = format!(
                "{n} motions were not enough to find a minimum: start nearer to it with --set and --initial"
            );
            return Err(not_fitted(reason));
        }
    }
    // A value that is held at an end of its interval is known.
    let loose: Vec<usize> = (0..request.free.len()).filter(|k| !found.is_held[*k]).collect();
    let names: Vec<String> = free().collect();
    let undetermined = |along: Vec<f64>| {
        let along =
            loose.iter().map(|k| names[*k].clone()).zip(along).filter(|(_, x)| x.abs() > 1e-6).collect();
        Error::Unidentifiable { along, reached: by_name() }
    };
    let known = precision(&found.at.jacobian.select_columns(&loose)).map_err(undetermined)?;
    let place = |k: usize| loose.iter().position(|own| *own == k);
    let correlation = |i: usize, j: usize| match (place(i), place(j)) {
        (Some(i), Some(j)) => known.correlation[i][j],
        _ => f64::from(u8::from(i == j)),
    };
    let n_free = request.free.len();
    let (params, mut initial) = residuals::values(request, &found.x);
    if let Some(follower) = follower {
        initial = follower.settled(&params, &initial, &request.free)?;
    }
    let estimate = |(k, name): (usize, String)| {
        let deviation = place(k).map(|at| known.deviations[at]);
        Estimate { name, value: found.x[k], deviation }
    };
    let mut response = FitResponse {
        params,
        initial,
        estimates: free().enumerate().map(estimate).collect(),
        correlation: (0..n_free).map(|i| (0..n_free).map(|j| correlation(i, j)).collect()).collect(),
        rms: Vec::new(),
        n_values: Vec::new(),
        n_priors: request.known.iter().filter(|known| known.prior.is_some()).count(),
        sum_of_squares: found.at.residuals.norm_squared(),
        starts,
        n_evaluations: n,
        verdict: search::verdict(request, &found.at),
        residuals: vec![vec![None; request.columns.len()]; request.times.len()],
        curve_times: Vec::new(),
        curves: Vec::new(),
    };
    for ((row, c, _), residual) in cells(request).zip(found.at.residuals.iter()) {
        response.residuals[row][c] = Some(residual * request.columns[c].sigma.unwrap_or(1.0));
    }
    for (c, column) in request.columns.iter().enumerate() {
        let cells = cells(request).zip(found.at.residuals.iter()).filter(|((_, at, _), _)| *at == c);
        let sum: f64 = cells.clone().map(|(_, r)| (r * column.sigma.unwrap_or(1.0)).powi(2)).sum();
        let n = cells.count();
        response.rms.push((sum / n.max(1) as f64).sqrt());
        response.n_values.push(n);
    }
    if response.verdict.is_poor {
        return Err(not_fitted(response.verdict.reason(request.times.last().copied().unwrap_or_default())));
    }
    if request.columns.iter().any(|column| column.sigma.is_none()) {
        let scale = (response.sum_of_squares / response.degrees_of_freedom() as f64).sqrt();
        response
            .estimates
            .iter_mut()
            .filter_map(|e| e.deviation.as_mut())
            .for_each(|deviation| *deviation *= scale);
    } else {
        response.verdict.chi_square =
            Some(ChiSquare::of(response.sum_of_squares, response.degrees_of_freedom()));
    }
    let numbers = response.estimates.iter().flat_map(|e| [e.value, e.deviation.unwrap_or_default()]);
    if !numbers.chain([response.sum_of_squares]).all(f64::is_finite) {
        let reason = "numbers overflow at the minimum: measure in other units, or start elsewhere";
        return Err(not_fitted(reason.to_owned()));
    }
    if request.n_curve > 1 {
        let end = request.times.last().copied().unwrap_or_default();
        response.curve_times =
            (0..request.n_curve).map(|k| end * (k as f64 / (request.n_curve - 1) as f64)).collect();
        response.curves = curves(&motions, request, &response)?;
    }
    Ok(response)
}

/// Whether options belong together.
fn check(request: &FitRequest, is_restricted: bool) -> Result<(), Error> {
    let refuse = |reason: &str| Err(Error::Options { reason: reason.to_owned() });
    if request.known.iter().any(|known| known.prior.is_some())
        && request.columns.iter().any(|column| column.sigma.is_none())
    {
        return refuse(
            "fit: a prior counts beside errors of the data of known size: give the standard deviations of all columns, \
             --sigma",
        );
    }
    if request.segments > 1 && is_restricted {
        return refuse(
            "fit: segments start at states that nothing restricts, and equations or constraints restrict those of this \
             scene: leave out --segments, or choose a scene in independent variables",
        );
    }
    Ok(())
}
