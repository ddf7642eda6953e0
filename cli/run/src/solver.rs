//! The integration method that a name stands for, as a value of its own type: [`with_method`].
//!
//! Does not know: what is integrated with a method, requests.

use hamel_codegen::spec::Want;
use hamel_runtime::{
    Dop853, Dopri5, F64x4, Gauss4, Gauss6, Gauss8, Gauss16, Gbs14, Method, OfPositions, OnCircles, Projected,
    Rk4, Splitting2, Splitting4, Splitting6, Taylor, Tsit5, Vern9,
};

use super::auto::{self, Purpose};
use super::dynamics::{Dynamics, PreparedLanes, PreparedScene};
use super::info::Info;
use super::inside::Inside;
use super::method::{MethodName, Steps};
use crate::error::Error;

/// Most invariants that are projected onto.
pub(crate) const MAX_INVARIANTS: usize = 64;

/// What is done with a method, whichever it is.
pub(crate) trait WithMethod<'a>: Sized {
    /// What comes out.
    type Output;

    /// With a method that integrates one trajectory at a time.
    fn single<M: Method<f64, PreparedScene<'a>> + Sync>(self, method: M) -> Self::Output;

    /// With an explicit method, which integrates trajectories side by side as well.
    fn explicit<M>(self, method: M) -> Self::Output
    where
        M: Method<f64, PreparedScene<'a>> + Method<F64x4, PreparedLanes<'a>> + Sync,
    {
        self.single(method)
    }

    /// With an explicit method for a scene that has angles as points of circles: lanes with a trajectory each have them
    /// as numbers.
    fn on_circles<M>(self, method: M) -> Self::Output
    where
        M: Method<f64, PreparedScene<'a>> + Method<f64, Inside<'a>> + Method<F64x4, PreparedLanes<'a>> + Sync,
    {
        self.single(OnCircles::new(method))
    }

    /// With a method that projects each step onto the invariants of a scene.
    fn projected<M: Method<f64, PreparedScene<'a>> + Sync>(self, method: M) -> Self::Output {
        self.single(method)
    }
}

/// Takes every method with a projection onto the equations between coordinates after each step.
struct OnPositions<U>(U);

impl<'a, U: WithMethod<'a>> WithMethod<'a> for OnPositions<U> {
    type Output = U::Output;

    fn single<M: Method<f64, PreparedScene<'a>> + Sync>(self, method: M) -> U::Output {
        self.0.single(Projected::<_, MAX_INVARIANTS, OfPositions>::onto_positions(method))
    }

    /// Projection onto invariants keeps these equations, too.
    fn projected<M: Method<f64, PreparedScene<'a>> + Sync>(self, method: M) -> U::Output {
        self.0.projected(method)
    }
}

/// Calls `user` with the method of a name, for a scene with parameters at a state; equations between coordinates are
/// kept by a projection after every step, whatever the method.
///
/// # Errors
/// [`Error::Options`] when the scene lacks what the method needs, or `auto` has no tolerance to go by.
pub(crate) fn with_method<'a, U: WithMethod<'a>>(
    method: MethodName,
    steps: Steps,
    purpose: Purpose,
    dynamics: &dyn Dynamics,
    y: &[f64],
    user: U,
) -> Result<U::Output, Error> {
    match dynamics.positions() {
        // Projection onto invariants keeps these equations, too.
        Some(found) if method.asks_for() != Some(Want::Invariants) => {
            if found.n_functions > MAX_INVARIANTS {
                let (n, Info { scene, model, .. }) = (found.n_functions, dynamics.info());
                let reason = format!(
                    "scene {scene} of {model} has {n} equations between coordinates, but at most {MAX_INVARIANTS} \
                     can be kept"
                );
                return Err(Error::Options { reason });
            }
            with_own_method(method, steps, purpose, dynamics, y, OnPositions(user))
        }
        _ => with_own_method(method, steps, purpose, dynamics, y, user),
    }
}

