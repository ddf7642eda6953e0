//! Many integrations of one scene: from what varies to the table of what came out.
//!
//! Deliberately does not know: whether the scene is compiled or interpreted, how a trajectory is integrated, file formats.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::time::Instant;

use hamel_ensemble::{Ensemble, Lanes, Source, Stop, Trajectory};
use hamel_runtime::{
    Dop853, Dopri5, F64x4, Gauss4, Gauss6, Gauss8, Method, Options, Projected, Rk4, Taylor, Tsit5, Vern9,
};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use rayon::ThreadPool;
use rayon::iter::ParallelIterator as _;
use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator as _, IntoParallelRefIterator as _};
use serde::{Deserialize, Serialize};

use crate::admissible;
use crate::backend::Local;
use crate::codegen_bridge as bridge;
use crate::commands::{Choice, Starts, assignments};
use crate::dynamics::{BadParams, Dynamics, Factory, Info, LaneDynamics, VecState};
use crate::error::{Error, Problem};
use crate::eval::prepare;
use crate::simulate::{
    MAX_INVARIANTS, MethodName, Sample, Steps, chosen, has_series, has_state, not_projected, sample_time,
    why_stopped,
};
use crate::workspace::Workspace;

mod table;
mod variation;

use table::Table;
pub use table::Target;
pub use variation::{Spread, Sweep};

/// How many trajectories are integrated side by side by one core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
pub enum Width {
    /// One, with steps of its own: the bits of `simulate`.
    #[value(name = "1")]
    One,
    /// Four, with common steps that keep the tolerances of each; explicit methods only, otherwise one.
    #[default]
    #[value(name = "4")]
    Four,
}

/// Many integrations from time zero that differ in parameters and initial state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EnsembleRequest {
    /// Parameters and initial state of each trajectory.
    pub members: Vec<(Vec<f64>, Vec<f64>)>,
    /// Time to reach.
    pub t_final: f64,
    /// The method.
    pub method: MethodName,
    /// How it chooses steps.
    pub steps: Steps,
    /// Number of samples at equal distances, both ends included; a single one is the end.
    pub samples: usize,
    /// How many trajectories share a core's registers.
    pub width: Width,
    /// Largest number of steps of each, rejected ones included; none for [`Steps::max_steps`].
    pub max_steps: Option<u64>,
    /// Number of threads; none for that of the cores.
    pub threads: Option<usize>,
    /// How many trajectories of how many are done already, for the progress bar.
    pub done: (usize, usize),
}

impl EnsembleRequest {
    /// Options of every integration.
    ///
    /// # Errors
    /// [`Error::Options`] for a time that is not finite, and steps that the integrator does not take.
    pub fn options(&self) -> Result<Options<f64>, Error> {
        let options = self.steps.options(self.t_final, self.max_steps.unwrap_or(self.steps.max_steps()))?;
        options.validate().map_err(|e| Error::Options { reason: e.to_string() })?;
        Ok(options)
    }
}

/// What became of one trajectory.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Member {
    /// Samples as far as they were reached, then the last state if it stopped; none if it never started.
    pub samples: Vec<Sample>,
    /// Accepted steps, those of the trajectories beside it.
    pub steps: u64,
    /// Why it stopped before the end, or what has no value.
    pub error: Option<String>,
}

impl Member {
    fn failed(error: impl ToString) -> Member {
        Member { error: Some(error.to_string()), ..Member::default() }
    }
}

