//! Chains of bodies, by the number of bodies: models as text, and the same chains for Pinocchio.
//!
//! Does not know: how anything is measured or shown.

use std::fmt::Write as _;

use super::linkages::families::{self, IIWA};

/// A family of chains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Chain {
    /// Links on wheels in the plane.
    Snake,
    /// An arm in the vertical plane, by the angles between its links.
    PlanarArm,
    /// Pendulums in the plane one behind the other, by their angles in space.
    PlanarPendulum,
    /// Pendulums in space, by their angles in space.
    SphericalPendulum,
    /// The first bodies of the arm LBR iiwa 14.
    SpatialArm,
}

impl Chain {
    /// All of them.
    pub(crate) const ALL: [Chain; 5] =
        [Chain::Snake, Chain::PlanarArm, Chain::PlanarPendulum, Chain::SphericalPendulum, Chain::SpatialArm];

    /// Its name in tables.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Chain::Snake => "snake",
            Chain::PlanarArm => "planar arm",
            Chain::PlanarPendulum => "planar pendulum",
            Chain::SphericalPendulum => "spherical pendulum",
            Chain::SpatialArm => "spatial arm",
        }
    }

    /// Name of the model of `n` bodies.
    pub(super) fn model(self, n: usize) -> String {
        let family = match self {
            Chain::Snake => "wheeled_snake",
            Chain::PlanarArm => "planar_arm",
            Chain::PlanarPendulum => "planar_pendulum",
            Chain::SphericalPendulum => "spherical_pendulum",
            Chain::SpatialArm => "spatial_arm",
        };
        format!("{family}_{n}")
    }

    /// Numbers of bodies, from small to large. `by_hand.rs` has the same.
    pub(super) fn sizes(self, short: bool) -> &'static [usize] {
        let sizes: &[usize] = match self {
            Chain::SpatialArm => &[2, 3, 5, 7],
            _ => &[2, 3, 5, 8, 10, 14, 20, 40],
        };
        if short { &sizes[..2] } else { sizes }
    }

    /// The chain as the text of a model.
    pub(super) fn text(self, n: usize) -> String {
        match self {
            Chain::Snake => families::wheeled_snake(n),
            Chain::PlanarArm => families::planar_arm(n),
            Chain::PlanarPendulum => families::planar_pendulum(n),
            Chain::SphericalPendulum => families::spherical_pendulum(n),
            Chain::SpatialArm => families::spatial_arm(n),
        }
    }

    /// The chain as `tests/peers/chains.cpp` reads it; none for the snake, whose wheels no joint is.
    ///
    /// ```text
    /// <model> <n> <coordinates> <gravity: 3>
    /// <joint> <place: 3> <turn, row by row: 9> <mass> <centre: 3> <principal moments: 3>      n times
    /// ```
    pub(super) fn mechanism(self, n: usize) -> Option<String> {
        const NO_TURN: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let (coordinates, joint, gravity) = match self {
            Chain::Snake => return None,
            Chain::PlanarArm => ("own", "turn", [0.0, -9.81, 0.0]),
            Chain::PlanarPendulum => ("planar", "turn", [0.0, -9.81, 0.0]),
            Chain::SphericalPendulum => ("spherical", "universal", [0.0, 0.0, -9.81]),
            Chain::SpatialArm => ("own", "turn", [0.0, 0.0, -9.81]),
        };
        let mut text = String::new();
        let mut line = |words: &str, numbers: &[&[f64]]| {
            let numbers: Vec<String> = numbers.concat().iter().map(f64::to_string).collect();
            let _ = writeln!(text, "{words} {}", numbers.join(" "));
        };
        line(&format!("{} {n} {coordinates}", self.model(n)), &[&gravity]);
        for k in 0..n {
            let (mass, before) = (1.0 + 0.1 * (k + 1) as f64, if k == 0 { 0.0 } else { 0.5 });
            let (place, turn, mass, centre, moments) = match self {
                Chain::PlanarArm => ([before, 0.0, 0.0], NO_TURN, mass, [0.2, 0.0, 0.0], [0.1; 3]),
                Chain::SphericalPendulum => ([0.0, 0.0, before], NO_TURN, mass, [0.0, 0.0, 0.5], [0.0; 3]),
                Chain::PlanarPendulum | Chain::Snake => {
                    ([before, 0.0, 0.0], NO_TURN, mass, [0.5, 0.0, 0.0], [0.0; 3])
                }
                Chain::SpatialArm => {
                    let link = &IIWA[k];
                    let turn = match (k, link.is_quarter) {
                        (0, _) => NO_TURN,
                        (_, true) => [1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0],
                        (_, false) => [-1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0],
                    };
                    (link.joint, turn, link.mass, link.centre, link.moments)
                }
            };
            line(joint, &[&place, &turn, &[mass], &centre, &moments]);
        }
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use hamel_codegen::spec;

    use super::Chain;

    #[test]
    fn every_chain_is_the_model_of_its_name() {
        for chain in Chain::ALL {
            let n = chain.sizes(true)[1];
            let model = spec::parse("chain.hamel", &chain.text(n)).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(model.name, chain.model(n));
        }
    }

    #[test]
    fn a_mechanism_has_a_line_for_each_body() {
        assert_eq!(Chain::Snake.mechanism(3), None);
        for chain in Chain::ALL.into_iter().filter(|c| *c != Chain::Snake) {
            let text = chain.mechanism(3).unwrap_or_default();
            let lines: Vec<usize> = text.lines().map(|l| l.split_whitespace().count()).collect();
            assert_eq!(lines, [6, 20, 20, 20], "{text}");
        }
    }
}
