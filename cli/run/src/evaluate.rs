//! Values of a scene at given states: derivatives, energy and outputs.
//!
//! Does not know: whether the scene is compiled or interpreted, how a request was written.

use std::ops::Range;

use hamel_codegen::spec::Want;
use hamel_runtime::{Error as SolverError, F64x8, Failure, Real as _};
use serde::{Deserialize, Serialize};

use super::dynamics::{BadParams, Dynamics, Factory, PreparedLanes, PreparedScene, Several as _, VecState};
use super::info::Info;
use crate::error::{Error, Problem};

/// What to evaluate, in the order of [`Info`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EvalRequest {
    /// Parameters.
    pub params: Vec<f64>,
    /// Time.
    pub t: f64,
    /// States.
    pub states: Vec<Vec<f64>>,
    /// Rates of the velocities of each state, in the order of [`Info::velocities`], whose forces are asked for; empty
    /// where none are.
    #[serde(default)]
    pub accelerations: Vec<Vec<f64>>,
}

/// The values, one entry per state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvalResponse {
    /// Derivatives of the states.
    pub derivatives: Vec<Vec<f64>>,
    /// Energies; none when the scene has no energy.
    pub energy: Option<Vec<f64>>,
    /// All outputs, one after the other.
    pub outputs: Vec<Vec<f64>>,
    /// The forces of [`Dynamics::inverse_dynamics`] at the accelerations of the request, where it has any.
    #[serde(default)]
    pub forces: Option<Vec<Vec<f64>>>,
}

/// More than this and further states are not looked at, or not told.
pub const MAX_PROBLEMS: usize = 20;

/// Fixes a scene's parameters.
///
/// # Errors
/// [`Error::Params`] with the condition that does not hold and the values in it.
pub fn prepare<'a>(factory: &'a dyn Factory, params: &[f64]) -> Result<PreparedScene<'a>, Error> {
    factory.prepare(params).map_err(|bad| refused(factory.info(), params, bad))
}

/// Parameters that a scene does not allow, with the values of those in the condition.
pub fn refused(info: &Info, params: &[f64], bad: BadParams) -> Error {
    let mentioned = |name: &str| {
        let is_word = |c: char| c.is_alphanumeric() || c == '_';
        bad.condition.split(|c| !is_word(c)).any(|word| word == name)
    };
    let named = info.params.iter().zip(params).filter(|(p, _)| mentioned(&p.name));
    let values = named.map(|(p, x)| (p.name.clone(), *x)).collect();
    Error::Params { condition: bad.condition, meaning: bad.meaning, values }
}

/// Evaluates a scene at every state of a request. Every number of the response is finite.
///
/// # Errors
/// [`Error::Params`]; [`Error::Request`] with all states at which something has no finite value, or where accelerations
/// are given to a scene without inverse dynamics.
pub fn eval(factory: &dyn Factory, request: &EvalRequest) -> Result<EvalResponse, Error> {
    let info = factory.info();
    let dynamics = prepare(factory, &request.params)?;
    let mut derivatives = Vec::with_capacity(request.states.len());
    let mut energies = Vec::with_capacity(request.states.len());
    let mut outputs = Vec::with_capacity(request.states.len());
    let mut forces = Vec::with_capacity(request.accelerations.len());
    let mut reasons: Vec<(usize, String)> = Vec::new();
    for (k, y) in request.states.iter().enumerate() {
        match values(&*dynamics, request.t, y) {
            Ok((dy, energy, values)) => {
                derivatives.push(dy);
                energies.extend(energy);
                outputs.push(values);
            }
            Err(reason) => reasons.push((k, reason)),
        }
        let Some(a) = request.accelerations.get(k) else { continue };
        let found = dynamics.inverse_dynamics(request.t, y, a).ok_or_else(|| no_inverse_dynamics(info))?;
        match found.iter().position(|tau| !tau.is_finite()) {
            Some(at) => reasons.push((k, format!("the force along {} is not finite", info.velocities[at]))),
            None => forces.push(found),
        }
    }
    if reasons.is_empty() {
        let forces = (!request.accelerations.is_empty()).then_some(forces);
        return Ok(EvalResponse {
            derivatives,
            energy: info.has_energy.then_some(energies),
            outputs,
            forces,
        });
    }
    Err(unusable_states(reasons, request.states.len()))
}

