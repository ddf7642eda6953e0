//! A motion as it is asked for, by names, and the request that it makes.
//!
//! Options of the command line and arguments of a function come here; only the words for them differ.
//!
//! Does not know: where a model comes from, who evaluates it, how anything is integrated.

use std::collections::BTreeMap;
use std::sync::Arc;

use hamel_codegen::scene::Told;

use super::direction::Direction;
use super::dynamics::Factory;
use super::evaluate::Judge;
use super::fit::Follows as _;
use super::follow::Follower;
use super::forms::Forms;
use super::info::Info;
use super::interpreted;
use super::method::{MethodName, Steps};
use super::noise::Noise;
use super::simulation::{MAX_EVENTS, SimulateRequest, samples_refusal};
use super::start::{Alike, Starts};
use super::watched::Watched;
use crate::error::{Error, Problem};
use crate::model::{self, Checked};

/// What messages call the parts of what is asked for.
#[derive(Clone, Copy, Debug)]
pub struct Words {
    /// Parameters.
    pub set: &'static str,
    /// Components of the initial state.
    pub initial: &'static str,
    /// Functions of the state to watch.
    pub sections: &'static str,
    /// What the motion is differentiated by.
    pub along: &'static str,
    /// The number of samples.
    pub samples: &'static str,
    /// Size of steps.
    pub step: &'static str,
    /// How coordinates of the group are integrated as well, after "takes x".
    pub reconstructing: &'static str,
}

impl Words {
    /// Options of the command line.
    pub const OPTIONS: Words = Words {
        set: "--set",
        initial: "--initial",
        sections: "--section",
        along: "--sensitivity",
        samples: "--samples",
        step: "--step",
        reconstructing: "with --reconstruct only, which integrates",
    };
}

/// A motion as it is asked for, from time zero.
#[derive(Clone, Debug)]
pub struct Asked {
    /// Parameters that differ from the scene's.
    pub set: Vec<(String, f64)>,
    /// Components of the initial state, in any of its forms; the rest is chosen.
    pub initial: Vec<(String, f64)>,
    /// Time to reach.
    pub t_final: f64,
    /// The method, one that stands for itself.
    pub method: MethodName,
    /// How it chooses steps.
    pub steps: Steps,
    /// Number of samples.
    pub samples: usize,
    /// Whether samples carry all outputs.
    pub with_outputs: bool,
    /// How many components at the end of the state are coordinates of the group that were asked for besides.
    pub n_group: usize,
    /// Largest number of steps, unless it is that of the steps.
    pub max_steps: Option<u64>,
    /// Largest number of events, unless it is [`MAX_EVENTS`].
    pub max_events: Option<u64>,
    /// Functions of the state to watch, in the language of models.
    pub sections: Vec<String>,
    /// The path of the scene's noises.
    pub noise: Noise,
    /// Parameters and components of the initial state that the motion is differentiated by.
    pub along: Vec<String>,
}

impl Asked {
    /// The request, with an initial state that keeps the constraints; `scene` is what it asks.
    ///
    /// # Errors
    /// [`Error::Request`] with every name that is not there, sections that are no expressions, too many samples; why
    /// there is no such initial state.
    ///
    /// Beside the request is what became of the components of the initial state that were not given.
    pub fn request(
        &self,
        words: &Words,
        model: &Arc<Checked>,
        scene: &dyn Factory,
    ) -> Result<(SimulateRequest, Vec<Told>), Error> {
        let info = scene.info().clone();
        let mut problems = Vec::new();
        let forms = Forms::of(model, &info)?;
        let [set, given] = given([&self.set, &self.initial], words, &info, &forms, &mut problems);
        let along = Direction::named(&info, &self.along, words.along).unwrap_or_else(|found| {
            problems.extend(found);
            Vec::new()
        });
        if !problems.is_empty() {
            let group = model::group_coordinates(model);
            let is_of_group =
                |p: &Problem| matches!(p, Problem::UnknownName { name, .. } if group.contains(name));
            if self.n_group == 0 && problems.iter().any(is_of_group) {
                let reason = format!(
                    "takes {} {} these coordinates of the group as well",
                    group.join(", "),
                    words.reconstructing
                );
                problems.push(Problem::Unusable { path: words.initial.into(), reason });
            }
            return Err(Error::Request { problems });
        }
        if let Some(reason) = samples_refusal(self.samples as u64, &info, self.with_outputs) {
            return Err(Error::unusable(words.samples, reason));
        }
        let watched = Watched::new(model, &info, &self.sections, words.sections)?;
        let starts = Starts::new(model, &info, forms)?;
        let (params, initial) = starts.choose(scene, &set, &given)?;
        let told = starts.told([&set, &given], (&params, &initial))?;
        let tangents = match along.is_empty() {
            true => Vec::new(),
            false => {
                let scene = interpreted::build(model, &info.scene)?;
                let follower = Follower::new(model, (&scene, Forms::of(model, &info)?), [&set, &given])?;
                follower.tangents(&along, (&params, &initial), &[])?
            }
        };
        Ok((SimulateRequest { watched, along, tangents, ..self.with_start(params, initial) }, told))
    }

