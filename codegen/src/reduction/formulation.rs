//! How a model is formulated before its equations are derived: everything that a scene or a search may choose.
//!
//! Does not know: how any choice is carried out.

use crate::expr::Rational;
use crate::spec::{Carried, CarriedBy, ConnectionKind, Model};

/// The choices that lead from a model to one [`ReducedSystem`](super::ReducedSystem) and its equations.
///
/// All of them describe the same motion, for the fixed parameters; they differ in state variables, in cost and in
/// rounding errors.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Formulation {
    /// Parameters that are numbers, by name: folded exactly before anything is derived.
    pub fixed: Vec<(String, Rational)>,
    /// The connection that is derived, with velocities `v = xi + A xdot`; none for the one that the model writes down.
    pub connection: Option<ConnectionKind>,
    /// Independent velocities, by index into base velocities, velocities in the algebra and quasi-velocities; none for
    /// those that are best to solve for.
    pub independent: Option<Vec<usize>>,
    /// Whether constraints that could be solved are kept with multipliers.
    pub multipliers: bool,
    /// Angles of the base that are carried as points of the circle.
    pub circles: Vec<String>,
    /// Whether squares of velocities in the Lagrangian are differentiated in the frame that turns with their
    /// components.
    pub squares: bool,
    /// Velocities for which the state carries a momentum, or a parameter is the momentum (Routh); none
    /// [by the velocity](CarriedBy::Velocity).
    pub momenta: Vec<Carried>,
    /// Whether the algebra is split along the model's chain of ideals.
    pub stages: bool,
}

impl Formulation {
    /// What a model's own items choose: its connection, independent velocities and stages, no parameter fixed, angles
    /// on the line.
    pub fn of(model: &Model) -> Formulation {
        Formulation {
            fixed: Vec::new(),
            connection: model.derived_connection,
            independent: model.independent.clone(),
            // A Hamiltonian has no need of independent velocities.
            multipliers: model.force_multipliers
                || model.hamiltonian.is_some() && !model.constraints.is_empty(),
            circles: Vec::new(),
            squares: true,
            momenta: carried_by_momenta(model, &[]),
            stages: model.stages.is_some(),
        }
    }
}

/// What is carried by momenta: what a model says, and what a scene says in its place.
///
/// A Hamiltonian is a function of all momenta, which are carried unless something else is said.
pub fn carried_by_momenta(model: &Model, of_scene: &[Carried]) -> Vec<Carried> {
    let mut momenta: Vec<Carried> = of_scene.to_vec();
    let of_hamiltonian = model.hamiltonian.map(|_| &model.momenta).into_iter().flatten();
    let of_hamiltonian = of_hamiltonian
        .flat_map(|m| &m.components)
        .map(|(name, _, velocity)| Carried { velocity: *velocity, by: CarriedBy::Momentum(name.clone()) });
    for carried in model.carries.iter().cloned().chain(of_hamiltonian) {
        if momenta.iter().all(|own| own.velocity != carried.velocity) {
            momenta.push(carried);
        }
    }
    momenta.retain(|carried| carried.by != CarriedBy::Velocity);
    momenta.sort_by_key(|carried| carried.velocity);
    momenta
}
