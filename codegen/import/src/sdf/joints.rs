//! Joints by their elements.
//!
//! Deliberately does not know: links, frames of the model.

use super::frames::{number, numbers};
use crate::axis::axis_of_joint;
use crate::number::Number;
use crate::robot::{Joint, JointKind, Spring};
use crate::rotation::{Axis, Turn};
use crate::xml::{Element, Reader, head, place};

/// Limits from which on a joint has none, by the specification.
const NONE: f64 = 1e16;

/// The coordinates of a joint: one or two joints without their places, one behind the other. `turned` is the rotation
/// of the joint's frame in that of the child. Nothing after a problem.
pub(super) fn joints<'a>(
    reader: &Reader<'a>,
    joint: Element<'a>,
    name: &str,
    turned: &Turn,
) -> Option<Vec<Joint>> {
    let kind = reader.required(joint, "type")?;
    let of = |axis: &str| {
        let element = reader.child(joint, axis);
        if element.is_none() {
            let help = format!("write `<{axis}><xyz>0 0 1</xyz></{axis}>`");
            reader.error(&head(joint), format!("joint `{name}` has no `{axis}`"), &help);
        }
        element
    };
    let empty = |name: &str, kind| Joint::new(name.to_owned(), kind, (0, 0), place(joint, "name"));
    let moving = |axis: &str, name: &str, is_turn: bool, is_limited: bool| {
        let axis = of(axis)?;
        let direction = direction(reader, axis, name, turned)?;
        let kind = if is_turn { JointKind::Revolute(direction) } else { JointKind::Prismatic(direction) };
        let mut one = empty(name, kind);
        forces(reader, axis, &mut one, is_limited);
        Some(one)
    };
    match kind {
        "fixed" => Some(vec![empty(name, JointKind::Fixed)]),
        "ball" => Some(vec![empty(name, JointKind::Ball)]),
        "revolute" => Some(vec![moving("axis", name, true, true)?]),
        "continuous" => Some(vec![moving("axis", name, true, false)?]),
        "prismatic" => Some(vec![moving("axis", name, false, true)?]),
        "universal" => Some(vec![
            moving("axis", &format!("{name}_1"), true, true)?,
            moving("axis2", &format!("{name}_2"), true, true)?,
        ]),
        other => {
            let help = "joints are revolute, continuous, prismatic, fixed, ball or universal";
            reader.error(&place(joint, "type"), format!("joint `{name}` has the type `{other}`"), help);
            None
        }
    }
}

/// The axis in the frame of the child.
fn direction<'a>(reader: &Reader<'a>, axis: Element<'a>, name: &str, turned: &Turn) -> Option<Axis> {
    let Some(xyz) = reader.child(axis, "xyz") else {
        let message = format!("the axis of joint `{name}` has no `xyz`");
        reader.error(&head(axis), message, "write a direction such as `0 0 1`");
        return None;
    };
    if reader.attribute(xyz, "expressed_in").is_some_and(|frame| !frame.is_empty()) {
        let help = "turn the `pose` of the joint, and write the axis in the frame of the joint";
        let message = format!("the axis of joint `{name}` is by another frame");
        reader.error(&place(xyz, "expressed_in"), message, help);
        return None;
    }
    let axis = axis_of_joint(reader, &head(xyz), name, &numbers(reader, xyz)?)?;
    let Some(turn) = turned.text() else { return Some(axis) };
    let vector = format!("({turn}*{})", axis.vector);
    Some(Axis { vector: vector.clone(), of_rotation: (vector, false), along: None })
}

/// Limits, damping, friction and springs of an axis.
fn forces<'a>(reader: &Reader<'a>, axis: Element<'a>, joint: &mut Joint, is_limited: bool) {
    if let Some(limit) = reader.child(axis, "limit").filter(|_| is_limited) {
        let end = |name: &str| number(reader, limit, name).filter(|n| n.value.abs() < NONE);
        match (end("lower"), end("upper")) {
            (Some(lower), Some(upper)) if lower.value < upper.value => joint.limits = Some([lower, upper]),
            (None, None) => {}
            _ => {
                let name = &joint.name;
                let message =
                    format!("joint `{name}` has no interval between its limits, and none in the model");
                reader.note(&head(limit), message);
            }
        }
    }
    let Some(dynamics) = reader.child(axis, "dynamics") else { return };
    let value = |name: &str| number(reader, dynamics, name).unwrap_or_else(Number::zero);
    joint.damping = value("damping");
    joint.friction = value("friction");
    let (stiffness, rest) = (value("spring_stiffness"), value("spring_reference"));
    if !stiffness.is_zero() {
        joint.spring = Some(Spring { stiffness, rest });
    }
}
