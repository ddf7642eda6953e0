//! Linkages of bodies: what their right-hand sides cost, and that they are those of the equations multiplied out.
//!
//! `LINKAGES="snake:10 arm:6:expanded" cargo test -p hamel-codegen --test linkages measured -- --nocapture` prints what
//! others take; with `TABLE=1`, by section.

#[path = "linkages/families.rs"]
mod families;

use std::time::Instant;

use families::{planar_arm, planar_pendulum, wheeled_snake};
use hamel_codegen::expr::rational_to_f64;
use hamel_codegen::mechanics::{derive, is_recursive, same_motion};
use hamel_codegen::program::Role;
use hamel_codegen::reduction::{Formulation, reduce};
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, Model};

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
    let counts = scene.program.function(&Role::Rate).expect("rates").counts();
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
    let params: Vec<f64> = scene.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let interpreter = scene.prepare(&params).expect("defaults keep the conditions");
    let mut rates = vec![0.0; state.len()];
    interpreter.rhs(0.0, state, &mut rates);
    rates
}

/// Both forms lose a few digits in the mass matrix's factors, of condition numbers below 1e4 here.
const TOLERANCE: f64 = 1e-10;

#[test]
fn by_recursion_bodies_move_as_multiplied_out() {
    for text in [wheeled_snake(3), planar_arm(3), planar_pendulum(3)] {
        let model = parsed(&text);
        let [recursive, expanded] = [true, false].map(|recursive| built(&model, Some(recursive)));
        assert_eq!(recursive.state_names(), expanded.state_names());
        for seed in 1..=5 {
            let state = numbers(recursive.state.len(), seed);
            let (a, b) = (rates(&recursive, &state), rates(&expanded, &state));
            let size = b.iter().fold(0.0_f64, |size, rate| size.max(rate.abs()));
            assert!(size > 0.1, "{}: nothing moves", model.name);
            for (a, b) in a.iter().zip(&b) {
                assert!((a - b).abs() <= TOLERANCE * size, "{}: {a} and {b}", model.name);
            }
        }
    }
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
        let counts = scene.program.function(&Role::Rate).expect("rates").counts();
        println!(
            "{item}: {} additions, {} multiplications, {} in all, cost {}, {:.1} s, {} MB",
            counts.add,
            counts.mul,
            counts.total(),
            counts.cost(),
            start.elapsed().as_secs_f64(),
            scene.spent().bytes >> 20
        );
        if std::env::var("TABLE").is_ok() {
            println!("{}", scene.operation_columns());
        }
    }
}
