//! The storage of an integrator from one integration to the next.
//!
//! Does not know how a step is taken.

use core::fmt;

use super::dense::Dense;
use super::norms::{copy, non_finite};
use super::{Integrator, Stats};
use crate::controller::Controller;
use crate::error::{Error, Failure};
use crate::methods::{Method, Point};
use crate::options::{Options, signed};
use crate::real::Real;
use crate::system::{StateVector, System};

/// An integrator without a system: its method, options and storage, for another integration of the same dimension.
///
/// [`start`](Self::start) makes an integrator again and clones no state, so that it allocates nothing where the
/// dimension is known at run time only. The integrator has the bits of one that is made by [`Integrator::new`].
///
/// ```
/// use hamel_runtime::{Integrator, Options, System, Tsit5};
///
/// struct Decay(f64);
///
/// impl System<f64> for Decay {
///     type State = [f64; 1];
///     fn rhs(&self, _t: f64, y: &[f64; 1], dy: &mut [f64; 1]) {
///         dy[0] = -self.0 * y[0];
///     }
/// }
///
/// let (slow, fast) = (Decay(1.0), Decay(2.0));
/// let mut solver = Integrator::new(&slow, Tsit5, 0.0, [1.0], Options::adaptive(1e-8, 1e-10))?;
/// solver.integrate_to(1.0)?;
/// let mut solver = solver.rest().start(&fast, 0.0, &[1.0])?;
/// solver.integrate_to(1.0)?;
/// assert!((solver.state()[0] - (-2.0_f64).exp()).abs() < 1e-7);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
pub struct AtRest<R: Real, S: System<R>, M: Method<R, S>> {
    pub(super) method: M,
    pub(super) options: Options<R>,
    pub(super) rtol: S::State,
    pub(super) atol: S::State,
    pub(super) estimate_order: u32,
    pub(super) points: [Point<S::State>; 2],
    pub(super) scales: S::State,
    pub(super) work: S::State,
    pub(super) storage: M::Storage,
}

impl<R: Real, S: System<R>, M: Method<R, S>> fmt::Debug for AtRest<R, S, M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("AtRest")
            .field("method", &self.method.tableau().name)
            .field("options", &self.options)
            .finish_non_exhaustive()
    }
}

/// The signature of a system at a point where an integration can start.
///
/// # Errors
///
/// As [`Integrator::new`] at its start.
pub(super) fn checked<R: Real, S: System<R>>(system: &S, t0: R, y0: &S::State) -> Result<R, Error> {
    if !t0.all_finite() {
        return Err(Error::TimeNotFinite { value: signed(t0) });
    }
    if let Some(index) = non_finite(y0) {
        return Err(Failure::NonFinite { t: signed(t0), index }.into());
    }
    system.domain(t0, y0)?;
    system.check(t0, y0)?;
    Ok(system.signature(t0, y0))
}

impl<R: Real, S: System<R>, M: Method<R, S>> AtRest<R, S, M> {
    /// Places `system` at the state `y0` at time `t0`, with the method, the options and the tolerances that there were.
    ///
    /// # Shapes
    ///
    /// y0: \[n\], the dimension of the last integration.
    ///
    /// # Errors
    ///
    /// [`Error::TimeNotFinite`]; [`Error::Failure`] if the right-hand side has no value at `y0`.
    ///
    /// # Panics
    ///
    /// When the dimension is another one.
    pub fn start<'s>(mut self, system: &'s S, t0: R, y0: &[R]) -> Result<Integrator<'s, R, S, M>, Error> {
        let [first, _] = &mut self.points;
        first.state.as_mut_slice().copy_from_slice(y0);
        let signature = checked(system, t0, &first.state)?;
        self.method.renew(&mut self.storage, system, t0, &first.state, &self.options);
        self.begin(system, t0, signature)
    }

    /// An integrator at the state of the first point, which has been [`checked`].
    pub(super) fn begin<'s>(
        self,
        system: &'s S,
        t0: R,
        signature: R,
    ) -> Result<Integrator<'s, R, S, M>, Error> {
        let AtRest { method, options, rtol, atol, estimate_order, mut points, scales, work, storage } = self;
        let [first, second] = &mut points;
        system.rhs(t0, &first.state, &mut first.slope);
        if let Some(index) = non_finite(&first.slope) {
            return Err(Failure::NonFinite { t: signed(t0), index }.into());
        }
        first.residue.as_mut_slice().fill(R::ZERO);
        copy(&first.state, &mut second.state);
        copy(&first.residue, &mut second.residue);
        copy(&first.slope, &mut second.slope);
        Ok(Integrator {
            system,
            method,
            options,
            rtol,
            atol,
            control: Controller::new(estimate_order),
            next_step: None,
            t: t0,
            t_previous: t0,
            t_residue: R::ZERO,
            h: R::ZERO,
            points,
            current: false,
            scales,
            work,
            storage,
            dense: Dense::NoStep,
            signature,
            told_until: None,
            stats: Stats { rhs_evals: 1, ..Stats::default() },
        })
    }
}

impl<R: Real, S: System<R>, M: Method<R, S>> Integrator<'_, R, S, M> {
    /// Ends the integration and keeps its storage for another one.
    #[must_use]
    pub fn rest(self) -> AtRest<R, S, M> {
        let estimate_order = self.method.tableau().estimate_order().unwrap_or(self.method.tableau().order);
        let Integrator { method, options, rtol, atol, points, scales, work, storage, .. } = self;
        AtRest { method, options, rtol, atol, estimate_order, points, scales, work, storage }
    }
}
