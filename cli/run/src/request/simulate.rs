//! Requests of `simulate --json` and their answers as JSON.
//!
//! Does not know: how anything is integrated.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::json::{Fields, Json, by_name, names_in, number};
use crate::direction::Direction;
use crate::error::{Error, Problem};
use crate::forms::Forms;
use crate::info::Info;
use crate::method::{MethodName, Steps};
use crate::noise::{Noise, method_for};
use crate::simulation::{
    MAX_EVENTS, Sample, SimulateRequest, SimulateResponse, SingularPosition, samples_refusal,
};
use crate::watched::EventRecord;

/// Largest number that a request can give exactly.
const MAX_WHOLE: f64 = (1_u64 << 53) as f64;

/// The state of a scene by its parameters and the components that are given, by name.
type Choose<'a> = dyn FnMut(&BTreeMap<String, f64>, &BTreeMap<String, f64>) -> Result<Vec<f64>, Error> + 'a;

/// The initial state of a model for requests that give a part of it.
pub struct Completion<'a> {
    /// The components that the model gives.
    pub known: &'a BTreeMap<String, f64>,
    /// Finds the state.
    pub choose: &'a mut Choose<'a>,
}

impl std::fmt::Debug for Completion<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Completion").field("known", &self.known).finish_non_exhaustive()
    }
}

impl Completion<'_> {
    /// Takes components that the model gives out of the missing ones.
    fn leave_out_known(&self, problem: &mut Problem) {
        if let Problem::MissingNames { absent, .. } = problem
            && !absent.iter().all(|name| self.known.contains_key(name))
        {
            absent.retain(|name| !self.known.contains_key(name));
        }
    }

    /// Whether the model gives every component that is missing beside `given`; not where none is missing.
    fn completes(&self, given: Vec<&str>, forms: &Forms, n_group: usize) -> bool {
        let zeros = given.iter().map(|name| ((*name).to_owned(), 0.0)).collect();
        let first = forms.with_momenta_of(self.known);
        let form = forms.form_among(std::slice::from_ref(&first), given);
        let (Ok(given), Ok(form)) = (forms.with_points(&zeros), form) else { return false };
        let names = forms.names(&form);
        let own = &names[..names.len() - n_group];
        let is_whole = own.iter().all(|name| zeros.contains_key(name));
        !is_whole && own.iter().all(|name| given.contains_key(name) || self.known.contains_key(name))
    }
}

impl SimulateRequest {
    /// Whether a request has a field `reconstruct`, so that the scene with the group's coordinates is to be run.
    ///
    /// # Errors
    /// [`Error::NotJson`].
    pub fn asks_to_reconstruct(text: &str) -> Result<bool, Error> {
        has_field(text, "reconstruct", |value| *value != Json::Null)
    }

    /// The sections that a request asks for.
    ///
    /// # Errors
    /// [`Error::NotJson`], [`Error::Request`] for anything but a list of texts.
    pub fn sections(text: &str) -> Result<Vec<String>, Error> {
        let Json::Object(entries) = Json::parse(text)? else { return Ok(Vec::new()) };
        let Some((_, value)) = entries.into_iter().find(|(name, _)| name == "sections") else {
            return Ok(Vec::new());
        };
        let texts = match value {
            Json::Null => Some(Vec::new()),
            Json::Array(list) => list
                .into_iter()
                .map(|one| match one {
                    Json::String(text) => Some(text),
                    _ => None,
                })
                .collect(),
            _ => None,
        };
        texts.ok_or_else(|| Error::unusable("sections", "is a list of texts such as [\"x rising\"]"))
    }

    /// The method of a request, where it asks a scene for more than the right-hand side: invariants or exact flows.
    ///
    /// # Errors
    /// [`Error::NotJson`].
    pub fn asking_method(text: &str) -> Result<Option<MethodName>, Error> {
        let Json::Object(entries) = Json::parse(text)? else { return Ok(None) };
        let found = entries.into_iter().find_map(|(field, value)| match value {
            Json::String(name) if field == "method" => MethodName::from_name(&name),
            _ => None,
        });
        Ok(found.filter(|method| method.asks_for().is_some()))
    }

