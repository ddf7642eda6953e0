//! Integration of a scene from an initial state, as JSON in and out.
//!
//! Deliberately does not know: whether the scene is compiled or interpreted, files, figures.

use std::collections::BTreeMap;

use hamel_runtime::{
    Dop853, Dopri5, Error as SolverError, Gauss4, Gauss6, Gauss8, Integrator, Method, Options, Projected,
    Rk4, Taylor, Tsit5, Vern9,
};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::admissible;
use crate::auto;
use crate::codegen_bridge::Want;
use crate::dynamics::{Dynamics, Factory, Info, VecState};
use crate::error::{Error, Problem};
use crate::eval::{describe, prepare};
use crate::json::{Fields, Json, by_name, number};
use crate::names;

/// An integration method of the runtime.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum MethodName {
    /// Tsitouras, fifth order.
    Tsit5,
    /// Dormand and Prince, eighth order.
    #[default]
    Dop853,
    /// Verner, ninth order.
    Vern9,
    /// Dormand and Prince, fifth order.
    Dopri5,
    /// The classical fourth-order method, fixed steps only.
    Rk4,
    /// Gauss collocation of fourth order: symplectic, fixed steps only.
    Gauss4,
    /// Gauss collocation of sixth order: symplectic, fixed steps only.
    Gauss6,
    /// Gauss collocation of eighth order: symplectic, fixed steps only.
    Gauss8,
    /// The same of fourth order with Newton's iteration, for stiff systems and long steps.
    #[serde(rename = "gauss4-newton")]
    Gauss4Newton,
    /// The same of sixth order with Newton's iteration.
    #[serde(rename = "gauss6-newton")]
    Gauss6Newton,
    /// The same of eighth order with Newton's iteration.
    #[serde(rename = "gauss8-newton")]
    Gauss8Newton,
    /// Taylor series of an order that suits the tolerances.
    Taylor,
    /// The one that is fastest for the tolerance and the scene, by measurements: see [`crate::auto`].
    Auto,
    /// Verner's method with a projection onto the invariants of the motion after every step.
    Projected,
}

impl MethodName {
    /// All methods.
    pub const ALL: [MethodName; 14] = [
        MethodName::Tsit5,
        MethodName::Dop853,
        MethodName::Vern9,
        MethodName::Dopri5,
        MethodName::Rk4,
        MethodName::Gauss4,
        MethodName::Gauss6,
        MethodName::Gauss8,
        MethodName::Gauss4Newton,
        MethodName::Gauss6Newton,
        MethodName::Gauss8Newton,
        MethodName::Taylor,
        MethodName::Auto,
        MethodName::Projected,
    ];

    /// The name in requests.
    pub fn name(self) -> &'static str {
        match self {
            MethodName::Tsit5 => "tsit5",
            MethodName::Dop853 => "dop853",
            MethodName::Vern9 => "vern9",
            MethodName::Dopri5 => "dopri5",
            MethodName::Rk4 => "rk4",
            MethodName::Gauss4 => "gauss4",
            MethodName::Gauss6 => "gauss6",
            MethodName::Gauss8 => "gauss8",
            MethodName::Gauss4Newton => "gauss4-newton",
            MethodName::Gauss6Newton => "gauss6-newton",
            MethodName::Gauss8Newton => "gauss8-newton",
            MethodName::Taylor => "taylor",
            MethodName::Auto => "auto",
            MethodName::Projected => "projected",
        }
    }

    /// Whether the method takes fixed steps only.
    pub(crate) fn has_fixed_steps(self) -> bool {
        use MethodName::{Gauss4, Gauss6, Gauss8, Rk4};
        matches!(self, Rk4 | Gauss4 | Gauss6 | Gauss8) || self.is_newton()
    }

    /// Whether the method asks for derivatives of the right-hand side.
    pub(crate) fn is_newton(self) -> bool {
        use MethodName::{Gauss4Newton, Gauss6Newton, Gauss8Newton};
        matches!(self, Gauss4Newton | Gauss6Newton | Gauss8Newton)
    }
}

