//! Long runs: what should stay constant along a motion, and how it drifts.
//!
//! Deliberately does not know: which models are run.

use hamel_codegen::spec::Want;
use hamel_run::Error;
use hamel_run::dynamics::{Dynamics, Factory, PreparedScene, VecState};
use hamel_run::evaluate::describe;
use hamel_run::info::Info;
use hamel_runtime::{Gauss6, Integrator, Method, Options, Progress, Projected, Vern9};

/// Samples per run.
const N_SAMPLES: u64 = 1000;
/// What is projected on: as many invariants as any scene has, or more.
const N_KEPT: usize = 8;

/// How steps are chosen.
#[derive(Clone, Copy, Debug)]
pub enum Stepping {
    /// Steps of this size.
    Fixed(f64),
    /// Steps for this relative tolerance, and an absolute one of a hundredth of it.
    Adaptive(f64),
}

impl Stepping {
    fn options(self) -> Options<f64> {
        match self {
            Stepping::Fixed(h) => Options::fixed(h),
            Stepping::Adaptive(rtol) => Options::adaptive(rtol, rtol / 100.0),
        }
    }
}

impl std::fmt::Display for Stepping {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Stepping::Fixed(h) => write!(f, "h = {h}"),
            Stepping::Adaptive(rtol) => write!(f, "rtol = {rtol:e}"),
        }
    }
}

type System<'a> = PreparedScene<'a>;
type Follow = fn(&System<'_>, &[f64], Stepping, u64, &mut dyn FnMut(f64, &[f64])) -> Result<(), String>;

/// A method and how it chooses steps. A new method is one line of [`METHODS`].
#[derive(Clone, Copy, Debug)]
pub struct Runner {
    /// Name of the method.
    pub name: &'static str,
    /// How it chooses steps.
    pub stepping: Stepping,
    /// The largest drift of a short run, relative to the quantity or to one: the power of ten above ten times what was
    /// measured.
    pub bound: f64,
    follow: Follow,
}

/// What long runs are made with.
pub const METHODS: [Runner; 4] = [
    Runner {
        name: "vern9",
        stepping: Stepping::Fixed(0.01),
        bound: 1e-12,
        follow: |d, y, s, n, seen| follow(Vern9, d, y, s, n, seen),
    },
    Runner {
        name: "vern9",
        stepping: Stepping::Adaptive(1e-12),
        bound: 1e-8,
        follow: |d, y, s, n, seen| follow(Vern9, d, y, s, n, seen),
    },
    Runner {
        name: "gauss6",
        stepping: Stepping::Fixed(0.01),
        bound: 1e-8,
        follow: |d, y, s, n, seen| follow(Gauss6::fixed_point(), d, y, s, n, seen),
    },
    Runner {
        name: "vern9, projected",
        stepping: Stepping::Fixed(0.01),
        bound: 1e-13,
        follow: |d, y, s, n, seen| follow(Projected::<_, N_KEPT>::new(Vern9), d, y, s, n, seen),
    },
];

/// Makes `steps` steps from `y0` and shows about [`N_SAMPLES`] of them.
fn follow<'d, M: Method<f64, System<'d>>>(
    method: M,
    system: &System<'d>,
    y0: &[f64],
    stepping: Stepping,
    steps: u64,
    seen: &mut dyn FnMut(f64, &[f64]),
) -> Result<(), String> {
    let initial = VecState(y0.to_vec());
    let mut solver =
        Integrator::new(system, method, 0.0, initial, stepping.options()).map_err(|e| e.to_string())?;
    let every = (steps / N_SAMPLES).max(1);
    seen(0.0, y0);
    for step in 1..=steps {
        // Far enough that the end is never met.
        let progress = solver.step_towards(1e12).map_err(|e| e.to_string())?;
        if step % every == 0 || matches!(progress, Progress::Reached) {
            seen(solver.t(), &solver.state().0);
        }
        if progress.reached() {
            break;
        }
    }
    Ok(())
}

/// The names of a scene's invariants: energy, Casimirs, momenta, residuals of constraints, the square of a quaternion.
fn invariants(info: &Info) -> Result<&[String], Error> {
    let names = info
        .outputs
        .iter()
        .find(|output| output.name == Want::Invariants.name())
        .map(|output| &*output.components);
    names.filter(|names| names.len() <= N_KEPT).ok_or_else(|| Error::Options {
        reason: format!("{} {} has not from 1 to {N_KEPT} invariants", info.model, info.scene),
    })
}

/// A quantity along a run.
#[derive(Clone, Debug)]
pub struct Drift {
    /// Which quantity.
    pub quantity: String,
    /// Its value at the start.
    pub start: f64,
    /// Largest distance from it.
    pub max: f64,
    /// Slope of the least-squares line of the distances against time.
    pub slope: f64,
}

impl Drift {
    /// The largest distance over the larger of one and the value at the start.
    pub fn relative(&self) -> f64 {
        self.max / self.start.abs().max(1.0)
    }
}

/// What became of a run.
#[derive(Clone, Debug)]
pub struct RunResult {
    /// Model and scene.
    pub name: (String, String),
    /// Method.
    pub runner: Runner,
    /// Number of steps asked for.
    pub steps: u64,
    /// Time reached.
    pub t: f64,
    /// All quantities that should stay constant.
    pub drifts: Vec<Drift>,
    /// Why the run ended early.
    pub stopped: Option<String>,
}

/// Follows a scene from `y0` with default parameters.
///
/// # Errors
/// [`Error::Options`] when the scene does not take its own defaults, or has no invariants.
pub fn run(factory: &dyn Factory, y0: &[f64], runner: Runner, steps: u64) -> Result<RunResult, Error> {
    let info = factory.info();
    let dynamics =
        factory.prepare(&info.defaults()).map_err(|bad| Error::Options { reason: bad.to_string() })?;
    Dynamics::check(&*dynamics, 0.0, y0).map_err(|f| Error::Options { reason: describe(info, f) })?;
    let names = invariants(info)?;
    let mut times = Vec::new();
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let followed = (runner.follow)(&dynamics, y0, runner.stepping, steps, &mut |t, y| {
        let mut values = vec![0.0; names.len()];
        dynamics.invariants(t, y, &mut values);
        times.push(t);
        rows.push(values);
    });
    let n = times.len() as f64;
    let mean = times.iter().sum::<f64>() / n;
    let spread: f64 = times.iter().map(|t| (t - mean) * (t - mean)).sum();
    let drifts = names.iter().enumerate().map(|(k, quantity)| {
        let start = rows[0][k];
        let moment: f64 = times.iter().zip(&rows).map(|(t, row)| (t - mean) * (row[k] - start)).sum();
        Drift {
            quantity: quantity.clone(),
            start,
            max: rows.iter().fold(0.0, |max, row| (row[k] - start).abs().max(max)),
            slope: if spread > 0.0 { moment / spread } else { 0.0 },
        }
    });
    Ok(RunResult {
        name: (info.model.clone(), info.scene.clone()),
        runner,
        steps,
        t: *times.last().unwrap_or(&0.0),
        drifts: drifts.collect(),
        stopped: followed.err(),
    })
}
