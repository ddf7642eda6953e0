//! What the variables of a state are, and the values that a model gives them.
//!
//! Does not know: scenes' states, who evaluates anything, what an initial state has to satisfy.

use std::collections::BTreeMap;

use hamel_expr::rational_to_f64;
use hamel_lang::spec::{Domain, Model, ReconstructionKind, circle_names};

/// What a state variable is.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum VariableRole {
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
    /// One while a mode is on, and zero otherwise.
    Mode,
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
pub fn variable_roles(model: &Model, params: &BTreeMap<String, f64>) -> BTreeMap<String, VariableRole> {
    let symbols = model.params.iter().filter_map(|p| Some((p.symbol, *params.get(&p.name)?))).collect();
    let mut roles = BTreeMap::new();
    let role_in = |domain| match domain {
        Domain::Interval(from, to) => {
            match (model.graph.eval_f64(from, &symbols), model.graph.eval_f64(to, &symbols)) {
                (Some(from), Some(to)) => VariableRole::Bounded { from, to },
                _ => VariableRole::Unbounded,
            }
        }
        Domain::Angle | Domain::Real => VariableRole::Unbounded,
    };
    for state in &model.first_order {
        roles.extend(state.components.iter().map(|(name, _)| (name.clone(), role_in(state.domain))));
    }
    roles.extend(model.modes.iter().map(|mode| (mode.name.clone(), VariableRole::Mode)));
    for coordinate in &model.base {
        roles.insert(coordinate.name.clone(), role_in(coordinate.domain));
        // A scene may carry it as a point of the circle.
        for (index, name) in circle_names(&coordinate.name).into_iter().enumerate() {
            roles.insert(name, VariableRole::Advected { index, n: 2 });
        }
    }
    for (name, _) in model.all_velocities() {
        roles.insert(name.to_owned(), VariableRole::Velocity);
    }
    for velocity in &model.quasi_velocities {
        roles.insert(velocity.name.clone(), VariableRole::Velocity);
    }
    // They are chosen like velocities where they do not follow from these.
    for (name, ..) in model.momenta.iter().flat_map(|momentum| &momentum.components) {
        roles.insert(name.clone(), VariableRole::Velocity);
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
            roles.insert(name.clone(), VariableRole::Group { identity });
        }
    }
    for advected in &model.advected {
        let n = advected.components.len();
        for (index, (name, _)) in advected.components.iter().enumerate() {
            roles.insert(name.clone(), VariableRole::Advected { index, n });
        }
    }
    roles
}

/// The initial values that a model gives, those of angles also as points of the circle.
pub fn initial_values(model: &Model, params: &BTreeMap<String, f64>) -> BTreeMap<String, f64> {
    let symbols = model.params.iter().filter_map(|p| Some((p.symbol, *params.get(&p.name)?))).collect();
    let value = |e| model.graph.eval_f64(e, &symbols).filter(|x| x.is_finite());
    let given = model.initial.iter().filter_map(|(name, e)| Some((name.clone(), value(*e)?)));
    let mut values: BTreeMap<String, f64> = given.collect();
    for coordinate in &model.base {
        if let Some(angle) = values.get(&coordinate.name).copied() {
            values.extend(circle_names(&coordinate.name).into_iter().zip([angle.cos(), angle.sin()]));
        }
    }
    values
}

/// Derivatives by a parameter of the initial values that a model gives a scene with the parameters `set`, of their
/// points of circles, and of middles of intervals.
pub fn initial_slopes(
    model: &Model,
    scene: &str,
    set: &BTreeMap<String, f64>,
    by: &str,
) -> BTreeMap<String, f64> {
    let Some(by) = model.params.iter().find(|p| p.name == by) else { return BTreeMap::new() };
    let params = all_params(model, scene, set);
    let symbols = model.params.iter().filter_map(|p| Some((p.symbol, *params.get(&p.name)?))).collect();
    let mut graph = model.graph.clone();
    let mut slopes = BTreeMap::new();
    let roles_of = variable_roles(model, &params);
    for (name, e) in &model.initial {
        let slope = graph.diff(*e, by.symbol);
        slopes.extend(graph.eval_f64(slope, &symbols).map(|slope| (name.clone(), slope)));
    }
    let values = initial_values(model, &params);
    // The middle of an interval without zero moves with its ends.
    for (coordinate, role) in model.base.iter().map(|c| (c, roles_of.get(&c.name))) {
        let (Domain::Interval(low, high), Some(VariableRole::Bounded { from, to })) =
            (coordinate.domain, role)
        else {
            continue;
        };
        let is_around_zero = *from < 0.0 && 0.0 < *to;
        if !(is_around_zero || values.contains_key(&coordinate.name)) {
            let ends = graph.sum(&[low, high]);
            let slope = graph.diff(ends, by.symbol);
            slopes
                .extend(graph.eval_f64(slope, &symbols).map(|slope| (coordinate.name.clone(), slope / 2.0)));
        }
    }
    for coordinate in &model.base {
        let (Some(angle), Some(slope)) =
            (values.get(&coordinate.name), slopes.get(&coordinate.name).copied())
        else {
            continue;
        };
        let point = [-angle.sin() * slope, angle.cos() * slope];
        slopes.extend(circle_names(&coordinate.name).into_iter().zip(point));
    }
    slopes
}
