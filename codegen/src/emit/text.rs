//! What the documentation of a scene says, as plain data.
//!
//! Does not know: programs beyond the roles of their functions, any language.

use std::collections::BTreeMap;

use crate::expr::Rational;
use crate::program::Role;

/// What the documentation of a scene says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SceneText {
    /// Name of the model.
    pub model: String,
    /// Name of the scene.
    pub scene: String,
    /// What the first line says after the version: the command that writes the file again, or what to edit instead.
    pub command: String,
    /// Path of the runtime in the crate that the module is for; empty for `::hamel_runtime`.
    pub runtime: String,
    /// What the system is, a paragraph.
    pub doc: Vec<String>,
    /// Where the equations come from.
    pub sources: Vec<String>,
    /// Parameters in the order of the program.
    pub params: Vec<ParamText>,
    /// Components of the state in the order of the program.
    pub state: Vec<StateText>,
    /// Outputs, the functions [`Role::Output`] of the program.
    pub outputs: Vec<OutputText>,
    /// Outputs that are the entries of a matrix.
    pub matrices: Vec<MatrixText>,
    /// Functions of a vector besides time and state.
    pub products: Vec<ProductText>,
    /// Formula lines of functions, by role.
    pub formulas: BTreeMap<Role, Vec<String>>,
    /// Whether the energy is proved to be constant along the motion.
    pub conserves_energy: bool,
}

/// A parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamText {
    /// Name.
    pub name: String,
    /// Value of the scene as published.
    pub default: Rational,
    /// Meaning and unit.
    pub doc: String,
}

/// A component of the state.
#[derive(Clone, Debug, PartialEq)]
pub struct StateText {
    /// Name.
    pub name: String,
    /// Meaning and unit.
    pub doc: String,
}

/// An output.
#[derive(Clone, Debug, PartialEq)]
pub struct OutputText {
    /// Name of the output and of its function.
    pub name: String,
    /// Names of the components; a scalar has one.
    pub components: Vec<String>,
    /// Meaning and unit.
    pub doc: String,
}

/// A matrix, the output of the same name being its entries.
#[derive(Clone, Debug, PartialEq)]
pub struct MatrixText {
    /// Name of the matrix and of its output.
    pub name: String,
    /// Numbers of rows and columns.
    pub shape: (usize, usize),
    /// Row and column of each entry; the others are zero.
    pub pattern: Vec<(usize, usize)>,
    /// Meaning.
    pub doc: String,
}

/// A function that takes a vector besides time and state.
#[derive(Clone, Debug, PartialEq)]
pub struct ProductText {
    /// Name of the product and of its function, [`Role::Product`].
    pub name: String,
    /// Name of the vector.
    pub vector: String,
    /// Names of the results.
    pub components: Vec<String>,
    /// Meaning.
    pub doc: String,
}
