//! What is compared with what, and what came of it.
//!
//! Does not know: how anything is compared.

use std::collections::BTreeMap;

use hamel_expr::SymbolId;
use hamel_lang::spec::Model;
use hamel_mechanics::mechanics::{Equations, GroupMap, Output};
use hamel_program::program::Program;

/// What is held to what.
pub(crate) struct Claim<'a> {
    pub(crate) model: &'a Model,
    /// Name of the scene.
    pub(crate) scene: &'a str,
    pub(crate) equations: &'a Equations,
    pub(crate) program: &'a Program,
    /// Symbols of the state, in the order of the program.
    pub(crate) state: Vec<SymbolId>,
    /// Whether rates are those in the time in which the motion is Hamiltonian.
    pub(crate) is_in_hamiltonian_time: bool,
    pub(crate) outputs: &'a [Output],
    pub(crate) matrices: Vec<MatrixClaim<'a>>,
    /// Names of the outputs of the model that a linearization observes.
    pub(crate) observed: Vec<String>,
    /// Number of equations between positions among the functions of positions.
    pub(crate) n_positions: usize,
    /// Which rows of the implicit form have a derivative.
    pub(crate) differential: Vec<bool>,
    /// Rows and columns of the entries of its Jacobian.
    pub(crate) implicit_pattern: &'a [(usize, usize)],
    /// The discrete equations, where the scene has them.
    pub(crate) discrete: Option<DiscreteClaim<'a>>,
    /// Number of points.
    pub(crate) n_points: usize,
}

/// Discrete equations: how the group moves, and where numbers stand.
pub(crate) struct DiscreteClaim<'a> {
    pub(crate) map: &'a GroupMap,
    pub(crate) n_unknowns: usize,
    pub(crate) pattern: &'a [(usize, usize)],
    /// The place among the unknowns of each component of the state.
    pub(crate) state: &'a [usize],
}

/// A matrix whose entries are an output.
pub(crate) struct MatrixClaim<'a> {
    pub(crate) name: &'a str,
    pub(crate) shape: (usize, usize),
    pub(crate) pattern: &'a [(usize, usize)],
    /// Components of the state that rows and columns of a bracket stand for.
    pub(crate) columns: Vec<usize>,
}

/// What was found: a scene has one, or an error.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Certificate {
    /// Number of points.
    pub n_points: usize,
    /// Functions that were held to their definitions, with the largest residual beside the terms of its row.
    pub held: BTreeMap<String, f64>,
    /// Functions that were not, with the reason.
    pub open: BTreeMap<String, String>,
}

impl Certificate {
    /// The largest residual of all functions.
    pub fn largest(&self) -> f64 {
        self.held.values().copied().fold(0.0, f64::max)
    }

    /// What was found, in a sentence for people.
    pub fn sentence(&self) -> String {
        let n = self.held.len();
        if self.n_points == 0 {
            let reasons: Vec<String> = self.open.iter().map(|(f, why)| format!("{f}, {why}")).collect();
            return format!("Not held to its definition: {}.", reasons.join("; "));
        }
        let plural = |n: usize| if n == 1 { "" } else { "s" };
        let open: Vec<&str> = self.open.keys().map(String::as_str).collect();
        let but = if open.is_empty() { String::new() } else { format!("; not held: {}", open.join(", ")) };
        let points = self.n_points;
        format!("Held to its definition at {points} point{}: {n} function{}{but}.", plural(points), plural(n))
    }

    /// The sentence, and a line for each function.
    pub fn table(&self) -> String {
        let mut text = format!("{}\n", self.sentence());
        let names = self.held.keys().chain(self.open.keys());
        let width = names.map(|name| name.chars().count()).max().unwrap_or(0);
        for (name, residual) in &self.held {
            text.push_str(&format!("  {name:width$}  {residual:.1e} of its terms\n"));
        }
        for (name, reason) in &self.open {
            text.push_str(&format!("  {name:width$}  not held: {reason}\n"));
        }
        text
    }
}
