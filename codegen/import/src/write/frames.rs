//! Frames and bodies as items of the model, where they are asked for.
//!
//! Deliberately does not know: energies, forces.

use super::{Carried, Writer};
use crate::number::{Number, ZERO, vector};
use crate::places;
use crate::problems::Problems;
use crate::robot::JointKind;

impl Writer<'_> {
    /// The frames of links that are asked for: places and rotations by the links before, from the link at rest or from
    /// the one that moves freely.
    pub(super) fn frames(&mut self, problems: &mut Problems) {
        let mut placed: Vec<Option<Carried>> = vec![None; self.robot.links.len()];
        for name in &self.options.frames {
            let Some(link) = self.robot.links.iter().position(|link| link.name == *name) else {
                let list: Vec<&str> = self.robot.links.iter().map(|link| link.name.as_str()).collect();
                let help = format!("links are {}", list.join(", "));
                problems.error(&(0..0), format!("there is no link `{name}` to have a frame"), &help);
                continue;
            };
            if placed.iter().all(Option::is_none) {
                self.line("\n// Frames.");
            }
            let mut frame = self.placed(link, &mut placed, problems);
            let origin = &self.robot.links[link].origin;
            if !origin.iter().all(Number::is_zero) {
                let origin = vec![vector(origin)];
                let turned = frame.turn.as_ref().map_or(origin.clone(), |turn| places::turned(turn, origin));
                frame.place = Some(places::sum(&frame.place.into_iter().chain(turned).collect::<Vec<_>>()));
            }
            let is_free = self.is_free(frame.carrier);
            let own = self.links[link].clone();
            let mut item = format!("frame {own}");
            if is_free && frame.carrier != link {
                item.push_str(&format!(" on {}", self.links[frame.carrier]));
            }
            if is_free && frame.carrier == link {
                // Declared where the first frame is on it.
                continue;
            }
            if let Some(place) = &frame.place {
                item.push_str(&format!(" at {place}"));
            }
            if let Some(turn) = &frame.turn {
                item.push_str(&format!(" attitude {turn}"));
            }
            let file_name = self.robot.links[link].name.clone();
            self.line(&format!("/// {file_name}\n{item};"));
        }
        if self.options.bodies {
            self.place_bodies(&mut placed, problems);
        }
    }

    /// The bodies, each on the frame of the link at rest or of the one that moves freely.
    fn place_bodies(&mut self, placed: &mut Vec<Option<Carried>>, problems: &mut Problems) {
        self.line("\n// Bodies.");
        let root = self.robot.root;
        let mut lacks_frame =
            !self.is_free(root) && !self.options.frames.contains(&self.robot.links[root].name);
        for (link, has_mass, has_moments) in self.bodies.clone() {
            let frame = self.placed(link, placed, problems);
            let (own, carrier) = (self.links[link].clone(), self.links[frame.carrier].clone());
            if frame.carrier == root && std::mem::take(&mut lacks_frame) {
                let file_name = self.robot.links[root].name.clone();
                self.line(&format!("/// {file_name}, at rest\nframe {carrier};"));
            }
            let mut item = format!("body {own} on {carrier} {{ ");
            if has_mass {
                let turned = frame.turn.as_ref().map_or(format!("c_{own}"), |turn| format!("{turn}*c_{own}"));
                let place = frame.place.as_ref().map(|place| format!("{place} + ")).unwrap_or_default();
                item.push_str(&format!("mass m_{own}; place {place}{turned}; "));
            }
            if has_moments {
                item.push_str(&format!("inertia I_{own}; "));
                if let Some(turn) = &frame.turn {
                    item.push_str(&format!("attitude {turn}; "));
                }
            }
            self.line(&format!("{item}}}"));
        }
    }

    /// Whether a link moves without a joint.
    fn is_free(&self, link: usize) -> bool {
        let joints = &self.robot.joints;
        let floats = |k: &usize| joints[*k].child == link;
        self.floats.joints.iter().any(floats) || (self.options.floating && link == self.robot.root)
    }

    /// A link in the frame of the link at rest or of the one that moves freely, by names that are written here.
    fn placed(&mut self, link: usize, placed: &mut Vec<Option<Carried>>, problems: &mut Problems) -> Carried {
        if let Some(known) = &placed[link] {
            return known.clone();
        }
        let joint = self.robot.joints.iter().position(|joint| joint.child == link);
        let (name, still) = (self.links[link].clone(), Carried { carrier: link, place: None, turn: None });
        let found = match joint {
            Some(k) if !self.is_free(link) => {
                let before = self.placed(self.robot.joints[k].parent, placed, problems);
                self.declare_frame_of(k);
                self.has_coordinates(k, problems);
                let pose = &self.robot.joints[k].pose;
                let (shift, rotation) = self.moved[k].clone().unwrap_or_default();
                let (mut place, turn) = (still.place_of(pose), pose.turn.text());
                if let Some(shift) = shift {
                    let shift = turn.as_ref().map_or(shift.clone(), |turn| format!("{turn}*({shift})"));
                    place = if place == ZERO { shift } else { format!("{place} + {shift}") };
                }
                let factors: Vec<String> = turn.into_iter().chain(rotation).collect();
                let mut own = before.clone();
                if place != ZERO {
                    let turned = match &before.turn {
                        Some(turn) if place.contains(" + ") => format!("{turn}*({place})"),
                        Some(turn) => format!("{turn}*{place}"),
                        None => place,
                    };
                    let plus = before.place.map(|before| format!("{before} + ")).unwrap_or_default();
                    self.line(&format!("let p_{name} = {plus}{turned};"));
                    own.place = Some(format!("p_{name}"));
                }
                if !factors.is_empty() {
                    let all: Vec<String> = before.turn.into_iter().chain(factors).collect();
                    self.line(&format!("let R_{name} = {};", all.join("*")));
                    own.turn = Some(format!("R_{name}"));
                }
                own
            }
            _ => {
                if self.is_free(link) {
                    let free = self.floats.of(link);
                    let file_name = self.robot.links[link].name.clone();
                    let (at, attitude) = free.pose();
                    self.line(&format!("/// {file_name}\nframe {name} at {at} attitude {attitude};"));
                }
                still
            }
        };
        placed[link] = Some(found.clone());
        found
    }

    /// Tells a joint of which the model lacks the coordinates, so that the link behind it has no place.
    pub(super) fn has_coordinates(&self, joint: usize, problems: &mut Problems) {
        let (moved, joint) = (&self.moved[joint], &self.robot.joints[joint]);
        if moved.is_none() && !matches!(joint.kind, JointKind::Fixed) {
            let help = format!("write `--lock {}`", joint.name);
            let message = format!(
                "link `{}` has no frame: joint `{}` before it moves no mass, and the model lacks it",
                self.robot.links[joint.child].name, joint.name
            );
            problems.error(&joint.span, message, &help);
        }
    }
}