/// How steps are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Steps {
    /// Such that the estimated error stays within the tolerances.
    Adaptive {
        /// Relative tolerance.
        rtol: f64,
        /// Absolute tolerance.
        atol: f64,
    },
    /// All of one size.
    Fixed {
        /// The size.
        step: f64,
    },
}

impl Steps {
    /// Default relative tolerance.
    pub const RTOL: f64 = 1e-10;
    /// Default absolute tolerance.
    pub const ATOL: f64 = 1e-12;

    /// Steps from what was given.
    ///
    /// # Errors
    /// What is contradictory or missing, and what to change.
    pub fn new(
        method: MethodName,
        rtol: Option<f64>,
        atol: Option<f64>,
        step: Option<f64>,
    ) -> Result<Steps, String> {
        match (step, rtol, atol) {
            (Some(_), ..) if method == MethodName::Auto => {
                Err("is given, but auto chooses by tolerances: leave it out, or choose a method for it"
                    .into())
            }
            (Some(step), None, None) => Ok(Steps::Fixed { step }),
            (Some(_), ..) => {
                Err("is given together with a tolerance: give either step, or rtol and atol".into())
            }
            (None, ..) if method.has_fixed_steps() => Err(format!(
                "is missing: {} has no error estimate, give a step or choose tsit5, dop853, vern9 or dopri5",
                method.name()
            )),
            (None, rtol, atol) => {
                Ok(Steps::Adaptive { rtol: rtol.unwrap_or(Self::RTOL), atol: atol.unwrap_or(Self::ATOL) })
            }
        }
    }

    /// Largest number of steps unless another one is given; one with fixed steps costs less and cannot be rejected.
    pub fn max_steps(self) -> u64 {
        match self {
            Steps::Adaptive { .. } => MAX_STEPS,
            Steps::Fixed { .. } => 20 * MAX_STEPS,
        }
    }

    /// Options of an integration to `t_final` with at most `max_steps` steps, rejected ones included.
    ///
    /// # Errors
    /// [`Error::Options`] for a time that is not finite, and for fixed steps that are too many.
    pub fn options(self, t_final: f64, max_steps: u64) -> Result<Options<f64>, Error> {
        if !t_final.is_finite() {
            return Err(Error::Options { reason: format!("t_final is {t_final}: give a finite time") });
        }
        let options = match self {
            Steps::Adaptive { rtol, atol } => Options::adaptive(rtol, atol),
            Steps::Fixed { step } => {
                let n_steps = (t_final / step).abs();
                // The quotient is rounded.
                if step > 0.0 && n_steps > max_steps as f64 * (1.0 + 1e-9) {
                    let reason = format!(
                        "step {step:?} is too small for t_final = {t_final:?}: it needs {n_steps:.1e} steps, and at most \
                         {max_steps} are taken; give a larger step, or raise max_steps"
                    );
                    return Err(Error::Options { reason });
                }
                Options::fixed(step)
            }
        };
        Ok(options.with_max_steps(max_steps))
    }
}

/// What to integrate, in the order of [`Info`]; it starts at time zero.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulateRequest {
    /// Parameters.
    pub params: Vec<f64>,
    /// State at time zero.
    pub initial: Vec<f64>,
    /// Time to reach; negative for integration backward.
    pub t_final: f64,
    /// The method.
    pub method: MethodName,
    /// How it chooses steps.
    pub steps: Steps,
    /// Number of samples at equal distances from zero to `t_final`, both included; a single one is the end.
    pub samples: usize,
    /// Whether samples carry all outputs.
    pub with_outputs: bool,
    /// How many components at the end of the state are coordinates of the group that the answer shows apart.
    pub n_group: usize,
    /// Largest number of steps, rejected ones included; [`Steps::max_steps`] unless somebody asks for another one.
    pub max_steps: u64,
}

