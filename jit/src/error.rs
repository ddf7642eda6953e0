//! Why a program is not compiled.
//!
//! Deliberately does not know: who evaluates the program then.

use std::fmt;

/// Why a program is not compiled in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Error {
    /// Cranelift has no code for this machine.
    UnknownMachine {
        /// What Cranelift says.
        reason: &'static str,
    },
    /// The program does not follow the rules of programs: a bug of whoever made it.
    Program {
        /// The rule that is broken.
        reason: String,
    },
    /// Cranelift refuses.
    Cranelift {
        /// What Cranelift says.
        reason: String,
    },
}

impl Error {
    pub(crate) fn cranelift(error: impl fmt::Display) -> Error {
        Error::Cranelift { reason: error.to_string() }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::UnknownMachine { reason } => write!(f, "this machine has no compiler in memory: {reason}"),
            Error::Program { reason } => write!(f, "the program is not well formed: {reason}"),
            Error::Cranelift { reason } => write!(f, "the program does not compile: {reason}"),
        }
    }
}

impl std::error::Error for Error {}
