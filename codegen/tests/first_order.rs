//! States of first order against equations of motion written by hand.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;

fn build(items: &str, scene: &str) -> BuiltScene {
    let text = format!("model m {{ {items} }}");
    let model = spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"))
}

/// What is wrong with a scene.
fn refusal(items: &str, scene: &str) -> String {
    let text = format!("model m {{ {items} }}");
    let problems = match spec::parse("m.hamel", &text) {
        Ok(model) => scene::build(&model, scene).expect_err("a refusal").to_string(),
        Err(problems) => problems.to_string(),
    };
    problems
}

/// Rates of a scene and its energy at a state by names.
fn rates(built: &BuiltScene, y: &[(&str, f64)], u: &[f64]) -> (Vec<f64>, Option<f64>) {
    let prepared = built.prepare(&[]).unwrap_or_else(|e| panic!("{e}"));
    let value = |name: &String| y.iter().find(|(own, _)| own == name).unwrap_or_else(|| panic!("no {name}")).1;
    let y: Vec<f64> = built.state_names().iter().map(value).collect();
    let mut dy = vec![0.0; y.len()];
    prepared.rhs_with(0.3, &y, u, &mut dy);
    (dy, prepared.energy(0.3, &y))
}

fn rate(built: &BuiltScene, name: &str, y: &[(&str, f64)], u: &[f64]) -> f64 {
    let at = built.state_names().iter().position(|own| own == name).unwrap_or_else(|| panic!("no {name}"));
    rates(built, y, u).0[at]
}

fn close(what: &str, found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-14 * expected.abs().max(1.0), "{what}: {found}, by hand {expected}");
}

const U: f64 = 1.7;

/// A constraint whose coefficient is a state: `y' = s x'`, so that `(1 + s^2) x'' = -s s' x'`.
const BLADE: &str = "input u = 0; coordinate x, y in real; state s in real by s_dot = u - s*x_dot;
    lagrangian = (x_dot^2 + y_dot^2)/2; constraint y_dot = s*x_dot;";

#[test]
fn a_constraint_may_contain_a_state_whose_rate_has_an_input() {
    let (x, y, s, v) = (0.2, -0.4, 0.7, 1.3);
    let s_dot = U - s * v;
    let expected = -s * s_dot * v / (1.0 + s * s);
    let scene = format!("{BLADE} scene a {{ input u; want energy, momentum_equation, bracket; }}");
    let solved = build(&scene, "a");
    let state = [("x", x), ("y", y), ("s", s), ("x_dot", v), ("y_dot", s * v)];
    close("s", rate(&solved, "s", &state, &[U]), s_dot);
    close("x''", rate(&solved, "x_dot", &state, &[U]), expected);
    assert!(solved.equations.facts.energy_is_conserved);
    assert_ne!(solved.equations.facts.holonomic, Some(true));
    let kept = build(&format!("{BLADE} multipliers; scene a {{ input u; want energy, bracket, implicit; }}"), "a");
    close("x'' by multipliers", rate(&kept, "x_dot", &state, &[U]), expected);
    let turning = s * expected + s_dot * v;
    close("y'' by multipliers", rate(&kept, "y_dot", &state, &[U]), turning);
}

/// A kinetic energy and a potential that depend on a state: `E' = -dL/dz z'`.
#[test]
fn a_lagrangian_may_contain_a_state() {
    let items = "input u = 0; coordinate x in real; state z in real by z_dot = x_dot + u;
        lagrangian = (1 + z^2)*x_dot^2/2 - z*x^2/2;
        scene a { input u; want energy, energy_rate, bracket, implicit, taylor, linearization; }
        momentum p of x_dot; scene b { input u; carry p; want energy, bracket; }";
    let (x, z, v) = (0.6, -0.8, 1.1);
    let z_dot = v + U;
    let state = [("x", x), ("z", z), ("x_dot", v), ("p", (1.0 + z * z) * v)];
    let by_velocity = build(items, "a");
    let expected = (-z * x - 2.0 * z * z_dot * v) / (1.0 + z * z);
    close("x''", rate(&by_velocity, "x_dot", &state, &[U]), expected);
    close("z'", rate(&by_velocity, "z", &state, &[U]), z_dot);
    let prepared = by_velocity.prepare(&[]).unwrap();
    let y: Vec<f64> = [x, v, z].to_vec();
    assert_eq!(by_velocity.state_names(), ["x", "x_dot", "z"]);
    let mut prepared = prepared;
    prepared.set_inputs(&[U]);
    let names: Vec<String> =
        by_velocity.outputs().iter().flat_map(|o| &o.components).map(|(name, _)| name.clone()).collect();
    let at = names.iter().position(|name| name == "energy_rate").unwrap_or_else(|| panic!("{names:?}"));
    close("E'", prepared.outputs(0.3, &y)[at], (-z * v * v + x * x / 2.0) * z_dot);
    let by_momentum = build(items, "b");
    close("p'", rate(&by_momentum, "p", &state, &[U]), -z * x);
    close("z' beside a momentum", rate(&by_momentum, "z", &state, &[U]), z_dot);
}

