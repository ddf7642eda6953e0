//! Modules in the types of `nalgebra`: what the accessors give and take, on a system without motion.
//!
//! `groups/module.rs` is the module. Write it again with
//! `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main groups`.

use std::f64::consts::FRAC_PI_2;

use expect_test::expect_file;
use hamel_codegen::emit::{GroupKind, GroupText, GroupTexts, ParamText, SceneText, StateText, emit_scene};
use hamel_codegen::expr::{Graph, Rational};
use hamel_codegen::lower::{Inputs, Request, SearchBudget, lower};
use hamel_codegen::program::Role;
use hamel_runtime::nalgebra::{
    Isometry2, Isometry3, Matrix2, Matrix2x3, Matrix3, Point2, Point3, SVector, UnitQuaternion, Vector2,
    Vector3,
};
use hamel_runtime::{Integrator, Options, Tsit5};

/// The module, as a crate has it.
mod module {
    include!("groups/module.rs");
}

const PARAMS: [&str; 16] = [
    "m", "value1", "value2", "value", "I1", "I2", "I3", "G11", "G12", "G22", "C11", "C12", "C13", "C21",
    "C22", "C23",
];
const STATE: [&str; 14] =
    ["Omega1", "Omega2", "Omega3", "qw", "qx", "qy", "qz", "r1", "r2", "r3", "theta", "x", "y", "clone"];

fn group(name: &str, kind: GroupKind, components: impl IntoIterator<Item = usize>) -> GroupText {
    GroupText { name: name.into(), kind, components: components.into_iter().collect() }
}

fn text() -> String {
    let mut g = Graph::new();
    let params = PARAMS.map(|name| g.symbol(name));
    let state = STATE.map(|name| (name, g.symbol(name)));
    let time = g.symbol("the time");
    let inputs = Inputs {
        params: params.to_vec(),
        time,
        held: Vec::new(),
        state: state.iter().map(|(_, symbol)| *symbol).collect(),
        signs: Default::default(),
        circles: vec![],
        arguments: Default::default(),
        divisors: Default::default(),
    };
    // Everything turns into its opposite.
    let opposite = state.map(|(name, symbol)| {
        let component = g.sym(symbol);
        (name.to_owned(), g.neg(component))
    });
    let requests = [Request { role: Role::Rate, results: opposite.to_vec() }];
    let program = lower(&mut g, &inputs, &[], &[], &requests, &SearchBudget::default()).unwrap();
    let params = PARAMS.iter().zip(1i64..).map(|(name, k)| ParamText {
        name: (*name).into(),
        default: Rational::from_integer(k.into()),
        doc: String::new(),
    });
    let text = SceneText {
        model: "still".into(),
        scene: "default".into(),
        command: "UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main groups".into(),
        params: params.collect(),
        state: STATE.iter().map(|name| StateText { name: (*name).into(), doc: String::new() }).collect(),
        groups: Some(GroupTexts {
            params: vec![
                group("value", GroupKind::Vector, [1, 2, 3]),
                group("I", GroupKind::Diagonal, 4..7),
                group("G", GroupKind::Symmetric(2), 7..10),
                group("C", GroupKind::Matrix(2, 3), 10..16),
            ],
            state: vec![
                group("Omega", GroupKind::Vector, 0..3),
                group("q", GroupKind::Attitude, 3..7),
                group("place", GroupKind::Place, 3..10),
                group("place", GroupKind::PlanarPlace, 10..13),
                group("clone", GroupKind::Vector, [13, 0]),
            ],
        }),
        ..SceneText::default()
    };
    emit_scene(&program, None, &text).unwrap()
}

#[test]
fn the_module_is_the_one_that_was_compiled() {
    expect_file!["groups/module.rs"].assert_eq(&text());
}

#[test]
fn parameters_are_vectors_and_matrices() {
    let params = module::Params::<f64>::default();
    assert_eq!(params.value(), Vector3::new(2.0, 3.0, 4.0));
    assert_eq!(params.I(), Matrix3::from_diagonal(&Vector3::new(5.0, 6.0, 7.0)));
    assert_eq!(params.G(), Matrix2::new(8.0, 9.0, 9.0, 10.0));
    assert_eq!(params.C(), Matrix2x3::new(11.0, 12.0, 13.0, 14.0, 15.0, 16.0));

    let other = params
        .with_value(Vector3::new(-1.0, -2.0, -3.0))
        .with_I(Vector3::new(0.5, 0.25, 0.125))
        .with_G(Matrix2::new(1.0, 2.0, 2.0, 3.0))
        .with_C(2.0 * params.C());
    assert_eq!(other.value(), Vector3::new(-1.0, -2.0, -3.0));
    assert_eq!([other.I1, other.I2, other.I3], [0.5, 0.25, 0.125]);
    assert_eq!([other.G11, other.G12, other.G22], [1.0, 2.0, 3.0]);
    assert_eq!(other.C(), 2.0 * params.C());
    assert_eq!(other.m, params.m);
}

#[test]
fn states_are_vectors_attitudes_and_places() {
    let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
    let place = Isometry3::from_parts(Vector3::new(1.0, 2.0, 3.0).into(), quarter);
    let planar = Isometry2::new(Vector2::new(4.0, 5.0), FRAC_PI_2);
    let state = module::State::from_vector(SVector::zeros())
        .with_Omega(Vector3::new(0.1, 0.2, 0.3))
        .with_place(place)
        .with_place_2(planar);
    assert_eq!(state.Omega(), Vector3::new(0.1, 0.2, 0.3));
    assert_eq!([state.qw, state.qx, state.qy, state.qz], [quarter.w, quarter.i, quarter.j, quarter.k]);
    assert_eq!([state.r1, state.r2, state.r3, state.x, state.y], [1.0, 2.0, 3.0, 4.0, 5.0]);
    assert!((state.theta - FRAC_PI_2).abs() < 1e-15);
    assert!(state.q().angle_to(&quarter) < 1e-15);
    let point = state.place() * Point3::new(1.0, 0.0, 0.0);
    assert!((point - Point3::new(1.0, 3.0, 3.0)).norm() < 1e-15, "{point}");
    let point = state.place_2() * Point2::new(1.0, 0.0);
    assert!((point - Point2::new(4.0, 6.0)).norm() < 1e-15, "{point}");
    assert_eq!(state.clone_2(), Vector2::new(0.0, 0.1));
    assert_eq!(state.with_q(quarter.inverse()).q(), quarter.inverse());

    // A quaternion that has lost its length on the way is an attitude all the same.
    let long = module::State { qw: 3.0 * state.qw, qz: 3.0 * state.qz, ..state };
    assert!(long.q().angle_to(&quarter) < 1e-15);
    assert_eq!(long.to_vector()[3], 3.0 * state.qw);
}

#[test]
fn the_system_takes_vectors() {
    let system = module::Prepared::new(&module::Params::<f64>::default()).unwrap().on_vectors();
    let y = module::State::from_array(std::array::from_fn(|k| k as f64)).to_vector();
    assert_eq!(system.derivative(0.0, &y), -y);
    let mut solver = Integrator::new(&system, Tsit5, 0.0, y, Options::adaptive(1e-10, 1e-10)).unwrap();
    solver.integrate_to(1.0).unwrap();
    let end = module::State::from_vector(*solver.state());
    assert!((end.Omega() - (-1.0_f64).exp() * Vector3::new(0.0, 1.0, 2.0)).norm() < 1e-9);
}
