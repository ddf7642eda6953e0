//! The one driver of all methods: time, state and counts of an integration.
//!
//! [`step`] takes one accepted step, [`failure`] says why there is none, [`dense`] interpolates within the last step,
//! [`sampling`] visits times on the way, [`telling`] looks for the events of a step and carries them out, [`watch`] has
//! the knowledge of their functions, [`rest`] keeps storage from one integration to the next, [`parts`] judges these by
//! a few values, [`crossing`] brackets events with few steps, [`norms`] measures errors. The module deliberately does
//! not know any method: the integrator reads a tableau and has the stages, or a series, computed.

mod crossing;
mod dense;
mod failure;
mod norms;
mod parts;
mod rest;
mod sampling;
mod step;
mod telling;
mod watch;

use core::fmt;

use self::dense::Dense;
pub use self::rest::AtRest;
use crate::controller::Controller;
use crate::error::Error;
use crate::methods::{Method, Point};
use crate::options::{Options, StepSize, signed, validate_tolerances};
use crate::real::Real;
use crate::system::{StateVector, System};

/// Counts of work done since the integrator was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Stats {
    /// Accepted steps.
    pub steps: u64,
    /// Rejected steps.
    pub rejected: u64,
    /// Evaluations of the right-hand side, those for dense output included; of methods by series, expansions.
    pub rhs_evals: u64,
    /// Evaluations of the Jacobian, of implicit methods only.
    pub jacobian_evals: u64,
}

/// Where a step led to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Progress {
    /// The end is still ahead.
    Running,
    /// The time is exactly the end asked for.
    Reached,
}

impl Progress {
    /// Whether the end was reached.
    #[must_use]
    pub fn reached(self) -> bool {
        self == Self::Reached
    }
}

/// Integrates a system with a method from an initial state, step by step in either direction of time.
///
/// Time and state are summed with compensation, so that round-off does not grow with the number of steps.
/// After an error the last accepted time and state are kept.
///
/// ```
/// use hamel_runtime::{Integrator, Options, System, Tsit5};
///
/// struct Growth;
///
/// impl System<f64> for Growth {
///     type State = [f64; 1];
///     fn rhs(&self, _t: f64, y: &[f64; 1], dy: &mut [f64; 1]) {
///         *dy = *y;
///     }
/// }
///
/// let mut solver = Integrator::new(&Growth, Tsit5, 0.0, [1.0], Options::adaptive(1e-8, 1e-10))?;
/// while !solver.step_towards(1.0)?.reached() {
///     println!("{}: {}", solver.t(), solver.state()[0]);
/// }
/// assert!((solver.state()[0] - 1.0_f64.exp()).abs() < 1e-7);
/// assert!(solver.stats().steps > 1);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
///
/// # Source
///
/// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section II.4; Knuth, The Art
/// of Computer Programming 2 (1997), section 4.2.2, theorem B, for the sums.
pub struct Integrator<'s, R: Real, S: System<R>, M: Method<R, S>> {
    system: &'s S,
    method: M,
    options: Options<R>,
    /// Relative tolerances of the components.
    rtol: S::State,
    /// Absolute tolerances of the components.
    atol: S::State,
    control: Controller,
    /// Size of the next adaptive step, positive; none before the first.
    next_step: Option<f64>,
    t: R,
    t_previous: R,
    /// What the sum `t` lacks.
    t_residue: R,
    /// The last accepted step, signed.
    h: R,
    /// The last accepted state and, unless a step has failed since, the one before.
    points: [Point<S::State>; 2],
    /// Which of `points` is the last accepted state.
    current: bool,
    /// Reciprocal scales of the components of an error.
    scales: S::State,
    work: S::State,
    storage: M::Storage,
    dense: Dense,
    /// [`System::signature`] of the initial state, which all accepted states have.
    signature: R,
    /// The time up to which events were told.
    told_until: Option<R>,
    stats: Stats,
}

