//! Parameters and initial values of a scene from measured motions, by least squares with exact derivatives.
//!
//! Does not know: whether the scene is compiled or interpreted, tables, how a request was written.

use hamel_codegen::spec::Want;
use hamel_runtime::{Dual, Integrator};
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::admissible;
use super::auto::Purpose;
use super::direction::Direction;
use super::dynamics::{Factory, PreparedDuals, PreparedScene, VecState};
use super::evaluate::{describe, prepare, why_stopped};
use super::info::Info;
use super::integrate::has_state;
use super::least_squares::{End, Found, Linearised, minimise, precision};
use super::method::{MethodName, Steps};
use super::noise;
use super::sensitivity::Along;
use super::simulation::stopped_because;
use super::solver::method_of;
use super::verdict::Judged;
pub use super::verdict::Verdict;
use crate::error::Error;

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

/// What to fit to what, in the order of [`Info`]; the motion starts at time zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitRequest {
    /// Parameters; of the free ones, where the search starts.
    pub params: Vec<f64>,
    /// The same of the initial state.
    pub initial: Vec<f64>,
    /// Parameters and components of the initial state to be found.
    pub free: Vec<Direction>,
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
    /// Its standard deviation to first order.
    pub deviation: f64,
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
    /// Sum of squares of what is left, in units of the standard deviations where they are known.
    pub sum_of_squares: f64,
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
    /// Values beyond those that determine the estimates.
    pub fn degrees_of_freedom(&self) -> usize {
        self.n_values.iter().sum::<usize>() - self.estimates.len()
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
/// minimum of sum_c sum_k ((g_c(t_k, y(t_k); p) - d_ck) / sigma_c)^2
/// ```
///
/// with the derivatives of `y` and of the outputs `g_c` by dual numbers. Steps to values that the model does not allow,
/// or from which no motion reaches the last time, are shortened. Standard deviations come from the derivatives at the
/// minimum, `(J^T J)^-1`, times the mean square of what is left where no `sigma` is known. `progress` is told how many
/// motions were integrated, and the sum of squares of the last. With a `follower`, what nobody gave of the start stays
/// on its equations.
///
/// # Errors
/// [`Error::NoState`]; [`Error::Options`] for a method without derivatives; what is wrong with the start, as for a
/// simulation; [`Error::Unidentifiable`] and [`Error::NotFitted`].
pub fn fit(
    factory: &dyn Factory,
    request: &FitRequest,
    follower: Option<&dyn Follows>,
    progress: &mut dyn FnMut(usize, f64),
) -> Result<FitResponse, Error> {
    has_state(factory.info())?;
    noise::refuse(factory.info(), "whose paths no fit follows")?;
    let along = Along::new(factory, &request.free, request.method, "fit")?;
    let start = start(request);
    let (mut refused, mut n) = (None, 0);
    let mut evaluate = |request: &FitRequest, x: &[f64]| {
        n += 1;
        let at = linearised((factory, follower), &along, request, x);
        progress(n, at.as_ref().map_or(f64::NAN, |at| at.residuals.norm_squared()));
        at
    };
    // Over a short time the sum of squares has few minima, of which the one that is found is near the right one of the
    // next longer time.
    let mut near = start.clone();
    for part in HORIZONS {
        let Some(shorter) = until(request, part) else { continue };
        let found = minimise(&near, &mut None, &mut |x: &[f64]| evaluate(&shorter, x));
        // A short motion may not determine everything.
        let found =
            found.ok().filter(|found| found.end == End::Minimum && precision(&found.at.jacobian).is_ok());
        near = found.map_or(near, |found| found.x);
    }
    let mut from = |near: &[f64]| minimise(near, &mut refused, &mut |x: &[f64]| evaluate(request, x));
    let found = match from(&near) {
        Ok(found) if found.end == End::Minimum && !is_poor(request, &found) => found,
        found if near == start => found?,
        // The long motion alone may know better.
        found => better(found, from(&start))?,
    };
    let info = factory.info();
    let free = || request.free.iter().map(|direction| direction.name(info).to_owned());
    let by_name = || free().zip(found.x.iter().copied()).collect();
    let not_fitted = |reason: String| Error::NotFitted { reason, reached: by_name() };
    match found.end {
        End::Minimum => {}
        End::Edge => {
            let why = refused.map(|error| error.to_string()).unwrap_or_default();
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
    let undetermined = |along: Vec<f64>| {
        let along = free().zip(along).filter(|(_, x)| x.abs() > 1e-6).collect();
        Error::Unidentifiable { along, reached: by_name() }
    };
    let known = precision(&found.at.jacobian).map_err(undetermined)?;
    let mut response = FitResponse {
        params: Vec::new(),
        initial: Vec::new(),
        estimates: Vec::new(),
        correlation: known.correlation,
        rms: Vec::new(),
        n_values: Vec::new(),
        sum_of_squares: found.at.residuals.norm_squared(),
        n_evaluations: n,
        verdict: verdict(request, &found),
        curve_times: Vec::new(),
        curves: Vec::new(),
    };
    (response.params, response.initial) = values(request, &found.x);
    if let Some(follower) = follower {
        response.initial = follower.settled(&response.params, &response.initial, &request.free)?;
    }
    for (c, column) in request.columns.iter().enumerate() {
        let cells = cells(request).zip(found.at.residuals.iter()).filter(|((_, at, _), _)| *at == c);
        let sum: f64 = cells.clone().map(|(_, r)| (r * column.sigma.unwrap_or(1.0)).powi(2)).sum();
        let n = cells.count();
        response.rms.push((sum / n.max(1) as f64).sqrt());
        response.n_values.push(n);
    }
    let estimates = free().zip(&found.x).zip(&known.deviations);
    response.estimates = estimates
        .map(|((name, value), deviation)| Estimate { name, value: *value, deviation: *deviation })
        .collect();
    if response.verdict.is_poor {
        return Err(not_fitted(response.verdict.reason(request.times.last().copied().unwrap_or_default())));
    }
    if request.columns.iter().any(|column| column.sigma.is_none()) {
        let scale = (response.sum_of_squares / response.degrees_of_freedom() as f64).sqrt();
        response.estimates.iter_mut().for_each(|estimate| estimate.deviation *= scale);
    }
    let numbers = response.estimates.iter().flat_map(|estimate| [estimate.value, estimate.deviation]);
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

/// Parts of the time of a table that are fitted before all of it: over a tenth of it, and then over a third.
const HORIZONS: [f64; 2] = [0.1, 1.0 / 3.0];

/// Residuals and slopes above this are those of a motion that runs away: their squares would overflow.
const RUNS_AWAY: f64 = 1e100;

/// The request with the first part of its table; none where it has too few values for the unknowns.
fn until(request: &FitRequest, part: f64) -> Option<FitRequest> {
    let end = part * request.times.last()?;
    let n = request.times.iter().take_while(|t| **t <= end).count();
    let (times, values) = (request.times[..n].to_vec(), request.values[..n].to_vec());
    let shorter = FitRequest { times, values, ..request.clone() };
    (cells(&shorter).count() > 2 * request.free.len()).then_some(shorter)
}

/// The one of two ends of a search with the smaller sum of squares at a minimum.
fn better(one: Result<Found, Error>, other: Result<Found, Error>) -> Result<Found, Error> {
    let (one, other) = match (one, other) {
        (Ok(one), Ok(other)) => (one, other),
        (found, Err(_)) | (Err(_), found) => return found,
    };
    let rank = |found: &Found| (found.end != End::Minimum, found.at.residuals.norm_squared());
    Ok(if rank(&other) < rank(&one) { other } else { one })
}

/// What the residuals of a minimum say.
fn verdict(request: &FitRequest, found: &Found) -> Verdict {
    let left = |c: usize, column: &Column| -> Vec<(f64, f64)> {
        let sigma = column.sigma.unwrap_or(1.0);
        let cells = cells(request).zip(found.at.residuals.iter()).filter(|((_, at, _), _)| *at == c);
        cells.map(|((_, _, value), r)| (value, r * sigma)).collect()
    };
    let columns = request.columns.iter().enumerate();
    let judged = columns.map(|(c, column)| Judged { cells: left(c, column), sigma: column.sigma });
    Verdict::of(&judged.collect::<Vec<_>>())
}

fn is_poor(request: &FitRequest, found: &Found) -> bool {
    verdict(request, found).is_poor
}

/// Values of the unknowns where the search starts.
fn start(request: &FitRequest) -> Vec<f64> {
    let value = |direction: &Direction| match direction {
        Direction::Param(k) => request.params[*k],
        Direction::Initial(k) => request.initial[*k],
    };
    request.free.iter().map(value).collect()
}

/// Parameters and initial state with values of the unknowns.
fn values(request: &FitRequest, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut params, mut initial) = (request.params.clone(), request.initial.clone());
    for (direction, x) in request.free.iter().zip(x) {
        match direction {
            Direction::Param(k) => params[*k] = *x,
            Direction::Initial(k) => initial[*k] = *x,
        }
    }
    (params, initial)
}

/// Row, column and value of everything that was measured, in the order of the residuals.
fn cells(request: &FitRequest) -> impl Iterator<Item = (usize, usize, f64)> + Clone {
    let row = |(k, row)| {
        let row: &Vec<Option<f64>> = row;
        row.iter().enumerate().filter_map(move |(c, cell)| Some((k, c, (*cell)?)))
    };
    request.values.iter().enumerate().flat_map(row)
}

/// Residuals and their derivatives with values of the unknowns.
fn linearised(
    (factory, follower): (&dyn Factory, Option<&dyn Follows>),
    along: &Along<'_>,
    request: &FitRequest,
    x: &[f64],
) -> Result<Linearised, Error> {
    let (params, mut initial) = values(request, x);
    let base = prepare(factory, &params)?;
    let mut tangents = Vec::new();
    if let Some(follower) = follower {
        initial = follower.settled(&params, &initial, &request.free)?;
        tangents = follower.tangents(&request.free, (&params, &initial), &request.free)?;
    }
    admissible::check(&*base, &initial, 0)?;
    let start = along.initial(&initial, &tangents);
    let states = states(&prepare(along, &params)?, request, &start, &request.times)?;
    let n = initial.len();
    let needs_outputs = request.columns.iter().any(|column| !matches!(column.quantity, Quantity::State(_)));
    let duals: Vec<PreparedDuals<'_>> = if needs_outputs {
        let prepared = request.free.iter().map(|direction| factory.prepare_duals(&direction.params(&params)));
        // The same values were allowed above.
        prepared
            .collect::<Result<_, _>>()
            .map_err(|bad| super::evaluate::refused(factory.info(), &params, bad))?
    } else {
        Vec::new()
    };
    let (n_cells, n_free) = (cells(request).count(), x.len());
    let (mut residuals, mut jacobian) = (DVector::zeros(n_cells), DMatrix::zeros(n_cells, n_free));
    let mut measured = Measured { row: usize::MAX, energy: Vec::new(), outputs: Vec::new() };
    for (at, (k, c, cell)) in cells(request).enumerate() {
        let (column, t, z) = (&request.columns[c], request.times[k], &states[k]);
        let scale = column.sigma.unwrap_or(1.0).recip();
        if measured.row != k {
            measured = Measured::new(&duals, k, t, (z, n));
        }
        for j in 0..n_free {
            let value = match column.quantity {
                Quantity::State(i) => Dual::new(z[i], z[(j + 1) * n + i]),
                Quantity::Energy => measured.energy[j],
                Quantity::Output(i) => measured.outputs[j][i],
            };
            residuals[at] = (value.value - cell) * scale;
            jacobian[(at, j)] = value.derivative * scale;
            let size = residuals[at].abs().max(jacobian[(at, j)].abs());
            if !(residuals[at].is_finite() && jacobian[(at, j)].is_finite() && size < RUNS_AWAY) {
                let what = if size < f64::INFINITY { "runs away" } else { "is not finite" };
                let reason = format!("{} or its derivative {what}", column.name);
                return Err(stopped_because(factory.info(), t, &z[..n], reason));
            }
        }
    }
    Ok(Linearised { residuals, jacobian })
}

/// Energy and outputs at a row of the table, along each direction.
struct Measured {
    row: usize,
    energy: Vec<Dual>,
    outputs: Vec<Vec<Dual>>,
}

impl Measured {
    fn new(duals: &[PreparedDuals<'_>], row: usize, t: f64, (z, n): (&[f64], usize)) -> Measured {
        let (mut energy, mut outputs) = (Vec::new(), Vec::new());
        for (j, scene) in duals.iter().enumerate() {
            let tangent = &z[(j + 1) * n..];
            let y: Vec<Dual> = z[..n].iter().zip(tangent).map(|(y, s)| Dual::new(*y, *s)).collect();
            let t = Dual::constant(t);
            energy.extend(scene.energy(t, &y));
            outputs.push(scene.outputs(t, &y));
        }
        Measured { row, energy, outputs }
    }
}

/// The fitted motion, a curve for each column.
fn curves(
    factory: &dyn Factory,
    request: &FitRequest,
    response: &FitResponse,
) -> Result<Vec<Vec<f64>>, Error> {
    let dynamics = prepare(factory, &response.params)?;
    let states = states(&dynamics, request, &response.initial, &response.curve_times)?;
    let curve = |column: &Column| -> Result<Vec<f64>, Error> {
        let value = |(t, y): (&f64, &Vec<f64>)| {
            let value = match column.quantity {
                Quantity::State(i) => Some(y[i]),
                Quantity::Energy => dynamics.energy(*t, y),
                Quantity::Output(i) => dynamics.outputs(*t, y).get(i).copied(),
            };
            let reason = || format!("{} is not finite", column.name);
            let is_finite = |x: &f64| x.is_finite();
            value.filter(is_finite).ok_or_else(|| stopped_because(dynamics.info(), *t, y, reason()))
        };
        response.curve_times.iter().zip(&states).map(value).collect()
    };
    request.columns.iter().map(curve).collect()
}

/// The states of a motion at times.
fn states(
    dynamics: &PreparedScene<'_>,
    request: &FitRequest,
    initial: &[f64],
    times: &[f64],
) -> Result<Vec<Vec<f64>>, Error> {
    let method =
        method_of(request.method, request.steps, Purpose::Samples, &**dynamics, initial)?.of_scenes();
    let info = dynamics.info();
    let end = times.last().copied().unwrap_or_default();
    let options = request.steps.options(end, request.max_steps)?;
    let initial = VecState(initial.to_vec());
    let mut solver = Integrator::new(dynamics, method, 0.0, initial, options).map_err(|e| match e {
        hamel_runtime::Error::Failure(failure) => {
            Error::State { path: "initial".into(), reason: describe(info, failure) }
        }
        other => Error::Options { reason: other.to_string() },
    })?;
    let mut states = Vec::with_capacity(times.len());
    let reached = solver.sample(end, times.iter().copied(), |_, y: &VecState| states.push(y.0.clone()));
    match reached {
        Ok(()) => Ok(states),
        Err(error) => Err(stopped_because(info, solver.t(), &solver.state().0, why_stopped(info, &error))),
    }
}
