//! What a fluid that is moved as products of matrices has.
//!
//! Does not know: texts.

use super::super::diagnostic::Origin;
use super::waves::{FluidSurface, FluidWave};
use hamel_expr::Rational;

/// Highest power of the Laplacian in a friction.
pub const MAX_FRICTION: usize = 4;

/// A coefficient of the vorticity that the model gives at time zero; all others begin with zero.
#[derive(Clone, Debug, PartialEq)]
pub struct FluidMode {
    /// Its name, such as `re_1_m2` or `c_2_1`.
    pub name: String,
    /// Which coefficient it is.
    pub wave: FluidWave,
    /// Value at time zero.
    pub initial: Rational,
}

/// A coefficient with a value: of a background or a force.
#[derive(Clone, Debug, PartialEq)]
pub struct FluidTerm {
    /// Which coefficient it is.
    pub wave: FluidWave,
    /// Its value.
    pub value: Rational,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct FluidParam {
    /// Name.
    pub name: String,
    /// Documentation.
    pub doc: String,
    /// Value.
    pub value: Rational,
}

/// A Casimir of the ideal fluid, `tr W^k/N`, or an output that is one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FluidCasimir {
    /// Name.
    pub name: String,
    /// The power `k`, from 1 to 16.
    pub power: usize,
    /// Documentation.
    pub doc: String,
}

/// A fluid that is moved as products of matrices:
///
/// ```text
/// omega' = [psi, omega] - d(-Delta) omega + force,   psi = scale (shift - Delta)^-1 omega + background
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MatrixFluid {
    /// Name of the model.
    pub name: String,
    /// Its documentation.
    pub doc: Vec<String>,
    /// Where it is from.
    pub sources: Vec<String>,
    /// What a list shows it under.
    pub topic: Option<String>,
    /// Where it flows.
    pub surface: FluidSurface,
    /// Size of the matrices.
    pub n: usize,
    /// Documentation of the vorticity.
    pub vorticity: String,
    /// Parameters, with the values that all other numbers belong to.
    pub params: Vec<FluidParam>,
    /// The factor `scale` of the stream function, one for an ideal fluid.
    pub scale: Rational,
    /// The square of the inverse radius of deformation, zero for an ideal fluid.
    pub shift: Rational,
    /// The constant stream function.
    pub background: Vec<FluidTerm>,
    /// Coefficients of powers of minus the Laplacian in the friction `d`; empty where there is none.
    pub friction: Vec<Rational>,
    /// The constant force.
    pub force: Vec<FluidTerm>,
    /// The modes with an initial value, in the order of the text.
    pub modes: Vec<FluidMode>,
    /// The Casimirs of the model, and its outputs.
    pub casimirs: Vec<FluidCasimir>,
    /// The text that it was read from.
    pub(super) origin: Origin,
}
