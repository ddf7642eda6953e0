//! `fit`: what it finds, how well it says that it knows it, and what each mistake is told.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::program;

/// `x = x0 cos w t + v0/w sin w t` with `w^2 = k/m`; the height of the end of an arm of length `l` besides.
const OSCILLATOR: &str = "model oscillator {
    param k = 4 where k > 0;
    param m = 1 where m > 0;
    param l = 2;
    coordinate x in real;
    lagrangian = m*x_dot^2/2 - k*x^2/2;
    output end = l*cos(x);
    scene stiff { fix k = 9; want energy, outputs; }
}";

/// A ball that bounces.
const BALL: &str = "model ball {
    coordinate z in real;
    lagrangian = z_dot^2/2 - z;
    event impact = z falling { then z_dot = -z_dot; }
}";

/// Two points with a constraint that both velocities are kept for.
const PAIR: &str = "model pair {
    param r = 2;
    coordinate x in real;
    coordinate y in real;
    constraint x_dot = r*y_dot;
    lagrangian = (x_dot^2 + y_dot^2 - x^2 - y^2)/2;
    multipliers;
}";

/// A file in a folder of the tests.
fn file(name: &str, text: &str) -> String {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fit_{name}"));
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// Exit status, standard output and standard error.
fn hamel(arguments: &[&str]) -> (Option<i32>, String, String) {
    let out = program::output(&mut program::command(arguments), "");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (out.status.code(), text(&out.stdout), text(&out.stderr))
}

fn fit_json(arguments: &[&str]) -> Value {
    let (code, answer, message) = hamel(&[&["fit"], arguments, &["--json"]].concat());
    assert_eq!(code, Some(0), "{arguments:?}: {message}");
    serde_json::from_str(&answer).unwrap_or_else(|e| panic!("{e}: {answer}"))
}

fn refused(arguments: &[&str], code: i32, words: &[&str]) {
    let (found, _, message) = hamel(&[&["fit"], arguments].concat());
    assert_eq!(found, Some(code), "{arguments:?}: {message}");
    for word in words {
        assert!(message.contains(word), "{arguments:?}: no {word:?} in {message}");
    }
}

fn estimate(answer: &Value, name: &str, field: &str) -> f64 {
    answer["estimates"][name][field].as_f64().unwrap_or_else(|| panic!("{name}: {answer}"))
}

/// Errors of measurements: normal with standard deviation one, always the same for a seed.
///
/// # Source
/// Box and Muller, A note on the generation of random normal deviates (1958).
struct Noise(u64);

impl Noise {
    fn unit(&mut self) -> f64 {
        ((hamel_expr::split_mix(&mut self.0) >> 12) as f64 + 0.5) / (1_u64 << 52) as f64
    }

    fn next(&mut self) -> f64 {
        let (x, angle) = (self.unit(), std::f64::consts::TAU * self.unit());
        (-2.0 * x.ln()).sqrt() * angle.cos()
    }
}

/// Times from `t0` to `t0 + 3` and the exact place of the oscillator with `k`, `m = 1`, `x0 = 0.3`, `v0 = -0.5`.
fn motion(k: f64, n: usize) -> Vec<(f64, f64)> {
    let w = k.sqrt();
    let times = (0..n).map(|i| 3.0 * i as f64 / (n - 1) as f64);
    times.map(|t| (t, 0.3 * (w * t).cos() - 0.5 / w * (w * t).sin())).collect()
}

const START: [&str; 3] = ["--initial", "x=0.3", "x_dot=-0.5"];

#[test]
fn exact_data_give_back_what_they_were_made_of() {
    let model = file("exact.hamel", OSCILLATOR);
    let mut text = "t,x\n".to_owned();
    motion(5.3, 40).iter().for_each(|(t, x)| writeln!(text, "{t:?},{x:?}").unwrap());
    let data = file("exact.csv", &text);
    let arguments =
        [&[&*model, "--data", &data, "--free", "k,x_dot", "--initial", "x=0.3", "x_dot=0"][..]].concat();
    let answer = fit_json(&arguments);
    // Of the tolerances of the integration, 1e-10.
    assert!((estimate(&answer, "k", "value") - 5.3).abs() < 1e-8, "{answer}");
    assert!((estimate(&answer, "x_dot", "value") + 0.5).abs() < 1e-8, "{answer}");
    assert!(answer["columns"]["x"]["rms"].as_f64().unwrap() < 1e-9, "{answer}");
    assert_eq!(answer["degrees_of_freedom"], 38);
    // The answer is a request to simulate, all parameters and the whole state.
    assert_eq!(answer["params"]["m"], 1.0);
    assert_eq!(answer["initial"]["x"], 0.3);
    // For people, what was found can be given back.
    let (_, summary, _) = hamel(&[&["fit"], &arguments[..]].concat());
    assert!(
        summary.contains("for simulate: --set k=5.3") || summary.contains("for simulate: --set k=5.29"),
        "{summary}"
    );
}

/// With the initial values alone free, the problem is linear: `dx/dx0 = cos w t`, `dx/dv0 = sin w t / w`.
#[test]
fn errors_and_correlations_are_those_of_the_linear_problem() {
    let model = file("linear.hamel", OSCILLATOR);
    let (mut noise, sigma, mut text) = (Noise(5), 0.02, "t,x\n".to_owned());
    for (t, x) in motion(4.0, 60) {
        writeln!(text, "{t:?},{:?}", x + sigma * noise.next()).unwrap();
    }
    let data = file("linear.csv", &text);
    let known = fit_json(&[&model, "--data", &data, "--free", "x,x_dot", "--sigma", "x=0.02"]);
    let unknown = fit_json(&[&model, "--data", &data, "--free", "x,x_dot"]);
    let columns: Vec<[f64; 2]> =
        motion(4.0, 60).iter().map(|(t, _)| [(2.0 * t).cos(), (2.0 * t).sin() / 2.0]).collect();
    let sum = |i: usize, j: usize| columns.iter().map(|c| c[i] * c[j]).sum::<f64>();
    let (a, b, c) = (sum(0, 0), sum(0, 1), sum(1, 1));
    let determinant = a * c - b * b;
    let expected =
        [("x", sigma * (c / determinant).sqrt(), 0.3), ("x_dot", sigma * (a / determinant).sqrt(), -0.5)];
    for (name, error, exact) in expected {
        assert!((estimate(&known, name, "error") / error - 1.0).abs() < 1e-7, "{name}: {known} {error}");
        // Five standard deviations, of data that never change.
        assert!((estimate(&known, name, "value") - exact).abs() < 5.0 * error, "{name}: {known}");
        assert_eq!(estimate(&known, name, "error") > 0.0, estimate(&unknown, name, "error") > 0.0);
    }
    let correlation = known["correlation"]["x"]["x_dot"].as_f64().unwrap();
    assert!((correlation + b / (a * c).sqrt()).abs() < 1e-7, "{correlation}");
    // Without known errors, what is left stands for them.
    let ratio = estimate(&unknown, "x", "error") / estimate(&known, "x", "error");
    let rms = unknown["columns"]["x"]["rms"].as_f64().unwrap();
    assert!((ratio - rms * (60.0_f64 / 58.0).sqrt() / sigma).abs() < 1e-6, "{ratio} {rms}");
    assert!((0.7..1.4).contains(&ratio), "{ratio}");
}

#[test]
fn columns_have_other_names_and_gaps_and_the_motion_starts_when_told() {
    let model = file("columns.hamel", OSCILLATOR);
    let mut text = "seconds, position ,room,x_dot\n".to_owned();
    let w = 5.3_f64.sqrt();
    for (k, (t, x)) in motion(5.3, 40).into_iter().enumerate() {
        let v = -0.3 * w * (w * t).sin() - 0.5 * (w * t).cos();
        let x = if k % 3 == 0 { String::new() } else { format!("{x:?}") };
        let v = if k % 4 == 0 { format!("{v:?}") } else { String::new() };
        writeln!(text, "{:?},{x},20,{v}", t + 7.5).unwrap();
    }
    let data = file("columns.csv", &text);
    let options = ["--time", "seconds", "--t0", "7.5", "--columns", "x=position,x_dot", "--free", "k"];
    let answer = fit_json(&[&[&*model, "--data", &data][..], &options, &START].concat());
    assert!((estimate(&answer, "k", "value") - 5.3).abs() < 1e-8, "{answer}");
    assert_eq!(
        (&answer["columns"]["x"]["values"], &answer["columns"]["x_dot"]["values"]),
        (&26.into(), &10.into())
    );
}

/// The output depends on the state and on a parameter of its own, the energy on both parameters.
#[test]
fn outputs_and_the_energy_are_fitted_with_their_own_derivatives() {
    let model = file("outputs.hamel", OSCILLATOR);
    let (k, l) = (5.3_f64, 1.7);
    let mut text = "t,end,energy\n".to_owned();
    for (t, x) in motion(k, 40) {
        writeln!(text, "{t:?},{:?},{:?}", l * x.cos(), 0.125 + k * 0.09 / 2.0).unwrap();
    }
    let data = file("outputs.csv", &text);
    let arguments = [&[&*model, "--data", &data, "--free", "k", "l"][..], &START].concat();
    let answer = fit_json(&arguments);
    assert!((estimate(&answer, "k", "value") - k).abs() < 1e-8, "{answer}");
    assert!((estimate(&answer, "l", "value") - l).abs() < 1e-8, "{answer}");
}

#[test]
fn what_the_data_do_not_determine_is_named() {
    let model = file("unknown.hamel", OSCILLATOR);
    let mut text = "t,x\n".to_owned();
    motion(5.3, 40).iter().for_each(|(t, x)| writeln!(text, "{t:?},{x:?}").unwrap());
    let data = file("unknown.csv", &text);
    let with = |free| [&[&*model, "--data", &data, "--free", free][..], &START].concat();
    // k/m alone matters: dk = k/m dm.
    refused(&with("m,k"), 2, &["combinations of m, k", "dk = 1", "found at m = "]);
    refused(&with("k,l"), 2, &["l changes nothing"]);
}

#[test]
fn steps_out_of_the_domain_are_shortened_and_an_edge_is_no_minimum() {
    let model = file("edge.hamel", OSCILLATOR);
    let mut text = "t,x\n".to_owned();
    motion(0.05, 40).iter().for_each(|(t, x)| writeln!(text, "{t:?},{x:?}").unwrap());
    let data = file("edge.csv", &text);
    // Newton's first step from here is to negative stiffness, which has no motion.
    let with = |data| [&[&*model, "--data", data, "--free", "k", "--set", "k=1.5"][..], &START].concat();
    let answer = fit_json(&with(&data));
    assert!((estimate(&answer, "k", "value") - 0.05).abs() < 1e-8, "{answer}");
    // x0 cosh + v0 sinh: a repelling spring.
    let mut text = "t,x\n".to_owned();
    for (t, _) in motion(1.0, 40) {
        writeln!(text, "{t:?},{:?}", 0.3 * t.cosh() - 0.5 * t.sinh()).unwrap();
    }
    let data = file("repelling.csv", &text);
    refused(&with(&data), 1, &["k > 0 does not hold", "the best values: k = "]);
    refused(
        &[&[&*model, "--data", &data, "--free", "m", "--set", "k=-1"][..], &START].concat(),
        2,
        &["k > 0"],
    );
}

#[test]
fn mistakes_are_told_with_what_to_change() {
    let model = file("mistakes.hamel", OSCILLATOR);
    let data = file("mistakes.csv", "t,x,temperature\n0,0.3,20\n1,0.1,20\n2,0.2,20\n");
    let base = [&*model, "--data", &data, "--free"];
    let with = |more: &[&'static str]| [&base[..], more].concat();
    refused(
        &with(&["k"]),
        2,
        &["no variable `temperature`", "variables: x, x_dot, energy", "--columns NAME=HEADER"],
    );
    refused(&with(&["kk", "--columns", "x"]), 2, &["`kk`", "did you mean `k`"]);
    refused(&with(&["k", "--scene", "stiff", "--columns", "x"]), 2, &["k, which scene stiff fixes"]);
    refused(&with(&["k,m,l", "--columns", "x"]), 2, &["has 3 values", "3 unknowns"]);
    refused(&with(&["k", "--columns", "x=y"]), 2, &["the table has no column `y`"]);
    refused(&with(&["k", "--columns", "x,x"]), 2, &["`x` twice"]);
    refused(&with(&["k", "--time", "seconds"]), 2, &["the table has no column `seconds`"]);
    refused(&with(&["k", "--columns", "x", "--t0", "0.5"]), 2, &["mistakes.csv:2", "earlier --t0"]);
    refused(&with(&["k", "--columns", "x", "--sigma", "x=0"]), 2, &["--sigma", "positive"]);
    refused(&with(&["k", "--columns", "x,x_dot=temperature", "--sigma", "x=1"]), 2, &["--sigma lacks x_dot"]);
    refused(&with(&["k", "--columns", "x", "--method", "taylor"]), 2, &["fit: method taylor"]);
    refused(&with(&["k", "--columns", "x", "-o", "out.gif"]), 2, &["out.gif", ".svg"]);
    let unsorted = file("unsorted.csv", "t,x\n0,0.3\n2,0.1\n1,0.2\n,0.2\n");
    let arguments = [&*model, "--data", &unsorted, "--free", "k"];
    refused(&arguments, 2, &["unsorted.csv:4 is at 1.0", "unsorted.csv:5 has no time"]);
    refused(&[&*model, "--data", "nowhere.csv", "--free", "k"], 1, &["nowhere.csv"]);
}

#[test]
fn events_are_refused_and_a_start_stays_on_its_constraint() {
    let data = file("refused.csv", "t,x,y\n0,0.3,0.1\n1,0.1,\n2,0.2,\n");
    let ball = file("ball.hamel", BALL);
    refused(&[&ball, "--data", &data, "--free", "z", "--columns", "z=x"], 2, &["--scene", "events"]);
    let pair = file("pair.hamel", PAIR);
    // Positions are free of the constraint.
    let (code, _, message) = hamel(&["fit", &pair, "--data", &data, "--free", "x"]);
    assert_eq!(code, Some(0), "{message}");
    // A parameter of the constraint moves the velocities that nobody gave.
    let data = file("pair.csv", "");
    let (code, _, message) = hamel(&[
        "simulate",
        &pair,
        "--set",
        "r=1.7",
        "--initial",
        "y_dot=1",
        "--t-final",
        "2",
        "--samples",
        "21",
        "-o",
        &data,
    ]);
    assert_eq!(code, Some(0), "{message}");
    let answer =
        fit_json(&[&pair, "--data", &data, "--free", "r", "--initial", "y_dot=1", "--columns", "x,y"]);
    assert!((estimate(&answer, "r", "value") - 1.7).abs() < 1e-8, "{answer}");
    let start = |name: &str| answer["initial"][name].as_f64().unwrap();
    assert!((start("x_dot") - 1.7 * start("y_dot")).abs() < 1e-8, "{answer}");
}

/// A top with its mass centre at 0.42 m that turns with 6 rad/s, measured with errors of 0.01. Over all of the time the
/// sum of squares has a minimum at l = 0.66, where residuals are as large as the motion.
#[test]
fn a_long_motion_is_fitted_from_far_and_a_wrong_minimum_is_no_answer() {
    let out = file("far.csv", "");
    let motion =
        ["--set", "l=0.42", "--initial", "Omega3=6", "--t-final", "10", "--samples", "201", "-o", &out];
    let (code, _, message) = hamel(&[&["simulate", "heavy_top"][..], &motion].concat());
    assert_eq!(code, Some(0), "{message}");
    let exact = std::fs::read_to_string(&out).unwrap();
    let mut lines = exact.lines().map(|line| line.split(',').collect::<Vec<&str>>());
    let names = lines.next().unwrap();
    let columns = ["t", "Omega1", "Omega2", "Omega3"];
    let places = columns.map(|name| names.iter().position(|own| *own == name).unwrap());
    let (mut noise, mut text) = (Noise(2), format!("{}\n", columns.join(",")));
    for cells in lines {
        let [t, omega @ ..] = places.map(|place| cells[place].parse::<f64>().unwrap());
        let omega = omega.map(|x| format!("{:.5}", x + 0.01 * noise.next()));
        writeln!(text, "{t:?},{}", omega.join(",")).unwrap();
    }
    let data = file("far_noise.csv", &text);
    for start in [&[][..], &["--initial", "Omega3=4.5"], &["--set", "l=0.6", "--initial", "Omega3=5"]] {
        let answer = fit_json(&[&["heavy_top", "--data", &data, "--free", "l,Omega3"][..], start].concat());
        for (name, exact) in [("l", 0.42), ("Omega3", 6.0)] {
            let (value, error) = (estimate(&answer, name, "value"), estimate(&answer, name, "error"));
            assert!((value - exact).abs() < 5.0 * error && error < 0.01, "{start:?}, {name}: {answer}");
        }
        assert!(answer["explained"].as_f64().unwrap() > 0.999, "{answer}");
    }
    // A top that cannot be that one: its length is fixed where it is wrong.
    let wrong = ["heavy_top", "--data", &data, "--free", "Omega3", "--set", "l=0.66"];
    refused(&wrong, 1, &["of the spread of the data", "no error of measurement", "Omega3 = "]);
}

#[test]
fn a_motion_that_runs_away_is_no_number() {
    let text = "model fall { param k = 300; coordinate x in real; lagrangian = x_dot^2/2 + k^2*x^2/2; }";
    let model = file("fall.hamel", text);
    let data = file("fall.csv", "t,x\n0,1\n0.5,2\n1,3\n");
    let start = ["--initial", "x=1", "x_dot=300"];
    refused(
        &[&[&*model, "--data", &data, "--free", "k"][..], &start].concat(),
        1,
        &["x or its derivative runs away"],
    );
}

#[test]
fn figures_show_the_values_and_the_curve() {
    let model = file("figure.hamel", OSCILLATOR);
    let mut text = "t,x,x_dot\n".to_owned();
    motion(5.3, 11).iter().for_each(|(t, x)| writeln!(text, "{t:?},{x:?},").unwrap());
    text.push_str("3.5,,0.1\n");
    let (data, svg) = (file("figure.csv", &text), file("figure.svg", ""));
    let arguments = [&["fit", &*model, "--data", &data, "--free", "k", "-o", &svg][..], &START].concat();
    let (code, summary, message) = hamel(&arguments);
    assert_eq!(code, Some(0), "{message}");
    assert!(summary.contains(&format!("wrote {svg}")), "{summary}");
    let figure = std::fs::read_to_string(&svg).unwrap();
    // Eleven values, one of the other column, and one in each legend.
    assert_eq!(figure.matches("<circle").count(), 14, "{figure}");
    assert!(figure.contains("fitted") && figure.contains("measured") && figure.contains("k = "));
}

fn book() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().join("docs/book/data/top.csv")
}

/// The table of the book: a top whose mass centre is at 0.41 m and that starts with 2.3 rad/s about its third axis,
/// measured with errors of 0.02 rad/s and 0.005. The vertical direction was measured every other time.
#[test]
fn the_table_of_the_book_is_a_simulation_with_errors() {
    let out = file("book.csv", "");
    let motion =
        ["--set", "l=0.41", "--initial", "Omega3=2.3", "--t-final", "3", "--samples", "61", "-o", &out];
    let (code, _, message) =
        hamel(&[&["simulate", "heavy_top", "--via", "interpreter"][..], &motion].concat());
    assert_eq!(code, Some(0), "{message}");
    let exact = std::fs::read_to_string(&out).unwrap();
    let mut lines = exact.lines().map(|line| line.split(',').collect::<Vec<&str>>());
    let names = lines.next().unwrap();
    let place = |name: &str| names.iter().position(|own| *own == name).unwrap();
    let places = ["t", "Omega1", "Gamma3"].map(place);
    let (mut noise, mut text) = (Noise(1), "t,Omega1,Gamma3\n".to_owned());
    for (k, cells) in lines.enumerate() {
        let [t, omega, gamma] = places.map(|place| cells[place].parse::<f64>().unwrap());
        let errors = [0.02, 0.005].map(|sigma| sigma * noise.next());
        let gamma = if k % 2 == 0 { format!("{:.4}", gamma + errors[1]) } else { String::new() };
        writeln!(text, "{t:.2},{:.4},{gamma}", omega + errors[0]).unwrap();
    }
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        std::fs::write(book(), &text).unwrap();
    }
    let kept =
        std::fs::read_to_string(book()).unwrap_or_else(|e| panic!("{e}: UPDATE_EXPECT=1 writes the table"));
    assert_eq!(text, kept);
    let sigma = ["--sigma", "Omega1=0.02", "Gamma3=0.005", "--free", "l,Omega3"];
    let data = book();
    let arguments =
        [&["heavy_top", "--via", "interpreter", "--data", data.to_str().unwrap()][..], &sigma].concat();
    let answer = fit_json(&arguments);
    for (name, exact) in [("l", 0.41), ("Omega3", 2.3)] {
        let (value, error) = (estimate(&answer, name, "value"), estimate(&answer, name, "error"));
        // Four standard deviations, of data that never change.
        assert!((value - exact).abs() < 4.0 * error && error < 0.01 * exact, "{name}: {answer}");
    }
    let ratio = answer["sum_of_squares"].as_f64().unwrap() / answer["degrees_of_freedom"].as_f64().unwrap();
    assert!((0.75..1.3).contains(&ratio), "{answer}");
}

