//! Motions that are given and follow from no Lagrangian: reduced and unreduced ones are the same, with reconstruction,
//! advected parameters and both sides of the action.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_tests::models::{close, follow, times};
use hamel_tests::problem::equations_of;

fn build(text: &str, scene: &str) -> BuiltScene {
    let model = spec::parse("given.hamel", text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// Holds the variables of one motion to those of another; initial values of both by name.
fn same(one: (&BuiltScene, &[(&str, f64)]), other: (&BuiltScene, &[(&str, f64)]), names: &[&str]) {
    let on_the_way = times(3.0, 6);
    let mut expected: Vec<Vec<f64>> = Vec::new();
    follow(other.0, &[], other.1, &on_the_way, |at| {
        expected.push(names.iter().map(|n| at.get(n)).collect());
    });
    let mut next = expected.iter();
    follow(one.0, &[], one.1, &on_the_way, |at| {
        let found: Vec<f64> = names.iter().map(|n| at.get(n)).collect();
        close("motion", &found, next.next().expect("as many states as times"), 1e-10);
    });
}

/// A body in the plane that turns towards a direction in space and is driven along its axis.
const LEFT: &str = "model body {
    velocity omega, v in se(2);
    advected G in R^2 by [omega*(-G2), omega*G1];
    acceleration omega = G2 - 0.3*omega;
    acceleration v = [1 - v1 + omega*v2, -2*v2 - omega*v1*G1];
    reconstruct theta, x, y in SE(2);
    scene whole { want rhs, reconstruction, jacobian, taylor; }
}";

#[test]
fn a_given_motion_on_a_group_is_the_one_in_coordinates() {
    let plain = "model body {
        coordinate theta in angle; coordinate x, y in real;
        let c = cos(theta); let s = sin(theta);
        let v1 = c*x_dot + s*y_dot; let v2 = -s*x_dot + c*y_dot; let omega = theta_dot;
        let G1 = c; let G2 = -s;
        let a1 = 1 - v1 + omega*v2; let a2 = -2*v2 - omega*v1*G1;
        acceleration theta_dot = G2 - 0.3*omega;
        acceleration x_dot = c*(a1 - omega*v2) - s*(a2 + omega*v1);
        acceleration y_dot = s*(a1 - omega*v2) + c*(a2 + omega*v1);
    }";
    let (theta, v) = (0.3_f64, [0.4, -0.2]);
    let (s, c) = theta.sin_cos();
    let reduced = [
        ("omega", 0.5),
        ("v1", v[0]),
        ("v2", v[1]),
        ("G1", c),
        ("G2", -s),
        ("theta", theta),
        ("x", 1.0),
        ("y", -1.0),
    ];
    let unreduced = [
        ("theta", theta),
        ("x", 1.0),
        ("y", -1.0),
        ("theta_dot", 0.5),
        ("x_dot", c * v[0] - s * v[1]),
        ("y_dot", s * v[0] + c * v[1]),
    ];
    let (one, other) = (build(LEFT, "whole"), build(plain, scene::DEFAULT));
    same((&one, &reduced), (&other, &unreduced), &["theta", "x", "y"]);
}

