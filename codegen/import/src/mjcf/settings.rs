//! What a file says about all of its elements: the compiler, options, defaults by class.
//!
//! Deliberately does not know: links, joints.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ops::Range;

use crate::number::{Number, zeros};
use crate::robot::{Pose, Robot};
use crate::rotation::{Turn, quaternion};
use crate::xml::{Element, Reader, head, place};

/// How a quantity says its rotation: names of attributes.
const ORIENTATIONS: [&str; 5] = ["quat", "axisangle", "xyaxes", "zaxis", "euler"];

/// Settings of the whole file.
pub(crate) struct Settings<'a, 'r> {
    pub(crate) reader: &'r Reader<'a>,
    pub(crate) is_degrees: bool,
    euler: Vec<(usize, bool)>,
    pub(crate) autolimits: bool,
    /// Whether geoms say the masses: always, never, or where there is no `inertial`.
    pub(crate) inertia_from_geom: Option<bool>,
    pub(crate) inertia_groups: [f64; 2],
    pub(crate) total_mass: Option<Number>,
    gravity: [Number; 3],
    /// What flags switch off.
    off: BTreeSet<&'static str>,
    /// Groups of actuators that are switched off.
    pub(crate) groups_off: Vec<f64>,
    classes: BTreeMap<&'a str, Class<'a>>,
    unknown: RefCell<Vec<&'a str>>,
}

#[derive(Clone, Debug, Default)]
struct Class<'a> {
    around: Option<&'a str>,
    /// Elements of the classes around it, then its own.
    elements: Vec<Element<'a>>,
    n_around: usize,
}

/// Flags that switch off what a model has here.
const FLAGS: [&str; 8] =
    ["gravity", "constraint", "equality", "limit", "frictionloss", "spring", "damper", "actuation"];

/// The class of everything without one.
const MAIN: &str = "main";

/// Attributes of joints and geoms that elements may take from defaults.
const FROM_DEFAULTS: [(&str, &[&str]); 3] = [
    ("equality", &["active"]),
    (
        "joint",
        &[
            "type",
            "pos",
            "axis",
            "range",
            "limited",
            "damping",
            "frictionloss",
            "stiffness",
            "springref",
            "ref",
            "armature",
            "springdamper",
        ],
    ),
    (
        "geom",
        &[
            "type",
            "size",
            "pos",
            "quat",
            "axisangle",
            "xyaxes",
            "zaxis",
            "euler",
            "fromto",
            "mass",
            "density",
            "group",
            "mesh",
            "shellinertia",
        ],
    ),
];

/// Elements of actuators, which share their defaults.
pub(super) const ACTUATORS: &[&str] =
    &["general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle", "adhesion"];
/// Attributes of actuators that have an effect here, or are refused by name.
const OF_ACTUATORS: &[&str] = &[
    "gear",
    "gaintype",
    "gainprm",
    "biastype",
    "biasprm",
    "dyntype",
    "kp",
    "kv",
    "dampratio",
    "timeconst",
    "group",
];

/// An element with the defaults of its class behind it.
#[derive(Clone)]
pub(crate) struct Defaulted<'a> {
    /// The element, then defaults from the nearest class on.
    chain: Vec<Element<'a>>,
}

impl<'a, 'r> Settings<'a, 'r> {
    /// Reads `compiler`, `option` and `default`.
    pub(crate) fn read(reader: &'r Reader<'a>, root: Element<'a>) -> Settings<'a, 'r> {
        let mut settings = Settings {
            reader,
            is_degrees: true,
            euler: vec![(0, false), (1, false), (2, false)],
            autolimits: true,
            inertia_from_geom: None,
            inertia_groups: [f64::NEG_INFINITY, f64::INFINITY],
            total_mass: None,
            gravity: Robot::earth(),
            off: BTreeSet::new(),
            groups_off: Vec::new(),
            classes: BTreeMap::new(),
            unknown: RefCell::default(),
        };
        settings.classes.insert(MAIN, Class::default());
        for element in reader.children(root, "compiler") {
            settings.compiler(element);
        }
        for element in reader.children(root, "option") {
            settings.option(element);
        }
        for element in reader.children(root, "default") {
            // The outermost class may have another name; elements without a class have it all the same.
            let class = reader.attribute(element, "class").unwrap_or(MAIN);
            settings.default(element, MAIN, 0);
            let all = settings.classes.get(MAIN).cloned().unwrap_or_default();
            settings.classes.insert(class, all);
        }
        settings
    }

