//! Integration methods by name, and how steps are chosen.
//!
//! `METHODS` is the one table of methods: a method is added by a variant, a line there, and an arm of
//! `solver::method_of`, which the compiler asks for.
//!
//! Does not know: how a method works, scenes, requests.

use hamel_codegen::spec::Want;
use hamel_runtime::Options;
use serde::{Deserialize, Serialize};

use crate::error::Error;
use crate::names;

/// An integration method of the runtime.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum MethodName {
    /// Tsitouras, fifth order.
    Tsit5,
    /// Dormand and Prince, eighth order.
    #[default]
    Dop853,
    /// Verner, ninth order.
    Vern9,
    /// The midpoint rule, extrapolated to order 14 in four lanes.
    Gbs14,
    /// Dormand and Prince, fifth order.
    Dopri5,
    /// The classical fourth-order method, fixed steps only.
    Rk4,
    /// The implicit midpoint rule, of second order: symplectic, fixed steps only; for noise.
    Midpoint,
    /// Gauss collocation of fourth order: symplectic, fixed steps only.
    Gauss4,
    /// Gauss collocation of sixth order: symplectic, fixed steps only.
    Gauss6,
    /// Gauss collocation of eighth order: symplectic, fixed steps only.
    Gauss8,
    /// Gauss collocation of order 16 in lanes, for the longest runs: symplectic, fixed steps only.
    Gauss16,
    /// The midpoint rule with Newton's iteration.
    MidpointNewton,
    /// The same of fourth order with Newton's iteration, for stiff systems and long steps.
    Gauss4Newton,
    /// The same of sixth order with Newton's iteration.
    Gauss6Newton,
    /// The same of eighth order with Newton's iteration.
    Gauss8Newton,
    /// Taylor series of an order that suits the tolerances.
    Taylor,
    /// The one that is fastest for the tolerance and the scene, by measurements: see [`super::auto`].
    Auto,
    /// Verner's method with a projection onto the invariants of the motion after every step.
    Projected,
    /// Gauss collocation of order 16 with the same projection, fixed steps only.
    Gauss16Projected,
    /// Strang's composition of exact flows, of second order: keeps all Casimirs, fixed steps only.
    Splitting2,
    /// A composition of exact flows of fourth order.
    Splitting4,
    /// A composition of exact flows of sixth order.
    Splitting6,
    /// The discrete equations of a scene with `discrete midpoint`, of second order: keeps momenta, fixed steps only.
    Discrete,
    /// A composition of such steps of fourth order.
    Discrete4,
    /// A composition of such steps of sixth order.
    Discrete6,
    /// The isospectral midpoint rule, for fluids that are moved as products of matrices; fixed steps only.
    Isospectral,
}

/// What a method needs and offers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Class {
    /// Explicit, with an error estimate of its own.
    Embedded,
    /// Fixed steps only.
    Fixed,
    /// Fixed steps only, and derivatives of the right-hand side.
    Newton,
    /// Coefficients of the solution's Taylor series.
    Series,
    /// Stands for another method.
    Choice,
    /// Corrects the steps of another method, of an explicit one with an error estimate.
    Projection,
    /// Corrects the steps of a method for fixed steps.
    FixedProjection,
    /// Composes exact flows, fixed steps only.
    Flows,
    /// Solves discrete equations of motion, fixed steps only.
    Steps,
    /// Moves matrices in fixed steps.
    Matrices,
}

/// Every method in the order of [`MethodName`], with its name in requests and on the command line.
const METHODS: [(MethodName, &str, Class); 26] = [
    (MethodName::Tsit5, "tsit5", Class::Embedded),
    (MethodName::Dop853, "dop853", Class::Embedded),
    (MethodName::Vern9, "vern9", Class::Embedded),
    (MethodName::Gbs14, "gbs14", Class::Embedded),
    (MethodName::Dopri5, "dopri5", Class::Embedded),
    (MethodName::Rk4, "rk4", Class::Fixed),
    (MethodName::Midpoint, "midpoint", Class::Fixed),
    (MethodName::Gauss4, "gauss4", Class::Fixed),
    (MethodName::Gauss6, "gauss6", Class::Fixed),
    (MethodName::Gauss8, "gauss8", Class::Fixed),
    (MethodName::Gauss16, "gauss16", Class::Fixed),
    (MethodName::MidpointNewton, "midpoint-newton", Class::Newton),
    (MethodName::Gauss4Newton, "gauss4-newton", Class::Newton),
    (MethodName::Gauss6Newton, "gauss6-newton", Class::Newton),
    (MethodName::Gauss8Newton, "gauss8-newton", Class::Newton),
    (MethodName::Taylor, "taylor", Class::Series),
    (MethodName::Auto, "auto", Class::Choice),
    (MethodName::Projected, "projected", Class::Projection),
    (MethodName::Gauss16Projected, "gauss16-projected", Class::FixedProjection),
    (MethodName::Splitting2, "splitting2", Class::Flows),
    (MethodName::Splitting4, "splitting4", Class::Flows),
    (MethodName::Splitting6, "splitting6", Class::Flows),
    (MethodName::Discrete, "discrete", Class::Steps),
    (MethodName::Discrete4, "discrete4", Class::Steps),
    (MethodName::Discrete6, "discrete6", Class::Steps),
    (MethodName::Isospectral, "isospectral", Class::Matrices),
];