    /// Whether `initial` names something that is no state variable, so that the forms of states matter.
    ///
    /// # Errors
    /// [`Error::NotJson`].
    pub fn has_other_names(text: &str, info: &Info) -> Result<bool, Error> {
        has_field(text, "initial", |value| {
            names_in(Some(value)).into_iter().any(|name| info.state.iter().all(|own| own != name))
        })
    }

    /// The values in `initial` and `reconstruct`.
    ///
    /// # Errors
    /// [`Error::NotJson`].
    pub fn given(text: &str) -> Result<BTreeMap<String, f64>, Error> {
        let Json::Object(entries) = Json::parse(text)? else { return Ok(BTreeMap::new()) };
        let states = entries.into_iter().filter(|(name, _)| name == "initial" || name == "reconstruct");
        let values = states.filter_map(|(_, value)| match value {
            Json::Object(values) => Some(values),
            _ => None,
        });
        let numbers = values.flatten().filter_map(|(name, value)| match value {
            Json::Number(x) => Some((name, x)),
            _ => None,
        });
        Ok(numbers.collect())
    }

    /// Reads `{"params", "initial", "t_final", "method", "rtol", "atol" or "step", "max_step", "samples",
    /// "max_steps"}`.
    ///
    /// Missing parameters take the scene's defaults; `initial` and `t_final` have to be there; the other defaults are
    /// `dop853` and [`Steps::RTOL`], [`Steps::ATOL`].
    ///
    /// # Errors
    /// [`Error::NotJson`], or [`Error::Request`] with everything that is wrong.
    pub fn parse(text: &str, info: &Info) -> Result<SimulateRequest, Error> {
        Self::parse_in(text, info, &Forms::own(info), 0, &|_| Vec::new(), None)
    }

    /// Whether `initial` leaves out components of the state before the last `n_group`.
    ///
    /// # Errors
    /// [`Error::NotJson`].
    pub fn lacks_names(text: &str, info: &Info, n_group: usize) -> Result<bool, Error> {
        let Json::Object(entries) = Json::parse(text)? else { return Ok(false) };
        let initial = entries.iter().find(|(name, _)| name == "initial").map(|(_, value)| value);
        let names = names_in(initial);
        let own = info.state.iter().take(info.state.len().saturating_sub(n_group));
        Ok(own.into_iter().any(|own| !names.contains(&own.as_str())))
    }

