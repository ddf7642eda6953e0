//! Nonholonomic brackets: `y' = Pi dE + R` at random states of printed and random systems, what is found out about them.

use hamel_codegen::scene::{self, BuiltScene, Interpreter};
use hamel_codegen::spec;
use hamel_tests::models::text_with;
use hamel_tests::random::Random;

fn built(text: &str) -> Result<BuiltScene, String> {
    let model = spec::parse("test.hamel", text).map_err(|e| e.to_string())?;
    scene::build(&model, "brackets").map_err(|e| e.to_string())
}

/// A shipped model with a scene `brackets` that wants its bracket.
fn of_model(name: &str, items: &str) -> Result<BuiltScene, String> {
    built(&text_with(name, &format!("scene brackets {{ want rhs, energy, bracket; {items} }}")))
}

/// Central differences of the energy.
fn slopes(of: &Interpreter<'_>, t: f64, y: &[f64]) -> Vec<f64> {
    let h = 1e-5;
    let at = |k: usize, shift: f64| {
        let mut z = y.to_vec();
        z[k] += shift;
        of.energy(t, &z).expect("the scene wants it")
    };
    (0..y.len()).map(|k| (8.0 * (at(k, h) - at(k, -h)) - (at(k, 2.0 * h) - at(k, -2.0 * h))) / (12.0 * h)).collect()
}

/// The largest `|y' - Pi dE - R|` at random states, each moved by `onto` to where the constraints hold; relative to the
/// size of the terms.
fn worst(scene: &BuiltScene, onto: impl Fn(&mut [f64])) -> f64 {
    let defaults: Vec<f64> =
        scene.params().iter().map(|p| hamel_codegen::expr::rational_to_f64(&p.default)).collect();
    let interpreter = scene.prepare(&defaults).unwrap();
    let n = scene.state.len();
    let mut random = Random(15);
    let (mut worst, mut moved) = (0.0_f64, 0.0_f64);
    for _ in 0..20 {
        let t = random.number();
        let mut y: Vec<f64> = (0..n).map(|_| 0.75 + 0.45 * random.number()).collect();
        onto(&mut y);
        let mut rates = vec![0.0; n];
        interpreter.rhs(t, &y, &mut rates);
        let matrix = interpreter.bracket(t, &y).unwrap();
        let remainder = interpreter.bracket_remainder(t, &y).unwrap_or_else(|| vec![0.0; n]);
        let slopes = slopes(&interpreter, t, &y);
        for (i, row) in matrix.iter().enumerate() {
            let terms: Vec<f64> = row.iter().zip(&slopes).map(|(e, slope)| e * slope).collect();
            let size = terms.iter().map(|x| x.abs()).sum::<f64>() + remainder[i].abs() + rates[i].abs() + 1.0;
            worst = worst.max((rates[i] - terms.iter().sum::<f64>() - remainder[i]).abs() / size);
            moved = moved.max(rates[i].abs());
            for (j, other) in matrix.iter().enumerate() {
                assert_eq!(row[j], -other[i], "antisymmetric");
            }
        }
    }
    assert!(moved > 1e-3, "nothing moves");
    worst
}

#[test]
fn models_move_by_their_brackets() {
    for name in [
        "free_rigid_body",
        "heavy_top",
        "kirchhoff_body",
        "suslov",
        "chaplygin_sleigh",
        "mobile_robot",
        "chaplygin_ball",
        "euler_disk",
        "euler_disk_advected",
        "ball_on_rotating_table",
        "rolling_ball",
        "snakeboard",
        "wong_particle",
        "two_arm_satellite",
        "chaplygin_gyro",
    ] {
        let scene = of_model(name, "").unwrap_or_else(|e| panic!("{name}: {e}"));
        let worst = worst(&scene, |_| ());
        println!("{name} {worst:e} {:?}", scene.state_names());
        assert!(worst < 1e-8, "{name}: {worst:e}");
    }
}

#[test]
fn with_multipliers_the_bracket_is_one_of_states_on_the_constraint() {
    let scene = of_model("veselova", "").unwrap();
    let worst = worst(&scene, |y| {
        let along = y[0] * y[3] + y[1] * y[4];
        y[2] = -along / y[5];
    });
    assert!(worst < 1e-8, "{worst:e}");
}
