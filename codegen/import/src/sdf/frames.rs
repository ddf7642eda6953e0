//! Frames of a model, and the pose of one in another.
//!
//! Deliberately does not know: links with masses, coordinates of joints.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::number::{Number, zeros};
use crate::robot::Pose;
use crate::rotation::{Rotation, Turn, quaternion, roll_pitch_yaw};
use crate::xml::{Element, Reader, head};

/// The frame of the model itself.
pub(super) const MODEL: &str = "__model__";
/// The frame that is relative to no other one.
pub(super) const WORLD: &str = "world";

#[derive(Clone, Debug)]
struct Frame {
    relative_to: String,
    pose: Pose,
    span: Range<usize>,
}

/// All frames by their names.
#[derive(Clone, Debug)]
pub(super) struct Frames {
    all: BTreeMap<String, Frame>,
}

/// Numbers in the text of an element.
pub(super) fn numbers<'a, const N: usize>(reader: &Reader<'a>, of: Element<'a>) -> Option<[Number; N]> {
    let text = of.text().unwrap_or_default();
    let all: Option<Vec<Number>> = text.split_whitespace().map(Number::decimal).collect();
    let all = all.and_then(|all| <[Number; N]>::try_from(all).ok());
    if all.is_none() {
        let count = if N == 1 { "a number".to_owned() } else { format!("{N} numbers") };
        let message = format!("`{}` is \"{}\", not {count}", of.tag_name().name(), text.trim());
        reader.error(&head(of), message, "write decimal numbers, separated by blanks");
    }
    all
}

/// The number in an element of a name.
pub(super) fn number<'a>(reader: &Reader<'a>, of: Element<'a>, name: &str) -> Option<Number> {
    let child = reader.child(of, name)?;
    numbers::<1>(reader, child).map(|[number]| number)
}

/// The word of a switch, as the specification has them; an error for others.
pub(super) fn is_on(reader: &Reader<'_>, of: Element<'_>, name: &str, word: &str) -> bool {
    match word.trim() {
        "1" => true,
        "0" => false,
        word if word.eq_ignore_ascii_case("true") => true,
        word if word.eq_ignore_ascii_case("false") => false,
        word => {
            reader.error(&head(of), format!("`{name}` is \"{word}\""), "write true or false");
            false
        }
    }
}

/// Whether an element of a name switches something on; nothing without the element.
pub(super) fn switch<'a>(reader: &Reader<'a>, of: Element<'a>, name: &str) -> Option<bool> {
    let child = reader.child(of, name)?;
    Some(is_on(reader, child, name, child.text().unwrap_or_default()))
}

/// The pose that an element has, and the frame that it names.
pub(super) fn pose<'a>(reader: &Reader<'a>, of: Element<'a>) -> (Pose, Option<&'a str>) {
    let mut pose = Pose::identity();
    let Some(element) = reader.child(of, "pose") else { return (pose, None) };
    let relative_to = reader.attribute(element, "relative_to").filter(|name| !name.is_empty());
    if element.text().unwrap_or_default().trim().is_empty() {
        return (pose, relative_to);
    }
    let format = reader.attribute(element, "rotation_format").unwrap_or("euler_rpy");
    let degrees = reader.attribute(element, "degrees");
    let is_degrees = degrees.is_some_and(|word| is_on(reader, element, "degrees", word));
    match format {
        "euler_rpy" => {
            if let Some([x, y, z, roll, pitch, yaw]) = numbers::<6>(reader, element) {
                pose.place = [x, y, z];
                let angles = [roll, pitch, yaw];
                pose.turn = roll_pitch_yaw(&if is_degrees { angles.map(Number::in_degrees) } else { angles });
            }
        }
        "quat_xyzw" => {
            if let Some([x, y, z, a, b, c, w]) = numbers::<7>(reader, element) {
                pose.place = [x, y, z];
                match quaternion(&[w, a, b, c]) {
                    Some(turn) => pose.turn = turn,
                    None => {
                        reader.error(&head(element), "the quaternion is zero", "write `0 0 0 1` for none")
                    }
                }
            }
        }
        other => {
            let help = "it is euler_rpy or quat_xyzw";
            reader.error(&head(element), format!("the rotation has the format `{other}`"), help);
        }
    }
    for (written, taken) in &pose.turn.moved {
        let message = format!("the rotation {written} is taken as {taken}");
        reader.note_with_help(&head(element), message, "give more digits of another angle");
    }
    (pose, relative_to)
}

