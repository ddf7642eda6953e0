//! The element `sdf` with one model: its links and joints.
//!
//! A joint moves the child about the origin of the joint's frame. Links here have their origin in the joint: each is
//! the frame of its link, moved by an offset, which is taken off everything in the link.
//!
//! Deliberately does not know: the model language.

use std::collections::BTreeMap;

use super::frames::{Frames, MODEL, WORLD, is_on, number, numbers, pose, switch};
use super::joints::joints;
use crate::number::{Number, zeros};
use crate::robot::{End, Held, Inertia, Joint, JointKind, Link, Loop, Mass, Mimic, Moments, Pose, Robot};
use crate::xml::{Element, Reader, head, place};

/// Reads the element `sdf`. Nothing after a problem.
pub(crate) fn read<'a>(reader: &Reader<'a>, root: Element<'a>, file_stem: &str) -> Option<Robot> {
    reader.attribute(root, "version");
    let mut models = reader.children(root, "model");
    let mut gravity = Robot::earth();
    for world in reader.children(root, "world") {
        models.extend(reader.children(world, "model"));
        gravity = match reader.child(world, "gravity") {
            Some(element) => numbers(reader, element).unwrap_or(gravity),
            None => {
                reader.note(&head(world), "the world has no `gravity`, and that of the format, 9.8 m/s^2");
                [Number::zero(), Number::zero(), Number::decimal("-9.8").unwrap_or_else(Number::zero)]
            }
        };
        for joint in reader.children(world, "joint") {
            let help = "write it into the model, with `world` as its parent";
            reader.error(&head(joint), "a joint stands in the world", help);
        }
    }
    let [model] = models[..] else {
        let at = models.get(1).map_or_else(|| head(root), |second| head(*second));
        let message = format!("the file has {} models", models.len());
        reader.error(&at, message, "write one model a file");
        return None;
    };
    let name = reader.attribute(model, "name").unwrap_or(file_stem).to_owned();
    let placed = stand(reader, model, &name);
    for tag in ["model", "include"] {
        for nested in reader.children(model, tag) {
            let shown = nested.attribute("name").map(|name| format!(" `{name}`")).unwrap_or_default();
            let message = format!("the model has another one within, by `{tag}`{shown}");
            reader.error(&head(nested), message, "write its links and joints into this model");
        }
    }
    let mut builder = Builder {
        reader,
        frames: Frames::new(placed, head(model)),
        links: Vec::new(),
        by_name: BTreeMap::new(),
        joints: Vec::new(),
        loops: Vec::new(),
        offsets: Vec::new(),
        attached: BTreeMap::new(),
        mimics: Vec::new(),
    };
    builder.links(model);
    builder.joints(model);
    let start = builder.start();
    builder.followers();
    if builder.links.is_empty() {
        reader.error(&head(model), "the model has no links", "a model has `link` and `joint` elements");
        return None;
    }
    Some(Robot {
        name,
        has_ground: builder.by_name.contains_key("world"),
        links: builder.links,
        joints: builder.joints,
        root: 0,
        start,
        motors: Vec::new(),
        loops: builder.loops,
        drives_all: true,
        gravity,
        total_mass: None,
    })
}

/// The pose of the model in the world, and what it cannot be.
fn stand<'a>(reader: &Reader<'a>, model: Element<'a>, name: &str) -> Pose {
    let (pose, relative_to) = pose(reader, model);
    let moved = "the pose of the model in the world";
    if let Some(frame) = relative_to.filter(|frame| *frame != WORLD) {
        let help = "write the pose without `relative_to`";
        reader.error(&head(model), format!("{moved} is relative to `{frame}`"), help);
    }
    if let Some(frame) = reader.attribute(model, "placement_frame").filter(|frame| !frame.is_empty()) {
        let help = "write the pose of the model itself, without `placement_frame`";
        reader.error(
            &place(model, "placement_frame"),
            format!("{moved} is that of its frame `{frame}`"),
            help,
        );
    }
    if switch(reader, model, "static") == Some(true) {
        let help = "remove `static`, or import a model that moves";
        reader.error(&head(model), format!("nothing moves: the model `{name}` is static"), help);
    }
    pose
}

