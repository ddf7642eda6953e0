//! Joints by their elements.
//!
//! Deliberately does not know: links, frames of the model.

use std::f64::consts::TAU;

use super::frames::{MODEL, WORLD, number, numbers, switch};
use crate::axis::axis_of_joint;
use crate::number::Number;
use crate::robot::{Joint, JointKind, Mimic, Spring};
use crate::rotation::Axis;
use crate::xml::{Element, Reader, head, place};

/// Limits from which on a joint has none, by the specification.
const NONE: f64 = 1e16;

/// The coordinates of a joint: one or two joints without their places, one behind the other. `turned` is the rotation
/// of a frame, by its name, in that behind the joint, where it is not one. Nothing after a problem.
pub(super) fn joints<'a>(
    reader: &Reader<'a>,
    joint: Element<'a>,
    name: &str,
    turned: &dyn Fn(&str) -> Option<Option<String>>,
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
        let direction = direction(reader, axis, (name, &turned_of(reader, axis, joint, turned)?))?;
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
        "universal" | "revolute2" => Some(vec![
            moving("axis", &format!("{name}_1"), true, true)?,
            moving("axis2", &format!("{name}_2"), true, true)?,
        ]),
        "screw" => {
            let turn = moving("axis", name, true, true)?;
            let JointKind::Revolute(axis) = &turn.kind else { return None };
            let mut slide = empty(&format!("{name}_advance"), JointKind::Prismatic(axis.clone()));
            slide.mimic =
                Some(Mimic { joint: 0, coefficients: vec![Number::zero(), advance(reader, joint)?] });
            Some(vec![turn, slide])
        }
        other => {
            let help =
                "joints are revolute, continuous, prismatic, fixed, ball, universal, revolute2 or screw";
            reader.error(&place(joint, "type"), format!("joint `{name}` has the type `{other}`"), help);
            None
        }
    }
}

/// How far a screw goes along its axis by its angle, in m/rad. Nothing after a problem.
///
/// # Source
/// sdformat.org, `sdf/1.11/joint.sdf`: `screw_thread_pitch` is in m a turn, of a right-handed thread; `thread_pitch`,
/// which it replaces, in rad/m, of a left-handed one.
fn advance<'a>(reader: &Reader<'a>, joint: Element<'a>) -> Option<Number> {
    let (new, old) = (number(reader, joint, "screw_thread_pitch"), number(reader, joint, "thread_pitch"));
    let advance = match (new, old) {
        (Some(pitch), _) => Number::expression(format!("{}/(2*pi)", pitch.text), pitch.value / TAU),
        (None, Some(pitch)) if !pitch.is_zero() => {
            let against = pitch.negative();
            Number::expression(format!("1/{}", against.factor()), 1.0 / against.value)
        }
        _ => {
            let help = "write `<screw_thread_pitch>`, in m a turn";
            reader.error(&head(joint), "the screw has no pitch", help);
            return None;
        }
    };
    Some(advance)
}

/// The rotation of the frame that an axis is written in.
///
/// # Source
/// sdformat.org, `sdf/1.5/1_4.convert` and `sdf/1.7/1_6.convert`: axes are in the frame of the model up to version 1.4,
/// and up to 1.6 where the file says so.
fn turned_of<'a>(
    reader: &Reader<'a>,
    axis: Element<'a>,
    joint: Element<'a>,
    turned: &dyn Fn(&str) -> Option<Option<String>>,
) -> Option<Option<String>> {
    let xyz = axis.children().find(|child| child.tag_name().name() == "xyz");
    let named = xyz.and_then(|xyz| reader.attribute(xyz, "expressed_in")).filter(|name| !name.is_empty());
    let is_of_model = switch(reader, axis, "use_parent_model_frame").unwrap_or_else(|| is_before_1_5(axis));
    let own = reader.attribute(joint, "name").unwrap_or_default();
    turned(match named {
        Some("world") => WORLD,
        Some(frame) => frame,
        None if is_of_model => MODEL,
        None => own,
    })
}

/// Whether the version of the file is below 1.5.
fn is_before_1_5(of: Element<'_>) -> bool {
    let version = of.document().root_element().attribute("version").unwrap_or_default();
    let mut numbers = version.split('.').map(|part| part.trim().parse::<u32>());
    matches!((numbers.next(), numbers.next()), (Some(Ok(1)), Some(Ok(0..5))))
}

/// The axis in the frame behind the joint.
fn direction<'a>(
    reader: &Reader<'a>,
    axis: Element<'a>,
    (name, turn): (&str, &Option<String>),
) -> Option<Axis> {
    let Some(xyz) = reader.child(axis, "xyz") else {
        let message = format!("the axis of joint `{name}` has no `xyz`");
        reader.error(&head(axis), message, "write a direction such as `0 0 1`");
        return None;
    };
    let axis = axis_of_joint(reader, &head(xyz), name, &numbers(reader, xyz)?)?;
    Some(match turn {
        Some(turn) => axis.turned(turn),
        None => axis,
    })
}

/// A limit; nothing for one that is none.
fn end<'a>(reader: &Reader<'a>, limit: Element<'a>, name: &str) -> Option<Number> {
    let text = reader.child(limit, name)?.text().unwrap_or_default().trim();
    if text.parse::<f64>().is_ok_and(f64::is_infinite) && !text.contains(|c: char| c.is_ascii_digit()) {
        return None;
    }
    number(reader, limit, name).filter(|n| n.value.abs() < NONE)
}

/// Limits, damping, friction and springs of an axis.
fn forces<'a>(reader: &Reader<'a>, axis: Element<'a>, joint: &mut Joint, is_limited: bool) {
    if let Some(limit) = reader.child(axis, "limit").filter(|_| is_limited) {
        match (end(reader, limit, "lower"), end(reader, limit, "upper")) {
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
