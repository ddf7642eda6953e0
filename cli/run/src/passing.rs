//! A motion through its events and through singular positions on its way, leg by leg.
//!
//! Does not know: which events there are, how a singular position is passed.

use hamel_runtime::{Dop853, Error as SolverError, Failure, Integrator, Method, Options, System};

use super::crossing::path::OnPath;
use super::crossing::{self, Crossing, NOT_REACHED, Point, Refusal, Way};
use super::dynamics::{PreparedScene, VecState};
use super::events::Watcher;
use super::method::Steps;
use super::simulation::{SimulateRequest, SingularPosition};
use super::watched::MAX_EVENTS;

/// Tolerance of the steps that look at a path, which has no error of its own to them.
const OF_PATH: f64 = 1e-13;

/// Where a motion has come to, and what that has cost.
pub(super) struct Reached {
    pub(super) t: f64,
    pub(super) y: Vec<f64>,
    /// Why the integrator went no further.
    pub(super) error: Option<SolverError>,
    /// Why a singular position that has stopped the motion was not passed.
    pub(super) refusal: Option<Refusal>,
    pub(super) steps: u64,
    pub(super) rejected: u64,
    pub(super) rhs_evals: u64,
    pub(super) passed: Vec<SingularPosition>,
}

/// A motion that is asked for.
pub(super) struct Course<'c> {
    pub(super) request: &'c SimulateRequest,
    pub(super) times: &'c [f64],
    pub(super) options: Options<f64>,
}

