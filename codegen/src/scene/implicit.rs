//! The implicit form that a scene can want, as functions beside its right-hand side.
//!
//! Deliberately does not know: how the form is derived, lowered or emitted.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{Graph, Section, SectionWriter, SymbolId};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{Equations, ImplicitVariable, Output, StateEquation, implicit_form};
use hamel_program::lower::Request;
use hamel_program::program::Role;

/// Name of the function `f(t, z)`.
pub(super) const RIGHT_SIDE: &str = "implicit_rhs";
/// Name of the function of the entries of `df/dz`, and of that matrix.
pub(super) const JACOBIAN: &str = "implicit_jacobian";

/// The implicit form of a scene: `M z' = f(t, z)`.
#[derive(Clone, Debug)]
pub struct Implicit {
    /// The variables `z` in order, each with its row.
    pub variables: Vec<ImplicitVariable>,
    /// The differential index.
    pub index: usize,
    /// The index of the equations with all momenta and multipliers.
    pub pontryagin_index: usize,
    /// Row and column of each entry of `df/dz` that does not vanish identically.
    pub pattern: Vec<(usize, usize)>,
    /// The place among the variables of each component of the state.
    pub state: Vec<usize>,
}

/// The role of `f(t, z)`.
pub(super) fn right_side() -> Role {
    Role::OfVariables(RIGHT_SIDE.to_owned())
}

/// The role of the entries of `df/dz`.
pub(super) fn jacobian() -> Role {
    Role::OfVariables(JACOBIAN.to_owned())
}

/// The implicit form, and what has to be lowered for it.
pub(super) struct Found {
    pub(super) implicit: Implicit,
    /// The variables at a state.
    pub(super) output: Output,
    pub(super) requests: [Request; 2],
    pub(super) arguments: BTreeMap<Role, Vec<SymbolId>>,
    /// To come after the sections of the equations.
    pub(super) sections: Vec<Section>,
}

/// The implicit form of the motion of `state`.
///
/// # Errors
/// As [`implicit_form`]; [`Error::Unsupported`] where a component of the state is no variable of it.
pub(super) fn find(g: &mut Graph, equations: &Equations, state: &[StateEquation]) -> Result<Found, Error> {
    if let Some(own) = &equations.system.feedback {
        return Err(Error::Unsupported {
            what: format!("the implicit form beside the force `{}` of an actuator", own.actuator),
            possible: "`rhs`, where the factor of the force is divided out".into(),
        });
    }
    let form = implicit_form(g, equations, state)?;
    let places = (0..state.len()).map(|k| {
        let place = form.variables.iter().position(|v| v.state == Some(k));
        place.ok_or_else(|| Error::Unsupported {
            what: format!("the implicit form with {} as state", state[k].name),
            possible: "velocities of the model as state".into(),
        })
    });
    let places = places.collect::<Result<Vec<usize>, Error>>()?;
    let mut writer = SectionWriter::new(g, BTreeSet::new(), &[]);
    let entries = form.jacobian(g, &mut writer);
    let symbols: Vec<SymbolId> = form.variables.iter().map(|v| v.symbol).collect();
    let values = form.variables.iter().map(|v| (v.name.clone(), v.value)).collect();
    let rows = form.variables.iter().map(|v| (format!("f_{}", v.name), v.right)).collect();
    let pattern = entries.iter().map(|(place, ..)| *place).collect();
    let entries = entries.into_iter().map(|(_, name, e)| (name, e)).collect();
    let mut sections = form.sections;
    sections.extend(writer.finish().0);
    let doc = "variables `z` of the implicit form `M z' = f(t, z)` at the state: consistent initial values";
    Ok(Found {
        output: Output::group(Want::Implicit, values, doc),
        requests: [
            Request { role: right_side(), results: rows },
            Request { role: jacobian(), results: entries },
        ],
        arguments: BTreeMap::from([(right_side(), symbols.clone()), (jacobian(), symbols)]),
        sections,
        implicit: Implicit {
            variables: form.variables,
            index: form.index,
            pontryagin_index: form.pontryagin_index,
            pattern,
            state: places,
        },
    })
}
