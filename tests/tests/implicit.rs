//! Implicit forms: the explicit motion satisfies them, the index is what they say, derivatives are those of the rows.
//!
//! That the motion satisfies every row is proved when a scene is built, by fingerprints; numbers here see that what was
//! proved is what is computed.

use hamel_codegen::scene::{self, BuiltScene, Implicit, Interpreter};
use hamel_codegen::spec;
use hamel_tests::models::{names, params, text, text_with};

const SCENE: &str = "\n scene tested { want rhs, implicit; }";

fn built(name: &str, text: &str) -> BuiltScene {
    let model = spec::parse(name, text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, "tested").unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// A state with components of order one, other for each.
fn state(n: usize) -> Vec<f64> {
    (0u32..).take(n).map(|k| 0.3 + 0.17 * f64::from((k * 7 + 3) % 5)).collect()
}

/// The variables at a state: the last output.
fn variables(interpreter: &Interpreter<'_>, implicit: &Implicit, t: f64, y: &[f64]) -> Vec<f64> {
    let mut outputs = interpreter.outputs(t, y);
    outputs.split_off(outputs.len() - implicit.variables.len())
}

/// The determinant of a matrix, by elimination with pivots.
fn determinant(mut rows: Vec<Vec<f64>>) -> f64 {
    let mut product = 1.0;
    for k in 0..rows.len() {
        let pivot = (k..rows.len()).max_by(|a, b| rows[*a][k].abs().total_cmp(&rows[*b][k].abs())).unwrap();
        rows.swap(k, pivot);
        product *= rows[k][k];
        for i in k + 1..rows.len() {
            let factor = rows[i][k] / rows[k][k];
            for j in k..rows.len() {
                rows[i][j] -= factor * rows[k][j];
            }
        }
    }
    product
}

/// Holds a scene to its implicit form at a state.
fn assert_holds(name: &str, scene: &BuiltScene) {
    let implicit = scene.implicit().expect("it is wanted");
    let interpreter = scene.prepare(&params(scene, &[])).unwrap();
    let (t, y) = (0.3, state(scene.state().len()));
    let z = variables(&interpreter, implicit, t, &y);
    let f = interpreter.implicit(t, &z).unwrap();
    let mut rates = vec![0.0; y.len()];
    interpreter.rhs(t, &y, &mut rates);
    let scale = f.iter().chain(&z).chain(&rates).fold(1.0_f64, |a, b| a.max(b.abs()));
    // Rounding errors of some tens of operations on numbers of that size.
    let tolerance = 1e-13 * scale * scale;
    for (variable, f) in implicit.variables.iter().zip(&f) {
        assert!(variable.is_differential || f.abs() < tolerance, "{name}: {} {f}", variable.name);
    }
    for (place, (rate, y)) in implicit.state.iter().zip(rates.iter().zip(&y)) {
        let variable = &implicit.variables[*place];
        assert_eq!(z[*place], *y, "{name}: {}", variable.name);
        let error = (f[*place] - rate).abs();
        assert!(!variable.is_differential || error < tolerance, "{name}: {} {error}", variable.name);
    }
    // Derivatives by central differences, which are within their third derivatives times h^2.
    let rows = interpreter.implicit_jacobian(t, &z).unwrap();
    let h = 1e-5;
    for (j, variable) in implicit.variables.iter().enumerate() {
        let moved = |step: f64| {
            let mut z = z.clone();
            z[j] += step;
            interpreter.implicit(t, &z).unwrap()
        };
        for (i, (after, before)) in moved(h).iter().zip(moved(-h)).enumerate() {
            let slope = (after - before) / (2.0 * h);
            let error = (slope - rows[i][j]).abs();
            assert!(error < 1e-6 * scale * scale, "{name}: row {i} by {} {error}", variable.name);
        }
    }
    // The index is one: algebraic equations give algebraic variables.
    let algebraic: Vec<usize> = (0..z.len()).filter(|k| !implicit.variables[*k].is_differential).collect();
    assert_eq!(implicit.index, usize::from(!algebraic.is_empty()), "{name}");
    let block: Vec<Vec<f64>> =
        algebraic.iter().map(|i| algebraic.iter().map(|j| rows[*i][*j]).collect()).collect();
    assert!(determinant(block).abs() > 1e-9, "{name}");
}

/// Large ones say nothing that small ones of the same kind do not.
const LARGE: [&str; 4] = ["zeitlin_euler_5", "zeitlin_euler_7", "zeitlin_mhd_5", "second_grade_fluid"];

#[test]
fn every_model_has_an_implicit_form_that_its_motion_satisfies() {
    for name in names().iter().filter(|name| !LARGE.contains(&name.as_str())) {
        assert_holds(name, &built(name, &text_with(name, SCENE)));
    }
}

#[test]
fn coordinates_of_the_group_and_momenta_are_variables() {
    let scene = "\n scene tested { want rhs, reconstruction, implicit; }";
    for name in ["heavy_top", "chaplygin_sleigh", "veselova", "two_arm_satellite_routh"] {
        let built = built(name, &text_with(name, scene));
        assert_eq!(built.implicit().unwrap().state.len(), built.state().len());
        assert_holds(name, &built);
    }
    let text = "model m { param I: diagonal(3) = [1, 2, 4] where I1 > 0, I2 > 0, I3 > 0;
        velocity Omega in so(3); momentum Pi of Omega; lagrangian = dot(Omega, I*Omega)/2;
        scene tested { carry Pi; want rhs, implicit; } }";
    let built = built("body", text);
    let names: Vec<&str> = built.implicit().unwrap().variables.iter().map(|v| v.name.as_str()).collect();
    assert_eq!(names, ["Omega1", "Omega2", "Omega3", "Pi1", "Pi2", "Pi3"]);
    assert_holds("body", &built);
}