/// The motion of [`motion`] in other units and marks, and times in milliseconds from another origin.
#[test]
fn tables_of_instruments_are_read_in_the_units_of_the_model() {
    let text = OSCILLATOR.replace("    coordinate x", "    /// Place [m].\n    coordinate x");
    let model = file("instrument.hamel", &text);
    let mut table = "Logger;SN 12\nchannels;2\n\nt (ms);x [cm];room\n".to_owned();
    for (k, (t, x)) in motion(5.3, 40).into_iter().enumerate() {
        let x = if k == 7 { "NaN".to_owned() } else { format!("{:?}", 100.0 * x).replace('.', ",") };
        writeln!(table, "{};{x};warm", format!("{:?}", 1e3 * (t + 2.0)).replace('.', ",")).unwrap();
    }
    let data = file("instrument.csv", &table);
    let options = ["--t0", "2000", "--columns", "x", "--free", "k"];
    let arguments = [&[&*model, "--data", &data][..], &options, &START].concat();
    let answer = fit_json(&arguments);
    assert!((estimate(&answer, "k", "value") - 5.3).abs() < 1e-8, "{answer}");
    assert_eq!(answer["columns"]["x"]["values"], 39);
    let (_, summary, _) = hamel(&[&["fit"], &arguments[..]].concat());
    for told in ["t is in ms and was multiplied by 0.001", "x is in cm and was multiplied by 0.01"] {
        assert!(summary.contains(told), "{summary}");
    }
    // Words have no values, and a unit has to be one of the quantity.
    let words = ["--data", &data, "--free", "k", "--columns", "x=room", "--t0", "2000"];
    refused(&[&[&*model][..], &words].concat(), 2, &["has no value of x"]);
    let data = file("unit.csv", "t,x [kg]\n0,1\n1,2\n");
    refused(
        &[&*model, "--data", &data, "--free", "k"],
        2,
        &["is in kg, which is no multiple of m, the unit of x"],
    );
    let plain = file("plain.hamel", OSCILLATOR);
    let data = file("unknown_unit.csv", "t,x [mm]\n0,1\n1,2\n");
    refused(
        &[&plain, "--data", &data, "--free", "k"],
        2,
        &["is in mm, and no unit of x is known", "/// Place [m]."],
    );
}

