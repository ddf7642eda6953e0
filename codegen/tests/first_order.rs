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
    match spec::parse("m.hamel", &text) {
        Ok(model) => scene::build(&model, scene).expect_err("a refusal").to_string(),
        Err(problems) => problems.to_string(),
    }
}

/// Rates of a scene and its energy at a state by names.
fn rates(built: &BuiltScene, y: &[(&str, f64)], u: &[f64]) -> (Vec<f64>, Option<f64>) {
    let prepared = built.prepare(&[]).unwrap_or_else(|e| panic!("{e}"));
    let value =
        |name: &String| y.iter().find(|(own, _)| own == name).unwrap_or_else(|| panic!("no {name}")).1;
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
    assert!(
        (found - expected).abs() < 1e-14 * expected.abs().max(1.0),
        "{what}: {found}, by hand {expected}"
    );
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
    assert!(solved.equations().facts.energy_is_conserved);
    assert_ne!(solved.equations().facts.holonomic, Some(true));
    let kept =
        build(&format!("{BLADE} multipliers; scene a {{ input u; want energy, bracket, implicit; }}"), "a");
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
        hamiltonian = p^2/(2*(1 + z)) + z*x^2/2; scene a { want energy, energy_rate, bracket, implicit; }";
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
    let state = [("Omega1", 0.3), ("Omega2", -0.7), ("Omega3", 0.9), ("f1", 0.1), ("f2", 0.2), ("f3", -0.4)];
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
        (
            "coordinate x in real; state z in real by z_dot = 1; lagrangian = x_dot^2; constraint x = z;",
            "positions",
        ),
        ("coordinate x in real by x = z; state z in real by z_dot = 1; lagrangian = x_dot^2;", "positions"),
        (
            "coordinate x in real; state z in real by z_dot = 1; frame { a = (2 + z)*x_dot; } lagrangian = a^2;",
            "contains `z`",
        ),
        (
            "coordinate x, y in real; state z in real by z_dot = -z; lagrangian = x*y_dot - y^2 - z*x;",
            "contains a state of first order",
        ),
        (
            "coordinate x in real; state z in real by y_dot = 1; lagrangian = x_dot^2;",
            "is not the rate of `z`",
        ),
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

/// Friction heats: the entropy has no inertia, and a constraint that is not linear gives its velocity.
const HEATED: &str = "param m = 1; param k = 2; param lam = 0.3; param c = 1.5; coordinate x, S in real;
    lagrangian = m*x_dot^2/2 - k*x^2/2 - c*exp(S/c); constraint heat: exp(S/c)*S_dot = lam*x_dot^2;
    virtual exp(S/c)*delta(S_dot) - lam*x_dot*delta(x_dot) = 0; output heating = exp(S/c)*S_dot;
    scene a { want energy, outputs, bracket, taylor; }";

#[test]
fn a_nonlinear_constraint_gives_a_velocity_without_inertia() {
    let built = build(HEATED, "a");
    assert_eq!(built.state_names(), ["x", "x_dot", "S"]);
    assert!(built.equations().facts.energy_is_conserved);
    let params = [1.3, 2.1, 0.4, 1.7];
    let [m, k, lam, c] = params;
    let prepared = built.prepare(&params).unwrap();
    let (x, v, s) = (0.7, -1.2, 0.4);
    let mut dy = [0.0; 3];
    prepared.rhs(0.0, &[x, v, s], &mut dy);
    close("x''", dy[1], (-k * x - lam * v) / m);
    close("S'", dy[2], lam * v * v * (-s / c).exp());
    close("heat", prepared.outputs(0.0, &[x, v, s])[0], lam * v * v);
    // Two bodies that heat by friction, one after the other, and a force on the entropy of one.
    let items = "coordinate x, y, S, T in real; lagrangian = (x_dot^2 + 2*y_dot^2)/2 - exp(S) - T^2/2;
        constraint exp(S)*S_dot = x_dot^2; constraint first: T*T_dot = 3*y_dot^2;
        virtual exp(S)*delta(S_dot) = x_dot*delta(x_dot); virtual T*delta(T_dot) = 3*y_dot*delta(y_dot);
        force S_dot = -x; scene b { want energy; }";
    let built = build(items, "b");
    let state = [("x", 0.3), ("y", 0.1), ("x_dot", 0.8), ("y_dot", -0.6), ("S", 0.2), ("T", 1.4)];
    // w = x_dot exp(-S), dL/dS + F_S = -exp(S) - x.
    close("x''", rate(&built, "x_dot", &state, &[]), 0.8 * (-0.2_f64).exp() * (-(0.2_f64.exp()) - 0.3));
    close("y''", rate(&built, "y_dot", &state, &[]), 3.0 * -0.6 / 1.4 * -1.4 / 2.0);
    close("T'", rate(&built, "T", &state, &[]), 3.0 * 0.36 / 1.4);
}

/// A swimmer of three links in a fluid without inertia (Purcell): force and torque of the drag vanish, which gives the
/// motion of the middle link by the rates of both joints.
#[test]
fn constraints_may_give_every_velocity() {
    // Drag along and across a link, by the length; links of the length 2 l.
    let items = "param l = 1; param k = 2; coordinate a, b in angle; velocity w, v in se(2);
        let left = [-l, 0] - l*[cos(a), sin(a)]; let right = [l, 0] + l*[cos(b), sin(b)];
        let u_left = v + w*[-left[2], left[1]] + a_dot*[sin(a), -cos(a)]*l;
        let u_right = v + w*[-right[2], right[1]] + b_dot*[-sin(b), cos(b)]*l;
        let t_left = [cos(a), sin(a)]; let n_left = [-sin(a), cos(a)];
        let t_right = [cos(b), sin(b)]; let n_right = [-sin(b), cos(b)];
        let f = [v1, k*v2];
        let f_left = dot(u_left, t_left)*t_left + k*dot(u_left, n_left)*n_left;
        let f_right = dot(u_right, t_right)*t_right + k*dot(u_right, n_right)*n_right;
        let spin = k*l^2/3*(3*w + a_dot + b_dot);
        constraint sum: f + f_left + f_right = [0, 0];
        constraint torque: spin + left[1]*f_left[2] - left[2]*f_left[1] + right[1]*f_right[2] - right[2]*f_right[1] = 0;
        constraint first: a_dot = -sin(t); constraint second: b_dot = cos(t);
        lagrangian = 0; reconstruct theta, x, y in SE(2);
        scene s { want rhs, reconstruction; }";
    let built = build(items, "s");
    assert_eq!(built.state_names(), ["a", "b", "theta", "x", "y"]);
    let prepared = built.prepare(&[0.9, 1.8]).unwrap();
    let (t, a, b) = (0.4_f64, 0.7_f64, -0.5_f64);
    let mut dy = [0.0; 5];
    prepared.rhs(t, &[a, b, 0.0, 0.0, 0.0], &mut dy);
    // Total drag at that motion, by sums over short pieces of the links: nothing is left.
    let (l, k) = (0.9, 1.8);
    let (w, v, rates) = (dy[2], [dy[3], dy[4]], [dy[0], dy[1]]);
    assert_eq!(rates, [-t.sin(), t.cos()]);
    let mut total = [0.0; 3];
    let n = 2000;
    for (joint, angle, rate, sign) in [(0.0, 0.0, 0.0, 0.0), (-l, a, rates[0], -1.0), (l, b, rates[1], 1.0)] {
        for i in 0..n {
            let s = ((f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0) * l + sign * l;
            let (tangent, normal) = ([angle.cos(), angle.sin()], [-angle.sin(), angle.cos()]);
            let place = [joint + s * tangent[0], s * tangent[1]];
            let u = [v[0] - w * place[1] + rate * s * normal[0], v[1] + w * place[0] + rate * s * normal[1]];
            let (along, across) =
                (u[0] * tangent[0] + u[1] * tangent[1], k * (u[0] * normal[0] + u[1] * normal[1]));
            let f = [0, 1].map(|i| (along * tangent[i] + across * normal[i]) / f64::from(n));
            total[0] += f[0];
            total[1] += f[1];
            total[2] += place[0] * f[1] - place[1] * f[0];
        }
    }
    // The midpoint rule is off by the square of the pieces.
    assert!(total.iter().all(|x| x.abs() < 1e-6), "{total:?}");
}
