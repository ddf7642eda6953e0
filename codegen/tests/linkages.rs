//! Linkages of bodies: what their right-hand sides cost, and that they are those of the equations multiplied out.
//!
//! `LINKAGES="snake:10 arm:6:expanded" cargo test -p hamel-codegen --test main linkages::measured -- --nocapture`
//! prints what others take; with `TABLE=1`, by section.

#[path = "linkages/articulated.rs"]
mod articulated;

use std::time::Instant;

use crate::families::{
    self, IIWA, planar_arm, planar_pendulum, spatial_arm, spherical_pendulum, wheeled_snake,
};
use articulated::{Input, Number, Origin};
use hamel_codegen::explain::explain;
use hamel_codegen::scene::{self, BuiltScene, Derivative, Made, build_tampered};
use hamel_codegen::spec::{self, Model};
use hamel_expr::{Budget, Style, rational_to_f64};
use hamel_mechanics::mechanics::{derive, is_recursive, same_motion};
use hamel_mechanics::reduction::{Formulation, reduce};
use hamel_program::program::Role;

fn parsed(text: &str) -> Model {
    spec::parse("linkage.hamel", text).unwrap_or_else(|problems| panic!("{problems}"))
}

/// The right-hand side by recursion, multiplied out, or as it costs less.
fn built(model: &Model, recursive: Option<bool>) -> BuiltScene {
    let formulation = Formulation { recursive, ..Formulation::of(model) };
    scene::build_in(model, "bare", &formulation).unwrap_or_else(|problems| panic!("{problems}"))
}

/// Operations of the right-hand side and its cost.
fn counted(scene: &BuiltScene) -> (usize, u64) {
    let counts = scene.program().function(&Role::Rate).expect("rates").counts();
    (counts.total(), counts.cost())
}

/// Numbers between minus and plus one that no equation knows.
fn numbers(n: usize, seed: u32) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1_u32 << 23) - 1.0
    };
    (0..n).map(|_| next()).collect()
}

fn rates(scene: &BuiltScene, state: &[f64]) -> Vec<f64> {
    rates_with(scene, state, |_| None)
}

/// With some parameters other than by default.
fn rates_with(scene: &BuiltScene, state: &[f64], value: impl Fn(&str) -> Option<f64>) -> Vec<f64> {
    let params = scene.params().iter().map(|p| value(&p.name).unwrap_or(rational_to_f64(&p.default)));
    let params: Vec<f64> = params.collect();
    let interpreter = scene.prepare(&params).expect("defaults keep the conditions");
    let mut rates = vec![0.0; state.len()];
    interpreter.rhs(0.0, state, &mut rates);
    rates
}

/// Both forms lose a few digits in the mass matrix's factors, of condition numbers below 1e4 here.
const TOLERANCE: f64 = 1e-10;

#[test]
fn by_recursion_bodies_move_as_multiplied_out() {
    for text in [wheeled_snake(3), planar_arm(3), planar_pendulum(3), spherical_pendulum(2), spatial_arm(3)] {
        let model = parsed(&text);
        let [recursive, expanded] = [true, false].map(|recursive| built(&model, Some(recursive)));
        assert_eq!(recursive.state_names(), expanded.state_names());
        for seed in 1..=5 {
            let state = numbers(recursive.state().len(), seed);
            let (a, b) = (rates(&recursive, &state), rates(&expanded, &state));
            let size = b.iter().fold(0.0_f64, |size, rate| size.max(rate.abs()));
            assert!(size > 0.1, "{}: nothing moves", model.name);
            for (a, b) in a.iter().zip(&b) {
                assert!((a - b).abs() <= TOLERANCE * size, "{}: {a} and {b}", model.name);
            }
        }
    }
}

/// The arm in space with products of inertia of its bodies.
fn skew_arm(n: usize) -> String {
    let mut text = spatial_arm(n);
    let mut products = String::new();
    for k in 1..=n {
        text = text.replacen("{\n", &format!("{{\n    param P{k} = 0.004;\n    param R{k} = -0.003;\n"), 1);
        products += &format!(" + P{k}*w{k}x*w{k}y + R{k}*w{k}y*w{k}z");
    }
    text.replacen("    lagrangian = ", &format!("    lagrangian = 0{products} + "), 1)
}

