//! The trajectories of an ensemble: their starts and their results.
//!
//! The module deliberately does not know how they are integrated.

use std::fmt;

use hamel_runtime::{ParamError, Stats};

use crate::error::Stop;
use crate::lanes::Lanes;

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

/// What trajectories start from.
#[derive(Clone, Copy)]
pub struct Members<'a> {
    /// Number of trajectories.
    pub n: usize,
    /// Number of components of each state.
    pub n_state: usize,
    /// Parameters and initial state of each.
    pub member: &'a (dyn Fn(usize) -> (&'a [f64], &'a [f64]) + Sync),
}

impl fmt::Debug for Members<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Members").field("n", &self.n).field("n_state", &self.n_state).finish_non_exhaustive()
    }
}

/// Many trajectories, all numbers one after the other; `E` says why parameters are not allowed.
#[derive(Clone, Debug, PartialEq)]
pub struct Motions<E = ParamError> {
    /// Number of components of each state.
    pub n_state: usize,
    /// Number of samples of each trajectory.
    pub n_times: usize,
    /// States at the times asked for, trajectory by trajectory and time by time; NaN where they were not reached.
    pub states: Vec<f64>,
    /// What [`Source::measure`](crate::Source::measure) tells of each of these states; NaN where it tells nothing.
    pub measures: Vec<f64>,
    /// The last state of each trajectory; the initial state if it never started.
    pub ends: Vec<f64>,
    /// Work done for each, which the lanes of a group share: each of them reports the same counts.
    pub stats: Vec<Stats>,
    /// The trajectories that stopped before the end, in their order.
    pub stopped: Vec<Stopped<E>>,
}

/// A trajectory that stopped before the end.
#[derive(Clone, Debug, PartialEq)]
pub struct Stopped<E = ParamError> {
    /// Its number.
    pub at: usize,
    /// Number of samples that were reached.
    pub n_samples: usize,
    /// Time reached.
    pub t: f64,
    /// Why it stopped.
    pub stop: Stop<E>,
}

impl<E> Motions<E> {
    /// Room for so many trajectories.
    pub(crate) fn of(n: usize, n_state: usize, n_times: usize) -> Self {
        Motions {
            n_state,
            n_times,
            states: vec![f64::NAN; n * n_times * n_state],
            measures: vec![f64::NAN; n * n_times],
            ends: vec![f64::NAN; n * n_state],
            stats: vec![Stats::default(); n],
            stopped: Vec::new(),
        }
    }

    /// So many trajectories after the other, each part by itself.
    pub(crate) fn parts(&mut self, length: usize) -> Vec<Part<'_>> {
        let Motions { n_state, n_times, states, measures, ends, stats, .. } = self;
        let (n_state, n_times) = (*n_state, *n_times);
        let (mut states, mut measures, mut ends) = (&mut states[..], &mut measures[..], &mut ends[..]);
        let mut parts = Vec::with_capacity(stats.len().div_ceil(length));
        for (at, stats) in stats.chunks_mut(length).enumerate() {
            let n = stats.len();
            parts.push(Part {
                first: at * length,
                n_state,
                n_times,
                states: split_off(&mut states, n * n_times * n_state),
                measures: split_off(&mut measures, n * n_times),
                ends: split_off(&mut ends, n * n_state),
                stats,
            });
        }
        parts
    }

    /// Number of trajectories.
    pub fn len(&self) -> usize {
        self.stats.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.stats.is_empty()
    }

    /// The state of a trajectory at one of the times.
    ///
    /// # Panics
    /// When there is no such trajectory or time.
    pub fn state(&self, k: usize, time: usize) -> &[f64] {
        let first = (k * self.n_times + time) * self.n_state;
        &self.states[first..first + self.n_state]
    }

    pub(crate) fn into_trajectories<const N: usize>(self, t_end: f64) -> Vec<Trajectory<[f64; N], E>> {
        let array = |numbers: &[f64]| std::array::from_fn(|c| numbers[c]);
        let mut stopped = self.stopped.into_iter().peekable();
        let mut samples = self.states.chunks(N.max(1));
        let one = |(k, &stats): (usize, &Stats)| {
            let own = stopped.next_if(|stopped| stopped.at == k);
            let mut samples: Vec<[f64; N]> = samples.by_ref().take(self.n_times).map(array).collect();
            let state = array(&self.ends[k * N..(k + 1) * N]);
            let Some(Stopped { n_samples, t, stop, .. }) = own else {
                return Trajectory { t: t_end, state, samples, stats, stop: None };
            };
            samples.truncate(n_samples);
            Trajectory { t, state, samples, stats, stop: Some(stop) }
        };
        self.stats.iter().enumerate().map(one).collect()
    }
}

/// Takes the first numbers off.
fn split_off<'a>(rest: &mut &'a mut [f64], n: usize) -> &'a mut [f64] {
    let (first, others) = std::mem::take(rest).split_at_mut(n);
    *rest = others;
    first
}

/// Where some trajectories in a row are written.
pub(crate) struct Part<'a> {
    /// The number of the first.
    pub(crate) first: usize,
    n_state: usize,
    n_times: usize,
    states: &'a mut [f64],
    measures: &'a mut [f64],
    ends: &'a mut [f64],
    stats: &'a mut [Stats],
}

impl Part<'_> {
    /// Number of trajectories.
    pub(crate) fn len(&self) -> usize {
        self.stats.len()
    }

    /// Writes a sample, and what is measured of it.
    #[inline]
    pub(crate) fn put<L: Lanes>(
        &mut self,
        (k, time, lane): (usize, usize, usize),
        y: &[L],
        measure: Option<L>,
    ) {
        let at = k * self.n_times + time;
        let out = &mut self.states[at * self.n_state..(at + 1) * self.n_state];
        out.iter_mut().zip(y).for_each(|(out, y)| *out = y.lane(lane));
        if let Some(measure) = measure {
            self.measures[at] = measure.lane(lane);
        }
    }

    /// Writes where a trajectory ended.
    pub(crate) fn end<L: Lanes>(&mut self, (k, lane): (usize, usize), y: &[L], stats: Stats) {
        let out = &mut self.ends[k * self.n_state..(k + 1) * self.n_state];
        out.iter_mut().zip(y).for_each(|(out, y)| *out = y.lane(lane));
        self.stats[k] = stats;
    }

    /// Forgets the samples of a trajectory.
    pub(crate) fn clear(&mut self, k: usize) {
        let samples = k * self.n_times..(k + 1) * self.n_times;
        self.states[samples.start * self.n_state..samples.end * self.n_state].fill(f64::NAN);
        self.measures[samples].fill(f64::NAN);
    }
}
