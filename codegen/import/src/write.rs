//! A robot as the text of a model: one joint, and the link that it moves, after the other.
//!
//! Everything about a link is in its own frame, by the link `P` before: angular velocity `w = E w_P + s q'`, velocity
//! of the origin `v = E (v_P + w_P x r)`, direction and height of the vertical. Links that fixed joints join are one
//! body.
//!
//! # Source
//! Featherstone 2008, Rigid Body Dynamics Algorithms, sections 4.4 and 5.3, in the signs of the velocities.
//!
//! Deliberately does not know: XML, how equations are derived.

mod frames;

use std::fmt::Write as _;

use crate::floats::Floats;
use crate::joints::{self, Motion};
use crate::loops::{Loops, OF_LOOP};
use crate::names::Names;
use crate::number::{Number, ZERO, vector};
use crate::options::{Limits, Options};
use crate::parameters::{OF_PLACE, Parameters, parameters};
use crate::places;
use crate::problems::Problems;
use crate::robot::{JointKind, Pose, Robot};
use crate::vertical::Vertical;

/// Names with a meaning in every model of a robot. A free motion has its own.
const RESERVED: [&str; 9] =
    ["e1", "e2", "e3", "g", "friction_speed", "limit_stiffness", "limit_width", "mass_scale", "total_mass"];
/// Everything that is named after a link, beside its places.
const OF_LINK: [&str; 17] = [
    "E_*", "w_*", "v_*", "up_*", "h_*", "r_*", "Q_*", "m_*", "c_*", "I_*", "u_*", "T_*", "U_*", "drag_*",
    "added_*", "p_*", "R_*",
];

/// A link in the frame of its carrier, the moving link that fixed joints join it to.
#[derive(Clone, Debug)]
struct Carried {
    carrier: usize,
    /// The definitions `r_` and `Q_` of a link, where they are not zero and one.
    place: Option<String>,
    turn: Option<String>,
}

impl Carried {
    /// The origin of a frame in the frame of the carrier.
    fn place_of(&self, pose: &Pose) -> String {
        let is_zero = pose.place.iter().chain(&pose.anchor).all(Number::is_zero);
        let mut own = vector(&pose.place);
        if !pose.anchor.iter().all(Number::is_zero) {
            let anchor = vector(&pose.anchor);
            let anchor = pose.turn.text().map_or(anchor.clone(), |turn| format!("{turn}*{anchor}"));
            let is_sum = own != ZERO && self.turn.is_some();
            own = if own == ZERO { anchor } else { format!("{own} + {anchor}") };
            own = if is_sum { format!("({own})") } else { own };
        }
        let turned = self.turn.as_ref().map_or(own.clone(), |turn| format!("{turn}*{own}"));
        match (&self.place, is_zero) {
            (None, true) => ZERO.to_owned(),
            (None, false) => turned,
            (Some(at), true) => at.clone(),
            (Some(at), false) => format!("{at} + {turned}"),
        }
    }

    fn turn_of(&self, pose: &Pose) -> Option<String> {
        match (&self.turn, pose.turn.text()) {
            (Some(a), Some(b)) => Some(format!("{a}*{b}")),
            (a, b) => a.clone().or(b),
        }
    }
}

struct Writer<'a> {
    /// With names of parameters in the place of lengths and angles.
    robot: &'a Robot,
    /// With the numbers of the file.
    file: &'a Robot,
    parameters: Parameters,
    options: &'a Options,
    /// The vertical upwards and the acceleration of gravity; nothing without gravity.
    vertical: Option<Vertical>,
    floats: Floats,
    /// Names of links and joints.
    links: Vec<String>,
    joints: Vec<String>,
    loop_names: Vec<String>,
    carried: Vec<Option<Carried>>,
    out: String,
    kinetic: Vec<String>,
    potential: Vec<String>,
    /// Links with a body, and whether that has a mass and moments of inertia.
    bodies: Vec<(usize, bool, bool)>,
    motion: Motion,
    /// Places and rotations of links in the frames of their joints, by joint, where that has a coordinate.
    moved: Vec<Option<(Option<String>, Option<String>)>>,
    /// Links whose masses have been declared.
    is_written: Vec<bool>,
    /// Whether the numbers of the frame of a joint have been declared.
    is_declared: Vec<bool>,
}