struct Builder<'a, 'r> {
    reader: &'r Reader<'a>,
    frames: Frames,
    links: Vec<Link>,
    by_name: BTreeMap<String, usize>,
    joints: Vec<Joint>,
    loops: Vec<Loop>,
    /// Origins of links in the frames of the file.
    offsets: Vec<[Number; 3]>,
    /// What frames are attached to, by their names.
    attached: BTreeMap<&'a str, &'a str>,
    /// Axes with an element `mimic`, by the places of their joints.
    mimics: Vec<(usize, Element<'a>)>,
}

/// A joint of the file with the ends that it names.
struct Ends<'a> {
    element: Element<'a>,
    name: &'a str,
    parent: &'a str,
    child: &'a str,
}

impl<'a> Builder<'a, '_> {
    fn links(&mut self, model: Element<'a>) {
        let reader = self.reader;
        for element in reader.children(model, "link") {
            let Some(name) = reader.required(element, "name") else { continue };
            self.frames.add(reader, element, name, MODEL);
            let inertias = inertia(reader, element, name).into_iter().collect();
            self.link(name, inertias, place(element, "name"));
        }
        for element in reader.children(model, "frame") {
            let Some(name) = reader.required(element, "name") else { continue };
            let attached = reader.attribute(element, "attached_to").filter(|attached| !attached.is_empty());
            self.frames.add(reader, element, name, attached.unwrap_or(MODEL));
            if let Some(attached) = attached {
                self.attached.insert(name, attached);
            }
        }
    }

    fn link(&mut self, name: &str, inertias: Vec<Inertia>, span: std::ops::Range<usize>) -> usize {
        self.by_name.insert(name.to_owned(), self.links.len());
        self.links.push(Link { inertias, ..Link::new(name.to_owned(), span) });
        self.offsets.push(zeros());
        self.links.len() - 1
    }

    fn joints(&mut self, model: Element<'a>) {
        let reader = self.reader;
        let mut all = Vec::new();
        for element in reader.children(model, "joint") {
            let Some(name) = reader.required(element, "name") else { continue };
            let end = |role: &str| {
                let found = reader.child(element, role).and_then(|end| end.text()).map(str::trim);
                if found.is_none() {
                    let help = format!("write `<{role}>..</{role}>`");
                    reader.error(&head(element), format!("joint `{name}` has no `{role}`"), &help);
                }
                found
            };
            let (Some(parent), Some(child)) = (end("parent"), end("child")) else { continue };
            self.frames.add(reader, element, name, child);
            all.push(Ends { element, name, parent, child });
        }
        for k in 0..all.len() {
            let [parent, child] = [all[k].parent, all[k].child].map(|name| self.attached(model, &all, name));
            (all[k].parent, all[k].child) = (parent, child);
        }
        if all.iter().any(|joint| joint.parent == "world") {
            self.link("world", Vec::new(), head(model));
        }
        let closing = closing(&all);
        // Offsets first: a child's place is by that of its parent.
        let (mut made, mut cut) = (Vec::new(), Vec::new());
        for ends in &all {
            let known = |end: &str| {
                let found = self.by_name.get(end).copied();
                if found.is_none() {
                    let message = format!("joint `{}` names `{end}`, which is no link", ends.name);
                    reader.error(&head(ends.element), message, "name a link of this model");
                }
                found
            };
            let (Some(parent), Some(child)) = (known(ends.parent), known(ends.child)) else { continue };
            if closing.contains(&ends.name) {
                cut.push((ends, (parent, child)));
                continue;
            }
            let Some(steps) = self.frames.between(reader, ends.child, ends.name) else { continue };
            // Nothing turns about the place of a joint that slides or is fixed.
            let turns = !matches!(ends.element.attribute("type"), Some("fixed" | "prismatic"));
            let behind = match &steps[..] {
                _ if !turns => ends.child,
                [] => ends.child,
                [one] if one.anchor.iter().all(Number::is_zero) => {
                    self.offsets[child] = one.place.clone();
                    ends.child
                }
                _ => ends.name,
            };
            let turned = |frame: &str| self.turned(ends, behind, frame);
            let Some(own) = joints(reader, ends.element, ends.name, &turned) else { continue };
            made.push((ends, behind, (parent, child), own));
        }
        for (ends, behind, links, own) in made {
            self.join(ends, behind, links, own);
        }
        for (ends, links) in cut {
            self.close(ends, links);
        }
        for (link, offset) in self.links.iter_mut().zip(&self.offsets) {
            link.origin = offset.each_ref().map(Number::negative);
            for inertia in &mut link.inertias {
                subtract(&mut inertia.pose.place, offset);
            }
        }
    }

    /// The rotation of a frame in the one behind a joint, where that is not one. Nothing after a problem.
    fn turned(&self, ends: &Ends<'a>, behind: &str, frame: &str) -> Option<Option<String>> {
        let reader = self.reader;
        if !self.frames.has(frame) {
            let message = format!("the axis of joint `{}` is by `{frame}`, which is no frame", ends.name);
            reader.error(&head(ends.element), message, "name a link, a joint or a frame of this model");
            return None;
        }
        let steps = self.frames.between(reader, behind, frame)?;
        let turns: Vec<String> = steps.iter().filter_map(|step| step.turn.text()).collect();
        Some((!turns.is_empty()).then(|| turns.join("*")))
    }

    /// Where the link that is no child is at the start.
    fn start(&self) -> Vec<Pose> {
        let is_child = |link: usize| self.joints.iter().any(|joint| joint.child == link);
        let root = (0..self.links.len()).find(|link| !is_child(*link));
        let name = root.map(|root| self.links[root].name.as_str()).filter(|name| self.frames.has(name));
        name.and_then(|name| self.frames.between(self.reader, WORLD, name)).unwrap_or_default()
    }

    /// The link that a frame is attached to, by names; the name of a link is that of its frame, and frames of the model
    /// are attached to its canonical link.
    fn attached(&self, model: Element<'a>, all: &[Ends<'a>], name: &'a str) -> &'a str {
        let mut last = name;
        for _ in 0..=self.attached.len() + all.len() {
            let of_joint = all.iter().find(|joint| joint.name == last).map(|joint| joint.child);
            match self.attached.get(last).copied().or(of_joint) {
                Some(next) => last = next,
                None if !self.by_name.contains_key(last) && last != WORLD && self.frames.has(last) => {
                    let canonical = self.reader.attribute(model, "canonical_link");
                    let first = model.children().find(|child| child.tag_name().name() == "link");
                    return canonical.or(first.and_then(|link| link.attribute("name"))).unwrap_or(last);
                }
                None => return last,
            }
        }
        name
    }

    /// Puts the joints of an element between two links, with links of their own where frames are turned on the way.
    /// `behind` is the frame that the joints move: that of the child, or that of the joint itself, to which the child
    /// is fixed.
    fn join(&mut self, ends: &Ends<'a>, behind: &str, (parent, child): (usize, usize), own: Vec<Joint>) {
        let Some(mut steps) = self.steps_to(ends, parent, behind) else { return };
        if let Some(last) = steps.last_mut() {
            let end = &self.offsets[child];
            let target = if last.turn.is_none() { &mut last.place } else { &mut last.anchor };
            *target = std::array::from_fn(|k| target[k].plus(&end[k]));
        }
        let n_before = steps.len() - 1;
        let mut at = self.fix(ends, parent, steps.drain(..n_before), None);
        let n_others = self.joints.len();
        let is_apart = behind != ends.child;
        let n_own = own.len();
        for (n, mut joint) in own.into_iter().enumerate() {
            let link = match n + 1 == n_own {
                true if !is_apart => child,
                true => self.link(&format!("{}_moved", ends.name), Vec::new(), place(ends.element, "name")),
                false => self.link(&format!("{}_cross", ends.name), Vec::new(), place(ends.element, "name")),
            };
            (joint.parent, joint.child) = (at, link);
            if let Some(step) = steps.pop() {
                joint.pose = step;
            }
            let axis = if n == 0 { "axis" } else { "axis2" };
            let axis = ends.element.children().find(|child| child.tag_name().name() == axis);
            if let Some(mimic) = &mut joint.mimic {
                mimic.joint += n_others;
            }
            if let Some(mimic) = axis.and_then(|axis| self.reader.child(axis, "mimic")) {
                self.mimics.push((self.joints.len(), mimic));
            }
            self.joints.push(joint);
            at = link;
        }
        if is_apart && let Some(steps) = self.frames.between(self.reader, behind, ends.child) {
            self.fix(ends, at, steps.into_iter(), Some(child));
        }
    }

    /// The steps to a frame from the link of the parent.
    fn steps_to(&self, ends: &Ends<'a>, parent: usize, to: &str) -> Option<Vec<Pose>> {
        let mut steps = self.frames.between(self.reader, ends.parent, to)?;
        let start = &self.offsets[parent];
        if !start.iter().all(Number::is_zero) || steps.is_empty() {
            let place = start.each_ref().map(Number::negative);
            match steps.first_mut() {
                Some(first) => first.place = std::array::from_fn(|k| first.place[k].plus(&place[k])),
                None => steps.push(Pose { place, ..Pose::identity() }),
            }
        }
        Some(steps)
    }

    /// Has a joint close a loop: an equation between its links.
    fn close(&mut self, ends: &Ends<'a>, (parent, child): (usize, usize)) {
        let reader = self.reader;
        let turned = |frame: &str| self.turned(ends, ends.name, frame);
        let Some(own) = joints(reader, ends.element, ends.name, &turned) else { return };
        let kinds: Vec<&JointKind> = own.iter().map(|joint| &joint.kind).collect();
        let held = match kinds[..] {
            [JointKind::Fixed] => Held::Frame,
            [JointKind::Revolute(axis)] => Held::Axis(axis.clone()),
            [JointKind::Prismatic(axis)] => Held::Slide(axis.clone()),
            [JointKind::Revolute(axis), JointKind::Revolute(other)] => {
                Held::Cross(axis.clone(), other.clone())
            }
            [JointKind::Ball] => Held::Point,
            _ => {
                let help = "let a joint that is no screw, and that no other one follows, close the loop";
                let message = format!("joint `{}` closes a loop, and has no equation for that", ends.name);
                reader.error(&place(ends.element, "name"), message, help);
                return;
            }
        };
        let message = format!(
            "joint `{}` closes a loop: it is an equation, and has no coordinate, no forces and no limits",
            ends.name
        );
        reader.note(&place(ends.element, "name"), message);
        let Some(mut steps) = self.steps_to(ends, parent, ends.name) else { return };
        let Some(pose) = steps.pop() else { return };
        let at = self.fix(ends, parent, steps.into_iter(), None);
        self.loops.push(Loop {
            name: ends.name.to_owned(),
            held,
            first: (at, pose),
            second: End { link: child, pose: None },
            span: place(ends.element, "name"),
        });
    }

    /// Fixes frames to a link, one behind the other, the last one to `end`; the last link.
    fn fix(
        &mut self,
        ends: &Ends<'a>,
        mut at: usize,
        steps: impl ExactSizeIterator<Item = Pose>,
        end: Option<usize>,
    ) -> usize {
        let span = place(ends.element, "name");
        let n_steps = steps.len();
        for (n, step) in steps.enumerate() {
            let name = match end {
                None => format!("{}_frame{}", ends.name, n + 1),
                Some(_) => format!("{}_back{}", ends.name, n + 1),
            };
            let link = match end.filter(|_| n + 1 == n_steps) {
                Some(end) => end,
                None => self.link(&name, Vec::new(), span.clone()),
            };
            let mut joint = Joint::new(name, JointKind::Fixed, (at, link), span.clone());
            joint.pose = step;
            self.joints.push(joint);
            at = link;
        }
        at
    }
}

