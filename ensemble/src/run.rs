//! Integration of groups of trajectories, shared out to threads.
//!
//! The module deliberately does not know any scene or method.

use std::marker::PhantomData;

use hamel_runtime::{Error as IntegrationError, F64x4, Integrator, Method, Options, Scene, Stats, StepSize};
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use crate::error::{Error, Stop};
use crate::lanes::{Family, Lanes};

/// How the trajectories of an ensemble are integrated: method, options, lanes.
///
/// The threads are those of the current `rayon` pool: by default as many as the machine has cores; call
/// [`run`](Self::run) within `ThreadPool::install` for others.
#[derive(Clone, Copy, Debug)]
pub struct Ensemble<M, L = F64x4> {
    method: M,
    options: Options<f64>,
    start: f64,
    lanes: PhantomData<fn() -> L>,
}

/// One trajectory of an ensemble.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory<const N: usize> {
    /// Time reached: exactly the end asked for, unless it stopped.
    pub t: f64,
    /// The state there; the initial state if it never started.
    pub state: [f64; N],
    /// States at the times asked for, as far as they were reached, in their order.
    pub samples: Vec<[f64; N]>,
    /// Work done by the integration, which the lanes of a group share: each of them reports the same counts.
    pub stats: Stats,
    /// Why it stopped before the end.
    pub stop: Option<Stop>,
}

impl<M> Ensemble<M> {
    /// Trajectories from time zero, on four lanes.
    pub fn new(method: M, options: Options<f64>) -> Self {
        Self { method, options, start: 0.0, lanes: PhantomData }
    }
}

impl<M, L> Ensemble<M, L> {
    /// Sets the number of lanes by their scalar: `f64`, [`F64x4`], [`F64x8`](crate::F64x8).
    #[must_use]
    pub fn with_lanes<K: Lanes>(self) -> Ensemble<M, K> {
        Ensemble { method: self.method, options: self.options, start: self.start, lanes: PhantomData }
    }

    /// Sets the time of the initial states.
    #[must_use]
    pub fn with_start(mut self, t: f64) -> Self {
        self.start = t;
        self
    }

    /// Integrates every trajectory to `t_end`, and records its states at `times`.
    ///
    /// The results are in the order of the input. What they depend on is said at the [crate](crate).
    ///
    /// # Shapes
    ///
    /// params: \[n\] or \[1\] sets in the order of `INFO.params`; initial: \[n\] or \[1\] states; times: between the start
    /// and `t_end`, in the direction of integration.
    ///
    /// # Errors
    ///
    /// [`Error::Lengths`]. Whatever concerns one trajectory is its [`Trajectory::stop`], options and times that cannot be
    /// included.
    pub fn run<F, const N: usize>(
        &self,
        params: &[impl AsRef<[f64]> + Sync],
        initial: &[[f64; N]],
        t_end: f64,
        times: &[f64],
    ) -> Result<Vec<Trajectory<N>>, Error>
    where
        F: Family<N>,
        L: Lanes,
        M: Method<f64, F::Of<f64>> + Method<L, F::Of<L>> + Sync,
    {
        let n = match (params.len(), initial.len()) {
            (sets, states) if sets == states || states == 1 => sets,
            (1, states) => states,
            (params, initial) => return Err(Error::Lengths { params, initial }),
        };
        let member = |k: usize| {
            let values = &params[if params.len() == 1 { 0 } else { k }];
            (values.as_ref(), &initial[if initial.len() == 1 { 0 } else { k }])
        };
        let goal = Goal { method: self.method, options: self.options, start: self.start, t_end, times };
        let group = |first: usize| {
            let width = L::LANES.min(n - first);
            let members: Vec<(&[f64], &[f64; N])> = (first..first + width).map(member).collect();
            goal.together::<F::Of<L>, L, N>(&members).unwrap_or_else(|| {
                members.iter().map(|&(values, y)| goal.alone::<F::Of<f64>, N>(values, y)).collect()
            })
        };
        let groups: Vec<Vec<Trajectory<N>>> =
            (0..n.div_ceil(L::LANES)).into_par_iter().map(|g| group(g * L::LANES)).collect();
        Ok(groups.into_iter().flatten().collect())
    }
}