    /// Reads a request whose `initial` is in any form of a state, and whose `reconstruct` has the values of the last
    /// `n_group` components.
    ///
    /// An empty `reconstruct` stands for `defaults`, which depend on the parameters by name. Components of `initial`
    /// that the model gives may be left out where there is a `model` to ask.
    ///
    /// # Errors
    /// As [`SimulateRequest::parse`], and what [`Forms::convert`] finds.
    pub fn parse_in(
        text: &str,
        info: &Info,
        forms: &Forms,
        n_group: usize,
        defaults: &dyn Fn(&BTreeMap<String, f64>) -> Vec<f64>,
        model: Option<&mut Completion<'_>>,
    ) -> Result<SimulateRequest, Error> {
        const FIELDS: [&str; 18] = [
            "params",
            "initial",
            "t_final",
            "method",
            "rtol",
            "atol",
            "step",
            "max_step",
            "reconstruct",
            "samples",
            "max_steps",
            "sections",
            "max_events",
            "sensitivity",
            "sizes",
            "noise_seed",
            "noise_path",
            "noise_step",
        ];
        let mut fields = Fields::new(Json::parse(text)?, &FIELDS)?;
        let params = fields.take("params");
        let params =
            fields.numbers("params", params, "parameter", &info.param_names(), Some(&info.defaults()));
        let names = info.state_names();
        let group = &names[names.len() - n_group..];
        let initial = fields.take("initial");
        let completed = match &model {
            Some(model) => model.completes(names_in(initial.as_ref()), forms, n_group),
            None => false,
        };
        let (mut given, mut form) = (BTreeMap::new(), forms.own_form());
        let mut initial = if completed {
            let known = forms.known();
            let known: Vec<&str> = known.into_iter().filter(|name| !group.contains(name)).collect();
            given = fields.some_numbers("initial", initial, "state", &known);
            vec![0.0; names.len() - n_group]
        } else {
            let (initial, own) = fields.state("initial", initial, forms, n_group);
            form = own;
            if let Some(model) = &model {
                fields.problems.iter_mut().for_each(|problem| model.leave_out_known(problem));
            }
            initial
        };
        let before = fields.problems.len();
        let t_final = fields.number("t_final");
        if t_final.is_none() && fields.problems.len() == before {
            fields.missing("t_final", "the time to integrate to, starting at zero");
        }
        let unusable = |path: &str, reason: String| Problem::Unusable { path: path.into(), reason };
        let method = match fields.string("method") {
            None => method_for(info, None),
            Some(name) => MethodName::named(&name).unwrap_or_else(|reason| {
                fields.problems.push(unusable("method", reason));
                MethodName::default()
            }),
        };
        let (rtol, atol, step) = (fields.number("rtol"), fields.number("atol"), fields.number("step"));
        let steps = Steps::new(method, rtol, atol, step).unwrap_or_else(|reason| {
            fields.problems.push(unusable("step", reason));
            Steps::Fixed { step: 1.0 }
        });
        let max_step = fields.number("max_step");
        let steps = steps.within(max_step).unwrap_or_else(|reason| {
            fields.problems.push(unusable("max_step", reason));
            steps
        });
        match fields.take("reconstruct") {
            None => {}
            Some(_) if n_group == 0 => {
                let reason = format!("needs coordinates of the group, which scene {} lacks", info.scene);
                fields.problems.push(unusable("reconstruct", reason));
            }
            Some(Json::Object(entries)) if entries.is_empty() => {
                let by_name = info.params.iter().zip(&params).map(|(p, x)| (p.name.clone(), *x)).collect();
                initial.extend(defaults(&by_name));
            }
            some => {
                let kind = "group coordinate";
                initial.extend(fields.numbers("reconstruct", some, kind, group, None));
            }
        }
        let mut whole = |name: &str, least: u64, default: u64| -> u64 {
            let x = fields.number(name).unwrap_or(default as f64);
            if x >= least as f64 && x.fract() == 0.0 && x <= MAX_WHOLE {
                return x as u64;
            }
            let reason = format!("is {x:?}, but has to be a whole number from {least} on");
            fields.problems.push(unusable(name, reason));
            default
        };
        let samples = whole("samples", 0, 0);
        let max_steps = whole("max_steps", 1, steps.max_steps());
        let max_events = whole("max_events", 1, MAX_EVENTS);
        let (seed, path) = (whole("noise_seed", 0, 0), whole("noise_path", 0, 0));
        let path = u32::try_from(path).unwrap_or_else(|_| {
            let reason = format!("is {path}, but the largest number of a path is {}", u32::MAX);
            fields.problems.push(unusable("noise_path", reason));
            0
        });
        let noise = Noise { seed, path, step: fields.number("noise_step") };
        if let Err(reason) = noise.suits(info) {
            fields.problems.push(unusable("noise_seed", reason));
        }
        let with_outputs = false;
        if let Some(reason) = samples_refusal(samples, info, with_outputs) {
            fields.problems.push(unusable("samples", reason));
        }
        let along = along(&mut fields, info);
        fields.finish()?;
        if let (true, Some(model)) = (completed, model) {
            let set = info.params.iter().zip(&params).map(|(p, x)| (p.name.clone(), *x)).collect();
            let found = (model.choose)(&set, &given)?;
            initial.iter_mut().zip(found).take(names.len() - n_group).for_each(|(own, found)| *own = found);
        }
        let initial = forms.own_of(&params, 0.0, &initial, &form).map_err(|e| e.at("initial"))?;
        let t_final = t_final.unwrap_or(0.0);
        // They fit into memory.
        let samples = samples as usize;
        Ok(SimulateRequest {
            params,
            initial,
            t_final,
            method,
            steps,
            samples,
            with_outputs,
            n_group,
            max_steps,
            max_events,
            watched: None,
            noise,
            along,
            tangents: Vec::new(),
        })
    }
}

