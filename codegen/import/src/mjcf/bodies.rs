//! Bodies, each with its joints one behind the other, as links.
//!
//! A joint of MuJoCo moves the body about a point of it, by the frame of the body. Links here have their origin in the
//! joint. So each link is the frame of its body, moved by an offset, which is taken off everything in the body.
//!
//! Deliberately does not know: actuators, the model language.

use std::collections::{BTreeMap, BTreeSet};

use super::geoms;
use super::joints;
use super::settings::Settings;
use crate::number::{Number, zeros};
use crate::robot::{Inertia, Joint, JointKind, Link, Pose, Robot};
use crate::xml::{Element, head, place};

/// Bodies in bodies; deeper files are refused.
const DEPTH: usize = 200;

/// Elements that make bodies, and are refused.
const MACROS: [&str; 5] = ["composite", "flexcomp", "replicate", "attach", "plugin"];

/// Where the contents of an element go.
#[derive(Clone)]
struct Inside<'a> {
    link: usize,
    /// The origin of the link in the frame of the body.
    offset: [Number; 3],
    childclass: Option<&'a str>,
    /// The name of the body.
    body: String,
    is_world: bool,
    /// Whether the masses of geoms make that of the body.
    counts_geoms: bool,
    /// The part of the weight of the body that is held up.
    lift: Number,
    depth: usize,
}

/// A frame that a body has for sensors, actuators and equations. One that no equation names is read by nobody.
pub(super) struct Site<'a> {
    element: Element<'a>,
    link: usize,
    /// The origin of the link in the frame of the body.
    offset: [Number; 3],
    childclass: Option<&'a str>,
}

impl<'a> Site<'a> {
    /// The link, and the frame in it.
    pub(super) fn read(&self, settings: &Settings<'a, '_>) -> (usize, Pose) {
        settings.reader.take(self.element);
        let of = settings.defaulted(self.element, self.childclass);
        let mut pose = settings.pose(&of);
        subtract(&mut pose.place, &self.offset);
        // The rest of it is seen.
        settings.reader.skip(self.element);
        (self.link, pose)
    }
}

pub(super) struct Bodies<'a, 'r> {
    settings: &'r Settings<'a, 'r>,
    pub(super) links: Vec<Link>,
    pub(super) joints: Vec<Joint>,
    pub(super) joint_by_name: BTreeMap<String, usize>,
    /// Links of bodies, and the origins of these in the frames of the bodies.
    pub(super) body_by_name: BTreeMap<String, (usize, [Number; 3])>,
    pub(super) site_by_name: BTreeMap<String, Site<'a>>,
    geoms: BTreeMap<String, usize>,
    /// Names that bodies and joints have in the file: those without one have others.
    given: BTreeSet<&'a str>,
}

impl<'a, 'r> Bodies<'a, 'r> {
    /// Reads everything within the elements `worldbody`.
    pub(super) fn read(settings: &'r Settings<'a, 'r>, root: Element<'a>) -> Bodies<'a, 'r> {
        let world = Link::new("world".to_owned(), head(root));
        let mut bodies = Bodies {
            settings,
            links: vec![world],
            joints: Vec::new(),
            joint_by_name: BTreeMap::new(),
            body_by_name: BTreeMap::new(),
            site_by_name: BTreeMap::new(),
            geoms: BTreeMap::new(),
            given: root.descendants().filter_map(|element| element.attribute("name")).collect(),
        };
        bodies.body_by_name.insert("world".to_owned(), (0, zeros()));
        for element in settings.reader.children(root, "worldbody") {
            let inside = Inside {
                link: 0,
                offset: zeros(),
                childclass: settings.reader.attribute(element, "childclass"),
                body: "world".to_owned(),
                is_world: true,
                counts_geoms: false,
                lift: Number::zero(),
                depth: 0,
            };
            bodies.contents(element, &inside);
        }
        bodies
    }

    /// Bodies and geoms within an element.
    fn contents(&mut self, element: Element<'a>, inside: &Inside<'a>) {
        let reader = self.settings.reader;
        let mut own = Vec::new();
        for child in reader.all(element) {
            let tag = child.tag_name().name();
            match tag {
                "body" => {
                    reader.take(child);
                    self.body(child, inside);
                }
                "frame" => {
                    reader.take(child);
                    self.frame(child, inside);
                }
                "geom" if inside.counts_geoms => {
                    let geom = self.settings.defaulted(child, inside.childclass);
                    if !geoms::has_mass(self.settings, &geom) {
                        continue;
                    }
                    reader.take(child);
                    let name = self.geom_name(child, &inside.body);
                    own.extend(geoms::inertia(self.settings, &geom, &name));
                }
                "site" => {
                    if let Some(name) = child.attribute("name") {
                        let site = Site {
                            element: child,
                            link: inside.link,
                            offset: inside.offset.clone(),
                            childclass: inside.childclass,
                        };
                        self.site_by_name.insert(name.to_owned(), site);
                    }
                }
                _ if MACROS.contains(&tag) => {
                    let message = format!("`{tag}` makes elements that the file does not say");
                    let help = "load the file into MuJoCo, and write it by `mujoco.mj_saveLastXML`";
                    reader.error(&head(child), message, help);
                }
                _ => {}
            }
        }
        for mut inertia in own {
            shift(&mut inertia, &inside.offset);
            inertia.lift = inside.lift.clone();
            self.links[inside.link].inertias.push(inertia);
        }
    }