/// Inputs from a table are in the units of the model as well: a constant push in kilonewtons and milliseconds.
#[test]
fn tables_of_inputs_and_starts_have_units() {
    let text = "model cart {
        /// Mass [kg].
        param m = 2;
        /// Force [N].
        input u = 0;
        /// Place [m].
        coordinate x in real;
        lagrangian = m*x_dot^2/2;
        force x_dot = u;
        initial x = 0;
        initial x_dot = 0;
    }";
    let model = file("cart.hamel", text);
    let table = file("push.csv", "# a push\nt,u\nms,kN\n0,0.004\n1000,0.004\n");
    let out = file("cart.csv", "");
    let scene = ["--scene", "controlled", "--input", &table];
    let (code, _, message) = hamel(
        &[&["simulate", &*model][..], &scene, &["--t-final", "1", "--samples", "2", "-o", &out]].concat(),
    );
    assert_eq!(code, Some(0), "{message}");
    let last = std::fs::read_to_string(&out).unwrap().lines().last().unwrap().to_owned();
    let x: f64 = last.split(',').nth(1).unwrap().parse().unwrap();
    assert!((x - 1.0).abs() < 1e-9, "{last}");
    let lines = file("starts.csv", "m [g]\n500\n");
    let (code, _, message) = hamel(&["ensemble", &model, "--table", &lines, "--t-final", "1", "-o", &out]);
    assert_eq!(code, Some(0), "{message}");
    let text = std::fs::read_to_string(&out).unwrap();
    assert!(text.contains("0.5"), "{text}");
}

