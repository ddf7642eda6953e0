//! What a fluid that is moved as products of matrices has.
//!
//! Does not know: texts.

use super::super::diagnostic::Origin;
use super::waves::{FluidSurface, FluidWave};
use hamel_expr::Rational;

/// Highest power of the Laplacian in a friction.
pub const MAX_FRICTION: usize = 4;

/// Most fields that a flow of matrices carries.
pub const MAX_CARRIED: usize = 4;

/// A field of a fluid: the vorticity, or one that the flow carries, by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FluidField {
    /// The vorticity.
    Vorticity,
    /// A field that the flow carries, in the order of the text.
    Carried(usize),
}

/// A coefficient of a field that the model gives at time zero; all others begin with zero.
#[derive(Clone, Debug, PartialEq)]
pub struct FluidMode {
    /// Its name, such as `re_1_m2` or `c_2_1`.
    pub name: String,
    /// Of which field.
    pub field: FluidField,
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

/// A field that the flow carries, `A' = [psi, A]`, and what its energy does to the vorticity:
///
/// ```text
/// omega' = .. + [j, A],   j = sum over k of c_k (-Delta)^k A + constant
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct CarriedField {
    /// Its name.
    pub name: String,
    /// Documentation.
    pub doc: String,
    /// Coefficients `c_k` of powers of minus the Laplacian in the current `j`; empty where there is none.
    pub current: Vec<Rational>,
    /// The constant part of the current.
    pub constant: Vec<FluidTerm>,
}

impl CarriedField {
    /// Whether it has an energy, so that it acts on the vorticity.
    pub fn is_active(&self) -> bool {
        !self.current.is_empty() || !self.constant.is_empty()
    }
}

/// A trace of matrices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FluidTrace {
    /// `tr F^k/N` of a field, `k` from 1 to 16.
    Power(FluidField, usize),
    /// `tr(W A^k)/N` with a carried field, `k` from 1 to 16.
    Cross(usize, usize),
}

impl FluidTrace {
    /// The power `k`.
    pub fn power(&self) -> usize {
        match self {
            FluidTrace::Power(_, power) | FluidTrace::Cross(_, power) => *power,
        }
    }

    /// That of another power of the same field.
    pub fn with_power(&self, power: usize) -> FluidTrace {
        match self {
            FluidTrace::Power(field, _) => FluidTrace::Power(*field, power),
            FluidTrace::Cross(field, _) => FluidTrace::Cross(*field, power),
        }
    }
}

/// A Casimir of the ideal fluid, a number times a trace, or an output that is one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FluidCasimir {
    /// Name.
    pub name: String,
    /// The trace.
    pub trace: FluidTrace,
    /// What it is multiplied by.
    pub factor: Rational,
    /// Documentation.
    pub doc: String,
}

/// A fluid that is moved as products of matrices:
///
/// ```text
/// omega' = [psi, omega] - d(-Delta) omega + force,   psi = scale (shift - Delta)^-1 omega + background
/// ```
///
/// and what the [fields](CarriedField) add that the flow carries.
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
    /// The fields that the flow carries.
    pub carried: Vec<CarriedField>,
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