/// Their part of the forces is Euler's equation as well; two products a body take up to twenty operations.
#[test]
fn products_of_inertia_are_part_of_a_spin() {
    let model = parsed(&skew_arm(3));
    let [recursive, expanded] = [true, false].map(|recursive| built(&model, Some(recursive)));
    let without = built(&parsed(&spatial_arm(3)), Some(true));
    for seed in 1..=5 {
        let state = numbers(recursive.state().len(), seed);
        let (a, b) = (rates(&recursive, &state), rates(&expanded, &state));
        let size = b.iter().fold(0.0_f64, |size, rate| size.max(rate.abs()));
        let moved = a.iter().zip(rates(&without, &state)).any(|(a, b)| (a - b).abs() > 1e-3 * size);
        assert!(moved, "the products do nothing");
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() <= TOLERANCE * size, "{a} and {b}");
        }
    }
    let [(operations, _), (least, _)] = [&recursive, &without].map(counted);
    assert!(operations <= least + 60, "{operations} operations, {least} without products");
}

/// `w . J w` is written as three products of a component and a sum, `wx*(D*wx + P*wy)`: that is the same spin.
#[test]
fn moments_of_inertia_by_a_matrix_are_those_by_their_terms() {
    let with = |of_body: &dyn Fn(usize) -> String| {
        let mut text = spatial_arm(3);
        for k in 1..=3 {
            let params =
                format!("{{\n    param D{k} = 0.02;\n    param P{k} = 0.004;\n    param R{k} = -0.003;\n");
            text = text.replacen("{\n", &params, 1);
        }
        let energies: String = (1..=3).map(of_body).collect();
        built(
            &parsed(&text.replacen("    lagrangian = ", &format!("    lagrangian = 0{energies} + "), 1)),
            Some(true),
        )
    };
    let by_terms = with(&|k| {
        format!(" + D{k}/2*w{k}x^2 + D{k}/2*w{k}y^2 + D{k}/2*w{k}z^2 + P{k}*w{k}x*w{k}y + R{k}*w{k}y*w{k}z")
    });
    let by_matrix = with(&|k| {
        let w = format!("[w{k}x, w{k}y, w{k}z]");
        format!(" + dot({w}, [[D{k}, P{k}, 0], [P{k}, D{k}, R{k}], [0, R{k}, D{k}]]*{w})/2")
    });
    for seed in 1..=5 {
        let state = numbers(by_terms.state().len(), seed);
        let (a, b) = (rates(&by_terms, &state), rates(&by_matrix, &state));
        let size = b.iter().fold(0.0_f64, |size, rate| size.max(rate.abs()));
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() <= TOLERANCE * size, "{a} and {b}");
        }
    }
    let [(by_terms, _), (by_matrix, _)] = [&by_terms, &by_matrix].map(counted);
    assert!(by_matrix.abs_diff(by_terms) * 20 <= by_terms, "{by_matrix} operations, {by_terms} by terms");
}

/// Forty rates, more than the systems have whose squares are looked for where they are multiplied out.
#[test]
fn twenty_pendulums_in_space_are_linked_bodies() {
    let model = parsed(&spherical_pendulum(20));
    assert!(is_recursive(&reduce(&model, &Formulation::of(&model)).expect("reduces")));
}

/// What a long chain takes of the budget, and that it is made of its rates alone. Bounds are by the body; with energy
/// and mass matrix forty pendulums take 9,209 expressions and 403,000 steps of work each, links of a snake of twenty
/// 20,504 and 1,073,000.
#[test]
fn rates_of_long_chains_take_counted_work() {
    for (text, n, expressions, work) in [
        (planar_pendulum(80), 80, 1_300, 180_000),
        (wheeled_snake(20), 20, 2_900, 250_000),
        (planar_arm(20), 20, 2_700, 420_000),
    ] {
        let scene = built(&parsed(&text), None);
        let spent = scene.spent();
        assert!(!scene.equations().is_whole(), "{text}");
        assert!(spent.expressions <= expressions * n, "{} expressions", spent.expressions);
        assert!(spent.work <= work * n, "{} steps of work", spent.work);
    }
}

/// Of pendulums no state violates anything: where expressions are left for nothing more, there is a start all the same.
#[test]
fn a_start_without_residuals_derives_nothing() {
    let mut model = parsed(&planar_pendulum(8));
    let spent = scene::build(&model, "bare").expect("builds").spent();
    let budget = model.graph.budget();
    model.graph.set_budget(Budget { expressions: spent.expressions, ..budget });
    let scene = scene::build(&model, "bare").expect("within its budget");
    assert!(!scene.equations().is_whole());
    let start = scene::start(&model, &scene).expect("nothing is derived").expect("a start");
    assert_eq!(start.state.len(), 16);
}