/// That a scene has no forces by accelerations, and how it gets them.
pub fn no_inverse_dynamics(info: &Info) -> Error {
    let (scene, model, want) = (&info.scene, &info.model, Want::InverseDynamics.name());
    let reason = format!(
        "are for inverse dynamics, which scene {scene} of {model} does not have: take a scene that wants it, such as \
         `scene dynamics {{ want rhs, {want}; }}`"
    );
    Error::unusable("accelerations", reason)
}

/// That some of several states cannot be evaluated, with the place and the reason of each.
pub fn unusable_states(reasons: Vec<(usize, String)>, n_states: usize) -> Error {
    let n = reasons.len();
    let mut problems: Vec<Problem> = (reasons.into_iter().take(MAX_PROBLEMS))
        .map(|(k, reason)| Problem::Unusable {
            path: format!("states[{k}]"),
            reason: format!("cannot be evaluated: {reason}"),
        })
        .collect();
    if n > MAX_PROBLEMS {
        let reason =
            format!("cannot be evaluated at {n} of {n_states} places, of which {MAX_PROBLEMS} are shown");
        problems.push(Problem::Unusable { path: "states".into(), reason });
    }
    Error::Request { problems }
}

/// The derivative, the energy and the outputs at a point.
type Values = (Vec<f64>, Option<f64>, Vec<f64>);

/// The [`Values`] at a point.
///
/// # Errors
/// Why one of them has no finite value.
fn values(dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Result<Values, String> {
    let dy = derivative(dynamics, t, y)?;
    let energy = dynamics.energy(t, y);
    if energy.is_some_and(|e| !e.is_finite()) {
        return Err("the energy is not finite".into());
    }
    let values = dynamics.outputs(t, y);
    match values.iter().position(|x| !x.is_finite()) {
        Some(at) => Err(format!("output {} is not finite", output_name(dynamics.info(), at))),
        None => Ok((dy, energy, values)),
    }
}

/// Tells of many starts whether the scene has values there, in the same storage, without allocation where the scene is
/// compiled.
pub struct Judge<'a> {
    factory: &'a dyn Factory,
    lanes: Option<PreparedLanes<'a, F64x8>>,
    params: Vec<F64x8>,
    state: VecState<F64x8>,
    slope: VecState<F64x8>,
    outputs: Vec<F64x8>,
}

