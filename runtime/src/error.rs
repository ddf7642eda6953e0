//! Every error of the crate: small `Copy` values which say where and why.
//!
//! Times are reported as `f64` whatever the scalar; of several lanes the largest is reported.

use core::fmt;

/// Why a right-hand side has no value at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Failure {
    /// A pivot of a linear solve vanishes.
    Singular {
        /// Time of the evaluation.
        t: f64,
        /// The pivot, in the words of the model.
        pivot: &'static str,
    },
    /// A pivot of a linear solve passes through zero between two states: the equations are singular in between.
    ChangedSign {
        /// Time of the state after it, which is not accepted.
        t: f64,
        /// The pivot, in the words of the model.
        pivot: &'static str,
    },
    /// Constraints that the motion keeps independent depend on each other on the way between two states: it may go on
    /// in more than one way there.
    RankLost {
        /// Time of the state after it, which is not accepted.
        t: f64,
    },
    /// A pivot is infinite or NaN: a division by it would give zeros that look like accelerations.
    PivotNotFinite {
        /// Time of the evaluation.
        t: f64,
        /// The pivot, in the words of the model.
        pivot: &'static str,
    },
    /// The point lies outside the domain of the equations.
    OutsideDomain {
        /// Time of the evaluation.
        t: f64,
        /// The condition that does not hold, such as `"sin(theta) != 0"`.
        condition: &'static str,
    },
    /// A component of the state or of its derivative is infinite or NaN, and the system does not say why.
    NonFinite {
        /// Time of the evaluation.
        t: f64,
        /// Position of the first such component in the state.
        index: usize,
    },
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Singular { t, pivot } => {
                write!(f, "pivot {pivot} vanishes at t = {t}: the equations are singular there")
            }
            Self::ChangedSign { t, pivot } => {
                write!(
                    f,
                    "pivot {pivot} passes through zero before t = {t}: the equations are singular there"
                )
            }
            Self::RankLost { t } => write!(
                f,
                "constraints depend on each other before t = {t}: the motion may go on in more than one way there"
            ),
            Self::PivotNotFinite { t, pivot } => {
                write!(
                    f,
                    "pivot {pivot} is not finite at t = {t}: the numbers of the state are too large for it"
                )
            }
            Self::OutsideDomain { t, condition } => {
                write!(f, "{condition} does not hold at t = {t}: the equations are not defined there")
            }
            Self::NonFinite { t, index } => {
                write!(f, "component {index} of the state or of its derivative is not finite at t = {t}")
            }
        }
    }
}

impl core::error::Error for Failure {}