/// One state on the way.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Time.
    pub t: f64,
    /// State.
    pub state: Vec<f64>,
    /// Energy, when the scene has one.
    pub energy: Option<f64>,
    /// Outputs, when asked for.
    pub outputs: Vec<f64>,
}

/// Where an integration led to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulateResponse {
    /// Time reached: `t_final` exactly.
    pub t: f64,
    /// State there.
    pub last: Vec<f64>,
    /// States on the way.
    pub samples: Vec<Sample>,
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected: u64,
    /// Evaluations of the right-hand side.
    pub rhs_evals: u64,
    /// Largest `|E - E0| / scale` over all steps and samples, with the scale of [`energy_scale`].
    pub energy_drift: Option<f64>,
    /// Energy at time zero.
    pub initial_energy: Option<f64>,
    /// The scale of `energy_drift`.
    pub energy_scale: f64,
    /// Times and energies of accepted steps, thinned out when there are very many; empty unless samples carry outputs.
    pub energy_at_steps: Vec<(f64, f64)>,
    /// Largest component of the output group `constraint` at the start; none when the scene has no such group.
    pub initial_residual: Option<f64>,
    /// The same over the start, all steps and samples.
    pub constraint_residual: Option<f64>,
    /// What there is to know about the result besides: that the energy moved though it is conserved.
    pub warnings: Vec<String>,
    /// Seconds that the integration took.
    pub seconds: f64,
}

/// Most invariants that are projected onto.
pub(crate) const MAX_INVARIANTS: usize = 64;
/// Memory that the samples of one run may take, in bytes: what a small machine has.
const MAX_BYTES: u64 = 4_000_000_000;
/// Memory of a sample, of each component of its state and of each output at the worst moment, when the answer is both
/// numbers and JSON by name. Measured for 3 and 6 components: 900 and 1450 bytes a sample.
const BYTES_PER_SAMPLE: u64 = 350;
const BYTES_PER_COMPONENT: u64 = 185;
const BYTES_PER_OUTPUT: u64 = 30;
/// Largest number that a request can give exactly.
const MAX_WHOLE: f64 = (1_u64 << 53) as f64;
/// Most steps of one run with adaptive steps, rejected ones included, unless another number is given.
const MAX_STEPS: u64 = 50_000_000;
/// Most steps whose energies are kept for a figure.
const MAX_STEPS_SHOWN: usize = 4096;

impl SimulateRequest {
    /// Whether a request has a field `reconstruct`, so that the scene with the group's coordinates is to be run.
    ///
    /// # Errors
    /// [`Error::NotJson`].
    pub fn asks_to_reconstruct(text: &str) -> Result<bool, Error> {
        has_field(text, "reconstruct", |value| *value != Json::Null)
    }

    /// Whether a request's method is [`MethodName::Projected`], so that the scene has to have its invariants.
    ///
    /// # Errors
    /// [`Error::NotJson`].
    pub fn asks_to_project(text: &str) -> Result<bool, Error> {
        let projected = Json::String(MethodName::Projected.name().to_owned());
        has_field(text, "method", |value| *value == projected)
    }

    /// Reads `{"params", "initial", "t_final", "method", "rtol", "atol" or "step", "samples", "max_steps"}`.
    ///
    /// Missing parameters take the scene's defaults; `initial` and `t_final` have to be there; the other defaults are
    /// `dop853` and [`Steps::RTOL`], [`Steps::ATOL`].
    ///
    /// # Errors
    /// [`Error::NotJson`], or [`Error::Request`] with everything that is wrong.
    pub fn parse(text: &str, info: &Info) -> Result<SimulateRequest, Error> {
        Self::parse_parts(text, info, 0, &|_| Vec::new())
    }

    /// Reads a request whose `reconstruct` has the values of the last components of the state, `initial` the others.
    ///
    /// An empty `reconstruct` stands for `defaults`, which depend on the parameters by name.
    ///
    /// # Errors
    /// As [`SimulateRequest::parse`].
    pub fn parse_with_group(
        text: &str,
        info: &Info,
        n_group: usize,
        defaults: &dyn Fn(&BTreeMap<String, f64>) -> Vec<f64>,
    ) -> Result<SimulateRequest, Error> {
        Self::parse_parts(text, info, n_group, defaults)
    }