/// The items of the model; its documentation comes before. Places and angles of joints are parameters, but for joints
/// in `stay`.
pub(crate) fn items(file: &Robot, options: &Options, stay: &[usize], problems: &mut Problems) -> String {
    let robot = file;
    let mut names = Names::new(&RESERVED);
    let mut floats = Floats::reserve(robot, options, &mut names);
    // Joints have their names first: they are what users write.
    let joints: Vec<String> =
        robot.joints.iter().map(|joint| names.take(&joint.name, joints::around(joint))).collect();
    let of_link: Vec<&str> = OF_LINK.iter().chain(OF_PLACE).copied().collect();
    let links: Vec<String> = robot.links.iter().map(|link| names.take(&link.name, &of_link)).collect();
    let of_loop: Vec<&str> = OF_LOOP.iter().chain(OF_PLACE).copied().collect();
    let loop_names: Vec<String> =
        robot.loops.iter().map(|closed| names.take(&closed.name, &of_loop)).collect();
    for (joint, name) in robot.joints.iter().zip(&joints) {
        let is_named = !matches!(joint.kind, JointKind::Fixed | JointKind::Floating);
        if is_named && *name != joint.name {
            problems.note(&joint.span, format!("joint `{}` is named `{name}`", joint.name));
        }
    }
    let motion = Motion::new(robot, &mut names);
    floats.name(&links, &mut names);
    let carried = vec![None; robot.links.len()];
    let vertical = Vertical::new(&robot.gravity);
    let mut robot = robot.clone();
    let parameters = parameters(&mut robot, &links, &loop_names, stay, &mut names);
    let mut writer = Writer {
        robot: &robot,
        file,
        parameters,
        options,
        vertical,
        floats,
        links,
        joints,
        loop_names,
        carried,
        out: String::new(),
        kinetic: Vec::new(),
        potential: Vec::new(),
        bodies: Vec::new(),
        motion,
        moved: vec![None; robot.joints.len()],
        is_written: vec![false; robot.links.len()],
        is_declared: vec![false; robot.joints.len()],
    };
    writer.root(problems);
    for k in 0..robot.joints.len() {
        writer.joint(k, problems);
    }
    writer.loops(problems);
    writer.frames(problems);
    writer.end()
}

