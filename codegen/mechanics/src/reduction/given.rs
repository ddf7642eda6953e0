//! A motion that the model gives: velocities that are functions of the base, velocities that constraints give by these,
//! and accelerations of the others.
//!
//! Does not know: how the motion is used, where the algebroid came from.

use std::collections::BTreeMap;

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Sign};
use hamel_lang::spec::{Given, Model};

use super::constraint::{
    ConstraintRow, KinematicConstraint, Reactions, SolvedConstraint, frame_unknowns, solved_with,
};

/// The velocities that are functions of the base as dependent ones, `y = Psi u + psi0` with the other velocities `u`;
/// nothing restricts displacements, and nothing reacts.
///
/// # Errors
/// Constraints beside these velocities that depend on each other, contradict each other or leave a velocity open.
pub(super) fn as_constraint(
    model: &mut Model,
    given: &[Given],
    signs: &BTreeMap<ExprId, Sign>,
) -> Result<KinematicConstraint, Error> {
    if given.contains(&Given::Constrained) {
        return kinematic(model, given, signs);
    }
    let (zero, one) = (model.graph.zero(), model.graph.one());
    let is_free = |k: &usize| matches!(given[*k], Given::Acceleration(_));
    let free: Vec<usize> = (0..given.len()).filter(is_free).collect();
    let psi: Vec<Vec<ExprId>> = (0..given.len())
        .map(|alpha| free.iter().map(|k| if *k == alpha { one } else { zero }).collect())
        .collect();
    let psi0 = given.iter().map(|given| match given {
        Given::Velocity(value) => *value,
        Given::Acceleration(_) | Given::Constrained => zero,
    });
    let unknowns = frame_unknowns(model).into_iter().enumerate();
    Ok(KinematicConstraint::Solved(SolvedConstraint {
        unknowns: unknowns.filter(|(k, _)| free.contains(k)).map(|(_, u)| u).collect(),
        dependent: (0..given.len()).filter(|k| !is_free(k)).collect(),
        psi0: psi0.collect(),
        virtual_displacements: psi.clone(),
        psi,
        reactions: Reactions { names: Vec::new(), one_forms: Vec::new(), on: Vec::new() },
        rows: Vec::new(),
        pivots: Vec::new(),
        response: None,
    }))
}

/// Fields and constraints together, solved for all velocities.
fn kinematic(
    model: &mut Model,
    given: &[Given],
    signs: &BTreeMap<ExprId, Sign>,
) -> Result<KinematicConstraint, Error> {
    let (zero, one) = (model.graph.zero(), model.graph.one());
    let names: Vec<String> = frame_unknowns(model).into_iter().map(|u| u.name).collect();
    let mut fields = Vec::new();
    for (k, own) in given.iter().enumerate() {
        let Given::Velocity(value) = own else { continue };
        let one_form = (0..names.len()).map(|j| if j == k { one } else { zero }).collect();
        let (name, text) = (format!("field_{}", names[k]), format!("field {}", names[k]));
        let offset = model.graph.neg(*value);
        fields.push(ConstraintRow { name, text, one_form, offset, written: None });
    }
    let mut solved = solved_with(model, fields, signs)?;
    let open = (0..names.len()).find(|k| !solved.dependent.contains(k));
    if let Some(k) = open {
        return Err(Error::Unsupported {
            what: format!("constraints that leave `{}` open beside fields", names[k]),
            possible: "one equation for each velocity without a field".into(),
        });
    }
    solved.reactions = Reactions { names: Vec::new(), one_forms: Vec::new(), on: Vec::new() };
    Ok(KinematicConstraint::Solved(solved))
}

/// The accelerations, in the order of the unknowns.
pub(super) fn accelerations(given: &[Given]) -> Vec<ExprId> {
    let rates = given.iter().filter_map(|given| match given {
        Given::Acceleration(rate) => Some(*rate),
        Given::Velocity(_) | Given::Constrained => None,
    });
    rates.collect()
}
