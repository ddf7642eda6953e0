//! Loops: what two links have in common beside the tree, as equations between coordinates.
//!
//! Both ways lead from the last link that they share. A point of the first link has the place `x = p + Q (s + R y)` in
//! the frame of the link before, and so on: two such sums are equal, which no joint before the shared link enters. A
//! way with a free motion begins in space, and so does the other one. Of two frames the rotation `T = A^T B` from one
//! to the other is the identity: its antisymmetric part vanishes, three equations that are independent there. It leaves
//! an axis `a` where that is if `a x T a = 0`: two components of these, as the one of the largest component of `a`
//! follows. A cross between axes `a`, `b` of both keeps `a . T b`; a slide along `a` keeps `T` and `a x A^T d`, with
//! `d` from one origin to the other. Where everything turns about one axis of coordinates, equations along it are left
//! out, as they always hold.
//!
//! Deliberately does not know: XML, energies.

use std::fmt::Write as _;

use crate::number::{Number, ZERO};
use crate::places::{in_product, origin, placed, sum, turned};
use crate::problems::Problems;
use crate::robot::{End, Held, JointKind, Loop, Pose, Robot};
use crate::rotation::{Axis, Rotation, Turn};

/// Everything that is named after a loop, beside the parameters of its places.
pub(crate) const OF_LOOP: [&str; 8] =
    ["*", "one_*", "other_*", "held_*", "turn_*", "across_*", "beside_*", "attitude_*"];

/// The joints from the shared link to one end.
#[derive(Clone, Debug)]
pub(crate) struct Way {
    pub(crate) joints: Vec<usize>,
    link: usize,
}

/// Loops of a robot, by names of its model.
pub(crate) struct Loops<'a> {
    /// With names of parameters in the place of numbers.
    pub(crate) robot: &'a Robot,
    /// With the numbers of the file.
    pub(crate) file: &'a Robot,
    pub(crate) names: &'a [String],
    /// Items that declare the ends of a loop, by loop.
    pub(crate) declared: &'a [String],
    /// Places and rotations of links in the frames of their joints, by joint, where that has a coordinate.
    pub(crate) moved: &'a [Option<(Option<String>, Option<String>)>],
}

