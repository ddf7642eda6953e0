//! What is measured, scene by scene on all cores, under a progress bar.
//!
//! Deliberately does not know: how results are shown.

use std::sync::Mutex;

use hamel_codegen::spec::Want;
use hamel_measure::both::Both;
use hamel_measure::random::Random;
use hamel_run::Error;
use hamel_run::dynamics::Factory;
use hamel_run::info::Info;
use hamel_run::interpreted;
use indicatif::{ProgressBar, ProgressStyle};

use crate::accuracy::{Accuracy, Function, Sample};
use crate::bounds;
use crate::motion::{self, METHODS, RunResult};
use crate::report;
use crate::request::{SceneRequest, StressRequest};
use crate::sample::{Region, magnitude, ordinary_params, scaled_params, state};
use crate::subject::Subject;
use crate::sweeps::{DISTANCES, Place, SWEEPS, Sweep};

/// States per scene: more than a million of all scenes together.
const SAMPLES: u64 = 20_000;
/// States per scene of a short run.
const SHORT: u64 = 2_000;
/// Steps of a long run.
const STEPS: u64 = 10_000_000;
/// Steps of a run that is not long.
const SHORT_STEPS: u64 = 100_000;
/// Outputs are evaluated at one state in so many.
const OUTPUTS_EVERY: u64 = 8;
/// Parameters very far from the defaults are tried at one state in so many.
const EXTREME_EVERY: u64 = 4;
/// Decades by which each parameter is moved up or down: those of a machine that one builds, and the extreme ones.
const BUILT: f64 = 3.0;
const EXTREME: f64 = 8.0;
/// Models whose scene `invariants` is followed for long.
const LONG: [&str; 10] = [
    "free_rigid_body",
    "heavy_top",
    "kirchhoff_body",
    "chaplygin_ball",
    "chaplygin_sleigh",
    "euler_disk_advected",
    "snakeboard",
    "suslov",
    "veselova",
    "two_arm_satellite",
];
/// Draws of parameters until the conditions of the model hold.
const DRAWS: usize = 1_000;

/// What was found for a scene.
#[derive(Debug)]
pub struct SceneResult {
    /// Names and defaults.
    pub info: Info,
    /// The right-hand side near the default parameters.
    pub rhs: Accuracy,
    /// Outputs and energy there.
    pub outputs: Accuracy,
    /// The right-hand side with every parameter moved by a factor from 1e-3 to 1e3 of its own.
    pub built: Accuracy,
    /// Outputs and energy there.
    pub built_outputs: Accuracy,
    /// The right-hand side at extreme parameters.
    pub extreme: Accuracy,
}

/// What was found on the way to a singular place: one result for each of [`DISTANCES`].
#[derive(Debug)]
pub struct SweepResult {
    /// The way.
    pub sweep: &'static Sweep,
    /// The right-hand side, by distance.
    pub at: Vec<Accuracy>,
}

/// Everything.
#[derive(Debug, Default)]
pub struct Results {
    /// By scene.
    pub scenes: Vec<SceneResult>,
    /// By sweep.
    pub sweeps: Vec<SweepResult>,
    /// Long runs.
    pub runs: Vec<RunResult>,
}

/// Applies `work` to all of `items` on all cores, in order.
fn parallel<T: Sync, R: Send>(items: &[T], bar: &ProgressBar, work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = Mutex::new(0);
    let results = Mutex::new(Vec::new());
    let n = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..n {
            scope.spawn(|| {
                loop {
                    let at = {
                        let mut next = next.lock().expect("no thread panics");
                        *next += 1;
                        *next - 1
                    };
                    let Some(item) = items.get(at) else { return };
                    let result = work(item);
                    results.lock().expect("no thread panics").push((at, result));
                    bar.inc(1);
                }
            });
        }
    });
    let mut results = results.into_inner().expect("no thread panics");
    results.sort_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}

/// A random sequence of its own for everything that has a name: the 64-bit FNV-1a hash of it.
fn random(name: &str) -> Random {
    Random(name.bytes().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)))
}

fn scene_result(subject: &Subject, scene: &SceneRequest, samples: u64) -> SceneResult {
    let info = subject.info();
    let defaults = info.defaults();
    let mut random = random(&format!("{} {}", info.model, info.scene));
    // A sequence of its own, so that the states of one part do not depend on the draws of another.
    let mut random_built = self::random(&format!("{} {} built", info.model, info.scene));
    let [rhs, outputs, built, built_outputs, extreme] = [(); 5].map(|()| Accuracy::default());
    let mut result = SceneResult { info: info.clone(), rhs, outputs, built, built_outputs, extreme };
    for k in 0..samples {
        let region = Region::ALL[k as usize % Region::ALL.len()];
        let y = state(scene, region, &mut random);
        let t = random.number();
        let params = ordinary_params(&defaults, &mut random);
        let sample = Sample { params, y, t, origin: format!("{region:?}") };
        result.rhs.add(subject, Function::Rhs, &sample);
        if k % OUTPUTS_EVERY == 0 {
            result.outputs.add(subject, Function::Outputs, &sample);
        }
        let of_machine = built_sample(subject, scene, region, &mut random_built);
        result.built.add(subject, Function::Rhs, &of_machine);
        if k % OUTPUTS_EVERY == 0 {
            result.built_outputs.add(subject, Function::Outputs, &of_machine);
        }
        if k % EXTREME_EVERY == 0 {
            let params = scaled_params(&defaults, EXTREME, &mut random);
            result.extreme.add(subject, Function::Rhs, &Sample { params, ..sample });
        }
    }
    let SceneResult { rhs, outputs, built, built_outputs, extreme, .. } = &mut result;
    [rhs, outputs, built, built_outputs, extreme].into_iter().for_each(Accuracy::finish);
    result
}