/// What every trajectory of an ensemble is asked for.
struct Goal<'a, M> {
    method: M,
    options: Options<f64>,
    start: f64,
    t_end: f64,
    times: &'a [f64],
}

impl<M> Goal<'_, M> {
    /// Trajectories side by side; none if anything fails, or if there is one lane only.
    fn together<S, L: Lanes, const N: usize>(
        &self,
        members: &[(&[f64], &[f64; N])],
    ) -> Option<Vec<Trajectory<N>>>
    where
        S: Scene<L, State = [L; N]>,
        M: Method<L, S>,
    {
        let n_params = members[0].0.len();
        if L::LANES == 1 || members.iter().any(|(values, _)| values.len() != n_params) {
            return None;
        }
        // Lanes beyond the last trajectory repeat it.
        let of = |k: usize| members[k.min(members.len() - 1)];
        let values: Vec<L> = (0..n_params).map(|p| L::gather(|k| of(k).0[p])).collect();
        let scene = S::prepare(&values).ok()?;
        let initial: [L; N] = std::array::from_fn(|c| L::gather(|k| of(k).1[c]));
        let scatter = |y: &[L; N], k: usize| -> [f64; N] { std::array::from_fn(|c| y[c].lane(k)) };
        let mut samples = vec![Vec::with_capacity(self.times.len()); members.len()];
        let keep = |y: &[L; N]| {
            for (k, samples) in samples.iter_mut().enumerate() {
                samples.push(scatter(y, k));
            }
        };
        let start = L::from_f64(self.start);
        let mut solver = Integrator::new(&scene, self.method, start, initial, lanewise(self.options)).ok()?;
        self.drive(&mut solver, keep).ok()?;
        let finish = |(k, samples)| Trajectory {
            t: self.t_end,
            state: scatter(solver.state(), k),
            samples,
            stats: solver.stats(),
            stop: None,
        };
        Some(samples.into_iter().enumerate().map(finish).collect())
    }

    /// One trajectory, with whatever becomes of it.
    fn alone<S, const N: usize>(&self, values: &[f64], initial: &[f64; N]) -> Trajectory<N>
    where
        S: Scene<f64, State = [f64; N]>,
        M: Method<f64, S>,
    {
        let mut trajectory = Trajectory {
            t: self.start,
            state: *initial,
            samples: Vec::with_capacity(self.times.len()),
            stats: Stats::default(),
            stop: None,
        };
        let outcome = (|| -> Result<(), Stop> {
            let scene = S::prepare(values)?;
            let mut solver = Integrator::new(&scene, self.method, self.start, *initial, self.options)?;
            let driven = self.drive(&mut solver, |y| trajectory.samples.push(*y));
            (trajectory.t, trajectory.state) = (solver.t(), *solver.state());
            trajectory.stats = solver.stats();
            Ok(driven?)
        })();
        trajectory.stop = outcome.err();
        trajectory
    }

    fn drive<R: Lanes, S, K, const N: usize>(
        &self,
        solver: &mut Integrator<'_, R, S, K>,
        mut keep: impl FnMut(&[R; N]),
    ) -> Result<(), IntegrationError>
    where
        S: Scene<R, State = [R; N]>,
        K: Method<R, S>,
    {
        let times = self.times.iter().map(|&t| R::from_f64(t));
        solver.sample(R::from_f64(self.t_end), times, |_, y| keep(y))
    }
}

/// The same options on every lane.
fn lanewise<L: Lanes>(options: Options<f64>) -> Options<L> {
    Options {
        rtol: L::from_f64(options.rtol),
        atol: L::from_f64(options.atol),
        step: match options.step {
            StepSize::Fixed(h) => StepSize::Fixed(L::from_f64(h)),
            StepSize::Adaptive { initial, max } => {
                StepSize::Adaptive { initial: initial.map(L::from_f64), max: max.map(L::from_f64) }
            }
        },
        norm: options.norm,
        max_steps: options.max_steps,
    }
}