impl Writer<'_> {
    fn line(&mut self, line: &str) {
        _ = writeln!(self.out, "{line}");
    }

    /// Whether a body with mass or inertia is this link, or behind it; by fixed joints alone, if asked for.
    fn has_inertia(&self, link: usize, rigidly: bool) -> bool {
        !self.robot.links[link].inertias.is_empty()
            || self.robot.joints.iter().any(|joint| {
                let goes_on = !rigidly || matches!(joint.kind, JointKind::Fixed);
                joint.parent == link && goes_on && self.has_inertia(joint.child, rigidly)
            })
    }

    /// Whether gravity pulls on a link that moves, on this one or behind it.
    fn has_weight(&self, link: usize, moves: bool) -> bool {
        (moves && self.parameters.parts[link].iter().any(|part| part.weight.is_some()))
            || self.robot.joints.iter().filter(|joint| joint.parent == link).any(|joint| match joint.kind {
                JointKind::Fixed => self.has_weight(joint.child, moves),
                JointKind::Floating => false,
                _ => self.has_weight(joint.child, true),
            })
    }

    /// Whether a joint behind a link moves a body by the velocities of the link.
    fn has_motion(&self, link: usize) -> bool {
        self.robot.joints.iter().filter(|joint| joint.parent == link).any(|joint| match joint.kind {
            JointKind::Fixed => self.has_motion(joint.child),
            JointKind::Floating => false,
            _ => self.has_inertia(joint.child, false),
        })
    }

    /// Whether anything of a link depends on its rotation: more than a point in its origin, or a joint.
    fn is_turned(&self, link: usize) -> bool {
        let of_body = self.parameters.parts[link]
            .iter()
            .any(|part| part.matrix.is_some() || part.pose.place.iter().any(|number| !number.is_zero()));
        let mut joints = self.robot.joints.iter().filter(|joint| joint.parent == link);
        of_body || joints.any(|joint| self.has_inertia(joint.child, false))
    }

    fn root(&mut self, problems: &mut Problems) {
        let root = self.robot.root;
        let name = self.links[root].clone();
        let span = &self.robot.links[root].span;
        if self.options.floating {
            let help = "leave out `--floating`: the floating joint is the free motion";
            if self.robot.has_ground {
                problems.error(span, "the root is the ground, which does not float", help);
            } else if !self.floats.joints.is_empty() {
                problems.error(span, "the base floats, and a joint is floating", help);
            }
            self.floating(root, &self.file.start.clone());
            return;
        }
        let is_named = self.has_motion(root);
        if is_named {
            self.line(&format!("// {}, at rest.", self.robot.links[root].name));
        }
        for (prefix, value) in [("w", ZERO), ("v", ZERO)].into_iter().filter(|_| is_named) {
            self.line(&format!("let {prefix}_{name} = {value};"));
        }
        let vertical = self.vertical.as_ref().filter(|_| is_named && self.has_weight(root, false));
        if let Some(up) = vertical.map(|vertical| vertical.up.clone()) {
            let up = match places::turn_of(&self.file.start) {
                Some(turn) => format!("transpose({turn})*{up}"),
                None => up,
            };
            self.line(&format!("let up_{name} = {up};"));
            self.line(&format!("let h_{name} = 0;"));
        }
        self.carried[root] = Some(Carried { carrier: root, place: None, turn: None });
        if self.has_inertia(root, true) {
            let message = format!("masses at rest with `{}` are left out", self.robot.links[root].name);
            match self.robot.has_ground {
                true => problems.note(span, message),
                false => problems.note_with_help(span, message, "with `--floating` it moves"),
            }
        }
    }

    /// A link that moves freely: its velocities in its frame, the vertical and its height.
    fn floating(&mut self, link: usize, start: &[Pose]) {
        let name = self.links[link].clone();
        let items = self.floats.items(link, &self.robot.links[link].name, self.vertical.as_ref(), start);
        self.out.push_str(&items);
        let own = self.floats.of(link);
        self.out.push_str(&format!("let w_{name} = {};\nlet v_{name} = {};\n", own.spin, own.velocity));
        if self.vertical.is_some() && self.has_weight(link, true) {
            self.out.push_str(&format!("let up_{name} = {};\nlet h_{name} = {};\n", own.up, own.height));
        }
        self.carried[link] = Some(Carried { carrier: link, place: None, turn: None });
        self.body(link);
    }

    fn joint(&mut self, k: usize, problems: &mut Problems) {
        let joint = &self.robot.joints[k];
        if matches!(joint.kind, JointKind::Floating) {
            self.free(k, problems);
            return;
        }
        let Some(parent) = self.carried[joint.parent].clone() else { return };
        let (link, name) = (joint.child, self.links[joint.child].clone());
        let behind = self.has_inertia(link, false);
        if matches!(joint.kind, JointKind::Fixed) {
            // Masses at rest say nothing.
            let rests = parent.carrier == self.robot.root && !self.options.floating;
            if !behind || (rests && !self.has_motion(link)) {
                return;
            }
            self.line(&format!(
                "\n// {}, fixed to {}.",
                self.robot.links[link].name, self.robot.links[joint.parent].name
            ));
            self.declare_frame_of(k);
            let (place, turn) = (parent.place_of(&joint.pose), parent.turn_of(&joint.pose));
            let is_there = place == ZERO;
            if !is_there {
                self.line(&format!("let r_{name} = {place};"));
            }
            if let Some(turn) = turn.as_ref().filter(|_| self.is_turned(link)) {
                self.line(&format!("let Q_{name} = {turn};"));
            }
            self.carried[link] = Some(Carried {
                carrier: parent.carrier,
                place: (!is_there).then(|| format!("r_{name}")),
                turn: turn.map(|_| format!("Q_{name}")),
            });
            return;
        }
        if !behind {
            self.without_mass(k, problems);
            return;
        }
        let coordinates =
            self.motion.declare(&mut self.out, self.robot, &self.joints, k, self.options.limits);
        self.declare_frame_of(k);
        self.moved[k] = Some((coordinates.shift.clone(), coordinates.rotation.clone()));
        let carrier = self.links[parent.carrier].clone();
        let turn = parent.turn_of(&joint.pose);
        let mut place = parent.place_of(&joint.pose);
        if let Some(shift) = &coordinates.shift {
            let shift = turn.as_ref().map_or(shift.clone(), |turn| format!("{turn}*({shift})"));
            place = if place == ZERO { shift } else { format!("{place} + {shift}") };
            self.line(&format!("let r_{name} = {place};"));
            place = format!("r_{name}");
        }
        let factors: Vec<String> = turn.into_iter().chain(coordinates.rotation).collect();
        let back = match factors.is_empty() {
            true => String::new(),
            false => {
                self.line(&format!("let E_{name} = transpose({});", factors.join("*")));
                format!("E_{name}*")
            }
        };
        let plus = |rate: &Option<String>| rate.as_ref().map(|rate| format!(" + {rate}")).unwrap_or_default();
        let (w, v) = (plus(&coordinates.spin), plus(&coordinates.slide));
        let moved = match place == ZERO {
            true => format!("v_{carrier}"),
            false if back.is_empty() => format!("v_{carrier} + cross(w_{carrier}, {place})"),
            false => format!("(v_{carrier} + cross(w_{carrier}, {place}))"),
        };
        let raised = if place == ZERO { String::new() } else { format!(" + dot(up_{carrier}, {place})") };
        self.line(&format!("let w_{name} = {back}w_{carrier}{w};"));
        self.line(&format!("let v_{name} = {back}{moved}{v};"));
        if self.vertical.is_some() && self.has_weight(link, true) {
            self.line(&format!("let up_{name} = {back}up_{carrier};"));
            self.line(&format!("let h_{name} = h_{carrier}{raised};"));
        }
        self.carried[link] = Some(Carried { carrier: link, place: None, turn: None });
        self.body(link);
    }

    /// A joint that moves no mass: it has its forces and its followers where it follows another one.
    fn without_mass(&mut self, k: usize, problems: &mut Problems) {
        let joint = &self.robot.joints[k];
        let message = format!("joint `{}` moves links without mass and inertia", joint.name);
        if joint.mimic.is_none() {
            let help =
                format!("give them an `inertial`, make the joint fixed, or write `--lock {}`", joint.name);
            problems.error(&joint.span, message, &help);
            return;
        }
        let is_followed =
            self.robot.joints.iter().any(|other| other.mimic.as_ref().is_some_and(|mimic| mimic.joint == k));
        let is_driven = self.robot.motors.iter().any(|motor| motor.joint == k);
        let has_forces = [&joint.damping, &joint.friction, &joint.armature].iter().any(|n| !n.is_zero());
        if !(is_followed || is_driven || has_forces || joint.spring.is_some()) {
            problems.note(&joint.span, format!("{message}: it is left out"));
            return;
        }
        let own = self.motion.declare(&mut self.out, self.robot, &self.joints, k, self.options.limits);
        self.moved[k] = Some((own.shift, own.rotation));
    }

    /// A joint that lets a link move freely of everything at rest.
    fn free(&mut self, k: usize, problems: &mut Problems) {
        let joint = &self.robot.joints[k];
        let (link, name) = (joint.child, self.links[joint.child].clone());
        let Some(mut start) = self.at_rest(joint.parent) else {
            let message = format!("joint `{}` is floating, and its parent moves", joint.name);
            let help = "join it to the link at rest, or make it another joint";
            problems.error(&joint.span, message, help);
            return;
        };
        if !self.has_inertia(link, false) {
            let help = "give it an `inertial`, or make the joint fixed";
            let message = format!("joint `{}` moves links without mass and inertia", joint.name);
            problems.error(&joint.span, message, help);
            return;
        }
        start.push(joint.pose.clone());
        self.out.push('\n');
        self.declare_frame_of(k);
        let free = self.floats.of(link);
        self.motion.free(&mut self.out, joint, &name, (&free.spin, &free.velocity));
        let (place, attitude) = free.pose();
        self.moved[k] = Some((Some(place.to_owned()), Some(attitude.to_owned())));
        self.floating(link, &start);
    }

    /// The frame of a link in space where only fixed joints are before it; nothing for one that moves.
    fn at_rest(&self, link: usize) -> Option<Vec<Pose>> {
        let Some(joint) = self.file.joints.iter().find(|joint| joint.child == link) else {
            return (!self.options.floating).then(|| self.file.start.clone());
        };
        let mut frames = match joint.kind {
            JointKind::Fixed => self.at_rest(joint.parent)?,
            _ => return None,
        };
        frames.push(joint.pose.clone());
        Some(frames)
    }

    fn loops(&mut self, problems: &mut Problems) {
        for k in 0..self.robot.loops.len() {
            let Some(ways) = self.of_loops().ways(k, problems) else { continue };
            for joint in ways.iter().flat_map(|way| &way.joints) {
                self.declare_frame_of(*joint);
                self.has_coordinates(*joint, problems);
            }
            let items = self.of_loops().items(k, &ways, problems);
            self.out.push_str(&items);
        }
    }

    fn of_loops(&self) -> Loops<'_> {
        Loops {
            robot: self.robot,
            file: self.file,
            names: &self.loop_names,
            declared: &self.parameters.of_loop,
            moved: &self.moved,
        }
    }

    /// The numbers of the frame of a joint as parameters, once.
    fn declare_frame_of(&mut self, joint: usize) {
        if !std::mem::replace(&mut self.is_declared[joint], true) {
            self.out.push_str(&self.parameters.of_joint[joint].clone());
        }
    }

    /// Links that fixed joints join to this one, each with its frame.
    fn rigid(&self, link: usize) -> Vec<usize> {
        let mut all = vec![link];
        let mut next = 0;
        while next < all.len() {
            let parent = all[next];
            let fixed =
                self.robot.joints.iter().filter(|j| j.parent == parent && matches!(j.kind, JointKind::Fixed));
            all.extend(fixed.map(|j| j.child));
            next += 1;
        }
        all
    }

    /// Kinetic and potential energy of everything that moves with a link.
    fn body(&mut self, link: usize) {
        if !self.has_inertia(link, true) {
            return;
        }
        let name = self.links[link].clone();
        let (mut masses, mut moments, mut weights) = (Vec::new(), Vec::new(), Vec::new());
        let (mut all, mut declared) = (Vec::new(), String::new());
        for part in self.rigid(link) {
            let frame = match part == link {
                true => Carried { carrier: link, place: None, turn: None },
                false => self.frame_of(part, link),
            };
            self.is_written[part] = true;
            for part in &self.parameters.parts[part] {
                declared.push_str(&part.items);
                all.push((part, frame.place_of(&part.pose), frame.turn_of(&part.pose)));
            }
        }
        let has_mass = all.iter().any(|(part, ..)| part.mass.is_some());
        for (part, place, turn) in &all {
            if let Some(mass) = &part.mass {
                masses.push((mass.clone(), place.clone()));
            }
            if let Some(weight) = &part.weight {
                weights.push((weight.clone(), place.clone()));
            }
            if let Some(matrix) = part.matrix.clone() {
                moments.push(match turn {
                    Some(turn) => format!("{turn}*{matrix}*transpose({turn})"),
                    None => matrix,
                });
            }
        }
        self.out.push_str(&declared);
        let is_lifted = weights != masses;
        if let [(mass, place)] = &masses[..] {
            let (mass, place) = (mass.clone(), place.clone());
            self.line(&format!("let m_{name} = {mass};"));
            self.line(&format!("let c_{name} = {place};"));
        } else if has_mass {
            let sum = |terms: Vec<String>| terms.join(" + ");
            for (_, place) in &mut masses {
                if place.contains(" + ") {
                    *place = format!("({place})");
                }
            }
            let total = sum(masses.iter().map(|(mass, _)| mass.clone()).collect());
            let moment = sum(masses.iter().map(|(mass, place)| format!("{mass}*{place}")).collect());
            self.line(&format!("let m_{name} = {total};"));
            self.line(&format!("let c_{name} = ({moment})/m_{name};"));
            for (mass, place) in &masses {
                // The parallel-axis theorem: `m (|a|^2 - a a^T) = -m hat(a)^2`.
                moments.push(format!("{mass}*hat({place} - c_{name})*hat(c_{name} - {place})"));
            }
        }
        if !moments.is_empty() {
            self.line(&format!("let I_{name} = {};", moments.join("\n    + ")));
        }
        self.bodies.push((link, has_mass, !moments.is_empty()));
        let mut energies = Vec::new();
        if has_mass {
            self.line(&format!("let u_{name} = v_{name} + cross(w_{name}, c_{name});"));
            energies.push(format!("m_{name}/2*dot(u_{name}, u_{name})"));
            if !is_lifted {
                weights = vec![(format!("m_{name}"), format!("c_{name}"))];
            }
            if self.vertical.is_some() && !weights.is_empty() {
                let of = |(mass, at): &(String, String)| format!("{mass}*(h_{name} + dot(up_{name}, {at}))");
                let terms: Vec<String> = weights.iter().map(of).collect();
                self.line(&format!("let U_{name} = {};", terms.join(" + ")));
                self.potential.push(format!("U_{name}"));
            }
        }
        if !moments.is_empty() {
            energies.push(format!("dot(w_{name}, I_{name}*w_{name})/2"));
        }
        self.line(&format!("let T_{name} = {};", energies.join(" + ")));
        self.kinetic.push(format!("T_{name}"));
    }

    /// The frame of a link in that of the link that carries it, by the names that its own lines define.
    fn frame_of(&self, part: usize, link: usize) -> Carried {
        let mut chain = Vec::new();
        let mut at = part;
        while at != link {
            let Some(joint) = self.robot.joints.iter().find(|joint| joint.child == at) else { break };
            chain.push(joint);
            at = joint.parent;
        }
        let mut frame = Carried { carrier: link, place: None, turn: None };
        for joint in chain.iter().rev() {
            let name = &self.links[joint.child];
            let has_place = frame.place_of(&joint.pose) != ZERO;
            let has_turn = frame.turn_of(&joint.pose).is_some();
            frame.place = has_place.then(|| format!("r_{name}"));
            frame.turn = has_turn.then(|| format!("Q_{name}"));
        }
        frame
    }

    fn end(mut self) -> String {
        let kinetic = self.kinetic.iter().chain(&self.motion.kinetic).cloned().collect::<Vec<_>>();
        let mut lagrangian = kinetic.join("\n    + ");
        if !self.potential.is_empty() {
            _ = write!(lagrangian, "\n    - g*({})", self.potential.join(" + "));
        }
        for spring in &self.motion.springs {
            _ = write!(lagrangian, "\n    - {spring}");
        }
        self.line(&format!("\nlagrangian = {lagrangian};"));
        let forces = std::mem::take(&mut self.motion.forces);
        if !forces.is_empty() {
            self.out.push('\n');
            self.out.push_str(&forces);
        }
        let mut head = std::mem::take(&mut self.parameters.head);
        // Masses at rest are of the sum of all.
        for (link, parts) in self.parameters.parts.iter().enumerate() {
            if self.robot.total_mass.is_some() && !self.is_written[link] {
                parts.iter().for_each(|part| head.push_str(&part.of_mass));
            }
        }
        if let Some(vertical) = self.vertical.as_ref().filter(|_| !self.potential.is_empty()) {
            head.push_str(&vertical.gravity);
        }
        if self.motion.has_friction {
            head.push_str(
                "/// Speed within which dry friction changes its sign, in rad/s or m/s.\n\
                 param friction_speed = 0.01 where friction_speed > 0;\n",
            );
        }
        if self.options.limits == Limits::Spring && self.motion.has_limits {
            head.push_str(
                "/// Stiffness of the springs at the limits of joints, in N m/rad or N/m.\n\
                 param limit_stiffness = 1000 where limit_stiffness >= 0;\n\
                 /// Length over which these springs begin, in rad or m.\n\
                 param limit_width = 0.001 where limit_width > 0;\n",
            );
        }
        format!("{head}\n{}", self.out)
    }
}