/// Why an integration could not start or could not go on.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Error {
    /// The right-hand side has no value where it is needed.
    Failure(Failure),
    /// The error estimate asks for steps that no longer change the time.
    StepTooSmall {
        /// Time of the last accepted state.
        t: f64,
        /// The step, signed, that was refused.
        h: f64,
    },
    /// The limit on attempted steps was reached.
    TooManySteps {
        /// Time of the last accepted state.
        t: f64,
        /// The limit, `Options::max_steps`.
        limit: u64,
    },
    /// The relative tolerance is negative, not finite or below round-off.
    RelativeTolerance {
        /// The tolerance asked for.
        value: f64,
        /// The least tolerance allowed for the scalar in use.
        least: f64,
    },
    /// The absolute tolerance is negative or not finite.
    AbsoluteTolerance {
        /// The tolerance asked for.
        value: f64,
        /// The least tolerance allowed.
        least: f64,
    },
    /// Both tolerances are zero.
    ZeroTolerances {
        /// The least relative tolerance allowed for the scalar in use.
        least: f64,
    },
    /// The tolerances of a component are not allowed, each by the rules for all.
    ComponentTolerances {
        /// Position of the component in the state.
        index: usize,
        /// The relative tolerance asked for.
        rtol: f64,
        /// The absolute tolerance asked for.
        atol: f64,
    },
    /// A step size (fixed, initial or maximal) is not a positive finite number.
    StepSize {
        /// The step size asked for.
        value: f64,
    },
    /// The method has no error estimate, so that it cannot choose its steps.
    NoErrorEstimate {
        /// Name of the method.
        method: &'static str,
    },
    /// A time to start from, to reach or to sample is not finite.
    TimeNotFinite {
        /// The time.
        value: f64,
    },
    /// A time asked of the dense output lies outside the interval that it covers.
    OutsideInterval {
        /// The time.
        t: f64,
        /// Start of the interval.
        from: f64,
        /// End of the interval.
        to: f64,
    },
    /// The iteration for the stages of an implicit method did not converge.
    NotConverged {
        /// Name of the method.
        method: &'static str,
        /// Time at the start of the step.
        t: f64,
        /// The step, signed.
        h: f64,
        /// Number of iterations done.
        iterations: u32,
    },
    /// A function whose changes of sign are events is infinite or NaN.
    EventNotFinite {
        /// Time of the evaluation.
        t: f64,
        /// Position of the function.
        index: usize,
    },
    /// An event that changes the state follows itself within the rounding of time: infinitely many events before a
    /// time, as of a ball that comes to rest, or one that leaves a ball at rest on a ground that does not hold it.
    EventsAccumulate {
        /// Time of the last of them.
        t: f64,
        /// Position of its function.
        index: usize,
    },
    /// An event function changes more often within a step than can be followed.
    EventsUnresolved {
        /// Time up to which it was followed.
        t: f64,
        /// Position of the function.
        index: usize,
    },
    /// The limit on events was reached.
    TooManyEvents {
        /// Time of the last of them.
        t: f64,
        /// The limit, `Options::max_events`.
        limit: u64,
    },
    /// An invariant to project onto is infinite or NaN at a state that is finite.
    InvariantNotFinite {
        /// Time of the evaluation.
        t: f64,
        /// Position of the invariant.
        index: usize,
    },
    /// An equation between coordinates is violated, and the coordinates that may be moved cannot meet it from where
    /// they start.
    PositionMissed {
        /// Time of the evaluation.
        t: f64,
        /// Position of the equation.
        index: usize,
        /// What is left of it.
        residual: f64,
    },
    /// An equation between coordinates does not change, in first order, with the coordinates that may be moved: a dead
    /// centre, where branches meet.
    PositionSingular {
        /// Time of the evaluation.
        t: f64,
        /// Position of the equation.
        index: usize,
        /// What is left of it.
        residual: f64,
    },
    /// There is no Taylor method of this order.
    Order {
        /// The order asked for.
        order: usize,
        /// The least order.
        least: usize,
        /// The highest order.
        most: usize,
    },
    /// The equations of the system, or its initial state, have not the form that the method integrates.
    Form {
        /// Name of the method.
        method: &'static str,
        /// What they would have to be.
        needs: &'static str,
    },
    /// Matrices of this size are not available.
    MatrixSize {
        /// The size asked for.
        n: usize,
        /// The sizes that there are, in words.
        allowed: &'static str,
    },
    /// A number of a fluid of matrices is outside the range in which there is one.
    Number {
        /// Its value.
        value: f64,
        /// The number that it would have to be, in words.
        needs: &'static str,
    },
    /// The room that was given is too small.
    Storage {
        /// Numbers that there is room for.
        given: usize,
        /// Numbers that there has to be room for.
        needed: usize,
    },
    /// Dense output was asked for after a failed step, which overwrote the stages it needs, or after a stop at an
    /// event.
    NoDenseOutput {
        /// Time of the last accepted state.
        t: f64,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Failure(failure) => failure.fmt(f),
            Self::StepTooSmall { t, h } => {
                write!(
                    f,
                    "step {h:e} at t = {t} is too small to change the time: the solution may be singular"
                )
            }
            Self::TooManySteps { t, limit } => {
                write!(
                    f,
                    "limit of {limit} steps reached at t = {t}: raise max_steps or loosen the tolerances"
                )
            }
            Self::RelativeTolerance { value, least } => {
                write!(f, "relative tolerance {value:e} is not allowed: take zero or at least {least:e}")
            }
            Self::AbsoluteTolerance { value, least } => {
                write!(
                    f,
                    "absolute tolerance {value:e} is not allowed: take a finite value of at least {least:e}"
                )
            }
            Self::ZeroTolerances { least } => {
                write!(f, "both tolerances are zero: take a relative tolerance of at least {least:e}")
            }
            Self::ComponentTolerances { index, rtol, atol } => {
                write!(
                    f,
                    "tolerances of component {index} (relative {rtol:e}, absolute {atol:e}) are not allowed: take \
                     finite values, not both zero, the relative one zero or above round-off"
                )
            }
            Self::StepSize { value } => {
                write!(f, "step size {value:e} is not allowed: take a positive finite value")
            }
            Self::NoErrorEstimate { method } => {
                write!(f, "method {method} has no error estimate: give it a fixed step")
            }
            Self::TimeNotFinite { value } => {
                write!(f, "time {value} is not finite, or not in one direction on every lane")
            }
            Self::OutsideInterval { t, from, to } => {
                write!(f, "time {t} lies outside the interval from {from} to {to} of the dense output")
            }
            Self::NotConverged { method, t, h, iterations } => {
                write!(
                    f,
                    "method {method}: stages of the step {h:e} from t = {t} did not converge in \
                     {iterations} iterations: take a smaller step"
                )?;
                // The fixed-point iteration of Gauss methods has an alternative.
                match method {
                    "gauss4" | "gauss6" | "gauss8" => write!(f, ", or {method}-newton"),
                    "gauss16" => f.write_str(", or gauss8-newton"),
                    _ => Ok(()),
                }
            }
            Self::Form { method, needs } => write!(f, "method {method} needs {needs}"),
            Self::EventNotFinite { t, index } => {
                write!(
                    f,
                    "event function {index} is not finite at t = {t}: let it have a value on the whole way"
                )
            }
            Self::EventsAccumulate { t, index } => {
                write!(
                    f,
                    "events of function {index} accumulate at t = {t}: each changes the state again within the \
                     rounding of time; stop before, or let it end the motion"
                )
            }
            Self::EventsUnresolved { t, index } => {
                write!(
                    f,
                    "event function {index} changes too often from t = {t} on: let steps be shorter, by max_step or \
                     tighter tolerances"
                )
            }
            Self::TooManyEvents { t, limit } => {
                write!(f, "limit of {limit} events reached at t = {t}: raise max_events if they are meant")
            }
            Self::InvariantNotFinite { t, index } => {
                write!(
                    f,
                    "invariant {index} is not finite at t = {t}: choose units in which it is, or a method without \
                     projection"
                )
            }
            Self::PositionMissed { t, index, residual } => {
                write!(
                    f,
                    "equation {index} between coordinates is violated by {residual:e} at t = {t}, and the coordinates \
                     that may be moved cannot meet it: start from others"
                )
            }
            Self::PositionSingular { t, index, residual } => {
                write!(
                    f,
                    "equation {index} between coordinates is violated by {residual:e} at t = {t}, where the coordinates \
                     that may be moved do not change it: a dead centre; start beside it"
                )
            }
            Self::Order { order, least, most } => {
                write!(f, "order {order} is not available: take one from {least} to {most}")
            }
            Self::MatrixSize { n, allowed } => {
                write!(f, "matrices of size {n} are not available: take {allowed}")
            }
            Self::Number { value, needs } => write!(f, "{value:e} is no {needs}"),
            Self::Storage { given, needed } => {
                write!(f, "room for {given} numbers is too small: give room for {needed}")
            }
            Self::NoDenseOutput { t } => {
                write!(
                    f,
                    "dense output up to t = {t} was lost to the failed step or the stop after it: sample before \
                     stepping"
                )
            }
        }
    }
}

