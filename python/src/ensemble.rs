//! Many motions of a scene, on threads, without holding Python.
//!
//! Deliberately does not know: how a trajectory is integrated, how results look in Python.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;
use std::time::Instant;

use hamel::commands::ensemble::{Arguments, Lines, Subject, chunk_of, of_scene, path_of};
use hamel::commands::options::{EndOptions, InputOptions, MotionOptions, NoiseOptions, SceneOptions};
use hamel::output::trajectories::Statistic;
use hamel_run::admissible;
use hamel_run::asked::assignments;
use hamel_run::ensemble::{Cancel, EnsembleRequest, Progress, Width, pool};
use hamel_run::error::{Error, Problem};
use hamel_run::evaluate::{Drawn, Judge, prepare};
use hamel_run::forms::Forms;
use hamel_run::info::{Info, ParamEntry};
use hamel_run::interpreted::Built;
use hamel_run::members::{Beginnings, Members};
use hamel_run::method::{MethodName, Steps};
use hamel_run::noise::Noise;
use hamel_run::request::share::Share;
use hamel_run::resources::{free_memory, shown};
use hamel_run::simulation::sample_time;
use hamel_run::start::Starts;
use numpy::ndarray::ArrayView2;
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use crate::scene::Scene;

/// Parameters and initial state of a trajectory, or why there are none.
type Start = Result<(Vec<f64>, Vec<f64>), String>;

/// How all trajectories are integrated.
pub(crate) struct Asked {
    pub(crate) t_final: f64,
    pub(crate) samples: usize,
    pub(crate) method: MethodName,
    pub(crate) steps: Steps,
    pub(crate) noise: Noise,
    pub(crate) max_steps: Option<u64>,
    pub(crate) width: Width,
    pub(crate) threads: Option<usize>,
}

/// Trajectories side by side: numbers in the order of trajectories, then samples, then components.
pub(crate) struct Trajectories {
    pub(crate) times: Vec<f64>,
    pub(crate) states: Vec<f64>,
    pub(crate) energies: Vec<f64>,
    /// Time and state at the end of each, wherever it was.
    pub(crate) ends: Vec<f64>,
    pub(crate) last: Vec<f64>,
    pub(crate) steps: Vec<u64>,
    pub(crate) errors: Vec<Option<String>>,
    /// Parameters of each.
    pub(crate) params: Vec<f64>,
    /// Initial state of each.
    pub(crate) initial: Vec<f64>,
}