#[test]
fn a_hamiltonian_may_contain_a_state() {
    let items = "coordinate x in real; momentum p of x_dot; state z in (0, 4) by z_dot = -z*x_dot^2;
        hamiltonian = p^2/(2*(1 + z)) + z*x^2/2; scene a { want energy, energy_rate, bracket; }";
    let (x, z, p) = (0.6, 0.8, 1.1);
    let built = build(items, "a");
    let state = [("x", x), ("z", z), ("p", p)];
    let v = p / (1.0 + z);
    close("x'", rate(&built, "x", &state, &[]), v);
    close("p'", rate(&built, "p", &state, &[]), -z * x);
    close("z'", rate(&built, "z", &state, &[]), -z * v * v);
}

/// The angular velocity of a body drives a filter; a torque follows the filter.
#[test]
fn bodies_in_frames_have_states() {
    let items = "velocity Omega in so(3); state f: vector(3) in real by f_dot = Omega - 2*f;
        lagrangian = (Omega1^2 + 2*Omega2^2 + 3*Omega3^2)/2; force Omega = -f; output rate_of_filter = f_dot;
        scene a { want energy, outputs, bracket; }
        stage whole; stage part = ideal([1, 0, 0], [0, 1, 0], [0, 0, 1]);";
    let built = build(items.split(" stage").next().unwrap(), "a");
    let state =
        [("Omega1", 0.3), ("Omega2", -0.7), ("Omega3", 0.9), ("f1", 0.1), ("f2", 0.2), ("f3", -0.4)];
    close("Omega1'", rate(&built, "Omega1", &state, &[]), (2.0 - 3.0) * -0.7 * 0.9 - 0.1);
    close("Omega2'", rate(&built, "Omega2", &state, &[]), ((3.0 - 1.0) * 0.9 * 0.3 - 0.2) / 2.0);
    close("f3'", rate(&built, "f3", &state, &[]), 0.9 + 0.8);
    let quasi = "coordinate x, y in real; frame { a = x_dot + y_dot; b = y_dot; }
        state z in real by z_dot = x_dot - z; lagrangian = (x_dot^2 + y_dot^2)/2; force x_dot = -z;
        scene q { want energy, bracket; }";
    let built = build(quasi, "q");
    let state = [("x", 0.1), ("y", 0.2), ("a", 0.9), ("b", 0.4), ("z", 0.3)];
    close("z' in a frame", rate(&built, "z", &state, &[]), 0.5 - 0.3);
    close("b'", rate(&built, "b", &state, &[]), 0.0);
    close("a'", rate(&built, "a", &state, &[]), -0.3);
}

/// A field of first order beside states, and rates that mention each other.
#[test]
fn a_field_has_states_beside_it() {
    let items = "input u = 0; coordinate x in real; field x_dot = -x + w;
        state w in real by w_dot = u - v_dot; state v in real by v_dot = x_dot - v;
        output slope = x_dot; scene a { input u; want outputs; }";
    let built = build(items, "a");
    let (x, w, v) = (0.4, 1.2, -0.3);
    let state = [("x", x), ("w", w), ("v", v)];
    close("x'", rate(&built, "x", &state, &[U]), -x + w);
    close("v'", rate(&built, "v", &state, &[U]), -x + w - v);
    close("w'", rate(&built, "w", &state, &[U]), U - (-x + w - v));
}

#[test]
fn what_a_state_cannot_be_in_is_told() {
    let cases = [
        ("coordinate x in real; state z in real by z_dot = 1; lagrangian = x_dot^2; constraint x = z;", "positions"),
        ("coordinate x in real by x = z; state z in real by z_dot = 1; lagrangian = x_dot^2;", "positions"),
        ("coordinate x in real; state z in real by z_dot = 1; frame { a = (2 + z)*x_dot; } lagrangian = a^2;", "the frame"),
        (
            "coordinate x, y in real; state z in real by z_dot = -z; lagrangian = x*y_dot - y^2 - z*x;",
            "contains a state of first order",
        ),
        ("coordinate x in real; state z in real by y_dot = 1; lagrangian = x_dot^2;", "is not the rate of `z`"),
        (
            "coordinate x in real; state a in real by a_dot = b_dot; state b in real by b_dot = a_dot; \
             lagrangian = x_dot^2;",
            "in a circle",
        ),
        (
            "momentum p in so(3); state z in real by z_dot = -z; hamiltonian = dot(p, p)/2 + z*p1; \
             scene default { want splitting; }",
            "",
        ),
    ];
    for (items, expected) in cases {
        let found = refusal(items, "default");
        assert!(found.contains(expected), "{items}: {found}");
    }
}
