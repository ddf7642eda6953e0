//! A motion that the model gives: velocities that are functions of the base, and accelerations of the others.
//!
//! Does not know: how the motion is used, where the algebroid came from.

use hamel_expr::ExprId;
use hamel_lang::spec::{Given, Model};

use super::constraint::{KinematicConstraint, Reactions, SolvedConstraint, frame_unknowns};

/// The velocities that are functions of the base as dependent ones, `y = Psi u + psi0` with the other velocities `u`;
/// nothing restricts displacements, and nothing reacts.
pub(super) fn as_constraint(model: &Model, given: &[Given]) -> KinematicConstraint {
    let (zero, one) = (model.graph.zero(), model.graph.one());
    let is_free = |k: &usize| matches!(given[*k], Given::Acceleration(_));
    let free: Vec<usize> = (0..given.len()).filter(is_free).collect();
    let psi: Vec<Vec<ExprId>> = (0..given.len())
        .map(|alpha| free.iter().map(|k| if *k == alpha { one } else { zero }).collect())
        .collect();
    let psi0 = given.iter().map(|given| match given {
        Given::Velocity(value) => *value,
        Given::Acceleration(_) => zero,
    });
    let unknowns = frame_unknowns(model).into_iter().enumerate();
    KinematicConstraint::Solved(SolvedConstraint {
        unknowns: unknowns.filter(|(k, _)| free.contains(k)).map(|(_, u)| u).collect(),
        dependent: (0..given.len()).filter(|k| !is_free(k)).collect(),
        psi0: psi0.collect(),
        virtual_displacements: psi.clone(),
        psi,
        reactions: Reactions { names: Vec::new(), one_forms: Vec::new(), on: Vec::new() },
        rows: Vec::new(),
        pivots: Vec::new(),
        response: None,
    })
}

/// The accelerations, in the order of the unknowns.
pub(super) fn accelerations(given: &[Given]) -> Vec<ExprId> {
    let rates = given.iter().filter_map(|given| match given {
        Given::Acceleration(rate) => Some(*rate),
        Given::Velocity(_) => None,
    });
    rates.collect()
}