/// Integrates one motion for each row of `values`, whose columns are the parameters and components of the initial state
/// in `names`; the rest of each state is chosen.
///
/// # Errors
/// As the command `ensemble`.
pub(crate) fn integrate(
    scene: &Scene,
    names: &[String],
    values: ArrayView2<'_, f64>,
    asked: &Asked,
    cancel: &Cancel,
) -> Result<Trajectories, Error> {
    let (built, info) = (scene.built(), scene.info());
    has_room(info, values.nrows(), asked.samples)?;
    if asked.samples == 0 {
        return Err(Error::unusable("samples", "is 0, but the end is a sample: give at least 1"));
    }
    let forms = Forms::of(&scene.model, info)?;
    let inputs = info.inputs.iter().map(|input| input.name.as_str());
    let known: Vec<&str> = info.param_names().into_iter().chain(forms.known()).chain(inputs).collect();
    let is_input = |name: &str| info.inputs.iter().any(|input| input.name == name);
    let of_inputs = names.iter().any(|name| is_input(name));
    let held = if of_inputs { held_inputs(scene)? } else { Vec::new() };
    let mut problems = Vec::new();
    let given: Vec<(String, f64)> = names.iter().map(|name| (name.clone(), 0.0)).collect();
    assignments(&given, "y0 and params", "parameter or state variable", &known, &mut problems);
    let of_state = names
        .iter()
        .map(String::as_str)
        .filter(|name| info.params.iter().all(|p| p.name != *name) && !is_input(name));
    if let Err(reason) = forms.form_of(of_state) {
        problems.push(Problem::Unusable { path: "y0".into(), reason });
    }
    if !problems.is_empty() {
        return Err(Error::Request { problems });
    }
    // What is given completely leaves nothing to choose.
    let is_complete = info.state.iter().all(|name| names.contains(name));
    let starts = Starts::new(&scene.model, info, forms)?;
    let start = |k: usize| -> Start {
        if cancel.is_off() {
            return Err("called off".into());
        }
        let row: BTreeMap<&str, f64> =
            names.iter().map(String::as_str).zip(values.row(k).iter().copied()).collect();
        let inputs: Vec<f64> =
            held.iter().map(|(name, held)| row.get(name.as_str()).copied().unwrap_or(*held)).collect();
        let row = row.into_iter().filter(|(name, _)| !is_input(name)).collect();
        let start = if is_complete { complete(scene, &row) } else { chosen(scene, built, &starts, &row) };
        let (mut params, y) = start.map_err(|e| e.to_string())?;
        params.extend(inputs);
        let prepared = prepare(built, &params).map_err(|e| e.to_string())?;
        admissible::check(&*prepared, &y, 0).map_err(|e| e.to_string())?;
        Ok((params, y))
    };
    // Where starts are alike but for the values of the rows, the rule of initial states is asked once.
    let own = scene.info().params.iter().zip(&scene.values).map(|(p, value)| (p.name.clone(), *value));
    let alike = starts.alike(&own.collect(), &BTreeMap::new(), names);
    let threads = pool(asked.threads)?;
    let n_params = info.params.len() + if of_inputs { info.inputs.len() } else { 0 };
    let block = |range: Range<usize>| {
        let mut members = Beginnings::none(n_params, info.state.len());
        let mut draw = |k: usize, (row, params, state): &mut Drawn| {
            let Some(alike) = alike.as_ref().filter(|_| !cancel.is_off()) else { return false };
            row.clear();
            row.extend(values.row(k));
            alike.write(row, params, state);
            true
        };
        Judge::new(built).each(range, &mut draw, &mut |k, drawn| match drawn {
            Some((_, params, state)) => members.push(params, state),
            None => match start(k) {
                Ok((params, y)) => members.push(&params, &y),
                Err(reason) => members.push_failed(reason),
            },
        });
        members
    };
    let beginnings = |chunk: Range<usize>| {
        let blocks = chunk.clone().step_by(BLOCK).map(|first| first..chunk.end.min(first + BLOCK));
        let blocks: Vec<Range<usize>> = blocks.collect();
        let blocks: Vec<Beginnings> = threads.install(|| blocks.into_par_iter().map(block).collect());
        let mut members = Beginnings::none(n_params, info.state.len());
        blocks.into_iter().for_each(|block| members.append(block));
        members
    };
    let (n, clock) = (values.nrows(), Instant::now());
    let mut all = Trajectories::with_room_for(n, info, asked);
    // The same as the command's, in storage that one after the other takes.
    let n_chunk = chunk_of(asked.samples.saturating_mul(info.state.len() + 2));
    for first in (0..n.max(1)).step_by(n_chunk) {
        let request = EnsembleRequest {
            members: beginnings(first..n.min(first + n_chunk)),
            t_final: asked.t_final,
            method: asked.method,
            steps: asked.steps,
            samples: asked.samples,
            width: asked.width,
            max_steps: asked.max_steps,
            threads: asked.threads,
            watched: built.watched().filter(|watched| watched.acts()),
            noise: Noise { path: asked.noise.path.saturating_add(path_of(first)?), ..asked.noise },
            progress: Progress {
                done: first,
                all: n,
                seconds: clock.elapsed().as_secs_f64(),
                ..Progress::default()
            },
            cancel: cancel.clone(),
        };
        all.add(info, &request.members, &hamel_run::ensemble::integrate(built, &request)?);
    }
    Ok(all)
}

/// Starts of a block, which one thread chooses.
const BLOCK: usize = 64;

/// Whether the states of all samples can be in memory at once.
///
/// # Errors
/// [`Error::Request`] where they cannot.
fn has_room(info: &Info, n: usize, samples: usize) -> Result<(), Error> {
    // Once as they are integrated, and once in the array.
    let bytes = 16 * n as u128 * samples as u128 * info.state.len() as u128;
    let Some(free) = free_memory().map(u128::from).filter(|free| bytes > *free) else { return Ok(()) };
    let reason = format!(
        "would have at least {} for {n} trajectories, and there is room for {} in memory: take fewer samples or \
         trajectories, or write them to a file with out=..",
        shown(bytes),
        shown(free)
    );
    Err(Error::unusable("samples", reason))
}

/// Inputs with the values that they are held at, to take the place of what drives the scene.
///
/// # Errors
/// [`Error::Request`] for an input that a table drives.
fn held_inputs(scene: &Scene) -> Result<Vec<(String, f64)>, Error> {
    let of_one = |input: &ParamEntry| match scene.table.as_deref().filter(|table| table.has(&input.name)) {
        None => Ok((input.name.clone(), input.default)),
        Some(table) => {
            table.held_value(&input.name).map(|held| (input.name.clone(), held)).ok_or_else(|| {
                let reason =
                    format!("vary, but {} is driven by a table: drive it by an expression", input.name);
                Error::unusable("inputs", reason)
            })
        }
    };
    scene.info().inputs.iter().map(of_one).collect()
}

