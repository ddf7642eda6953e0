//! Chains of bodies as data, random ones among them.
//!
//! Deliberately does not know: how a chain is written as a model, how it moves.

use proptest::prelude::Rng as _;
use proptest::test_runner::{RngAlgorithm, TestRng};

/// A vector in space.
pub(crate) type V3 = [f64; 3];

/// A number with its name in the text of a model: of a parameter, or a decimal.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Length {
    pub(crate) text: String,
    pub(crate) value: f64,
}

impl Length {
    pub(crate) fn decimal(value: f64) -> Length {
        Length { text: if value == 0.0 { "0".into() } else { format!("{value}") }, value }
    }
}

/// An axis or a normal, a unit vector with rational components.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    pub(crate) text: &'static str,
    pub(crate) value: V3,
}

pub(crate) const E1: Axis = Axis { text: "e1", value: [1.0, 0.0, 0.0] };
pub(crate) const E2: Axis = Axis { text: "e2", value: [0.0, 1.0, 0.0] };
pub(crate) const E3: Axis = Axis { text: "e3", value: [0.0, 0.0, 1.0] };
const SKEW: Axis = Axis { text: "[3/5, 0, 4/5]", value: [0.6, 0.0, 0.8] };
const OBLIQUE: Axis = Axis { text: "[2/3, 1/3, 2/3]", value: [2.0 / 3.0, 1.0 / 3.0, 2.0 / 3.0] };

/// A rotation by a fixed angle.
#[derive(Clone, Debug)]
pub(crate) struct Turn {
    pub(crate) axis: Axis,
    pub(crate) text: &'static str,
    pub(crate) angle: f64,
}

const QUARTER: (&str, f64) = ("pi/2", std::f64::consts::FRAC_PI_2);
const ANGLES: [(&str, f64); 5] = [
    QUARTER,
    ("-pi/2", -std::f64::consts::FRAC_PI_2),
    ("pi", std::f64::consts::PI),
    ("pi/3", std::f64::consts::FRAC_PI_3),
    ("0.3", 0.3),
];

/// How a body moves in the frame of the body before.
#[derive(Clone, Debug)]
pub(crate) enum Joint {
    Revolute(Axis),
    Prismatic(Axis),
}

/// A body by its own frame, whose origin is at its joint.
#[derive(Clone, Debug)]
pub(crate) struct Body {
    /// None for the base.
    pub(crate) parent: Option<usize>,
    /// The joint in the frame of the body before.
    pub(crate) offset: [Length; 3],
    /// Fixed rotations before that of the joint.
    pub(crate) twist: Vec<Turn>,
    pub(crate) joint: Joint,
    pub(crate) mass: Length,
    pub(crate) centre: [Length; 3],
    /// About the centre: `xx, xy, xz, yy, yz, zz`.
    pub(crate) inertia: [Length; 6],
}

/// Where a chain begins.
#[derive(Clone, Debug)]
pub(crate) enum Base {
    Fixed,
    /// A body that moves freely in space: mass, centre, principal moments about the origin of its frame.
    Floating {
        mass: Length,
        centre: Box<[Length; 3]>,
        moments: Box<[Length; 3]>,
    },
}

/// What restricts the motion of a point of a body.
#[derive(Clone, Debug)]
pub(crate) enum Restriction {
    /// Its velocity along an axis of the body is zero.
    Wheel { body: usize, point: [Length; 3], axis: Axis },
    /// Its component in space stays.
    Loop { body: usize, point: [Length; 3], component: usize },
}

#[derive(Clone, Debug)]
pub(crate) struct Chain {
    pub(crate) base: Base,
    pub(crate) bodies: Vec<Body>,
    pub(crate) restrictions: Vec<Restriction>,
    /// Along `-z`; none for zero.
    pub(crate) gravity: Length,
    /// Parameters by name, with their values.
    pub(crate) params: Vec<Length>,
}

/// Random numbers from a seed.
pub(crate) struct Draw(TestRng);

impl Draw {
    pub(crate) fn new(seed: u64) -> Draw {
        let mut bytes = [0; 32];
        bytes[..8].copy_from_slice(&seed.to_le_bytes());
        Draw(TestRng::from_seed(RngAlgorithm::ChaCha, &bytes))
    }

    pub(crate) fn below(&mut self, n: usize) -> usize {
        usize::try_from(self.0.next_u64() % n as u64).expect("a small number")
    }

    fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    fn one_of<T: Clone>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())].clone()
    }

    /// Of moderate size, for a state.
    pub(crate) fn number(&mut self) -> f64 {
        (self.below(2001) as f64 - 1000.0) / 900.0
    }

    fn axis(&mut self) -> Axis {
        match self.below(20) {
            0 => SKEW,
            1 => OBLIQUE,
            k => [E1, E2, E3][k % 3].clone(),
        }
    }
}

/// What a chain is drawn from: lengths that were drawn before are drawn again, so that lever arms are equal.
struct Maker<'a> {
    draw: &'a mut Draw,
    lengths: Vec<Length>,
    params: Vec<Length>,
    /// Of a hundred lengths, those with a parameter.
    named: usize,
    /// Of a hundred lengths, those with a value that was drawn before.
    again: usize,
    /// Of a hundred lengths, those that are zero.
    zero: usize,
}

