//! Every error of the crate.

use std::fmt;

use hamel_runtime::{Error as IntegrationError, ParamError};

/// Why no ensemble could be integrated: the fault of the call, not of a trajectory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// The numbers of parameter sets and of initial states differ, and neither is one.
    Lengths {
        /// Number of parameter sets.
        params: usize,
        /// Number of initial states.
        initial: usize,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Lengths { params, initial } => write!(
                f,
                "{params} parameter sets do not fit {initial} initial states: give as many of both, or one for all"
            ),
        }
    }
}

impl std::error::Error for Error {}

/// Why a trajectory ended before its time; `E` says why parameters are not allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Stop<E = ParamError> {
    /// The parameters are not allowed: it never started.
    Params(E),
    /// The integration could not start, or not go on.
    Integration(IntegrationError),
}

impl<E: fmt::Display> fmt::Display for Stop<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Params(error) => error.fmt(f),
            Self::Integration(error) => error.fmt(f),
        }
    }
}

impl<E: std::error::Error + 'static> std::error::Error for Stop<E> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Params(error) => Some(error),
            Self::Integration(error) => Some(error),
        }
    }
}

impl<E> From<IntegrationError> for Stop<E> {
    fn from(error: IntegrationError) -> Self {
        Self::Integration(error)
    }
}