/// Integrates all members on several threads; results are in their order, and the same for any number of threads.
///
/// # Errors
/// [`Error::Options`] for a time, tolerances, a method or a number of threads that suit none of them.
pub fn integrate(factory: &dyn Factory, request: &EnsembleRequest) -> Result<Vec<Member>, Error> {
    let job = Job { factory, request };
    // What a scene can do depends on the scene alone, but takes parameters that are allowed.
    let any = request.members.iter().find_map(|(p, y)| Some((factory.prepare(p).ok()?, y)));
    let method = match &any {
        Some((dynamics, y)) => chosen(request.method, request.steps, &**dynamics, y)?,
        // No trajectory will start, whatever the method.
        None => MethodName::Dop853,
    };
    match method {
        MethodName::Tsit5 => job.on_lanes(Tsit5),
        MethodName::Dop853 => job.on_lanes(Dop853),
        MethodName::Vern9 => job.on_lanes(Vern9),
        MethodName::Dopri5 => job.on_lanes(Dopri5),
        MethodName::Rk4 => job.on_lanes(Rk4),
        MethodName::Gauss4 => job.run::<f64, _>(Gauss4::fixed_point()),
        MethodName::Gauss6 => job.run::<f64, _>(Gauss6::fixed_point()),
        MethodName::Gauss8 => job.run::<f64, _>(Gauss8::fixed_point()),
        MethodName::Gauss4Newton => job.run::<f64, _>(Gauss4::newton()),
        MethodName::Gauss6Newton => job.run::<f64, _>(Gauss6::newton()),
        MethodName::Gauss8Newton => job.run::<f64, _>(Gauss8::newton()),
        MethodName::Taylor => {
            if let Some((dynamics, y)) = &any {
                has_series(&**dynamics, y)?;
            }
            job.run::<f64, _>(Taylor::new())
        }
        MethodName::Projected => {
            match any.as_ref().map_or(Some(1), |(dynamics, _)| dynamics.n_invariants()) {
                Some(1..=4) => job.run::<f64, _>(Projected::<_, 4>::new(Vern9)),
                Some(5..=16) => job.run::<f64, _>(Projected::<_, 16>::new(Vern9)),
                Some(17..=MAX_INVARIANTS) => job.run::<f64, _>(Projected::<_, MAX_INVARIANTS>::new(Vern9)),
                n_invariants => Err(not_projected(factory.info(), n_invariants)),
            }
        }
        // Chosen above.
        MethodName::Auto => unreachable!("auto stands for another method"),
    }
}

/// The scenes of a factory for all parameters.
struct Scenes<'a>(&'a dyn Factory);

impl<'a> Source<f64> for Scenes<'a> {
    type State = VecState;
    type System = Box<dyn Dynamics + 'a>;
    type Error = BadParams;

    fn prepare(&self, params: &[f64]) -> Result<Self::System, BadParams> {
        self.0.prepare(params)
    }

    fn state(&self, components: &[f64]) -> VecState {
        VecState(components.to_vec())
    }
}

impl<'a> Source<F64x4> for Scenes<'a> {
    type State = VecState<F64x4>;
    type System = Box<dyn LaneDynamics + 'a>;
    type Error = BadParams;

    fn prepare(&self, params: &[F64x4]) -> Result<Self::System, BadParams> {
        self.0.prepare_lanes(params)
    }

    fn state(&self, components: &[F64x4]) -> VecState<F64x4> {
        VecState(components.to_vec())
    }
}

struct Job<'a> {
    factory: &'a dyn Factory,
    request: &'a EnsembleRequest,
}

impl<'a> Job<'a> {
    fn on_lanes<M>(&self, method: M) -> Result<Vec<Member>, Error>
    where
        M: Method<f64, Box<dyn Dynamics + 'a>> + Method<F64x4, Box<dyn LaneDynamics + 'a>> + Sync,
    {
        match self.request.width {
            Width::One => self.run::<f64, M>(method),
            Width::Four => self.run::<F64x4, M>(method),
        }
    }

    fn run<L, M>(&self, method: M) -> Result<Vec<Member>, Error>
    where
        L: Lanes,
        Scenes<'a>: Source<L, Error = BadParams>,
        M: Method<f64, Box<dyn Dynamics + 'a>> + Method<L, <Scenes<'a> as Source<L>>::System> + Sync,
    {
        let request = self.request;
        let refused = |e: hamel_runtime::Error| Error::Options { reason: e.to_string() };
        let options = request.options()?;
        Method::<f64, Box<dyn Dynamics + 'a>>::validate(&method, &options).map_err(refused)?;
        let (params, initial): (Vec<&[f64]>, Vec<VecState>) =
            request.members.iter().map(|(params, y)| (params.as_slice(), VecState(y.clone()))).unzip();
        let times: Vec<f64> =
            (0..request.samples).map(|k| sample_time(request.t_final, request.samples, k)).collect();
        let ensemble = Ensemble::new(method, options).with_lanes::<L>();
        let bar = progress_bar(request.done);
        let members = pool(request.threads)?.install(|| {
            let scenes = Scenes(self.factory);
            let progress = |n: usize| bar.inc(n as u64);
            let trajectories =
                ensemble.run_from(&scenes, &params, &initial, request.t_final, &times, progress);
            let one = |(trajectory, params): (_, &&[f64])| self.member(trajectory, params, &times);
            Ok(trajectories?.into_par_iter().zip(&params).map(one).collect())
        });
        bar.finish_and_clear();
        // As many parameters as states, by construction.
        members.map_err(|e: hamel_ensemble::Error| Error::Options { reason: e.to_string() })
    }