#[test]
fn bounds_hold_a_value_without_an_error_of_its_own() {
    let model = file("bounds.hamel", OSCILLATOR);
    let mut text = "t,x\n".to_owned();
    motion(5.3, 40).iter().for_each(|(t, x)| writeln!(text, "{t:?},{x:?}").unwrap());
    let data = file("bounds.csv", &text);
    let with = |bounds: &'static str| {
        let options = ["--free", "k,x_dot", "--initial", "x=0.3", "--bounds", bounds];
        [&[&*model, "--data", &data][..], &options].concat()
    };
    let answer = fit_json(&with("k=1..5"));
    assert_eq!(estimate(&answer, "k", "value"), 5.0);
    assert!(
        answer["estimates"]["k"]["error"].is_null() && estimate(&answer, "x_dot", "error") > 0.0,
        "{answer}"
    );
    assert_eq!(answer["degrees_of_freedom"], 39);
    let (_, summary, _) = hamel(&[&["fit"], &with("k=1..5")[..]].concat());
    assert!(summary.contains("at its bound"), "{summary}");
    // Everything is held.
    let both =
        ["--free", "k,x_dot", "--initial", "x=0.3", "x_dot=-0.3", "--bounds", "k=1..5", "x_dot=-0.4..0"];
    let answer = fit_json(&[&[&*model, "--data", &data][..], &both].concat());
    assert!(answer["estimates"]["x_dot"]["error"].is_null(), "{answer}");
    assert_eq!((estimate(&answer, "x_dot", "value"), &answer["degrees_of_freedom"]), (-0.4, &40.into()));
    // An interval that has the minimum inside changes nothing.
    let answer = fit_json(&with("k=..100"));
    assert!((estimate(&answer, "k", "value") - 5.3).abs() < 1e-8, "{answer}");
    refused(&with("k=5..6"), 2, &["keeps k within 5.0..6.0", "k = 4.0", "--set"]);
    refused(&with("k=6..5"), 2, &["the interval 6..5 is empty"]);
    refused(&with("m=1..2"), 2, &["--bounds has no free name `m`", "k, x_dot"]);
}