/// Writes the trajectories of the rows of `values` as the command `ensemble` does, and says what became of them.
///
/// # Errors
/// As the command `ensemble`.
pub(crate) fn write(
    scene: &Scene,
    (names, rows): (Vec<String>, Vec<Vec<f64>>),
    asked: &Asked,
    to: Written,
    cancel: Cancel,
) -> Result<String, Error> {
    let is_varied = |name: &str| names.iter().any(|varied| varied == name);
    let own = scene.info().params.iter().zip(&scene.values).map(|(p, value)| (p.name.clone(), *value));
    let (rtol, atol, step, max_step) = match asked.steps {
        Steps::Adaptive { rtol, atol, max } => (Some(rtol), Some(atol), None, max),
        Steps::Fixed { step } => (None, None, Some(step), None),
    };
    let arguments = Arguments {
        scene: SceneOptions {
            model: scene.info().model.clone(),
            scene: scene.info().scene.clone(),
            via: None,
            inputs: InputOptions::default(),
        },
        sweep: Vec::new(),
        spread: Vec::new(),
        // Trajectories of which nothing but the path of noises varies.
        count: Some(rows.len()).filter(|n| names.is_empty() && *n > 1),
        seed: 0,
        table: None,
        motion: MotionOptions {
            set: own.filter(|(name, _)| !is_varied(name)).collect(),
            initial: Vec::new(),
            method: Some(asked.method),
            rtol,
            atol,
            step,
            max_step,
            max_steps: asked.max_steps,
        },
        noise: NoiseOptions {
            noise_seed: Some(asked.noise.seed).filter(|seed| *seed != 0),
            noise_path: Some(asked.noise.path).filter(|path| *path != 0),
            noise_step: asked.noise.step,
        },
        end: EndOptions { t_final: asked.t_final },
        samples: asked.samples,
        lanes: asked.width,
        threads: asked.threads,
        resume: to.resume,
        part: to
            .part
            .map(|(part, of)| Share::parse(&format!("{part}/{of}")))
            .transpose()
            .map_err(|reason| Error::unusable("part", reason))?,
        statistics: Statistic::named(&to.statistics)
            .map_err(|reason| Error::unusable("statistics", reason))?,
        quantiles: to.quantiles,
        bins: to.bins,
        output: vec![to.out],
    };
    let inputs = scene.drives();
    let subject =
        Subject { model: &scene.model, text: scene.model_text(), built: scene.built(), inputs, cancel };
    let lines = if names.is_empty() { Lines::none() } else { Lines::of((names, rows)) };
    of_scene(&subject, scene.built(), lines, &arguments, |_| {})
}

/// To where trajectories are written, and which.
pub(crate) struct Written {
    pub(crate) out: PathBuf,
    pub(crate) resume: bool,
    pub(crate) part: Option<(usize, usize)>,
    pub(crate) statistics: Vec<String>,
    pub(crate) quantiles: Vec<f64>,
    pub(crate) bins: u16,
}

/// Parameters and state of a row that has all components.
fn complete(scene: &Scene, row: &BTreeMap<&str, f64>) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let info = scene.info();
    let params = info.params.iter().zip(&scene.values);
    let params = params.map(|(p, own)| row.get(p.name.as_str()).copied().unwrap_or(*own)).collect();
    Ok((params, info.state.iter().map(|name| row.get(name.as_str()).copied().unwrap_or_default()).collect()))
}

/// Parameters and state of a row, the rest of which is chosen as by `simulate`.
fn chosen(
    scene: &Scene,
    built: &Built,
    starts: &Starts<'_>,
    row: &BTreeMap<&str, f64>,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let names = scene.info().param_names();
    let own = names.iter().map(|name| (*name).to_owned()).zip(scene.values.iter().copied());
    let (mut set, mut given): (BTreeMap<String, f64>, _) = (own.collect(), BTreeMap::new());
    for (name, value) in row {
        let of = if names.contains(name) { &mut set } else { &mut given };
        of.insert((*name).to_owned(), *value);
    }
    starts.choose(built, &set, &given)
}

impl Trajectories {
    fn with_room_for(n: usize, info: &Info, asked: &Asked) -> Trajectories {
        let (n_state, samples) = (info.state.len(), asked.samples);
        Trajectories {
            times: (0..samples).map(|k| sample_time(asked.t_final, samples, k)).collect(),
            states: Vec::with_capacity(n * samples * n_state),
            energies: Vec::with_capacity(n * samples),
            ends: Vec::with_capacity(n),
            last: Vec::with_capacity(n * n_state),
            steps: Vec::with_capacity(n),
            errors: Vec::with_capacity(n),
            params: Vec::with_capacity(n * info.params.len()),
            initial: Vec::with_capacity(n * n_state),
        }
    }

    /// Adds what became of some.
    fn add(&mut self, info: &Info, members: &Beginnings, integrated: &Members) {
        let nothing = |n: usize| std::iter::repeat_n(f64::NAN, n);
        let (n, n_params, n_samples) = (info.state.len(), info.params.len(), self.times.len());
        let t_final = self.times.last().copied().unwrap_or_default();
        for (k, result) in integrated.iter().enumerate() {
            let (params, initial) = members.member(k);
            // Behind them are inputs.
            self.params.extend(&params[..n_params]);
            self.initial.extend(initial);
            for at in 0..n_samples {
                let sample = result.sample(at);
                match sample {
                    Some(sample) => self.states.extend(sample.state),
                    None => self.states.extend(nothing(n)),
                }
                self.energies.push(sample.and_then(|sample| sample.energy).unwrap_or(f64::NAN));
            }
            match result.last() {
                Some(sample) => {
                    self.ends.push(sample.t);
                    self.last.extend(sample.state);
                }
                None => {
                    self.ends.push(if result.error().is_some() { 0.0 } else { t_final });
                    self.last.extend(nothing(n));
                }
            }
            self.steps.push(result.steps());
            self.errors.push(result.error().map(str::to_owned));
        }
    }
}
