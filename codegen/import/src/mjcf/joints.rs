//! Joints by their elements.
//!
//! Deliberately does not know: bodies, where joints are.

use super::settings::{Defaulted, Settings};
use crate::axis::axis_of_joint;
use crate::number::{Number, zeros};
use crate::robot::{Joint, JointKind, Spring};

/// A joint without its place, and the point of the body that it holds; nothing where every point is as good.
pub(super) fn joint<'a>(
    settings: &Settings<'a, '_>,
    of: &Defaulted<'a>,
    name: &str,
    ends: (usize, usize),
) -> Option<(Joint, Option<[Number; 3]>)> {
    let reader = settings.reader;
    let element = of.own();
    let span = crate::xml::place(element, "name");
    if element.tag_name().name() == "freejoint" {
        return Some((Joint::new(name.to_owned(), JointKind::Floating, ends, span), None));
    }
    let axis = || {
        let unit = || [Number::zero(), Number::zero(), Number::one()];
        let entries = of.numbers(reader, "axis").unwrap_or_else(unit);
        axis_of_joint(reader, &of.place("axis"), name, &entries)
    };
    let kind = match of.attribute(reader, "type").unwrap_or("hinge") {
        "hinge" => JointKind::Revolute(axis()?),
        "slide" => JointKind::Prismatic(axis()?),
        "ball" => JointKind::Ball,
        "free" => JointKind::Floating,
        other => {
            let message = format!("joint `{name}` has the type `{other}`");
            reader.error(&of.place("type"), message, "a joint is hinge, slide, ball or free");
            return None;
        }
    };
    let is_hinge = matches!(kind, JointKind::Revolute(_));
    let held = match kind {
        JointKind::Revolute(_) | JointKind::Ball => Some(of.numbers(reader, "pos").unwrap_or_else(zeros)),
        _ => {
            of.numbers::<3>(reader, "pos");
            None
        }
    };
    let has_one = is_hinge || matches!(kind, JointKind::Prismatic(_));
    let is_free = matches!(kind, JointKind::Floating);
    let number = |attribute: &str| of.number(reader, attribute).unwrap_or_else(Number::zero);
    let length = |n: Number| if is_hinge { settings.angle(n) } else { n };
    let mut joint = Joint::new(name.to_owned(), kind, ends, span);
    let is_on = |flag: &str| !settings.is_off(flag);
    joint.damping = Some(number("damping")).filter(|_| is_on("damper")).unwrap_or_else(Number::zero);
    joint.armature = number("armature");
    let others = [("frictionloss", "frictionloss"), ("stiffness", "spring")]
        .map(|(name, flag)| (name, Some(number(name)).filter(|_| is_on(flag)).unwrap_or_else(Number::zero)));
    if has_one {
        joint.reference = length(number("ref"));
        let [(_, friction), (_, stiffness)] = others;
        joint.friction = friction;
        if !stiffness.is_zero() {
            joint.spring = Some(Spring { stiffness, rest: length(number("springref")) });
        }
        joint.limits = limits(settings, of, name).filter(|_| is_on("limit")).map(|pair| pair.map(length));
    } else {
        for (attribute, value) in others {
            if !value.is_zero() {
                let message = format!("`{attribute}` of joint `{name}` is not taken");
                let help = "write a `force` into the model";
                reader.note_with_help(&of.place(attribute), message, help);
            }
        }
        let has_range = of.list(reader, "range", 2).get(1).is_some_and(|high| high.value > 0.0);
        let is_limited = of.attribute(reader, "limited") != Some("false");
        if has_range && is_limited && !is_free && is_on("limit") {
            let help = "write an `event` into the model";
            reader.note_with_help(
                &of.place("range"),
                format!("the limit of joint `{name}` is not taken"),
                help,
            );
        }
    }
    if of.list(reader, "springdamper", 2).iter().any(|n| n.value > 0.0) {
        let message = format!("stiffness and damping of joint `{name}` are those of an oscillator");
        let help = "write `stiffness` and `damping`: `mujoco.mj_saveLastXML` has them";
        reader.error(&of.place("springdamper"), message, help);
    }
    Some((joint, held))
}

/// The interval of a coordinate, in the numbers of the file.
fn limits<'a>(settings: &Settings<'a, '_>, of: &Defaulted<'a>, name: &str) -> Option<[Number; 2]> {
    let reader = settings.reader;
    let range = of.numbers::<2>(reader, "range");
    let limited = of.attribute(reader, "limited").unwrap_or("auto");
    let is_limited = match limited {
        "true" => true,
        "false" => false,
        "auto" => {
            if range.is_some() && !settings.autolimits {
                let help = "write `limited`, or leave `autolimits` out";
                reader.error(
                    &of.place("range"),
                    format!("joint `{name}` has a range, and no `limited`"),
                    help,
                );
            }
            range.is_some()
        }
        other => {
            let help = "write true, false or auto";
            reader.error(&of.place("limited"), format!("`limited` is \"{other}\""), help);
            return None;
        }
    };
    if !is_limited {
        return None;
    }
    let range = range.filter(|[low, high]| low.value < high.value);
    if range.is_none() {
        let message = format!("joint `{name}` is limited, and has no interval");
        reader.error(&of.place("limited"), message, "write `range`, the smaller number first");
    }
    range
}