/// The same without a thought for equations between coordinates.
fn with_own_method<'a, U: WithMethod<'a>>(
    method: MethodName,
    steps: Steps,
    purpose: Purpose,
    dynamics: &dyn Dynamics,
    y: &[f64],
    user: U,
) -> Result<U::Output, Error> {
    Ok(match method {
        MethodName::Tsit5 => user.explicit(Tsit5),
        MethodName::Dop853 => carried(Dop853, dynamics, user),
        MethodName::Vern9 => carried(Vern9, dynamics, user),
        MethodName::Gbs14 => carried(Gbs14, dynamics, user),
        MethodName::Dopri5 => user.explicit(Dopri5),
        MethodName::Rk4 => user.explicit(Rk4),
        MethodName::Gauss4 => user.single(Gauss4::fixed_point()),
        MethodName::Gauss6 => user.single(Gauss6::fixed_point()),
        MethodName::Gauss8 => user.single(Gauss8::fixed_point()),
        MethodName::Gauss16 => user.single(Gauss16),
        MethodName::Gauss4Newton => user.single(Gauss4::newton()),
        MethodName::Gauss6Newton => user.single(Gauss6::newton()),
        MethodName::Gauss8Newton => user.single(Gauss8::newton()),
        MethodName::Taylor => {
            has_series(dynamics, y)?;
            user.single(Taylor::new())
        }
        MethodName::Auto => {
            let Steps::Adaptive { rtol, .. } = steps else {
                let reason = "method auto chooses by tolerances: give these instead of a step".to_owned();
                return Err(Error::Options { reason });
            };
            // A table ends a step of a series at every row, and most have many.
            let has_series = dynamics.series((0.0, f64::INFINITY), y, &mut []) == Some(f64::INFINITY);
            let chosen = auto::choose(rtol, dynamics.rhs_cost(), has_series, purpose);
            return with_own_method(chosen, steps, purpose, dynamics, y, user);
        }
        MethodName::Isospectral => {
            let info = dynamics.info();
            let reason = format!(
                "method isospectral moves fluids that are products of matrices, and scene {} of {} has equations: choose \
                 another method, or write `want matrices` in a fluid's scene",
                info.scene, info.model
            );
            return Err(Error::Options { reason });
        }
        MethodName::Splitting2 => split(Splitting2::new(), method, dynamics, user)?,
        MethodName::Splitting4 => split(Splitting4::new(), method, dynamics, user)?,
        MethodName::Splitting6 => split(Splitting6::new(), method, dynamics, user)?,
        MethodName::Projected => return projected(Vern9, method, dynamics, user),
        MethodName::Gauss16Projected => return projected(Gauss16, method, dynamics, user),
    })
}

/// Calls `user` with an explicit method of high order, on circles where the scene has angles as points of circles.
fn carried<'a, U: WithMethod<'a>, M>(method: M, dynamics: &dyn Dynamics, user: U) -> U::Output
where
    M: Method<f64, PreparedScene<'a>> + Method<f64, Inside<'a>> + Method<F64x4, PreparedLanes<'a>> + Sync,
{
    if dynamics.n_circles() == 0 { user.explicit(method) } else { user.on_circles(method) }
}

/// Calls `user` with a method around which steps are projected onto the invariants of a scene; `name` is that of both.
///
/// # Errors
/// [`Error::Options`] when the scene has no invariants, or too many.
fn projected<'a, U: WithMethod<'a>, M>(
    method: M,
    name: MethodName,
    dynamics: &dyn Dynamics,
    user: U,
) -> Result<U::Output, Error>
where
    M: Method<f64, PreparedScene<'a>> + Sync,
{
    // Storage has a size known to the compiler: rounded up, with invariants that are always met.
    Ok(match dynamics.n_invariants() {
        1..=4 => user.projected(Projected::<_, 4>::new(method)),
        5..=16 => user.projected(Projected::<_, 16>::new(method)),
        17..=MAX_INVARIANTS => user.projected(Projected::<_, MAX_INVARIANTS>::new(method)),
        n_invariants => return Err(not_projected(name, dynamics.info(), n_invariants)),
    })
}

/// Calls `user` with a composition of the exact flows of a scene; `name` is its name.
///
/// # Errors
/// [`Error::Options`] when the scene has none.
fn split<'a, U: WithMethod<'a>, M>(
    method: M,
    name: MethodName,
    dynamics: &dyn Dynamics,
    user: U,
) -> Result<U::Output, Error>
where
    M: Method<f64, PreparedScene<'a>> + Sync,
{
    if let Err(reason) = dynamics.flows() {
        let (name, Info { scene, model, .. }) = (name.name(), dynamics.info());
        return Err(Error::Options { reason: format!("method {name}: scene {scene} of {model} {reason}") });
    }
    Ok(user.single(method))
}

/// Whether a scene has the series that the method `taylor` needs.
///
/// # Errors
/// [`Error::Options`] when it has not.
fn has_series(dynamics: &dyn Dynamics, y: &[f64]) -> Result<(), Error> {
    if dynamics.series((0.0, 0.0), y, &mut []).is_some() {
        return Ok(());
    }
    let info = dynamics.info();
    let reason = format!(
        "method taylor: scene {} of {} has no Taylor series: choose another method",
        info.scene, info.model
    );
    Err(Error::Options { reason })
}

fn not_projected(method: MethodName, info: &Info, n_invariants: usize) -> Error {
    let reason = match n_invariants {
        0 => {
            "has no invariant besides components of its state: choose another method, or claim one that you \
                    know with `casimir name = ..;`"
                .to_owned()
        }
        n => {
            format!("has {n} invariants, but at most {MAX_INVARIANTS} can be kept: choose another method")
        }
    };
    let (method, Info { scene, model, .. }) = (method.name(), info);
    Error::Options { reason: format!("method {method}: scene {scene} of {model} {reason}") }
}
