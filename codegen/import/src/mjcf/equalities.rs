//! Equations between joints, and equations that close loops.
//!
//! Deliberately does not know: the model language.

use super::bodies::{Bodies, subtract};
use super::settings::{Defaulted, Settings};
use crate::number::{Number, zeros};
use crate::robot::{End, Held, JointKind, Loop, Mimic, Pose};
use crate::rotation::quaternion;
use crate::xml::{Element, place};

/// Has joints follow others as the elements of `equality` say, and gives the loops that they close; other equations
/// are told.
pub(super) fn equalities<'a>(
    settings: &Settings<'a, '_>,
    root: Element<'a>,
    bodies: &mut Bodies<'a, '_>,
) -> Vec<Loop> {
    let reader = settings.reader;
    let sections = reader.children(root, "equality");
    let mut loops = Vec::new();
    for element in sections.into_iter().flat_map(|section| reader.all(section)) {
        let tag = element.tag_name().name();
        let given = reader.attribute(element, "name");
        let shown = given
            .map_or_else(|| format!("the equation `{tag}`"), |n| format!("the equation `{n}`, a {tag},"));
        reader.take(element);
        let of = settings.defaulted_as(element, "equality", None);
        let is_off = settings.is_off("equality");
        if is_off || of.attribute(reader, "active") == Some("false") {
            let why = if is_off { "is switched off by a flag" } else { "is not active" };
            reader.note(&place(element, "active"), format!("{shown} {why}, and not taken"));
            reader.skip(element);
            continue;
        }
        match tag {
            "joint" => follow(settings, &of, bodies),
            "connect" => loops.extend(closed(settings, &of, bodies, Held::Point)),
            "weld" => loops.extend(closed(settings, &of, bodies, Held::Frame)),
            _ => {
                let ends: Vec<&str> =
                    ["tendon1", "tendon2"].iter().filter_map(|name| element.attribute(*name)).collect();
                let joins = if ends.is_empty() {
                    String::new()
                } else {
                    format!("; it joins {}", ends.join(" and "))
                };
                let help = "write a `constraint` between the places of both into the model";
                reader.note_with_help(&place(element, "name"), format!("{shown} is not taken{joins}"), help);
                reader.skip(element);
            }
        }
    }
    loops
}

/// Has a joint follow another one, or holds it.
fn follow<'a>(settings: &Settings<'a, '_>, of: &Defaulted<'a>, bodies: &mut Bodies<'a, '_>) {
    let (reader, element) = (settings.reader, of.own());
    let find = |attribute: &str| {
        let name = reader.attribute(element, attribute)?;
        let found = bodies.joint_by_name.get(name).copied();
        if found.is_none() {
            let message = format!("there is no joint `{name}`");
            reader.error(&place(element, attribute), message, "name a joint of this file");
        }
        found
    };
    if reader.required(element, "joint1").is_none() {
        return;
    }
    let (Some(follower), leader) = (find("joint1"), find("joint2")) else { return };
    let mut coefficients = vec![Number::zero(), Number::one()];
    for (k, number) in of.list(reader, "polycoef", 5).into_iter().enumerate() {
        match coefficients.get_mut(k) {
            Some(own) => *own = number,
            None => coefficients.push(number),
        }
    }
    let joint = &mut bodies.joints[follower];
    if joint.mimic.is_some() {
        let message = format!("joint `{}` follows two joints", joint.name);
        reader.error(&place(element, "joint1"), message, "leave one of the equations");
    } else if element.has_attribute("joint2") {
        joint.mimic = leader.map(|joint| Mimic { joint, coefficients });
    } else if coefficients[0].is_zero() {
        joint.kind = JointKind::Fixed;
        reader.note(&place(element, "joint1"), format!("joint `{}` is held", joint.name));
    } else {
        let message = format!("joint `{}` is held away from its reference", joint.name);
        reader.error(&place(element, "joint1"), message, "turn the body, and hold it at zero");
    }
}

/// The loop that a `connect` or a `weld` closes.
fn closed<'a>(
    settings: &Settings<'a, '_>,
    of: &Defaulted<'a>,
    bodies: &Bodies<'a, '_>,
    held: Held,
) -> Option<Loop> {
    let (reader, element) = (settings.reader, of.own());
    let tag = element.tag_name().name();
    let has_anchor = matches!(held, Held::Point);
    let ends = ends(settings, of, bodies, has_anchor)?;
    let named = |kind: &str| [1, 2].map(|k| element.attribute(format!("{kind}{k}").as_str()));
    let [one, other] = if element.has_attribute("site1") { named("site") } else { named("body") };
    let joined = format!("{}_{}", one.unwrap_or(tag), other.unwrap_or("world"));
    let name = reader.attribute(element, "name").map_or(joined, str::to_owned);
    // Frames that coincide do so in every point, and forces that only soft equations have scale nothing here.
    for attribute in ["anchor", "torquescale"].into_iter().filter(|_| !has_anchor) {
        of.attribute(reader, attribute);
    }
    let (first, second) = ends;
    Some(Loop { name, held, first, second, span: place(element, "name") })
}

/// The frames that an equation joins.
fn ends<'a>(
    settings: &Settings<'a, '_>,
    of: &Defaulted<'a>,
    bodies: &Bodies<'a, '_>,
    has_anchor: bool,
) -> Option<((usize, Pose), End)> {
    let (reader, element) = (settings.reader, of.own());
    let missing = |attribute: &str, kind: &str| {
        let name = element.attribute(attribute).unwrap_or_default();
        let help = format!("name a {kind} of this file");
        reader.error(&place(element, attribute), format!("there is no {kind} `{name}`"), &help);
    };
    if element.has_attribute("site1") || element.has_attribute("site2") {
        let site = |attribute: &str| {
            let name = reader.required(element, attribute)?;
            let found = bodies.site_by_name.get(name).map(|site| site.read(settings));
            if found.is_none() {
                missing(attribute, "site");
            }
            found
        };
        let (first, second) = (site("site1"), site("site2"));
        let (link, pose) = second?;
        return Some((first?, End { link, pose: Some(pose) }));
    }
    let body = |attribute: &str| {
        let name = reader.attribute(element, attribute).unwrap_or("world");
        let found = bodies.body_by_name.get(name).cloned();
        if found.is_none() {
            missing(attribute, "body");
        }
        found
    };
    reader.required(element, "body1")?;
    let (first, second) = (body("body1"), body("body2"));
    let ((one, offset), (other, other_offset)) = (first?, second?);
    let mut pose = Pose::identity();
    if has_anchor {
        let anchor = of.numbers(reader, "anchor");
        if of.carrier("anchor").is_none() {
            let help = "write `anchor=\"x y z\"`, the point in the frame of the first body";
            reader.error(&place(element, "name"), "`connect` has no `anchor`", help);
        }
        pose.place = anchor?;
        subtract(&mut pose.place, &offset);
        return Some(((one, pose), End { link: other, pose: None }));
    }
    let relative = of.numbers::<7>(reader, "relpose");
    let turn = relative.as_ref().and_then(|[_, _, _, q @ ..]| quaternion(q));
    let (Some([x, y, z, ..]), Some(turn)) = (relative, turn) else {
        return Some(((one, pose), End { link: other, pose: None }));
    };
    settings.tell_moved(&of.place("relpose"), &turn);
    // The second body in the frame of the first.
    pose.place = [x, y, z];
    pose.turn = turn;
    subtract(&mut pose.place, &offset);
    let mut own = Pose { place: zeros(), ..Pose::identity() };
    subtract(&mut own.place, &other_offset);
    Some(((one, pose), End { link: other, pose: Some(own) }))
}
