//! Actuators as motors of joints.
//!
//! # Source
//! mujoco.readthedocs.io/en/stable/modeling.html#cactshortcut: every shortcut is `general` with other parameters.
//!
//! Deliberately does not know: bodies, the model language.

use std::collections::BTreeMap;

use super::settings::{ACTUATORS, Settings};
use crate::number::{Number, zeros};
use crate::robot::{Joint, JointKind, Motor};
use crate::xml::{Element, Reader, place};

/// An actuator while its defaults and itself are read, one after the other.
#[derive(Clone)]
struct Actuator<'a> {
    gear: Vec<Number>,
    gain: [Number; 3],
    bias: [Number; 3],
    has_bias: bool,
    /// The last element, where that was not `general`.
    shortcut: Option<&'a str>,
    /// What the model cannot say, with the reason.
    refused: Option<String>,
}

impl<'a> Actuator<'a> {
    /// Takes what an element says, in the classes around.
    fn apply(&mut self, reader: &Reader<'a>, element: Element<'a>, around: &[Actuator<'a>]) {
        let overlay = |target: &mut [Number; 3], name: &str| {
            for (own, new) in target.iter_mut().zip(reader.list(element, name, 10).into_iter().flatten()) {
                *own = new;
            }
        };
        for (k, number) in reader.list(element, "gear", 6).into_iter().flatten().enumerate() {
            match self.gear.get_mut(k) {
                Some(own) => *own = number,
                None => self.gear.push(number),
            }
        }
        let tag = element.tag_name().name();
        self.begin(tag, around);
        match tag {
            "general" => {
                overlay(&mut self.gain, "gainprm");
                overlay(&mut self.bias, "biasprm");
                for (name, known) in
                    [("gaintype", &["fixed"][..]), ("biastype", &["none", "affine"]), ("dyntype", &["none"])]
                {
                    let Some(word) = reader.attribute(element, name) else { continue };
                    if name == "biastype" {
                        self.has_bias = word == "affine";
                    }
                    if !known.contains(&word) {
                        self.refused = Some(format!("`{name}` is {word}"));
                    }
                }
            }
            "motor" => {
                self.gain[0] = Number::one();
                self.bias = zeros();
                self.has_bias = false;
            }
            "position" => {
                if let Some(kp) = reader.number(element, "kp") {
                    self.gain[0] = kp;
                }
                self.bias[0] = Number::zero();
                self.bias[1] = self.gain[0].negative();
                if let Some(kv) = reader.number(element, "kv") {
                    self.bias[2] = kv.negative();
                }
                self.has_bias = true;
                for (name, what) in [("dampratio", "its damping is by a ratio"), ("timeconst", "it lags")] {
                    if reader.number(element, name).is_some_and(|n| !n.is_zero()) {
                        self.refused = Some(what.to_owned());
                    }
                }
            }
            "velocity" => {
                let kv = reader.number(element, "kv").unwrap_or_else(|| self.gain[0].clone());
                self.bias = [Number::zero(), Number::zero(), kv.negative()];
                self.gain[0] = kv;
                self.has_bias = true;
            }
            other => self.refused = Some(format!("it is a `{other}`")),
        }
    }

    /// A shortcut says everything that `general` could, and knows nothing of other shortcuts: where the last element
    /// was one, it goes on from the nearest class around that ends with its own kind or with `general`.
    fn begin(&mut self, tag: &'a str, around: &[Actuator<'a>]) {
        if tag == "general" {
            self.shortcut = None;
            return;
        }
        self.refused = None;
        let knows = |other: &Actuator<'a>| other.shortcut.is_none_or(|last| last == tag);
        if !knows(self) {
            let found = around.iter().rev().find(|class| knows(class));
            (self.gain, self.bias) =
                found.map_or_else(unsaid, |class| (class.gain.clone(), class.bias.clone()));
        }
        self.shortcut = Some(tag);
    }

    /// What the model cannot say, with the reason: the damping of a servo above zero is a part of the critical one.
    fn refusal(&self) -> Option<String> {
        let is_servo = self.has_bias && self.bias[1].equals(&self.gain[0].negative());
        let is_ratio = is_servo && self.bias[2].value > 0.0;
        self.refused.clone().or_else(|| is_ratio.then(|| "its damping is by a ratio".to_owned()))
    }
}

/// Gain and bias of an actuator that says neither.
fn unsaid() -> ([Number; 3], [Number; 3]) {
    ([Number::one(), Number::zero(), Number::zero()], zeros())
}

/// The motors of a file.
pub(super) fn motors<'a>(
    settings: &Settings<'a, '_>,
    root: Element<'a>,
    joints: &[Joint],
    joint_by_name: &BTreeMap<String, usize>,
) -> Vec<Motor> {
    let reader = settings.reader;
    let mut motors = Vec::new();
    let sections = reader.children(root, "actuator");
    for element in sections.into_iter().flat_map(|section| reader.all(section)) {
        let tag = element.tag_name().name();
        if !ACTUATORS.contains(&tag) {
            continue;
        }
        reader.take(element);
        let given = reader.attribute(element, "name");
        let shown = given.map_or_else(|| format!("the {tag}"), |name| format!("the {tag} `{name}`"));
        let leave = |at: &str, why: &str| {
            let help = "write an `input` and a `force` into the model";
            reader.note_with_help(&place(element, at), format!("{shown} is not taken: {why}"), help);
        };
        if settings.is_off("actuation") {
            leave("name", "the flag `actuation` switches it off");
            reader.skip(element);
            continue;
        }
        let Some(joint) = reader.attribute(element, "joint").or(reader.attribute(element, "jointinparent"))
        else {
            leave("name", "it acts on no joint");
            continue;
        };
        let Some(&k) = joint_by_name.get(joint) else {
            let message = format!("there is no joint `{joint}`");
            reader.error(&place(element, "joint"), message, "name a joint of this file");
            continue;
        };
        let (gain, bias) = unsaid();
        let mut actuator = Actuator {
            gear: vec![Number::one()],
            gain,
            bias,
            has_bias: false,
            shortcut: None,
            refused: None,
        };
        let mut group = 0.0;
        let mut around = Vec::new();
        for class in settings.layers(element, ACTUATORS).into_iter().chain([vec![element]]) {
            for said in class {
                actuator.apply(reader, said, &around);
                group = reader.number(said, "group").map_or(group, |own| own.value);
            }
            around.push(actuator.clone());
        }
        if settings.groups_off.contains(&group) {
            leave("group", "the option `actuatorgroupdisable` switches its group off");
            continue;
        }
        if let Some(why) = actuator.refusal() {
            leave("name", &why);
            continue;
        }
        if !matches!(joints[k].kind, JointKind::Revolute(_) | JointKind::Prismatic(_)) {
            let is_held = matches!(joints[k].kind, JointKind::Fixed);
            leave("joint", if is_held { "its joint is held" } else { "its joint has several coordinates" });
            continue;
        }
        let gear = actuator.gear.first().cloned().unwrap_or_else(Number::one);
        if gear.is_zero() || actuator.gain[0].is_zero() {
            leave("gear", "it has no force");
            continue;
        }
        motors.push(Motor {
            name: given.unwrap_or(joint).to_owned(),
            joint: k,
            gear,
            gain: actuator.gain[0].clone(),
            bias: if actuator.has_bias { actuator.bias } else { zeros() },
        });
    }
    motors
}