impl<'s, R: Real, S: System<R>, M: Method<R, S>> Integrator<'s, R, S, M> {
    /// Places `system` at the state `y0` at time `t0`.
    ///
    /// # Errors
    ///
    /// Those of [`Options::validate`]; [`Error::NoErrorEstimate`] for adaptive steps with a method for fixed ones;
    /// [`Error::Order`]; [`Error::TimeNotFinite`]; [`Error::Failure`] if the right-hand side has no value at `y0`.
    pub fn new(system: &'s S, method: M, t0: R, y0: S::State, options: Options<R>) -> Result<Self, Error> {
        options.validate()?;
        method.validate(&options)?;
        let estimate_order = match (method.tableau().estimate_order(), options.step) {
            (Some(order), _) => order,
            // Unused with fixed steps.
            (None, StepSize::Fixed(_)) => method.tableau().order,
            (None, StepSize::Adaptive { .. }) => {
                return Err(Error::NoErrorEstimate { method: method.tableau().name });
            }
        };
        let signature = rest::checked(system, t0, &y0)?;
        let zeros = y0.zeros_like();
        let storage = method.storage(system, t0, &y0, &options);
        let filled = |value: R| {
            let mut state = zeros.clone();
            state.as_mut_slice().fill(value);
            state
        };
        let start = Point { state: y0, residue: zeros.clone(), slope: zeros.clone() };
        let rest = AtRest {
            method,
            options,
            rtol: filled(options.rtol),
            atol: filled(options.atol),
            estimate_order,
            points: [start.clone(), start],
            scales: zeros.clone(),
            work: zeros,
            storage,
        };
        rest.begin(system, t0, signature)
    }

    /// Replaces the tolerances of the options by those of each component; no effect with fixed steps.
    ///
    /// # Errors
    ///
    /// [`Error::ComponentTolerances`] for the first component whose tolerances [`Options::validate`] would reject.
    pub fn with_tolerances(mut self, rtol: S::State, atol: S::State) -> Result<Self, Error> {
        for (index, (&rtol, &atol)) in rtol.as_slice().iter().zip(atol.as_slice()).enumerate() {
            validate_tolerances(rtol, atol).map_err(|_| Error::ComponentTolerances {
                index,
                rtol: signed(rtol),
                atol: signed(atol),
            })?;
        }
        (self.rtol, self.atol) = (rtol, atol);
        Ok(self)
    }

    /// Says that the motion goes on from the end of another one, along which events were told: a function that is zero
    /// at the start has no event there.
    #[must_use]
    pub fn with_events_told(mut self) -> Self {
        self.told_until = Some(self.t);
        self
    }

    /// Time of the last accepted state.
    pub fn t(&self) -> R {
        self.t
    }

    /// The last accepted state.
    pub fn state(&self) -> &S::State {
        &self.here().state
    }

    /// Time of the state before the last step; [`t`](Self::t) before the first.
    pub fn previous_t(&self) -> R {
        self.t_previous
    }

    /// The system that is integrated.
    pub fn system(&self) -> &'s S {
        self.system
    }

    /// Counts of the work done so far.
    pub fn stats(&self) -> Stats {
        self.stats
    }

    /// Takes one accepted step towards `t_end`, with as many trials as it needs, and never beyond.
    ///
    /// At `t_end` nothing is done.
    ///
    /// # Errors
    ///
    /// [`Error::TimeNotFinite`] for `t_end`; [`Error::Failure`], [`Error::StepTooSmall`] and
    /// [`Error::TooManySteps`] if there is no acceptable step.
    pub fn step_towards(&mut self, t_end: R) -> Result<Progress, Error> {
        let mut budget = self.options.max_steps;
        self.step_within(t_end, &mut budget)
    }

    /// Takes steps until the time is exactly `t_end`.
    ///
    /// # Errors
    ///
    /// As [`step_towards`](Self::step_towards).
    pub fn integrate_to(&mut self, t_end: R) -> Result<(), Error> {
        let mut budget = self.options.max_steps;
        while !self.step_within(t_end, &mut budget)?.reached() {}
        Ok(())
    }

    /// The last accepted state.
    fn here(&self) -> &Point<S::State> {
        &self.points[usize::from(self.current)]
    }
}

impl<R: Real, S: System<R>, M: Method<R, S>> fmt::Debug for Integrator<'_, R, S, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Integrator")
            .field("method", &self.method.tableau().name)
            .field("t", &self.t)
            .field("state", &self.state().as_slice())
            .field("options", &self.options)
            .field("stats", &self.stats)
            .finish_non_exhaustive()
    }
}