/// What a field `sensitivity`, an array of names, asks to differentiate by.
fn along(fields: &mut Fields, info: &Info) -> Vec<Direction> {
    let mut names = Vec::new();
    for name in fields.array("sensitivity").unwrap_or_default() {
        match name {
            Json::String(name) => names.push(name),
            other => fields.problems.push(Problem::WrongKind {
                path: "sensitivity".into(),
                found: other.describe(),
                wanted: "the name of a parameter or of a component of the state",
            }),
        }
    }
    let directions = Direction::named(info, &names, "sensitivity");
    directions.unwrap_or_else(|problems| {
        fields.problems.extend(problems);
        Vec::new()
    })
}

/// Whether an object has a field with such a value.
fn has_field(text: &str, name: &str, is_such: impl Fn(&Json) -> bool) -> Result<bool, Error> {
    let Json::Object(entries) = Json::parse(text)? else { return Ok(false) };
    Ok(entries.iter().any(|(field, value)| field == name && is_such(value)))
}

impl SimulateResponse {
    /// `{"t", "final", "samples", "steps", "rejected", "rhs_evals", "energy_drift", "constraint_residual",
    /// "initial_residual", "warnings"}`.
    ///
    /// Singular positions that the motion has passed are added where there are some, as `"singular_positions"`:
    /// `[{"t", "lost"}, ..]` with the number of equations that depend on the others.
    ///
    /// With `n_group` coordinates of the group at the end of the state, `final` and `samples` have the components
    /// before them only, and `reconstruction` is added with the final values of these.
    pub fn to_json(&self, info: &Info, n_group: usize) -> Value {
        let n_own = info.state.len() - n_group;
        let names = || info.state[..n_own].iter().map(String::as_str);
        let sample = |s: &Sample| Value::Array(vec![number(s.t), by_name(names(), &s.state)]);
        let mut answer = Map::new();
        answer.insert("t".into(), number(self.t));
        answer.insert("final".into(), by_name(names(), &self.last));
        answer.insert("samples".into(), self.samples.iter().map(sample).collect());
        answer.insert("steps".into(), self.steps.into());
        answer.insert("rejected".into(), self.rejected.into());
        answer.insert("rhs_evals".into(), self.rhs_evals.into());
        let if_any = |x: Option<f64>| x.map_or(Value::Null, number);
        answer.insert("energy_drift".into(), if_any(self.energy_drift));
        answer.insert("constraint_residual".into(), if_any(self.constraint_residual));
        answer.insert("initial_residual".into(), if_any(self.initial_residual));
        answer.insert("warnings".into(), self.warnings.clone().into());
        if let Some(events) = &self.events {
            let event = |e: &EventRecord| {
                let mut entry = Map::new();
                entry.insert("name".into(), e.name.clone().into());
                entry.insert("t".into(), number(e.t));
                entry.insert("state".into(), by_name(names(), &e.state));
                Value::from(entry)
            };
            answer.insert("events".into(), events.iter().map(event).collect());
            if let Some(event) = &self.ended_by {
                answer.insert("ended_by".into(), event.clone().into());
            }
        }
        if !self.singular_positions.is_empty() {
            let position = |passed: &SingularPosition| {
                let mut entry = Map::new();
                entry.insert("t".into(), number(passed.t));
                entry.insert("lost".into(), passed.n_lost.into());
                Value::from(entry)
            };
            answer
                .insert("singular_positions".into(), self.singular_positions.iter().map(position).collect());
        }
        if !self.along.is_empty() {
            let all = || info.state.iter().map(String::as_str);
            let by = self.along.iter().map(|(name, values)| (name.clone(), by_name(all(), values)));
            answer.insert("sensitivity".into(), by.collect());
        }
        if n_group > 0 {
            let group = info.state[n_own..].iter().map(String::as_str);
            answer.insert("reconstruction".into(), by_name(group, &self.last[n_own..]));
        }
        answer.into()
    }
}
