//! Fluids that are moved as products of matrices: recognised in the syntax tree, so that nothing is elaborated whose
//! size grows with `N`.
//!
//! A model is one where its momenta are in `zeitlin(N)` or `zeitlin_sphere(N)` of an `N` that has no table of structure
//! constants, or a field that it carries no adjoint representation, or where a scene wants `matrices`. Its hamiltonian
//! is the energy of the fluid, with a radius of deformation, terms that are linear in the vorticity, and energies of
//! fields that the flow carries; its forces are a friction and constants.
//!
//! Deliberately does not know: structure constants, equations of motion, how matrices are multiplied.

mod form;
mod found;
mod model;
mod read;
mod value;
mod waves;

use std::collections::BTreeMap;

use super::ast::File;
use super::diagnostic::{Diagnostic, Diagnostics, Origin, Span};
use super::limits::MAX_REPRESENTATION;
use super::parser;
use crate::algebra::LieAlgebra;
use found::{Momenta, carried, energy_text, exists, momenta, sizes, wanted};
use hamel_expr::Rational;

pub use model::{
    CarriedField, FluidCasimir, FluidField, FluidMode, FluidParam, FluidTerm, FluidTrace, MAX_CARRIED,
    MAX_FRICTION, MatrixFluid,
};
pub use value::Meaning;
pub use waves::{FluidSurface, FluidWave};

impl MatrixFluid {
    /// Whether it has a constant stream function, or a carried field with a constant current.
    pub fn has_background(&self) -> bool {
        !self.background.is_empty() || self.carried.iter().any(|field| !field.constant.is_empty())
    }

    /// Whether it is no ideal fluid: it has friction, or a force.
    pub fn is_damped(&self) -> bool {
        !self.friction.is_empty() || !self.force.is_empty()
    }

    /// The fluid with other values of the parameters, in their order.
    ///
    /// # Errors
    /// Conditions that they violate, and whatever else they do to the model.
    ///
    /// # Panics
    /// If there are not as many values as parameters.
    pub fn at(&self, values: &[Rational]) -> Result<MatrixFluid, Diagnostics> {
        assert_eq!(values.len(), self.params.len());
        let names = self.params.iter().map(|param| param.name.clone());
        let values = names.zip(values.iter().cloned()).collect();
        let outcome = parser::parse_file(&self.origin.text);
        let file = outcome.file.expect("the text was read before");
        read::read(&file, &self.origin, &values)
            .map_err(|list| Diagnostics::new(Some(self.origin.clone()), list))
    }

    /// The meaning of the text by arithmetic alone, for matrices of any size.
    pub fn meaning(&self) -> Meaning {
        let file = parser::parse_file(&self.origin.text).file.expect("the text was read before");
        Meaning::of(file, self)
    }
}

/// Reads a fluid.
///
/// # Errors
/// Everything in the model that is no part of such a fluid.
pub(super) fn read(file: &File, origin: &Origin) -> Result<MatrixFluid, Vec<Diagnostic>> {
    read::read(file, origin, &BTreeMap::new())
}

/// Where it stands that a model is moved as products of matrices; none for one with equations.
pub(super) fn requested(file: &File) -> Option<Span> {
    let has_equations = |m: &Momenta<'_>| {
        let has_table = match m.surface {
            FluidSurface::Torus => LieAlgebra::TORUS_SIZES.contains(&m.n),
            FluidSurface::Sphere => m.n <= LieAlgebra::MAX_SPHERE,
        };
        // No more than 21 where there is a table.
        let has_adjoint = || (m.n * m.n - 1).pow(3) <= MAX_REPRESENTATION;
        has_table && (has_adjoint() || carried(file, m).iter().all(|field| !field.is_adjoint))
    };
    wanted(file).or_else(|| {
        let momenta = momenta(file)?;
        (exists(momenta.surface, momenta.n) && !has_equations(&momenta)).then_some(momenta.item.span)
    })
}

/// What to write where an algebra has no table of structure constants; `possible` are those with one.
pub(super) fn instead_of_a_table(surface: FluidSurface, possible: &str) -> String {
    format!(
        "tables: {possible}; other sizes, {}, are moved as products of matrices, which fluids alone are: \
         `algebra fluid = ..; momentum omega in fluid as *; action right; hamiltonian = {}; scene default {{ want matrices; }}`",
        sizes(surface),
        energy_text(surface, "fluid", "omega")
    )
}

/// That a model is moved as products of matrices, for those who want its equations.
pub(super) fn refusal(span: Span) -> Diagnostic {
    Diagnostic::new(Some(span), "this fluid is moved as products of matrices and has no equations in components")
        .with_help(
            "`hamel simulate`, `hamel report`, `hamel generate` and `pyhamel.Fluid` take it; equations have zeitlin(N) \
             up to 21 and zeitlin_sphere(N) up to 12, without `want matrices`",
        )
}
