//! The methods, each a tableau of constants and a way to compute its stages; the one stepping loop drives them.
//!
//! The module deliberately does not know how steps are chosen. Tableaux have 32 digits, in two parts: `f64` uses the
//! first part alone, [`DoubleDouble`](crate::DoubleDouble) both. Digits beyond those of the sources are the solution of
//! the order conditions next to the printed numbers (Newton's iteration, least correction); `tests` checks all
//! conditions to the last of these digits.

mod discrete;
mod dla;
mod dop853;
mod dopri5;
mod elimination;
mod explicit;
mod gauss;
#[cfg(feature = "lanes")]
mod gbs14;
mod iteration;
mod on_circles;
mod projected;
mod rk4;
#[cfg(feature = "lanes")]
mod rows_in_turn;
mod splitting;
mod sums;
mod tableau;
mod taylor;
mod tsit5;
mod vern9;

pub use discrete::{Discrete, Discrete2, Discrete4, Discrete6, DiscreteSteps, DiscreteStorage};
pub use dla::{Dla, DlaStorage};
pub use dop853::Dop853;
pub use dopri5::Dopri5;
pub use explicit::ExplicitMethod;
pub use gauss::{FixedPoint, Gauss, Gauss4, Gauss6, Gauss8, Midpoint, Newton};
#[cfg(feature = "lanes")]
pub use gauss::{Gauss16, Gauss16With, Halves, Moved, OwnLoops, StageLoops, StageRow};
#[cfg(feature = "lanes")]
pub use gbs14::{Gbs14, Rows};
pub use on_circles::{OnCircles, Turning};
pub use projected::{Invariants, Levels, OfMotion, OfPositions, Projected, Projection};
pub use rk4::Rk4;
#[cfg(feature = "lanes")]
pub use rows_in_turn::Turns;
pub use splitting::{ExactFlows, Splitting, Splitting2, Splitting4, Splitting6};
pub(crate) use sums::{Derivatives, compensated_advance, square_of_norm, two_sum};
pub(crate) use tableau::c;
pub use tableau::{Constant, Estimate, Row, Tableau};
pub use taylor::Taylor;
pub(crate) use taylor::increments;
pub use tsit5::Tsit5;
pub use vern9::Vern9;

use crate::error::Error;
use crate::options::{Norm, Options};
use crate::real::Real;
use crate::system::{StateVector, System};

/// A one-step method with continuous output for a system `S`: of Runge and Kutta, or of the series of the solution.
///
/// A method computes the stages or coefficients and the new state of one step. Everything else, such as time, step
/// sizes, errors, dense output, events and counts, is the work of the [`Integrator`](crate::Integrator), which is the
/// same for all methods.
pub trait Method<R: Real, S: System<R>>: Copy {
    /// Coefficients of the method; without stages for a series. [`Tableau::CHOSEN`] where the values of a type are
    /// different methods.
    const TABLEAU: &'static Tableau;

    /// Whether the state within a step is that of a shorter step from the same start, instead of what the tableau says.
    const DENSE_BY_STEPS: bool = false;