    fn parse_parts(
        text: &str,
        info: &Info,
        n_group: usize,
        defaults: &dyn Fn(&BTreeMap<String, f64>) -> Vec<f64>,
    ) -> Result<SimulateRequest, Error> {
        const FIELDS: [&str; 10] = [
            "params",
            "initial",
            "t_final",
            "method",
            "rtol",
            "atol",
            "step",
            "reconstruct",
            "samples",
            "max_steps",
        ];
        let mut fields = Fields::new(Json::parse(text)?, &FIELDS)?;
        let params = fields.take("params");
        let params =
            fields.numbers("params", params, "parameter", &info.param_names(), Some(&info.defaults()));
        let names = info.state_names();
        let (own, group) = names.split_at(names.len() - n_group);
        let initial = fields.take("initial");
        let mut initial = fields.numbers("initial", initial, "state", own, None);
        let before = fields.problems.len();
        let t_final = fields.number("t_final");
        if t_final.is_none() && fields.problems.len() == before {
            fields.missing("t_final", "the time to integrate to, starting at zero");
        }
        let unusable = |path: &str, reason: String| Problem::Unusable { path: path.into(), reason };
        let method = match fields.string("method") {
            None => MethodName::default(),
            Some(name) => match MethodName::ALL.into_iter().find(|m| m.name() == name) {
                Some(method) => method,
                None => {
                    let known = MethodName::ALL.map(MethodName::name);
                    let reason = format!(
                        "{name:?} is no method{}\n  methods: {}",
                        names::hint(&name, known),
                        names::list(known)
                    );
                    fields.problems.push(unusable("method", reason));
                    MethodName::default()
                }
            },
        };
        let (rtol, atol, step) = (fields.number("rtol"), fields.number("atol"), fields.number("step"));
        let steps = Steps::new(method, rtol, atol, step).unwrap_or_else(|reason| {
            fields.problems.push(unusable("step", reason));
            Steps::Fixed { step: 1.0 }
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
        let with_outputs = false;
        if let Some(reason) = samples_refusal(samples, info, with_outputs) {
            fields.problems.push(unusable("samples", reason));
        }
        fields.finish()?;
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
        })
    }

    /// Checks what does not depend on the scene's values, before anything is allocated or sent to another process.
    ///
    /// # Errors
    /// [`Error::Options`] for a time that is not finite, steps that the integrator does not take, and too many samples.
    pub fn validate(&self, info: &Info) -> Result<(), Error> {
        let options = self.steps.options(self.t_final, self.max_steps)?;
        options.validate().map_err(|e| Error::Options { reason: e.to_string() })?;
        match samples_refusal(self.samples as u64, info, self.with_outputs) {
            Some(reason) => Err(Error::Options { reason: format!("samples {reason}") }),
            None => Ok(()),
        }
    }

    /// Time of a sample.
    fn sample_time(&self, k: usize) -> f64 {
        sample_time(self.t_final, self.samples, k)
    }
}

