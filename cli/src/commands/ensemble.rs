//! `ensemble`: many motions with parameters and initial states that vary, as one table.
//!
//! Does not know: how trajectories are integrated, file formats.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use rayon::iter::{IntoParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _};

use super::options::{EndOptions, MotionOptions, SceneOptions, assignments};
use crate::error::{Error, Problem};
use crate::output::table::{self, Target};
use crate::request::table::Table;
use crate::request::variation::{Spread, Sweep};
use crate::run::admissible;
use crate::run::backend::Local;
use crate::run::dynamics::Factory as _;
use crate::run::ensemble::{EnsembleRequest, Member, Width, pool};
use crate::run::evaluate::prepare;
use crate::run::forms::Forms;
use crate::run::info::Info;
use crate::run::integrate::has_state;
use crate::run::interpreted::{self, Built};
use crate::run::method::Steps;
use crate::run::simulation::sample_time;
use crate::run::start::Starts;
use crate::session::Session;

/// Integrate a model many times, with parameters and initial states that vary; write a table
///
/// What varies takes every value of a grid (--sweep), is drawn at random (--spread), or is read from a table (--table).
/// Several of these are combined: every line of the table, with every point of the grid, --count times. What is drawn
/// depends on the seed, the name and the number of the trajectory alone. The rest of a state is chosen as by simulate,
/// for each trajectory anew, so that constraints hold.
///
/// Four trajectories are integrated side by side in the registers of a core, and the cores share the work; results
/// depend on neither the number of threads nor --via. A trajectory that stops keeps its last state, the reason is in
/// the column `error`, and the others go on; when none reaches the end, the exit status is 1. Integration starts at t =
/// 0.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel ensemble heavy_top --sweep Omega3=0..20:101 --t-final 5 -o tops.csv
  hamel ensemble heavy_top --spread m=0.05 Omega1=-0.1..0.1 --count 1000 --seed 7 --samples 101 -o tops.npz
  hamel ensemble heavy_top --sweep m=log:0.1..10:5 l=0.1..1:5 --method tsit5 --rtol 1e-6 --atol 1e-8 -o grid.csv
  hamel ensemble euler_disk --table starts.csv --set m=2 -o disks.csv"
)]
pub struct Arguments {
    /// Which scene, and who evaluates it.
    #[command(flatten)]
    pub scene: SceneOptions,
    /// Parameter or component of the initial state that takes N values from A to B, or with equal ratios from log:A to
    /// B
    #[arg(long, value_name = "NAME=[log:]A..B:N", num_args = 1.., value_parser = Sweep::parse)]
    pub sweep: Vec<Sweep>,
    /// Parameter or component to draw: normally distributed around its value with standard deviation SIGMA, or
    /// uniformly from A..B, or with a uniform logarithm from log:A..B
    #[arg(long, value_name = "NAME=SIGMA|[log:]A..B", num_args = 1.., requires = "count", value_parser = Spread::parse)]
    pub spread: Vec<Spread>,
    /// Number of draws, for each line of the table and point of the grid
    #[arg(long, value_name = "N", requires = "spread")]
    pub count: Option<usize>,
    /// Seed of what is drawn
    #[arg(long, default_value_t = 0, requires = "spread")]
    pub seed: u64,
    /// File (CSV) of parameters and components of initial states: a line of names, then a line for each trajectory
    #[arg(long, value_name = "FILE")]
    pub table: Option<PathBuf>,
    /// From where, and how.
    #[command(flatten)]
    pub motion: MotionOptions,
    /// To where.
    #[command(flatten)]
    pub end: EndOptions,
    /// Number of samples of each trajectory at equal distances, both ends included; a single one is the end
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub samples: usize,
    /// Trajectories side by side in a core, with common steps; explicit methods only, the others take one at a time
    #[arg(long, value_enum, default_value_t)]
    pub lanes: Width,
    /// Number of threads, at most 1024; results do not depend on it [default: that of the cores]
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// File to write: .csv or .npz; may be repeated
    #[arg(short, long = "output", value_name = "FILE", required = true)]
    pub output: Vec<PathBuf>,
}

/// Most numbers of one table: half a gigabyte in memory, more as text.
const MAX_NUMBERS: usize = 50_000_000;
/// Numbers of one request, so that neither process holds all of them as text.
const NUMBERS_AT_ONCE: usize = 1 << 19;