    /// Coefficients of this value: [`TABLEAU`](Self::TABLEAU), but for a method that is chosen at run time.
    #[inline(always)]
    fn tableau(&self) -> &'static Tableau {
        Self::TABLEAU
    }

    /// [`DENSE_BY_STEPS`](Self::DENSE_BY_STEPS) of this value.
    #[inline(always)]
    fn dense_by_steps(&self) -> bool {
        Self::DENSE_BY_STEPS
    }

    /// What the method keeps from one step to the next.
    type Storage;

    /// Says whether the method can integrate with these options.
    ///
    /// # Errors
    ///
    /// [`Error::Order`] of methods of any order.
    fn validate(&self, _options: &Options<R>) -> Result<(), Error> {
        Ok(())
    }

    /// Storage for an integration with valid options that starts at the state `y0` at time `t0`.
    fn storage(&self, system: &S, t0: R, y0: &S::State, options: &Options<R>) -> Self::Storage;

    /// Makes storage ready for another integration, of a system and a state of the same dimensions, as
    /// [`storage`](Self::storage) makes it; nothing that it leaves is read before it is written.
    fn renew(&self, storage: &mut Self::Storage, system: &S, t0: R, y0: &S::State, options: &Options<R>) {
        *storage = self.storage(system, t0, y0, options);
    }

    /// The stage derivatives: `k_1` to `k_(s-1)`, then those for dense output alone; of a series its coefficients, from
    /// the state at the start of the step to the last order.
    ///
    /// # Shapes
    ///
    /// \[[`Tableau::n_stored`]\], \[order + 1\] of a series; `k_0` and `k_s` are the [`Point::slope`] of the two ends
    /// of the step.
    fn stages(storage: &Self::Storage) -> &[S::State];

    /// [`stages`](Self::stages) for writing.
    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State];

    /// The time at which the next step ends at the latest, on the way to `t_end`: what the method knows of the motion
    /// does not hold beyond. Methods by series are asked once before each step, adaptive or fixed.
    #[inline]
    fn last_time(&self, _storage: &mut Self::Storage, start: Start<'_, R, S>, t_end: R) -> R {
        let _ = start;
        t_end
    }

    /// The longest step from a point that is accurate, as far as the method knows before it takes the step; asked once
    /// before each adaptive step, after [`last_time`](Self::last_time).
    ///
    /// Most methods know none, which is infinity, and are judged by their error after the step.
    #[inline]
    fn longest_step(&self, _storage: &mut Self::Storage, _start: Start<'_, R, S>) -> f64 {
        f64::INFINITY
    }

    /// Forgets what the storage knows of the motion so far: it goes on from another state at a time, as after an
    /// impact.
    fn restart(&self, _storage: &mut Self::Storage, _system: &S, _t: R, _y: &S::State) {}

    /// The size of the first adaptive step, as far as the method can tell from a trial of the signed size `trial` that
    /// leads to no state; asked only where the size is not given.
    ///
    /// Most methods cannot tell, and start with a step whose error is about that of Euler's method.
    #[inline]
    fn first_step(&self, _storage: &mut Self::Storage, _start: Start<'_, R, S>, _trial: R) -> Option<f64> {
        None
    }

    /// Computes the stages `k_1` to `k_(s-1)`, or the series, the new state and what it lacks.
    ///
    /// Values that are not finite are passed on: the integrator looks for them.
    ///
    /// # Errors
    ///
    /// [`Error::NotConverged`] of implicit methods.
    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error>;

    /// Writes the derivative at the end of a step, with the bits that the system gives; not asked for by methods by
    /// series.
    #[inline]
    fn slope(&self, _storage: &mut Self::Storage, system: &S, t: R, end: &mut Point<S::State>) {
        system.rhs(t, &end.state, &mut end.slope);
    }

    /// The mean square of the error of a step of size `h` in units of the tolerances, if the method has it sooner than
    /// the sums of its tableau; the step waits for it.
    #[inline]
    fn mean_square_error(
        _storage: &Self::Storage,
        _h: R,
        _rtol: &S::State,
        _atol: &S::State,
        _ends: [&S::State; 2],
    ) -> Option<f64> {
        None
    }
}

/// An end of a step.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Point<V> {
    /// The state, rounded.
    pub state: V,
    /// What the sum `state` lacks.
    pub residue: V,
    /// The derivative there; methods by series do without, beyond the first point.
    pub slope: V,
}

/// The start of a step whose size is to be chosen, as a method sees it.
#[derive(Debug)]
#[non_exhaustive]
pub struct Start<'a, R: Real, S: System<R>> {
    /// The system that is integrated.
    pub system: &'a S,
    /// Time at the start.
    pub t: R,
    /// The start; its slope is complete for methods with stages.
    pub point: &'a Point<S::State>,
    /// The tolerances of the components there.
    pub tolerances: Tolerances<'a, S::State>,
    /// The norm of scaled components that is to be at most one.
    pub norm: Norm,
    /// Space for one state.
    pub work: &'a mut S::State,
    /// Count of evaluations of the right-hand side, to be kept up to date.
    pub rhs_evals: &'a mut u64,
}