/// Why so many samples are too many, or nothing.
pub(crate) fn samples_refusal(samples: u64, info: &Info, with_outputs: bool) -> Option<String> {
    let n_outputs = if with_outputs { info.n_outputs() } else { 0 };
    let (n_state, n_outputs) = (info.state.len() as u64, n_outputs as u64);
    let each = BYTES_PER_SAMPLE + BYTES_PER_COMPONENT * n_state + BYTES_PER_OUTPUT * n_outputs;
    let bytes = each.saturating_mul(samples);
    (bytes > MAX_BYTES).then(|| {
        format!(
            "is {samples}, which would take about {:.1} GB of memory: take {} or fewer, or integrate in parts",
            bytes as f64 / 1e9,
            MAX_BYTES / each
        )
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
    /// With `n_group` coordinates of the group at the end of the state, `final` and `samples` have the components before
    /// them only, and `reconstruction` is added with the final values of these.
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
        if n_group > 0 {
            let group = info.state[n_own..].iter().map(String::as_str);
            answer.insert("reconstruction".into(), by_name(group, &self.last[n_own..]));
        }
        answer.into()
    }
}

/// Time of sample `k` of `samples` at equal distances from zero to `t_final`, both included; a single one is the end.
pub fn sample_time(t_final: f64, samples: usize, k: usize) -> f64 {
    if k + 1 >= samples { t_final } else { t_final * (k as f64 / (samples - 1) as f64) }
}

/// Scale to which the drift of the energy is relative: `|E0|`, or a thousandth of the size of the terms that `E0` is
/// the sum of, whichever is larger.
///
/// ```text
/// scale = max(|E0|, 1e-3 sum_i |y_i dE/dy_i|)
/// ```
///
/// The zero of a potential is a convention, and where `E0` nearly cancels a drift relative to `|E0|` alone says nothing
/// about the integration. A state at rest in the zero of the potential has the scale one, so that its drift is absolute.
pub fn energy_scale(dynamics: &dyn Dynamics, t: f64, y: &[f64]) -> f64 {
    let energy = |y: &[f64]| dynamics.energy(t, y).unwrap_or(0.0);
    let mut terms = 0.0;
    let mut moved = y.to_vec();
    for (k, &x) in y.iter().enumerate() {
        let h = 1e-6;
        moved[k] = x * (1.0 + h);
        let above = energy(&moved);
        moved[k] = x * (1.0 - h);
        let below = energy(&moved);
        moved[k] = x;
        let term = ((above - below) / (2.0 * h)).abs();
        if term.is_finite() {
            terms += term;
        }
    }
    let scale = energy(y).abs().max(1e-3 * terms).min(f64::MAX);
    if scale >= f64::MIN_POSITIVE { scale } else { 1.0 }
}

/// Integrates a scene. `progress` is told the time reached after every step.
///
/// # Errors
/// [`Error::NoState`], [`Error::Params`], [`Error::State`] and [`Error::Inadmissible`] for the initial state,
/// [`Error::Options`], and [`Error::Stopped`] with the state reached when the integration cannot go on.
pub fn simulate(
    factory: &dyn Factory,
    request: &SimulateRequest,
    progress: &mut dyn FnMut(f64),
) -> Result<SimulateResponse, Error> {
    has_state(factory.info())?;
    request.validate(factory.info())?;
    let dynamics = prepare(factory, &request.params)?;
    let dynamics = &*dynamics;
    admissible::check(dynamics, &request.initial, request.n_group)?;
    match chosen(request.method, request.steps, dynamics, &request.initial)? {
        MethodName::Tsit5 => run(Tsit5, dynamics, request, progress),
        MethodName::Dop853 => run(Dop853, dynamics, request, progress),
        MethodName::Vern9 => run(Vern9, dynamics, request, progress),
        MethodName::Gauss4 => run(Gauss4::fixed_point(), dynamics, request, progress),
        MethodName::Gauss6 => run(Gauss6::fixed_point(), dynamics, request, progress),
        MethodName::Gauss8 => run(Gauss8::fixed_point(), dynamics, request, progress),
        MethodName::Gauss4Newton => run(Gauss4::newton(), dynamics, request, progress),
        MethodName::Gauss6Newton => run(Gauss6::newton(), dynamics, request, progress),
        MethodName::Gauss8Newton => run(Gauss8::newton(), dynamics, request, progress),
        MethodName::Dopri5 => run(Dopri5, dynamics, request, progress),
        MethodName::Rk4 => run(Rk4, dynamics, request, progress),
        MethodName::Taylor => {
            has_series(dynamics, &request.initial)?;
            run(Taylor::new(), dynamics, request, progress)
        }
        // Chosen above.
        MethodName::Auto => unreachable!("auto stands for another method"),
        MethodName::Projected => {
            // Storage has a size known to the compiler: rounded up, with invariants that are always met.
            match dynamics.n_invariants() {
                Some(1..=4) => run(Projected::<_, 4>::new(Vern9), dynamics, request, progress),
                Some(5..=16) => run(Projected::<_, 16>::new(Vern9), dynamics, request, progress),
                Some(17..=MAX_INVARIANTS) => {
                    run(Projected::<_, MAX_INVARIANTS>::new(Vern9), dynamics, request, progress)
                }
                n_invariants => Err(not_projected(dynamics.info(), n_invariants)),
            }
        }
    }
}

/// Whether there is anything to integrate.
///
/// # Errors
/// [`Error::NoState`].
pub(crate) fn has_state(info: &Info) -> Result<(), Error> {
    if info.state.is_empty() {
        return Err(Error::NoState { scene: info.scene.clone(), model: info.model.clone() });
    }
    Ok(())
}

/// The method itself, or the one that `auto` stands for.
///
/// # Errors
/// [`Error::Options`] when there is no tolerance for `auto` to go by.
pub fn chosen(
    method: MethodName,
    steps: Steps,
    dynamics: &dyn Dynamics,
    y: &[f64],
) -> Result<MethodName, Error> {
    match (method, steps) {
        (MethodName::Auto, Steps::Adaptive { rtol, .. }) => {
            Ok(auto::choose(rtol, dynamics.rhs_cost(), dynamics.series(0.0, y, &mut [])))
        }
        (MethodName::Auto, Steps::Fixed { .. }) => {
            let reason = "method auto chooses by tolerances: give these instead of a step".to_owned();
            Err(Error::Options { reason })
        }
        (method, _) => Ok(method),
    }
}

/// Whether a scene has the series that the method `taylor` needs.
///
/// # Errors
/// [`Error::Options`] when it has not.
pub fn has_series(dynamics: &dyn Dynamics, y: &[f64]) -> Result<(), Error> {
    if dynamics.series(0.0, y, &mut []) {
        return Ok(());
    }
    let info = dynamics.info();
    let reason = format!(
        "method taylor: scene {} of {} was compiled without Taylor series: choose a scene that wants `taylor`, or \
         --via interpreter",
        info.scene, info.model
    );
    Err(Error::Options { reason })
}

pub(crate) fn not_projected(info: &Info, n_invariants: Option<usize>) -> Error {
    let reason = match n_invariants {
        None => "was compiled without its invariants: choose a scene that wants `invariants`, or --via interpreter"
            .to_owned(),
        Some(0) => "has no invariant besides components of its state: choose another method, or claim one that you \
                    know with `casimir name = ..;`"
            .to_owned(),
        Some(n) => format!("has {n} invariants, but at most {MAX_INVARIANTS} can be kept: choose another method"),
    };
    Error::Options { reason: format!("method projected: scene {} of {} {reason}", info.scene, info.model) }
}

fn run<'d, M: Method<f64, &'d dyn Dynamics>>(
    method: M,
    dynamics: &'d dyn Dynamics,
    request: &SimulateRequest,
    progress: &mut dyn FnMut(f64),
) -> Result<SimulateResponse, Error> {
    let info = dynamics.info();
    let options = request.steps.options(request.t_final, request.max_steps)?;
    let start = |error: SolverError| match error {
        SolverError::Failure(failure) => {
            Error::State { path: "initial".into(), reason: describe(info, failure) }
        }
        other => Error::Options { reason: other.to_string() },
    };
    let clock = std::time::Instant::now();
    let initial = VecState(request.initial.clone());
    let mut solver = Integrator::new(&dynamics, method, 0.0, initial, options).map_err(start)?;
    let mut record = Record::new(dynamics, request)?;
    let mut interpolated = VecState(request.initial.clone());
    let mut next = 0;
    loop {
        // Samples up to the time reached; the end is sampled at the end exactly.
        while next < request.samples {
            let time = request.sample_time(next);
            if (time - solver.t()) * request.t_final.signum() > 0.0 {
                break;
            }
            if let Err(error) = solver.interpolate(time, &mut interpolated) {
                let (t, y) = (solver.t(), solver.state().0.clone());
                return Err(stopped(info, t, &y, &error));
            }
            record.sample(time, &interpolated.0)?;
            next += 1;
        }
        if solver.t() == request.t_final {
            break;
        }
        if solver.stats().steps + solver.stats().rejected >= request.max_steps {
            let limit = SolverError::TooManySteps { t: solver.t(), limit: request.max_steps };
            return Err(stopped(info, solver.t(), &solver.state().0, &limit));
        }
        if let Err(error) = solver.step_towards(request.t_final) {
            return Err(stopped(info, solver.t(), &solver.state().0, &error));
        }
        record.step(solver.t(), &solver.state().0)?;
        progress(solver.t());
    }
    let last = solver.state().0.clone();
    let stats = solver.stats();
    let energy_drift = record.initial_energy.map(|_| (record.deviation / record.scale).min(f64::MAX));
    Ok(SimulateResponse {
        t: solver.t(),
        last,
        steps: stats.steps,
        rejected: stats.rejected,
        rhs_evals: stats.rhs_evals,
        energy_drift,
        warnings: drift_warning(info, request.steps, energy_drift).into_iter().collect(),
        initial_energy: record.initial_energy,
        energy_scale: record.scale,
        energy_at_steps: record.energy_at_steps,
        initial_residual: record.initial_residual,
        constraint_residual: record.residual,
        samples: record.samples,
        seconds: clock.elapsed().as_secs_f64(),
    })
}

/// A larger relative drift of an energy that is conserved is told.
const LARGE_DRIFT: f64 = 1e-3;

/// That fixed steps were too long, where the energy shows it: they have no error estimate.
fn drift_warning(info: &Info, steps: Steps, drift: Option<f64>) -> Option<String> {
    let (Steps::Fixed { step }, Some(drift)) = (steps, drift) else { return None };
    (info.conserves_energy && drift > LARGE_DRIFT).then(|| {
        format!(
            "the energy is conserved but moved by {drift:.1e} of its size: step {step:?} is too long for this motion, \
             take a shorter one or a method with adaptive steps"
        )
    })
}

fn stopped(info: &Info, t: f64, y: &[f64], error: &SolverError) -> Error {
    stopped_because(info, t, y, why_stopped(info, error))
}

/// Why an integration could not go on, in the words of the scene.
pub fn why_stopped(info: &Info, error: &SolverError) -> String {
    match *error {
        SolverError::Failure(failure) => describe(info, failure),
        SolverError::StepTooSmall { h, .. } => format!(
            "the error estimate asks for steps of {h:e}, which no longer change the time: the solution may be singular \
             there, or the tolerances cannot be reached"
        ),
        SolverError::TooManySteps { limit, .. } => {
            format!(
                "{limit} steps were not enough: choose a smaller t_final, loosen the tolerances, or raise max_steps"
            )
        }
        // Non-finite end times are the request's fault and found before the first step.
        other => other.to_string(),
    }
}

fn stopped_because(info: &Info, t: f64, y: &[f64], reason: String) -> Error {
    let state = info.state.iter().cloned().zip(y.iter().copied()).collect();
    Error::Stopped { t, state, reason }
}

/// What is noted on the way.
struct Record<'a> {
    dynamics: &'a dyn Dynamics,
    with_outputs: bool,
    initial_energy: Option<f64>,
    scale: f64,
    /// Largest `|E - E0|`.
    deviation: f64,
    constraint: Option<std::ops::Range<usize>>,
    initial_residual: Option<f64>,
    residual: Option<f64>,
    energy_at_steps: Vec<(f64, f64)>,
    n_steps: usize,
    /// Every step whose number is a multiple of it is kept in `energy_at_steps`.
    stride: usize,
    samples: Vec<Sample>,
}

