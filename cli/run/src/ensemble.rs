//! Many integrations of one scene side by side and on several threads.
//!
//! Does not know: whether the scene is compiled or interpreted, how a trajectory is integrated, what varies, files.

use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use hamel_ensemble::{Ensemble, Lanes, Motions, Source};
use hamel_runtime::{F64x4, F64x8, Method, Options, Wiener};
use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use rayon::ThreadPool;
use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use serde::{Deserialize, Serialize};

use super::any_method::AnyMethod;
use super::auto::Purpose;
use super::dynamics::{BadParams, Factory, PreparedLanes, PreparedScene, Several, VecState};
use super::info::Info;
use super::integrate::{self, Unfinished};
use super::lost_rank::Rank;
use super::members::{Beginnings, Followed, Members};
use super::method::{MethodName, Steps};
use super::noise::{self, Noise};
use super::simulation::{MAX_EVENTS, SimulateRequest, sample_time};
use super::solver::method_of;
use super::watched::Watched;
use crate::error::Error;
use crate::signs::{self, Instead};

/// How many trajectories are integrated side by side by one core.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Width {
    /// One, with steps of its own: the bits of `simulate`.
    #[cfg_attr(feature = "clap", value(name = "1"))]
    One,
    /// Four, with common steps that keep the tolerances of each; explicit methods only, otherwise one.
    #[cfg_attr(feature = "clap", value(name = "4"))]
    Four,
    /// Eight, likewise.
    #[default]
    #[cfg_attr(feature = "clap", value(name = "8"))]
    Eight,
}

impl Width {
    /// How many.
    pub fn lanes(self) -> usize {
        match self {
            Width::One => 1,
            Width::Four => F64x4::LANES,
            Width::Eight => F64x8::LANES,
        }
    }

    /// That of so many lanes, if it is one.
    pub fn of_lanes(lanes: usize) -> Option<Width> {
        [Width::One, Width::Four, Width::Eight].into_iter().find(|width| width.lanes() == lanes)
    }
}

/// Many integrations from time zero that differ in parameters and initial state.
#[derive(Clone, Debug, PartialEq)]
pub struct EnsembleRequest {
    /// What each trajectory starts from.
    pub members: Beginnings,
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
    /// The path of the first trajectory, with the seed of all; the others have the numbers behind it.
    pub noise: Noise,
    /// Events that change the state or end motions; each trajectory has steps of its own then.
    pub watched: Option<Watched>,
    /// How far the whole ensemble is.
    pub progress: Progress,
    /// Whether it is called off.
    pub cancel: Cancel,
}

/// Whether somebody has called an ensemble off: trajectories that have not begun are not integrated then.
#[derive(Clone, Debug, Default)]
pub struct Cancel(Arc<AtomicBool>);

