//! What the variables of a state are, and the values that a model gives them.
//!
//! Does not know: scenes' states, who evaluates anything.

use std::collections::BTreeMap;

use hamel_codegen::expr::rational_to_f64;
use hamel_codegen::spec::{Domain, ReconstructionKind, circle_names};
use serde::{Deserialize, Serialize};

use super::{Model, RECONSTRUCTION_SCENE, group_coordinates};

/// What a state variable is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Role {
    /// A coordinate in an open interval.
    Bounded {
        /// Lower end.
        from: f64,
        /// Upper end.
        to: f64,
    },
    /// An angle or a coordinate on the real line.
    Unbounded,
    /// A velocity or a momentum.
    Velocity,
    /// A coordinate of the group.
    Group {
        /// Its value at the identity.
        identity: f64,
    },
    /// A component of an advected parameter.
    Advected {
        /// Which component.
        index: usize,
        /// Of how many.
        n: usize,
    },
}

/// Values of all parameters of a model: its defaults, what a scene fixes, and `given`.
pub fn all_params(model: &Model, scene_name: &str, given: &BTreeMap<String, f64>) -> BTreeMap<String, f64> {
    let mut values: BTreeMap<String, f64> =
        model.params.iter().map(|p| (p.name.clone(), rational_to_f64(&p.default))).collect();
    for scene in model.scenes.iter().filter(|s| s.name == scene_name) {
        values.extend(scene.fixed.iter().map(|(name, value)| (name.clone(), rational_to_f64(value))));
    }
    values.extend(given.iter().map(|(name, value)| (name.clone(), *value)));
    values
}

/// What the possible state variables of a model are.
pub fn roles(model: &Model, params: &BTreeMap<String, f64>) -> BTreeMap<String, Role> {
    let symbols = model.params.iter().filter_map(|p| Some((p.symbol, *params.get(&p.name)?))).collect();
    let mut roles = BTreeMap::new();
    let role_in = |domain| match domain {
        Domain::Interval(from, to) => {
            match (model.graph.eval_f64(from, &symbols), model.graph.eval_f64(to, &symbols)) {
                (Some(from), Some(to)) => Role::Bounded { from, to },
                _ => Role::Unbounded,
            }
        }
        Domain::Angle | Domain::Real => Role::Unbounded,
    };
    for state in &model.first_order {
        roles.extend(state.components.iter().map(|(name, _)| (name.clone(), role_in(state.domain))));
    }
    for coordinate in &model.base {
        roles.insert(coordinate.name.clone(), role_in(coordinate.domain));
        // A scene may carry it as a point of the circle.
        for (index, name) in circle_names(&coordinate.name).into_iter().enumerate() {
            roles.insert(name, Role::Advected { index, n: 2 });
        }
    }
    for (name, _) in model.all_velocities() {
        roles.insert(name.to_owned(), Role::Velocity);
    }
    for velocity in &model.quasi_velocities {
        roles.insert(velocity.name.clone(), Role::Velocity);
    }
    // They are chosen like velocities where they do not follow from these.
    for (name, ..) in model.momenta.iter().flat_map(|momentum| &momentum.components) {
        roles.insert(name.clone(), Role::Velocity);
    }
    for item in &model.reconstruction {
        for (k, name) in item.names.iter().enumerate() {
            let is_one = match &item.kind {
                ReconstructionKind::Quaternion { .. } | ReconstructionKind::Pose { .. } => k == 0,
                ReconstructionKind::Matrix { group, .. } => {
                    k < group.n() * group.n() && k.is_multiple_of(group.n() + 1)
                }
                _ => false,
            };
            let identity = if is_one { 1.0 } else { 0.0 };
            roles.insert(name.clone(), Role::Group { identity });
        }
    }
    for advected in &model.advected {
        let n = advected.components.len();
        for (index, (name, _)) in advected.components.iter().enumerate() {
            roles.insert(name.clone(), Role::Advected { index, n });
        }
    }
    roles
}

/// Where the coordinates of the group start, in the order of [`group_coordinates`]: as the model's `initial` says,
/// otherwise at the identity.
pub fn group_start(model: &Model, params: &BTreeMap<String, f64>) -> Vec<f64> {
    let params = all_params(model, RECONSTRUCTION_SCENE, params);
    let (roles, preferred) = (roles(model, &params), initial_values(model, &params));
    let start = |name: &String| match (preferred.get(name), roles.get(name)) {
        (Some(value), _) => *value,
        (None, Some(Role::Group { identity })) => *identity,
        (None, _) => 0.0,
    };
    group_coordinates(model).iter().map(start).collect()
}

/// The initial values that a model gives, those of angles also as points of the circle.
pub fn initial_values(model: &Model, params: &BTreeMap<String, f64>) -> BTreeMap<String, f64> {
    let symbols = model.params.iter().filter_map(|p| Some((p.symbol, *params.get(&p.name)?))).collect();
    let value = |e| model.graph.eval_f64(e, &symbols).filter(|x| x.is_finite());
    let given = model.initial.iter().filter_map(|(name, e)| Some((name.clone(), value(*e)?)));
    let mut values: BTreeMap<String, f64> = given.collect();
    for coordinate in &model.base {
        let middle = || match coordinate.domain {
            Domain::Interval(from, to) => Some((value(from)? + value(to)?) / 2.0),
            Domain::Angle | Domain::Real => None,
        };
        if let Some(angle) = values.get(&coordinate.name).copied().or_else(middle) {
            values.extend(circle_names(&coordinate.name).into_iter().zip([angle.cos(), angle.sin()]));
        }
    }
    values
}