impl Course<'_> {
    /// Follows the motion to its end.
    ///
    /// # Errors
    /// That it cannot begin.
    pub(super) fn follow<'f, M>(
        &self,
        (scene, method): (&PreparedScene<'f>, M),
        watcher: &mut Watcher<'_, '_>,
    ) -> Result<Reached, SolverError>
    where
        M: Method<f64, PreparedScene<'f>>,
    {
        let (t, y) = (0.0, self.request.initial.clone());
        let (error, refusal, passed) = (None, None, Vec::new());
        let mut reached = Reached { t, y, error, refusal, steps: 0, rejected: 0, rhs_evals: 0, passed };
        self.leg((scene, method), &mut reached, self.request.t_final, watcher)?;
        let (rtol, step) = match self.request.steps {
            Steps::Adaptive { rtol, .. } => (Some(rtol), None),
            Steps::Fixed { step } => (None, Some(step)),
        };
        let mut way =
            Way { scene, method, options: self.options, rtol, step, evaluations: 0, lengths: Vec::new() };
        while self.is_stopped(&reached, watcher) {
            let marks: Vec<Point> = watcher.marks.iter().map(|mark| (mark.t, mark.y.clone())).collect();
            let (lost_at, near_at) = (watcher.record.lost_at, watcher.record.near_at);
            let told = lost_at.or(near_at).unwrap_or_else(|| self.next(&reached, watcher));
            let found = crossing::find(&mut way, &marks, told, self.is_backward());
            reached.rhs_evals += std::mem::take(&mut way.evaluations);
            let last = reached.passed.last().map(|passed| passed.t);
            match found {
                Ok(crossing) if last.is_some_and(|last| !self.is_beyond(crossing.t, last)) => {
                    reached.refusal = Some(NOT_REACHED);
                    break;
                }
                Ok(crossing) => self.cross((scene, method), crossing, &mut reached, watcher),
                Err(_) if lost_at.is_none() && near_at.is_some() => {
                    watcher.record.dismiss();
                    self.on((scene, method), &mut reached, self.request.t_final, watcher);
                }
                Err(refusal) => {
                    reached.refusal = Some(refusal);
                    break;
                }
            }
        }
        Ok(reached)
    }

    /// The end of a step like the last one from where a motion has come to.
    fn next(&self, reached: &Reached, watcher: &Watcher<'_, '_>) -> f64 {
        let step = match (self.request.steps, &watcher.marks[..]) {
            (Steps::Fixed { step }, _) => step.copysign(self.request.t_final),
            (_, [.., before, last]) => last.t - before.t,
            _ => (self.request.t_final - reached.t) / 64.0,
        };
        reached.t + step
    }

    fn is_backward(&self) -> bool {
        self.request.t_final < 0.0
    }

    fn is_beyond(&self, t: f64, other: f64) -> bool {
        if self.is_backward() { t < other } else { t > other }
    }

    /// Whether something has stopped a motion that a singular position may be.
    fn is_stopped(&self, reached: &Reached, watcher: &Watcher<'_, '_>) -> bool {
        let may_be = match reached.error {
            Some(SolverError::Failure(failure)) => !matches!(failure, Failure::OutsideDomain { .. }),
            Some(
                SolverError::StepTooSmall { .. }
                | SolverError::NotConverged { .. }
                | SolverError::PositionMissed { .. }
                | SolverError::PositionSingular { .. },
            ) => watcher.error.is_none(),
            Some(_) => false,
            None => {
                let is_near = watcher.record.near_at.is_some() && reached.t != self.request.t_final;
                watcher.record.lost_at.is_some() || is_near && !watcher.is_over()
            }
        };
        may_be && !watcher.marks.is_empty()
    }

    /// Goes on from where a motion has come to, until a time at most.
    fn leg<S, M>(
        &self,
        (system, method): (&S, M),
        reached: &mut Reached,
        until: f64,
        watcher: &mut Watcher<'_, '_>,
    ) -> Result<(), SolverError>
    where
        S: System<f64, State = VecState>,
        M: Method<f64, S>,
    {
        let left = self.options.max_steps.saturating_sub(reached.steps + reached.rejected).max(1);
        let options = if watcher.record.path.is_some() {
            Options::adaptive(OF_PATH, OF_PATH).with_max_events(self.request.max_events)
        } else {
            self.options.with_max_steps(left)
        };
        let is_first = reached.steps == 0;
        let mut solver = Integrator::new(system, method, reached.t, VecState(reached.y.clone()), options)?;
        if !is_first {
            solver = solver.with_events_told();
        }
        let times = self.times[watcher.record.samples.len()..].iter().copied();
        let times = times.take_while(|t| !self.is_beyond(*t, until));
        let outcome = match self.request.watched {
            None => solver.observe::<0>(until, times, [], watcher),
            Some(_) => {
                let directions = watcher.directions();
                solver.observe::<MAX_EVENTS>(until, times, directions, watcher)
            }
        };
        let stats = solver.stats();
        reached.steps += stats.steps;
        reached.rejected += stats.rejected;
        reached.rhs_evals += stats.rhs_evals;
        (reached.t, reached.y) = (solver.t(), solver.state().0.clone());
        reached.error = outcome.err();
        Ok(())
    }

    /// Takes a motion back to before a singular position, through it, and on.
    fn cross<'f, M>(
        &self,
        (scene, method): (&PreparedScene<'f>, M),
        crossing: Crossing,
        reached: &mut Reached,
        watcher: &mut Watcher<'_, '_>,
    ) where
        M: Method<f64, PreparedScene<'f>>,
    {
        let Crossing { t, n_lost, mark, ends: [begin, end], end: behind, path } = crossing;
        (reached.t, reached.y) = watcher.rewind(mark);
        let n_changes = watcher.n_changes;
        watcher.record.looks = false;
        let is_there = reached.t == begin || self.on((scene, method), reached, begin, watcher);
        watcher.record.looks = true;
        if !is_there {
            return;
        }
        if watcher.n_changes == n_changes {
            let t_final = self.request.t_final;
            let until = if self.is_beyond(end, t_final) { t_final } else { end };
            watcher.record.path = Some(path.clone());
            let on_path = self.leg((&OnPath::new(&path, &**scene), Dop853), reached, until, watcher);
            watcher.record.path = None;
            if let Err(error) = on_path {
                reached.error = Some(error);
            }
            if reached.error.is_some() || watcher.error.is_some() {
                return;
            }
            if !self.is_beyond(t, reached.t) {
                reached.passed.push(SingularPosition { t, n_lost });
            }
            if watcher.is_over() || reached.t == t_final {
                return;
            }
            if reached.t == end {
                reached.y = behind;
            }
            watcher.begin_again(reached.t, &reached.y);
        }
        self.on((scene, method), reached, self.request.t_final, watcher);
    }

    /// Goes on from where a motion has come to, and says whether it has come to a time.
    fn on<'f, M>(
        &self,
        (scene, method): (&PreparedScene<'f>, M),
        reached: &mut Reached,
        until: f64,
        watcher: &mut Watcher<'_, '_>,
    ) -> bool
    where
        M: Method<f64, PreparedScene<'f>>,
    {
        if let Err(error) = self.leg((scene, method), reached, until, watcher) {
            reached.error = Some(error);
        }
        reached.error.is_none() && reached.t == until && !watcher.is_over()
    }
}