impl<'a> Record<'a> {
    fn new(dynamics: &'a dyn Dynamics, request: &SimulateRequest) -> Result<Record<'a>, Error> {
        let y = &request.initial;
        let initial_energy = dynamics.energy(0.0, y);
        if initial_energy.is_some_and(|e| !e.is_finite()) {
            return Err(Error::State { path: "initial".into(), reason: "the energy is not finite".into() });
        }
        let scale = if initial_energy.is_some() { energy_scale(dynamics, 0.0, y) } else { 1.0 };
        let constraint = dynamics.info().output_range(Want::Constraint.name());
        let mut record = Record {
            dynamics,
            with_outputs: request.with_outputs,
            initial_energy,
            scale,
            deviation: 0.0,
            constraint,
            initial_residual: None,
            residual: None,
            energy_at_steps: Vec::new(),
            n_steps: 0,
            stride: 1,
            samples: Vec::with_capacity(request.samples),
        };
        record.residual_at(0.0, y).map_err(|_| Error::State {
            path: "initial".into(),
            reason: "the residual of the constraint is not finite".into(),
        })?;
        record.initial_residual = record.residual;
        record.keep(0.0, initial_energy);
        Ok(record)
    }

    /// Notes the energy and the residual after a step.
    fn step(&mut self, t: f64, y: &[f64]) -> Result<(), Error> {
        self.residual_at(t, y)?;
        let energy = self.energy(t, y)?;
        self.keep(t, energy);
        Ok(())
    }

    fn keep(&mut self, t: f64, energy: Option<f64>) {
        let (Some(energy), true) = (energy, self.with_outputs) else { return };
        if self.n_steps.is_multiple_of(self.stride) {
            self.energy_at_steps.push((t, energy));
        }
        self.n_steps += 1;
        if self.energy_at_steps.len() >= MAX_STEPS_SHOWN {
            let mut number = 0;
            self.energy_at_steps.retain(|_| {
                number += 1;
                number % 2 == 1
            });
            self.stride *= 2;
        }
    }

    /// Notes the energy at a point and returns it.
    fn energy(&mut self, t: f64, y: &[f64]) -> Result<Option<f64>, Error> {
        let (Some(energy), Some(initial)) = (self.dynamics.energy(t, y), self.initial_energy) else {
            return Ok(None);
        };
        if !energy.is_finite() {
            return Err(self.not_finite(t, y, "the energy"));
        }
        let change = (energy - initial).abs();
        if !change.is_finite() {
            return Err(self.not_finite(t, y, "the change of the energy"));
        }
        self.deviation = self.deviation.max(change);
        Ok(Some(energy))
    }

    fn sample(&mut self, t: f64, y: &[f64]) -> Result<(), Error> {
        let energy = self.energy(t, y)?;
        let mut outputs = Vec::new();
        if self.with_outputs || self.constraint.is_some() {
            outputs = self.dynamics.outputs(t, y);
            self.note_residual(t, y, &outputs)?;
        }
        if !self.with_outputs {
            outputs.clear();
        }
        if outputs.iter().any(|x| !x.is_finite()) {
            return Err(self.not_finite(t, y, "an output"));
        }
        self.samples.push(Sample { t, state: y.to_vec(), energy, outputs });
        Ok(())
    }

    fn residual_at(&mut self, t: f64, y: &[f64]) -> Result<(), Error> {
        if self.constraint.is_none() {
            return Ok(());
        }
        let outputs = self.dynamics.outputs(t, y);
        self.note_residual(t, y, &outputs)
    }

    fn note_residual(&mut self, t: f64, y: &[f64], outputs: &[f64]) -> Result<(), Error> {
        let Some(range) = self.constraint.clone() else { return Ok(()) };
        for x in &outputs[range] {
            if !x.is_finite() {
                return Err(self.not_finite(t, y, "the residual of the constraint"));
            }
            self.residual = Some(self.residual.unwrap_or(0.0).max(x.abs()));
        }
        Ok(())
    }

    fn not_finite(&self, t: f64, y: &[f64], what: &str) -> Error {
        stopped_because(self.dynamics.info(), t, y, format!("{what} is not finite"))
    }
}