impl MethodName {
    /// All methods.
    pub fn all() -> impl Iterator<Item = MethodName> {
        METHODS.iter().map(|(method, ..)| *method)
    }

    /// The method of a name.
    pub fn from_name(name: &str) -> Option<MethodName> {
        METHODS.iter().find(|(_, known, _)| *known == name).map(|(method, ..)| *method)
    }

    /// The same, and what is wrong with a name that is none.
    ///
    /// # Errors
    /// What follows the word for the place where the name was given.
    pub fn named(name: &str) -> Result<MethodName, String> {
        MethodName::from_name(name).ok_or_else(|| {
            let known: Vec<&str> = MethodName::all().map(MethodName::name).collect();
            format!(
                "{name:?} is no method{}\n  methods: {}",
                names::hint(name, known.iter().copied()),
                names::list(known)
            )
        })
    }

    /// The name in requests.
    pub fn name(self) -> &'static str {
        METHODS[self as usize].1
    }

    fn class(self) -> Class {
        METHODS[self as usize].2
    }

    /// Whether the method takes fixed steps only.
    pub fn has_fixed_steps(self) -> bool {
        matches!(
            self.class(),
            Class::Fixed
                | Class::Newton
                | Class::FixedProjection
                | Class::Flows
                | Class::Steps
                | Class::Matrices
        )
    }

    /// Whether a step evaluates rates at times inside of it alone.
    pub fn evaluates_inside(self) -> bool {
        use MethodName::*;
        matches!(
            self,
            Midpoint | Gauss4 | Gauss6 | Gauss8 | MidpointNewton | Gauss4Newton | Gauss6Newton | Gauss8Newton
        )
    }

    /// Whether the method asks for the invariants of the motion.
    pub fn is_projection(self) -> bool {
        matches!(self.class(), Class::Projection | Class::FixedProjection)
    }

    /// What the method asks a scene for, beyond its right-hand side.
    pub fn asks_for(self) -> Option<Want> {
        match self.class() {
            Class::Projection | Class::FixedProjection => Some(Want::Invariants),
            Class::Flows => Some(Want::Splitting),
            _ => None,
        }
    }

    /// Whether the method integrates a motion with its derivatives: it asks a scene for nothing but the right-hand
    /// side.
    pub fn carries_derivatives(self) -> bool {
        (self.evaluates_rates_alone() && !self.is_projection()) || self.class() == Class::Choice
    }

    /// Whether every scene with equations can be moved by the method, with steps that any explicit method takes.
    pub fn suits_all_scenes(self) -> bool {
        matches!(self.class(), Class::Embedded) || self == MethodName::Rk4
    }

    /// Whether the method is one of its own, and evaluates the right-hand side but neither its derivatives nor a
    /// series, and moves no matrices, which models with equations have none of.
    pub fn evaluates_rates_alone(self) -> bool {
        !matches!(
            self.class(),
            Class::Newton | Class::Series | Class::Choice | Class::Flows | Class::Steps | Class::Matrices
        )
    }
}

/// The names of the methods with an error estimate, for a sentence: `a, b or c`.
fn embedded_names() -> String {
    let embedded = METHODS.iter().filter(|(.., class)| *class == Class::Embedded);
    let names: Vec<&str> = embedded.map(|(_, name, _)| *name).collect();
    match names.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => names.concat(),
    }
}

/// Most steps of one run with adaptive steps, rejected ones included, unless another number is given.
const MAX_STEPS: u64 = 50_000_000;

/// How steps are chosen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Steps {
    /// Such that the estimated error stays within the tolerances.
    Adaptive {
        /// Relative tolerance.
        rtol: f64,
        /// Absolute tolerance.
        atol: f64,
        /// Largest step; none for any.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        max: Option<f64>,
    },
    /// All of one size.
    Fixed {
        /// The size.
        step: f64,
    },
}

impl Steps {
    /// Default relative tolerance.
    pub const RTOL: f64 = 1e-10;
    /// Default absolute tolerance.
    pub const ATOL: f64 = 1e-12;

