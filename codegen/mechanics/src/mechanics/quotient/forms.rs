//! Constraints on velocities and on displacements as linear forms.
//!
//! Does not know: maps of systems.

use hamel_expr::{ExprId, Graph, independent_rows};

use crate::reduction::{AccelerationSource, KinematicConstraint, ReducedSystem};

/// `a . y + b . s + c = 0` with velocities `y` and quasi-velocities `s`: `y` is allowed where there is some `s`.
#[derive(Clone, Debug)]
pub(super) struct Form {
    /// The constraint as written, or its name.
    pub(super) text: String,
    /// `a`.
    pub(super) velocities: Vec<ExprId>,
    /// `b`.
    pub(super) quasi: Vec<ExprId>,
    /// `c`.
    pub(super) offset: ExprId,
}

/// The velocities that constraints allow: linear forms, and functions of velocities that are not linear, with their
/// texts.
pub(super) fn allowed(g: &mut Graph, system: &ReducedSystem) -> (Vec<Form>, Vec<(String, ExprId)>) {
    let (mut forms, mut functions) = (Vec::new(), Vec::new());
    match &system.constraint {
        KinematicConstraint::Solved(solved) => forms.extend(solved.rows.iter().map(|row| {
            let (velocities, quasi) = row.one_form.split_at(system.velocities.len());
            let (velocities, quasi) = (velocities.to_vec(), quasi.to_vec());
            Form { text: row.text.clone(), velocities, quasi, offset: row.offset }
        })),
        KinematicConstraint::Multipliers { rows, .. } => {
            for row in rows {
                let AccelerationSource::Differentiated(residual) = row.source else { continue };
                let text = row.text.clone();
                match g.affine_parts(residual, &system.velocities) {
                    Some((velocities, offset)) => {
                        forms.push(Form { text, velocities, quasi: Vec::new(), offset })
                    }
                    None => functions.push((text, residual)),
                }
            }
        }
    }
    (forms, functions)
}

/// Forms that vanish on the displacements.
pub(super) fn reactions(g: &mut Graph, system: &ReducedSystem) -> Vec<Form> {
    let offset = g.zero();
    let of_forms = |forms: &[Vec<ExprId>]| {
        let form = |form: &Vec<ExprId>| {
            let (velocities, quasi) = form.split_at(system.velocities.len());
            let (velocities, quasi) = (velocities.to_vec(), quasi.to_vec());
            Form { text: String::new(), velocities, quasi, offset }
        };
        forms.iter().map(form).collect()
    };
    match &system.constraint {
        // The constraints, by Chetaev's rule.
        KinematicConstraint::Solved(solved) if solved.psi == solved.virtual_displacements => {
            let (forms, _) = allowed(g, system);
            forms.into_iter().map(|form| Form { offset, ..form }).collect()
        }
        KinematicConstraint::Solved(solved) => of_forms(&solved.reactions.one_forms),
        KinematicConstraint::Multipliers { reactions, .. } => of_forms(reactions),
    }
}

/// The dimension of the kernel of forms among velocities, whatever the quasi-velocities are.
pub(super) fn dimension(g: &Graph, forms: &[Form], n_velocities: usize) -> usize {
    let rows: Vec<Vec<ExprId>> =
        forms.iter().map(|form| [form.velocities.as_slice(), &form.quasi].concat()).collect();
    let quasi: Vec<Vec<ExprId>> = forms.iter().map(|form| form.quasi.clone()).collect();
    n_velocities + independent_rows(g, &quasi).len() - independent_rows(g, &rows).len()
}
