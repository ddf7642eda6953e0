//! Long runs: what should stay constant along a motion, and how it drifts.
//!
//! Deliberately does not know: which models are run.

use hamel_runtime::{Dop853, Dopri5, Integrator, Method, Options, Progress, Rk4, Tsit5};
use xtask::Error;
use xtask::dynamics::{Dynamics, Factory, Info, VecState};
use xtask::eval::describe;

/// Samples per run.
const N_SAMPLES: u64 = 1000;

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

type Follow = fn(&dyn Dynamics, &[f64], Stepping, u64, &mut dyn FnMut(f64, &[f64])) -> Result<(), String>;

/// A method and how it chooses steps. A new method is one line of [`METHODS`].
#[derive(Clone, Copy, Debug)]
pub struct Runner {
    /// Name of the method.
    pub name: &'static str,
    /// How it chooses steps.
    pub stepping: Stepping,
    follow: Follow,
}

/// What long runs are made with.
pub const METHODS: [Runner; 6] = [
    Runner {
        name: "rk4",
        stepping: Stepping::Fixed(0.01),
        follow: |d, y, s, n, seen| follow(Rk4, d, y, s, n, seen),
    },
    Runner {
        name: "tsit5",
        stepping: Stepping::Fixed(0.01),
        follow: |d, y, s, n, seen| follow(Tsit5, d, y, s, n, seen),
    },
    Runner {
        name: "dop853",
        stepping: Stepping::Fixed(0.01),
        follow: |d, y, s, n, seen| follow(Dop853, d, y, s, n, seen),
    },
    Runner {
        name: "dopri5",
        stepping: Stepping::Adaptive(1e-8),
        follow: |d, y, s, n, seen| follow(Dopri5, d, y, s, n, seen),
    },
    Runner {
        name: "tsit5",
        stepping: Stepping::Adaptive(1e-8),
        follow: |d, y, s, n, seen| follow(Tsit5, d, y, s, n, seen),
    },
    Runner {
        name: "dop853",
        stepping: Stepping::Adaptive(1e-12),
        follow: |d, y, s, n, seen| follow(Dop853, d, y, s, n, seen),
    },
];

/// Makes `steps` steps from `y0` and shows about [`N_SAMPLES`] of them.
fn follow<'d, M: Method<f64, &'d dyn Dynamics>>(
    method: M,
    dynamics: &'d dyn Dynamics,
    y0: &[f64],
    stepping: Stepping,
    steps: u64,
    seen: &mut dyn FnMut(f64, &[f64]),
) -> Result<(), String> {
    let initial = VecState(y0.to_vec());
    let mut solver =
        Integrator::new(&dynamics, method, 0.0, initial, stepping.options()).map_err(|e| e.to_string())?;
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

/// What should stay constant: energy where it does, Casimirs, residuals of constraints, the square of a quaternion.
fn invariants(info: &Info, dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> Vec<(String, f64)> {
    let mut values = Vec::new();
    if info.conserves_energy() {
        values.extend(dynamics.energy(t, y).map(|e| ("energy".to_owned(), e)));
    }
    let outputs = dynamics.outputs(t, y);
    let mut start = 0;
    for group in &info.outputs {
        let end = start + group.components.len();
        if ["casimirs", "constraint"].contains(&group.name.as_str()) {
            let named = group.components.iter().map(|c| format!("{}.{c}", group.name));
            values.extend(named.zip(outputs[start..end].iter().copied()));
        }
        start = end;
    }
    let quaternion = ["qw", "qx", "qy", "qz"].map(|name| info.state.iter().position(|s| s == name));
    if let [Some(w), Some(x), Some(z), Some(v)] = quaternion {
        values.push(("|q|^2".into(), [w, x, z, v].iter().map(|k| y[*k] * y[*k]).sum()));
    }
    values
}

/// Follows a scene from `y0` with default parameters.
///
/// # Errors
/// [`Error::Options`] when the scene does not take its own defaults.
pub fn run(factory: &dyn Factory, y0: &[f64], runner: Runner, steps: u64) -> Result<RunResult, Error> {
    let info = factory.info();
    let dynamics =
        factory.prepare(&info.defaults()).map_err(|bad| Error::Options { reason: bad.to_string() })?;
    dynamics.check(0.0, y0).map_err(|f| Error::Options { reason: describe(info, f) })?;
    let mut times = Vec::new();
    let mut rows: Vec<Vec<(String, f64)>> = Vec::new();
    let followed = (runner.follow)(&*dynamics, y0, runner.stepping, steps, &mut |t, y| {
        times.push(t);
        rows.push(invariants(info, &*dynamics, t, y));
    });
    let n = times.len() as f64;
    let mean = times.iter().sum::<f64>() / n;
    let spread: f64 = times.iter().map(|t| (t - mean) * (t - mean)).sum();
    let drifts = rows[0].iter().enumerate().map(|(k, (quantity, start))| {
        let distance = |row: &Vec<(String, f64)>| row[k].1 - start;
        let moment: f64 = times.iter().zip(&rows).map(|(t, row)| (t - mean) * distance(row)).sum();
        Drift {
            quantity: quantity.clone(),
            start: *start,
            max: rows.iter().fold(0.0, |max, row| distance(row).abs().max(max)),
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
