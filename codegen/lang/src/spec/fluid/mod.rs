//! Fluids that are moved as products of matrices: recognised in the syntax tree, so that nothing is elaborated whose
//! size grows with `N`.
//!
//! A model is one where its momenta are in `zeitlin(N)` or `zeitlin_sphere(N)` of an `N` that has no table of structure
//! constants, or where a scene wants `matrices`. Its hamiltonian is the energy of the fluid, with a radius of
//! deformation, and terms that are linear in the vorticity; its forces are a friction and constants.
//!
//! Deliberately does not know: structure constants, equations of motion, how matrices are multiplied.

mod form;
mod read;
mod value;
mod waves;

use std::collections::BTreeMap;

use super::ast::{AlgebraExpr, AlgebraNode, File, Item, ItemKind, Name};
use super::diagnostic::{Diagnostic, Diagnostics, Origin, Span};
use super::limits::MAX_MATRIX;
use super::parser;
use super::want::Want;
use crate::algebra::LieAlgebra;
use hamel_expr::Rational;

pub use value::Meaning;
pub use waves::{FluidSurface, FluidWave};

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

/// A Casimir `tr W^k/N`.
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
    /// The Casimirs of the model.
    pub casimirs: Vec<FluidCasimir>,
    /// The text that it was read from.
    origin: Origin,
}

impl MatrixFluid {
    /// Largest power of a Casimir, zero where there is none.
    pub fn n_casimirs(&self) -> usize {
        self.casimirs.iter().map(|c| c.power).max().unwrap_or(0)
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

/// The momenta of a fluid in an algebra of functions.
#[derive(Clone, Copy)]
struct Momenta<'a> {
    item: &'a Item,
    names: &'a [Name],
    labels: &'a [Name],
    surface: FluidSurface,
    n: usize,
    /// The name of the algebra, where it has one.
    algebra: Option<&'a str>,
}

/// Surface and size of an algebra of functions on a surface.
fn surface_of(expr: &AlgebraExpr) -> Option<(FluidSurface, usize)> {
    let AlgebraNode::Call(family, arguments) = &expr.node else { return None };
    let surface = match family.text.as_str() {
        "zeitlin" => FluidSurface::Torus,
        "zeitlin_sphere" => FluidSurface::Sphere,
        _ => return None,
    };
    match arguments.as_slice() {
        [AlgebraExpr { node: AlgebraNode::Number(n), .. }] => Some((surface, *n)),
        _ => None,
    }
}

fn momenta(file: &File) -> Option<Momenta<'_>> {
    file.items.iter().find_map(|item| {
        let ItemKind::MomentumIn { names, algebra, labels } = &item.kind else { return None };
        let named = match &algebra.node {
            AlgebraNode::Name(name) => file.items.iter().find_map(|other| match &other.kind {
                ItemKind::AlgebraName { name: own, value } if own.text == *name => {
                    Some((value, Some(own.text.as_str())))
                }
                _ => None,
            }),
            _ => Some((algebra, None)),
        };
        let (value, algebra) = named?;
        let (surface, n) = surface_of(value)?;
        Some(Momenta { item, names, labels, surface, n, algebra })
    })
}

/// Where a scene wants matrices.
fn wanted(file: &File) -> Option<Span> {
    file.items.iter().find_map(|item| match &item.kind {
        ItemKind::Scene { wants, .. } => {
            wants.iter().find(|want| want.text == Want::Matrices.name()).map(|want| want.span)
        }
        _ => None,
    })
}

/// Reads a fluid.
///
/// # Errors
/// Everything in the model that is no part of such a fluid.
pub(super) fn read(file: &File, origin: &Origin) -> Result<MatrixFluid, Vec<Diagnostic>> {
    read::read(file, origin, &BTreeMap::new())
}

/// Whether matrices of that size exist.
fn exists(surface: FluidSurface, n: usize) -> bool {
    match surface {
        FluidSurface::Torus => (3..=MAX_MATRIX).contains(&n) && !n.is_multiple_of(2),
        FluidSurface::Sphere => (2..=MAX_MATRIX).contains(&n),
    }
}

/// Where it stands that a model is moved as products of matrices; none for one with equations.
pub(super) fn requested(file: &File) -> Option<Span> {
    let has_table = |m: &Momenta<'_>| match m.surface {
        FluidSurface::Torus => LieAlgebra::TORUS_SIZES.contains(&m.n),
        FluidSurface::Sphere => m.n <= LieAlgebra::MAX_SPHERE,
    };
    wanted(file).or_else(|| {
        let momenta = momenta(file)?;
        (exists(momenta.surface, momenta.n) && !has_table(&momenta)).then_some(momenta.item.span)
    })
}

/// Sizes for which matrices exist.
fn sizes(surface: FluidSurface) -> String {
    match surface {
        FluidSurface::Torus => format!("odd numbers from 3 to {}", MAX_MATRIX - 1),
        FluidSurface::Sphere => format!("numbers from 2 to {MAX_MATRIX}"),
    }
}

/// The energy of a fluid as a model has it; an algebra without a name is that of the velocities.
fn energy_text(surface: FluidSurface, algebra: &str, omega: &str) -> String {
    let factor = match surface {
        FluidSurface::Torus => "-",
        FluidSurface::Sphere => "-1/2*",
    };
    format!("{factor}dot({omega}, laplacian({algebra})^-1*{omega})")
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
            "`hamel simulate`, `hamel report` and `hamel generate` take it; equations have zeitlin(N) up to 21 and \
             zeitlin_sphere(N) up to 12, without `want matrices`",
        )
}
