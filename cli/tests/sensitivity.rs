//! Derivatives of motions by parameters and initial values: `simulate --sensitivity` and its JSON field.

use std::path::Path;
use std::sync::Arc;

use hamel::commands::simulate::simulate_text;
use hamel_codegen::spec;
use hamel_run::cache::Cache;
use hamel_run::error::{Error, Problem};
use hamel_run::interpreted;
use hamel_run::model::Checked;
use serde_json::{Value, json};

use crate::common::program;

/// `x = x0 cos w t + v0/w sin w t` with `w^2 = k/m`.
const OSCILLATOR: &str = "model oscillator {
    param k = 4 where k > 0;
    param m = 1;
    coordinate x in real;
    lagrangian = m*x_dot^2/2 - k*x^2/2;
}";

/// A ball that bounces on a floor whose height depends on a parameter, loses some of its velocity, and is caught in
/// another scene.
const BALL: &str = "model ball {
    param e = 0.7;
    param a = 0.1;
    coordinate z in real;
    lagrangian = z_dot^2/2 - z;
    event impact = z - a falling { then z_dot = -e*z_dot; }
}";
/// The same ball, which is caught.
const CAUGHT: &str = "model caught {
    param a = 0.1;
    coordinate z in real;
    lagrangian = z_dot^2/2 - z;
    event floor = z - a falling { stop; }
}";

fn simulate(text: &str, request: &Value) -> Result<Value, Error> {
    let model = spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let model = Arc::new(Checked::new(model, Cache::none()));
    let built = interpreted::build(&model, "default").unwrap_or_else(|e| panic!("{e}"));
    let answer = simulate_text(&built, &request.to_string())?;
    Ok(serde_json::from_str(&answer).expect("JSON"))
}

fn request() -> Value {
    json!({
        "initial": {"x": 0.3, "x_dot": -0.5}, "t_final": 3.0, "rtol": 1e-12, "atol": 1e-12,
        "method": "vern9", "sensitivity": ["k", "x_dot", "m"],
    })
}

fn at(answer: &Value, by: &str, component: &str) -> f64 {
    answer["sensitivity"][by][component].as_f64().unwrap_or_else(|| panic!("{answer}"))
}

#[test]
fn derivatives_are_those_of_the_solution_in_closed_form() {
    let answer = simulate(OSCILLATOR, &request()).unwrap();
    let (t, w) = (3.0_f64, 2.0_f64);
    let (s, c) = (w * t).sin_cos();
    // By the frequency, and dw/dk = 1/(2 w), dw/dm = -w/2.
    let by_w = -0.3 * t * s - 0.5 * (t * c / w - s / (w * w));
    let expected = [("k", by_w / (2.0 * w)), ("m", -by_w * w / 2.0), ("x_dot", s / w)];
    for (by, expected) in expected {
        assert!((at(&answer, by, "x") - expected).abs() < 1e-10, "{by}: {answer} {expected}");
    }
    assert!((at(&answer, "x_dot", "x_dot") - c).abs() < 1e-10);
    // The state is what it is without derivatives, to the tolerance, and the answer has them only where asked.
    let mut plain = request();
    plain.as_object_mut().unwrap().remove("sensitivity");
    let plain = simulate(OSCILLATOR, &plain).unwrap();
    assert!(plain.get("sensitivity").is_none());
    for name in ["x", "x_dot"] {
        let difference = plain["final"][name].as_f64().unwrap() - answer["final"][name].as_f64().unwrap();
        assert!(difference.abs() < 1e-11, "{difference}");
    }
    assert_eq!(answer["final"].as_object().unwrap().len(), 2);
}

#[test]
fn every_method_that_takes_rates_alone_has_them_and_others_are_refused_by_name() {
    let (mut n_fit, mut n_refused) = (0, 0);
    let exact = at(&simulate(OSCILLATOR, &request()).unwrap(), "k", "x");
    for method in hamel_run::method::MethodName::all() {
        let mut request = request();
        request["method"] = json!(method.name());
        let fixed = |request: &mut Value| {
            let fields = request.as_object_mut().unwrap();
            fields.remove("rtol");
            fields.remove("atol");
            fields.insert("step".into(), json!(1e-3));
        };
        let found = match simulate(OSCILLATOR, &request) {
            Err(Error::Request { .. }) => {
                fixed(&mut request);
                simulate(OSCILLATOR, &request)
            }
            other => other,
        };
        match found {
            Ok(answer) => {
                n_fit += 1;
                let found = at(&answer, "k", "x");
                // The classical method at its step is the least exact, but for the one of second order.
                let bound = if method == hamel_run::method::MethodName::Midpoint { 1e-5 } else { 1e-8 };
                assert!((found - exact).abs() < bound, "{}: {found} {exact}", method.name());
            }
            Err(error) => {
                n_refused += 1;
                let text = error.to_string();
                assert!(text.contains("sensitivity") && text.contains(method.name()), "{text}");
            }
        }
    }
    assert!(n_fit >= 9 && n_refused >= 5, "{n_fit} {n_refused}");
}