    fn compiler(&mut self, element: Element<'a>) {
        let reader = self.reader;
        if let Some(unit) = self.word(element, "angle", &["degree", "radian"]) {
            self.is_degrees = unit == "degree";
        }
        if let Some(sequence) = reader.attribute(element, "eulerseq") {
            let axes: Option<Vec<(usize, bool)>> = sequence
                .chars()
                .map(|c| Some(("xyz".find(c.to_ascii_lowercase())?, c.is_ascii_uppercase())))
                .collect();
            match axes.filter(|axes| axes.len() == 3) {
                Some(axes) => self.euler = axes,
                None => {
                    let message = format!("`eulerseq` is \"{sequence}\", not three axes");
                    reader.error(&place(element, "eulerseq"), message, "write axes such as `xyz` or `XYZ`");
                }
            }
        }
        if let Some(word) = self.word(element, "autolimits", &["true", "false"]) {
            self.autolimits = word == "true";
        }
        if let Some(word) = self.word(element, "inertiafromgeom", &["true", "false", "auto"]) {
            self.inertia_from_geom = (word != "auto").then_some(word == "true");
        }
        if let Some([low, high]) = reader.numbers::<2>(element, "inertiagrouprange") {
            self.inertia_groups = [low.value, high.value];
        }
        if let Some(total) = reader.number(element, "settotalmass") {
            self.total_mass = (total.value > 0.0).then_some(total);
        }
        if reader.attribute(element, "coordinate").is_some_and(|word| word != "local") {
            let help = "save the model by MuJoCo 2.3.3, which still reads them: its frames are local then";
            reader.error(&place(element, "coordinate"), "coordinates are global", help);
        }
    }

    fn option(&mut self, element: Element<'a>) {
        let reader = self.reader;
        if let Some(gravity) = reader.numbers(element, "gravity") {
            self.gravity = gravity;
        }
        if let Some(groups) = reader.list(element, "actuatorgroupdisable", 31) {
            self.groups_off = groups.iter().map(|group| group.value).collect();
        }
        for flag in reader.children(element, "flag") {
            for name in FLAGS {
                match self.word(flag, name, &["enable", "disable"]) {
                    Some("disable") => self.off.insert(name),
                    Some(_) => self.off.remove(name),
                    None => false,
                };
            }
            if flag.attribute("passive") == Some("disable") {
                let message = "the flag `passive` leaves out forces that the file has";
                let help = "write the flags `spring` and `damper`, which newer versions have in its place";
                reader.error(&place(flag, "passive"), message, help);
            }
        }
    }

    /// Whether a flag switches something off.
    pub(crate) fn is_off(&self, flag: &str) -> bool {
        let is_constraint = matches!(flag, "equality" | "limit" | "frictionloss");
        self.off.contains(flag) || (is_constraint && self.off.contains("constraint"))
    }

    /// The part of a weight that a body has held up: a passive force, which both flags of such forces switch off.
    pub(crate) fn lift(&self, said: Option<Number>) -> Number {
        let is_off = self.is_off("spring") && self.is_off("damper");
        said.filter(|_| !is_off).unwrap_or_else(Number::zero)
    }

    /// The acceleration of gravity.
    pub(crate) fn gravity(&self) -> [Number; 3] {
        if self.is_off("gravity") { zeros() } else { self.gravity.clone() }
    }

