//! Configurations in groups, and models that are reduced by symmetries that are found.

use std::collections::BTreeMap;
use std::path::Path;

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, Model};
use hamel_codegen::symmetry;
use hamel_tests::models;

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../models/unreduced"))
}

fn model(text: &str) -> Model {
    spec::parse("model", text).unwrap_or_else(|e| panic!("{e}"))
}

fn built(model: &Model) -> BuiltScene {
    scene::build(model, &scene::names(model)[0]).unwrap_or_else(|e| panic!("{}: {e}", model.name))
}

/// The text of the shipped model of that name.
fn shipped(name: &str) -> Option<String> {
    let folders = [("specs", models::names()), ("shelf", models::names_on_shelf())];
    let (of, _) = folders.iter().find(|(_, names)| names.iter().any(|n| n == name))?;
    std::fs::read_to_string(folder().join(format!("../{of}/{name}.hamel"))).ok()
}

fn cost(model: &Model) -> u64 {
    let rows = built(model).operation_counts();
    rows.iter().find(|(name, _)| name == "rhs").map(|(_, counts)| counts.cost()).expect("a right-hand side")
}

/// Rates by name, at the defaults of the parameters.
fn rates(model: &Model, values: &[(&str, f64)]) -> BTreeMap<String, f64> {
    let scene = built(model);
    let params: Vec<f64> = model.params.iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let names = scene.state_names();
    let state: Vec<f64> = names
        .iter()
        .map(|name| values.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("no value of {name}")).1)
        .collect();
    let mut dy = vec![0.0; state.len()];
    scene.prepare(&params).unwrap().rhs(0.0, &state, &mut dy);
    names.into_iter().zip(dy).collect()
}

/// A rotation that is none about an axis of the frame.
const R: [[f64; 3]; 3] = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]];

fn named(name: &str, m: [[f64; 3]; 3]) -> Vec<(String, f64)> {
    let entries = (0..9).map(|k| (format!("{name}{}{}", k / 3 + 1, k % 3 + 1), m[k / 3][k % 3]));
    entries.collect()
}