#[test]
fn wrong_names_are_told_with_what_there_is() {
    let mut wrong = request();
    wrong["sensitivity"] = json!(["kk", "x", "x", 3]);
    let Err(Error::Request { problems }) = simulate(OSCILLATOR, &wrong) else { panic!() };
    assert!(problems.iter().any(|p| matches!(p, Problem::UnknownName { name, .. } if name == "kk")));
    assert!(problems.iter().any(|p| matches!(p, Problem::Repeated { name, .. } if name == "x")));
    assert!(problems.iter().any(|p| matches!(p, Problem::WrongKind { .. })));
}

fn hamel(arguments: &[&str]) -> (bool, String, String) {
    let out = program::output(&mut program::command(arguments), "");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (out.status.success(), text(&out.stdout), text(&out.stderr))
}

/// A file in a folder of the tests.
fn file(name: &str, text: &str) -> String {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("sensitivity_{name}"));
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// The derivative of the component `component` by `by` in the file that a simulation wrote.
fn at_end(model: &str, arguments: &[&str], by: &str, component: &str) -> f64 {
    at_end_of(model, &[&["--initial", "z=1.1", "z_dot=0"], arguments].concat(), by, component)
}

fn at_end_of(model: &str, arguments: &[&str], by: &str, component: &str) -> f64 {
    let json = file(&format!("at_end_{}", Path::new(model).file_stem().unwrap().display()), "");
    let json = std::fs::canonicalize(json).unwrap().with_extension("json");
    let arguments = [&["simulate", model], arguments, &["-o", json.to_str().unwrap()]].concat();
    let (is_fine, _, message) = hamel(&arguments);
    assert!(is_fine, "{message}");
    let answer: Value = serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    at(&answer, by, component)
}

/// From the height `h` above the floor the ball falls for `t1 = sqrt(2 h)`, and has risen `e t1 s - s^2/2` after `s`.
#[test]
fn derivatives_go_through_events_that_change_the_state() {
    let model = file("ball.hamel", BALL);
    let (h, e, t_final) = (1.0_f64, 0.7_f64, 2.0_f64);
    let t1 = (2.0 * h).sqrt();
    let s = t_final - t1;
    // By the height, which moves t1 by 1/t1; the place of the floor moves height and floor.
    let by_h = [(e * s - e * t1 + s) / t1, (e + 1.0) / t1];
    let expected = [("z", by_h), ("e", [t1 * s, t1]), ("a", [1.0 - by_h[0], -by_h[1]])];
    let arguments = ["--t-final", "2", "--sensitivity", "z,e,a", "--rtol", "1e-12"];
    for (by, expected) in expected {
        for (component, expected) in ["z", "z_dot"].iter().zip(expected) {
            let found = at_end(&model, &arguments, by, component);
            assert!((found - expected).abs() < 1e-9, "{component} by {by}: {found} {expected}");
        }
    }
}

/// The last state is where the event is: at the floor, with the velocity `-sqrt(2 h)`.
#[test]
fn the_last_state_of_a_motion_that_an_event_ends_moves_along_the_event() {
    let model = file("caught.hamel", CAUGHT);
    let arguments = ["--sensitivity", "z,a"];
    let slope = 1.0 / 2.0_f64.sqrt();
    for (by, component, expected) in
        [("z", "z", 0.0), ("z", "z_dot", -slope), ("a", "z", 1.0), ("a", "z_dot", slope)]
    {
        let found = at_end(&model, &arguments, by, component);
        assert!((found - expected).abs() < 1e-9, "{component} by {by}: {found} {expected}");
    }
}

