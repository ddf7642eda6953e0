//! One group of trajectories after the other in the same storage.
//!
//! The module deliberately does not know threads, any scene or method.

use std::ops::Range;

use hamel_runtime::{AtRest, Integrator, Method, Options, StateVector as _, Stats};

use crate::error::Stop;
use crate::lanes::{Lanes, Source};
use crate::motions::{Members, Part, Stopped};

/// What every trajectory of an ensemble is asked for.
pub(crate) struct Goal<'a, P, M> {
    pub(crate) source: &'a P,
    pub(crate) method: M,
    pub(crate) options: Options<f64>,
    pub(crate) start: f64,
    pub(crate) t_end: f64,
    pub(crate) times: &'a [f64],
}

/// Storage of one integration, which the next one uses again.
pub(crate) struct Space<R: Lanes, P: Source<R>, M: Method<R, P::System>> {
    /// Parameters.
    values: Vec<R>,
    /// The initial state, and the last one when the integration is over.
    state: Vec<R>,
    system: Option<P::System>,
    rest: Option<AtRest<R, P::System, M>>,
}

impl<R: Lanes, P: Source<R>, M: Method<R, P::System>> Default for Space<R, P, M> {
    fn default() -> Self {
        Space { values: Vec::new(), state: Vec::new(), system: None, rest: None }
    }
}

/// How an integration ended.
struct Ended<E> {
    t: f64,
    n_samples: usize,
    stats: Stats,
    stop: Option<Stop<E>>,
}

/// Where a group of trajectories is integrated side by side, and where one of them alone.
pub(crate) type Spaces<'s, L, P, M> = (&'s mut Space<L, P, M>, &'s mut Space<f64, P, M>);

impl<P, M: Copy> Goal<'_, P, M> {
    /// Integrates trajectories side by side; one after the other if anything fails, or if there is one lane only.
    pub(crate) fn group<L: Lanes, E>(
        &self,
        (on_lanes, single): Spaces<'_, L, P, M>,
        members: &Members<'_>,
        range: Range<usize>,
        (part, stopped): (&mut Part<'_>, &mut Vec<Stopped<E>>),
    ) where
        P: Source<f64, Error = E> + Source<L, Error = E>,
        M: Method<f64, <P as Source<f64>>::System> + Method<L, <P as Source<L>>::System>,
    {
        let (first, width, before) = (range.start, range.len(), part.first);
        // Lanes beyond the last trajectory repeat it.
        let of = |lane: usize| (members.member)(before + first + lane.min(width - 1));
        let n_params = of(0).0.len();
        if L::LANES > 1 && (1..width).all(|lane| of(lane).0.len() == n_params) {
            let put = |time: usize, y: &[L], measure: Option<L>| {
                (0..width).for_each(|lane| part.put((first + lane, time, lane), y, measure));
            };
            on_lanes.gather(of);
            let ended = self.integrate::<L, E>(on_lanes, put);
            if ended.stop.is_none() {
                (0..width).for_each(|lane| part.end((first + lane, lane), &on_lanes.state, ended.stats));
                return;
            }
        }
        for lane in 0..width {
            let at = first + lane;
            part.clear(at);
            single.gather(|_| of(lane));
            let put = |time: usize, y: &[f64], measure: Option<f64>| part.put((at, time, 0), y, measure);
            let Ended { t, n_samples, stats, stop } = self.integrate::<f64, E>(single, put);
            part.end((at, 0), &single.state, stats);
            if let Some(stop) = stop {
                stopped.push(Stopped { at: before + at, n_samples, t, stop });
            }
        }
    }

    /// Integrates what the storage has gathered; `put` is told each sample.
    fn integrate<R: Lanes, E>(
        &self,
        space: &mut Space<R, P, M>,
        mut put: impl FnMut(usize, &[R], Option<R>),
    ) -> Ended<E>
    where
        P: Source<R, Error = E>,
        M: Method<R, P::System>,
    {
        let Space { values, state, system, rest } = space;
        let mut ended = Ended { t: self.start, n_samples: 0, stats: Stats::default(), stop: None };
        let prepared = match system.take() {
            Some(mut own) => self.source.prepare_again(&mut own, values).map(|()| own),
            None => self.source.prepare(values),
        };
        let system = match prepared {
            Ok(prepared) => system.insert(prepared),
            Err(bad) => {
                ended.stop = Some(Stop::Params(bad));
                return ended;
            }
        };
        let (system, start) = (&*system, R::from_f64(self.start));
        let solver = match rest.take() {
            Some(rest) => rest.start(system, start, state),
            None => {
                let options = self.options.map(R::from_f64);
                Integrator::new(system, self.method, start, self.source.state(state), options)
            }
        };
        let mut solver = match solver {
            Ok(solver) => solver,
            Err(error) => {
                ended.stop = Some(error.into());
                return ended;
            }
        };
        let times = self.times.iter().map(|&t| R::from_f64(t));
        let driven = solver.sample(R::from_f64(self.t_end), times, |t, y| {
            put(ended.n_samples, y.as_slice(), self.source.measure(system, t, y));
            ended.n_samples += 1;
        });
        ended.t = solver.t().lane(0);
        ended.stats = solver.stats();
        ended.stop = driven.err().map(Stop::from);
        state.copy_from_slice(solver.state().as_slice());
        *rest = Some(solver.rest());
        ended
    }
}

impl<R: Lanes, P: Source<R>, M: Method<R, P::System>> Space<R, P, M> {
    /// Takes parameters and initial states of the lanes, which have as many of both.
    fn gather<'m>(&mut self, of: impl Fn(usize) -> (&'m [f64], &'m [f64])) {
        let mut lanes: [(&[f64], &[f64]); MAX_LANES] = [(&[], &[]); MAX_LANES];
        lanes.iter_mut().take(R::LANES).enumerate().for_each(|(lane, member)| *member = of(lane));
        let (n_params, n_state) = (lanes[0].0.len(), lanes[0].1.len());
        self.values.clear();
        self.values.extend((0..n_params).map(|p| R::gather(|lane| lanes[lane].0[p])));
        self.state.clear();
        self.state.extend((0..n_state).map(|c| R::gather(|lane| lanes[lane].1[c])));
    }
}

/// The most lanes of a scalar.
const MAX_LANES: usize = 8;
