//! Solids of even density: mass and moments of inertia about the mass centre.
//!
//! # Source
//! The formulas of solids in any table; a capsule is a cylinder with two half balls, `I = I_c + d^2 m` for each.
//!
//! Deliberately does not know: XML, links.

use crate::number::{Number, vector};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    /// By its radius.
    Ball,
    /// By its radius and half the length of its cylinder, about the third axis.
    Capsule,
    /// By its radius and half its length, about the third axis.
    Cylinder,
    /// By its half axes.
    Ellipsoid,
    /// By half its lengths.
    Cuboid,
}

#[derive(Clone, Debug)]
pub(crate) struct Solid {
    pub(crate) shape: Shape,
    pub(crate) sizes: Vec<Number>,
    /// The direction of the axis of a capsule or cylinder in the place of the third one, of any length.
    pub(crate) along: Option<[Number; 3]>,
}

impl Shape {
    /// The prefixes of names of its sizes, and what they are.
    pub(crate) fn sizes(self) -> &'static [(&'static str, &'static str)] {
        const ROUND: [(&str, &str); 2] = [("radius", "Radius"), ("half", "Half length")];
        const AXES: [(&str, &str); 3] =
            [("ax", "Half length along x"), ("ay", "Half length along y"), ("az", "Half length along z")];
        match self {
            Shape::Ball => &ROUND[..1],
            Shape::Capsule | Shape::Cylinder => &ROUND,
            Shape::Ellipsoid | Shape::Cuboid => &AXES,
        }
    }

    /// The volume by the names of the sizes.
    pub(crate) fn volume(self, sizes: &[String]) -> String {
        let product = || sizes.join("*");
        match self {
            Shape::Ball => format!("4/3*pi*{}^3", sizes[0]),
            Shape::Capsule => format!("pi*{r}^2*(2*{h} + 4/3*{r})", r = sizes[0], h = sizes[1]),
            Shape::Cylinder => format!("2*pi*{}^2*{}", sizes[0], sizes[1]),
            Shape::Ellipsoid => format!("4/3*pi*{}", product()),
            Shape::Cuboid => format!("8*{}", product()),
        }
    }

    /// The principal moments by the names of the mass and of the sizes; the first two are equal where two are given.
    pub(crate) fn moments(self, m: &str, sizes: &[String]) -> Vec<String> {
        let across = |n: u32, a: &str, b: &str| format!("{m}*({a}^2 + {b}^2)/{n}");
        match self {
            Shape::Ball => vec![format!("2/5*{m}*{}^2", sizes[0])],
            Shape::Cylinder => {
                let (r, h) = (&sizes[0], &sizes[1]);
                vec![format!("{m}*(3*{r}^2 + 4*{h}^2)/12"), format!("{m}*{r}^2/2")]
            }
            // The half balls have 2 r of 2 r + 3 h parts of the mass.
            Shape::Capsule => {
                let (r, h) = (&sizes[0], &sizes[1]);
                let parts = format!("(2*{r} + 3*{h})");
                let half_balls = format!("2*{r}*(2/5*{r}^2 + 3/4*{r}*{h} + {h}^2)");
                vec![
                    format!("{m}*({half_balls} + {h}*(3*{r}^2 + 4*{h}^2)/4)/{parts}"),
                    format!("{m}*{r}^2*(4/5*{r} + 3/2*{h})/{parts}"),
                ]
            }
            Shape::Ellipsoid | Shape::Cuboid => {
                let n = if self == Shape::Cuboid { 3 } else { 5 };
                let [x, y, z] = [&sizes[0], &sizes[1], &sizes[2]];
                vec![across(n, y, z), across(n, x, z), across(n, x, y)]
            }
        }
    }
}

impl Solid {
    /// The matrix of moments of inertia by names of the principal ones, as [`Shape::moments`] has them.
    pub(crate) fn matrix(&self, names: &[String]) -> String {
        match (names, &self.along) {
            ([one], _) => format!("{one}*identity(3)"),
            // I = I_z + (I_z - I_x) hat(d)^2/(d.d)
            ([x, z], Some(along)) => {
                let d = vector(along);
                format!("({z}*identity(3) + ({z} - {x})/dot({d}, {d})*hat({d})*hat({d}))")
            }
            ([x, z], None) => format!("diag([{x}, {x}, {z}])"),
            _ => format!("diag([{}])", names.join(", ")),
        }
    }
}