    fn default(&mut self, element: Element<'a>, class: &'a str, depth: usize) {
        let reader = self.reader;
        if depth > 64 {
            reader.error(&head(element), "classes are more than 64 deep", "make them flatter");
            return;
        }
        let is_class = |child: &Element<'a>| child.tag_name().name() == "default";
        let (classes, own): (Vec<_>, Vec<_>) = reader.all(element).into_iter().partition(is_class);
        for child in own {
            let tag = child.tag_name().name();
            self.classes.entry(class).or_default().elements.push(child);
            let attributes = match FROM_DEFAULTS.iter().find(|(own, _)| *own == tag) {
                Some((_, attributes)) => *attributes,
                None if ACTUATORS.contains(&tag) => OF_ACTUATORS,
                None => continue,
            };
            reader.take(child);
            for attribute in attributes {
                reader.attribute(child, attribute);
            }
        }
        // A class begins with all that the class around it has said so far.
        for child in classes {
            reader.take(child);
            let Some(name) = reader.required(child, "class") else { continue };
            let elements = self.classes.get(class).map(|class| class.elements.clone()).unwrap_or_default();
            let own = Class { around: Some(class), n_around: elements.len(), elements };
            if self.classes.insert(name, own).is_some() {
                let help = "give each class a name of its own";
                reader.error(&place(child, "class"), format!("class `{name}` is declared twice"), help);
            }
            self.default(child, name, depth + 1);
        }
    }

    /// One of the words that an attribute may have.
    pub(crate) fn word(&self, of: Element<'a>, name: &str, words: &[&str]) -> Option<&'a str> {
        let word = self.reader.attribute(of, name)?;
        if !words.contains(&word) {
            let help = format!("write {}", words.join(" or "));
            self.reader.error(&place(of, name), format!("`{name}` is \"{word}\""), &help);
            return None;
        }
        Some(word)
    }

    /// The elements of a tag in the defaults of an element's class, from the outermost class on.
    pub(crate) fn defaults(
        &self,
        element: Element<'a>,
        childclass: Option<&'a str>,
        tags: &[&str],
    ) -> Vec<Element<'a>> {
        self.layers_of(element, childclass, tags).concat()
    }

    /// As [`Settings::defaults`], class by class.
    pub(crate) fn layers(&self, element: Element<'a>, tags: &[&str]) -> Vec<Vec<Element<'a>>> {
        self.layers_of(element, None, tags)
    }

    fn layers_of(
        &self,
        element: Element<'a>,
        childclass: Option<&'a str>,
        tags: &[&str],
    ) -> Vec<Vec<Element<'a>>> {
        let named = self.reader.attribute(element, "class");
        let class = named.or(childclass).unwrap_or(MAIN);
        if !self.classes.contains_key(class) && !self.unknown.borrow().contains(&class) {
            self.unknown.borrow_mut().push(class);
            let at = if named.is_some() { place(element, "class") } else { head(element) };
            self.reader.error(&at, format!("there is no class `{class}`"), "name a class of `default`");
        }
        let mut left = self.classes.get(class).map(|class| class.elements.clone()).unwrap_or_default();
        let mut layers = Vec::new();
        let mut next = self.classes.get(class);
        while let Some(class) = next {
            let own = left.split_off(class.n_around.min(left.len()));
            layers.push(own.into_iter().filter(|child| tags.contains(&child.tag_name().name())).collect());
            next = class.around.and_then(|around| self.classes.get(around));
        }
        layers.reverse();
        layers
    }

