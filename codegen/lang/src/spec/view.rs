//! What figures show of a model: shapes in space, functions on the torus.
//!
//! Deliberately does not know: how they are declared, equations, pictures.

use std::collections::{BTreeMap, BTreeSet};

use super::diagnostic::Span;
use hamel_expr::{ExprId, Graph, SymbolId};

/// What a [`View`] draws; sizes in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum ViewShape {
    /// A cuboid along the axes of its frame.
    Box {
        /// Its lengths along them.
        edges: [ExprId; 3],
    },
    /// A disk about the third axis of its frame.
    Disk {
        /// Radius.
        radius: ExprId,
        /// Height along the axis.
        thickness: ExprId,
    },
    /// A ball with a pattern that shows how it turns.
    Ball {
        /// Radius.
        radius: ExprId,
    },
    /// A line between two points.
    Segment,
    /// A point.
    Point,
    /// The curve that a point leaves behind.
    Path,
    /// A function on the torus `[0, 2 pi)^2`, `f(x) = 2 sum (re_m cos(m.x) - im_m sin(m.x))` over these waves.
    Field {
        /// The waves `m`: half of those that the function has.
        waves: Vec<(i64, i64)>,
        /// Real and imaginary part of the Fourier coefficient of each wave.
        coefficients: Vec<ExprId>,
    },
}

/// A shape that a figure in space shows; its expressions live in [`Views::graph`].
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Name.
    pub name: String,
    /// What is drawn.
    pub shape: ViewShape,
    /// In space: the centre of a solid, both ends of a segment, or the point; none for a field.
    pub points: Vec<[ExprId; 3]>,
    /// From the shape's frame to space, by rows.
    pub rotation: [[ExprId; 3]; 3],
    /// Documentation.
    pub doc: String,
    /// Where its name stands.
    pub span: Option<Span>,
}

impl View {
    /// Sizes or coefficients, points and, for solids, the rotation by rows: what has to be known at an instant, in this
    /// order.
    pub fn numbers(&self) -> Vec<ExprId> {
        let (mut numbers, is_solid) = match &self.shape {
            ViewShape::Box { edges } => (edges.to_vec(), true),
            ViewShape::Disk { radius, thickness } => (vec![*radius, *thickness], true),
            ViewShape::Ball { radius } => (vec![*radius], true),
            ViewShape::Field { coefficients, .. } => (coefficients.clone(), false),
            ViewShape::Segment | ViewShape::Point | ViewShape::Path => (Vec::new(), false),
        };
        numbers.extend(self.points.iter().flatten());
        if is_solid {
            numbers.extend(self.rotation.iter().flatten());
        }
        numbers
    }
}

/// What figures in space show of a model. It has no part in equations and generated code.
#[derive(Clone, Debug, Default)]
pub struct Views {
    /// Owner of the expressions, apart from [`Model::graph`](super::Model::graph).
    pub graph: Graph,
    /// The views in the order of the text.
    pub list: Vec<View>,
}

impl Views {
    /// The numbers of a view, see [`View::numbers`], where the names in it have values; none where one has none.
    pub fn numbers_at(&self, view: &View, value: impl Fn(&str) -> Option<f64>) -> Option<Vec<f64>> {
        let numbers = view.numbers();
        let symbols: BTreeSet<SymbolId> = numbers.iter().flat_map(|e| self.graph.free_symbols(*e)).collect();
        let values: Option<BTreeMap<SymbolId, f64>> =
            symbols.into_iter().map(|s| Some((s, value(self.graph.name(s))?))).collect();
        let known = self.graph.eval_known(&numbers, &values?);
        numbers.iter().map(|e| known.get(e).copied()).collect()
    }
}
