//! Groups whose motion can be reconstructed.
//!
//! Deliberately does not know: how a group is written in a model, its equations.

use std::fmt;

use super::layout::Layout;
use crate::algebra::LieAlgebra;

/// A group whose motion can be reconstructed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// SO(2), by an angle.
    PlanarRotation,
    /// SO(3), by a unit quaternion.
    Rotation,
    /// SE(2), by an angle and a position.
    PlanarMotion,
    /// SE(3), by a unit quaternion and a position.
    Motion,
    /// R^n.
    Translation(usize),
}

impl fmt::Display for Group {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Group::PlanarRotation => f.write_str("SO(2)"),
            Group::Rotation => f.write_str("SO(3)"),
            Group::PlanarMotion => f.write_str("SE(2)"),
            Group::Motion => f.write_str("SE(3)"),
            Group::Translation(1) => f.write_str("R"),
            Group::Translation(n) => write!(f, "R^{n}"),
        }
    }
}

impl Group {
    /// The dimension of the group.
    pub fn dim(self) -> usize {
        match self {
            Group::PlanarRotation => 1,
            Group::Rotation | Group::PlanarMotion => 3,
            Group::Motion => 6,
            Group::Translation(n) => n,
        }
    }

    pub(super) fn algebra(self) -> Option<LieAlgebra> {
        match self {
            Group::PlanarRotation => Some(LieAlgebra::abelian(1)),
            Group::Rotation => LieAlgebra::so(3).ok(),
            Group::PlanarMotion => LieAlgebra::se(2).ok(),
            Group::Motion => LieAlgebra::se(3).ok(),
            Group::Translation(n) => Some(LieAlgebra::abelian(n)),
        }
    }

    /// Names of the coordinates per given name, or nothing when there are too many or too few.
    pub(super) fn coordinates(self, names: &[&str]) -> Option<Vec<Vec<String>>> {
        let single = |name: &&str| vec![(*name).to_owned()];
        let quaternion = |name: &str| ["w", "x", "y", "z"].iter().map(|c| format!("{name}{c}")).collect();
        match (self, names) {
            (Group::PlanarRotation, [_]) | (Group::PlanarMotion, [_, _, _]) => {
                Some(names.iter().map(single).collect())
            }
            (Group::Rotation, [q]) => Some(vec![quaternion(q)]),
            (Group::Motion, [q, r]) => Some(vec![quaternion(q), Layout::Vector(3).names(r)]),
            (Group::Translation(n), _) if names.len() == n => Some(names.iter().map(single).collect()),
            (Group::Translation(n), [x]) => Some(vec![Layout::Vector(n).names(x)]),
            _ => None,
        }
    }

    pub(super) fn example(self) -> String {
        let names = match self {
            Group::PlanarRotation => "theta",
            Group::Rotation => "q",
            Group::PlanarMotion => "theta, x, y",
            Group::Motion => "q, r",
            Group::Translation(_) => "x",
        };
        format!("for example `reconstruct {names} in {self};`")
    }
}