/// Integrates all, writes the table, and returns a summary for people.
///
/// # Errors
/// Everything that can be wrong with names, values and files; not what stops a trajectory, unless it stops all:
/// [`Error::NoneArrived`], after the files have been written.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let clock = Instant::now();
    let motion = &arguments.motion;
    let targets: Vec<Target> = arguments.output.iter().map(|p| Target::new(p)).collect::<Result<_, _>>()?;
    let steps = Steps::new(motion.method, motion.rtol, motion.atol, motion.step)
        .map_err(|reason| Error::unusable("--step", reason))?;
    let (file, choice) = (arguments.scene.find(session)?, arguments.scene.choice()?);
    let model = file.model()?;
    // Chooses initial states, here and on all threads; it agrees bit for bit with the compiled scene.
    let built = interpreted::build(model, &choice.scene)?;
    has_state(built.info())?;
    let forms = Forms::of(model, built.info())?;
    if built.watched().is_some_and(|watched| watched.acts()) {
        let reason = "has events that change the state or end the motion, which ensembles do not carry out: choose a \
                      scene without `events`";
        return Err(Error::unusable("--scene", reason));
    }
    let plan = Plan::new(built.info(), &forms, arguments)?;
    let mut backend = choice.open(&file)?;
    let info = backend.info().clone();
    if plan.len().saturating_mul(arguments.samples.saturating_mul(info.state.len() + 2)) > MAX_NUMBERS {
        let reason = format!(
            "is {}, which makes more than {MAX_NUMBERS} numbers of {} trajectories: take fewer of either",
            arguments.samples,
            plan.len()
        );
        return Err(Error::unusable("--samples", reason));
    }
    let starts = Starts::new(model, &info, forms)?;
    let members = pool(arguments.threads)?.install(|| plan.members(&starts, &built));
    let (inputs, members): (Vec<Vec<f64>>, Vec<Result<_, String>>) = members.into_iter().unzip();

    // A multiple of the lanes, so that neighbours do not depend on it.
    let at_once = (NUMBERS_AT_ONCE / (arguments.samples * (info.state.len() + 2))).clamp(256, 8192) / 8 * 8;
    let sound: Vec<&(Vec<f64>, Vec<f64>)> = members.iter().filter_map(|m| m.as_ref().ok()).collect();
    let mut integrated = Vec::with_capacity(sound.len());
    for part in sound.chunks(at_once) {
        let request = EnsembleRequest {
            members: part.iter().map(|member| (*member).clone()).collect(),
            t_final: arguments.end.t_final,
            method: motion.method,
            steps,
            samples: arguments.samples,
            width: arguments.lanes,
            max_steps: motion.max_steps,
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
        (0..arguments.samples).map(|k| sample_time(arguments.end.t_final, arguments.samples, k)).collect();
    let table = table::Table { info: &info, input_names: plan.names(), inputs, times, results };
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

/// For people: how many, how many stopped, and why the first did.
fn summary(table: &table::Table<'_>, targets: &[Target], seconds: f64) -> String {
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

/// What each trajectory starts from: every line of the table, with every point of the grid, as often as values are
/// drawn.
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
    fn new(info: &'a Info, forms: &Forms, arguments: &'a Arguments) -> Result<Plan<'a>, Error> {
        if arguments.samples == 0 {
            return Err(Error::unusable("--samples", "is 0, but the end is a sample: give at least 1"));
        }
        let (mut names, mut points) = match &arguments.table {
            Some(path) => Table::read(path)?.full()?,
            None => (Vec::new(), vec![Vec::new()]),
        };
        let zeros = |names: &mut dyn Iterator<Item = &String>| {
            names.map(|name| (name.clone(), 0.0)).collect::<Vec<(String, f64)>>()
        };
        let mut problems = Vec::new();
        let known: Vec<&str> = info.param_names().into_iter().chain(forms.known()).collect();
        let kind = "parameter or state variable";
        let set =
            assignments(&arguments.motion.set, "--set", "parameter", &info.param_names(), &mut problems);
        let given =
            assignments(&arguments.motion.initial, "--initial", "state", &forms.known(), &mut problems);
        let of_table = assignments(&zeros(&mut names.iter()), "--table", kind, &known, &mut problems);
        let swept = zeros(&mut arguments.sweep.iter().map(|s| &s.name));
        let swept = assignments(&swept, "--sweep", kind, &known, &mut problems);
        let spread = zeros(&mut arguments.spread.iter().map(|s| &s.name));
        let spread = assignments(&spread, "--spread", kind, &known, &mut problems);
        let all = given.keys().chain(of_table.keys()).chain(swept.keys()).chain(spread.keys());
        if let Err(reason) = forms.form_of(all.map(String::as_str)) {
            problems.push(Problem::Unusable { path: "the initial state".into(), reason });
        }
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
            return Err(Error::unusable(path, "leaves no trajectory: give at least one"));
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
            return Err(Error::unusable(path, reason));
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
    fn members(&self, starts: &Starts<'_>, scene: &Built) -> Vec<Start> {
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
                let params_by_name = self.info.param_names().into_iter().zip(params);
                let center = match params_by_name.into_iter().find(|(name, _)| *name == spread.name) {
                    Some((_, x)) => *x,
                    None => match starts.value(params, state, &spread.name) {
                        Ok(x) => x.unwrap_or_default(),
                        Err(error) => {
                            values.resize(names.len(), ("", f64::NAN));
                            return (values.into_iter().map(|(_, x)| x).collect(), Err(error.to_string()));
                        }
                    },
                };
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