fn apply(m: [[f64; 3]; 3], v: [f64; 3]) -> [f64; 3] {
    m.map(|row| (0..3).map(|k| row[k] * v[k]).sum())
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn close(found: f64, wanted: f64, what: &str) {
    assert!((found - wanted).abs() < 1e-12, "{what}: {found}, not {wanted}");
}

#[test]
fn an_attitude_obeys_the_group_equation_from_both_sides() {
    let body = "param I: diagonal(3) = [1.3, 1.7, 0.6]; param k = 0.7;";
    let left = model(&format!(
        "model left {{ {body} configuration R in SO(3) velocity Omega; lagrangian = dot(Omega, I*Omega)/2 - k*R12*R33; }}"
    ));
    let right = model(&format!(
        "model right {{ {body} configuration R in SO(3) velocity omega; action right; let W = spin(R); \
         lagrangian = dot(W, I*W)/2 - k*R12*R33; }}"
    ));
    let omega = [0.3, -0.7, 1.1];
    let in_space = apply(R, omega);
    let matrix = named("R", R);
    let with = |name: &str, w: [f64; 3]| {
        let mut all: Vec<(String, f64)> = matrix.clone();
        all.extend((0..3).map(|k| (format!("{name}{}", k + 1), w[k])));
        all
    };
    let run = |m: &Model, all: &[(String, f64)]| {
        let borrowed: Vec<(&str, f64)> = all.iter().map(|(n, x)| (n.as_str(), *x)).collect();
        rates(m, &borrowed)
    };
    let of_left = run(&left, &with("Omega", omega));
    let of_right = run(&right, &with("omega", in_space));
    for i in 0..3 {
        // `R' = R hat(Omega)`: a row is turned as `r x Omega`.
        let row = cross(R[i], omega);
        for j in 0..3 {
            let name = format!("R{}{}", i + 1, j + 1);
            close(of_left[&name], row[j], &name);
            close(of_right[&name], row[j], &name);
        }
    }
    // `I W' = I W x W + torque`, with the torque `-dV/dphi` about each axis of the body.
    let inertia = [1.3, 1.7, 0.6];
    let momentum = [0, 1, 2].map(|k| inertia[k] * omega[k]);
    let gyroscopic = cross(momentum, omega);
    let wanted = [0, 1, 2].map(|k| {
        let mut axis = [0.0; 3];
        axis[k] = 1.0;
        let (first, third) = (cross(R[0], axis), cross(R[2], axis));
        let torque = -0.7 * (first[1] * R[2][2] + R[0][1] * third[2]);
        (gyroscopic[k] + torque) / inertia[k]
    });
    for k in 0..3 {
        close(of_left[&format!("Omega{}", k + 1)], wanted[k], "Omega'");
    }
    // `omega = R W`, so that `omega' = R W'`.
    let turned = apply(R, wanted);
    for k in 0..3 {
        close(of_right[&format!("omega{}", k + 1)], turned[k], "omega'");
    }
}

#[test]
fn a_relative_attitude_is_the_quotient_of_two() {
    let parts = "param A: diagonal(3) = [1.3, 1.7, 0.6]; param B: diagonal(3) = [0.3, 0.7, 0.8]; \
                 param s: vector(3) = [0.1, 0.2, 0.3]; param u: vector(3) = [0.3, 0.2, 0.1];";
    let lagrangian = "lagrangian = dot(Omega, A*Omega)/2 + dot(omega, B*omega)/2";
    let two = model(&format!(
        "model two {{ {parts} configuration R in SO(3) velocity Omega; configuration Q in SO(3) velocity omega; \
         {lagrangian} + dot(rate(R*s), rate(Q*u)) - 2*dot(R*s, Q*u); }}"
    ));
    let one = model(&format!(
        "model one {{ {parts} velocity Omega in so(3); configuration Q in SO(3) velocity omega relative Omega; \
         {lagrangian} + dot(cross(Omega, s), Q*cross(omega, u)) - 2*dot(s, Q*u); output w = spin(Q); scene s {{ want rhs, outputs, invariants; }} }}"
    ));
    let velocities = [("Omega", [0.3, -0.7, 1.1]), ("omega", [-0.2, 0.9, 0.4])];
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let mut all: Vec<(String, f64)> = velocities
        .iter()
        .flat_map(|(name, w)| (0..3).map(move |k| (format!("{name}{}", k + 1), w[k])))
        .collect();
    all.extend(named("Q", R));
    let without = all.clone();
    all.extend(named("R", identity));
    let borrow = |all: &[(String, f64)]| all.iter().map(|(n, x)| (n.clone(), *x)).collect::<Vec<_>>();
    let (all, without) = (borrow(&all), borrow(&without));
    let run = |m: &Model, all: &[(String, f64)]| {
        rates(m, &all.iter().map(|(n, x)| (n.as_str(), *x)).collect::<Vec<_>>())
    };
    let (of_two, of_one) = (run(&two, &all), run(&one, &without));
    for name in ["Omega1", "Omega2", "Omega3", "omega1", "omega2", "omega3"] {
        close(of_one[name], of_two[name], name);
    }
    // `Q_rel = R^T Q`, so that at `R = 1` its rate is `Q' - hat(Omega) Q`.
    for j in 0..3 {
        let column = [0, 1, 2].map(|i| R[i][j]);
        let turned = cross(velocities[0].1, column);
        for i in 0..3 {
            let name = format!("Q{}{}", i + 1, j + 1);
            close(of_one[&name], of_two[&name] - turned[i], &name);
        }
    }
    let scene = scene::build(&one, "s").unwrap();
    let invariants = scene.invariant_names().unwrap();
    assert!(invariants.iter().any(|n| n == "Q_dot_Q"), "{invariants:?}");
}

#[test]
fn groups_of_complex_matrices_move_by_their_algebra() {
    let spin = model(
        "model spin { configuration g in SU(2) velocity w; lagrangian = dot(w, w) - g_re11*g_im12; \
         scene s { want rhs, invariants; } }",
    );
    // What a motion keeps tells that the rates are tangent to the group; at the identity they are `hat(w)`, a traceless
    // matrix that is the negative of its conjugate transpose.
    let scene = scene::build(&spin, "s").unwrap();
    let invariants = scene.invariant_names().unwrap();
    assert!(invariants.iter().filter(|name| name.starts_with("g_form")).count() >= 3, "{invariants:?}");
    assert_eq!(spin.configurations[0].names.len(), 8);
    let identity = ["re11", "re22"];
    let entries = ["re11", "re12", "re21", "re22", "im11", "im12", "im21", "im22"];
    let mut values: Vec<(String, f64)> =
        entries.iter().map(|e| (format!("g_{e}"), f64::from(u8::from(identity.contains(e))))).collect();
    values.extend([("w1", 0.3), ("w2", -0.7), ("w3", 1.1)].map(|(name, x)| (name.to_owned(), x)));
    let values: Vec<(&str, f64)> = values.iter().map(|(n, x)| (n.as_str(), *x)).collect();
    let found = rates(&spin, &values);
    let rate = |entry: &str| found[&format!("g_{entry}")];
    close(rate("re11"), 0.0, "re11");
    close(rate("re22"), 0.0, "re22");
    close(rate("im11") + rate("im22"), 0.0, "trace");
    close(rate("re12") + rate("re21"), 0.0, "real part");
    close(rate("im12") - rate("im21"), 0.0, "imaginary part");
    // `det hat(w) = |w|^2/4` or `|w|^2`, by the size of the basis; each component has the same.
    let det = rate("im11").powi(2) + rate("re12").powi(2) + rate("im12").powi(2);
    let square = 0.3_f64.powi(2) + 0.7_f64.powi(2) + 1.1_f64.powi(2);
    assert!((det - square).abs() < 1e-12 || (det - square / 4.0).abs() < 1e-12, "{det} beside {square}");
    assert_eq!(spin.initial.len(), 8);
}

#[test]
fn a_pose_is_an_attitude_and_a_place() {
    let parts = "param I: diagonal(3) = [1.3, 1.7, 0.6]; param s: vector(3) = [0.1, 0.6, 0.8]; let p = r + R*s; \
                 lagrangian = dot(Omega, I*Omega)/2 + dot(rate(p), rate(p)) - dot(p, p)/2 - r1^3";
    let pose = model(&format!("model pose {{ configuration R, r in SE(3) velocity Omega, V; {parts}; }}"));
    let place = model(&format!(
        "model place {{ configuration R in SO(3) velocity Omega; coordinate r: vector(3) in real; {parts}; }}"
    ));
    let (omega, v, r) = ([0.3, -0.7, 1.1], [0.5, 0.2, -0.9], [0.4, -0.6, 0.7]);
    let rate = apply(R, v);
    let vector = |name: &str, dot: &str, v: [f64; 3]| {
        (0..3).map(|k| (format!("{name}{}{dot}", k + 1), v[k])).collect::<Vec<_>>()
    };
    let shared = [named("R", R), vector("Omega", "", omega), vector("r", "", r)].concat();
    let run = |m: &Model, all: &[(String, f64)]| {
        rates(m, &all.iter().map(|(n, x)| (n.as_str(), *x)).collect::<Vec<_>>())
    };
    let of_pose = run(&pose, &[shared.clone(), vector("V", "", v)].concat());
    let of_place = run(&place, &[shared, vector("r", "_dot", rate)].concat());
    // `r' = R V`, so that `r'' = R (V' + Omega x V)`.
    let turned = cross(omega, v);
    let inner = [0, 1, 2].map(|k| of_pose[&format!("V{}", k + 1)] + turned[k]);
    let wanted = apply(R, inner);
    for k in 0..3 {
        close(of_pose[&format!("r{}", k + 1)], rate[k], "r'");
        close(of_place[&format!("r{}_dot", k + 1)], wanted[k], "r''");
        let name = format!("Omega{}", k + 1);
        close(of_pose[&name], of_place[&name], &name);
    }
}

/// The twin of each model in `models/unreduced` is reduced to this: the algebra, the dimension of the advected
/// parameter, and whether the shipped model of that name is met: at most 1.05 times its operations.
const TWINS: [(&str, &str, usize, bool); 33] = [
    // 6 operations beside 2: the expert keeps other velocities in the state.
    ("ball_on_rotating_table", "so(3)", 0, false),
    // The expert has velocities of each axle in its own frame; so for the snake.
    ("car_with_trailers", "se(2)", 0, false),
    ("chaplygin_ball", "se(3)", 3, true),
    ("chaplygin_gyro", "se(3)", 3, true),
    ("chaplygin_sleigh", "se(2)", 0, true),
    ("double_spherical_pendulum", "R^1", 0, true),
    ("ellipsoid_on_plane", "product(so(3), R^2)", 3, true),
    ("euler_disk", "product(se(2), R^1)", 0, true),
    ("extended_pose", "g", 0, true),
    ("free_body_in_angles", "so(3)", 0, false),
    ("free_rigid_body", "so(3)", 0, true),
    ("heavy_body", "se(3)", 4, false),
    ("heavy_top", "so(3)", 3, true),
    ("heavy_top_in_angles", "so(3)", 3, false),
    ("kirchhoff_body", "se(3)", 0, true),
    ("lagrange_top", "so(3)", 3, false),
    ("linked_bodies", "so(3)", 0, false),
    ("mobile_robot", "product(se(2), R^2)", 0, true),
    ("particle_in_body", "so(3)", 0, false),
    ("particle_in_field", "R^3", 0, false),
    ("roller_racer", "se(2)", 0, true),
    ("rolling_ball", "product(so(3), R^2)", 0, true),
    ("rolling_disk", "product(se(2), R^1)", 0, true),
    ("satellite_with_wheels", "product(so(3), R^3)", 3, true),
    // 11 operations beside 10.
    ("skate_on_incline", "se(2)", 3, false),
    ("snake", "se(2)", 0, false),
    ("snakeboard", "product(se(2), R^1)", 0, true),
    ("suslov", "so(3)", 0, true),
    ("tethered_body", "so(3)", 0, true),
    // 149 operations beside 143.
    ("two_arm_satellite", "so(3)", 0, true),
    ("underwater_vehicle", "se(3)", 3, true),
    ("unequal_ball", "product(so(3), R^2)", 6, false),
    ("veselova", "so(3)", 3, true),
];

/// The row of a twin in the table of the book; it is held to the expected one.
fn row(&(name, algebra, advected, is_met): &(&str, &str, usize, bool)) -> String {
    let text = std::fs::read_to_string(folder().join(format!("{name}.hamel"))).unwrap();
    let unreduced = model(&text);
    let reduced = symmetry::reduce(&unreduced).unwrap_or_else(|e| panic!("{name}: {e}"));
    let Some(map) = &reduced.map else { panic!("{name}: {:?}", reduced.report) };
    let proved = &map.proved;
    assert!(proved.n_conditions > 0 && proved.velocities.0 == proved.velocities.1, "{name}: {proved:?}");
    let reduced = model(&reduced.text);
    let n_kept: usize = reduced.configurations.iter().map(|c| c.names.len()).sum();
    let n_advected: usize = reduced.advected.iter().map(|a| a.components.len()).sum::<usize>() - n_kept;
    assert_eq!(n_advected, advected, "{name}");
    if reduced.configurations.is_empty() {
        assert_eq!(reduced.algebra.name(), algebra, "{name}");
    }
    let costs = [&unreduced, &reduced].map(cost);
    let expert = shipped(name).map(|text| cost(&model(&text)));
    if let Some(expert) = expert {
        let limit = expert as f64 * 1.05;
        assert_eq!(costs[1] as f64 <= limit, is_met, "{name}: {} beside {expert}", costs[1]);
    }
    let advected = if advected == 0 { "-".to_owned() } else { format!("R^{advected}") };
    let expert = expert.map_or("-".to_owned(), |cost| cost.to_string());
    format!("| {name} | {algebra} | {advected} | {} | {} | {expert} |\n", costs[0], costs[1])
}

#[test]
fn unreduced_twins_are_reduced_to_what_an_expert_writes() {
    let mut files: Vec<String> = std::fs::read_dir(folder())
        .unwrap()
        .map(|f| f.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    files.sort();
    assert_eq!(files, TWINS.map(|(name, ..)| name));
    let n_workers = std::thread::available_parallelism().map_or(1, usize::from);
    let table = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..n_workers)
            .map(|w| {
                scope.spawn(move || {
                    let own = TWINS.iter().enumerate().skip(w).step_by(n_workers);
                    own.map(|(k, twin)| (k, row(twin))).collect::<Vec<_>>()
                })
            })
            .collect();
        let mut rows: Vec<_> = workers.into_iter().flat_map(|w| w.join().unwrap()).collect();
        rows.sort();
        rows.into_iter().map(|(_, row)| row).collect::<String>()
    });
    let page = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/book/symmetry.md"));
    let text = std::fs::read_to_string(page).unwrap();
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        let (before, rest) = text.split_once("|---|---|--:|--:|--:|--:|\n").unwrap();
        let after = rest.split_once("\n\n").unwrap().1;
        std::fs::write(page, format!("{before}|---|---|--:|--:|--:|--:|\n{table}\n{after}")).unwrap();
        return;
    }
    assert!(text.contains(&table), "the table of the book is another one:\n{table}");
}