impl<'a> Judge<'a> {
    /// Of the starts of a scene.
    pub fn new(factory: &'a dyn Factory) -> Judge<'a> {
        let [state, slope] = [(); 2].map(|()| VecState(Vec::new()));
        Judge { factory, lanes: None, params: Vec::new(), state, slope, outputs: Vec::new() }
    }

    /// Whether the derivative, the energy and all outputs have finite values at time zero at some parameters and
    /// states, of which there are at most as many as lanes, and as many of both.
    pub fn have_values(&mut self, params: &[&[f64]], states: &[&[f64]]) -> bool {
        if let ([params], [y]) = (params, states) {
            return self.factory.prepare(params).is_ok_and(|dynamics| values(&*dynamics, 0.0, y).is_ok());
        }
        to_lanes(params, &mut self.params);
        to_lanes(states, &mut self.state.0);
        self.slope.0.clone_from(&self.state.0);
        let prepared = match &mut self.lanes {
            Some(lanes) => F64x8::prepare_again(self.factory, lanes, &self.params),
            None => F64x8::prepare(self.factory, &self.params).map(|lanes| self.lanes = Some(lanes)),
        };
        let (Ok(()), Some(dynamics)) = (prepared, &self.lanes) else { return false };
        let (t, y) = (F64x8::splat(0.0), &self.state);
        let is_finite = |x: &F64x8| x.all_finite();
        if dynamics.check(t, y).is_err() {
            return false;
        }
        dynamics.rhs(t, y, &mut self.slope);
        if !self.slope.0.iter().all(is_finite) || !dynamics.energy(t, y).is_none_or(|e| is_finite(&e)) {
            return false;
        }
        dynamics.write_outputs(t, y, &mut self.outputs);
        self.outputs.iter().all(is_finite)
    }
}

/// A start that is being judged: the values that vary, parameters and state.
pub type Drawn = (Vec<f64>, Vec<f64>, Vec<f64>);

impl Judge<'_> {
    /// Calls `tell` for each number of a range in its order: with the start that `draw` writes if the scene has values
    /// there, and without one otherwise. `draw` says whether it has written one.
    pub fn each(
        &mut self,
        range: Range<usize>,
        draw: &mut dyn FnMut(usize, &mut Drawn) -> bool,
        tell: &mut dyn FnMut(usize, Option<&Drawn>),
    ) {
        let mut drawn: [Drawn; F64x8::LANES] = Default::default();
        for first in range.clone().step_by(F64x8::LANES) {
            let numbers = first..range.end.min(first + F64x8::LANES);
            let width = numbers.len();
            let are_drawn = numbers.clone().zip(&mut drawn).all(|(k, own)| draw(k, own));
            let params: [&[f64]; F64x8::LANES] = std::array::from_fn(|k| drawn[k].1.as_slice());
            let states: [&[f64]; F64x8::LANES] = std::array::from_fn(|k| drawn[k].2.as_slice());
            let have_all = are_drawn && width > 1 && self.have_values(&params[..width], &states[..width]);
            for (at, k) in numbers.enumerate() {
                let has_values =
                    have_all || are_drawn && self.have_values(&params[at..=at], &states[at..=at]);
                tell(k, has_values.then_some(&drawn[at]));
            }
        }
    }
}

/// Some numbers of each of up to eight, component by component on lanes, of which those behind the last repeat it.
fn to_lanes(all: &[&[f64]], out: &mut Vec<F64x8>) {
    let n = all.first().map_or(0, |first| first.len());
    let of = |k: usize| all[k.min(all.len() - 1)];
    out.clear();
    out.extend((0..n).map(|at| F64x8::new(std::array::from_fn(|k| of(k)[at]))));
}

/// The derivative at a point.
///
/// # Errors
/// Why it has no finite value.
pub fn derivative(dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Result<Vec<f64>, String> {
    let info = dynamics.info();
    dynamics.check(t, y).map_err(|failure| describe(info, failure))?;
    let mut dy = vec![0.0; y.len()];
    dynamics.rhs(t, y, &mut dy);
    match dy.iter().position(|x| !x.is_finite()) {
        Some(at) => Err(match dynamics.domain(t, y) {
            Err(outside) => describe(info, outside),
            Ok(()) => format!("the derivative of {} is not finite", info.state[at]),
        }),
        None => Ok(dy),
    }
}

/// `group.component` of a position among all outputs.
fn output_name(info: &Info, at: usize) -> String {
    let names = info.outputs.iter().flat_map(|g| g.components.iter().map(move |c| format!("{}.{c}", g.name)));
    names.into_iter().nth(at).unwrap_or_default()
}

/// A failure in the words of the scene.
pub fn describe(info: &Info, failure: Failure) -> String {
    match failure {
        Failure::NonFinite { t, index } if index < info.state.len() => {
            format!("{} or its derivative is not finite at t = {t:?}", info.state[index])
        }
        other => other.to_string(),
    }
}

/// Why an integration could not go on, in the words of the scene.
pub fn why_stopped(info: &Info, error: &SolverError) -> String {
    match *error {
        SolverError::Failure(failure) => describe(info, failure),
        SolverError::StepTooSmall { h, .. } => format!(
            "the error estimate asks for steps of {h:e}, which no longer change the time: the solution may be singular \
             there, or the tolerances cannot be reached"
        ),
        SolverError::TooManySteps { limit, .. } => {
            format!(
                "{limit} steps were not enough: choose a smaller t_final, loosen the tolerances, or raise max_steps"
            )
        }
        // Non-finite end times are the request's fault and found before the first step.
        other => other.to_string(),
    }
}
