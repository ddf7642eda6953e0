//! Parameters and initial values of a scene from measured motions, by least squares with exact derivatives.
//!
//! Does not know: whether the scene is compiled or interpreted, tables, how a request was written.

mod bounded;
mod residuals;
mod search;
mod segments;
mod starts;
mod verdict;

use hamel_codegen::spec::Want;
use serde::{Deserialize, Serialize};

use super::direction::Direction;
use super::dynamics::Factory;
use super::info::Info;
use super::integrate::has_state;
use super::least_squares::{End, precision};
use super::method::{MethodName, Steps};
use super::noise;
use crate::error::Error;

use self::residuals::{Motions, cells, curves};
pub use self::verdict::{ChiSquare, Verdict};

/// A number of a scene along its motion that can be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Quantity {
    /// A component of the state, by its place.
    State(usize),
    /// The energy.
    Energy,
    /// A component of the outputs, by its place among all of them.
    Output(usize),
}

impl Quantity {
    /// What a scene has, by the names that its tables have: components of the state, `energy`, `group.component`.
    pub fn all(info: &Info) -> Vec<(String, Quantity)> {
        let mut all: Vec<(String, Quantity)> =
            info.state.iter().enumerate().map(|(k, name)| (name.clone(), Quantity::State(k))).collect();
        if info.has_energy {
            all.push((Want::Energy.name().to_owned(), Quantity::Energy));
        }
        let outputs = info.outputs.iter().flat_map(|group| {
            group.components.iter().map(move |component| format!("{}.{component}", group.name))
        });
        all.extend(outputs.enumerate().map(|(k, name)| (name, Quantity::Output(k))));
        all
    }

    /// The quantity of a name; outputs also by the name of the component, where no other one has it.
    pub fn named(info: &Info, name: &str) -> Option<Quantity> {
        let all = Quantity::all(info);
        if let Some((_, quantity)) = all.iter().find(|(own, _)| own == name) {
            return Some(*quantity);
        }
        let mut alike =
            all.iter().filter(|(own, _)| own.rsplit_once('.').is_some_and(|(_, own)| own == name));
        match (alike.next(), alike.next()) {
            (Some((_, quantity)), None) => Some(*quantity),
            _ => None,
        }
    }
}

/// What is measured, and how well.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// What it is.
    pub quantity: Quantity,
    /// Standard deviation of its errors; known for all columns or for none.
    pub sigma: Option<f64>,
}

/// What is known of an unknown beforehand.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// Its smallest value.
    pub least: f64,
    /// Its largest one.
    pub most: f64,
    /// A measurement of its own.
    pub prior: Option<Prior>,
}

impl Default for Known {
    fn default() -> Known {
        Known { least: f64::NEG_INFINITY, most: f64::INFINITY, prior: None }
    }
}

/// A normal distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prior {
    /// Its mean.
    pub mean: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

/// What to fit to what, in the order of [`Info`]; the motion starts at time zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitRequest {
    /// Parameters; of the free ones, where the search starts.
    pub params: Vec<f64>,
    /// The same of the initial state.
    pub initial: Vec<f64>,
    /// Parameters and components of the initial state to be found.
    pub free: Vec<Direction>,
    /// What is known of each of these.
    pub known: Vec<Known>,
    /// Further points from which the search starts.
    pub restarts: usize,
    /// Pieces of the motion that start on their own at first.
    pub segments: usize,
    /// What was measured.
    pub columns: Vec<Column>,
    /// Times from zero on, increasing.
    pub times: Vec<f64>,
    /// For each time a value of each column, where there is one.
    pub values: Vec<Vec<Option<f64>>>,
    /// The method of integration.
    pub method: MethodName,
    /// How it chooses steps.
    pub steps: Steps,
    /// Largest number of steps of one motion.
    pub max_steps: u64,
    /// Number of points of the fitted curves.
    pub n_curve: usize,
}

/// A number that was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// What it is called.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation to first order; none of a value at an end of its interval, which the data push beyond.
    pub deviation: Option<f64>,
}