impl<'a> Builder<'a, '_> {
    /// Has joints follow others.
    fn followers(&mut self) {
        let reader = self.reader;
        for (follower, element) in std::mem::take(&mut self.mimics) {
            let Some(name) = reader.required(element, "joint") else { continue };
            let Some(leader) = self.joints.iter().position(|joint| joint.name == name) else {
                let message = format!("there is no joint `{name}` with one axis");
                reader.error(&place(element, "joint"), message, "name a joint of this model");
                continue;
            };
            reader.attribute(element, "axis");
            let value = |name: &str| number(reader, element, name);
            let factor = value("multiplier").unwrap_or_else(Number::one);
            let offset = value("offset").unwrap_or_else(Number::zero);
            let offset = match value("reference").filter(|reference| !reference.is_zero()) {
                None => offset,
                Some(from) => {
                    let text = format!("{} - {}*{}", offset.text, factor.factor(), from.factor());
                    Number::expression(text, offset.value - factor.value * from.value)
                }
            };
            self.joints[follower].mimic = Some(Mimic { joint: leader, coefficients: vec![offset, factor] });
        }
    }
}

/// Names of joints that close loops: of several joints with one child the last that has an equation, without a motion
/// that others follow or forces act along if there is one, and with few equations about axes.
fn closing<'a>(all: &[Ends<'a>]) -> Vec<&'a str> {
    let kind = |joint: &Ends<'a>| joint.element.attribute("type").unwrap_or_default();
    let has = |joint: &Ends<'a>, tags: &[&str]| {
        joint.element.descendants().any(|own| tags.contains(&own.tag_name().name()))
    };
    let is_followed = |joint: &Ends<'a>| {
        let mimics = all.iter().flat_map(|other| other.element.descendants());
        mimics
            .filter(|own| own.tag_name().name() == "mimic")
            .any(|own| own.attribute("joint") == Some(joint.name))
    };
    let mut closing = Vec::new();
    for (k, joint) in all.iter().enumerate() {
        if all[..k].iter().any(|before| before.child == joint.child) {
            continue;
        }
        let mut own: Vec<&Ends<'a>> = all.iter().filter(|other| other.child == joint.child).collect();
        // The first one stays.
        own.sort_by_key(|joint| {
            let is_simple = matches!(kind(joint), "revolute" | "continuous" | "ball" | "fixed");
            let moves_others = has(joint, &["mimic"]) || is_followed(joint);
            let has_forces = has(joint, &["damping", "friction", "spring_stiffness", "limit"]);
            (kind(joint) != "screw" && !moves_others, !has_forces, is_simple)
        });
        closing.extend(own.iter().skip(1).map(|joint| joint.name));
    }
    closing
}