impl Cancel {
    /// Calls it off.
    pub fn call_off(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it is called off.
    pub fn is_off(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl PartialEq for Cancel {
    /// Requests are the same whether or not somebody waits for the answer.
    fn eq(&self, _: &Cancel) -> bool {
        true
    }
}

/// How far an ensemble is before a request, for the progress bar.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// Trajectories that are done.
    pub done: usize,
    /// Those of them that were there before this run.
    pub found: usize,
    /// All.
    pub all: usize,
    /// Seconds since the run began.
    pub seconds: f64,
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

/// Integrates all members on several threads; results are in their order, and the same for any number of threads.
/// Neighbours among the members with a start are side by side.
///
/// # Errors
/// [`Error::Options`] for a time, tolerances, a method or a number of threads that suit none of them, and where it is
/// called off.
pub fn integrate(factory: &dyn Factory, request: &EnsembleRequest) -> Result<Members, Error> {
    let options = request.options()?;
    let pool = pool(request.threads)?;
    let times: Vec<f64> =
        (0..request.samples).map(|k| sample_time(request.t_final, request.samples, k)).collect();
    let _instead = Instead::of_line();
    let bar = progress_bar(request.progress);
    let progress = |n: usize| bar.inc(n as u64);
    let members = pool.install(|| {
        let noise = noise_of(factory.info(), request, &times)?;
        // What a scene can do depends on the scene alone, but takes parameters that are allowed.
        let any = request.members.iter().find_map(|(p, y)| Some((factory.prepare(p).ok()?, y)));
        let is_held = any.as_ref().is_some_and(|(dynamics, y)| Rank::may_be_lost(&**dynamics, y));
        if request.watched.is_some() || is_held {
            let scenes = Scenes { factory, cancel: request.cancel.clone(), noise };
            return Ok(one_by_one(&scenes, request, (&times, &progress)));
        }
        let job = Job { factory, request, noise, options, times: &times, progress: &progress };
        let method = match &any {
            Some((dynamics, y)) => {
                let purpose = Purpose::of_ensemble(request.samples);
                method_of(request.method, request.steps, purpose, &**dynamics, y)?
            }
            // No trajectory will start, whatever the method.
            None => AnyMethod::single(&hamel_runtime::Dop853),
        };
        let motions = match (request.width, method.of_lanes(), method.of_eight_lanes()) {
            (Width::Four, Some(method), _) => job.run::<F64x4, _>(method),
            (Width::Eight, _, Some(method)) => job.run::<F64x8, _>(method),
            _ => job.run::<f64, _>(method.of_scenes()),
        }?;
        Ok(Members::new(factory, &request.members, motions, &times))
    });
    bar.finish_and_clear();
    if request.cancel.is_off() {
        return Err(Error::Options { reason: "the ensemble was called off".into() });
    }
    members
}

/// What moves the trajectories of a scene with noise.
fn noise_of(info: &Info, request: &EnsembleRequest, times: &[f64]) -> Result<Option<Wiener>, Error> {
    if info.noises.is_empty() {
        return Ok(None);
    }
    let EnsembleRequest { members, noise, method, steps, t_final, watched, .. } = request;
    if watched.is_some() {
        noise::refuse(info, "whose paths no event is watched for on")?;
    }
    if u32::try_from(members.len()).ok().and_then(|n| noise.path.checked_add(n)).is_none() {
        return Err(Error::Options { reason: format!("noise has at most {} paths", u32::MAX) });
    }
    noise.wiener(info, (*method, *steps), times.iter().copied().chain([*t_final])).map(Some)
}

/// All members with a start through their events, held to the rank of their constraints, each in the steps that
/// `simulate` takes by the same method.
fn one_by_one(
    scenes: &Scenes<'_>,
    request: &EnsembleRequest,
    (times, progress): (&[f64], &(dyn Fn(usize) + Sync)),
) -> Members {
    let EnsembleRequest { members, t_final, method, steps, max_steps, samples, watched, noise, .. } = request;
    let n_params = scenes.factory.info().params.len();
    let single = |(params, initial): (&[f64], &[f64])| SimulateRequest {
        // What inputs are held at stands behind the parameters, and the dynamics have it.
        params: params[..params.len().min(n_params)].to_vec(),
        initial: initial.to_vec(),
        t_final: *t_final,
        method: *method,
        steps: *steps,
        samples: *samples,
        with_outputs: false,
        n_group: 0,
        max_steps: max_steps.unwrap_or(steps.max_steps()),
        max_events: MAX_EVENTS,
        watched: watched.clone(),
        noise: Noise::default(),
        along: Vec::new(),
        tangents: Vec::new(),
    };
    let on_paths = scenes.noise.map(|_| members.numbered(noise.path));
    let all: Vec<(&[f64], &[f64])> = on_paths.as_ref().unwrap_or(members).iter().collect();
    let follow = |member: &(&[f64], &[f64])| {
        let followed = followed_of((scenes, member.0), &single(*member), times);
        progress(1);
        followed
    };
    let motions: Vec<Followed> = all.par_iter().map(follow).collect();
    Members::one_by_one(scenes.factory, members, motions, times)
}

fn followed_of(
    (scenes, params): (&Scenes<'_>, &[f64]),
    request: &SimulateRequest,
    times: &[f64],
) -> Followed {
    let never = |reason: String| Followed { samples: Vec::new(), steps: 0, stop: Some((reason, None)) };
    let dynamics = match Source::<f64>::prepare(scenes, params) {
        Ok(dynamics) => dynamics,
        Err(bad) => return never(bad.to_string()),
    };
    let at = |t: f64, state: &[f64]| {
        let energy = dynamics.energy(t, state).filter(|energy| energy.is_finite());
        Some((t, state.to_vec(), energy))
    };
    match integrate::followed(&dynamics, request, times, &mut |_| ControlFlow::Continue(())) {
        Ok(found) => {
            let by = found.ended_by.filter(|_| found.t != request.t_final);
            let stop =
                by.map(|event| (format!("event {event} has ended the motion"), at(found.t, &found.last)));
            Followed { samples: found.samples, steps: found.steps, stop }
        }
        Err(unfinished) => {
            let Unfinished { error, samples, steps } = *unfinished;
            let (reason, last) = match error {
                Error::Stopped { t, state, reason } => {
                    let state: Vec<f64> = state.into_iter().map(|(_, value)| value).collect();
                    (reason, at(t, &state))
                }
                other => (other.to_string(), None),
            };
            Followed { samples, steps, stop: Some((reason, last)) }
        }
    }
}

/// The scenes of a factory for all parameters, none once the ensemble is called off.
struct Scenes<'a> {
    factory: &'a dyn Factory,
    cancel: Cancel,
    /// What moves them, with the number of the path behind the parameters.
    noise: Option<Wiener>,
}

impl Scenes<'_> {
    fn go_on(&self) -> Result<(), BadParams> {
        match self.cancel.is_off() {
            true => Err(BadParams { condition: "going on".into(), meaning: String::new() }),
            false => Ok(()),
        }
    }
}

impl<'a> Source<f64> for Scenes<'a> {
    type State = VecState;
    type System = PreparedScene<'a>;
    type Error = BadParams;

    fn prepare(&self, params: &[f64]) -> Result<Self::System, BadParams> {
        self.go_on()?;
        match (self.noise, params.split_last()) {
            (Some(noise), Some((path, params))) => {
                self.factory.prepare_noisy(params, noise.with_path(*path as u32))
            }
            _ => self.factory.prepare(params),
        }
    }

    fn state(&self, components: &[f64]) -> VecState {
        VecState(components.to_vec())
    }

    fn measure(&self, system: &Self::System, t: f64, y: &VecState) -> Option<f64> {
        system.energy(t, &y.0)
    }
}

impl<'a, L: Several> Source<L> for Scenes<'a> {
    type State = VecState<L>;
    type System = PreparedLanes<'a, L>;
    type Error = BadParams;

    fn prepare(&self, params: &[L]) -> Result<Self::System, BadParams> {
        self.go_on()?;
        L::prepare(self.factory, params)
    }

    fn prepare_again(&self, system: &mut Self::System, params: &[L]) -> Result<(), BadParams> {
        self.go_on()?;
        L::prepare_again(self.factory, system, params)
    }

    fn state(&self, components: &[L]) -> VecState<L> {
        VecState(components.to_vec())
    }

    fn measure(&self, system: &Self::System, t: L, y: &VecState<L>) -> Option<L> {
        system.energy(t, y)
    }
}

/// An ensemble that waits for its method, on the threads of the current pool.
struct Job<'a, 'r> {
    factory: &'a dyn Factory,
    request: &'r EnsembleRequest,
    noise: Option<Wiener>,
    options: Options<f64>,
    /// Times of the samples.
    times: &'r [f64],
    /// Is told how many more trajectories are done.
    progress: &'r (dyn Fn(usize) + Sync),
}

impl<'a> Job<'a, '_> {
    fn run<L, M>(&self, method: M) -> Result<Motions<BadParams>, Error>
    where
        L: Lanes,
        Scenes<'a>: Source<L, Error = BadParams>,
        M: Method<f64, PreparedScene<'a>> + Method<L, <Scenes<'a> as Source<L>>::System> + Sync,
    {
        Method::<f64, PreparedScene<'a>>::validate(&method, &self.options)
            .map_err(|e| Error::Options { reason: e.to_string() })?;
        let ensemble = Ensemble::new(method, self.options).with_lanes::<L>();
        let EnsembleRequest { members, t_final, cancel, noise, .. } = self.request;
        let scenes = Scenes { factory: self.factory, cancel: cancel.clone(), noise: self.noise };
        let on_paths = self.noise.map(|_| members.numbered(noise.path));
        let members = on_paths.as_ref().unwrap_or(members);
        let started = members.started();
        let member = |k: usize| members.member(started.as_ref().map_or(k, |started| started[k]));
        let n = started.as_ref().map_or(members.len(), Vec::len);
        let all = hamel_ensemble::Members { n, n_state: members.n_state, member: &member };
        Ok(ensemble.run_from(&scenes, &all, *t_final, self.times, self.progress))
    }
}

/// Most threads: several for each core of a large machine, and far fewer than a system refuses.
const MAX_THREADS: usize = 1024;

/// Threads for an ensemble.
///
/// # Errors
/// [`Error::Request`] for too many, [`Error::Options`] when they cannot be started.
pub fn pool(threads: Option<usize>) -> Result<ThreadPool, Error> {
    if let Some(n) = threads.filter(|n| *n > MAX_THREADS) {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        let reason = format!(
            "is {n}, but at most {MAX_THREADS} are started: leave it out for as many as there are cores, {cores} here"
        );
        return Err(Error::unusable("--threads", reason));
    }
    // Zero is the pool's word for as many as there are cores.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|e| Error::Options { reason: format!("threads could not be started: {e}") })
}

/// A bar on a terminal, with the rate of the whole run, and the time left at that rate.
fn progress_bar(progress: Progress) -> ProgressBar {
    let bar = ProgressBar::new(progress.all as u64);
    if !signs::are_shown() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let told = move |state: &ProgressState, out: &mut dyn fmt::Write| {
        let seconds = progress.seconds + state.elapsed().as_secs_f64();
        // A bar that cannot be written is not shown.
        let _ = out.write_str(&rate(progress, state.pos(), seconds));
    };
    // The template is a constant that indicatif accepts.
    let style = ProgressStyle::with_template("  {bar:40} {pos} of {len} trajectories  {rate}");
    bar.set_style(style.expect("valid template").with_key("rate", told));
    bar.set_position(progress.done as u64);
    bar
}

/// Trajectories a second and the time left, once there is a rate.
///
/// Trajectories that were there before the run took no time of it.
fn rate(progress: Progress, position: u64, seconds: f64) -> String {
    let made = position.saturating_sub(progress.found as u64) as f64;
    let left = (progress.all as u64).saturating_sub(position) as f64;
    let rate = made / seconds;
    if !rate.is_finite() || rate <= 0.0 {
        return String::new();
    }
    // Never so many seconds, but a number that is not finite is no time.
    let left = Duration::from_secs_f64((left / rate).min(1e15));
    format!("{rate:.3e}/s  {} left", HumanDuration(left))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use hamel_ensemble::Motions;
    use hamel_runtime::{Dop853, F64x8, Gbs14, Method, Options};

    use super::{Cancel, EnsembleRequest, Job, Progress, Width, rate};
    use crate::any_method::{OfLanes, OfScenes, SideBySide};
    use crate::cache::Cache;
    use crate::dynamics::{BadParams, PreparedLanes};
    use crate::extrapolated::Extrapolated;
    use crate::interpreted::{self, Built};
    use crate::machine::Registers;
    use crate::members::Beginnings;
    use crate::method::{MethodName, Steps};
    use crate::model::Checked;
    use crate::noise::Noise;
    use crate::session::Session;
    use crate::wide::Wide;

    const BOUNDED: &str = "
        model bounded {
            param l = 2 where l > 0;
            coordinate theta in angle;
            coordinate x in (-100, 1);
            lagrangian = (x_dot^2 + l^2*theta_dot^2/2 + x_dot*theta_dot*cos(theta))/2 + l*cos(theta) - x^2/2;
        }
    ";

    /// Some trajectories, of which the tenth runs out of its domain.
    fn request(n: usize) -> EnsembleRequest {
        let mut members = Beginnings::none(1, 4);
        for k in 0..n {
            let x = (k as f64 * 0.37).sin();
            let speed = if k == 9 { 40.0 } else { 0.3 * x };
            members.push(&[1.5 + 0.3 * x], &[0.4 * x, 0.2, 0.1 - x, speed]);
        }
        EnsembleRequest {
            members,
            t_final: 0.5,
            method: MethodName::Gbs14,
            steps: Steps::Adaptive { rtol: 1e-9, atol: 1e-11, max: None },
            samples: 3,
            width: Width::Eight,
            max_steps: None,
            threads: Some(1),
            noise: Noise::default(),
            watched: None,
            progress: Progress::default(),
            cancel: Cancel::default(),
        }
    }

    fn motions<'a>(
        scene: &'a Built,
        request: &EnsembleRequest,
        (single, lanes): (OfScenes<'a>, OfLanes<'a, F64x8>),
    ) -> Motions<BadParams> {
        let options: Options<f64> = request.options().unwrap();
        let (times, progress) = ([0.0, 0.25, 0.5], |_: usize| {});
        let job = Job { factory: scene, request, noise: None, options, times: &times, progress: &progress };
        job.run::<F64x8, _>(SideBySide::chosen(single, lanes)).unwrap()
    }

