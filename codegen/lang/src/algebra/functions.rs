//! Functions that bases of algebras consist of, on whichever surface they are.
//!
//! Deliberately does not know: algebras made of them, how each is multiplied.

use super::circle::CircleModes;
use super::harmonics::Harmonics;
use super::modes::{Modes, Normal};
use super::skew::Bracket;
use hamel_expr::{ExprId, Graph, Number};

/// The functions that the basis of an algebra consists of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Functions {
    /// Waves on the torus.
    Torus(Modes),
    /// Waves on the circle.
    Circle(CircleModes),
    /// Spherical harmonics.
    Sphere(Harmonics),
}

impl Functions {
    /// Eigenvalues of minus the Laplacian of each basis element.
    pub fn squares(&self) -> Vec<i64> {
        match self {
            Functions::Torus(modes) => modes.squares(),
            Functions::Circle(modes) => modes.squares(),
            Functions::Sphere(harmonics) => harmonics.squares(),
        }
    }

    /// The functions of a basis of which components have another meaning; none on the circle.
    pub(super) fn normalised(self, normal: Normal) -> Option<Functions> {
        match self {
            Functions::Torus(modes) => Some(Functions::Torus(modes.normalised(normal))),
            Functions::Circle(_) => None,
            Functions::Sphere(harmonics) => Some(Functions::Sphere(harmonics.normalised(normal))),
        }
    }

    /// Names of the basis elements.
    pub(super) fn labels(&self) -> Vec<String> {
        match self {
            Functions::Torus(modes) => modes.labels(),
            Functions::Circle(modes) => modes.labels(),
            Functions::Sphere(harmonics) => harmonics.labels(),
        }
    }

    /// Brackets of the basis.
    pub(super) fn brackets(&self) -> Vec<Bracket<Number>> {
        match self {
            Functions::Torus(modes) => modes.brackets(),
            Functions::Circle(modes) => modes.brackets(),
            Functions::Sphere(harmonics) => harmonics.brackets(),
        }
    }

    /// Whether brackets lose what leaves the set, so that they are those of an almost algebra.
    pub(super) fn is_truncated(&self) -> bool {
        match self {
            Functions::Torus(modes) => modes.modulus().is_none(),
            Functions::Circle(_) => true,
            Functions::Sphere(_) => false,
        }
    }

    /// The bracket of two functions by their coefficients; none on the circle, where fields have one.
    pub fn poisson(&self, g: &mut Graph, x: &[ExprId], y: &[ExprId]) -> Option<Vec<ExprId>> {
        match self {
            Functions::Torus(modes) => Some(modes.poisson(g, x, y)),
            Functions::Circle(_) => None,
            Functions::Sphere(harmonics) => Some(harmonics.poisson(g, x, y)),
        }
    }

    /// The product of two functions without what leaves the set; none but on the circle.
    pub fn pointwise(&self, g: &mut Graph, x: &[ExprId], y: &[ExprId]) -> Option<Vec<ExprId>> {
        match self {
            Functions::Circle(modes) => Some(modes.pointwise(g, x, y)),
            Functions::Torus(_) | Functions::Sphere(_) => None,
        }
    }

    /// Coefficients of the `k`-th power of the matrix of a function, without its multiple of the identity, `k > 0`;
    /// none where functions are no matrices.
    pub fn star_power(&self, g: &mut Graph, x: &[ExprId], k: usize) -> Option<Vec<ExprId>> {
        match self {
            Functions::Torus(modes) => modes.star_power(g, x, k),
            Functions::Circle(_) => None,
            Functions::Sphere(harmonics) => Some(harmonics.star_power(g, x, k)),
        }
    }

    /// `tr(x^k)/N` of the matrix of a function, `k > 0`; none where functions are no matrices.
    pub fn trace_power(&self, g: &mut Graph, x: &[ExprId], k: usize) -> Option<ExprId> {
        match self {
            Functions::Torus(modes) => modes.trace_power(g, x, k),
            Functions::Circle(_) => None,
            Functions::Sphere(harmonics) => Some(harmonics.trace_power(g, x, k)),
        }
    }
}
