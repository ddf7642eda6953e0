//! What a simulation is asked for, and what comes out, in the order of a scene's [`Info`].
//!
//! Does not know: how anything is integrated, how a request was written.

use serde::{Deserialize, Serialize};

use super::direction::Direction;
use super::info::Info;
use super::method::{MethodName, Steps};
use super::noise::Noise;
use super::watched::{EventRecord, Watched};
use crate::error::Error;

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
    /// Largest number of events.
    pub max_events: u64,
    /// Events to watch for.
    pub watched: Option<Watched>,
    /// The path of the scene's noises.
    #[serde(default)]
    pub noise: Noise,
    /// What the motion is differentiated by.
    pub along: Vec<Direction>,
    /// Derivatives of the initial state along each direction; where there are none, everything but what a direction
    /// names is fixed.
    pub tangents: Vec<Vec<f64>>,
}

/// Largest number of events unless somebody asks for another one: all of them are kept.
pub const MAX_EVENTS: u64 = 100_000;

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
    /// Derivatives of the state along each direction that was asked for, one direction after the other.
    pub along: Vec<f64>,
}

/// Where an integration led to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulateResponse {
    /// Time reached: `t_final` exactly, unless an event has ended the motion.
    pub t: f64,
    /// State there.
    pub last: Vec<f64>,
    /// Derivatives of the state there, by the name of what it is differentiated by.
    pub along: Vec<(String, Vec<f64>)>,
    /// States on the way.
    pub samples: Vec<Sample>,
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected: u64,
    /// Evaluations of the right-hand side.
    pub rhs_evals: u64,
    /// Largest `|E - E0| / scale` over all steps and samples, with the scale [`SimulateResponse::energy_scale`].
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
    /// Events in the order of time; none where nothing was watched for.
    pub events: Option<Vec<EventRecord>>,
    /// The event that has ended the motion.
    pub ended_by: Option<String>,
    /// Singular positions that the motion has passed, in the order of time.
    #[serde(default)]
    pub singular_positions: Vec<SingularPosition>,
    /// What there is to know about the result besides: that the energy moved though it is conserved.
    pub warnings: Vec<String>,
    /// Seconds that the integration took.
    pub seconds: f64,
}

/// A position where equations between coordinates depend on each other, and which a motion has passed on the branch on
/// which its positions and velocities are smooth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SingularPosition {
    /// Time.
    pub t: f64,
    /// How many more equations there are than independent ones.
    pub n_lost: usize,
}

impl SingularPosition {
    /// A summary of the positions that a motion has passed, where it has passed some.
    pub fn told(passed: &[SingularPosition]) -> Option<String> {
        let last = passed.last()?.t;
        let n = passed.len();
        let (positions, last) = match n {
            1 => ("position", format!("at t = {last:.6}")),
            _ => ("positions", format!("the last at t = {last:.6}")),
        };
        Some(format!(
            "{n} {positions} passed, {last}, where equations depend on each other: the motion goes on along the branch \
             on which it is smooth"
        ))
    }
}

/// Memory that the samples of one run may take, in bytes: what a small machine has.
const MAX_BYTES: u64 = 4_000_000_000;
/// Memory of a sample, of each component of its state and of each output at the worst moment, when the answer is both
/// numbers and JSON by name. Measured for 3 and 6 components: 900 and 1450 bytes a sample.
const BYTES_PER_SAMPLE: u64 = 350;
const BYTES_PER_COMPONENT: u64 = 185;
const BYTES_PER_OUTPUT: u64 = 30;

impl SimulateRequest {
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

    /// Whether a motion has come to its end: to the last time, or to an event that ends it.
    pub fn is_complete(&self, response: &SimulateResponse) -> bool {
        response.t == self.t_final || response.ended_by.is_some()
    }

    /// Time of a sample.
    pub fn sample_time(&self, k: usize) -> f64 {
        sample_time(self.t_final, self.samples, k)
    }
}

/// Why so many samples are too many, or nothing.
pub fn samples_refusal(samples: u64, info: &Info, with_outputs: bool) -> Option<String> {
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

/// Time of sample `k` of `samples` at equal distances from zero to `t_final`, both included; a single one is the end.
pub fn sample_time(t_final: f64, samples: usize, k: usize) -> f64 {
    if k + 1 >= samples { t_final } else { t_final * (k as f64 / (samples - 1) as f64) }
}

/// An integration that could not go on, with the time and the state reached.
pub fn stopped_because(info: &Info, t: f64, y: &[f64], reason: String) -> Error {
    let state = info.state.iter().cloned().zip(y.iter().copied()).collect();
    Error::Stopped { t, state, reason }
}