impl Maker<'_> {
    fn number(&mut self, low: f64, high: f64, name: &str, positive: bool) -> Length {
        let value = low + (high - low) * self.draw.below(1001) as f64 / 1000.0;
        let value = (value * 1e4).round() / 1e4;
        let value = if value == 0.0 { 0.05 } else { value };
        if self.draw.below(100) >= self.named {
            return Length::decimal(value);
        }
        let length = Length { text: format!("{name}{}", self.params.len() + 1), value };
        debug_assert!(!positive || value > 0.0, "masses and moments are positive");
        self.params.push(length.clone());
        length
    }

    fn length(&mut self) -> Length {
        if self.draw.below(100) < self.zero {
            return Length::decimal(0.0);
        }
        if !self.lengths.is_empty() && self.draw.below(100) < self.again {
            let known = self.draw.one_of(&self.lengths.clone());
            if !self.draw.chance(30) {
                return known;
            }
            let text = match known.text.strip_prefix('-') {
                Some(text) => text.to_owned(),
                None => format!("-{}", known.text),
            };
            return Length { text, value: -known.value };
        }
        let length = self.number(-0.5, 0.5, "l", false);
        self.lengths.push(length.clone());
        length
    }

    fn lengths(&mut self) -> [Length; 3] {
        [0; 3].map(|_| self.length())
    }

    fn inertia(&mut self) -> [Length; 6] {
        let moments = self.moments();
        let [xx, yy, zz] = moments;
        let mut products = [0; 3].map(|_| Length::decimal(0.0));
        if self.draw.chance(40) {
            products = [0; 3].map(|_| self.number(-0.01, 0.01, "P", false));
        }
        let [xy, xz, yz] = products;
        [xx, xy, xz, yy, yz, zz]
    }

    /// Of which each two are more than the third, and more than products of inertia.
    fn moments(&mut self) -> [Length; 3] {
        if self.draw.chance(20) {
            let moment = self.number(0.05, 0.2, "J", true);
            return [0; 3].map(|_| moment.clone());
        }
        [0; 3].map(|_| self.number(0.1, 0.19, "J", true))
    }
}

/// A random chain of this many joints.
pub(crate) fn draw_chain(draw: &mut Draw, n: usize) -> Chain {
    let named = draw.one_of(&[0, 0, 30, 100]);
    let (again, zero) = (draw.one_of(&[0, 50, 90]), draw.one_of(&[0, 40, 70]));
    let is_tree = draw.chance(25);
    let is_planar = draw.chance(15);
    let (is_twisted, slides) = (draw.chance(50) && !is_planar, draw.chance(30));
    let is_floating = draw.chance(20);
    let mut maker = Maker { draw, lengths: Vec::new(), params: Vec::new(), named, again, zero };
    let gravity = match maker.draw.below(3) {
        0 => Length::decimal(0.0),
        _ if is_floating => Length::decimal(0.0),
        _ => maker.number(9.81, 9.81, "g", true),
    };
    let base = match is_floating {
        true => Base::Floating {
            mass: maker.number(0.5, 2.0, "m", true),
            centre: Box::new([0; 3].map(|_| Length::decimal(0.0))),
            moments: Box::new(maker.moments()),
        },
        false => Base::Fixed,
    };
    let mut bodies = Vec::new();
    for k in 0..n {
        let parent = match k {
            0 => None,
            _ if is_tree && maker.draw.chance(40) => Some(maker.draw.below(k)),
            _ => Some(k - 1),
        };
        let axis = if is_planar { E3 } else { maker.draw.axis() };
        let slides = slides && k > 0 && maker.draw.chance(40);
        let joint = match slides {
            true => Joint::Prismatic(if is_planar { E1 } else { axis }),
            false => Joint::Revolute(axis),
        };
        let n_turns = if is_twisted { maker.draw.below(3) } else { 0 };
        let twist = (0..n_turns).map(|_| {
            let (text, angle) = if maker.draw.chance(70) {
                maker.draw.one_of(&ANGLES[..3])
            } else {
                maker.draw.one_of(&ANGLES)
            };
            Turn { axis: [E1, E2, E3][maker.draw.below(3)].clone(), text, angle }
        });
        let twist = twist.collect();
        bodies.push(Body {
            parent,
            offset: maker.lengths(),
            twist,
            joint,
            mass: maker.number(0.5, 2.0, "m", true),
            centre: maker.lengths(),
            inertia: maker.inertia(),
        });
    }
    let mut restrictions = Vec::new();
    let point = |maker: &mut Maker<'_>| [0; 3].map(|_| maker.number(-0.5, 0.5, "d", false));
    match maker.draw.below(4) {
        0 if n > 1 => {
            for _ in 0..1 + maker.draw.below(2.min(n - 1)) {
                let body = maker.draw.below(n);
                let axis = [E1, E2, E3][maker.draw.below(if is_planar { 2 } else { 3 })].clone();
                restrictions.push(Restriction::Wheel { body, point: point(&mut maker), axis });
            }
        }
        1 if n > 1 && !is_floating => {
            let (body, point) = (n - 1, point(&mut maker));
            for component in 0..1 + maker.draw.below(2.min(n - 1)) {
                restrictions.push(Restriction::Loop { body, point: point.clone(), component });
            }
        }
        _ => {}
    }
    let params = maker.params;
    Chain { base, bodies, restrictions, gravity, params }
}
