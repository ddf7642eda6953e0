//! The Unified Robot Description Format.
//!
//! # Source
//! wiki.ros.org/urdf/XML; its quantities are in SI units, angles in radians.
//!
//! Deliberately does not know: the model language.

use std::collections::BTreeMap;

use crate::axis::axis_of_joint;
use crate::number::{Number, zeros};
use crate::robot::{Inertia, Joint, JointKind, Link, Mass, Mimic, Moments, Motor, Pose, Robot};
use crate::rotation::roll_pitch_yaw;
use crate::xml::{Element, Reader, head, place};

/// Reads the element `robot`. Nothing after a problem.
pub(crate) fn read<'a>(reader: &Reader<'a>, robot: Element<'a>, file_stem: &str) -> Option<Robot> {
    let name = reader.attribute(robot, "name").map(str::to_owned).unwrap_or_else(|| {
        reader.note(&head(robot), "the robot has no name, and the model that of the file");
        file_stem.to_owned()
    });
    reader.attribute(robot, "version");
    let mut links = Vec::new();
    let mut by_name = BTreeMap::new();
    for element in reader.children(robot, "link") {
        let Some(name) = reader.required(element, "name") else { continue };
        if by_name.insert(name, links.len()).is_some() {
            let help = "give each link a name of its own";
            reader.error(&place(element, "name"), format!("link `{name}` is declared twice"), help);
        }
        let inertias = inertia(reader, element, name).into_iter().collect();
        links.push(Link { inertias, ..Link::new(name.to_owned(), place(element, "name")) });
    }
    let mut joints = Vec::new();
    let mut followers = Vec::new();
    let mut joint_by_name = BTreeMap::new();
    for element in reader.children(robot, "joint") {
        let Some(name) = reader.required(element, "name") else { continue };
        if joint_by_name.insert(name, joints.len()).is_some() {
            let help = "give each joint a name of its own";
            reader.error(&place(element, "name"), format!("joint `{name}` is declared twice"), help);
        }
        let Some(joint) = joint(reader, element, name, &by_name) else { continue };
        if let Some(mimic) = reader.child(element, "mimic") {
            followers.push((joints.len(), mimic));
        }
        joints.push(joint);
    }
    for (follower, element) in followers {
        let Some(leader) = reader.required(element, "joint") else { continue };
        let Some(&leader) = joint_by_name.get(leader) else {
            let help = "name a joint of this file";
            reader.error(&place(element, "joint"), format!("there is no joint `{leader}`"), help);
            continue;
        };
        let factor = reader.number(element, "multiplier").unwrap_or_else(Number::one);
        let offset = reader.number(element, "offset").unwrap_or_else(Number::zero);
        joints[follower].mimic = Some(Mimic { joint: leader, coefficients: vec![offset, factor] });
    }
    let motors = motors(reader, robot, &joint_by_name, &joints);
    if links.is_empty() {
        reader.error(&head(robot), "the robot has no links", "a description has `link` and `joint` elements");
    }
    Some(Robot {
        name,
        links,
        joints,
        root: 0,
        start: Vec::new(),
        has_ground: false,
        motors,
        loops: Vec::new(),
        drives_all: true,
        gravity: Robot::earth(),
        total_mass: None,
    })
}

/// Transmissions between one actuator and one joint.
fn motors<'a>(
    reader: &Reader<'a>,
    robot: Element<'a>,
    joint_by_name: &BTreeMap<&str, usize>,
    joints: &[Joint],
) -> Vec<Motor> {
    let mut motors: Vec<Motor> = Vec::new();
    for element in reader.children(robot, "transmission") {
        let (joint, actuator) = (reader.children(element, "joint"), reader.children(element, "actuator"));
        let shown = reader.attribute(element, "name").unwrap_or("without a name");
        let leave = |why: &str| {
            reader.skip(element);
            let help = "write an `input` and a `force` into the model";
            let message = format!("the transmission `{shown}` is not taken: {why}");
            reader.note_with_help(&place(element, "name"), message, help);
        };
        let ([joint], [actuator]) = (&joint[..], &actuator[..]) else {
            leave("it has not one joint and one actuator");
            continue;
        };
        let kind = reader.child(element, "type").and_then(|kind| kind.text()).unwrap_or_default();
        if !kind.trim().ends_with("SimpleTransmission") {
            leave("it is no SimpleTransmission");
            continue;
        }
        let Some(name) = reader.required(*joint, "name") else { continue };
        let Some(&k) = joint_by_name.get(name) else {
            reader.error(
                &place(*joint, "name"),
                format!("there is no joint `{name}`"),
                "name a joint of this file",
            );
            continue;
        };
        // A joint that is refused is not there.
        let Some(own) = joints.get(k) else { continue };
        if !matches!(own.kind, JointKind::Revolute(_) | JointKind::Prismatic(_)) {
            leave("its joint has not one coordinate");
            continue;
        }
        let reductions = [*actuator, *joint].map(|of| reader.child(of, "mechanicalReduction"));
        let mut gear = Number::one();
        if let [Some(_), Some(second)] = reductions {
            let message = "the reduction of the joint is not taken: that of the actuator is";
            reader.note(&head(second), message);
        }
        if let Some(reduction) = reductions.into_iter().flatten().next() {
            let text = reduction.text().unwrap_or_default().trim();
            match Number::decimal(text).filter(|ratio| !ratio.is_zero()) {
                Some(ratio) => gear = ratio,
                None => {
                    let message = format!("the reduction is \"{text}\", not a number other than zero");
                    reader.error(
                        &head(reduction),
                        message,
                        "write the turns of the motor by a turn of the joint",
                    );
                }
            }
        }
        let name = reader.attribute(*actuator, "name").unwrap_or(name).to_owned();
        motors.push(Motor { name, joint: k, gear, gain: Number::one(), bias: zeros() });
    }
    motors
}

