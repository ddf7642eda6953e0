//! What the variables of a state are, and the values that a model gives them, by the names of the command line.
//!
//! Does not know: scenes' states, who evaluates anything.

use std::collections::BTreeMap;

pub use hamel_codegen::scene::{VariableRole as Role, all_params, initial_values, variable_roles as roles};

use super::{Model, RECONSTRUCTION_SCENE, group_coordinates};

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
