//! Named frames: poses, twists, Jacobians and drifts against differences of each other, wrong frames, planted faults;
//! and forces at rest.

use hamel_codegen::scene::{self, BuiltScene, Made, build_tampered};
use hamel_codegen::spec::{self, Model, Want};
use hamel_expr::rational_to_f64;
use hamel_program::program::{Operand, Role};

/// An arm with skew axes: two frames by places in space, of which one is a frame on another as well.
const ARM: &str = "model arm {
    param l1 = 0.7 where l1 > 0;
    param l2 = 0.5 where l2 > 0;
    param m1 = 2 where m1 > 0;
    param m2 = 1 where m2 > 0;
    coordinate q1, q2, q3 in angle;
    let R1 = rot(e3, q1);
    let R2 = R1*rot(e1, q2);
    let R3 = R2*rot([0, 3/5, 4/5], q3);
    let p2 = R1*[l1, 0, 0.1];
    let p3 = p2 + R2*[0, l2, 0.2];
    body A { mass m1; place p2; inertia diag([0.1, 0.2, 0.3]); attitude R2; }
    body B { mass m2; place p3; inertia diag([0.1, 0.2, 0.25]); attitude R3; }
    lagrangian = A_energy + B_energy - 9.81*(m1*p2[3] + m2*p3[3]);
    force q1_dot = -0.1*q1_dot;
    frame elbow at p2 attitude R2;
    /// the end of the arm
    frame tip on elbow at [0, l2, 0.2] attitude rot([0, 3/5, 4/5], q3);
    frame whole at p3 attitude R3;
    frame still at [0, 0, 1];
    scene frames { want rhs, frames, bias, gravity, inverse_dynamics; }
}";

/// A body that moves freely, with a hand that depends on time.
const FLOATER: &str = "model floater {
    param m = 2 where m > 0;
    velocity Omega, V in se(3);
    coordinate x in real;
    coordinate phi in angle;
    lagrangian = dot(Omega, Omega)/2 + m/2*dot(V, V) + (x_dot + V[1])^2/2 + phi_dot^2/2 + phi_dot*Omega[3]
        - x^2/5 + cos(phi)*x_dot*phi_dot/8;
    reconstruct q, r in SE(3);
    frame base at r attitude q;
    frame hand on base at [x, 0.3*sin(t), 0.1*x^2] attitude rot(e3, phi)*rot(e1, 0.2*x);
    scene frames { want rhs, frames, reconstruction; }
    scene twists { want rhs, frame_twists, frame_jacobians, frame_drifts, bias; }
}";

/// The same in the plane.
const WHEELER: &str = "model wheeler {
    velocity omega, v1, v2 in se(2);
    coordinate s in angle;
    lagrangian = (omega^2 + v1^2 + 2*v2^2)/2 + (s_dot + omega)^2/4;
    reconstruct theta, x, y in SE(2);
    frame cart at [x, y] attitude theta;
    frame wheel on cart at [0.2, 0.1] attitude s;
    scene frames { want rhs, frames, reconstruction; }
}";

fn parsed(text: &str) -> Model {
    spec::parse("frames.hamel", text).unwrap_or_else(|problems| panic!("{problems}"))
}

fn built(text: &str, name: &str) -> BuiltScene {
    scene::build(&parsed(text), name).unwrap_or_else(|problems| panic!("{problems}"))
}

pub(crate) fn params(scene: &BuiltScene) -> Vec<f64> {
    scene.params().iter().map(|p| rational_to_f64(&p.default)).collect()
}

/// A state without order, with quaternions of length one.
pub(crate) fn state(scene: &BuiltScene) -> Vec<f64> {
    let mut y: Vec<f64> = (0..scene.state().len()).map(|k| (1.7 * k as f64 + 0.4).sin()).collect();
    if let Some(k) = scene.state_names().iter().position(|name| name == "qw") {
        let length = y[k..k + 4].iter().map(|x| x * x).sum::<f64>().sqrt();
        y[k..k + 4].iter_mut().for_each(|x| *x /= length);
    }
    y
}

/// The values of an output by name.
pub(crate) fn values(scene: &BuiltScene, group: &str, t: f64, y: &[f64]) -> Vec<f64> {
    let executable = scene.executable();
    let role = Role::Output(group.to_owned());
    let k = executable.program.function_idx(&role).unwrap_or_else(|| panic!("no {group}"));
    let prepared = executable.program.prepare(&params(scene)).expect("default parameters");
    let mut out = vec![0.0; executable.program.functions[k].results.len()];
    executable.program.run(k, &params(scene), &prepared, t, y, &mut out);
    out
}

