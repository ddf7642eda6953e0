//! States of any dimension, and parameters that are refused.
//!
//! Does not know: scenes.

use std::fmt;

use hamel_runtime::{ParamError, Real, SquareStorage, StateVector};

/// Parameter values that the model does not allow.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BadParams {
    /// The condition that does not hold, such as `m > 0`.
    pub condition: String,
    /// What the condition means for the model; may be empty.
    pub meaning: String,
}

impl fmt::Display for BadParams {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} does not hold", self.condition)?;
        if self.meaning.is_empty() { Ok(()) } else { write!(f, ": {}", self.meaning) }
    }
}

impl From<ParamError> for BadParams {
    fn from(error: ParamError) -> BadParams {
        BadParams { condition: error.condition.to_string(), meaning: error.meaning.into() }
    }
}

/// A state whose dimension is known at run time only.
#[derive(Clone, Debug, PartialEq)]
pub struct VecState<R = f64>(pub Vec<R>);

impl<R: Real> StateVector<R> for VecState<R> {
    fn as_slice(&self) -> &[R] {
        &self.0
    }

    fn as_mut_slice(&mut self) -> &mut [R] {
        &mut self.0
    }
}

impl<R: Real> SquareStorage<R> for VecState<R> {
    type Rows = Vec<VecState<R>>;
    type Positions = Vec<usize>;

    fn rows_like(&self) -> Self::Rows {
        vec![self.zeros_like(); self.0.len()]
    }

    fn positions_like(&self) -> Self::Positions {
        vec![0; self.0.len()]
    }
}

/// How the equations between coordinates of a scene are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PositionEquations<'a> {
    /// Number of functions.
    pub n_functions: usize,
    /// As [`hamel_runtime::Positions::n_equations`].
    pub n_equations: usize,
    /// As [`hamel_runtime::Positions::moved`].
    pub moved: &'a [usize],
}
