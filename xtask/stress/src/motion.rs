//! Long runs: what should stay constant along a motion, and how it drifts.
//!
//! Deliberately does not know: which models are run.

use hamel_runtime::{
    Failure, Gauss6, Integrator, Invariants, Method, Options, Progress, Projected, System, Vern9,
};
use xtask::Error;
use xtask::dynamics::{Dynamics, Factory, Info, VecState};
use xtask::eval::describe;

/// Samples per run.
const N_SAMPLES: u64 = 1000;
/// What is projected on: more quantities than any scene has.
const N_KEPT: usize = 5;

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

type Follow = fn(&Kept<'_>, &[f64], Stepping, u64, &mut dyn FnMut(f64, &[f64])) -> Result<(), String>;

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
fn follow<'d, M: Method<f64, &'d Kept<'d>>>(
    method: M,
    system: &'d Kept<'d>,
    y0: &[f64],
    stepping: Stepping,
    steps: u64,
    seen: &mut dyn FnMut(f64, &[f64]),
) -> Result<(), String> {
    let initial = VecState(y0.to_vec());
    let mut solver =
        Integrator::new(&system, method, 0.0, initial, stepping.options()).map_err(|e| e.to_string())?;
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

/// What should stay constant along motions.
#[derive(Clone, Debug)]
enum Quantity {
    Energy,
    /// A Casimir or the residual of a constraint: its position among the outputs.
    Output(usize),
    /// The square of a quaternion in these components of the state.
    Norm([usize; 4]),
}

/// A scene with what should stay constant: energy where it does, Casimirs, residuals of constraints, the square of a
/// quaternion.
struct Kept<'a> {
    dynamics: &'a dyn Dynamics,
    quantities: Vec<(String, Quantity)>,
}

impl<'a> Kept<'a> {
    fn new(info: &Info, dynamics: &'a dyn Dynamics) -> Kept<'a> {
        let mut quantities = Vec::new();
        if info.has_energy && info.conserves_energy() {
            quantities.push(("energy".to_owned(), Quantity::Energy));
        }
        let names =
            info.outputs.iter().flat_map(|group| group.components.iter().map(move |c| (&group.name, c)));
        for (at, (group, component)) in names.enumerate() {
            if ["casimirs", "constraint"].contains(&group.as_str()) {
                quantities.push((format!("{group}.{component}"), Quantity::Output(at)));
            }
        }
        let quaternion = ["qw", "qx", "qy", "qz"].map(|name| info.state.iter().position(|s| s == name));
        if let [Some(w), Some(x), Some(y), Some(z)] = quaternion {
            quantities.push(("|q|^2".into(), Quantity::Norm([w, x, y, z])));
        }
        assert!(quantities.len() <= N_KEPT, "{} has more than {N_KEPT} constants", info.model);
        Kept { dynamics, quantities }
    }

    /// The quantities in order, and zeros.
    fn at(&self, t: f64, y: &[f64]) -> [f64; N_KEPT] {
        let mut values = [0.0; N_KEPT];
        let reads_outputs = self.quantities.iter().any(|(_, q)| matches!(q, Quantity::Output(_)));
        let outputs = if reads_outputs { self.dynamics.outputs(t, y) } else { Vec::new() };
        for (value, (_, quantity)) in values.iter_mut().zip(&self.quantities) {
            *value = match quantity {
                Quantity::Energy => self.dynamics.energy(t, y).unwrap_or(f64::NAN),
                Quantity::Output(at) => outputs[*at],
                Quantity::Norm(at) => at.iter().map(|k| y[*k] * y[*k]).sum(),
            };
        }
        values
    }
}

impl System<f64> for Kept<'_> {
    type State = VecState;

    fn rhs(&self, t: f64, y: &VecState, dy: &mut VecState) {
        self.dynamics.rhs(t, &y.0, &mut dy.0);
    }

    fn check(&self, t: f64, y: &VecState) -> Result<(), Failure> {
        self.dynamics.check(t, &y.0)
    }
}

impl Invariants<f64, N_KEPT> for Kept<'_> {
    fn values(&self, t: f64, y: &VecState) -> [f64; N_KEPT] {
        self.at(t, &y.0)
    }

    /// By central differences: the projection iterates, so its end does not depend on their error.
    fn gradients(&self, t: f64, y: &VecState, gradients: &mut [VecState; N_KEPT]) {
        let mut moved = y.0.clone();
        for c in 0..moved.len() {
            let h = 1e-5 * y.0[c].abs().max(1.0);
            moved[c] = y.0[c] + h;
            let above = self.at(t, &moved);
            moved[c] = y.0[c] - h;
            let below = self.at(t, &moved);
            moved[c] = y.0[c];
            for (gradient, (above, below)) in gradients.iter_mut().zip(above.iter().zip(below)) {
                gradient.0[c] = (above - below) / (2.0 * h);
            }
        }
    }
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
/// [`Error::Options`] when the scene does not take its own defaults.
pub fn run(factory: &dyn Factory, y0: &[f64], runner: Runner, steps: u64) -> Result<RunResult, Error> {
    let info = factory.info();
    let dynamics =
        factory.prepare(&info.defaults()).map_err(|bad| Error::Options { reason: bad.to_string() })?;
    Dynamics::check(&*dynamics, 0.0, y0).map_err(|f| Error::Options { reason: describe(info, f) })?;
    let kept = Kept::new(info, &*dynamics);
    let mut times = Vec::new();
    let mut rows: Vec<[f64; N_KEPT]> = Vec::new();
    let followed = (runner.follow)(&kept, y0, runner.stepping, steps, &mut |t, y| {
        times.push(t);
        rows.push(kept.at(t, y));
    });
    let n = times.len() as f64;
    let mean = times.iter().sum::<f64>() / n;
    let spread: f64 = times.iter().map(|t| (t - mean) * (t - mean)).sum();
    let drifts = kept.quantities.iter().enumerate().map(|(k, (quantity, _))| {
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
