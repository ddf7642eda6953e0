//! What the trajectories of an ensemble start from, and what became of them: all numbers one after the other.
//!
//! Does not know: how trajectories are integrated, files.

use std::borrow::Cow;
use std::collections::BTreeMap;

use hamel_ensemble::{Motions, Stop, Stopped};

use super::dynamics::{BadParams, Factory};
use super::evaluate::why_stopped;
use super::simulation::Sample;

/// Parameters and initial states of trajectories; behind the parameters, or not, what their inputs are held at.
#[derive(Clone, Debug, PartialEq)]
pub struct Beginnings {
    n: usize,
    n_params: usize,
    pub(super) n_state: usize,
    params: Vec<f64>,
    states: Vec<f64>,
    /// Why some have no start.
    failed: BTreeMap<usize, String>,
}

impl Beginnings {
    /// Of no trajectory, with so many parameters and components of a state.
    pub fn none(n_params: usize, n_state: usize) -> Beginnings {
        let (params, states) = (Vec::new(), Vec::new());
        Beginnings { n: 0, n_params, n_state, params, states, failed: BTreeMap::new() }
    }

    /// Makes room for so many trajectories in all.
    pub fn reserve(&mut self, n: usize) {
        let more = n.saturating_sub(self.n);
        self.params.reserve_exact(more * self.n_params);
        self.states.reserve_exact(more * self.n_state);
    }

    /// Adds a trajectory.
    ///
    /// # Panics
    /// When the numbers are not as many as the others have.
    pub fn push(&mut self, params: &[f64], state: &[f64]) {
        assert_eq!((params.len(), state.len()), (self.n_params, self.n_state), "parameters and components");
        self.n += 1;
        self.params.extend_from_slice(params);
        self.states.extend_from_slice(state);
    }

    /// Adds a trajectory that has no start.
    pub fn push_failed(&mut self, reason: String) {
        self.failed.insert(self.n, reason);
        self.n += 1;
        self.params.resize(self.n * self.n_params, f64::NAN);
        self.states.resize(self.n * self.n_state, f64::NAN);
    }

    /// The same with a number behind the parameters of each, which counts up from that of the first.
    pub(super) fn numbered(&self, first: u32) -> Beginnings {
        let mut numbered = Beginnings {
            n: self.n,
            n_params: self.n_params + 1,
            n_state: self.n_state,
            params: Vec::with_capacity(self.n * (self.n_params + 1)),
            states: self.states.clone(),
            failed: self.failed.clone(),
        };
        for k in 0..self.n {
            numbered.params.extend_from_slice(self.member(k).0);
            numbered.params.push(f64::from(first) + k as f64);
        }
        numbered
    }

    /// Adds others behind these, which have as many numbers.
    pub fn append(&mut self, mut others: Beginnings) {
        self.failed.extend(others.failed.into_iter().map(|(k, reason)| (self.n + k, reason)));
        self.n += others.n;
        self.params.append(&mut others.params);
        self.states.append(&mut others.states);
    }

    /// Number of trajectories.
    pub fn len(&self) -> usize {
        self.n
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.n == 0
    }

    /// Parameters and initial state of a trajectory; NaN where it has no start.
    ///
    /// # Panics
    /// When there is no such trajectory.
    pub fn member(&self, k: usize) -> (&[f64], &[f64]) {
        (
            &self.params[k * self.n_params..(k + 1) * self.n_params],
            &self.states[k * self.n_state..(k + 1) * self.n_state],
        )
    }

    /// Those with a start, in their order.
    pub fn iter(&self) -> impl Iterator<Item = (&[f64], &[f64])> {
        (0..self.n).filter(|k| !self.failed.contains_key(k)).map(|k| self.member(k))
    }

    /// Why a trajectory has no start.
    pub fn failure(&self, k: usize) -> Option<&str> {
        self.failed.get(&k).map(String::as_str)
    }

    /// The numbers of the trajectories with a start, unless all have one.
    pub(super) fn started(&self) -> Option<Vec<usize>> {
        let has_start = |k: &usize| !self.failed.contains_key(k);
        (!self.failed.is_empty()).then(|| (0..self.n).filter(has_start).collect())
    }
}

/// What became of trajectories.
#[derive(Clone, Debug, PartialEq)]
pub struct Members {
    n_state: usize,
    /// Times of samples.
    times: Vec<f64>,
    /// States trajectory by trajectory and time by time.
    states: Vec<f64>,
    /// Their energies; empty where there is none.
    energies: Vec<f64>,
    /// Accepted steps, which the trajectories beside each share.
    steps: Vec<u64>,
    /// The trajectories that did not arrive with all values.
    ended: BTreeMap<usize, Ended>,
}

/// Where a trajectory has stopped: time, state and energy.
pub(super) type Stopping = (f64, Vec<f64>, Option<f64>);