    /// Whether the inertia of a body is that of its geoms, and not of its element `inertial`.
    fn counts_geoms(&self, body: Element<'a>) -> bool {
        let is_said = body.children().any(|child| child.tag_name().name() == "inertial");
        self.settings.inertia_from_geom.unwrap_or(!is_said)
    }

    fn geom_name(&mut self, geom: Element<'a>, body: &str) -> String {
        if let Some(name) = self.settings.reader.attribute(geom, "name") {
            return name.to_owned();
        }
        let n = self.geoms.entry(body.to_owned()).or_default();
        *n += 1;
        format!("{body}_geom{n}")
    }

    /// A frame within a body: a link that is fixed to the link of the body.
    fn frame(&mut self, element: Element<'a>, inside: &Inside<'a>) {
        let reader = self.settings.reader;
        if self.is_too_deep(element, inside) {
            return;
        }
        let own = self.settings.defaulted(element, None);
        let mut pose = self.settings.pose(&own);
        subtract(&mut pose.place, &inside.offset);
        for child in reader.all(element) {
            if matches!(child.tag_name().name(), "joint" | "freejoint" | "inertial") {
                let help = "write it into the body, by the frame of the body";
                let message = format!("`{}` stands in a `frame`", child.tag_name().name());
                reader.error(&head(child), message, help);
            }
        }
        let name =
            reader.attribute(element, "name").map_or_else(|| format!("{}_frame", inside.body), str::to_owned);
        let link = self.link(&name, head(element));
        let mut joint = Joint::new(name.clone(), JointKind::Fixed, (inside.link, link), head(element));
        joint.pose = pose;
        self.joints.push(joint);
        let within = Inside {
            link,
            offset: zeros(),
            childclass: reader.attribute(element, "childclass").or(inside.childclass),
            depth: inside.depth + 1,
            ..inside.clone()
        };
        self.contents(element, &within);
    }

    fn is_too_deep(&self, element: Element<'a>, inside: &Inside<'a>) -> bool {
        let is_deep = inside.depth >= DEPTH;
        if is_deep {
            let message = format!("bodies are more than {DEPTH} deep");
            self.settings.reader.error(&head(element), message, "split the chain");
        }
        is_deep
    }

    fn link(&mut self, name: &str, span: std::ops::Range<usize>) -> usize {
        self.links.push(Link::new(name.to_owned(), span));
        self.links.len() - 1
    }