/// A state with parameters of a machine that one builds: such as the conditions of the model allow, unless hardly any
/// do.
fn built_sample(subject: &Subject, scene: &SceneRequest, region: Region, random: &mut Random) -> Sample {
    let defaults = subject.info().defaults();
    let y = state(scene, region, random);
    let t = random.number();
    let mut params = scaled_params(&defaults, BUILT, random);
    for _ in 0..DRAWS {
        let lifted: Vec<Both> = params.iter().map(|x| Both::input(*x)).collect();
        if subject.prepare(&lifted).is_some() {
            break;
        }
        params = scaled_params(&defaults, BUILT, random);
    }
    Sample { params, y, t, origin: format!("{region:?}, parameters moved by up to {BUILT} decades") }
}

fn sweep_result(subject: &Subject, scene: &SceneRequest, sweep: &'static Sweep, samples: u64) -> SweepResult {
    let info = subject.info();
    let defaults = info.defaults();
    let (names, param_names) = (info.state_names(), info.param_names());
    let mut random = random(sweep.what);
    let at = DISTANCES.map(|distance| {
        let mut accuracy = Accuracy::default();
        for _ in 0..samples {
            let mut y = state(scene, Region::Ordinary, &mut random);
            let mut params = ordinary_params(&defaults, &mut random);
            // Not the power of ten itself, whose digits may be lucky.
            let distance = distance * magnitude(&mut random, -0.1, 0.1).abs();
            let mut place =
                Place { names: &names, y: &mut y, param_names: &param_names, params: &mut params };
            (sweep.place)(&mut place, distance);
            let sample = Sample { params, y, t: 0.0, origin: format!("d = {distance:e}") };
            accuracy.add(subject, Function::Rhs, &sample);
        }
        accuracy.finish();
        accuracy
    });
    SweepResult { sweep, at: at.into() }
}

/// Measures what the request asks for, with long runs of `LONG`, prints a summary and writes the files.
///
/// # Errors
/// [`Error::Failed`] when a bound of a short run is exceeded or missing; [`Error::Io`].
pub fn run(request: StressRequest) -> Result<(), Error> {
    let StressRequest { mut scenes, short, samples, steps, folder } = request;
    let samples = samples.unwrap_or(if short { SHORT } else { SAMPLES });
    let bar = ProgressBar::new(scenes.len() as u64);
    let template = "  {bar:40.cyan/blue} {pos}/{len}  {elapsed}  {eta} left";
    // The template is a constant that indicatif accepts.
    bar.set_style(ProgressStyle::with_template(template).expect("valid template"));
    let subjects = parallel(&scenes, &bar, |of| Subject::new(&of.model.name, &of.text, &of.scene));
    let mut chosen: Vec<(&Subject, &SceneRequest)> = Vec::new();
    for (scene, subject) in scenes.iter_mut().zip(&subjects) {
        scene.order(&subject.info().state);
        chosen.push((subject, scene));
    }
    let sweeps: Vec<_> = SWEEPS
        .iter()
        .filter_map(|sweep| {
            let is_it = |s: &Info| (s.model.as_str(), s.scene.as_str()) == sweep.scene;
            let found = chosen.iter().find(|(subject, _)| is_it(subject.info()))?;
            Some((found.0, found.1, sweep))
        })
        .collect();

    let is_long = |scene: &SceneRequest| {
        LONG.contains(&scene.model.name.as_str()) && scene.scene == Want::Invariants.name()
    };
    let mut long = Vec::new();
    for (_, scene) in chosen.iter().filter(|(_, scene)| is_long(scene)) {
        long.push((interpreted::build(&scene.model, &scene.scene)?.in_memory(), *scene));
    }
    let runs: Vec<_> = (long.iter())
        .flat_map(|(factory, scene)| METHODS.iter().map(move |method| (factory, *scene, *method)))
        .collect();
    let steps = steps.unwrap_or(if short { SHORT_STEPS } else { STEPS });

    bar.inc_length((chosen.len() + sweeps.len() + runs.len()) as u64);
    let results = Results {
        scenes: parallel(&chosen, &bar, |(subject, scene)| scene_result(subject, scene, samples)),
        sweeps: parallel(&sweeps, &bar, |(subject, scene, sweep)| {
            sweep_result(subject, scene, sweep, (samples / 20).min(2_000))
        }),
        runs: parallel(&runs, &bar, |(factory, scene, method)| {
            motion::run(*factory as &dyn Factory, &scene.initial, *method, steps)
        })
        .into_iter()
        .collect::<Result<_, _>>()?,
    };
    bar.finish_and_clear();

    let shown = if folder.is_some() || short { report::summary } else { report::detailed_summary };
    println!("{}", shown(&results));
    if let Some(folder) = folder {
        for (name, text) in [
            ("stress.md", report::markdown(&results, samples)),
            ("stress.csv", report::csv(&results)),
            ("stress_runs.csv", report::runs_csv(&results)),
        ] {
            let path = folder.join(name);
            hamel_codegen::config::write_atomically(&path, text.as_bytes())
                .map_err(|e| Error::io(path.display().to_string(), e))?;
            println!("wrote {}", path.display());
        }
    }
    if short && samples == SHORT && steps == SHORT_STEPS {
        let excesses = bounds::excesses(&results);
        if !excesses.is_empty() {
            return Err(Error::Failed { step: "bounds".into(), status: excesses.join("\n  ") });
        }
    }
    Ok(())
}