    /// Of any number of trajectories, the last group of which has any size; one of them fails, with its neighbours
    /// integrated alone.
    #[test]
    fn ensembles_on_eight_lanes_have_the_same_bits_with_any_registers() {
        let tableau = <Dop853 as Method<F64x8, PreparedLanes<'static, F64x8>>>::TABLEAU;
        let model = Session::of_shipped(&[]).parse("bounded", BOUNDED).unwrap_or_else(|e| panic!("{e}"));
        let model = Arc::new(Checked::new(model, Cache::none()));
        let scene = || interpreted::build(&model, "default").unwrap_or_else(|e| panic!("{e}"));
        for n in 1..=17 {
            let request = request(n);
            let own: [Motions<BadParams>; 2] = [
                motions(&scene(), &request, (&Gbs14, &Gbs14)),
                motions(&scene(), &request, (&Dop853, &Dop853)),
            ];
            assert_eq!(own[0].stopped.len(), usize::from(n > 9), "the tenth alone does not arrive");
            for most in [Registers::OfProgram, Registers::Avx, Registers::Avx2, Registers::Avx512] {
                let scene = scene().in_memory().with_registers_up_to(most);
                let gbs: OfLanes<'_, F64x8> = match Extrapolated::up_to(most) {
                    Some(found) => Box::leak(Box::new(found)),
                    None => &Gbs14,
                };
                let dop: OfLanes<'_, F64x8> = match Wide::up_to(most, tableau) {
                    Some(found) => Box::leak(Box::new(found)),
                    None => &Dop853,
                };
                let found =
                    [motions(&scene, &request, (&Gbs14, gbs)), motions(&scene, &request, (&Dop853, dop))];
                for (own, found) in own.iter().zip(&found) {
                    let bits = |all: &[f64]| all.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
                    assert_eq!(bits(&found.states), bits(&own.states), "{n} trajectories, {most:?}");
                    assert_eq!(bits(&found.ends), bits(&own.ends), "{n} trajectories, {most:?}");
                    assert_eq!(bits(&found.measures), bits(&own.measures), "{n} trajectories, {most:?}");
                    assert_eq!((&found.stats, &found.stopped), (&own.stats, &own.stopped));
                }
            }
        }
    }

    /// Of work that was done before the run there is no speed.
    #[test]
    fn trajectories_found_take_no_part_in_the_time_left() {
        let progress = Progress { done: 9000, found: 8000, all: 100_000, seconds: 0.0 };
        assert_eq!(rate(progress, 9000, 10.0), "1.000e2/s  15 minutes left");
        assert_eq!(rate(Progress { found: 9000, ..progress }, 9000, 10.0), "");
        assert_eq!(rate(progress, 9000, 0.0), "");
    }
}