    /// An element with its defaults.
    pub(crate) fn defaulted(&self, element: Element<'a>, childclass: Option<&'a str>) -> Defaulted<'a> {
        self.defaulted_as(element, element.tag_name().name(), childclass)
    }

    /// An element with the defaults that have another tag.
    pub(crate) fn defaulted_as(
        &self,
        element: Element<'a>,
        tag: &str,
        childclass: Option<&'a str>,
    ) -> Defaulted<'a> {
        let mut chain = self.defaults(element, childclass, &[tag]);
        chain.push(element);
        chain.reverse();
        Defaulted { chain }
    }

    /// An angle of the file's unit.
    pub(crate) fn angle(&self, number: Number) -> Number {
        if self.is_degrees { number.in_degrees() } else { number }
    }

    /// The frame that an element says.
    pub(crate) fn pose(&self, of: &Defaulted<'a>) -> Pose {
        let mut pose = Pose::identity();
        if let Some(place) = of.numbers(self.reader, "pos") {
            pose.place = place;
        }
        pose.turn = self.turn(of);
        pose
    }

    fn turn(&self, of: &Defaulted<'a>) -> Turn {
        // The rotation of an element takes the place of that of its class, whatever the word of either is.
        let own = |element: &Element<'a>| -> Vec<&str> {
            ORIENTATIONS.into_iter().filter(|name| element.attribute(*name).is_some()).collect()
        };
        let said =
            of.chain.iter().map(|element| (*element, own(element))).find(|(_, names)| !names.is_empty());
        let Some((element, names)) = said else { return Turn::none() };
        let name = names[0];
        if let [_, second, ..] = names[..] {
            let message = format!("a rotation is said by `{name}` and by `{second}`");
            self.reader.error(&place(element, second), message, "leave one of them");
        }
        let reader = self.reader;
        let help = "write a direction such as `0 0 1`";
        let turn = match name {
            "quat" => reader.numbers(element, name).map(|q| quaternion(&q)),
            "axisangle" => reader.numbers(element, name).map(|[x, y, z, angle]: [Number; 4]| {
                let axis = crate::rotation::Axis::new(&[x, y, z])?;
                let (axis, is_against) = axis.of_rotation;
                let angle = if is_against { angle.negative() } else { angle };
                let mut turn = Turn::none();
                turn.push(axis, self.angle(angle));
                Some(turn)
            }),
            "xyaxes" => reader
                .numbers(element, name)
                .map(|[a, b, c, d, e, f]: [Number; 6]| Turn::axes([a, b, c], [d, e, f])),
            "zaxis" => reader.numbers(element, name).map(Turn::onto),
            _ => reader.numbers(element, name).map(|angles: [Number; 3]| {
                // Axes that turn along stand behind those before, axes at rest in front of them.
                let mut factors = VecDeque::new();
                for ((axis, is_fixed), angle) in self.euler.iter().zip(angles) {
                    match is_fixed {
                        true => factors.push_front((axis, angle)),
                        false => factors.push_back((axis, angle)),
                    }
                }
                let mut turn = Turn::none();
                for (axis, angle) in factors {
                    turn.push(format!("e{}", axis + 1), self.angle(angle));
                }
                Some(turn)
            }),
        };
        let turn = match turn {
            None => return Turn::none(),
            Some(None) => {
                reader.error(&place(element, name), format!("`{name}` has no direction"), help);
                return Turn::none();
            }
            Some(Some(turn)) => turn,
        };
        self.tell_moved(&place(element, name), &turn);
        turn
    }

    /// Tells which numbers of a rotation stand for quarter turns.
    pub(super) fn tell_moved(&self, at: &Range<usize>, turn: &Turn) {
        for (written, taken) in &turn.moved {
            let message = format!("the rotation {written} is taken as {taken}");
            self.reader.note_with_help(at, message, "give more digits of another angle");
        }
    }
}

impl<'a> Defaulted<'a> {
    pub(crate) fn own(&self) -> Element<'a> {
        self.chain[0]
    }

    /// The nearest element that has an attribute.
    pub(crate) fn carrier(&self, name: &str) -> Option<Element<'a>> {
        self.chain.iter().copied().find(|element| element.attribute(name).is_some())
    }

    pub(crate) fn attribute(&self, reader: &Reader<'a>, name: &str) -> Option<&'a str> {
        reader.attribute(self.carrier(name)?, name)
    }

    pub(crate) fn numbers<const N: usize>(&self, reader: &Reader<'a>, name: &str) -> Option<[Number; N]> {
        reader.numbers(self.carrier(name)?, name)
    }

    pub(crate) fn number(&self, reader: &Reader<'a>, name: &str) -> Option<Number> {
        reader.number(self.carrier(name)?, name)
    }

    /// A list whose first numbers an element may have, and the others a default.
    pub(crate) fn list(&self, reader: &Reader<'a>, name: &str, most: usize) -> Vec<Number> {
        let mut all = Vec::new();
        for element in self.chain.iter().rev() {
            for (k, number) in reader.list(*element, name, most).into_iter().flatten().enumerate() {
                match all.get_mut(k) {
                    Some(old) => *old = number,
                    None => all.push(number),
                }
            }
        }
        all
    }

    /// Where an attribute is, or the element.
    pub(crate) fn place(&self, name: &str) -> std::ops::Range<usize> {
        place(self.carrier(name).unwrap_or(self.chain[0]), name)
    }
}
