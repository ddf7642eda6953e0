//! Integration of groups of trajectories, shared out to threads.
//!
//! The module deliberately does not know any scene or method.

use std::marker::PhantomData;

use hamel_runtime::{F64x4, Method, Options};
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use crate::error::Error;
use crate::lanes::{Family, Generated, Lanes, Source};
use crate::motions::{Members, Motions, Part, Trajectory};
use crate::space::{Goal, Space};

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
        let n = match (params.len(), initial.len()) {
            (sets, states) if sets == states || states == 1 => sets,
            (1, states) => states,
            (params, initial) => return Err(Error::Lengths { params, initial }),
        };
        let member = |k: usize| {
            let values = &params[if params.len() == 1 { 0 } else { k }];
            (values.as_ref(), initial[if initial.len() == 1 { 0 } else { k }].as_slice())
        };
        let source = Generated::<F, N>(PhantomData);
        let members = Members { n, n_state: N, member: &member };
        Ok(self.run_from(&source, &members, t_end, times, |_| {}).into_trajectories(t_end))
    }

    /// [`run`](Self::run) with systems that are known at run time only, and all numbers one after the other: nothing
    /// is allocated for a single trajectory. `progress` is told how many more trajectories are done, by any thread.
    pub fn run_from<P, E>(
        &self,
        source: &P,
        members: &Members<'_>,
        t_end: f64,
        times: &[f64],
        progress: impl Fn(usize) + Sync,
    ) -> Motions<E>
    where
        P: Source<f64, Error = E> + Source<L, Error = E>,
        E: Send,
        L: Lanes,
        M: Method<f64, <P as Source<f64>>::System> + Method<L, <P as Source<L>>::System> + Sync,
    {
        let goal =
            Goal { source, method: self.method, options: self.options, start: self.start, t_end, times };
        let n_groups = members.n.div_ceil(L::LANES);
        let length =
            n_groups.div_ceil(BLOCKS_OF_A_THREAD * rayon::current_num_threads()).clamp(1, LARGEST_BLOCK);
        let block = |mut part: Part<'_>| {
            let (mut on_lanes, mut single) = (Space::default(), Space::default());
            let mut stopped = Vec::new();
            for first in (0..part.len()).step_by(L::LANES) {
                let range = first..part.len().min(first + L::LANES);
                let width = range.len();
                goal.group::<L, E>((&mut on_lanes, &mut single), members, range, (&mut part, &mut stopped));
                progress(width);
            }
            stopped
        };
        let mut all = Motions::of(members.n, members.n_state, times.len());
        let stopped = share_out(all.parts(length * L::LANES), &block);
        Motions { stopped: stopped.into_iter().flatten().collect(), ..all }
    }
}

/// Groups of a block, at most: their numbers fit a core's cache.
const LARGEST_BLOCK: usize = 256;

/// Blocks for each thread, so that none waits long for the last one.
const BLOCKS_OF_A_THREAD: usize = 8;

/// A task on each part by the threads of the current pool, the results in order. What a task does is behind a pointer,
/// so that this is compiled once for each type of results, not for each system and method.
fn share_out<T: Send>(parts: Vec<Part<'_>>, task: &(dyn Fn(Part<'_>) -> T + Sync)) -> Vec<T> {
    parts.into_par_iter().map(task).collect()
}