fn subtract(place: &mut [Number; 3], offset: &[Number; 3]) {
    for (own, offset) in place.iter_mut().zip(offset) {
        *own = own.minus(offset);
    }
}

fn inertia<'a>(reader: &Reader<'a>, link: Element<'a>, name: &str) -> Option<Inertia> {
    let default = |mass: Number| Inertia {
        name: name.to_owned(),
        mass: Mass::Given(mass),
        pose: Pose::identity(),
        moments: Moments::Given([
            Number::one(),
            Number::one(),
            Number::one(),
            Number::zero(),
            Number::zero(),
            Number::zero(),
        ]),
        lift: match switch(reader, link, "gravity") {
            Some(false) => Number::one(),
            _ => Number::zero(),
        },
    };
    let Some(element) = reader.child(link, "inertial") else {
        reader.note(
            &head(link),
            "links without `inertial` have the mass 1 kg and moments of 1 kg m^2, as the format says",
        );
        return Some(default(Number::one()));
    };
    if reader.attribute(element, "auto").is_some_and(|word| is_on(reader, element, "auto", word)) {
        let help = "write the mass and the moments of inertia";
        reader.error(&place(element, "auto"), format!("the inertia of link `{name}` is by its shapes"), help);
    }
    let mass = number(reader, element, "mass").unwrap_or_else(Number::one);
    if mass.value < 0.0 {
        reader.error(&head(element), "the mass is negative", "write a mass in kg");
    }
    let (pose, relative_to) = pose(reader, element);
    if relative_to.is_some() {
        let help = "write the pose in the frame of the link";
        reader.error(&head(element), format!("the mass centre of link `{name}` is by another frame"), help);
    }
    let mut inertia = Inertia { pose, ..default(mass) };
    if let (Some(matrix), Moments::Given(moments)) = (reader.child(element, "inertia"), &mut inertia.moments)
    {
        for (moment, name) in moments.iter_mut().zip(["ixx", "iyy", "izz", "ixy", "ixz", "iyz"]) {
            if let Some(value) = number(reader, matrix, name) {
                *moment = value;
            }
        }
    }
    Some(inertia)
}
