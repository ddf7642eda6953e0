//! What of a scene is a vector, a matrix, an attitude or a place.

use hamel_codegen::scene::{BuiltScene, Writing, build, groups};
use hamel_codegen::spec;
use hamel_program::emit::{GroupKind, GroupText, GroupTexts};

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