#[test]
fn a_nonlinear_constraint_and_a_moving_one_are_kept() {
    for text in [
        "model m { coordinate x, y, z in real; lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2 - z;
            constraint x_dot^2 + y_dot^2 - z_dot^2 = 0; scene tested { want rhs, implicit; } }",
        "model m { coordinate x, y, z in real; lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2 - x*z;
            constraint z_dot = y*x_dot + cos(t); scene tested { want rhs, implicit; } }",
    ] {
        assert_holds(text, &built("m", text));
    }
}

/// Each round of conditions, and each that restricts places alone, differentiates `p = L_y` once more.
#[test]
fn the_index_with_all_momenta_follows_from_the_steps() {
    let index = |text: &str| built("m", text).implicit().unwrap().pontryagin_index;
    let pontryagin = |l: &str, names: &str| {
        index(&format!("model m {{ coordinate {names} in real; lagrangian = {l}; {SCENE} }}"))
    };
    assert_eq!(pontryagin("x_dot^2 - x^2", "x"), 1);
    assert_eq!(pontryagin("x*y_dot - x^2 - y^2", "x, y"), 2);
    // A multiplier written as a coordinate: g = 0, g' = 0, lambda by g'' = 0, its rate by g''' = 0.
    let multiplier = "x_dot^2/2 + z_dot^2 + lambda*(x - 2*z) - x^2*z";
    assert_eq!(pontryagin(multiplier, "x, z, lambda"), 5);
    assert_eq!(index(&text_with("chaplygin_sleigh", SCENE)), 2);
}

#[test]
fn what_has_no_implicit_form_is_refused_where_it_is_wanted() {
    let text = text("veselova");
    let text = text.trim_end().strip_suffix('}').unwrap();
    let text = format!("{text} momentum P of Omega; scene tested {{ carry P; want rhs, implicit; }} }}");
    let model = spec::parse("veselova", &text).unwrap_or_else(|e| panic!("{e}"));
    let error = scene::build(&model, "tested").unwrap_err().to_string();
    assert!(error.contains("the implicit form with multipliers and momenta does not exist"), "{error}");
    assert!(error.contains("velocities as state; remove `carry`"), "{error}");
}
