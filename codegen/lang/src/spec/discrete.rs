//! The discrete equations that a scene asks for.
//!
//! Deliberately does not know: which models have them, how they are derived.

use super::diagnostic::Span;

/// A map from a Lie algebra to its group, near the identity, by which discrete equations move the group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Retraction {
    /// `cay(xi) = (1 - xi/2)^-1 (1 + xi/2)`.
    Cayley,
    /// The exponential map.
    Exp,
}

impl Retraction {
    /// Both of them.
    pub const ALL: [Retraction; 2] = [Retraction::Cayley, Retraction::Exp];

    /// The name in the language.
    pub const fn name(self) -> &'static str {
        match self {
            Retraction::Cayley => "cayley",
            Retraction::Exp => "exp",
        }
    }

    /// The retraction of a name.
    pub fn from_name(name: &str) -> Option<Retraction> {
        Retraction::ALL.into_iter().find(|retraction| retraction.name() == name)
    }
}

/// That a scene has the discrete equations of the midpoint quadrature: `discrete midpoint;`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Discrete {
    /// The retraction, where the algebra does not choose.
    pub retraction: Option<Retraction>,
    /// Where the retraction is named, or the quadrature.
    pub place: Option<Span>,
}
