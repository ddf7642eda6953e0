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
struct Actuator {
    gear: Vec<Number>,
    gain: [Number; 3],
    bias: [Number; 3],
    has_bias: bool,
    /// The last element was this shortcut.
    shortcut: Option<&'static str>,
    /// Gain and bias as each shortcut and `general` have left them.
    left: BTreeMap<&'static str, ([Number; 3], [Number; 3])>,
    /// What the model cannot say, with the reason.
    refused: Option<String>,
}

impl Actuator {
    /// Takes what an element says.
    fn apply<'a>(&mut self, reader: &Reader<'a>, element: Element<'a>) {
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
        self.begin(tag);
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
        let left = (self.gain.clone(), self.bias.clone());
        self.left.insert(self.shortcut.unwrap_or("general"), left);
    }

    /// A shortcut says everything that `general` could. It knows numbers of `general`, and nothing of other shortcuts.
    fn begin(&mut self, tag: &str) {
        let shortcut = ["motor", "position", "velocity"].into_iter().find(|shortcut| *shortcut == tag);
        if tag != "general" {
            self.refused = None;
        }
        if let Some(own) = shortcut.filter(|own| self.shortcut.is_some_and(|last| last != *own)) {
            let fresh = ([Number::one(), Number::zero(), Number::zero()], zeros());
            (self.gain, self.bias) =
                self.left.get(own).or_else(|| self.left.get("general")).cloned().unwrap_or(fresh);
        }
        self.shortcut = shortcut;
    }
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
        let one = [Number::one(), Number::zero(), Number::zero()];
        let mut actuator = Actuator {
            gear: vec![Number::one()],
            gain: one,
            bias: zeros(),
            has_bias: false,
            shortcut: None,
            left: BTreeMap::new(),
            refused: None,
        };
        for default in settings.defaults(element, None, ACTUATORS) {
            actuator.apply(reader, default);
        }
        actuator.apply(reader, element);
        if let Some(why) = &actuator.refused {
            leave("name", why);
            continue;
        }
        if !matches!(joints[k].kind, JointKind::Revolute(_) | JointKind::Prismatic(_)) {
            leave("joint", "its joint has several coordinates");
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
