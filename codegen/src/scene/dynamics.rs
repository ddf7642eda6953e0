//! Mass matrix, inverse dynamics, and forces at rest, as functions beside the right-hand side.
//!
//! Does not know: how the balance of the equations is derived, lowered or emitted.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{Graph, Section, SymbolId};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{AtRest, Equations, Output};
use hamel_program::lower::Request;
use hamel_program::program::Role;

use super::derivatives::{Matrix, Product};

/// The role of the forces by accelerations.
pub(super) fn inverse_dynamics_role() -> Role {
    Role::Product(Want::InverseDynamics.name().to_owned())
}

/// What a scene has of `tau = A udot - f`.
#[derive(Default)]
pub(super) struct Dynamics {
    pub(super) outputs: Vec<Output>,
    pub(super) matrices: Vec<Matrix>,
    pub(super) products: Vec<Product>,
    pub(super) requests: Vec<Request>,
    pub(super) arguments: BTreeMap<Role, Vec<SymbolId>>,
    /// To come after the sections of the equations.
    pub(super) sections: Vec<Section>,
}

/// Why a function has no balance of forces that is solved for accelerations.
pub(super) fn unbalanced(equations: &Equations, want: Want) -> Error {
    let (what, possible) = match &equations.system.feedback {
        Some(own) => {
            let force = &own.actuator;
            (format!("beside the force `{force}` of an actuator"), format!("the force `{force}` as an input"))
        }
        None => (
            "of equations that are not solved for the rates of velocities".to_owned(),
            "velocities of the model as state; remove `carry`".to_owned(),
        ),
    };
    Error::Unsupported { what: format!("{} {what}", want.name()), possible }
}

/// The functions that are wanted, along the virtual displacements of the velocities `u` of the state.
///
/// # Errors
/// [`Error::Unsupported`] where the state has momenta, velocities along stages, or nothing is solved for accelerations;
/// [`Error::DivisionByZero`] where forces have no value at rest.
pub(super) fn find(g: &mut Graph, equations: &Equations, wanted: &BTreeSet<Want>) -> Result<Dynamics, Error> {
    let mut found = Dynamics::default();
    let Some(first) = wanted.first() else { return Ok(found) };
    let Some((system, balance)) = equations.balanced_system() else {
        return Err(unbalanced(equations, *first));
    };
    let names = &system.unknowns;
    let n = names.len();
    if wanted.contains(&Want::MassMatrix) {
        let (mut pattern, mut entries) = (Vec::new(), Vec::new());
        for (i, row) in system.mass_matrix.iter().enumerate() {
            for (j, e) in row.iter().enumerate().filter(|(_, e)| **e != g.zero()) {
                pattern.push((i, j));
                entries.push((format!("A_{}_{}", names[i], names[j]), *e));
            }
        }
        let want = Want::MassMatrix;
        let doc = "entries of the mass matrix `A` of `A udot = f` that do not vanish identically, row by row";
        found.outputs.push(Output::group(want, entries, doc));
        found.matrices.push(Matrix {
            name: want.name(),
            shape: (n, n),
            pattern,
            is_antisymmetric: false,
            doc: "mass matrix `A` of `A udot = f`, a row and a column for each velocity of the state that has a rate of \
                  its own",
        });
    }
    if wanted.contains(&Want::InverseDynamics) {
        let role = inverse_dynamics_role();
        let components: Vec<String> = names.iter().map(|name| format!("tau_{name}")).collect();
        let symbols = balance.accelerations.iter().map(|(symbol, _)| *symbol).take(n).collect();
        let results = components.iter().cloned().zip(balance.forces.iter().copied()).collect();
        found.requests.push(Request { role: role.clone(), results });
        found.arguments.insert(role, symbols);
        found.products.push(Product {
            name: Want::InverseDynamics.name(),
            vector: "a",
            n_vector: n,
            components,
            doc: format!(
                "forces `tau = A a - f` along the virtual displacements of the velocities {}, which have to act beside \
                 the model's for the rates of these to be `a`; no mass matrix is formed",
                names.join(", ")
            ),
        });
    }
    let at_rest = [
        (
            Want::Bias,
            AtRest::Accelerations,
            "forces that have to act beside the model's for the rates of velocities to vanish, `-f` of `A udot = f`",
        ),
        (
            Want::Gravity,
            AtRest::Velocities,
            "forces that have to act beside the model's to hold it at rest, at zero velocities and accelerations",
        ),
    ];
    for (want, at, doc) in at_rest.into_iter().filter(|(want, ..)| wanted.contains(want)) {
        // The balance was found above.
        let Some((forces, sections)) = equations.forces_at(g, at)? else { continue };
        let name = |name: &String| format!("{}_{name}", want.name());
        found.outputs.push(Output::group(want, names.iter().map(name).zip(forces).collect(), doc));
        found.sections.extend(sections);
    }
    Ok(found)
}
