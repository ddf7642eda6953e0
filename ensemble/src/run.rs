//! Integration of groups of trajectories, shared out to threads.
//!
//! The module deliberately does not know any scene or method.

use std::marker::PhantomData;

use hamel_runtime::{
    Error as IntegrationError, F64x4, Integrator, Method, Options, ParamError, StateVector, Stats, System,
};
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use crate::error::{Error, Stop};
use crate::lanes::{Family, Generated, Lanes, Source};

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

/// One trajectory of an ensemble: `Y` stores a state, `E` says why parameters are not allowed.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory<Y, E = ParamError> {
    /// Time reached: exactly the end asked for, unless it stopped.
    pub t: f64,
    /// The state there; the initial state if it never started.
    pub state: Y,
    /// States at the times asked for, as far as they were reached, in their order.
    pub samples: Vec<Y>,
    /// Work done by the integration, which the lanes of a group share: each of them reports the same counts.
    pub stats: Stats,
    /// Why it stopped before the end.
    pub stop: Option<Stop<E>>,
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
    /// params: \[n\] or \[1\] sets in the order of `INFO.params`; initial: \[n\] or \[1\] states; times: between the
    /// start and `t_end`, in the direction of integration.
    ///
    /// # Errors
    ///
    /// [`Error::Lengths`]. Whatever concerns one trajectory is its [`Trajectory::stop`], options and times that cannot
    /// be included.
    pub fn run<F, const N: usize>(
        &self,
        params: &[impl AsRef<[f64]> + Sync],
        initial: &[[f64; N]],
        t_end: f64,
        times: &[f64],
    ) -> Result<Vec<Trajectory<[f64; N]>>, Error>
    where
        F: Family<N>,
        L: Lanes,
        M: Method<f64, F::Of<f64>> + Method<L, F::Of<L>> + Sync,
    {
        self.run_from(&Generated::<F, N>(PhantomData), params, initial, t_end, times, |_| {})
    }

    /// [`run`](Self::run) with systems that are known at run time only. `progress` is told how many more trajectories
    /// are done, by any thread.
    ///
    /// # Errors
    ///
    /// As [`run`](Self::run).
    pub fn run_from<P, Y, E>(
        &self,
        source: &P,
        params: &[impl AsRef<[f64]> + Sync],
        initial: &[Y],
        t_end: f64,
        times: &[f64],
        progress: impl Fn(usize) + Sync,
    ) -> Result<Vec<Trajectory<Y, E>>, Error>
    where
        P: Source<f64, State = Y, Error = E> + Source<L, Error = E>,
        Y: StateVector<f64> + Send + Sync,
        E: Send,
        L: Lanes,
        M: Method<f64, <P as Source<f64>>::System> + Method<L, <P as Source<L>>::System> + Sync,
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
        let goal =
            Goal { source, method: self.method, options: self.options, start: self.start, t_end, times };
        let group = |first: usize| {
            let width = L::LANES.min(n - first);
            let members: Vec<(&[f64], &Y)> = (first..first + width).map(member).collect();
            let done = goal
                .together::<L, Y, E>(&members)
                .unwrap_or_else(|| members.iter().map(|&(values, y)| goal.alone(values, y)).collect());
            progress(width);
            done
        };
        let groups = share_out(n.div_ceil(L::LANES), &|g| group(g * L::LANES));
        Ok(groups.into_iter().flatten().collect())
    }
}

/// The tasks `0..n` on the threads of the current pool, their results in order. What a task does is behind a pointer,
/// so that this is compiled once for each type of results, not for each system and method.
fn share_out<T: Send>(n: usize, task: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    (0..n).into_par_iter().map(task).collect()
}

/// What every trajectory of an ensemble is asked for.
struct Goal<'a, P, M> {
    source: &'a P,
    method: M,
    options: Options<f64>,
    start: f64,
    t_end: f64,
    times: &'a [f64],
}

impl<P, M: Copy> Goal<'_, P, M> {
    /// Trajectories side by side; none if anything fails, or if there is one lane only.
    fn together<L: Lanes, Y, E>(&self, members: &[(&[f64], &Y)]) -> Option<Vec<Trajectory<Y, E>>>
    where
        P: Source<f64, State = Y, Error = E> + Source<L>,
        Y: StateVector<f64>,
        M: Method<L, <P as Source<L>>::System>,
    {
        let (n_params, n_state) = (members[0].0.len(), members[0].1.as_slice().len());
        let alike = |&(values, y): &(&[f64], &Y)| values.len() == n_params && y.as_slice().len() == n_state;
        if L::LANES == 1 || !members.iter().all(alike) {
            return None;
        }
        // Lanes beyond the last trajectory repeat it.
        let of = |k: usize| members[k.min(members.len() - 1)];
        let values: Vec<L> = (0..n_params).map(|p| L::gather(|k| of(k).0[p])).collect();
        let system = Source::<L>::prepare(self.source, &values).ok()?;
        let initial: Vec<L> = (0..n_state).map(|c| L::gather(|k| of(k).1.as_slice()[c])).collect();
        let initial = Source::<L>::state(self.source, &initial);
        let mut lane = vec![0.0; n_state];
        let mut scatter = |y: &[L], k: usize| {
            lane.iter_mut().zip(y).for_each(|(x, y)| *x = y.lane(k));
            Source::<f64>::state(self.source, &lane)
        };
        let mut samples: Vec<Vec<Y>> = vec![Vec::with_capacity(self.times.len()); members.len()];
        let start = L::from_f64(self.start);
        let mut solver =
            Integrator::new(&system, self.method, start, initial, self.options.map(L::from_f64)).ok()?;
        let keep = |y: &<P as Source<L>>::State| {
            for (k, samples) in samples.iter_mut().enumerate() {
                samples.push(scatter(y.as_slice(), k));
            }
        };
        self.drive(&mut solver, keep).ok()?;
        let finish = |(k, samples)| Trajectory {
            t: self.t_end,
            state: scatter(solver.state().as_slice(), k),
            samples,
            stats: solver.stats(),
            stop: None,
        };
        Some(samples.into_iter().enumerate().map(finish).collect())
    }

    /// One trajectory, with whatever becomes of it.
    fn alone<Y, E>(&self, values: &[f64], initial: &Y) -> Trajectory<Y, E>
    where
        P: Source<f64, State = Y, Error = E>,
        Y: StateVector<f64>,
        M: Method<f64, <P as Source<f64>>::System>,
    {
        let mut trajectory = Trajectory {
            t: self.start,
            state: initial.clone(),
            samples: Vec::with_capacity(self.times.len()),
            stats: Stats::default(),
            stop: None,
        };
        let outcome = (|| -> Result<(), Stop<E>> {
            let system = self.source.prepare(values).map_err(Stop::Params)?;
            let mut solver =
                Integrator::new(&system, self.method, self.start, initial.clone(), self.options)?;
            let driven = self.drive(&mut solver, |y| trajectory.samples.push(y.clone()));
            (trajectory.t, trajectory.state) = (solver.t(), solver.state().clone());
            trajectory.stats = solver.stats();
            Ok(driven?)
        })();
        trajectory.stop = outcome.err();
        trajectory
    }

    fn drive<R: Lanes, S: System<R>, K: Method<R, S>>(
        &self,
        solver: &mut Integrator<'_, R, S, K>,
        mut keep: impl FnMut(&S::State),
    ) -> Result<(), IntegrationError> {
        let times = self.times.iter().map(|&t| R::from_f64(t));
        solver.sample(R::from_f64(self.t_end), times, |_, y| keep(y))
    }
}
