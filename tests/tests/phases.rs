//! Geometric and dynamic phases of coordinates that an abelian group moves.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_tests::models::{follow, params, times};

fn tried(items: &str) -> Result<BuiltScene, String> {
    let text = format!("model m {{ {items} scene turned {{ want rhs, reconstruction, phases; }} }}");
    let model = spec::parse("test.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, "turned").map_err(|e| e.to_string())
}

fn built(items: &str) -> BuiltScene {
    tried(items).unwrap_or_else(|e| panic!("{e}\n{items}"))
}

/// The parts of the rate of a coordinate and the rate itself, at a state by names.
fn parts(scene: &BuiltScene, state: &[(&str, f64)], of: &str) -> ([f64; 2], f64) {
    let names = scene.state_names();
    let value = |name: &String| state.iter().find(|(own, _)| own == name).map_or(0.0, |(_, x)| *x);
    let y: Vec<f64> = names.iter().map(value).collect();
    let prepared = scene.prepare(&params(scene, &[])).expect("valid parameters");
    let mut rates = vec![0.0; y.len()];
    prepared.rhs(0.0, &y, &mut rates);
    let outputs = scene.outputs().iter().flat_map(|o| o.components.iter().map(|(name, _)| name.clone()));
    let values: Vec<(String, f64)> = outputs.zip(prepared.outputs(0.0, &y)).collect();
    let find = |part: &str| {
        let name = format!("{of}_{part}");
        values.iter().find(|(own, _)| *own == name).unwrap_or_else(|| panic!("no {name} in {values:?}")).1
    };
    let place = names.iter().position(|name| name == of).expect("a reconstructed coordinate");
    ([find("geometric"), find("dynamic")], rates[place])
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-14 * (1.0 + a.abs())
}

const HINGE: &str =
    "param I = 2 where I > 0; param J = 1 where J > 0; coordinate psi in angle; velocity omega in R;
    lagrangian = I/2*omega^2 + J/2*(omega + psi_dot)^2 + cos(psi); reconstruct theta in SO(2);";

#[test]
fn at_zero_momentum_the_heading_turns_by_the_geometric_phase() {
    let scene = built(&format!("{HINGE} connection mechanical;"));
    let (psi_dot, v) = (0.7, -0.4);
    let state = [("psi", 0.3), ("psi_dot", psi_dot), ("omega", v)];
    let ([geometric, dynamic], rate) = parts(&scene, &state, "theta");
    assert!(close(geometric, -psi_dot / 3.0) && close(dynamic, v) && close(rate, geometric + dynamic));
    let initial = [("psi", 1.0), ("psi_dot", 0.0), ("omega", 0.0), ("theta", 0.0)];
    let mut turned = 0.0_f64;
    follow(&scene, &[], &initial, &times(7.0, 14), |at| {
        turned = turned.max(at.get("theta").abs());
        assert!((at.get("theta") + (at.get("psi") - 1.0) / 3.0).abs() < 1e-11);
    });
    assert!(turned > 0.3);
}

#[test]
fn the_parts_depend_on_the_connection_and_their_sum_does_not() {
    let (psi, psi_dot, omega) = (0.3, 0.7, -0.4);
    for side in ["left", "right"] {
        for (connection, a) in [("mechanical", 1.0 / 3.0), ("omega = 0.3*psi*psi_dot", 0.3 * psi)] {
            let scene = built(&format!("{HINGE} action {side}; connection {connection};"));
            let state = [("psi", psi), ("psi_dot", psi_dot), ("omega", omega + a * psi_dot)];
            let ([geometric, dynamic], rate) = parts(&scene, &state, "theta");
            assert!(close(geometric, -a * psi_dot), "{connection}: {geometric}");
            assert!(close(dynamic, omega + a * psi_dot) && close(rate, omega), "{connection}");
        }
    }
}

#[test]
fn a_constraint_that_is_horizontal_leaves_no_dynamic_phase() {
    let rolling = "param c = 0.6; coordinate a, b in angle; velocity w in R^2;
        lagrangian = a_dot^2 + b_dot^2 + dot(w, w) + a_dot*w1/2;
        constraint w1 = c*cos(a)*b_dot; constraint w2 = a_dot - b*b_dot; connection nonholonomic;
        reconstruct x in R^2;";
    let scene = built(rolling);
    let state = [("a", 0.4), ("b", 1.5), ("a_dot", 0.9), ("b_dot", -0.8)];
    let expected = [0.6 * 0.4_f64.cos() * -0.8, 0.9 + 1.5 * 0.8];
    for (name, expected) in ["x1", "x2"].into_iter().zip(expected) {
        let ([geometric, dynamic], rate) = parts(&scene, &state, name);
        assert!(dynamic == 0.0 && close(geometric, expected) && close(rate, expected), "{name}: {geometric}");
    }
}

#[test]
fn a_cyclic_coordinate_with_a_fixed_momentum_has_phases_of_the_mechanical_connection() {
    let bead = "param p = 0.8; param q = 0.3; coordinate r in (0, 10); coordinate phi, chi in angle;
        lagrangian = (r_dot^2 + r^2*phi_dot^2 + chi_dot^2 + phi_dot*chi_dot)/2 + r*r_dot*phi_dot/4 + phi_dot/5 - r;
        routh phi = p, chi = q;";
    let scene = built(bead);
    let (r, r_dot) = (1.7, 0.6);
    // L_vv = [[r^2, 1/2], [1/2, 1]], L_vx = [r/4, 0], without velocities p - L_v = [p - 1/5, q].
    let (k, l, m) = (r * r, 0.5, 1.0);
    let solved = |a: f64, b: f64| {
        let det = k * m - l * l;
        [(m * a - l * b) / det, (k * b - l * a) / det]
    };
    let (still, moving) = (solved(0.8 - 0.2, 0.3), solved(-r / 4.0 * r_dot, 0.0));
    for (at, name) in ["phi", "chi"].into_iter().enumerate() {
        let ([geometric, dynamic], rate) = parts(&scene, &[("r", r), ("r_dot", r_dot)], name);
        assert!(close(geometric, moving[at]) && close(dynamic, still[at]), "{name}: {geometric}, {dynamic}");
        assert!(close(rate, still[at] + moving[at]) && geometric.abs() > 0.01);
    }
}

#[test]
fn without_a_connection_there_are_no_phases() {
    let reason = "there are no phases: no coordinate of an abelian group is moved through a connection";
    let framed = HINGE.replace("reconstruct", "frame { a = omega + psi_dot; b = psi_dot; } reconstruct");
    let turning = "coordinate s in real; velocity w in so(3); lagrangian = s_dot^2 + dot(w, w);
        connection w1 = s_dot; reconstruct q in SO(3);";
    for items in [HINGE.to_owned(), framed, turning.to_owned()] {
        let problem = tried(&items).expect_err("no connection");
        assert!(problem.contains(reason), "{problem}");
    }
}
