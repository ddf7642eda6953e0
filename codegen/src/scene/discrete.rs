//! The discrete equations that a scene can have, as functions beside its right-hand side.
//!
//! Deliberately does not know: how they are derived, lowered or emitted, how steps are solved.

use std::collections::BTreeMap;

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::algebra::{Matrix, Representation};
use hamel_lang::spec::{self, Model, Retraction};
use hamel_mechanics::mechanics::{
    DiscreteSetting, DiscreteUnknown, Equations, GroupMap, StateEquation, discrete_equations, row_name,
};
use hamel_program::lower::Request;
use hamel_program::program::{Function, Role};

/// Name of the function of first values of the unknowns.
pub(super) const START: &str = "discrete_start";
/// Name of the function of the rows.
pub(super) const RESIDUAL: &str = "discrete_residual";
/// Name of the function of the entries of their derivatives, and of that matrix.
pub(super) const JACOBIAN: &str = "discrete_jacobian";

/// What a model says about its group, as far as discrete equations ask.
#[derive(Clone, Debug)]
pub(super) struct Asked {
    n_shape: usize,
    standard: Option<Vec<Matrix>>,
    retraction: Option<Retraction>,
}

impl Asked {
    /// Of a scene's words.
    pub(super) fn of(model: &Model, discrete: spec::Discrete) -> Asked {
        let standard = Representation::standard(&model.algebra);
        let matrices = |found: &Representation| {
            (0..found.n_generators()).map(|a| found.matrix(a).clone()).collect::<Vec<Matrix>>()
        };
        let standard = standard.as_ref().map(matrices).filter(|list| list.len() == model.velocities.len());
        Asked { n_shape: model.n_shape(), standard, retraction: discrete.retraction }
    }
}

/// The discrete equations of a scene: one step from a state to the next, for the variables `(h, state, unknowns)`.
#[derive(Clone, Debug)]
pub struct Discrete {
    /// Names of the unknowns.
    pub unknowns: Vec<String>,
    /// Row and column of each derivative of a row by an unknown that does not vanish identically.
    pub pattern: Vec<(usize, usize)>,
    /// The place among the unknowns of each component of the state at the end.
    pub state: Vec<usize>,
    /// How the group moves.
    pub map: GroupMap,
}

/// Where the numbers of discrete equations stand.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DiscreteLayout {
    /// Number of unknowns, and of rows.
    pub n_unknowns: usize,
    /// Row and column of each derivative of a row by an unknown that does not vanish identically.
    pub pattern: Vec<(usize, usize)>,
    /// The place among the unknowns of each component of the state at the end.
    pub state: Vec<usize>,
}

impl DiscreteLayout {
    /// Whether functions have the sizes with which they are read, for so many components of the state.
    pub(super) fn fits(&self, functions: [Option<&Function>; 3], n_state: usize) -> bool {
        let n = self.n_unknowns;
        let sizes = [n, n, self.pattern.len()];
        let is_inside = |k: &usize| *k < n;
        self.state.len() == n_state
            && self.state.iter().all(is_inside)
            && self.pattern.iter().all(|(i, j)| is_inside(i) && is_inside(j))
            && functions.into_iter().zip(sizes).all(|(function, size)| {
                function.is_some_and(|f| f.results.len() == size && f.argument.len() == 1 + n_state + n)
            })
    }
}

/// A function of discrete equations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DiscretePart {
    /// First values of the unknowns.
    Start,
    /// The rows.
    Residual,
    /// The entries of their derivatives.
    Jacobian,
}

impl DiscretePart {
    /// The role of the function.
    pub(super) fn role(self) -> Role {
        let name = match self {
            DiscretePart::Start => START,
            DiscretePart::Residual => RESIDUAL,
            DiscretePart::Jacobian => JACOBIAN,
        };
        Role::OfVariables(name.to_owned())
    }
}

/// The roles of the first values, the rows and their derivatives.
pub(super) fn roles() -> [Role; 3] {
    [DiscretePart::Start, DiscretePart::Residual, DiscretePart::Jacobian].map(DiscretePart::role)
}

/// The equations, and the functions to be lowered.
pub(super) struct Found {
    pub(super) discrete: Discrete,
    pub(super) requests: Vec<Request>,
    pub(super) arguments: BTreeMap<Role, Vec<SymbolId>>,
}

/// The discrete equations of the motion of `state`.
///
/// # Errors
/// As [`discrete_equations`].
pub(super) fn find(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    asked: &Asked,
) -> Result<Found, Error> {
    let Asked { n_shape, standard, retraction } = asked;
    let setting =
        DiscreteSetting { n_shape: *n_shape, standard: standard.as_deref(), retraction: *retraction };
    let found = discrete_equations(g, equations, state, &setting)?;
    let entries = found.jacobian(g);
    let variables: Vec<SymbolId> = std::iter::once(found.step)
        .chain(found.start.iter().copied())
        .chain(found.unknowns.iter().map(|u| u.symbol))
        .collect();
    let values = |of: &dyn Fn(&DiscreteUnknown) -> (String, ExprId)| found.unknowns.iter().map(of).collect();
    let results: [Vec<(String, ExprId)>; 3] = [
        values(&|u| (u.name.clone(), u.guess)),
        values(&|u| (row_name(&u.name), u.residual)),
        entries.iter().map(|(_, name, e)| (name.clone(), *e)).collect(),
    ];
    let requests =
        roles().into_iter().zip(results).map(|(role, results)| Request { role, results }).collect();
    Ok(Found {
        requests,
        arguments: roles().into_iter().map(|role| (role, variables.clone())).collect(),
        discrete: Discrete {
            unknowns: found.unknowns.iter().map(|u| u.name.clone()).collect(),
            pattern: entries.into_iter().map(|(place, ..)| place).collect(),
            state: found.state,
            map: found.map,
        },
    })
}
