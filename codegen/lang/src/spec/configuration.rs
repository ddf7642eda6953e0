//! Elements of groups as coordinates of a checked model.
//!
//! Deliberately does not know: how they move.

use super::matrix_group::MatrixGroup;
use hamel_expr::SymbolId;

/// Coordinates in a group of matrices that everything may depend on: the trivial algebroid `G x g`, `g' = g xi` (left)
/// or `g' = xi g` (right). They are an advected parameter of the model as well, with that action.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// Name of the matrix.
    pub name: String,
    /// Its place in [`Model::advected`](super::Model::advected).
    pub advected: usize,
    /// Names of the coordinates: the matrix row by row, and the vectors of a semidirect product.
    pub names: Vec<String>,
    /// Their symbols.
    pub symbols: Vec<SymbolId>,
    /// The group.
    pub group: Box<MatrixGroup>,
    /// The elements of [`Model::algebra`](super::Model::algebra) for each element of the group's.
    pub velocities: Vec<usize>,
    /// The elements that move the frame that it is told in, `g' = g xi - eta g` (left); empty for space.
    pub relative: Vec<usize>,
}