#[test]
fn tables_pictures_and_the_summary_have_them() {
    let model = file("oscillator.hamel", OSCILLATOR);
    let [csv, svg] = ["out.csv", "out.svg"].map(|name| file(name, ""));
    let arguments =
        ["--initial", "x=0.3", "x_dot=-0.5", "--t-final", "3", "--sensitivity", "k,x", "--samples"];
    let arguments = [&["simulate", &model][..], &arguments, &["7", "-o", &csv, "-o", &svg]].concat();
    let (is_fine, summary, message) = hamel(&arguments);
    assert!(is_fine, "{message}");
    assert!(summary.contains("derivative of the final state by k"), "{summary}");
    let table = std::fs::read_to_string(&csv).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows.len(), 8);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    let column =
        |name: &str| rows[0].iter().position(|own| *own == name).unwrap_or_else(|| panic!("{table}"));
    let value = |row: usize, name: &str| rows[row][column(name)].parse::<f64>().unwrap();
    // At the start nothing has moved but what is differentiated by.
    assert_eq!((value(1, "d_x_d_k"), value(1, "d_x_d_x"), value(1, "d_x_dot_d_x")), (0.0, 1.0, 0.0));
    // By the initial place: cos w t.
    for row in 1..8 {
        let exact = (2.0 * value(row, "t")).cos();
        assert!((value(row, "d_x_d_x") - exact).abs() < 1e-8, "{row}: {table}");
    }
    assert!(std::fs::read_to_string(&svg).unwrap().contains("Derivative by k"));
}

/// The state has the momentum, initial values are a place and a velocity, and both depend on the mass.
const CARRIED: &str = "model carried {
    param m = 0.7 where m > 0;
    param k = 2;
    coordinate x in real;
    momentum p of x_dot;
    carry p;
    lagrangian = m*x_dot^2/2 - k*x^2/2;
    initial x = m^2;
    initial x_dot = 1/m;
}";

/// Place and momentum of that model at the time one.
fn carried(m: f64, [x, v]: [f64; 2]) -> [f64; 2] {
    let w = (2.0 / m).sqrt();
    let (s, c) = w.sin_cos();
    [x * c + v / w * s, m * (v * c - x * w * s)]
}

#[test]
fn starts_in_other_variables_move_with_the_parameters() {
    let model = file("carried.hamel", CARRIED);
    // By differences of the closed form.
    let slopes = |start: &dyn Fn(f64) -> [f64; 2]| {
        let (h, m) = (1e-5, 0.7);
        let [after, before] = [m + h, m - h].map(|m| carried(m, start(m)));
        [(after[0] - before[0]) / (2.0 * h), (after[1] - before[1]) / (2.0 * h)]
    };
    let check = |what: &str, found: &dyn Fn(&str) -> f64, expected: [f64; 2]| {
        for (component, expected) in ["x", "p"].iter().zip(expected) {
            let found = found(component);
            assert!((found - expected).abs() < 1e-8, "{what}: {component} {found} {expected}");
        }
    };
    type Start<'a> = &'a dyn Fn(f64) -> [f64; 2];
    let cases: [(&[&str], Value, Start<'_>); 4] = [
        (&[], json!({}), &|m| [m * m, 1.0 / m]),
        (&["x=0.4"], json!({"x": 0.4}), &|m| [0.4, 1.0 / m]),
        (&["x=0.4", "x_dot=1.5"], json!({"x": 0.4, "x_dot": 1.5}), &|_| [0.4, 1.5]),
        (&["x=0.4", "p=1.5"], json!({"x": 0.4, "p": 1.5}), &|m| [0.4, 1.5 / m]),
    ];
    for (given, initial, start) in cases {
        let mut arguments = vec!["--t-final", "1", "--sensitivity", "m", "--rtol", "1e-12"];
        if !given.is_empty() {
            arguments.push("--initial");
            arguments.extend(given);
        }
        let found = |component: &str| at_end_of(&model, &arguments, "m", component);
        check(&format!("{given:?}"), &found, slopes(start));
        let request = json!({"initial": initial, "t_final": 1, "sensitivity": ["m"], "rtol": 1e-12});
        let out =
            program::output(&mut program::command(&["simulate", &model, "--json"]), &request.to_string());
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let answer: Value = serde_json::from_slice(&out.stdout).unwrap();
        check(&request.to_string(), &|component| at(&answer, "m", component), slopes(start));
    }
}

/// Nobody gives the place, which is the middle of its interval.
#[test]
fn a_middle_of_an_interval_moves_with_its_ends() {
    let text = "model between {
        param a = 1 where a > 0;
        coordinate x in (a, 4*a);
        lagrangian = x_dot^2/2;
        initial x_dot = 0.1;
    }";
    let model = file("between.hamel", text);
    let found = at_end_of(&model, &["--t-final", "1", "--sensitivity", "a"], "a", "x");
    assert!((found - 2.5).abs() < 1e-9, "{found}");
}