/// One that wants more gets everything, and moves alike.
#[test]
fn a_scene_that_wants_energy_is_derived_as_a_whole() {
    let model = parsed(
        &planar_pendulum(8).replace("    scene bare", "    scene more { want rhs, energy; }\n    scene bare"),
    );
    let [bare, more] = ["bare", "more"].map(|name| scene::build(&model, name).expect("builds"));
    assert!(!bare.equations().is_whole() && more.equations().is_whole());
    assert_eq!(bare.equations().names_of_velocities(), more.equations().names_of_velocities());
    let page = explain(&model, &bare, Style::Unicode);
    assert!(page.contains("Energy is conserved"), "{page}");
    for seed in 1..=5 {
        let state = numbers(bare.state().len(), seed);
        let (a, b) = (rates(&bare, &state), rates(&more, &state));
        let size = b.iter().fold(0.0_f64, |size, rate| size.max(rate.abs()));
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() <= TOLERANCE * size, "{a} and {b}");
        }
    }
}

/// Angular accelerations of a planar arm from the energy of its bodies by their angles in space:
/// `A_jk = S_jk cos(t_j - t_k)`, solved by elimination.
fn rates_of_arm(n: usize, state: &[f64]) -> Vec<f64> {
    let (angles, rates) = state.split_at(n);
    let sums = |list: &[f64]| -> Vec<f64> {
        list.iter()
            .scan(0.0, |sum, x| {
                *sum += x;
                Some(*sum)
            })
            .collect()
    };
    let (t, w) = (sums(angles), sums(rates));
    let mass = |k: usize| 1.0 + 0.1 * (k + 1) as f64;
    // Along body j, of body k: its own centre, or the end of one before it.
    let arm = |j: usize, k: usize| if j == k { 0.2 } else { 0.5 };
    let moment = |j: usize, k: usize| (j.max(k)..n).map(|i| mass(i) * arm(j, i) * arm(k, i)).sum::<f64>();
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for j in 0..n {
        let entry = |k: usize| moment(j, k) * (t[j] - t[k]).cos() + if j == k { 0.1 } else { 0.0 };
        let weight: f64 = (j..n).map(|i| mass(i) * 9.81 * arm(j, i)).sum();
        let turning: f64 = (0..n).map(|k| moment(j, k) * (t[j] - t[k]).sin() * w[k] * w[k]).sum();
        rows.push((0..n).map(entry).chain([-weight * t[j].cos() - turning]).collect());
    }
    for k in 0..n {
        let pivot = rows[k].clone();
        for row in rows.iter_mut().skip(k + 1) {
            let factor = row[k] / pivot[k];
            row.iter_mut().zip(&pivot).for_each(|(e, p)| *e -= factor * p);
        }
    }
    let mut wdot = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| rows[k][j] * wdot[j]).sum();
        wdot[k] = (rows[k][n] - known) / rows[k][k];
    }
    (0..n).map(|k| if k == 0 { wdot[0] } else { wdot[k] - wdot[k - 1] }).collect()
}

/// Four bodies by the factors of the mass matrix, six as articulated bodies.
#[test]
fn arms_move_as_their_energy_in_space_says() {
    for n in [4, 6] {
        let scene = built(&parsed(&planar_arm(n)), Some(true));
        for seed in 1..=5 {
            let state = numbers(2 * n, seed);
            let (a, b) = (rates(&scene, &state), rates_of_arm(n, &state));
            let size = b.iter().fold(0.0_f64, |size, rate| size.max(rate.abs()));
            assert!(size > 0.1, "nothing moves");
            for (a, b) in a[n..].iter().zip(&b) {
                assert!((a - b).abs() <= TOLERANCE * size, "{n} bodies: {a} and {b}");
            }
        }
    }
}

