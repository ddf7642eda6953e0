//! Which parameters and components of a scene's state form vectors, matrices, attitudes and places.
//!
//! Does not know: how a module speaks of them.

use crate::emit::{GroupKind, GroupText, GroupTexts};
use crate::expr::SymbolId;
use crate::reduction::{Block, BlockKind};
use crate::spec::Layout;

use super::built::BuiltScene;

/// All groups of which the scene has every number: what it fixes or leaves out takes the group with it.
pub(super) fn groups(scene: &BuiltScene) -> GroupTexts {
    let system = &scene.equations.system;
    let params: Vec<SymbolId> = system.params.iter().map(|p| p.symbol).collect();
    let arrays = system.param_arrays.iter().filter_map(|array| {
        let kind = match array.layout {
            Layout::Vector(_) => GroupKind::Vector,
            Layout::Diagonal(_) => GroupKind::Diagonal,
            Layout::Symmetric(n) => GroupKind::Symmetric(n),
            Layout::Matrix(n_rows, n_columns) => GroupKind::Matrix(n_rows, n_columns),
        };
        group(&array.name, kind, &array.symbols, &params)
    });
    let state: Vec<SymbolId> = scene.state.iter().map(|s| s.symbol).collect();
    GroupTexts { params: arrays.collect(), state: of_state(&system.blocks, &state) }
}

/// The groups of a state: its vectors and attitudes, then the places that these make.
fn of_state(blocks: &[Block], state: &[SymbolId]) -> Vec<GroupText> {
    let mut groups = Vec::new();
    let mut places = Vec::new();
    for (k, block) in blocks.iter().enumerate() {
        let (kind, place) = match block.kind {
            BlockKind::Attitude => (GroupKind::Attitude, Some(GroupKind::Place)),
            BlockKind::Heading => (GroupKind::Vector, Some(GroupKind::PlanarPlace)),
            BlockKind::Matrix(n) => (GroupKind::Matrix(n, n), None),
            BlockKind::Velocity
            | BlockKind::Momentum
            | BlockKind::Advected
            | BlockKind::Position { .. }
            | BlockKind::Reconstructed => (GroupKind::Vector, None),
        };
        // One number is a field and no vector.
        if block.components.len() > 1 {
            groups.extend(group(&block.name, kind, &block.components, state));
        }
        let own = |other: &&Block| other.kind == BlockKind::Position { attitude: k };
        let position: Vec<SymbolId> =
            blocks.iter().filter(own).flat_map(|other| other.components.iter().copied()).collect();
        if let Some(place) = place.filter(|_| !position.is_empty()) {
            let components = [block.components.as_slice(), &position].concat();
            places.extend(group("place", place, &components, state));
        }
    }
    groups.extend(places);
    groups
}

/// The group of some numbers among all; none unless all of them are there.
fn group(name: &str, kind: GroupKind, symbols: &[SymbolId], among: &[SymbolId]) -> Option<GroupText> {
    let components: Option<Vec<usize>> =
        symbols.iter().map(|symbol| among.iter().position(|s| s == symbol)).collect();
    Some(GroupText { name: name.to_owned(), kind, components: components? })
}

#[cfg(test)]
mod tests {
    use super::super::{Writing, build};
    use super::*;
    use crate::spec;

    fn built(text: &str, scene: &str) -> BuiltScene {
        let model = spec::parse("m", text).expect("a valid model");
        build(&model, scene).expect("a scene")
    }

    fn listed(groups: &[GroupText]) -> Vec<(&str, GroupKind, &[usize])> {
        groups.iter().map(|g| (g.name.as_str(), g.kind, g.components.as_slice())).collect()
    }

    #[test]
    fn vectors_attitudes_and_places_are_those_of_the_model() {
        let scene = built(
            "model kite {
                param I: diagonal(3) = [2, 3, 4] where I1 > 0, I2 > 0, I3 > 0;
                param m = 1 where m > 0;
                param k: vector(3) = [1, 0, 1];
                velocity Omega, V in se(3);
                advected Gamma in R^3 by cross(Omega, Gamma);
                lagrangian = 1/2*dot(Omega, I*Omega) + m/2*dot(V, V) - dot(k, Gamma);
                reconstruct q, r in SE(3);
            }",
            "reconstruction",
        );
        let found = groups(&scene);
        assert_eq!(
            listed(&found.params),
            [("I", GroupKind::Diagonal, [0, 1, 2].as_slice()), ("k", GroupKind::Vector, &[4, 5, 6])]
        );
        assert_eq!(
            listed(&found.state),
            [
                ("Omega", GroupKind::Vector, [0, 1, 2].as_slice()),
                ("V", GroupKind::Vector, &[3, 4, 5]),
                ("Gamma", GroupKind::Vector, &[6, 7, 8]),
                ("q", GroupKind::Attitude, &[9, 10, 11, 12]),
                ("r", GroupKind::Vector, &[13, 14, 15]),
                ("place", GroupKind::Place, &[9, 10, 11, 12, 13, 14, 15]),
            ]
        );
    }

    #[test]
    fn matrices_of_a_group_are_matrices() {
        let scene = built(
            "model turning {
                velocity w in su(2);
                lagrangian = 1/2*dot(w, w) + w1^2;
                reconstruct g in SU(2);
            }",
            "reconstruction",
        );
        let found = groups(&scene).state;
        let expected = [
            ("w", GroupKind::Vector, [0, 1, 2].as_slice()),
            ("g_re", GroupKind::Matrix(2, 2), &[3, 4, 5, 6]),
            ("g_im", GroupKind::Matrix(2, 2), &[7, 8, 9, 10]),
        ];
        assert_eq!(listed(&found), expected);
    }

    #[test]
    fn what_a_scene_lacks_takes_its_group_with_it() {
        let text = "model wheel {
                param C: matrix(2, 2) = [[2, 0], [0, 3]];
                velocity w, v1, v2 in se(2);
                lagrangian = 1/2*w^2 + 1/2*C11*v1^2 + 1/2*C22*v2^2 + C12*v1*v2 + C21*v1*v2;
                constraint v2 = 0;
                reconstruct theta, x, y in SE(2);
                scene half { fix C12 = 1; }
            }";
        let found = groups(&built(text, "half"));
        assert_eq!(found, GroupTexts::default());
        let found = groups(&built(text, "reconstruction"));
        assert_eq!(listed(&found.params), [("C", GroupKind::Matrix(2, 2), [0, 1, 2, 3].as_slice())]);
        assert_eq!(listed(&found.state), [("place", GroupKind::PlanarPlace, [2, 3, 4].as_slice())]);
    }

    #[test]
    fn modules_have_them_where_they_are_asked_to() {
        let scene = built(
            "model top {
                velocity Omega in so(3);
                lagrangian = 1/2*dot(Omega, Omega) + 1/2*Omega3^2;
            }",
            "default",
        );
        let plain = scene.emit().expect("a module");
        assert!(!plain.contains("nalgebra"), "{plain}");
        let writing = Writing { nalgebra: true, ..Writing::default() };
        let asked = scene.emit_as(&writing).expect("a module");
        assert!(asked.starts_with(&plain), "what is asked for comes last");
        assert!(asked.contains("pub fn Omega(&self)") && asked.contains("fn on_vectors"), "{asked}");
    }
}