    /// Steps from what was given.
    ///
    /// # Errors
    /// What is contradictory or missing, and what to change.
    pub fn new(
        method: MethodName,
        rtol: Option<f64>,
        atol: Option<f64>,
        step: Option<f64>,
    ) -> Result<Steps, String> {
        match (step, rtol, atol) {
            (Some(_), ..) if method == MethodName::Auto => {
                Err("is given, but auto chooses by tolerances: leave it out, or choose a method for it"
                    .into())
            }
            (Some(step), None, None) => Ok(Steps::Fixed { step }),
            (Some(_), ..) => {
                Err("is given together with a tolerance: give either step, or rtol and atol".into())
            }
            (None, ..) if method.has_fixed_steps() => Err(format!(
                "is missing: {} has no error estimate, give a step or choose {}",
                method.name(),
                embedded_names()
            )),
            (None, rtol, atol) => {
                let (rtol, atol) = (rtol.unwrap_or(Self::RTOL), atol.unwrap_or(Self::ATOL));
                Ok(Steps::Adaptive { rtol, atol, max: None })
            }
        }
    }

    /// The same with a largest step, if one is given.
    ///
    /// # Errors
    /// Why it cannot be, and what to change.
    pub fn within(self, max_step: Option<f64>) -> Result<Steps, String> {
        match (self, max_step) {
            (steps, None) => Ok(steps),
            (_, Some(max)) if !(max.is_finite() && max > 0.0) => {
                Err(format!("is {max:?}: give a positive, finite time"))
            }
            (Steps::Fixed { .. }, Some(_)) => Err(
                "is given together with a fixed step, which is the largest as well: leave one of them out"
                    .into(),
            ),
            (Steps::Adaptive { rtol, atol, .. }, max) => Ok(Steps::Adaptive { rtol, atol, max }),
        }
    }

    /// The same for people, such as `rtol 1e-10, atol 1e-12`.
    pub fn describe(self) -> String {
        match self {
            Steps::Adaptive { rtol, atol, max: None } => format!("rtol {rtol:e}, atol {atol:e}"),
            Steps::Adaptive { rtol, atol, max: Some(max) } => {
                format!("rtol {rtol:e}, atol {atol:e}, steps up to {max:?}")
            }
            Steps::Fixed { step } => format!("step {step:?}"),
        }
    }

    /// Largest number of steps unless another one is given; one with fixed steps costs less and cannot be rejected.
    pub fn max_steps(self) -> u64 {
        match self {
            Steps::Adaptive { .. } => MAX_STEPS,
            Steps::Fixed { .. } => 20 * MAX_STEPS,
        }
    }

    /// Options of an integration to `t_final` with at most `max_steps` steps, rejected ones included.
    ///
    /// # Errors
    /// [`Error::Options`] for a time that is not finite, and for fixed steps that are too many.
    pub fn options(self, t_final: f64, max_steps: u64) -> Result<Options<f64>, Error> {
        if !t_final.is_finite() {
            return Err(Error::Options { reason: format!("t_final is {t_final}: give a finite time") });
        }
        let options = match self {
            Steps::Adaptive { rtol, atol, max } => {
                let n_steps = max.map_or(0.0, |max| (t_final / max).abs());
                if n_steps > max_steps as f64 * (1.0 + 1e-9) {
                    let reason = format!(
                        "max_step {:?} is too small for t_final = {t_final:?}: it needs {n_steps:.1e} steps, and at \
                         most {max_steps} are taken; give a larger one, or raise max_steps",
                        max.unwrap_or_default()
                    );
                    return Err(Error::Options { reason });
                }
                let options = Options::adaptive(rtol, atol);
                max.map_or(options, |max| options.with_max_step(max))
            }
            Steps::Fixed { step } => {
                let n_steps = (t_final / step).abs();
                // The quotient is rounded.
                if step > 0.0 && n_steps > max_steps as f64 * (1.0 + 1e-9) {
                    let reason = format!(
                        "step {step:?} is too small for t_final = {t_final:?}: it needs {n_steps:.1e} steps, and at most \
                         {max_steps} are taken; give a larger step, or raise max_steps"
                    );
                    return Err(Error::Options { reason });
                }
                Options::fixed(step)
            }
        };
        Ok(options.with_max_steps(max_steps))
    }
}

#[cfg(test)]
mod tests {
    use super::{METHODS, MethodName, embedded_names};

    #[test]
    fn a_method_has_one_name_everywhere() {
        for (method, name, _) in METHODS {
            assert_eq!(method.name(), name);
            assert_eq!(MethodName::from_name(name), Some(method));
            assert_eq!(serde_json::to_value(method).ok(), Some(name.into()));
        }
        assert_eq!(embedded_names(), "tsit5, dop853, vern9, gbs14 or dopri5");
    }
}