/// Ten bodies with masses 1 and 1000: the mass matrix has the condition number 4.4e4, by which rounding errors of 1e-16
/// are amplified. Expected are the accelerations from the energy in space (as in [`rates_of_arm`]) in 50 digits, by
/// mpmath.
#[test]
fn bodies_of_very_different_masses_lose_no_digits() {
    let expected = [
        -53.896967437417956,
        149.15304506899307,
        -152.05683929374982,
        56.539143413481845,
        -1.973548859875219,
        8.564431804053457,
        -7.217005408143527,
        -5.156072673210571,
        9.092372906665416,
        -3.6380874788420265,
    ];
    let scene = built(&parsed(&planar_arm(10)), Some(true));
    let mass = |name: &str| {
        let k: usize = name.strip_prefix('m')?.parse().ok()?;
        Some(if k.is_multiple_of(2) { 1000.0 } else { 1.0 })
    };
    let found = rates_with(&scene, &numbers(20, 1), mass);
    for (found, expected) in found[10..].iter().zip(expected) {
        assert!((found - expected).abs() <= 4.4e4 * 1e-16 * 150.0, "{found}, expected {expected}");
    }
}

/// Accelerations of the seven joints by Pinocchio 4.1.0: `pinocchio.aba` without torques, for a model of the joints
/// `JointModelRZ` and the bodies of [`IIWA`].
#[test]
fn an_arm_in_space_moves_as_others_compute_it() {
    let angles = [0.3, -0.5, 0.7, 1.1, -0.2, 0.4, 0.9];
    let speeds = [0.1, -0.3, 0.2, 0.5, -0.7, 0.4, 0.6];
    let expected = [
        -4.941736259959183,
        -8.697724197133272,
        7.823189167089321,
        18.832860777802612,
        -14.132857017222763,
        30.798936675074824,
        3.360544445130384,
    ];
    let (by_hand, noted) = articulated::accelerations(&IIWA, &angles, &speeds);
    // Sine and cosine of an angle are one.
    let most = noted.len() + angles.len() - 1;
    let scene = built(&parsed(&spatial_arm(7)), Some(true));
    // The scene leaves out the angle about the vertical.
    let n_angles = scene.state().len() - speeds.len();
    let state: Vec<f64> = angles[angles.len() - n_angles..].iter().chain(&speeds).copied().collect();
    let found = rates(&scene, &state);
    for ((found, by_hand), expected) in found[n_angles..].iter().zip(&by_hand).zip(expected) {
        for (who, value) in [("by hand", &by_hand.value), ("found", found)] {
            assert!((value - expected).abs() <= 1e-10 * 30.0, "{who}: {value}, expected {expected}");
        }
    }
    let (operations, _) = counted(&scene);
    println!("{operations} operations, {most} as articulated bodies by hand");
    assert!(5 * operations <= 6 * most, "{operations} operations, {most} as articulated bodies by hand");
}

/// What `cargo xtask bench scaling` writes as the algorithm of the arm.
#[test]
fn noted_operations_are_the_algorithm_at_any_state() {
    let (accelerations, noted) = articulated::accelerations(&IIWA, &numbers(7, 1), &numbers(7, 11));
    let (angles, speeds) = (numbers(7, 2), numbers(7, 12));
    let (expected, _) = articulated::accelerations(&IIWA, &angles, &speeds);
    let mut values: Vec<f64> = Vec::new();
    let read = |number: &Number, values: &[f64]| {
        let value = match number.origin {
            Origin::Constant => return number.value,
            Origin::Input(Input::Sine, k) => angles[k].sin(),
            Origin::Input(Input::Cosine, k) => angles[k].cos(),
            Origin::Input(Input::Rate, k) => speeds[k],
            Origin::Operation(k) => values[k],
        };
        if number.is_negated { -value } else { value }
    };
    for operation in &noted {
        let [a, b] = operation.operands.map(|number| read(&number, &values));
        values.push(match operation.op {
            '+' => a + b,
            '*' => a * b,
            _ => a / b,
        });
    }
    for (found, expected) in accelerations.iter().zip(&expected) {
        let found = read(found, &values);
        assert!((found - expected.value).abs() <= 1e-12 * 100.0, "{found}, expected {}", expected.value);
    }
}

#[test]
fn operations_of_an_arm_grow_with_its_bodies() {
    for n in [3, 4, 6] {
        let (operations, _) = counted(&built(&parsed(&planar_arm(n)), Some(true)));
        assert!(operations <= 60 * n + n.pow(3) / 6, "{n} bodies: {operations} operations");
    }
}