/// `R^T p'` and `w` of a pose that moves, by differences along the rates.
fn twist_by_differences(scene: &BuiltScene, frame: usize) -> [f64; 6] {
    let (t, y, h) = (0.3, state(scene), 1e-6);
    let prepared = scene.prepare(&params(scene)).expect("default parameters");
    let mut dy = vec![0.0; y.len()];
    prepared.rhs(t, &y, &mut dy);
    let at = |s: f64| {
        let moved: Vec<f64> = y.iter().zip(&dy).map(|(y, dy)| y + s * dy).collect();
        values(scene, "frame_poses", t + s, &moved)[12 * frame..12 * frame + 12].to_vec()
    };
    let (pose, after, before) = (at(0.0), at(h), at(-h));
    let rate: Vec<f64> = after.iter().zip(&before).map(|(a, b)| (a - b) / (2.0 * h)).collect();
    let turned =
        |i: usize, j: usize| -> f64 { (0..3).map(|k| pose[3 + 3 * k + i] * rate[3 + 3 * k + j]).sum() };
    let moved = |i: usize| -> f64 { (0..3).map(|k| pose[3 + 3 * k + i] * rate[k]).sum() };
    [turned(2, 1), turned(0, 2), turned(1, 0), moved(0), moved(1), moved(2)]
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(found.len(), expected.len());
    for (k, (found, expected)) in found.iter().zip(expected).enumerate() {
        assert!((found - expected).abs() < tolerance, "component {k}: {found}, expected {expected}");
    }
}

#[test]
fn twists_are_rates_of_poses() {
    for (text, n_frames) in [(ARM, 4), (FLOATER, 2), (WHEELER, 2)] {
        let scene = built(text, "frames");
        assert!(scene.certificate().open.is_empty(), "{:?}", scene.certificate());
        let twists = values(&scene, "frame_twists", 0.3, &state(&scene));
        assert_eq!(twists.len(), 6 * n_frames);
        for frame in 0..n_frames {
            close(&twists[6 * frame..6 * frame + 6], &twist_by_differences(&scene, frame), 1e-8);
        }
    }
}

/// `V = J u` where nothing depends on time, and `V' = J u' + drift`.
#[test]
fn jacobians_and_drifts_are_derivatives_of_twists() {
    let scene = built(ARM, "frames");
    let y = state(&scene);
    let prepared = scene.prepare(&params(&scene)).expect("default parameters");
    let executable = scene.executable();
    let interpreter = executable.prepare(&params(&scene)).expect("default parameters");
    let jacobian = interpreter.matrix_of(Want::FrameJacobians, 0.0, &y).expect("wanted");
    assert_eq!((jacobian.len(), jacobian[0].len()), (24, 3));
    let times = |u: &[f64]| -> Vec<f64> {
        jacobian.iter().map(|row| row.iter().zip(u).map(|(j, u)| j * u).sum()).collect()
    };
    let twists = values(&scene, "frame_twists", 0.0, &y);
    close(&times(&y[3..]), &twists, 1e-14);
    close(&twists[6..12], &twists[12..18], 1e-14);
    assert_eq!(&twists[18..], [0.0; 6]);

    let mut dy = vec![0.0; 6];
    prepared.rhs(0.0, &y, &mut dy);
    let h = 1e-6;
    let at = |s: f64| {
        let moved: Vec<f64> = y.iter().zip(&dy).map(|(y, dy)| y + s * dy).collect();
        values(&scene, "frame_twists", 0.0, &moved)
    };
    let rates: Vec<f64> = at(h).iter().zip(&at(-h)).map(|(a, b)| (a - b) / (2.0 * h)).collect();
    let drift = values(&scene, "frame_drifts", 0.0, &y);
    let sum: Vec<f64> = times(&dy[3..]).iter().zip(&drift).map(|(a, b)| a + b).collect();
    close(&sum, &rates, 1e-8);
}

/// Twists, Jacobians and drifts ask for no coordinate of the group, poses do.
#[test]
fn twists_of_a_free_body_do_not_need_its_place() {
    let with = built(FLOATER, "frames");
    let without = built(FLOATER, "twists");
    assert_eq!(without.state().len() + 7, with.state().len());
    let y = state(&with);
    let own: Vec<f64> = without
        .state_names()
        .iter()
        .map(|name| y[with.state_names().iter().position(|n| n == name).expect("there")])
        .collect();
    for group in ["frame_twists", "frame_jacobians", "frame_drifts"] {
        close(&values(&without, group, 0.3, &own), &values(&with, group, 0.3, &y), 1e-14);
    }
    let text = FLOATER.replace("frame_twists,", "frame_poses,");
    let problems = scene::build(&parsed(&text), "twists").expect_err("refused").to_string();
    assert!(problems.contains("add `want reconstruction;`"), "{problems}");
}

