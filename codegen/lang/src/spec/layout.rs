//! Names and order of the components of vectors and matrices.
//!
//! Deliberately does not know: what has components.

use super::names;
use super::value::Value;
use hamel_expr::{ExprId, Graph};

/// How the components of a parameter are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// `chi1, chi2, ..`, a vector.
    Vector(usize),
    /// `I1, I2, ..`, a diagonal matrix.
    Diagonal(usize),
    /// `G11, G12, .., G22, ..`, a symmetric matrix by its upper triangle.
    Symmetric(usize),
    /// `C11, C12, ..`, a matrix row by row.
    Matrix(usize, usize),
}

impl Layout {
    /// Names of the components; row and column are parted by `_` when one of them can have two digits.
    pub fn names(self, name: &str) -> Vec<String> {
        let pair = |i: usize, j: usize, n: usize, m: usize| {
            let parted = if n.max(m) > 9 { "_" } else { "" };
            format!("{name}{}{parted}{}", i + 1, j + 1)
        };
        match self {
            Layout::Vector(n) | Layout::Diagonal(n) => (1..=n).map(|i| format!("{name}{i}")).collect(),
            Layout::Symmetric(n) => (0..n).flat_map(|i| (i..n).map(move |j| pair(i, j, n, n))).collect(),
            Layout::Matrix(n, m) => (0..n).flat_map(|i| (0..m).map(move |j| pair(i, j, n, m))).collect(),
        }
    }

    /// Numbers of entries along the axes: one of a vector, rows and columns of a matrix.
    pub fn shape(self) -> Vec<usize> {
        match self {
            Layout::Vector(n) => vec![n],
            Layout::Diagonal(n) | Layout::Symmetric(n) => vec![n, n],
            Layout::Matrix(n, m) => vec![n, m],
        }
    }

    /// The component at each entry, row by row; none where it is zero.
    pub fn entries(self) -> Vec<Option<usize>> {
        match self {
            Layout::Vector(n) => (0..n).map(Some).collect(),
            Layout::Diagonal(n) => (0..n * n).map(|k| (k / n == k % n).then_some(k / n)).collect(),
            Layout::Symmetric(n) => {
                // Position of (i, j), i <= j, in the upper triangle.
                let at = |i: usize, j: usize| i * n - i * (i + 1) / 2 + j;
                (0..n * n).map(|k| Some(at((k / n).min(k % n), (k / n).max(k % n)))).collect()
            }
            Layout::Matrix(n, m) => (0..n * m).map(Some).collect(),
        }
    }

    pub(super) fn assemble(self, g: &mut Graph, c: &[ExprId]) -> Value {
        let entries = self.entries().into_iter().map(|at| at.map_or_else(|| g.zero(), |k| c[k])).collect();
        match self.shape().as_slice() {
            [rows, columns] => Value::Matrix { rows: *rows, columns: *columns, entries },
            _ => Value::Vector(entries),
        }
    }
}

/// `intro` and the first names of a list, for a help.
pub(super) fn short_list(intro: &str, names: &[String]) -> String {
    let shown: Vec<&str> = names.iter().take(12).map(String::as_str).collect();
    let more = if names.len() > 12 { ", .." } else { "" };
    if shown.is_empty() { String::new() } else { format!("{intro} {}{more}", names::list(&shown)) }
}

/// The names of components, for a help.
pub(super) fn component_help(names: &[String]) -> String {
    short_list("the components are", names)
}

/// Coordinates of a group that belong together.
#[derive(Clone)]
pub(super) struct GroupBlock {
    /// Position of the name in the text that they stand for.
    pub(super) of: usize,
    /// Their name as one value.
    pub(super) name: String,
    /// Their own names.
    pub(super) components: Vec<String>,
    /// The number of columns of a matrix; none for a vector or a number.
    pub(super) n_columns: Option<usize>,
}