impl Loops<'_> {
    /// The ways from the last link that both ends of a loop share. Nothing, and a note, where no equation joins them.
    pub(crate) fn ways(&self, k: usize, problems: &mut Problems) -> Option<[Way; 2]> {
        let closed = &self.robot.loops[k];
        let mut around = self.robot.around(closed);
        // Free motions are told in space.
        if around.iter().flatten().any(|k| self.is_free(*k)) {
            around = [closed.first.0, closed.second.link].map(|link| self.robot.chain(link));
        }
        let [one, other] = around;
        let ways =
            [Way { joints: one, link: closed.first.0 }, Way { joints: other, link: closed.second.link }];
        let (reason, help) = match self.refusal(&ways) {
            None => return Some(ways),
            Some(refusal) => refusal,
        };
        let message = format!("the equation `{}` {reason}: it is not taken", closed.name);
        problems.note_with_help(&closed.span, message, help);
        None
    }

    /// The equations of a loop; the frames of joints on its ways are declared before.
    pub(crate) fn items(&self, k: usize, ways: &[Way; 2], problems: &mut Problems) -> String {
        let closed = &self.robot.loops[k];
        let plane = self.plane(closed, ways);
        if let Some(axis) = plane
            && let Some(gap) = self.gap(k, ways, axis)
        {
            let message = format!(
                "the ends of the equation `{}` are {} m apart along axis {}, about which all of its joints turn",
                closed.name,
                gap.text,
                axis + 1
            );
            problems.error(&closed.span, message, "move one of the two sites");
            return String::new();
        }
        let name = &self.names[k];
        let [one, other] = [&ways[0], &ways[1]].map(|way| &self.robot.links[way.link].name);
        let held = match &closed.held {
            Held::Point => "a point",
            Held::Axis(_) => "an axis",
            Held::Cross(..) => "the centre of a cross",
            Held::Slide(_) => "a line with its frame",
            Held::Frame => "a frame",
        };
        let mut out =
            format!("\n// {}: {held} of {one} is one of {other}.\n{}", closed.name, self.declared[k]);
        let second = self.second(closed, ways);
        let (mut place, turn) = (second.place, second.turn);
        if second.is_found {
            _ = writeln!(out, "let held_{name} = {place};");
            place = format!("held_{name}");
        }
        let first = origin(&closed.first.1);
        let second = if place == ZERO { Vec::new() } else { vec![place] };
        _ = writeln!(out, "let one_{name} = {};", sum(&self.moving(ways, 0, first)));
        _ = writeln!(out, "let other_{name} = {};", sum(&self.moving(ways, 1, second)));
        let of = |side: &str| match plane {
            None => format!("{side}_{name}"),
            Some(left_out) => {
                let kept = (0..3).filter(|axis| *axis != left_out);
                let entries: Vec<String> = kept.map(|axis| format!("{side}_{name}[{}]", axis + 1)).collect();
                format!("[{}]", entries.join(", "))
            }
        };
        match &closed.held {
            Held::Slide(axis) => out.push_str(&self.beside(closed, ways, axis, plane, name)),
            _ => _ = writeln!(out, "constraint {name}: {} = {};", of("one"), of("other")),
        }
        out.push_str(&self.attitude(closed, ways, &turn, plane, name));
        out
    }

    /// That one origin is beside the other nowhere but along an axis of the first frame.
    fn beside(
        &self,
        closed: &Loop,
        ways: &[Way; 2],
        axis: &Axis,
        plane: Option<usize>,
        name: &str,
    ) -> String {
        let mut one = self.turning(ways, 0);
        one.extend(closed.first.1.turn.text());
        let apart = format!("other_{name} - one_{name}");
        let apart = if one.is_empty() { apart } else { format!("transpose({})*({apart})", one.join("*")) };
        let mut out = format!("let beside_{name} = cross({}, {apart});\n", axis.vector);
        let along = axis.along.map(|(k, _)| k);
        // In the plane, a line along it has one equation, and the axis across it two.
        let kept: Vec<usize> = match plane {
            Some(k) if along != Some(k) => vec![k],
            // Of an axis that is written in another frame the largest component is not known.
            _ => (0..3).filter(|k| axis.frame().is_some() || *k != axis.largest).collect(),
        };
        let entries: Vec<String> = kept.iter().map(|k| format!("beside_{name}[{}]", k + 1)).collect();
        _ = match &entries[..] {
            [entry] => writeln!(out, "constraint {name}: {entry} = 0;"),
            _ => writeln!(out, "constraint {name}: [{}] = 0;", entries.join(", ")),
        };
        out
    }

    /// That the rotation between two frames is the identity, leaves an axis where it is, or the angle between two axes.
    fn attitude(
        &self,
        closed: &Loop,
        ways: &[Way; 2],
        second: &[String],
        plane: Option<usize>,
        name: &str,
    ) -> String {
        let turns = |way: &Way| way.joints.iter().any(|k| self.rotation(*k).is_some());
        let along = |axis: &Axis| axis.along.map(|(k, _)| k);
        let is_kept = match &closed.held {
            Held::Point => true,
            Held::Axis(axis) => plane.is_some() && along(axis) == plane,
            Held::Cross(axis, other) => plane.is_some() && [axis, other].iter().any(|a| along(a) == plane),
            Held::Frame | Held::Slide(_) => false,
        };
        if is_kept || !ways.iter().any(turns) {
            return String::new();
        }
        // An axis is told in the frame in which it was written.
        let frame = match &closed.held {
            Held::Axis(axis) => axis.frame().cloned(),
            Held::Point | Held::Frame | Held::Cross(..) | Held::Slide(_) => None,
        };
        let mut one = self.turning(ways, 0);
        one.extend(closed.first.1.turn.text().into_iter().chain(frame.clone()));
        let mut other = self.turning(ways, 1);
        other.extend(second.iter().cloned().chain(frame));
        let back = (!one.is_empty()).then(|| format!("transpose({})", one.join("*")));
        let factors: Vec<String> = back.into_iter().chain(other).collect();
        let mut out = format!("let turn_{name} = {};\n", factors.join("*"));
        if let Held::Cross(axis, other) = &closed.held {
            let [a, b] = [&axis.vector, &other.vector];
            _ = writeln!(out, "constraint attitude_{name}: dot({a}, turn_{name}*{b}) = dot({a}, {b});");
            return out;
        }
        let others = |k: usize| [(k + 1) % 3 + 1, (k + 2) % 3 + 1];
        let entry = |i: usize, j: usize| format!("turn_{name}[{i}, {j}]");
        let entries: Vec<String> = match (&closed.held, plane) {
            (Held::Axis(axis), _) => match axis.oblique() {
                None => others(axis.largest).map(|i| entry(i, axis.largest + 1)).to_vec(),
                Some(vector) => {
                    _ = writeln!(out, "let across_{name} = cross({vector}, turn_{name}*{vector});");
                    others(axis.largest).map(|i| format!("across_{name}[{i}]")).to_vec()
                }
            },
            (_, Some(k)) => {
                let [i, j] = others(k);
                vec![entry(j, i)]
            }
            (_, None) => {
                let across = |k: usize| {
                    let [i, j] = others(k);
                    format!("{} - {}", entry(j, i), entry(i, j))
                };
                (0..3).map(across).collect()
            }
        };
        let zeros = vec!["0"; entries.len()].join(", ");
        _ = match &entries[..] {
            [entry] => writeln!(out, "constraint attitude_{name}: {entry} = 0;"),
            _ => writeln!(out, "constraint attitude_{name}:\n    [{}] = [{zeros}];", entries.join(", ")),
        };
        out
    }

    /// Why a loop is not taken, and the fix.
    fn refusal(&self, ways: &[Way; 2]) -> Option<(&'static str, &'static str)> {
        let mut kinds = ways.iter().flat_map(|way| &way.joints).map(|k| &self.robot.joints[*k].kind);
        let is_rigid = kinds.all(|kind| matches!(kind, JointKind::Fixed));
        is_rigid.then_some(("joins one body with itself", "leave it out of the file, or name another body"))
    }

    /// The place and the rotation of a joint's link by its coordinates.
    fn moved(&self, joint: usize) -> (Option<String>, Option<String>) {
        self.moved[joint].clone().unwrap_or_default()
    }

    fn rotation(&self, joint: usize) -> Option<String> {
        self.moved(joint).1
    }

    fn is_free(&self, joint: usize) -> bool {
        matches!(self.robot.joints[joint].kind, JointKind::Floating)
    }

    /// The frames before a chain that moves: frames of the root in space, where a way has a free motion.
    fn before(&self, ways: &[Way; 2]) -> &[Pose] {
        let has_free = ways.iter().flat_map(|way| &way.joints).any(|k| self.is_free(*k));
        if has_free { &self.robot.start } else { &[] }
    }

    /// The place of a point of the last link of a chain in the frame of the first, as terms, by its terms in the last.
    fn point(&self, chain: &[usize], mut terms: Vec<String>, moves: bool) -> Vec<String> {
        for k in chain.iter().rev() {
            let pose = &self.robot.joints[*k].pose;
            let (shift, rotation) = if moves { self.moved(*k) } else { (None, None) };
            if let Some(rotation) = rotation {
                terms = turned(&rotation, terms);
            }
            terms.splice(0..0, shift);
            terms = placed(pose, terms);
        }
        terms
    }

    /// As [`Loops::point`] where joints move, and in space where a free motion does.
    fn moving(&self, ways: &[Way; 2], way: usize, terms: Vec<String>) -> Vec<String> {
        let chain = &ways[way].joints;
        match chain.iter().rposition(|k| self.is_free(*k)) {
            Some(at) => {
                let (place, attitude) = self.moved(chain[at]);
                let behind = self.point(&chain[at + 1..], terms, true);
                let turned = turned(&attitude.unwrap_or_default(), behind);
                place.into_iter().chain(turned).collect()
            }
            None => {
                let terms = self.point(chain, terms, true);
                self.before(ways).iter().rev().fold(terms, |terms, pose| placed(pose, terms))
            }
        }
    }

    /// The rotation of the last link of a chain in the frame of the first, as factors.
    fn turns(&self, chain: &[usize], moves: bool) -> Vec<String> {
        let of = |k: &usize| {
            let rotation = if moves { self.rotation(*k) } else { None };
            self.robot.joints[*k].pose.turn.text().into_iter().chain(rotation)
        };
        chain.iter().flat_map(of).collect()
    }

    /// As [`Loops::turns`] where joints move, and in space where a free motion does.
    fn turning(&self, ways: &[Way; 2], way: usize) -> Vec<String> {
        let chain = &ways[way].joints;
        let (first, behind) = match chain.iter().rposition(|k| self.is_free(*k)) {
            Some(at) => (self.rotation(chain[at]).into_iter().collect(), &chain[at + 1..]),
            None => (self.before(ways).iter().filter_map(|pose| pose.turn.text()).collect(), &chain[..]),
        };
        let first: Vec<String> = first;
        first.into_iter().chain(self.turns(behind, true)).collect()
    }

    /// The frame of the second end in its link.
    fn second(&self, closed: &Loop, ways: &[Way; 2]) -> Second {
        if let End { pose: Some(pose), .. } = &closed.second {
            let turn = pose.turn.text().into_iter().collect();
            return Second { place: sum(&origin(pose)), turn, is_found: false };
        }
        let there = self.point(&ways[0].joints, origin(&closed.first.1), false);
        let from = self.point(&ways[1].joints, Vec::new(), false);
        let difference = match from.is_empty() {
            true => there,
            false => {
                let there = if there.is_empty() { String::new() } else { format!("{} ", sum(&there)) };
                vec![format!("{there}- {}", in_product(&sum(&from)))]
            }
        };
        let back = self.turns(&ways[1].joints, false);
        let back = (!back.is_empty()).then(|| format!("transpose({})", back.join("*")));
        let place = match &back {
            Some(back) => sum(&turned(back, difference)),
            None => sum(&difference),
        };
        let turn: Vec<String> = back
            .into_iter()
            .chain(self.turns(&ways[0].joints, false))
            .chain(closed.first.1.turn.text())
            .collect();
        Second { place, turn, is_found: true }
    }

    /// The axis of coordinates about which everything on both ways turns, and across which it slides.
    fn plane(&self, closed: &Loop, ways: &[Way; 2]) -> Option<usize> {
        let is_along = |axis: &Axis, k: usize| axis.along.is_some_and(|(along, _)| along == k);
        let keeps = |pose: &Pose, k: usize| turns_about(&pose.turn, k);
        let poses = [Some(&closed.first.1), closed.second.pose.as_ref()];
        (0..3).find(|k| {
            let joints = ways.iter().flat_map(|way| &way.joints);
            joints.map(|joint| &self.robot.joints[*joint]).all(|joint| {
                let moves_there = match &joint.kind {
                    JointKind::Fixed => true,
                    JointKind::Revolute(axis) | JointKind::Planar(axis) => is_along(axis, *k),
                    JointKind::Prismatic(axis) => axis.along.is_some_and(|(along, _)| along != *k),
                    JointKind::Ball | JointKind::Floating => false,
                };
                moves_there && keeps(&joint.pose, *k)
            }) && poses.iter().flatten().all(|pose| keeps(pose, *k))
        })
    }

    /// How far both ends are apart along the axis of all joints, where that is not zero.
    fn gap(&self, k: usize, ways: &[Way; 2], axis: usize) -> Option<Number> {
        let closed = &self.file.loops[k];
        let end = closed.second.pose.as_ref()?;
        let along = |way: &Way, end: &Pose| {
            let poses = way.joints.iter().map(|k| &self.file.joints[*k].pose);
            poses.fold(end.place[axis].plus(&end.anchor[axis]), |sum, pose| {
                sum.plus(&pose.place[axis]).plus(&pose.anchor[axis])
            })
        };
        let gap = along(&ways[0], &closed.first.1).minus(&along(&ways[1], end));
        (!gap.is_zero()).then_some(gap)
    }
}

/// The frame of an end in its link.
struct Second {
    place: String,
    /// As factors.
    turn: Vec<String>,
    /// Whether it is where the other end is.
    is_found: bool,
}

fn turns_about(turn: &Turn, axis: usize) -> bool {
    let own = format!("e{}", axis + 1);
    turn.factors.iter().all(|factor| matches!(factor, Rotation::About(about, _) if *about == own))
}
