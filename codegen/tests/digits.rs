//! No digits are lost that the inputs have: right-hand sides of models, run by the interpreter in `f64` and to 31
//! digits.
//!
//! The error of every component is a multiple of `|f| + sum_i |df/dx_i| |x_i|`, what rounding the inputs does to the
//! exact function.

use std::path::Path;

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_program::program::Role;
use hamel_runtime::{DoubleDouble, Real};

const SHIFT: f64 = 1.0 / (1u128 << 64) as f64;

fn build(model: &str) -> BuiltScene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../models/specs/{model}.hamel"));
    let text = std::fs::read_to_string(&path).unwrap();
    let model = spec::parse(&path.display().to_string(), &text).unwrap();
    scene::build(&model, "default").unwrap()
}

/// SplitMix64 (Steele, Lea, Flood 2014), to `[-1, 1)`.
struct Random(u64);

impl Random {
    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / (1u64 << 63) as f64 - 1.0
    }
}

fn rhs<R: Real>(scene: &BuiltScene, params: &[R], state: &[R]) -> Option<Vec<R>> {
    let program = &scene.program;
    let prepared = program.prepare(params).ok()?;
    let mut out = vec![R::ZERO; state.len()];
    program.run(program.function_idx(&Role::Rate)?, params, &prepared, R::ZERO, state, &mut out);
    Some(out)
}

/// The largest error of a component in multiples of epsilon times the effect of the inputs; none where the parameters
/// are refused.
fn loss(scene: &BuiltScene, params: &[f64], state: &[f64]) -> Option<f64> {
    let long = |x: &[f64]| x.iter().map(|x| DoubleDouble::from(*x)).collect::<Vec<_>>();
    let (found, exact) = (rhs(scene, params, state)?, rhs(scene, &long(params), &long(state))?);
    let mut effects: Vec<f64> = exact.iter().map(|x| x.hi().abs()).collect();
    for k in 0..params.len() + state.len() {
        let mut inputs = long(&[params, state].concat());
        inputs[k] *= DoubleDouble::sum_of(1.0, SHIFT);
        let moved = rhs(scene, &inputs[..params.len()], &inputs[params.len()..])?;
        for ((effect, moved), exact) in effects.iter_mut().zip(moved).zip(&exact) {
            *effect += (moved - *exact).hi().abs() / SHIFT;
        }
    }
    let errors = found.iter().zip(&exact).map(|(x, exact)| (DoubleDouble::from(*x) - *exact).hi().abs());
    Some(
        errors
            .zip(effects)
            .map(|(error, effect)| if error == 0.0 { 0.0 } else { error / effect / f64::EPSILON })
            .fold(0.0, f64::max),
    )
}

/// The largest loss of many random states with every parameter moved by up to three decades.
fn at_parameters_of_a_machine_that_one_builds(model: &str, state: impl Fn(&mut Random) -> Vec<f64>) -> f64 {
    let scene = build(model);
    let defaults: Vec<f64> = scene.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let mut random = Random(1);
    let mut worst: f64 = 0.0;
    let mut n = 0;
    while n < 3000 {
        let params: Vec<f64> = defaults.iter().map(|p| p * 10f64.powf(3.0 * random.number())).collect();
        let state = state(&mut random);
        if let Some(loss) = loss(&scene, &params, &state) {
            worst = worst.max(loss);
            n += 1;
        }
    }
    worst
}

#[test]
fn eulers_disk_keeps_its_digits_when_every_parameter_moves_by_three_decades() {
    // 3e9 with the Schur complement as a difference.
    let worst = at_parameters_of_a_machine_that_one_builds("euler_disk", |random| {
        let theta = 0.75 * (1.0 + 0.99 * random.number());
        [theta].into_iter().chain((0..4).map(|_| 3.0 * random.number())).collect()
    });
    assert!(worst < 64.0, "{worst}");
}

#[test]
fn a_mobile_robot_keeps_its_digits_when_every_parameter_moves_by_three_decades() {
    // 7e8 before. What is left is `(a psi1' + b psi2') (psi1' - psi2')`, multiplied out, next to psi1' = psi2'.
    let worst = at_parameters_of_a_machine_that_one_builds("mobile_robot", |random| {
        (0..4).map(|_| 3.0 * random.number()).collect()
    });
    assert!(worst < 1000.0, "{worst}");
}

#[test]
fn a_skew_sleigh_keeps_its_digits_when_every_parameter_moves_by_three_decades() {
    // 4e5 before, 65 measured now. In 20,000 states of the stress run 37 for 99.99 % and 1e2 at most.
    let scene = build("skew_sleigh");
    let n = scene.state.len();
    let worst = at_parameters_of_a_machine_that_one_builds("skew_sleigh", |random| {
        (0..n).map(|_| 3.0 * random.number()).collect()
    });
    assert!(worst < 200.0, "{worst}");
}

#[test]
fn veselovas_body_keeps_its_digits_next_to_an_axis_at_any_speed() {
    let scene = build("veselova");
    let mut params: Vec<f64> =
        scene.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    params[..3].copy_from_slice(&[1.69226352, 1.25110093, 0.36976687]);
    let state = [215099545.15, -233220141.45, 12.175, 8.3e-8, 2.43e-8, -1.0];
    let found = loss(&scene, &params, &state).unwrap();
    assert!(found < 64.0, "{found}");
    let worst = at_parameters_of_a_machine_that_one_builds("veselova", |random| {
        let speeds: Vec<f64> = (0..3).map(|_| random.number() * 10f64.powf(8.0 * random.number())).collect();
        let distance = 10f64.powf(-6.0 + 6.0 * random.number());
        let mut gamma = [distance * random.number(), distance * random.number(), distance * random.number()];
        gamma[(1.5 + 1.5 * random.number()) as usize] = 1.0;
        speeds.into_iter().chain(gamma).collect()
    });
    assert!(worst < 64.0, "{worst}");
}