    /// A trajectory with times, energies and words.
    fn member(&self, trajectory: Trajectory<VecState, BadParams>, params: &[f64], times: &[f64]) -> Member {
        let info = self.factory.info();
        let mut error = trajectory.stop.as_ref().map(|stop| match stop {
            Stop::Params(bad) => bad.to_string(),
            Stop::Integration(error) => why_stopped(info, error),
            other => format!("{other:?}"),
        });
        // With a known reason the parameters may not be allowed, and then there is no state either.
        let Ok(dynamics) = self.factory.prepare(params) else { return Member { error, ..Member::default() } };
        let has_started = trajectory.stats.rhs_evals > 0;
        let reached = times.iter().copied().zip(trajectory.samples);
        let is_new = has_started && error.is_some();
        let last = is_new.then_some((trajectory.t, trajectory.state));
        let mut samples: Vec<Sample> = Vec::with_capacity(reached.len() + 1);
        for (t, state) in reached.chain(last) {
            if samples.last().is_some_and(|s| s.t == t) {
                continue;
            }
            let energy = dynamics.energy(t, &state.0).filter(|e| e.is_finite());
            if info.has_energy && energy.is_none() {
                error.get_or_insert_with(|| format!("the energy is not finite at t = {t:?}"));
            }
            samples.push(Sample { t, state: state.0, energy, outputs: Vec::new() });
        }
        Member { samples, steps: trajectory.stats.steps, error }
    }
}

/// Most threads: several for each core of a large machine, and far fewer than a system refuses.
const MAX_THREADS: usize = 1024;

/// Threads for an ensemble.
fn pool(threads: Option<usize>) -> Result<ThreadPool, Error> {
    if let Some(n) = threads.filter(|n| *n > MAX_THREADS) {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let reason = format!(
            "is {n}, but at most {MAX_THREADS} are started: leave it out for as many as there are cores, {cores} here"
        );
        return Err(unusable("--threads", reason));
    }
    // Zero is the pool's word for as many as there are cores.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|e| Error::Options { reason: format!("threads could not be started: {e}") })
}

/// A bar on a terminal.
fn progress_bar((done, all): (usize, usize)) -> ProgressBar {
    let bar = ProgressBar::new(all as u64);
    if !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    // The template is a constant that indicatif accepts.
    let style = ProgressStyle::with_template("  {bar:40.cyan/blue} {pos} of {len} trajectories  {eta} left");
    bar.set_style(style.expect("valid template"));
    bar.set_position(done as u64);
    // What was done before the bar took no time of it.
    bar.reset_eta();
    bar
}

/// Arguments of `ensemble`.
#[derive(Clone, Debug, Default)]
pub struct Arguments {
    /// What takes each value of a grid.
    pub sweep: Vec<Sweep>,
    /// What is drawn.
    pub spread: Vec<Spread>,
    /// Number of draws for each point of the grid and each line of the table.
    pub count: Option<usize>,
    /// Seed of what is drawn.
    pub seed: u64,
    /// Table of parameters and components of initial states.
    pub table: Option<PathBuf>,
    /// Parameters of all that differ from the defaults.
    pub set: Vec<(String, f64)>,
    /// Components of all initial states that differ from the default one.
    pub initial: Vec<(String, f64)>,
    /// Time to reach.
    pub t_final: f64,
    /// The method.
    pub method: MethodName,
    /// Relative tolerance.
    pub rtol: Option<f64>,
    /// Absolute tolerance.
    pub atol: Option<f64>,
    /// Size of fixed steps.
    pub step: Option<f64>,
    /// Largest number of steps of each trajectory.
    pub max_steps: Option<u64>,
    /// Number of samples of each trajectory.
    pub samples: usize,
    /// How many trajectories share a core's registers.
    pub width: Width,
    /// Number of threads.
    pub threads: Option<usize>,
    /// Files to write.
    pub outputs: Vec<PathBuf>,
}