    fn body(&mut self, element: Element<'a>, inside: &Inside<'a>) {
        let settings = self.settings;
        let reader = settings.reader;
        if self.is_too_deep(element, inside) {
            return;
        }
        let given = reader.attribute(element, "name");
        let name = given.map_or_else(
            || self.unused(self.body_by_name.len(), |k| format!("body{k}"), &self.body_by_name),
            str::to_owned,
        );
        if self.body_by_name.insert(name.clone(), (self.links.len(), zeros())).is_some() {
            let help = "give each body a name of its own";
            reader.error(&place(element, "name"), format!("body `{name}` is declared twice"), help);
        }
        let childclass = reader.attribute(element, "childclass").or(inside.childclass);
        let own = settings.defaulted(element, None);
        let mut pose = settings.pose(&own);
        subtract(&mut pose.place, &inside.offset);
        let joints: Vec<Element<'a>> = reader
            .all(element)
            .into_iter()
            .filter(|child| matches!(child.tag_name().name(), "joint" | "freejoint"))
            .collect();
        let span = place(element, "name");
        let mut at = inside.link;
        let mut offset = zeros();
        for (n, child) in joints.iter().enumerate() {
            reader.take(*child);
            let joint_name = self.joint_name(*child, &name, n);
            let is_last = n + 1 == joints.len();
            let link_name = if is_last { name.clone() } else { format!("{name}_{joint_name}") };
            let link = self.link(&link_name, span.clone());
            let of = settings.defaulted(*child, childclass);
            let Some((mut joint, held)) = joints::joint(settings, &of, &joint_name, (at, link)) else {
                return;
            };
            let is_free = matches!(joint.kind, JointKind::Floating);
            if is_free && (!inside.is_world || joints.len() > 1) {
                let message =
                    format!("joint `{joint_name}` is free, and not the one joint of a body of the world");
                reader.error(&joint.span, message, "put the body into `worldbody`, with no other joint");
            }
            let held = held.unwrap_or_else(|| offset.clone());
            let moved: [Number; 3] = std::array::from_fn(|k| held[k].minus(&offset[k]));
            joint.pose = match n {
                0 => placed(pose.clone(), moved),
                _ => Pose { place: moved, ..Pose::identity() },
            };
            offset = held;
            self.joint_by_name.insert(joint_name, self.joints.len());
            self.joints.push(joint);
            at = link;
        }
        if joints.is_empty() {
            at = self.link(&name, span.clone());
            let mut joint = Joint::new(name.clone(), JointKind::Fixed, (inside.link, at), span.clone());
            joint.pose = pose;
            self.joints.push(joint);
        }
        if reader.attribute(element, "mocap") == Some("true") {
            reader.note(
                &place(element, "mocap"),
                format!("body `{name}` is moved from outside, and rests here"),
            );
        }
        self.body_by_name.insert(name.clone(), (at, offset.clone()));
        self.links[at].origin = offset.each_ref().map(Number::negative);
        let lift = settings.lift(reader.number(element, "gravcomp"));
        if lift.value < 0.0 {
            let help = "write the part of the weight that is held up, or change `gravity`";
            reader.error(&place(element, "gravcomp"), "`gravcomp` is negative", help);
        }
        self.own_inertia(element, &name, at, &offset, &lift);
        let within = Inside {
            link: at,
            offset,
            childclass,
            body: name,
            is_world: false,
            counts_geoms: self.counts_geoms(element),
            lift,
            depth: inside.depth + 1,
        };
        self.contents(element, &within);
    }

    /// The first name from a number on that nothing in the file has.
    fn unused<T>(&self, first: usize, name: impl Fn(usize) -> String, taken: &BTreeMap<String, T>) -> String {
        let mut names = (first..).map(name);
        let is_unused = |name: &String| !self.given.contains(name.as_str()) && !taken.contains_key(name);
        names.find(is_unused).unwrap_or_default()
    }

    fn joint_name(&mut self, element: Element<'a>, body: &str, n: usize) -> String {
        let reader = self.settings.reader;
        let given = reader.attribute(element, "name");
        let counted =
            |k: usize| if k == 0 { format!("{body}_joint") } else { format!("{body}_joint{}", k + 1) };
        let name = given.map_or_else(|| self.unused(n, counted, &self.joint_by_name), str::to_owned);
        if self.joint_by_name.contains_key(&name) {
            let help = "give each joint a name of its own";
            reader.error(&place(element, "name"), format!("joint `{name}` is declared twice"), help);
        }
        name
    }

    /// The inertia that an element of the body says, unless geoms do.
    fn own_inertia(
        &mut self,
        element: Element<'a>,
        name: &str,
        link: usize,
        offset: &[Number; 3],
        lift: &Number,
    ) {
        if self.counts_geoms(element) {
            return;
        }
        let reader = self.settings.reader;
        if let Some(inertial) = reader.child(element, "inertial")
            && let Some(mut inertia) = geoms::inertial(self.settings, inertial, name)
        {
            shift(&mut inertia, offset);
            inertia.lift = lift.clone();
            self.links[link].inertias.push(inertia);
        }
    }

    /// The robot of everything that was read.
    pub(super) fn finish(self, name: String) -> Robot {
        Robot {
            name,
            links: self.links,
            joints: self.joints,
            root: 0,
            start: Vec::new(),
            has_ground: true,
            motors: Vec::new(),
            loops: Vec::new(),
            drives_all: false,
            gravity: self.settings.gravity(),
            total_mass: self.settings.total_mass.clone(),
        }
    }
}

pub(super) fn subtract(place: &mut [Number; 3], offset: &[Number; 3]) {
    for (own, offset) in place.iter_mut().zip(offset) {
        *own = own.minus(offset);
    }
}

/// By the origin of the link in the place of that of the body.
fn shift(inertia: &mut Inertia, offset: &[Number; 3]) {
    subtract(&mut inertia.pose.place, offset);
}

/// A frame moved by a vector of its own.
fn placed(mut pose: Pose, moved: [Number; 3]) -> Pose {
    match pose.turn.is_none() {
        true => pose.place = std::array::from_fn(|k| pose.place[k].plus(&moved[k])),
        false => pose.anchor = moved,
    }
    pose
}