/// The tolerances of the components over a step, or at a point, in which their errors are measured.
///
/// ```text
/// tolerance_i = atol_i + rtol_i max(|a_i|, |b_i|)
/// ```
///
/// Errors are multiplied by the reciprocals of the tolerances. Where one of them leaves the range of the scalar, as
/// with states around 1e-300, state and error are brought into the middle of the range by a power of two first:
/// results do not depend on the scale of the state.
#[derive(Clone, Copy, Debug)]
pub struct Tolerances<'a, V> {
    pub(crate) rtol: &'a V,
    pub(crate) atol: &'a V,
    /// The states at both ends of the step.
    pub(crate) ends: [&'a V; 2],
    /// Reciprocals of the tolerances, as far as they are finite.
    pub(crate) reciprocals: &'a V,
}

impl<V> Tolerances<'_, V> {
    /// A value of the component `c` in units of its tolerance.
    #[inline(always)]
    pub fn scaled<R: Real>(&self, c: usize, value: R) -> R
    where
        V: StateVector<R>,
    {
        let scaled = value * self.reciprocals.as_slice()[c];
        if scaled.all_finite() { scaled } else { self.scaled_within_range(c, value) }
    }

    #[cold]
    #[inline(never)]
    pub(crate) fn scaled_within_range<R: Real>(&self, c: usize, value: R) -> R
    where
        V: StateVector<R>,
    {
        let larger = larger(self.ends[0].as_slice()[c], self.ends[1].as_slice()[c]);
        let unit = R::from_f64(middle_of_range::<R>(larger.magnitude()));
        // A component may be zero where its absolute tolerance is; its error is to be zero then.
        let least = R::from_f64(R::MIN_POSITIVE);
        let tolerance =
            self.rtol.as_slice()[c].mul_add(larger * unit, self.atol.as_slice()[c] * unit) + least;
        value * unit / tolerance
    }
}

/// The larger absolute value, on every lane.
#[inline(always)]
pub(crate) fn larger<R: Real>(a: R, b: R) -> R {
    let (half, a, b) = (R::from_f64(0.5), a.abs(), b.abs());
    // Halves are summed, as the sum of two large numbers may not exist.
    half * a + half * b + half * (a - b).abs()
}

/// The power of two that brings numbers of a size into the middle of the range of a scalar; one for most.
fn middle_of_range<R: Real>(size: f64) -> f64 {
    // An even power of two in every scalar, or twice one: its root is within a factor two of a power of two.
    let root = f64::from_bits(crate::math::sqrt(R::MIN_POSITIVE).to_bits() & (0x7ff << 52));
    if size < root {
        1.0 / root
    } else if size > 1.0 / root {
        root
    } else {
        1.0
    }
}

/// One trial step, as a method sees it.
#[derive(Debug)]
#[non_exhaustive]
pub struct Step<'a, R: Real, S: System<R>> {
    /// The system that is integrated.
    pub system: &'a S,
    /// Time at the start.
    pub t: R,
    /// Size, signed.
    pub h: R,
    /// The start, complete.
    pub from: &'a Point<S::State>,
    /// The end: `state` and `residue` are to be computed. Before, it is the start of the last step if `last_h` says
    /// so; of a step inside of the last one its slope is that at the end of it.
    pub to: &'a mut Point<S::State>,
    /// Space for one state.
    pub work: &'a mut S::State,
    /// Size of the last step, if `to` and the stored stages are still those of the step that led to `from`, or of the
    /// one around this.
    pub last_h: Option<R>,
    /// Whether the step is one inside of the last one, from its start, for continuous output: what is stored of the
    /// last one is to be kept for the step after it.
    pub is_inside: bool,
    /// Count of evaluations of the right-hand side, to be kept up to date.
    pub rhs_evals: &'a mut u64,
    /// Count of evaluations of the Jacobian, to be kept up to date.
    pub jacobian_evals: &'a mut u64,
}

#[cfg(test)]
mod tests;