/// Where the search from one of several points ended.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Started {
    /// Values of the unknowns where it started.
    pub from: Vec<f64>,
    /// The sum of squares of the minimum; none where none was found.
    pub sum_of_squares: Option<f64>,
    /// Whether the minimum is that of the answer.
    pub is_same: bool,
}

/// What was fitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitResponse {
    /// All parameters.
    pub params: Vec<f64>,
    /// The initial state.
    pub initial: Vec<f64>,
    /// What was free.
    pub estimates: Vec<Estimate>,
    /// Correlations of the estimates, row by row.
    pub correlation: Vec<Vec<f64>>,
    /// Root of the mean square of what is left of each column, in its own unit.
    pub rms: Vec<f64>,
    /// Number of values of each column.
    pub n_values: Vec<usize>,
    /// Number of unknowns that were measured on their own.
    pub n_priors: usize,
    /// Sum of squares of what is left, in units of the standard deviations where they are known.
    pub sum_of_squares: f64,
    /// The search from each point where it started.
    pub starts: Vec<Started>,
    /// Motions that were integrated.
    pub n_evaluations: usize,
    /// What the residuals say about the fit.
    pub verdict: Verdict,
    /// Times of the curves.
    pub curve_times: Vec<f64>,
    /// The fitted motion at these times, a curve for each column.
    pub curves: Vec<Vec<f64>>,
}

impl FitResponse {
    /// Values and priors beyond those that determine the estimates.
    pub fn degrees_of_freedom(&self) -> usize {
        let n_known = self.n_values.iter().sum::<usize>() + self.n_priors;
        n_known.saturating_sub(self.estimates.iter().filter(|estimate| estimate.deviation.is_some()).count())
    }
}

/// How a start stays on its equations while parameters and components of it change.
pub trait Follows {
    /// A state moved onto its equations, with the components that `given` names as they are.
    ///
    /// # Errors
    /// Which equation cannot be met.
    fn settled(&self, params: &[f64], y: &[f64], given: &[Direction]) -> Result<Vec<f64>, Error>;

    /// The derivatives of a start, by parameters and state, along directions, where the components that `given` names
    /// do not follow.
    ///
    /// # Errors
    /// Parameters that are not allowed; [`Error::Request`] where no component that may follow keeps an equation.
    fn tangents(
        &self,
        directions: &[Direction],
        at: (&[f64], &[f64]),
        given: &[Direction],
    ) -> Result<Vec<Vec<f64>>, Error>;
}

/// Finds the parameters and initial values whose motion is nearest to what was measured.
///
/// ```text
/// minimum of sum_c sum_k ((g_c(t_k, y(t_k); p) - d_ck) / sigma_c)^2 + sum_j ((p_j - m_j) / s_j)^2,  a_j <= p_j <= b_j
/// ```
///
/// with the derivatives of `y` and of the outputs `g_c` by dual numbers, and the second sum over priors. Steps to
/// values that the model does not allow, or from which no motion reaches the last time, are shortened. Standard
/// deviations come from the derivatives at the minimum, `(J^T J)^-1`, times the mean square of what is left where no
/// `sigma` is known. `progress` is told how many motions were integrated, and the sum of squares of the last. With a
/// `follower`, what nobody gave of the start stays on its equations.
///
/// # Errors
/// [`Error::NoState`]; [`Error::Options`] for a method without derivatives, for priors without the standard deviations
/// of the data, for segments of a motion whose starts equations restrict; what is wrong with the start, as for a
/// simulation; [`Error::Unidentifiable`] and [`Error::NotFitted`].
pub fn fit(
    factory: &dyn Factory,
    request: &FitRequest,
    follower: Option<&dyn Follows>,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<FitResponse, Error> {
    let info = factory.info();
    has_state(info)?;
    noise::refuse(info, "whose paths no fit follows")?;
    check(request, follower.is_some())?;
    let mut motions = Motions::new((factory, follower), request, progress)?;
    let (found, starts) = search::search(&mut motions, request)?;
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
    // What is held at an end of its interval is known.
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
        curve_times: Vec::new(),
        curves: Vec::new(),
    };
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
        response.curves = curves(factory, request, &response)?;
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
