//! A robot as a tree of links and joints: the one form between the formats and the model.
//!
//! Deliberately does not know: XML, the model language.

use std::ops::Range;

use crate::number::{Number, zeros};
use crate::rotation::{Axis, Turn};
use crate::solid::Solid;

/// A frame in another one: the place of its origin, and the rotation that takes its components to the other's.
#[derive(Clone, Debug)]
pub(crate) struct Pose {
    pub(crate) place: [Number; 3],
    pub(crate) turn: Turn,
    /// How far the origin is moved after the rotation, in the turned frame.
    pub(crate) anchor: [Number; 3],
}

impl Pose {
    pub(crate) fn identity() -> Pose {
        Pose { place: zeros(), turn: Turn::none(), anchor: zeros() }
    }
}

#[derive(Clone, Debug)]
pub(crate) enum Mass {
    Given(Number),
    /// That of a solid, by its density.
    Density(Number),
}

#[derive(Clone, Debug)]
pub(crate) enum Moments {
    /// `xx, yy, zz, xy, xz, yz`.
    Given([Number; 6]),
    Solid(Solid),
}

/// Mass, mass centre and moments of inertia about it.
#[derive(Clone, Debug)]
pub(crate) struct Inertia {
    pub(crate) name: String,
    pub(crate) mass: Mass,
    /// The frame of the moments of inertia, whose origin is the mass centre, in that of the link.
    pub(crate) pose: Pose,
    pub(crate) moments: Moments,
    /// The part of the weight that is held up: zero, or one for a mass that gravity does not pull.
    pub(crate) lift: Number,
}

#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) inertias: Vec<Inertia>,
    /// The origin of its frame in the file, in its frame here, whose origin is in its joint.
    pub(crate) origin: [Number; 3],
    pub(crate) span: Range<usize>,
}

impl Link {
    /// A link without mass.
    pub(crate) fn new(name: String, span: Range<usize>) -> Link {
        Link { name, inertias: Vec::new(), origin: zeros(), span }
    }
}

#[derive(Clone, Debug)]
pub(crate) enum JointKind {
    Fixed,
    /// A turn about an axis.
    Revolute(Axis),
    Prismatic(Axis),
    /// Two translations and a turn about the axis across.
    Planar(Axis),
    /// Any rotation.
    Ball,
    /// Any motion; the pose of the joint is where it starts.
    Floating,
}

/// A coordinate that follows another one: a polynomial of it, both by their references.
#[derive(Clone, Debug)]
pub(crate) struct Mimic {
    /// The place of the other joint among the joints.
    pub(crate) joint: usize,
    /// From the constant on.
    pub(crate) coefficients: Vec<Number>,
}

/// A spring: its stiffness, and the coordinate where it is at rest.
#[derive(Clone, Debug)]
pub(crate) struct Spring {
    pub(crate) stiffness: Number,
    pub(crate) rest: Number,
}

#[derive(Clone, Debug)]
pub(crate) struct Joint {
    pub(crate) name: String,
    pub(crate) kind: JointKind,
    /// Places of the links among the links.
    pub(crate) parent: usize,
    pub(crate) child: usize,
    /// The frame of the joint, that of the child at rest, in the frame of the parent.
    pub(crate) pose: Pose,
    pub(crate) limits: Option<[Number; 2]>,
    pub(crate) damping: Number,
    pub(crate) friction: Number,
    pub(crate) spring: Option<Spring>,
    /// Inertia along the coordinate alone, as of a rotor behind gears.
    pub(crate) armature: Number,
    /// The value of the coordinate where child and joint have one frame.
    pub(crate) reference: Number,
    pub(crate) mimic: Option<Mimic>,
    pub(crate) span: Range<usize>,
}