/// With initial values alone free, the problem is linear: a prior adds `1/s^2` to the normal equations, and its mean.
#[test]
fn priors_are_measurements_of_their_own() {
    let model = file("prior.hamel", OSCILLATOR);
    let (mut noise, sigma, mut text) = (Noise(5), 0.02, "t,x\n".to_owned());
    let mut values = Vec::new();
    for (t, x) in motion(4.0, 20) {
        let x = x + sigma * noise.next();
        writeln!(text, "{t:?},{x:?}").unwrap();
        values.push([(2.0 * t).cos(), (2.0 * t).sin() / 2.0, x]);
    }
    let data = file("prior.csv", &text);
    let options = ["--free", "x,x_dot", "--prior", "x_dot=-0.45+-0.01"];
    let arguments = [&[&*model, "--data", &data][..], &options].concat();
    refused(&arguments, 2, &["a prior counts beside errors of the data", "--sigma"]);
    let answer = fit_json(&[&arguments[..], &["--sigma", "x=0.02"]].concat());
    let sum = |i: usize, j: usize| values.iter().map(|v| v[i] * v[j]).sum::<f64>() / (sigma * sigma);
    let (a, b, c) = (sum(0, 0), sum(0, 1), sum(1, 1) + 1e4);
    let (f, g) = (sum(0, 2), sum(1, 2) - 0.45e4);
    let determinant = a * c - b * b;
    let expected = [
        ("x", (c * f - b * g) / determinant, (c / determinant).sqrt()),
        ("x_dot", (a * g - b * f) / determinant, (a / determinant).sqrt()),
    ];
    for (name, value, error) in expected {
        assert!((estimate(&answer, name, "value") - value).abs() < 1e-8, "{name}: {answer} {value}");
        assert!((estimate(&answer, name, "error") / error - 1.0).abs() < 1e-7, "{name}: {answer} {error}");
    }
    assert_eq!(answer["degrees_of_freedom"], 19);
    assert!(
        answer["fits"] == true && answer["chi_square"]["probability"].as_f64().unwrap() > 1e-3,
        "{answer}"
    );
    // Errors a fifth as large as they are: said, and counted against the fit.
    let small = [&[&*model, "--data", &data, "--free", "x,x_dot", "--sigma", "x=0.004"][..]].concat();
    let answer = fit_json(&small);
    assert_eq!(answer["fits"], false, "{answer}");
    let (_, summary, _) = hamel(&[&["fit"], &small[..]].concat());
    assert!(summary.contains("the residuals are larger than --sigma says"), "{summary}");
}