#[test]
fn the_action_from_the_right_has_the_velocities_of_space() {
    let reduced = "model body {
        velocity omega, v in se(2); action right;
        coordinate k in real;
        acceleration omega = k - omega; acceleration v = [omega*v2, k*omega - v2];
        field k_dot = cos(t) - k;
        reconstruct theta, x, y in SE(2);
        scene whole { want rhs, reconstruction; }
    }";
    // xdot = v + omega x (x, y).
    let plain = "model body {
        coordinate theta in angle; coordinate x, y, k in real;
        let omega = theta_dot;
        let v1 = x_dot + omega*y; let v2 = y_dot - omega*x;
        let turn = k - omega;
        acceleration theta_dot = turn;
        acceleration x_dot = omega*v2 - turn*y - omega*y_dot;
        acceleration y_dot = k*omega - v2 + turn*x + omega*x_dot;
        field k_dot = cos(t) - k;
    }";
    let (one, other) = (build(reduced, "whole"), build(plain, scene::DEFAULT));
    let (theta, x, y, omega, v) = (0.2, 0.5, -0.4, 0.6, [0.3, 0.1]);
    let start = [("theta", theta), ("x", x), ("y", y), ("k", 0.7)];
    let own = [("omega", omega), ("v1", v[0]), ("v2", v[1])];
    let rates = [("theta_dot", omega), ("x_dot", v[0] - omega * y), ("y_dot", v[1] + omega * x)];
    same(
        (&one, &[start.as_slice(), &own].concat()),
        (&other, &[start.as_slice(), &rates].concat()),
        &["theta", "x", "y", "k"],
    );
}

#[test]
fn a_field_of_first_order_has_no_velocities_in_its_state() {
    let reduced = "model walker {
        coordinate s in angle;
        velocity omega, v in se(2);
        field s_dot = 1 + sin(s)/2;
        field omega = sin(s); field v = [cos(s), s/10];
        reconstruct theta, x, y in SE(2);
        casimir none = 1;
        output speed = v1;
        scene whole { want rhs, reconstruction, speed; }
    }";
    let plain = "model walker {
        coordinate s, theta in angle; coordinate x, y in real;
        let c = cos(theta); let w = sin(theta);
        field s_dot = 1 + sin(s)/2;
        field theta_dot = sin(s);
        field x_dot = c*cos(s) - w*s/10; field y_dot = w*cos(s) + c*s/10;
    }";
    let (one, other) = (build(reduced, "whole"), build(plain, scene::DEFAULT));
    let names: Vec<&str> = one.equations().state.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["s"]);
    let start = [("s", 0.1), ("theta", 0.4), ("x", 0.0), ("y", 0.3)];
    same((&one, &start), (&other, &start), &["s", "theta", "x", "y"]);
}

#[test]
fn a_given_motion_in_a_frame_is_the_one_in_coordinates() {
    // Free motion in the plane: u' = v^2/r, v' = -u v/r in the frame of polar coordinates.
    let framed = "model free { coordinate r in (0, 10); coordinate phi in angle;
        frame { u = r_dot; v = r*phi_dot; }
        acceleration u = v^2/r; acceleration v = -u*v/r; }";
    let plain = "model free { coordinate r in (0, 10); coordinate phi in angle;
        lagrangian = (r_dot^2 + r^2*phi_dot^2)/2; }";
    let (one, other) = (build(framed, scene::DEFAULT), build(plain, scene::DEFAULT));
    let start = [("r", 1.0), ("phi", 0.2)];
    same(
        (&one, &[start.as_slice(), &[("u", 0.3), ("v", 0.8)]].concat()),
        (&other, &[start.as_slice(), &[("r_dot", 0.3), ("phi_dot", 0.8)]].concat()),
        &["r", "phi"],
    );
}

#[test]
fn a_given_motion_has_no_energy_and_claims_are_verified() {
    let text = "model oscillator { param k = 2; coordinate x in real; acceleration x_dot = -k*x;
        casimir E = x_dot^2 + k*x^2; scene kept { want rhs, casimirs, invariants; } }";
    let equations = equations_of(text).unwrap_or_else(|e| panic!("{e}"));
    assert!(!equations.has_energy() && !equations.facts.energy_is_conserved);
    assert_eq!(equations.facts.casimirs, ["E"]);
    let built = build(text, "kept");
    assert!(built.outputs().iter().any(|o| o.name == "invariants"));
    assert!(built.outputs().iter().all(|o| o.name != "energy" && o.name != "momentum"));
    let wrong = text.replace("x_dot^2 +", "x_dot^2 + x +");
    assert!(equations_of(&wrong).is_err(), "a claim that does not hold");
}