/// A trajectory that was followed from step to step.
pub(super) struct Followed {
    /// As far as they were reached.
    pub(super) samples: Vec<Sample>,
    pub(super) steps: u64,
    /// Why it has ended before its time, and where, if anywhere.
    pub(super) stop: Option<(String, Option<Stopping>)>,
}

/// A trajectory that stopped, or lacks a value.
#[derive(Clone, Debug, PartialEq)]
struct Ended {
    reason: String,
    /// Number of samples that were reached.
    n_samples: usize,
    /// Where it stopped beyond them.
    last: Option<Stopping>,
}

impl Members {
    /// What became of the trajectories with a start, and of those without.
    pub(super) fn new(
        factory: &dyn Factory,
        starts: &Beginnings,
        motions: Motions<BadParams>,
        times: &[f64],
    ) -> Members {
        let started = starts.started();
        let place = |k: usize| started.as_ref().map_or(k, |started| started[k]);
        let (n_state, n_times) = (motions.n_state, times.len());
        let has_energy = factory.info().has_energy;
        let mut ended = BTreeMap::new();
        for stopped in &motions.stopped {
            let k = place(stopped.at);
            let last = &motions.ends[stopped.at * n_state..(stopped.at + 1) * n_state];
            let is_new = motions.stats[stopped.at].rhs_evals > 0;
            let last =
                (is_new && times.get(stopped.n_samples.wrapping_sub(1)) != Some(&stopped.t)).then_some(last);
            ended.insert(k, Ended::of(factory, starts.member(k).0, stopped, last));
        }
        let lacks_energy = |(at, energy): (usize, &f64)| (!energy.is_finite()).then_some(at);
        let lacking =
            if has_energy { motions.measures.iter().enumerate().find_map(lacks_energy) } else { None };
        if lacking.is_some() {
            for (at, _) in motions.measures.iter().enumerate().filter(|(_, energy)| !energy.is_finite()) {
                let (k, time) = (place(at / n_times), at % n_times);
                // The samples behind the last one of a trajectory that stopped have no energy either.
                ended.entry(k).or_insert_with(|| Ended {
                    reason: format!("the energy is not finite at t = {:?}", times[time]),
                    n_samples: n_times,
                    last: None,
                });
            }
        }
        let steps = motions.stats.iter().map(|stats| stats.steps).collect();
        let energies = if has_energy { motions.measures } else { Vec::new() };
        let all = Members { n_state, times: times.to_vec(), states: motions.states, energies, steps, ended };
        match &started {
            None => all,
            Some(started) => all.among(starts, started),
        }
    }

    /// What became of trajectories that were followed one by one, in the order of those with a start.
    pub(super) fn one_by_one(
        factory: &dyn Factory,
        starts: &Beginnings,
        motions: Vec<Followed>,
        times: &[f64],
    ) -> Members {
        let started = starts.started();
        let (n_state, n_times) = (starts.n_state, times.len());
        let has_energy = factory.info().has_energy;
        let mut all = Members {
            n_state,
            times: times.to_vec(),
            states: vec![f64::NAN; motions.len() * n_times * n_state],
            energies: if has_energy { vec![f64::NAN; motions.len() * n_times] } else { Vec::new() },
            steps: Vec::new(),
            ended: BTreeMap::new(),
        };
        for (k, Followed { samples, steps, stop }) in motions.into_iter().enumerate() {
            for (time, sample) in samples.iter().take(n_times).enumerate() {
                let at = k * n_times + time;
                all.states[at * n_state..(at + 1) * n_state].copy_from_slice(&sample.state);
                if let (Some(out), Some(energy)) = (all.energies.get_mut(at), sample.energy) {
                    *out = energy;
                }
            }
            all.steps.push(steps);
            if let Some((reason, last)) = stop {
                let is_sample =
                    last.as_ref().is_some_and(|(t, ..)| samples.last().is_some_and(|s| s.t == *t));
                let (n_samples, last) = (samples.len(), last.filter(|_| !is_sample));
                all.ended.insert(
                    started.as_ref().map_or(k, |started| started[k]),
                    Ended { reason, n_samples, last },
                );
            }
        }
        match &started {
            None => all,
            Some(started) => all.among(starts, started),
        }
    }

    /// The same with the trajectories without a start.
    fn among(self, starts: &Beginnings, started: &[usize]) -> Members {
        let n_times = self.times.len();
        let spread = |values: &[f64], width: usize| {
            let mut all = vec![f64::NAN; starts.len() * width];
            for (k, at) in started.iter().enumerate() {
                all[at * width..(at + 1) * width].copy_from_slice(&values[k * width..(k + 1) * width]);
            }
            all
        };
        let states = spread(&self.states, n_times * self.n_state);
        let energies = if self.energies.is_empty() { Vec::new() } else { spread(&self.energies, n_times) };
        let mut steps = vec![0; starts.len()];
        started.iter().zip(&self.steps).for_each(|(at, n)| steps[*at] = *n);
        let mut ended = self.ended;
        ended.extend(
            starts
                .failed
                .iter()
                .map(|(k, reason)| (*k, Ended { reason: reason.clone(), n_samples: 0, last: None })),
        );
        Members { states, energies, steps, ended, ..self }
    }