impl Joint {
    /// A joint without forces.
    pub(crate) fn new(name: String, kind: JointKind, ends: (usize, usize), span: Range<usize>) -> Joint {
        Joint {
            name,
            kind,
            parent: ends.0,
            child: ends.1,
            pose: Pose::identity(),
            limits: None,
            damping: Number::zero(),
            friction: Number::zero(),
            spring: None,
            armature: Number::zero(),
            reference: Number::zero(),
            mimic: None,
            span,
        }
    }
}

/// A motor: the force along the coordinate of a joint is `gear (gain u + bias_0 + bias_1 gear q + bias_2 gear q')`
/// with its input `u`.
#[derive(Clone, Debug)]
pub(crate) struct Motor {
    pub(crate) name: String,
    /// The place of the joint among the joints.
    pub(crate) joint: usize,
    pub(crate) gear: Number,
    pub(crate) gain: Number,
    pub(crate) bias: [Number; 3],
}

/// What two links have in common beside the tree.
#[derive(Clone, Debug)]
pub(crate) enum Held {
    /// A point.
    Point,
    /// A point and an axis through it, in the frame of the first end.
    Axis(Axis),
    /// A point, and the angle between an axis of the first link and one of the second, each in the frame of its end: a
    /// cross that turns about both.
    Cross(Axis, Axis),
    /// The attitude, and the place but for the way along an axis, in the frame of the first end.
    Slide(Axis),
    /// A frame.
    Frame,
}

/// A link and a frame of it.
#[derive(Clone, Debug)]
pub(crate) struct End {
    pub(crate) link: usize,
    /// Nothing for the frame where the other end is with all joints at their references.
    pub(crate) pose: Option<Pose>,
}

/// Two links that the tree does not join: frames of both stay together, or what a joint holds of them.
#[derive(Clone, Debug)]
pub(crate) struct Loop {
    pub(crate) name: String,
    pub(crate) held: Held,
    /// The first one has its frame.
    pub(crate) first: (usize, Pose),
    pub(crate) second: End,
    pub(crate) span: Range<usize>,
}

/// A tree of links: each but the first is the child of one joint, and each joint stands behind the joint of its parent.
#[derive(Clone, Debug)]
pub(crate) struct Robot {
    pub(crate) name: String,
    pub(crate) links: Vec<Link>,
    pub(crate) joints: Vec<Joint>,
    /// The link that is no child.
    pub(crate) root: usize,
    /// Where the root is at the start: the last of some frames, each in the one before it, the first in space.
    pub(crate) start: Vec<Pose>,
    /// Whether the root is the ground, and not a body that may move.
    pub(crate) has_ground: bool,
    pub(crate) motors: Vec<Motor>,
    pub(crate) loops: Vec<Loop>,
    /// Whether every coordinate without a motor has an input as well: the file does not say which are driven.
    pub(crate) drives_all: bool,
    pub(crate) gravity: [Number; 3],
    /// All masses and moments of inertia have one factor, such that this is the sum of the masses.
    pub(crate) total_mass: Option<Number>,
}

impl Robot {
    /// The joints from the root to a link.
    pub(crate) fn chain(&self, link: usize) -> Vec<usize> {
        let mut chain = Vec::new();
        let mut at = link;
        while let Some(k) = self.joints.iter().position(|joint| joint.child == at) {
            chain.push(k);
            at = self.joints[k].parent;
        }
        chain.reverse();
        chain
    }

    /// The joints on both ways from the last link that the ends of a loop share.
    pub(crate) fn around(&self, closed: &Loop) -> [Vec<usize>; 2] {
        let [a, b] = [closed.first.0, closed.second.link].map(|link| self.chain(link));
        let n_shared = a.iter().zip(&b).take_while(|(a, b)| a == b).count();
        [a[n_shared..].to_vec(), b[n_shared..].to_vec()]
    }

    /// Gravity of the Earth along the third axis.
    pub(crate) fn earth() -> [Number; 3] {
        let g = Number { text: "-9.81".to_owned(), value: -9.81, ..Number::zero() };
        [Number::zero(), Number::zero(), g]
    }
}
