//! What a function of a program is for.
//!
//! A role is how whoever requests a function finds it again; a name is made from it where text is written, and no name
//! is read back. Does not know: how any of these functions is computed.

use std::fmt;

/// What a function of a program is for.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Role {
    /// The derivative of the state, one result for each component: what the other functions are about.
    #[default]
    Rate,
    /// The energy, one result.
    Energy,
    /// What must neither vanish nor overflow: the pivots of the request, computed as [`Role::Rate`] computes them where
    /// both do, and everything else that [`Role::Rate`] divides by, unless lowering sees that it is finite and other
    /// than zero everywhere.
    ///
    /// As many scales follow these values: a value whose absolute value does not make its scale larger when it is added
    /// is nothing but rounding error. The scale is the constant zero where no terms can cancel.
    Pivots,
    /// One result, which stays the same while no watched matrix becomes singular; a program has this function if a
    /// matrix is watched, after [`Role::Pivots`].
    Signature,
    /// Results that are positive inside the domain of the coordinates.
    Domain,
    /// A named output of the model or the scene, also the entries of a matrix.
    Output(String),
    /// A named product of a matrix with a vector, which the function takes besides time and state.
    Product(String),
    /// A named function of time and of a vector of variables, which the function takes in the place of the state.
    OfVariables(String),
    /// What one of the exact flows of the scene, by its name, adds to the state in a time that the function takes
    /// besides the state.
    Flow(String),
    /// Cosines and sines of the angles of a right-hand side, see [`Circles`](super::Circles).
    Points,
    /// Order zero of the Taylor coefficients, see [`Jet`](super::Jet).
    SeriesStart,
    /// Every other order of the Taylor coefficients, see [`Jet`](super::Jet).
    SeriesStep,
}

impl Role {
    /// The name of the function in text: in tables of operations, messages and emitted code.
    pub fn name(&self) -> &str {
        match self {
            Role::Rate => "rhs",
            Role::Energy => "energy",
            Role::Pivots => "check",
            Role::Signature => "signature",
            Role::Domain => "domain",
            Role::Output(name) | Role::Product(name) | Role::OfVariables(name) | Role::Flow(name) => name,
            Role::Points => "on_circles",
            Role::SeriesStart => "first",
            Role::SeriesStep => "next",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