impl Frames {
    /// The frames of a model in the world.
    pub(super) fn new(model: Pose, span: Range<usize>) -> Frames {
        let frame = Frame { relative_to: WORLD.to_owned(), pose: model, span };
        Frames { all: BTreeMap::from([(MODEL.to_owned(), frame)]) }
    }

    /// Adds a frame; a second one of its name is a problem.
    pub(super) fn add<'a>(
        &mut self,
        reader: &Reader<'a>,
        element: Element<'a>,
        name: &str,
        relative_to: &str,
    ) {
        let (pose, named) = pose(reader, element);
        let frame = Frame { relative_to: named.unwrap_or(relative_to).to_owned(), pose, span: head(element) };
        if self.all.insert(name.to_owned(), frame).is_some() || name == WORLD {
            let help = "give links, joints and frames names of their own";
            reader.error(&head(element), format!("`{name}` is declared twice"), help);
        }
    }

    /// Whether there is a frame of a name.
    pub(super) fn has(&self, name: &str) -> bool {
        name == WORLD || self.all.contains_key(name)
    }

    /// Frames from one on, each relative to the next, up to the world. Nothing after a problem.
    fn chain(&self, reader: &Reader<'_>, name: &str) -> Option<Vec<String>> {
        let mut chain = vec![name.to_owned()];
        let mut last = name;
        while let Some(frame) = self.all.get(last) {
            last = &frame.relative_to;
            if chain.len() > self.all.len() {
                let message = format!("the pose of `{name}` is relative to itself");
                reader.error(&self.all[name].span, message, "let one pose be relative to the model");
                return None;
            }
            if !self.all.contains_key(last) && last != WORLD {
                let message = format!("there is no frame `{last}`");
                reader.error(&frame.span, message, "name a link, a joint or a frame of this model");
                return None;
            }
            chain.push(last.to_owned());
        }
        Some(chain)
    }

    /// The pose of a frame in another one as steps, one frame in the frame before. Nothing after a problem.
    pub(super) fn between(&self, reader: &Reader<'_>, from: &str, to: &str) -> Option<Vec<Pose>> {
        let (mut up, mut down) = (self.chain(reader, from)?, self.chain(reader, to)?);
        // Both end in the world; the last common frame is the nearest one.
        while up.len() > 1 && down.len() > 1 && up[up.len() - 2] == down[down.len() - 2] {
            up.pop();
            down.pop();
        }
        up.pop();
        down.pop();
        let mut steps: Vec<Pose> = up.iter().filter_map(|name| inverse(&self.all[name].pose)).collect();
        steps.extend(down.iter().rev().map(|name| self.all[name].pose.clone()));
        Some(joined(steps))
    }
}

/// The pose of the outer frame in the inner one.
fn inverse(pose: &Pose) -> Option<Pose> {
    let mut factors = Vec::new();
    for factor in pose.turn.factors.iter().rev() {
        factors.push(match factor {
            Rotation::About(axis, angle) => Rotation::About(axis.clone(), angle.negative()),
            Rotation::Quaternion([w, x, y, z]) => {
                Rotation::Quaternion([w.clone(), x.negative(), y.negative(), z.negative()])
            }
            // Poses of this format have none.
            Rotation::Axes(..) => return None,
        });
    }
    let turn = Turn { factors, moved: Vec::new() };
    let back = pose.place.each_ref().map(Number::negative);
    Some(match turn.is_none() {
        true => Pose { place: back, turn, anchor: zeros() },
        false => Pose { place: zeros(), turn, anchor: back },
    })
}

/// The same pose with fewer steps: translations are added to their neighbours.
fn joined(steps: Vec<Pose>) -> Vec<Pose> {
    let mut all: Vec<Pose> = Vec::new();
    for step in steps {
        match all.last_mut() {
            Some(last) if last.turn.is_none() => {
                last.place = sum(&last.place, &step.place);
                (last.turn, last.anchor) = (step.turn, step.anchor);
            }
            Some(last) if step.turn.is_none() => last.anchor = sum(&last.anchor, &step.place),
            _ => all.push(step),
        }
    }
    all
}

fn sum(a: &[Number; 3], b: &[Number; 3]) -> [Number; 3] {
    std::array::from_fn(|k| a[k].plus(&b[k]))
}