/// The accelerations are differentiated by their balance: 2.3 and 5.9 times the rates, for an arm with general offsets
/// 2.1 and 4.9, where 2.5 and 6.6 are those by the way that they were solved for. Loops over nearly empty tables would
/// take 160,000 additions.
#[test]
fn the_jacobian_of_an_arm_costs_less_than_products_with_every_direction() {
    let text = skew_arm(7).replace("want rhs;", "want rhs, jvp, jacobian;");
    let model = parsed(&text);
    let scene = scene::build(&model, "bare").unwrap_or_else(|problems| panic!("{problems}"));
    let function = |role: Role| {
        let function = scene.program().function(&role).unwrap_or_else(|| panic!("no {role}"));
        assert!(function.contractions.is_empty(), "{role} has loops");
        function.counts().cost()
    };
    let rates = function(Role::Rate);
    let product = function(Derivative::Jvp.role());
    let matrix = function(Derivative::Jacobian.role());
    let n = scene.state().len() as u64;
    assert!(matrix < n * product / 5, "{matrix}, {n} products with {product}");
    assert!(5 * product < 12 * rates && matrix < 6 * rates, "rates {rates}, J v {product}, J {matrix}");
}

/// `tau = A a - f` without `A`: two thirds of the rates, and less the more bodies there are.
#[test]
fn inverse_dynamics_of_an_arm_forms_no_mass_matrix() {
    let text = skew_arm(7).replace("want rhs;", "want rhs, mass_matrix, inverse_dynamics;");
    let model = parsed(&text);
    let scene = scene::build(&model, "bare").unwrap_or_else(|problems| panic!("{problems}"));
    let cost = |role: &Role| scene.program().function(role).expect("wanted").counts().cost();
    let role = Role::Product("inverse_dynamics".into());
    let (forces, rates) = (cost(&role), cost(&Role::Rate));
    assert!(3 * forces < 2 * rates, "{forces} of forces, {rates} of rates");

    let params: Vec<f64> = scene.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let interpreter = scene.prepare(&params).expect("default parameters");
    let y = numbers(14, 3);
    let mut dy = vec![0.0; 14];
    interpreter.rhs(0.0, &y, &mut dy);
    let accelerations = &dy[7..];
    let forces = |a: &[f64]| interpreter.inverse_dynamics(0.0, &y, a).expect("wanted");
    let still = forces(&[0.0; 7]);
    let size = still.iter().fold(0.0_f64, |size, tau| size.max(tau.abs()));
    assert!(forces(accelerations).iter().all(|tau| tau.abs() < 1e-13 * size), "rates need no forces");
    let [matrix] = scene.matrices() else { panic!("one matrix") };
    assert_eq!((matrix.name, matrix.shape, matrix.pattern.len()), ("mass_matrix", (7, 7), 49));
    let entries = interpreter.outputs(0.0, &y);
    for k in 0..7 {
        let unit: Vec<f64> = (0..7).map(|i| f64::from(u8::from(i == k))).collect();
        for (i, (tau, still)) in forces(&unit).iter().zip(&still).enumerate() {
            let entry = entries[7 * i + k];
            assert!((tau - still - entry).abs() < 1e-13 * size, "A[{i}][{k}]: {} and {entry}", tau - still);
        }
    }
}

#[test]
fn faults_in_the_dynamics_of_an_arm_are_found() {
    let text = skew_arm(3).replace("want rhs;", "want rhs, mass_matrix, inverse_dynamics;");
    let model = parsed(&text);
    for role in [Role::Product("inverse_dynamics".into()), Role::Output("mass_matrix".into())] {
        let exchanged = |made: Made<'_>| {
            let Made::Program(program) = made else { return };
            let function = program.functions.iter_mut().find(|f| f.role == role).expect("wanted");
            let [a, b] = [function.results[0].1, function.results[1].1];
            (function.results[0].1, function.results[1].1) = (b, a);
        };
        let problems = build_tampered(&model, "bare", &exchanged).expect_err("refused").to_string();
        assert!(problems.contains(role.name()), "{problems}");
    }
    assert!(build_tampered(&model, "bare", &|_| {}).is_ok());
}

#[test]
fn momenta_in_the_state_have_no_inverse_dynamics() {
    let text = "model particle {
        coordinate x in real;
        momentum p of x_dot;
        lagrangian = x_dot^2 - x^4;
        scene hamilton { carry p; want rhs, inverse_dynamics; }
    }";
    let problems = scene::build(&parsed(text), "hamilton").expect_err("refused").to_string();
    assert!(problems.contains("velocities of the model as state; remove `carry`"), "{problems}");
    assert!(problems.contains("5:45"), "at the word: {problems}");
}

