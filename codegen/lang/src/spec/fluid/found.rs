//! Where a file has the momenta of a fluid of matrices and the fields that it carries, and which sizes there are.
//!
//! Does not know: everything else in the file.

use super::super::ast::{AlgebraExpr, AlgebraNode, File, Item, ItemKind, Name, Node};
use super::super::diagnostic::Span;
use super::super::limits::MAX_MATRIX;
use super::super::want::Want;
use super::waves::FluidSurface;

/// The momenta of a fluid in an algebra of functions.
#[derive(Clone, Copy)]
pub(super) struct Momenta<'a> {
    pub(super) item: &'a Item,
    pub(super) names: &'a [Name],
    pub(super) labels: &'a [Name],
    pub(super) surface: FluidSurface,
    pub(super) n: usize,
    /// The name of the algebra, where it has one.
    pub(super) algebra: Option<&'a str>,
}

/// A function in the algebra of a fluid, which the flow carries.
#[derive(Clone, Copy)]
pub(super) struct Carried<'a> {
    pub(super) item: &'a Item,
    pub(super) name: &'a Name,
    /// What the names of its components begin with, none where they have no names of the basis.
    pub(super) label: Option<&'a Name>,
    /// Whether it is said to be carried by `ad`, which needs all of the adjoint representation in equations.
    pub(super) is_adjoint: bool,
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

pub(super) fn momenta(file: &File) -> Option<Momenta<'_>> {
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

/// The functions in the algebra of the momenta that the flow carries, in the order of the file.
pub(super) fn carried<'a>(file: &'a File, momenta: &Momenta<'_>) -> Vec<Carried<'a>> {
    let is_of_fluid = |space: &AlgebraExpr| match &space.node {
        AlgebraNode::Name(name) => Some(name.as_str()) == momenta.algebra,
        _ => surface_of(space) == Some((momenta.surface, momenta.n)),
    };
    let of = |item: &'a Item| match &item.kind {
        ItemKind::Advected { name, space, labels, action } => {
            let Node::Name(by) = &action.node else { return None };
            let is_adjoint = by == "ad";
            let is_bracket = is_adjoint || by == "functions";
            (is_bracket && is_of_fluid(space)).then_some(Carried {
                item,
                name,
                label: labels.first(),
                is_adjoint,
            })
        }
        _ => None,
    };
    file.items.iter().filter_map(of).collect()
}

/// Where a scene wants matrices.
pub(super) fn wanted(file: &File) -> Option<Span> {
    file.items.iter().find_map(|item| match &item.kind {
        ItemKind::Scene { wants, .. } => {
            wants.iter().find(|want| want.text == Want::Matrices.name()).map(|want| want.span)
        }
        _ => None,
    })
}

/// Whether matrices of that size exist.
pub(super) fn exists(surface: FluidSurface, n: usize) -> bool {
    match surface {
        FluidSurface::Torus => (3..=MAX_MATRIX).contains(&n) && !n.is_multiple_of(2),
        FluidSurface::Sphere => (2..=MAX_MATRIX).contains(&n),
    }
}

/// Sizes for which matrices exist.
pub(super) fn sizes(surface: FluidSurface) -> String {
    match surface {
        FluidSurface::Torus => format!("odd numbers from 3 to {}", MAX_MATRIX - 1),
        FluidSurface::Sphere => format!("numbers from 2 to {MAX_MATRIX}"),
    }
}

/// The energy of a fluid as a model has it; an algebra without a name is that of the velocities.
pub(super) fn energy_text(surface: FluidSurface, algebra: &str, omega: &str) -> String {
    let factor = match surface {
        FluidSurface::Torus => "-",
        FluidSurface::Sphere => "-1/2*",
    };
    format!("{factor}dot({omega}, laplacian({algebra})^-1*{omega})")
}