impl core::error::Error for Error {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            Self::Failure(failure) => Some(failure),
            _ => None,
        }
    }
}

impl From<Failure> for Error {
    fn from(failure: Failure) -> Self {
        Self::Failure(failure)
    }
}

/// What parameters have to satisfy.
///
/// It compares with text: `error.condition == "m > 0"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Condition {
    /// A condition of the model, such as `m > 0`.
    OfModel(&'static str),
    /// The parameter of that name is neither infinite nor NaN, `m is finite`.
    IsFinite(&'static str),
    /// There are so many values, `the number of values is 3`.
    Count(usize),
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OfModel(text) => f.write_str(text),
            Self::IsFinite(name) => write!(f, "{name} is finite"),
            Self::Count(n) => write!(f, "the number of values is {n}"),
        }
    }
}

impl PartialEq<str> for Condition {
    fn eq(&self, text: &str) -> bool {
        match *self {
            Self::OfModel(own) => own == text,
            Self::IsFinite(name) => text.strip_suffix(" is finite") == Some(name),
            Self::Count(n) => {
                text.strip_prefix("the number of values is ").and_then(|n| n.parse().ok()) == Some(n)
            }
        }
    }
}

impl PartialEq<&str> for Condition {
    fn eq(&self, text: &&str) -> bool {
        *self == **text
    }
}

