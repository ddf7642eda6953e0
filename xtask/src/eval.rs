//! Values of a scene at given states: derivatives, energy and outputs, as JSON in and out.
//!
//! Deliberately does not know: whether the scene is compiled or interpreted.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::dynamics::{Dynamics, Factory, Info};
use crate::error::{Error, Problem};
use crate::json::{Fields, Json, by_name, number};

use hamel_runtime::Failure;

/// What to evaluate, in the order of [`Info`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvalRequest {
    /// Parameters.
    pub params: Vec<f64>,
    /// Time.
    pub t: f64,
    /// States.
    pub states: Vec<Vec<f64>>,
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
}

impl EvalRequest {
    /// Reads `{"params": {..}, "states": [{name: number, ..}, ..], "t": number}`.
    ///
    /// Missing parameters take the scene's defaults and a missing `t` is zero.
    ///
    /// # Errors
    /// [`Error::NotJson`], or [`Error::Request`] with everything that is wrong.
    pub fn parse(text: &str, info: &Info) -> Result<EvalRequest, Error> {
        let mut fields = Fields::new(Json::parse(text)?, &["params", "states", "t"])?;
        let params = fields.take("params");
        let params =
            fields.numbers("params", params, "parameter", &info.param_names(), Some(&info.defaults()));
        let t = fields.number("t").unwrap_or(0.0);
        let before = fields.problems.len();
        let items = fields.array("states");
        if items.is_none() && fields.problems.len() == before {
            fields.missing("states", "an array of states, each an object of numbers by name");
        }
        let names = info.state_names();
        let mut states = Vec::new();
        for (k, item) in items.unwrap_or_default().into_iter().enumerate() {
            if fields.problems.len() > MAX_PROBLEMS {
                let reason = "has more problems, which are not shown".into();
                fields.problems.push(Problem::Unusable { path: "states".into(), reason });
                break;
            }
            states.push(fields.numbers(&format!("states[{k}]"), Some(item), "state", &names, None));
        }
        fields.finish()?;
        Ok(EvalRequest { params, t, states })
    }
}

/// More than this and further states are not looked at, or not told.
const MAX_PROBLEMS: usize = 20;

impl EvalResponse {
    /// `{"model", "state", "derivatives", "energy", "outputs"}`.
    ///
    /// `outputs` has one entry per group: an array with one object of numbers by component for each state.
    pub fn to_json(&self, info: &Info) -> Value {
        let rows = |rows: &[Vec<f64>]| -> Value {
            rows.iter().map(|row| row.iter().copied().map(number).collect::<Value>()).collect()
        };
        let mut outputs = Map::new();
        let mut start = 0;
        for group in &info.outputs {
            let end = start + group.components.len();
            let per_state = self
                .outputs
                .iter()
                .map(|all| by_name(group.components.iter().map(String::as_str), &all[start..end]));
            outputs.insert(group.name.clone(), per_state.collect());
            start = end;
        }
        let mut answer = Map::new();
        answer.insert("model".into(), info.model.clone().into());
        answer.insert("state".into(), info.state.clone().into());
        answer.insert("derivatives".into(), rows(&self.derivatives));
        answer.insert(
            "energy".into(),
            self.energy
                .as_ref()
                .map_or(Value::Null, |energies| energies.iter().copied().map(number).collect()),
        );
        answer.insert("outputs".into(), outputs.into());
        answer.into()
    }
}

/// Fixes a scene's parameters.
///
/// # Errors
/// [`Error::Params`] with the condition that does not hold and the values in it.
pub fn prepare<'a>(factory: &'a dyn Factory, params: &[f64]) -> Result<Box<dyn Dynamics + 'a>, Error> {
    factory.prepare(params).map_err(|bad| {
        let mentioned = |name: &str| {
            let is_word = |c: char| c.is_alphanumeric() || c == '_';
            bad.condition.split(|c| !is_word(c)).any(|word| word == name)
        };
        let named = factory.info().params.iter().zip(params).filter(|(p, _)| mentioned(&p.name));
        let values = named.map(|(p, x)| (p.name.clone(), *x)).collect();
        Error::Params { condition: bad.condition, meaning: bad.meaning, values }
    })
}

/// Evaluates a scene at every state of a request. Every number of the response is finite.
///
/// # Errors
/// [`Error::Params`]; [`Error::Request`] with all states at which something has no finite value.
pub fn eval(factory: &dyn Factory, request: &EvalRequest) -> Result<EvalResponse, Error> {
    let info = factory.info();
    let dynamics = prepare(factory, &request.params)?;
    let mut derivatives = Vec::with_capacity(request.states.len());
    let mut energies = Vec::with_capacity(request.states.len());
    let mut outputs = Vec::with_capacity(request.states.len());
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
    }
    if reasons.is_empty() {
        return Ok(EvalResponse { derivatives, energy: info.has_energy.then_some(energies), outputs });
    }
    let (n, n_states) = (reasons.len(), request.states.len());
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
    Err(Error::Request { problems })
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
        Some(at) => Err(format!("the derivative of {} is not finite", info.state[at])),
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
