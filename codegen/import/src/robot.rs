//! A robot as a tree of links and joints: the one form between the formats and the model.
//!
//! Deliberately does not know: XML, the model language.

use std::ops::Range;

use crate::number::Number;
use crate::rotation::{Axis, Turn};

/// A frame in another one: the place of its origin, and the rotation that takes its components to the other's.
#[derive(Clone, Debug)]
pub(crate) struct Pose {
    pub(crate) place: [Number; 3],
    pub(crate) turn: Turn,
}

impl Pose {
    pub(crate) fn identity() -> Pose {
        Pose { place: std::array::from_fn(|_| Number::zero()), turn: Turn::none() }
    }
}

/// Mass, mass centre and moments of inertia about it.
#[derive(Clone, Debug)]
pub(crate) struct Inertia {
    pub(crate) mass: Number,
    /// The frame of the moments of inertia, whose origin is the mass centre, in that of the link.
    pub(crate) pose: Pose,
    /// `xx, yy, zz, xy, xz, yz`.
    pub(crate) moments: [Number; 6],
}

#[derive(Clone, Debug)]
pub(crate) struct Link {
    pub(crate) name: String,
    pub(crate) inertia: Option<Inertia>,
    pub(crate) span: Range<usize>,
}

#[derive(Clone, Debug)]
pub(crate) enum JointKind {
    Fixed,
    /// A turn about an axis; `is_full` where the angle has no limits.
    Revolute(Axis),
    Prismatic(Axis),
    /// Two translations and a turn about the axis across.
    Planar(Axis),
    /// Any motion.
    Floating,
}

/// A coordinate that follows another one: `factor q + offset`.
#[derive(Clone, Debug)]
pub(crate) struct Mimic {
    /// The place of the other joint among the joints.
    pub(crate) joint: usize,
    pub(crate) factor: Number,
    pub(crate) offset: Number,
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
    pub(crate) mimic: Option<Mimic>,
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
}
