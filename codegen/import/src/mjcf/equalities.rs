//! Equations between joints.
//!
//! Deliberately does not know: bodies, the model language.

use std::collections::BTreeMap;

use super::settings::Settings;
use crate::number::Number;
use crate::robot::{Joint, JointKind, Mimic};
use crate::xml::{Element, place};

/// Has joints follow others as the elements of `equality` say; other equations are told.
pub(super) fn equalities<'a>(
    settings: &Settings<'a, '_>,
    root: Element<'a>,
    joints: &mut [Joint],
    joint_by_name: &BTreeMap<String, usize>,
) {
    let reader = settings.reader;
    let sections = reader.children(root, "equality");
    for element in sections.into_iter().flat_map(|section| reader.all(section)) {
        let tag = element.tag_name().name();
        let given = reader.attribute(element, "name");
        let shown = given
            .map_or_else(|| format!("the equation `{tag}`"), |n| format!("the equation `{n}`, a {tag},"));
        reader.take(element);
        let of = settings.defaulted(element, None);
        if of.attribute(reader, "active") == Some("false") {
            reader.note(&place(element, "active"), format!("{shown} is not active, and not taken"));
            continue;
        }
        if tag != "joint" {
            let ends: Vec<&str> = ["body1", "body2", "site1", "site2", "tendon1", "tendon2"]
                .iter()
                .filter_map(|name| element.attribute(*name))
                .collect();
            let message = format!("{shown} is not taken; it joins {}", ends.join(" and "));
            let help = "write a `constraint` between the places of both into the model";
            reader.note_with_help(&place(element, "name"), message, help);
            continue;
        }
        let find = |attribute: &str| {
            let name = reader.attribute(element, attribute)?;
            let found = joint_by_name.get(name).copied();
            if found.is_none() {
                let message = format!("there is no joint `{name}`");
                reader.error(&place(element, attribute), message, "name a joint of this file");
            }
            found
        };
        if reader.required(element, "joint1").is_none() {
            continue;
        }
        let Some(follower) = find("joint1") else { continue };
        let mut coefficients = vec![Number::zero(), Number::one()];
        for (k, number) in of.list(reader, "polycoef", 5).into_iter().enumerate() {
            match coefficients.get_mut(k) {
                Some(own) => *own = number,
                None => coefficients.push(number),
            }
        }
        if joints[follower].mimic.is_some() {
            let message = format!("joint `{}` follows two joints", joints[follower].name);
            reader.error(&place(element, "joint1"), message, "leave one of the equations");
            continue;
        }
        if reader.attribute(element, "joint2").is_some() {
            let Some(leader) = find("joint2") else { continue };
            joints[follower].mimic = Some(Mimic { joint: leader, coefficients });
        } else if coefficients[0].is_zero() {
            joints[follower].kind = JointKind::Fixed;
            reader.note(&place(element, "joint1"), format!("joint `{}` is held", joints[follower].name));
        } else {
            let message = format!("joint `{}` is held away from its reference", joints[follower].name);
            reader.error(&place(element, "joint1"), message, "turn the body, and hold it at zero");
        }
    }
}
