//! Loops with bodies that move freely: what a joint of a tree holds in one description, an equation holds in another,
//! and both move alike.
//!
//! Deliberately does not know: how an equation between two ways is written.

use std::collections::BTreeMap;

use hamel_codegen::import::{Options, import};
use hamel_codegen::scene;
use hamel_codegen::spec;
use hamel_expr::rational_to_f64;

type V3 = [f64; 3];
type M3 = [V3; 3];
type Values = BTreeMap<String, f64>;

fn times(a: M3, x: V3) -> V3 {
    a.map(|row| row.iter().zip(x).map(|(a, x)| a * x).sum())
}

fn transposed(a: M3) -> M3 {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| a[j][i]))
}

fn product(a: M3, b: M3) -> M3 {
    let columns = transposed(b).map(|column| times(a, column));
    transposed(columns)
}

fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn plus(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn about(axis: usize, angle: f64) -> M3 {
    let (s, c) = angle.sin_cos();
    let mut turn = [[0.0; 3]; 3];
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    turn[axis][axis] = 1.0;
    (turn[i][i], turn[i][j], turn[j][i], turn[j][j]) = (c, -s, s, c);
    turn
}

#[derive(Default)]
struct State(Values);

impl State {
    fn number(mut self, name: &str, value: f64) -> State {
        self.0.insert(name.to_owned(), value);
        self
    }

    fn vector(self, name: &str, value: V3) -> State {
        (0..3).fold(self, |state, k| state.number(&format!("{name}{}", k + 1), value[k]))
    }

    fn matrix(self, name: &str, value: M3) -> State {
        (0..3).fold(self, |state, i| state.vector(&format!("{name}{}", i + 1), value[i]))
    }
}

/// Rates of an imported model, and the equations that it leaves out.
fn rates(robot: &str, state: State) -> (Values, usize) {
    let text = import("robot.xml", robot, &Options::default()).unwrap_or_else(|e| panic!("{e}")).text;
    let body = text.trim_end().strip_suffix('}').expect("a model");
    let text = format!("{body} scene bare {{ want rhs; }} }}\n");
    let model = spec::parse("robot.hamel", &text).unwrap_or_else(|e| panic!("{e}\n{text}"));
    let built = scene::build(&model, "bare").unwrap_or_else(|e| panic!("{e}\n{text}"));
    let params: Vec<f64> = built.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let prepared = built.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let names = built.state_names();
    let value = |name: &String| *state.0.get(name).unwrap_or_else(|| panic!("no {name} in {names:?}"));
    let y: Vec<f64> = names.iter().map(value).collect();
    let mut dy = vec![0.0; y.len()];
    prepared.rhs(0.0, &y, &mut dy);
    (names.iter().cloned().zip(dy).collect(), model.implied.len())
}

fn vector(rates: &Values, name: &str) -> V3 {
    [1, 2, 3].map(|k| rates[&format!("{name}{k}")])
}

fn close(what: &str, found: &[f64], expected: &[f64]) {
    let scale = expected.iter().fold(1.0_f64, |max, x| max.max(x.abs()));
    for (a, b) in found.iter().zip(expected) {
        // Some ten unknowns by elimination on either side.
        assert!((a - b).abs() < 1e-11 * scale, "{what}: {found:?}, expected {expected:?}");
    }
}

/// An arm on a hinge at (0, 0, 0.5), with a body behind it or beside it.
fn arm(behind: &str, beside: &str, equations: &str) -> String {
    format!(
        "<mujoco><worldbody><body name=\"arm\" pos=\"0 0 0.5\"><joint name=\"q\" axis=\"0 1 0\"/>\
         <inertial pos=\"0.2 0.01 0\" mass=\"1.5\" diaginertia=\"0.01 0.03 0.02\"/>{behind}</body>{beside}\
         </worldbody><equality>{equations}</equality></mujoco>"
    )
}

/// A body at (0.4, 0, 0.1) of the arm or at the same place in space, with its joint.
fn bob(place: V3, joint: &str) -> String {
    let [x, y, z] = place;
    format!(
        "<body name=\"bob\" pos=\"{x} {y} {z}\">{joint}<inertial pos=\"0.1 0.05 -0.2\" mass=\"0.8\" \
         fullinertia=\"0.03 0.02 0.04 0.001 0.002 -0.003\"/></body>"
    )
}

const AT: V3 = [0.4, 0.0, 0.1];
const IN_SPACE: V3 = [0.4, 0.0, 0.6];
const FREE: &str = "<freejoint/>";

/// The arm turned by 0.4, and the bob at its end, turned by `turn` and turning by `spin` in its own frame.
fn state_of_free(turn: M3, spin: V3) -> State {
    let (q, q_dot) = (0.4, 0.7);
    let arm = about(1, q);
    let attitude = product(arm, turn);
    let end = times(arm, AT);
    let omega = plus(spin, times(transposed(turn), [0.0, q_dot, 0.0]));
    let velocity = times(transposed(attitude), cross([0.0, q_dot, 0.0], end));
    State::default()
        .number("q", q)
        .number("q_dot", q_dot)
        .vector("Omega", omega)
        .vector("V", velocity)
        .matrix("attitude", attitude)
        .vector("position", plus(end, [0.0, 0.0, 0.5]))
}

#[test]
fn a_free_body_on_a_point_of_an_arm_is_on_a_ball_joint() {
    let (turn, spin) = (product(about(0, 0.5), about(2, -0.3)), [0.2, -0.3, 0.6]);
    let tree = arm(&bob(AT, "<joint name=\"socket\" type=\"ball\"/>"), "", "");
    let state = State::default()
        .number("q", 0.4)
        .number("q_dot", 0.7)
        .matrix("socket", turn)
        .vector("socket_rate", spin);
    let (expected, _) = rates(&tree, state);
    let pin = "<connect name=\"pin\" body1=\"arm\" body2=\"bob\" anchor=\"0.4 0 0.1\"/>";
    let (found, n_implied) = rates(&arm("", &bob(IN_SPACE, FREE), pin), state_of_free(turn, spin));
    assert_eq!(n_implied, 0);
    close("the arm", &[found["q_dot"]], &[expected["q_dot"]]);
    // Omega = w + T^T (0, q', 0), whose rate has -w x T^T (0, q', 0).
    let back = transposed(turn);
    let turning = cross(spin, times(back, [0.0, 0.7, 0.0])).map(|x| -x);
    let omega = plus(vector(&expected, "socket_rate"), times(back, [0.0, expected["q_dot"], 0.0]));
    close("the bob", &vector(&found, "Omega"), &plus(omega, turning));
    // Another anchor moves otherwise.
    let wrong = pin.replace("0.4 0 0.1", "0.4 0 0.11");
    let (wrong, _) = rates(&arm("", &bob(IN_SPACE, FREE), &wrong), state_of_free(turn, spin));
    assert!((wrong["q_dot"] - expected["q_dot"]).abs() > 1e-3);
}

#[test]
fn a_free_body_that_is_welded_to_an_arm_is_part_of_it() {
    let one = about(0, 0.0);
    let state = || State::default().number("q", 0.4).number("q_dot", 0.7);
    let (expected, _) = rates(&arm(&bob(AT, ""), "", ""), state());
    let weld = "<weld name=\"glue\" body1=\"arm\" body2=\"bob\"/>";
    let (found, _) = rates(&arm("", &bob(IN_SPACE, FREE), weld), state_of_free(one, [0.0; 3]));
    close("the arm", &[found["q_dot"]], &[expected["q_dot"]]);
}

/// Two points hold an axis, and one of their six equations follows.
#[test]
fn a_free_body_on_two_points_of_an_arm_is_on_a_hinge() {
    let tree = arm(&bob(AT, "<joint name=\"hinge\" axis=\"0 0 1\"/>"), "", "");
    let state = State::default().number("q", 0.4).number("q_dot", 0.7).number("hinge", 0.3);
    let (expected, _) = rates(&tree, state.number("hinge_dot", -0.9));
    let pins = "<connect name=\"low\" body1=\"arm\" body2=\"bob\" anchor=\"0.4 0 0.1\"/>\
        <connect name=\"high\" body1=\"arm\" body2=\"bob\" anchor=\"0.4 0 0.3\"/>";
    let of_free = state_of_free(about(2, 0.3), [0.0, 0.0, -0.9]);
    let (found, n_implied) = rates(&arm("", &bob(IN_SPACE, FREE), pins), of_free);
    assert_eq!(n_implied, 1);
    close("the arm", &[found["q_dot"]], &[expected["q_dot"]]);
}

/// Neither body is held by the world: one carries the other in a tree.
#[test]
fn two_free_bodies_on_one_point_are_a_chain() {
    let carrier = |behind: &str, beside: &str, equations: &str| {
        arm(behind, beside, equations).replace("<joint name=\"q\" axis=\"0 1 0\"/>", FREE)
    };
    let (attitude, place) = (product(about(0, 0.3), about(2, 0.2)), [0.1, -0.2, 0.7]);
    let (omega, velocity) = ([0.4, 0.5, -0.6], [0.3, 0.1, -0.2]);
    let (turn, spin) = (product(about(1, -0.5), about(2, 0.8)), [0.2, -0.3, 0.6]);
    let tree = carrier(&bob(AT, "<joint name=\"socket\" type=\"ball\"/>"), "", "");
    let up = times(transposed(attitude), [0.0, 0.0, 1.0]);
    let state = State::default()
        .vector("Omega", omega)
        .vector("V", velocity)
        .vector("up", up)
        .number("height", place[2])
        .matrix("socket", turn)
        .vector("socket_rate", spin);
    let (expected, _) = rates(&tree, state);
    let pin = "<connect name=\"pin\" body1=\"arm\" body2=\"bob\" anchor=\"0.4 0 0.1\"/>";
    let both = carrier("", &bob(IN_SPACE, FREE), pin);
    let back = transposed(turn);
    let state = State::default()
        .vector("Omega_arm", omega)
        .vector("V_arm", velocity)
        .matrix("attitude_arm", attitude)
        .vector("position_arm", place)
        .vector("Omega_bob", plus(spin, times(back, omega)))
        .vector("V_bob", times(back, plus(velocity, cross(omega, AT))))
        .matrix("attitude_bob", product(attitude, turn))
        .vector("position_bob", plus(place, times(attitude, AT)));
    let (found, _) = rates(&both, state);
    for (own, other) in [("Omega_arm", "Omega"), ("V_arm", "V")] {
        close(own, &vector(&found, own), &vector(&expected, other));
    }
}

/// A platform on three cranks of one length, and a linkage of a plane that leans: equations follow from others for
/// lengths and angles that are equal by their digits alone, which stay numbers.
#[test]
fn lengths_that_have_to_be_equal_stay_numbers() {
    let inertial = "<inertial pos=\"0.1 0 0.2\" mass=\"1\" diaginertia=\"0.01 0.02 0.02\"/>";
    let body = |name: &str, place: &str, behind: &str| {
        format!(
            "<body name=\"{name}\" {place}><joint name=\"q_{name}\" axis=\"0 1 0\"/>{inertial}{behind}</body>"
        )
    };
    let platform = body("platform", "pos=\"0 0 0.5\"", "");
    let cranks = ["0 0 0", "0.3 0 0", "0.7 0 0"].map(|at| format!("pos=\"{at}\""));
    let bodies = body("a", &cranks[0], &platform) + &body("b", &cranks[1], "") + &body("c", &cranks[2], "");
    let pins = "<connect body1=\"platform\" body2=\"b\" anchor=\"0.3 0 0\"/>\
        <connect body1=\"platform\" body2=\"c\" anchor=\"0.7 0 0\"/>";
    let three = format!("<mujoco><worldbody>{bodies}</worldbody><equality>{pins}</equality></mujoco>");
    let lean = "pos=\"0 0 1\" euler=\"20 0 0\"";
    let far = "pos=\"0.9 0 1\" euler=\"20 0 0\"";
    let chain = body("a", lean, &body("platform", "pos=\"0 0 0.5\"", "")) + &body("b", far, "");
    let pin = "<connect body1=\"platform\" body2=\"b\" anchor=\"0.6 0 0.1\"/>";
    let leaning = format!("<mujoco><worldbody>{chain}</worldbody><equality>{pin}</equality></mujoco>");
    for (robot, n_implied) in [(three, 1), (leaning, 1)] {
        let imported = import("robot.xml", &robot, &Options::default()).unwrap_or_else(|e| panic!("{e}"));
        let told = "stay numbers";
        assert!(imported.notes.iter().any(|note| note.message.ends_with(told)), "{}", imported.notes);
        let model = spec::parse("robot.hamel", &imported.text).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(model.implied.len(), n_implied, "{}", imported.text);
        let names: Vec<&str> = model.params.iter().map(|p| p.name.as_str()).collect();
        assert!(names.contains(&"mass_a") && !names.contains(&"dz_platform"), "{names:?}");
        let built = scene::build(&model, "default").unwrap_or_else(|e| panic!("{e}"));
        assert!(built.certificate().open.is_empty(), "{:?}", built.certificate());
    }
}
