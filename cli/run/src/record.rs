//! What is noted on the way of an integration: samples, the drift of the energy, residuals of constraints.
//!
//! Does not know: how steps are made.

use hamel_codegen::spec::Want;

use super::crossing::path::Path;
use super::dynamics::Dynamics;
use super::lost_rank::Rank;
use super::scale::energy_scale;
use super::simulation::{Sample, SimulateRequest, stopped_because};
use crate::error::Error;

/// A residual after an event, relative to the largest component of the state, that is no rounding.
const VIOLATED: f64 = 1e-9;

/// Most steps whose energies are kept for a figure.
const MAX_STEPS_SHOWN: usize = 4096;

/// How much was noted up to a state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Noted {
    n_samples: usize,
    level: Option<f64>,
    deviation: f64,
    residual: Option<f64>,
}

/// What is noted on the way.
pub(super) struct Record<'a> {
    dynamics: &'a dyn Dynamics,
    with_outputs: bool,
    pub(super) initial_energy: Option<f64>,
    /// What the energy is compared with: that at the start, or after the last event that has changed the state.
    level: Option<f64>,
    pub(super) scale: f64,
    /// Largest `|E - E0|`.
    pub(super) deviation: f64,
    constraint: Option<std::ops::Range<usize>>,
    /// Of the equations between coordinates, and of constraints that multipliers keep.
    rank: Option<Rank>,
    /// When they were found to depend on each other.
    pub(super) lost_at: Option<f64>,
    /// About when they are so where the motion has come near to such a place, and stopped to look at it.
    pub(super) near_at: Option<f64>,
    /// Whether the motion stops there.
    pub(super) looks: bool,
    /// What the motion is on while it passes a singular position.
    pub(super) path: Option<Path>,
    pub(super) initial_residual: Option<f64>,
    pub(super) residual: Option<f64>,
    pub(super) energy_at_steps: Vec<(f64, f64)>,
    n_steps: usize,
    /// Every step whose number is a multiple of it is kept in `energy_at_steps`.
    stride: usize,
    pub(super) samples: Vec<Sample>,
}

impl<'a> Record<'a> {
    pub(super) fn new(dynamics: &'a dyn Dynamics, request: &SimulateRequest) -> Result<Record<'a>, Error> {
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
            level: initial_energy,
            scale,
            deviation: 0.0,
            constraint,
            // With derivatives behind the state the motion without them was held to its rank.
            rank: request.along.is_empty().then(|| Rank::new(dynamics, 0.0, y)).flatten(),
            lost_at: None,
            near_at: None,
            looks: true,
            path: None,
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
    ///
    /// # Errors
    /// What is not finite; equations between coordinates that depend on each other on the way.
    pub(super) fn step(&mut self, t: f64, y: &[f64]) -> Result<(), Error> {
        self.residual_at(t, y)?;
        self.keeps_rank(t, y)?;
        let energy = self.energy(t, y)?;
        self.keep(t, energy);
        Ok(())
    }

    /// Looks whether equations that may become dependent are independent on the way to a state.
    ///
    /// # Errors
    /// That they are not.
    pub(super) fn keeps_rank(&mut self, t: f64, y: &[f64]) -> Result<(), Error> {
        let dynamics = self.dynamics;
        let Some(rank) = self.rank.as_mut().filter(|_| self.path.is_none()) else { return Ok(()) };
        if !rank.is_lost(dynamics, t, y) {
            self.near_at = rank.nears().filter(|_| self.looks);
            return Ok(());
        }
        self.lost_at = Some(t);
        Err(rank.lost(dynamics, t, y))
    }

    /// Goes on from a state next to which there is no place where they become dependent.
    pub(super) fn dismiss(&mut self) {
        self.near_at = None;
        if let Some(rank) = &mut self.rank {
            rank.dismiss();
        }
    }

    /// Whether they may become dependent.
    pub(super) fn may_lose_rank(&self) -> bool {
        self.rank.is_some()
    }

    /// Forgets all notes after a time.
    pub(super) fn rewind(&mut self, t: f64, y: &[f64], noted: Noted) {
        let is_before = |time: f64| time.abs() <= t.abs();
        (self.lost_at, self.near_at) = (None, None);
        self.samples.truncate(noted.n_samples);
        self.energy_at_steps.retain(|(time, _)| is_before(*time));
        (self.level, self.deviation, self.residual) = (noted.level, noted.deviation, noted.residual);
        self.begin_again(t, y);
    }

    /// Goes on from a state with constraints that are independent.
    pub(super) fn begin_again(&mut self, t: f64, y: &[f64]) {
        if let Some(rank) = &mut self.rank {
            rank.restart(self.dynamics, t, y);
        }
    }

    /// What there is to go back to.
    pub(super) fn noted(&self) -> Noted {
        Noted {
            n_samples: self.samples.len(),
            level: self.level,
            deviation: self.deviation,
            residual: self.residual,
        }
    }

    /// Goes on after an event that has changed the state; what it has done wrong, if it has violated a constraint.
    pub(super) fn restart(&mut self, t: f64, before: &[f64], after: &[f64]) -> Result<Option<String>, Error> {
        self.keeps_rank(t, before)?;
        let energy = self.dynamics.energy(t, after);
        if energy.is_some_and(|energy| !energy.is_finite()) {
            return Err(self.not_finite(t, after, "the energy after an event"));
        }
        self.level = energy;
        self.begin_again(t, after);
        let Some(range) = self.constraint.clone() else { return Ok(None) };
        let largest = |y: &[f64]| {
            self.dynamics.outputs(t, y)[range.clone()].iter().fold(0.0_f64, |max, x| max.max(x.abs()))
        };
        let (old, new) = (largest(before), largest(after));
        let size = after.iter().fold(1.0_f64, |max, y| max.max(y.abs()));
        // What the motion itself has lost of the constraint is no fault of the event.
        let is_kept = new <= VIOLATED * size || new <= 10.0 * old;
        Ok((!is_kept).then(|| {
            format!(
                "violates the constraint: its residual is {new:.1e} after it and {old:.1e} before; let it set \
                 velocities that satisfy the constraint"
            )
        }))
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
        let own = self.path.as_ref().map_or_else(|| self.dynamics.energy(t, y), |path| path.energy(t));
        let (Some(energy), Some(initial)) = (own, self.level) else {
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

    pub(super) fn sample(&mut self, t: f64, y: &[f64]) -> Result<(), Error> {
        let energy = self.energy(t, y)?;
        let mut outputs = Vec::new();
        if self.with_outputs || self.constraint.is_some() {
            outputs = self.outputs(t, y);
            self.note_residual(t, y, &outputs)?;
        }
        if !self.with_outputs {
            outputs.clear();
        }
        if outputs.iter().any(|x| !x.is_finite()) {
            return Err(self.not_finite(t, y, "an output"));
        }
        self.samples.push(Sample { t, state: y.to_vec(), energy, outputs, along: Vec::new() });
        Ok(())
    }

    fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        match &self.path {
            Some(path) => path.outputs(self.dynamics, t, y),
            None => self.dynamics.outputs(t, y),
        }
    }

    fn residual_at(&mut self, t: f64, y: &[f64]) -> Result<(), Error> {
        if self.constraint.is_none() {
            return Ok(());
        }
        let outputs = self.outputs(t, y);
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