#[test]
fn forces_at_rest_are_those_of_zero_accelerations() {
    let scene = built(ARM, "frames");
    let prepared = scene.prepare(&params(&scene)).expect("default parameters");
    let mut y = state(&scene);
    let bias = values(&scene, "bias", 0.0, &y);
    close(&bias, &prepared.inverse_dynamics(0.0, &y, &[0.0; 3]).expect("wanted"), 1e-14);
    let gravity = values(&scene, "gravity", 0.0, &y);
    y[3..].fill(0.0);
    close(&gravity, &prepared.inverse_dynamics(0.0, &y, &[0.0; 3]).expect("wanted"), 1e-14);
    assert!(gravity.iter().zip(&bias).any(|(a, b)| (a - b).abs() > 0.01));
    // Of the weights alone: no velocity is read.
    let function = scene.program().function(&Role::Output("gravity".into())).expect("wanted");
    let reads = |operand: Operand| matches!(operand, Operand::State(k) if k >= 3);
    let operands = function.instructions.iter().flat_map(|i| i.op.operands());
    assert!(!operands.into_iter().any(reads));
}

#[test]
fn faults_in_frames_are_found() {
    let model = parsed(ARM);
    for group in ["frame_poses", "frame_twists", "frame_jacobians", "frame_drifts", "bias", "gravity"] {
        let role = Role::Output(group.into());
        let exchanged = |made: Made<'_>| {
            let Made::Program(program) = made else { return };
            let function = program.functions.iter_mut().find(|f| f.role == role).expect("wanted");
            let n = function.results.len().min(12);
            let a = (0..n).find(|k| function.results[*k].1 != function.results[n - 1].1).expect("others");
            let (one, other) = (function.results[a].1, function.results[n - 1].1);
            (function.results[a].1, function.results[n - 1].1) = (other, one);
        };
        let problems = build_tampered(&model, "frames", &exchanged).expect_err(group).to_string();
        assert!(problems.contains(group), "{problems}");
    }
    // A twist that the model itself has wrong is no derivative of its pose.
    let mut wrong = parsed(ARM);
    let twists = wrong.outputs.iter_mut().find(|o| o.name == "frame_twists").expect("frames");
    let other = twists.components[1].1;
    twists.components[0].1 = other;
    let problems = scene::build(&wrong, "frames").expect_err("refused").to_string();
    assert!(problems.contains("frame_twists") && problems.contains("by the rate of the pose"), "{problems}");
    assert!(build_tampered(&model, "frames", &|_| {}).is_ok());
}

#[test]
fn wrong_frames_are_told_with_the_fix() {
    let told = |items: &str| {
        let text = format!(
            "model m {{ coordinate x in real; velocity Omega, V in se(3); lagrangian = x_dot^2 + dot(Omega, Omega) + \
             dot(V, V); reconstruct q, r in SE(3); {items} }}"
        );
        spec::parse("m.hamel", &text).expect_err(items).to_string()
    };
    for (items, expected) in [
        ("frame a on b at [x, 0, 0];", "frame `a` is on `b`, which is no frame before it"),
        ("frame a at x;", "`at` must be a place, vector(3) or vector(2)"),
        ("frame a at [x, 0] at [0, 0];", "`at` is written twice"),
        ("frame a at [x, 0, 0] attitude [[2, 0, 0], [0, 1, 0], [0, 0, 1]];", "the matrix is no rotation"),
        ("frame a at [x, 0, 0]; frame a;", "frame `a` is declared twice"),
        ("frame b; frame a on b at r attitude q;", "frame `a` is that of the group, on another frame"),
        ("frame a at [x, 0, 0] + r;", "r1"),
        (
            "let a_w1 = 2; frame a at [x*a_w1, 0, 0];",
            "frame `a` has a component `a_w1`, which is a definition",
        ),
        ("output a_v2 = x; frame a at [x, 0, 0];", "frame `a` has a component `a_v2`, which is an output"),
        ("frame a at [x_dot, 0, 0];", "x_dot"),
        ("output frames = x;", "`frames` cannot be used as a name"),
        ("frame a at [x, 0] to q;", "expected `on`, `at`, `attitude` or `;`"),
    ] {
        let problems = told(items);
        assert!(problems.contains(expected), "{items}: {problems}");
    }
    let right = FLOATER.replace("reconstruct q, r", "action right;\n    reconstruct q, r");
    let problems = spec::parse("m.hamel", &right).expect_err("refused").to_string();
    assert!(problems.contains("that of a group that acts on the right"), "{problems}");
    let none =
        "model m { coordinate x in real; lagrangian = x_dot^2; scene s { want rhs, frame_jacobians; } }";
    let problems = scene::build(&parsed(none), "s").expect_err("refused").to_string();
    assert!(problems.contains("declare one, such as `frame tool at p attitude R;`"), "{problems}");
    let momenta = WHEELER.replace("scene frames {", "momentum p of s_dot;\n    scene frames { carry p;");
    let problems = scene::build(&parsed(&momenta), "frames").expect_err("refused").to_string();
    assert!(problems.contains("velocities of the model as state; remove `carry`"), "{problems}");
}