/// Most numbers of one table: half a gigabyte in memory, more as text.
const MAX_NUMBERS: usize = 50_000_000;
/// Numbers of one request, so that neither process holds all of them as text.
const NUMBERS_AT_ONCE: usize = 1 << 19;

/// `ensemble`: integrates all, writes the table, and returns a summary for people.
///
/// # Errors
/// Everything that can be wrong with names, values and files; not what stops a trajectory, unless it stops all:
/// [`Error::NoneArrived`], after the files have been written.
pub fn ensemble(workspace: &Workspace, choice: &Choice, arguments: &Arguments) -> Result<String, Error> {
    let clock = Instant::now();
    let targets: Vec<Target> = arguments.outputs.iter().map(|p| Target::new(p)).collect::<Result<_, _>>()?;
    let steps = Steps::new(arguments.method, arguments.rtol, arguments.atol, arguments.step)
        .map_err(|reason| unusable("--step", reason))?;
    let spec = workspace.spec(&choice.model)?;
    let model = bridge::read(workspace, &spec)?;
    // Chooses initial states, here and on all threads; it agrees bit for bit with the compiled scene.
    let built = bridge::build(&model, &choice.scene)?;
    has_state(built.info())?;
    let plan = Plan::new(built.info(), arguments)?;
    let mut backend = choice.open(workspace, &spec)?;
    let info = backend.info().clone();
    if plan.len().saturating_mul(arguments.samples.saturating_mul(info.state.len() + 2)) > MAX_NUMBERS {
        let reason = format!(
            "is {}, which makes more than {MAX_NUMBERS} numbers of {} trajectories: take fewer of either",
            arguments.samples,
            plan.len()
        );
        return Err(unusable("--samples", reason));
    }
    let starts = Starts::new(&model, &info)?;
    let members = pool(arguments.threads)?.install(|| plan.members(&starts, &built));
    let (inputs, members): (Vec<Vec<f64>>, Vec<Result<_, String>>) = members.into_iter().unzip();

    // A multiple of the lanes, so that neighbours do not depend on it.
    let at_once = (NUMBERS_AT_ONCE / (arguments.samples * (info.state.len() + 2))).clamp(256, 8192) / 8 * 8;
    let sound: Vec<&(Vec<f64>, Vec<f64>)> = members.iter().filter_map(|m| m.as_ref().ok()).collect();
    let mut integrated = Vec::with_capacity(sound.len());
    for part in sound.chunks(at_once) {
        let request = EnsembleRequest {
            members: part.iter().map(|member| (*member).clone()).collect(),
            t_final: arguments.t_final,
            method: arguments.method,
            steps,
            samples: arguments.samples,
            width: arguments.width,
            max_steps: arguments.max_steps,
            threads: arguments.threads,
            done: (integrated.len(), sound.len()),
        };
        integrated.extend(backend.ensemble(&request)?);
    }
    let mut integrated = integrated.into_iter();
    let results: Vec<Member> = members
        .iter()
        .map(|member| match member {
            Ok(_) => integrated.next().unwrap_or_default(),
            Err(error) => Member::failed(error),
        })
        .collect();
    let times =
        (0..arguments.samples).map(|k| sample_time(arguments.t_final, arguments.samples, k)).collect();
    let table = Table { info: &info, input_names: plan.names(), inputs, times, results };
    for target in &targets {
        target.write(&table)?;
    }
    if let Some(reason) = table.results.iter().map(|r| r.error.clone()).collect::<Option<Vec<_>>>() {
        // There is at least one trajectory.
        let reason = reason.into_iter().next().unwrap_or_default();
        let files = targets.iter().map(|target| target.path().to_owned()).collect();
        return Err(Error::NoneArrived { n: table.results.len(), reason, files });
    }
    Ok(summary(&table, &targets, clock.elapsed().as_secs_f64()))
}