    /// The request that [`request`](Self::request) makes of all parameters and a complete state, in the order and in
    /// the variables of the scene, whose starts are `alike`: the same, as nothing is chosen, without a look at the
    /// model. None for others, and where the scene has no values at the state.
    ///
    /// The caller sees to it that there are no events and nothing by which the motion is differentiated.
    pub fn complete(&self, scene: &dyn Factory, alike: &Alike) -> Option<SimulateRequest> {
        let info = scene.info();
        let are_all = |given: &[(String, f64)], names: &mut dyn Iterator<Item = &String>| {
            given.iter().map(|(name, _)| name).eq(names)
        };
        if !are_all(&self.set, &mut info.params.iter().map(|p| &p.name))
            || !are_all(&self.initial, &mut info.state.iter())
            || samples_refusal(self.samples as u64, info, self.with_outputs).is_some()
        {
            return None;
        }
        let values: Vec<f64> = self.initial.iter().map(|(_, x)| *x).collect();
        let (_, initial) = alike.with(&values);
        let params: Vec<f64> = self.set.iter().map(|(_, x)| *x).collect();
        let has_values = Judge::new(scene).have_values(&[&params], &[&initial]);
        has_values.then(|| self.with_start(params, initial))
    }

    /// The request without events and derivatives.
    fn with_start(&self, params: Vec<f64>, initial: Vec<f64>) -> SimulateRequest {
        SimulateRequest {
            params,
            initial,
            t_final: self.t_final,
            method: self.method,
            steps: self.steps,
            samples: self.samples,
            with_outputs: self.with_outputs,
            n_group: self.n_group,
            max_steps: self.max_steps.unwrap_or(self.steps.max_steps()),
            max_events: self.max_events.unwrap_or(MAX_EVENTS),
            watched: None,
            noise: self.noise,
            along: Vec::new(),
            tangents: Vec::new(),
        }
    }
}

/// Parameters and components of the initial state that were given, by name; of a state in one of its forms.
pub fn given(
    [set, initial]: [&[(String, f64)]; 2],
    words: &Words,
    info: &Info,
    forms: &Forms,
    problems: &mut Vec<Problem>,
) -> [BTreeMap<String, f64>; 2] {
    let set = assignments(set, words.set, "parameter", &info.param_names(), problems);
    let given = assignments(initial, words.initial, "state", &forms.known(), problems);
    if let Err(reason) = forms.form_of(given.keys().map(String::as_str)) {
        problems.push(Problem::Unusable { path: words.initial.into(), reason });
    }
    [set, given]
}

/// Values by name, each once and known; `path` is what gave them.
pub fn assignments(
    given: &[(String, f64)],
    path: &str,
    kind: &'static str,
    known: &[&str],
    problems: &mut Vec<Problem>,
) -> BTreeMap<String, f64> {
    let mut values = BTreeMap::new();
    for (name, value) in given {
        let name = name.clone();
        if !known.contains(&name.as_str()) {
            let known = known.iter().map(|k| (*k).to_owned()).collect();
            problems.push(Problem::UnknownName { path: path.into(), kind, name, known });
        } else if values.insert(name.clone(), *value).is_some() {
            problems.push(Problem::Repeated { path: path.into(), name });
        }
    }
    values
}
