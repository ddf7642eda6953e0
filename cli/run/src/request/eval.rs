//! Requests of `eval` and their answers as JSON.
//!
//! Does not know: how anything is evaluated.

use hamel_codegen::spec::Want;
use serde_json::{Map, Value};

use super::json::{Fields, Json, by_name, names_in, number};
use crate::error::{Error, Problem};
use crate::evaluate::{EvalRequest, EvalResponse, MAX_PROBLEMS};
use crate::forms::{Form, Forms};
use crate::info::Info;

impl EvalRequest {
    /// Reads `{"params": {..}, "states": [{name: number, ..}, ..], "t": number, "accelerations": [{..}, ..]}`.
    ///
    /// Missing parameters take the scene's defaults and a missing `t` is zero. Accelerations, by the names of the
    /// velocities, are as many as states, or not there.
    ///
    /// # Errors
    /// [`Error::NotJson`], or [`Error::Request`] with everything that is wrong.
    pub fn parse(text: &str, info: &Info) -> Result<EvalRequest, Error> {
        Self::parse_in(text, info, &Forms::own(info))
    }

    /// Whether a request names something in a state that is no state variable, so that the forms of states matter.
    ///
    /// # Errors
    /// [`Error::NotJson`].
    pub fn has_other_names(text: &str, info: &Info) -> Result<bool, Error> {
        let Json::Object(entries) = Json::parse(text)? else { return Ok(false) };
        let states =
            entries.iter().filter(|(field, _)| field == "states").filter_map(|(_, value)| match value {
                Json::Array(states) => Some(states),
                _ => None,
            });
        let mut names = states.flatten().flat_map(|state| names_in(Some(state)));
        Ok(names.any(|name| info.state.iter().all(|own| own != name)))
    }

    /// The same with states in any of their forms.
    ///
    /// # Errors
    /// As [`EvalRequest::parse`], and what [`Forms::convert`] finds.
    pub fn parse_in(text: &str, info: &Info, forms: &Forms) -> Result<EvalRequest, Error> {
        let mut fields =
            Fields::new(Json::parse(text)?, &["params", "states", "t", "sizes", "accelerations"])?;
        let params = fields.take("params");
        let params =
            fields.numbers("params", params, "parameter", &info.param_names(), Some(&info.defaults()));
        let t = fields.number("t").unwrap_or(0.0);
        let before = fields.problems.len();
        let items = fields.array("states");
        if items.is_none() && fields.problems.len() == before {
            fields.missing("states", "an array of states, each an object of numbers by name");
        }
        let mut states = Vec::new();
        for (k, item) in items.unwrap_or_default().into_iter().enumerate() {
            if fields.problems.len() > MAX_PROBLEMS {
                let reason = "has more problems, which are not shown".into();
                fields.problems.push(Problem::Unusable { path: "states".into(), reason });
                break;
            }
            states.push(fields.state(&format!("states[{k}]"), Some(item), forms, 0));
        }
        let accelerations = fields.accelerations(info, states.len());
        fields.finish()?;
        let convert = |(k, (y, form)): (usize, (Vec<f64>, Form))| {
            forms.own_of(&params, t, &y, &form).map_err(|e| e.at(&format!("states[{k}]")))
        };
        let states = states.into_iter().enumerate().map(convert).collect::<Result<_, Error>>()?;
        Ok(EvalRequest { params, t, states, accelerations })
    }
}

impl Fields {
    /// The rates of the velocities of so many states; empty where there are none.
    fn accelerations(&mut self, info: &Info, n_states: usize) -> Vec<Vec<f64>> {
        let Some(items) = self.array("accelerations") else { return Vec::new() };
        let mut refuse = |reason: String| {
            self.problems.push(Problem::Unusable { path: "accelerations".into(), reason });
            Vec::new()
        };
        if info.velocities.is_empty() {
            let (scene, model) = (&info.scene, &info.model);
            return refuse(format!(
                "are rates of velocities, and the state of scene {scene} of {model} has none"
            ));
        }
        if items.len() != n_states {
            let n = items.len();
            return refuse(format!(
                "are {n} for {n_states} states: give one object of numbers for each state"
            ));
        }
        let names: Vec<&str> = info.velocities.iter().map(String::as_str).collect();
        let mut all = Vec::new();
        for (k, item) in items.into_iter().enumerate() {
            if self.problems.len() > MAX_PROBLEMS {
                break;
            }
            all.push(self.numbers(&format!("accelerations[{k}]"), Some(item), "acceleration", &names, None));
        }
        all
    }
}

impl EvalResponse {
    /// `{"model", "state", "derivatives", "energy", "outputs"}`, and `"inverse_dynamics"` where the request has
    /// accelerations.
    ///
    /// `outputs` has one entry per group: an array with one object of numbers by component for each state.
    /// `inverse_dynamics` is an array with one object of forces by velocity for each state.
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
        if let Some(forces) = &self.forces {
            let names = || info.velocities.iter().map(String::as_str);
            let per_state = forces.iter().map(|forces| by_name(names(), forces));
            answer.insert(Want::InverseDynamics.name().into(), per_state.collect());
        }
        answer.into()
    }
}