/// Of a fast oscillation, measured late, the sum of squares has a minimum at every other number of turns.
#[test]
fn further_starts_find_the_minimum_that_one_start_misses() {
    let model = file("restarts.hamel", OSCILLATOR);
    let mut text = "t,x\n".to_owned();
    let late = motion(400.0, 200).into_iter().filter(|(t, _)| *t > 2.0);
    late.for_each(|(t, x)| writeln!(text, "{t:?},{x:?}").unwrap());
    let data = file("restarts.csv", &text);
    let one = [&[&*model, "--data", &data, "--free", "k", "--bounds", "k=0.1..1000"][..], &START].concat();
    refused(&one, 1, &["of the spread of the data"]);
    let answer = fit_json(&[&one[..], &["--restarts", "20"]].concat());
    assert!((estimate(&answer, "k", "value") - 400.0).abs() < 1e-6, "{answer}");
    let starts = answer["starts"].as_array().unwrap();
    assert_eq!(starts.len(), 21);
    let (_, summary, _) = hamel(&[&["fit"], &one[..], &["--restarts", "20"]].concat());
    assert!(summary.contains("of 21 starts"), "{summary}");
}

/// Two pendulums that hang from each other, over a time in which neighbouring motions part a hundredfold.
const PENDULUMS: &str = "model pendulums {
    param l = 1 where l > 0;
    param m = 1 where m > 0;
    coordinate a in angle;
    coordinate b in angle;
    let v = [a_dot*cos(a), a_dot*sin(a)];
    let w = v + [l*b_dot*cos(b), l*b_dot*sin(b)];
    lagrangian = dot(v, v)/2 + m*dot(w, w)/2 + 9.81*((1 + m)*cos(a) + m*l*cos(b));
    initial a = 2;
    initial b = 2.5;
    initial a_dot = 0;
    initial b_dot = 0;
}";