fn pose<'a>(reader: &Reader<'a>, of: Element<'a>) -> Pose {
    let mut pose = Pose::identity();
    if let Some(origin) = reader.child(of, "origin") {
        if let Some(xyz) = reader.numbers(origin, "xyz") {
            pose.place = xyz;
        }
        if let Some(rpy) = reader.numbers(origin, "rpy") {
            pose.turn = roll_pitch_yaw(&rpy);
            for (written, taken) in &pose.turn.moved {
                let message = format!("the angle {written} is taken as {taken}");
                reader.note_with_help(&place(origin, "rpy"), message, "give more digits of another angle");
            }
        }
    }
    pose
}

fn inertia<'a>(reader: &Reader<'a>, link: Element<'a>, name: &str) -> Option<Inertia> {
    let element = reader.child(link, "inertial")?;
    let pose = pose(reader, element);
    let Some(mass_element) = reader.child(element, "mass") else {
        reader.error(&head(element), "`inertial` has no `mass`", "write `<mass value=\"..\"/>` in kg");
        return None;
    };
    reader.required(mass_element, "value")?;
    let mass = reader.number(mass_element, "value")?;
    if mass.value < 0.0 {
        reader.error(&place(mass_element, "value"), "the mass is negative", "write a mass in kg");
    }
    let mut moments = zeros();
    if let Some(matrix) = reader.child(element, "inertia") {
        for (moment, name) in moments.iter_mut().zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]) {
            if let Some(number) = reader.number(matrix, name) {
                *moment = number;
            }
        }
    }
    let is_empty = mass.is_zero() && moments.iter().all(Number::is_zero);
    (!is_empty).then_some(Inertia {
        name: name.to_owned(),
        mass: Mass::Given(mass),
        pose,
        moments: Moments::Given(moments),
        lift: Number::zero(),
    })
}

fn joint<'a>(
    reader: &Reader<'a>,
    element: Element<'a>,
    name: &str,
    links: &BTreeMap<&str, usize>,
) -> Option<Joint> {
    let end = |role: &str| {
        let Some(end) = reader.child(element, role) else {
            let help = format!("write `<{role} link=\"..\"/>`");
            reader.error(&head(element), format!("joint `{name}` has no `{role}`"), &help);
            return None;
        };
        let link = reader.required(end, "link")?;
        let found = links.get(link).copied();
        if found.is_none() {
            let help = "name a link of this file";
            reader.error(&place(end, "link"), format!("there is no link `{link}`"), help);
        }
        found
    };
    let (parent, child) = (end("parent"), end("child"));
    let kind = reader.required(element, "type")?;
    let axis = || {
        let direction = reader.child(element, "axis");
        let entries = direction.and_then(|direction| reader.numbers(direction, "xyz"));
        let entries = entries.unwrap_or_else(|| [Number::one(), Number::zero(), Number::zero()]);
        let place = direction.map_or_else(|| head(element), |direction| place(direction, "xyz"));
        axis_of_joint(reader, &place, name, &entries)
    };
    let limit = reader.child(element, "limit");
    let kind = match kind {
        "fixed" => JointKind::Fixed,
        "floating" => JointKind::Floating,
        "revolute" | "continuous" => JointKind::Revolute(axis()?),
        "prismatic" => JointKind::Prismatic(axis()?),
        "planar" => {
            let axis = axis()?;
            if axis.along.is_none() {
                let message = format!("the plane of joint `{name}` is across no coordinate axis");
                reader.error(&head(element), message, "turn its `origin`, so that the axis is `0 0 1`");
            }
            JointKind::Planar(axis)
        }
        other => {
            let help = "a joint is revolute, continuous, prismatic, fixed, planar or floating";
            let message = format!("joint `{name}` has the type `{other}`");
            reader.error(&place(element, "type"), message, help);
            return None;
        }
    };
    if matches!(kind, JointKind::Fixed | JointKind::Floating) {
        // Neither moves along an axis.
        if let Some(axis) = reader.child(element, "axis") {
            reader.attribute(axis, "xyz");
        }
    }
    let mut limits = None;
    if let Some(limit) = limit
        && matches!(kind, JointKind::Revolute(_) | JointKind::Prismatic(_))
        && reader.attribute(element, "type") != Some("continuous")
    {
        let end = |name: &str| reader.number(limit, name).unwrap_or_else(Number::zero);
        let (lower, upper) = (end("lower"), end("upper"));
        match lower.value < upper.value {
            true => limits = Some([lower, upper]),
            false => {
                let message =
                    format!("joint `{name}` has no interval between its limits, and none in the model");
                reader.note(&head(limit), message);
            }
        }
    }
    let dynamics = reader.child(element, "dynamics");
    let number = |name: &str| dynamics.and_then(|e| reader.number(e, name)).unwrap_or_else(Number::zero);
    let is_moving = !matches!(kind, JointKind::Fixed | JointKind::Floating | JointKind::Planar(_));
    let (damping, friction) = match is_moving {
        true => (number("damping"), number("friction")),
        false => (Number::zero(), Number::zero()),
    };
    let pose = pose(reader, element);
    let joint = Joint::new(name.to_owned(), kind, (parent?, child?), place(element, "name"));
    Some(Joint { pose, limits, damping, friction, ..joint })
}