#[test]
fn a_fault_in_the_jacobian_of_an_arm_is_found() {
    let text = skew_arm(4).replace("want rhs;", "want rhs, jacobian;");
    let model = parsed(&text);
    let role = Derivative::Jacobian.role();
    // Two entries of the last row, which belong to neighbours.
    let exchanged = |made: Made<'_>| {
        let Made::Program(program) = made else { return };
        let matrix = program.functions.iter_mut().find(|f| f.role == role).expect("a Jacobian");
        let last = matrix.results.len() - 1;
        let [a, b] = [matrix.results[last - 1].1, matrix.results[last].1];
        (matrix.results[last - 1].1, matrix.results[last].1) = (b, a);
    };
    let problems = build_tampered(&model, "bare", &exchanged).expect_err("refused").to_string();
    assert!(problems.contains("jacobian"), "{problems}");
    assert!(build_tampered(&model, "bare", &|_| {}).is_ok());
}

#[test]
fn recursion_is_proved_to_be_the_same_motion() {
    let model = parsed(&wheeled_snake(3));
    let [recursive, expanded] = [true, false].map(|recursive| {
        let formulation = Formulation { recursive: Some(recursive), ..Formulation::of(&model) };
        derive(&reduce(&model, &formulation).expect("reduces")).expect("derives")
    });
    assert_ne!(recursive.sections, expanded.sections, "not derived by recursion");
    same_motion(&recursive, &expanded).expect("the same motion");
}

#[test]
fn operations_are_linear_in_the_links_of_a_snake() {
    for (n, most) in [(3, 84), (5, 205)] {
        let model = parsed(&wheeled_snake(n));
        let (operations, _) = counted(&built(&model, Some(true)));
        assert!(operations <= most, "{n} links: {operations} operations");
    }
}

#[test]
fn whichever_costs_less_is_taken() {
    for (text, most) in [(wheeled_snake(3), 84), (planar_pendulum(4), 140)] {
        let model = parsed(&text);
        let costs = [None, Some(true), Some(false)].map(|recursive| counted(&built(&model, recursive)));
        let [(operations, cost), (_, recursive), (_, expanded)] = costs;
        assert_eq!(cost, recursive.min(expanded), "{}", model.name);
        assert!(operations <= most, "{}: {operations} operations", model.name);
    }
}

#[test]
fn two_bodies_are_no_recursion() {
    let is_recursive = |text: &str| {
        let model = parsed(text);
        is_recursive(&reduce(&model, &Formulation::of(&model)).expect("reduces"))
    };
    assert!(!is_recursive(&planar_pendulum(2)) && !is_recursive(&wheeled_snake(2)));
    assert!(is_recursive(&wheeled_snake(3)) && is_recursive(&planar_arm(4)));
}

#[test]
fn measured() {
    let Ok(list) = std::env::var("LINKAGES") else { return };
    for item in list.split_whitespace() {
        let words: Vec<&str> = item.split(':').collect();
        let n: usize = words.get(1).and_then(|n| n.parse().ok()).expect("family:n");
        let text = match words[0] {
            "snake" => wheeled_snake(n),
            "arm" => planar_arm(n),
            "pendulum" => planar_pendulum(n),
            "spatial" => spatial_arm(n),
            "spherical" => spherical_pendulum(n),
            other => panic!("no family {other}"),
        };
        let recursive = match words.get(2) {
            None => Some(true),
            Some(&"expanded") => Some(false),
            Some(_) => None,
        };
        let start = Instant::now();
        let model = parsed(&text);
        let scene = built(&model, recursive);
        let counts = scene.program().function(&Role::Rate).expect("rates").counts();
        println!(
            "{item}: {} additions, {} multiplications, {} in all, cost {}, {:.1} s, {} MB",
            counts.add,
            counts.mul,
            counts.total(),
            counts.cost(),
            start.elapsed().as_secs_f64(),
            scene.spent().bytes >> 20
        );
        if std::env::var("SECTIONS").is_ok() {
            let e = scene.equations();
            for s in &e.sections {
                println!("# {}", s.title);
                for d in &s.definitions {
                    println!(
                        "  {} = {}",
                        e.system.graph.name(d.symbol),
                        e.display(d.expr, hamel_expr::Style::Plain)
                    );
                }
            }
        }
        if std::env::var("TABLE").is_ok() {
            println!("{}", scene.operation_columns());
        }
    }
}