    /// Number of trajectories.
    pub fn len(&self) -> usize {
        self.steps.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// One of them.
    pub fn get(&self, at: usize) -> Member<'_> {
        Member { all: self, at, ended: self.ended.get(&at) }
    }

    /// All in their order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = Member<'_>> {
        (0..self.len()).map(|at| self.get(at))
    }

    /// Accepted steps of each.
    pub fn steps(&self) -> &[u64] {
        &self.steps
    }

    /// The states of all samples, trajectory by trajectory and time by time; NaN where there is no sample.
    pub fn states(&self) -> Cow<'_, [f64]> {
        if self.have_all_samples() {
            return Cow::Borrowed(&self.states);
        }
        let mut all = Vec::with_capacity(self.states.len());
        for sample in self.iter().flat_map(|member| (0..self.times.len()).map(move |at| member.sample(at))) {
            match sample {
                Some(sample) => all.extend_from_slice(sample.state),
                None => all.extend(std::iter::repeat_n(f64::NAN, self.n_state)),
            }
        }
        Cow::Owned(all)
    }

    /// The energies of all samples; NaN where there is none.
    pub fn energies(&self) -> Cow<'_, [f64]> {
        let n = self.len() * self.times.len();
        if self.have_all_samples() && self.energies.len() == n {
            return Cow::Borrowed(&self.energies);
        }
        let samples = self.iter().flat_map(|member| (0..self.times.len()).map(move |at| member.sample(at)));
        Cow::Owned(samples.map(|sample| sample.and_then(|s| s.energy).unwrap_or(f64::NAN)).collect())
    }

    /// Whether there is a sample of each trajectory at each time.
    fn have_all_samples(&self) -> bool {
        self.have_arrived() && self.times.windows(2).all(|pair| pair[0] != pair[1])
    }

    /// Whether all arrived with all values.
    pub fn have_arrived(&self) -> bool {
        self.ended.is_empty()
    }
}

impl Ended {
    fn of(
        factory: &dyn Factory,
        params: &[f64],
        Stopped { n_samples, t, stop, .. }: &Stopped<BadParams>,
        last: Option<&[f64]>,
    ) -> Ended {
        let reason = match stop {
            Stop::Params(bad) => bad.to_string(),
            Stop::Integration(error) => why_stopped(factory.info(), error),
            other => format!("{other:?}"),
        };
        let of_state = |state: &[f64]| {
            let energy = factory.prepare(params).ok()?.energy(*t, state);
            Some((*t, state.to_vec(), energy.filter(|energy| energy.is_finite())))
        };
        Ended { reason, n_samples: *n_samples, last: last.and_then(of_state) }
    }
}

/// What became of one trajectory.
#[derive(Clone, Copy, Debug)]
pub struct Member<'a> {
    all: &'a Members,
    at: usize,
    ended: Option<&'a Ended>,
}

/// A state on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct At<'a> {
    /// Time.
    pub t: f64,
    /// The state.
    pub state: &'a [f64],
    /// Its energy, if there is one.
    pub energy: Option<f64>,
}

impl<'a> Member<'a> {
    /// Accepted steps, which the trajectories beside it share.
    pub fn steps(&self) -> u64 {
        self.all.steps[self.at]
    }

    /// Why it stopped before the end, or which value it lacks.
    pub fn error(&self) -> Option<&'a str> {
        self.ended.map(|ended| ended.reason.as_str())
    }

    fn n_samples(&self) -> usize {
        self.ended.map_or(self.all.times.len(), |ended| ended.n_samples)
    }

    /// The sample at a time by its number, unless it was not reached, or where the time is that of the sample
    /// before.
    pub fn sample(&self, time: usize) -> Option<At<'a>> {
        let Members { n_state, times, states, energies, .. } = self.all;
        if time >= self.n_samples() || (time > 0 && times[time] == times[time - 1]) {
            return None;
        }
        let at = self.at * times.len() + time;
        let energy = energies.get(at).copied().filter(|energy| energy.is_finite());
        Some(At { t: times[time], state: &states[at * n_state..(at + 1) * n_state], energy })
    }

    /// The state at which it stopped, unless that is a sample.
    fn stopped_at(&self) -> Option<At<'a>> {
        let (t, state, energy) = self.ended?.last.as_ref()?;
        Some(At { t: *t, state, energy: *energy })
    }

    /// The samples as far as they were reached, then the last state if it stopped; nothing if it never started.
    pub fn samples(&self) -> impl Iterator<Item = At<'a>> {
        let own = *self;
        (0..self.n_samples()).filter_map(move |time| own.sample(time)).chain(self.stopped_at())
    }

    /// The last of these.
    pub fn last(&self) -> Option<At<'a>> {
        self.stopped_at().or_else(|| (0..self.n_samples()).rev().find_map(|time| self.sample(time)))
    }
}