fn unusable(path: &str, reason: String) -> Error {
    Error::Request { problems: vec![Problem::Unusable { path: path.into(), reason }] }
}

/// For people: how many, how many stopped, and why the first did.
fn summary(table: &Table<'_>, targets: &[Target], seconds: f64) -> String {
    let results = &table.results;
    let stopped: Vec<(usize, &str)> =
        results.iter().enumerate().filter_map(|(k, r)| Some((k, r.error.as_deref()?))).collect();
    let steps: u64 = results.iter().map(|r| r.steps).sum();
    let mut text = format!(
        "{}: {} trajectories, {} stopped, {steps} steps, {seconds:.1} s",
        table.info.model,
        results.len(),
        stopped.len()
    );
    if let Some((k, reason)) = stopped.first() {
        let _ = write!(text, "\n  the first that stopped is {k}: {}", reason.replace('\n', "\n    "));
    }
    for target in targets {
        let _ = write!(text, "\nwrote {}", target.path().display());
    }
    text
}

/// What each trajectory starts from: every line of the table, with every point of the grid, as often as values are drawn.
struct Plan<'a> {
    arguments: &'a Arguments,
    info: &'a Info,
    /// Parameters of all.
    set: BTreeMap<String, f64>,
    /// Components of all initial states.
    given: BTreeMap<String, f64>,
    /// Names in the table, then those of the grid.
    names: Vec<String>,
    /// Values of these names.
    points: Vec<Vec<f64>>,
}

/// Parameters and initial state of a trajectory, or why there are none, after the values that vary.
type Start = (Vec<f64>, Result<(Vec<f64>, Vec<f64>), String>);