#[test]
fn pieces_that_start_on_their_own_find_a_chaotic_motion() {
    let model = file("pendulums.hamel", PENDULUMS);
    let out = file("pendulums.csv", "");
    let motion = ["--set", "l=0.8", "m=1.3", "--t-final", "4", "--samples", "81", "-o", &out];
    let (code, _, message) = hamel(&[&["simulate", &*model][..], &motion].concat());
    assert_eq!(code, Some(0), "{message}");
    let options = ["--free", "l,m", "--columns", "a,b", "--segments", "8", "--rtol", "1e-8"];
    let answer = fit_json(&[&[&*model, "--data", &out][..], &options].concat());
    for (name, exact) in [("l", 0.8), ("m", 1.3)] {
        assert!((estimate(&answer, name, "value") - exact).abs() < 1e-5, "{answer}");
    }
    let pair = file("restricted.hamel", PAIR);
    let data = file("restricted.csv", "t,x\n0,0.3\n1,0.1\n2,0.2\n");
    refused(&[&pair, "--data", &data, "--free", "x", "--segments", "2"], 2, &["segments start at states"]);
}

/// The state has the momentum, and the start depends on parameters that are free: the mass, and one in a formula.
#[test]
fn a_start_moves_with_the_parameters_that_are_fitted() {
    let text = "model carried {
        param m = 1 where m > 0;
        param k = 3;
        param a = 0.2;
        coordinate x in real;
        momentum p of x_dot;
        carry p;
        lagrangian = m*x_dot^2/2 - k*x^2/2;
        initial x = a^2;
        initial x_dot = 1;
    }";
    let model = file("carried.hamel", text);
    let (m, k, a) = (1.3_f64, 2.5_f64, 0.8_f64);
    let w = (k / m).sqrt();
    let mut data = "t,x,p\n".to_owned();
    for t in (0..30).map(|i| 0.1 * f64::from(i)) {
        let (s, c) = (w * t).sin_cos();
        let (x, v) = (a * a * c + s / w, c - a * a * w * s);
        writeln!(data, "{t:?},{x:?},{:?}", m * v).unwrap();
    }
    let data = file("carried.csv", &data);
    let answer = fit_json(&[&model, "--data", &data, "--free", "m,k,a"]);
    let pieces = fit_json(&[&model, "--data", &data, "--free", "m,k,a", "--segments", "3"]);
    for (name, expected) in [("m", m), ("k", k), ("a", a)] {
        assert!((estimate(&answer, name, "value") - expected).abs() < 1e-7, "{answer}");
        assert!((estimate(&pieces, name, "value") - expected).abs() < 1e-7, "{pieces}");
    }
    // The start of the answer is the one that `simulate` has with these parameters.
    assert!((answer["initial"]["x"].as_f64().unwrap() - a * a).abs() < 1e-7, "{answer}");
    assert!((answer["initial"]["p"].as_f64().unwrap() - m).abs() < 1e-7, "{answer}");
}