/// A parameter value that the model does not allow.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ParamError {
    /// The condition that does not hold.
    pub condition: Condition,
    /// What the condition means for the model.
    pub meaning: &'static str,
}

impl ParamError {
    /// An error with its condition and what that means for the model.
    #[must_use]
    pub const fn new(condition: Condition, meaning: &'static str) -> Self {
        Self { condition, meaning }
    }

    /// Passes where a condition of the model holds.
    ///
    /// # Errors
    ///
    /// The condition otherwise.
    pub const fn require(holds: bool, condition: &'static str, meaning: &'static str) -> Result<(), Self> {
        if holds { Ok(()) } else { Err(Self::new(Condition::OfModel(condition), meaning)) }
    }
}

impl fmt::Display for ParamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.meaning.is_empty() {
            write!(f, "{} does not hold", self.condition)
        } else {
            write!(f, "{} does not hold: {}", self.condition, self.meaning)
        }
    }
}

impl core::error::Error for ParamError {}

#[cfg(test)]
mod tests {
    use std::format;
    use std::string::ToString;

    use super::{Condition, Error, Failure, ParamError};

    #[test]
    fn messages_are_lower_case_without_full_stop() {
        let errors = [
            Error::Failure(Failure::Singular { t: 1.0, pivot: "d1" }),
            Error::Failure(Failure::ChangedSign { t: 1.0, pivot: "d1" }),
            Error::Failure(Failure::PivotNotFinite { t: 1.0, pivot: "d1" }),
            Error::Failure(Failure::OutsideDomain { t: 1.0, condition: "x > 0" }),
            Error::Failure(Failure::NonFinite { t: 1.0, index: 2 }),
            Error::StepTooSmall { t: 1.0, h: 1e-17 },
            Error::TooManySteps { t: 1.0, limit: 10 },
            Error::RelativeTolerance { value: 1e-20, least: 2e-15 },
            Error::AbsoluteTolerance { value: -1.0, least: 0.0 },
            Error::ZeroTolerances { least: 2e-15 },
            Error::ComponentTolerances { index: 2, rtol: -1.0, atol: 0.0 },
            Error::StepSize { value: -1.0 },
            Error::NoErrorEstimate { method: "rk4" },
            Error::TimeNotFinite { value: f64::NAN },
            Error::OutsideInterval { t: 3.0, from: 1.0, to: 2.0 },
            Error::NotConverged { method: "gauss6", t: 1.0, h: 0.1, iterations: 100 },
            Error::EventNotFinite { t: 1.0, index: 0 },
            Error::EventsAccumulate { t: 1.0, index: 0 },
            Error::EventsUnresolved { t: 1.0, index: 0 },
            Error::TooManyEvents { t: 1.0, limit: 10 },
            Error::InvariantNotFinite { t: 1.0, index: 0 },
            Error::PositionMissed { t: 1.0, index: 0, residual: 0.1 },
            Error::PositionSingular { t: 1.0, index: 0, residual: 0.1 },
            Error::Order { order: 40, least: 2, most: 32 },
            Error::MatrixSize { n: 4, allowed: "an odd number from 3 on" },
            Error::Storage { given: 1, needed: 2 },
            Error::NoDenseOutput { t: 1.0 },
        ];
        for error in errors {
            let message = error.to_string();
            assert!(!message.ends_with('.'), "{message}");
            assert!(message.chars().next().is_some_and(char::is_lowercase), "{message}");
        }
        let error = ParamError::require(false, "m > 0", "a body has mass").unwrap_err();
        assert_eq!(format!("{error}"), "m > 0 does not hold: a body has mass");
        assert_eq!(ParamError::require(true, "m > 0", "a body has mass"), Ok(()));
    }

    #[test]
    fn conditions_compare_with_their_text() {
        for condition in [Condition::OfModel("m > 0"), Condition::IsFinite("m"), Condition::Count(3)] {
            assert_eq!(condition, condition.to_string().as_str());
            assert_ne!(condition, "m");
        }
    }

    #[test]
    fn errors_are_small() {
        assert!(size_of::<Error>() <= 40, "{}", size_of::<Error>());
    }
}