impl<'a> Plan<'a> {
    fn new(info: &'a Info, arguments: &'a Arguments) -> Result<Plan<'a>, Error> {
        if arguments.samples == 0 {
            return Err(unusable("--samples", "is 0, but the end is a sample: give at least 1".into()));
        }
        let (mut names, mut points) = match &arguments.table {
            Some(path) => variation::read_table(path)?,
            None => (Vec::new(), vec![Vec::new()]),
        };
        let zeros = |names: &mut dyn Iterator<Item = &String>| {
            names.map(|name| (name.clone(), 0.0)).collect::<Vec<(String, f64)>>()
        };
        let mut problems = Vec::new();
        let known: Vec<&str> = info.param_names().into_iter().chain(info.state_names()).collect();
        let kind = "parameter or state variable";
        let set = assignments(&arguments.set, "--set", "parameter", &info.param_names(), &mut problems);
        let given = assignments(&arguments.initial, "--initial", "state", &info.state_names(), &mut problems);
        let of_table = assignments(&zeros(&mut names.iter()), "--table", kind, &known, &mut problems);
        let swept = zeros(&mut arguments.sweep.iter().map(|s| &s.name));
        let swept = assignments(&swept, "--sweep", kind, &known, &mut problems);
        let spread = zeros(&mut arguments.spread.iter().map(|s| &s.name));
        assignments(&spread, "--spread", kind, &known, &mut problems);
        let sources = [("--set", &set), ("--initial", &given), ("--table", &of_table), ("--sweep", &swept)];
        for (at, (path, values)) in sources.iter().enumerate() {
            for (other, earlier) in &sources[..at] {
                problems.extend(values.keys().filter(|name| earlier.contains_key(*name)).map(|name| {
                    let reason = format!("gives {name}, which {other} gives as well: leave one of them out");
                    Problem::Unusable { path: (*path).to_owned(), reason }
                }));
            }
        }
        if !problems.is_empty() {
            return Err(Error::Request { problems });
        }
        let count = arguments.count.unwrap_or(1);
        let lines = points.len();
        let grid = arguments.sweep.iter().map(|s| s.n).try_fold(1_usize, usize::checked_mul);
        if count == 0 || lines == 0 {
            let path = if count == 0 { "--count" } else { "--table" };
            return Err(unusable(path, "leaves no trajectory: give at least one".into()));
        }
        let all = grid.and_then(|n| n.checked_mul(lines)?.checked_mul(count));
        if all.is_none_or(|n| n > MAX_NUMBERS) {
            // The factors, the largest of which is to blame.
            let factors = [
                (grid.unwrap_or(usize::MAX), "--sweep", "points of the grid"),
                (count, "--count", "draws"),
                (lines, "--table", "lines"),
            ];
            let told = factors.iter().filter(|(n, ..)| *n > 1).map(|(n, _, what)| match *n {
                usize::MAX => format!("too many {what}"),
                n => format!("{n} {what}"),
            });
            let told = told.collect::<Vec<_>>().join(" times ");
            let (_, path, _) = factors.into_iter().max_by_key(|(n, ..)| *n).unwrap_or(factors[0]);
            let reason = format!("makes more than {MAX_NUMBERS} trajectories ({told}): take fewer");
            return Err(unusable(path, reason));
        }
        for sweep in &arguments.sweep {
            names.push(sweep.name.clone());
            let with_each = |point: Vec<f64>| {
                (0..sweep.n).map(move |k| point.iter().copied().chain([sweep.value(k)]).collect())
            };
            points = points.into_iter().flat_map(with_each).collect();
        }
        Ok(Plan { arguments, info, set, given, names, points })
    }

    fn count(&self) -> usize {
        self.arguments.count.unwrap_or(1)
    }

    /// Number of trajectories.
    fn len(&self) -> usize {
        self.points.len() * self.count()
    }

    /// Names of all that varies.
    fn names(&self) -> Vec<String> {
        let drawn = self.arguments.spread.iter().map(|s| &s.name).filter(|name| !self.names.contains(name));
        self.names.iter().chain(drawn).cloned().collect()
    }

    /// The starts of all trajectories, on the threads of the current pool.
    fn members(&self, starts: &Starts<'_>, scene: &bridge::Built) -> Vec<Start> {
        let choose = |values: &[(&str, f64)]| {
            let (mut set, mut given) = (self.set.clone(), self.given.clone());
            for (name, value) in values {
                let is_param = self.info.params.iter().any(|p| p.name == *name);
                if is_param { &mut set } else { &mut given }.insert((*name).to_owned(), *value);
            }
            let chosen = starts.choose(&mut Local::new(scene), &set, &given).and_then(|(params, y)| {
                admissible::check(&*prepare(scene, &params)?, &y, 0)?;
                Ok((params, y))
            });
            chosen.map_err(|e| e.to_string())
        };
        let at_point = |point: &Vec<f64>| -> Vec<(&str, f64)> {
            self.names.iter().map(String::as_str).zip(point.iter().copied()).collect()
        };
        // What is drawn is drawn around these.
        let nominal: Vec<_> = self.points.par_iter().map(|point| choose(&at_point(point))).collect();
        let names = self.names();
        let start = |k: usize| -> Start {
            let at = k / self.count();
            let mut values = at_point(&self.points[at]);
            let around = match &nominal[at] {
                Ok(around) if !self.arguments.spread.is_empty() => around,
                chosen => {
                    values.resize(names.len(), ("", f64::NAN));
                    return (values.into_iter().map(|(_, x)| x).collect(), chosen.clone());
                }
            };
            let (params, state) = around;
            for spread in &self.arguments.spread {
                let here = |names: &[&str], values: &[f64]| {
                    names.iter().zip(values).find(|(name, _)| **name == spread.name).map(|(_, x)| *x)
                };
                let center = here(&self.info.param_names(), params)
                    .or_else(|| here(&self.info.state_names(), state))
                    .unwrap_or_default();
                let value = spread.draw(center, self.arguments.seed, k);
                match values.iter_mut().find(|(name, _)| *name == spread.name) {
                    Some((_, x)) => *x = value,
                    None => values.push((spread.name.as_str(), value)),
                }
            }
            (values.iter().map(|(_, x)| *x).collect(), choose(&values))
        };
        (0..self.len()).into_par_iter().map(start).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::progress_bar;

    /// Of work that was done before the bar there is no speed.
    #[test]
    fn trajectories_done_before_take_no_part_in_the_time_left() {
        let bar = progress_bar((8192, 100_000));
        assert_eq!(bar.position(), 8192);
        // Zero, or not a number where the clock has not moved.
        assert!(bar.per_sec().is_nan() || bar.per_sec() == 0.0, "{}", bar.per_sec());
    }
}
