//! Motions with noise on the command line: paths, grids, orders, ensembles, refusals.

use std::path::Path;
use std::process::Output;

use serde_json::{Value, json};

use crate::common::program;

/// Kubo's oscillator, of which every moment is known.
const KUBO: &str = "model kubo {
    param omega = 1; param sigma = 0.5;
    coordinate x in real;
    momentum p of x_dot;
    hamiltonian = omega*(p^2 + x^2)/2;
    noise W: sigma*(p^2 + x^2)/2;
    initial x = 1;
}";

fn top() -> String {
    concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/book/noisy_top.hamel").to_owned()
}

fn file(name: &str, text: &str) -> String {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("noise_{name}"));
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

fn run(arguments: &[&str], input: &str) -> Output {
    program::output(&mut program::command(arguments), input)
}

fn done(arguments: &[&str]) -> String {
    let out = run(arguments, "");
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

fn refused(arguments: &[&str], expected: &str) {
    let out = run(arguments, "");
    assert!(!out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stdout));
    let text = String::from_utf8(out.stderr).unwrap();
    assert!(text.contains(expected), "{text}");
}

fn simulated(model: &str, request: &str) -> Value {
    let out = run(&["simulate", model, "--scene", "stochastic", "--json"], request);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

/// The last line of an ensemble's table for each trajectory: its state.
fn rows(table: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(table).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let n = names.iter().position(|name| *name == "energy").unwrap();
    lines.map(|line| line.split(',').take(n).skip(2).map(|x| x.parse().unwrap()).collect()).collect()
}

fn state(answer: &Value, names: &[&str]) -> Vec<f64> {
    names.iter().map(|name| answer["final"][*name].as_f64().unwrap()).collect()
}

const STATE: [&str; 6] = ["Pi1", "Pi2", "Pi3", "Gamma1", "Gamma2", "Gamma3"];

#[test]
fn a_trajectory_of_an_ensemble_is_a_path_of_its_own() {
    let (top, table) = (top(), file("paths.csv", ""));
    let asked = ["--noise-seed", "9", "--noise-path", "3", "--step", "0.01", "--t-final", "2"];
    let ensemble = |threads: &str, via: &str| {
        let more = ["--count", "5", "--threads", threads, "--via", via, "-o", &table];
        done(&[&["ensemble", &*top][..], &asked, &more].concat());
        rows(&table)
    };
    let found = ensemble("2", "jit");
    assert_eq!(found, ensemble("1", "interpreter"));
    for (k, row) in found.iter().enumerate() {
        let request = format!(
            "{{\"initial\": {{}}, \"t_final\": 2, \"step\": 0.01, \"noise_seed\": 9, \"noise_path\": {}}}",
            3 + k
        );
        assert_eq!(state(&simulated(&top, &request), &STATE), *row);
    }
    assert!(found.windows(2).all(|pair| pair[0] != pair[1]));
}

/// Both Casimirs are quadratic: the midpoint rule keeps them on every path, to the rounding of a thousand steps. The
/// energy moves.
#[test]
fn casimirs_stay_on_every_path() {
    for path in 0..4 {
        let request = format!(
            "{{\"initial\": {{}}, \"t_final\": 10, \"step\": 0.01, \"noise_path\": {path}, \"samples\": 101}}"
        );
        let answer = simulated(&top(), &request);
        let casimirs = |at: &Value| {
            let x = |name: &str| at[name].as_f64().unwrap();
            let vertical = (1..4).map(|k| x(&format!("Pi{k}")) * x(&format!("Gamma{k}"))).sum::<f64>();
            [vertical, (1..4).map(|k| x(&format!("Gamma{k}")).powi(2)).sum::<f64>()]
        };
        for sample in answer["samples"].as_array().unwrap() {
            let [vertical, length] = casimirs(&sample[1]);
            assert!((vertical - 2.04).abs() < 1e-12 && (length - 1.0).abs() < 1e-12, "{vertical} {length}");
        }
        assert!(answer["energy_drift"].as_f64().unwrap() > 1e-3);
    }
}

/// The mean of errors at the time one, for steps from 1/16 to 1/128 on the grid 1/2048, has the order of the step where
/// the fields of the noise commute, and of its root where they do not.
#[test]
fn strong_orders() {
    let table = file("orders.csv", "");
    // On the full energy of the body, a field that is not affine makes the midpoint rule inexact for one noise.
    let text = |noise: &str| {
        let momenta = "momentum Pi in so(3); hamiltonian = Pi1^2/2.6 + Pi2^2/3.4 + Pi3^2/1.2;";
        format!("model body {{ {momenta} {noise} initial Pi = [0.3, 0.2, 1.4]; }}")
    };
    let order = |name: &str, noise: &str| {
        let model = file(name, &text(noise));
        let at = |step: f64| {
            let step = step.to_string();
            let asked = ["--scene", "stochastic", "--count", "60", "--noise-step", "0.00048828125"];
            let more = ["--step", &step, "--t-final", "1", "--via", "jit", "-o", &table];
            done(&[&["ensemble", &*model][..], &asked, &more].concat());
            rows(&table)
        };
        let exact = at(1.0 / 2048.0);
        let error = |step: f64| {
            let apart = |(a, b): (&Vec<f64>, &Vec<f64>)| {
                a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
            };
            at(step).iter().zip(&exact).map(apart).sum::<f64>() / exact.len() as f64
        };
        (error(1.0 / 16.0) / error(1.0 / 128.0)).log2() / 3.0
    };
    let one = order("one.hamel", "noise W: Pi1^2/3 + Pi2*Pi3/4;");
    assert!((0.8..1.3).contains(&one), "{one}");
    let two = order("two.hamel", "noise V: 0.6*Pi1; noise W: 0.6*Pi2;");
    assert!((0.35..0.7).contains(&two), "{two}");
}

/// `E[x + i p] = exp((-i omega - sigma^2/2) t)`, within five standard deviations of the mean of the paths, which the
/// error of the step, of order `step`, is far below.
#[test]
fn the_mean_of_kubos_oscillator_is_the_exact_one() {
    let (model, table) = (file("kubo.hamel", KUBO), file("kubo.csv", ""));
    let n = 2000;
    let count = n.to_string();
    let asked = ["--noise-seed", "1", "--count", &count, "--step", "0.02", "--t-final", "1", "-o", &table];
    done(&[&["ensemble", &*model][..], &asked].concat());
    let found = rows(&table);
    let (damped, root) = ((-0.125_f64).exp(), (n as f64).sqrt());
    for (k, exact) in [damped * 1.0_f64.cos(), -damped * 1.0_f64.sin()].into_iter().enumerate() {
        let mean = found.iter().map(|row| row[k]).sum::<f64>() / n as f64;
        let variance = found.iter().map(|row| (row[k] - mean).powi(2)).sum::<f64>() / n as f64;
        assert!((mean - exact).abs() < 5.0 * variance.sqrt() / root, "{mean} and {exact}");
    }
    // Every path stays on the circle.
    assert!(found.iter().all(|row| (row[0].hypot(row[1]) - 1.0).abs() < 1e-13));
}

/// Noise of a velocity with friction, as in Langevin's equation: the variance of the velocity is that of Ornstein and
/// Uhlenbeck's process, and the scene without noise has none.
#[test]
fn noise_that_a_model_mentions() {
    let text = "model langevin {
        param g = 1.5; param s = 0.8;
        coordinate x in real;
        lagrangian = x_dot^2/2;
        noise W;
        force x_dot = -g*x_dot + s*W;
    }";
    let (model, table) = (file("langevin.hamel", text), file("langevin.csv", ""));
    let asked =
        ["--scene", "stochastic", "--count", "2000", "--step", "0.02", "--t-final", "2", "-o", &table];
    done(&[&["ensemble", &*model][..], &asked].concat());
    let found = rows(&table);
    let variance = found.iter().map(|row| row[1].powi(2)).sum::<f64>() / 2000.0;
    let exact = 0.64 / 3.0 * (1.0 - (-6.0_f64).exp());
    assert!((variance / exact - 1.0).abs() < 5.0 * (2.0_f64 / 2000.0).sqrt(), "{variance} and {exact}");
    let still = done(&["simulate", &model, "--t-final", "2"]);
    assert!(!still.contains("midpoint"), "{still}");
}

/// The attitude turns with the noise: the vertical of the body stays that of space.
#[test]
fn noise_moves_the_group() {
    let initial = json!({"Pi1": 0.3, "Pi2": 0.2, "Pi3": 2.4, "Gamma1": 0, "Gamma2": 0.6, "Gamma3": 0.8,
                         "qw": 1, "qx": 0, "qy": 0, "qz": 0});
    let request =
        json!({"initial": initial, "t_final": 5, "step": 0.01, "noise_seed": 2, "method": "gauss8"})
            .to_string();
    let out = run(&["simulate", &top(), "--scene", "in_space", "--json"], &request);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let answer: Value = serde_json::from_slice(&out.stdout).unwrap();
    let q = state(&answer, &["qw", "qx", "qy", "qz"]);
    let gamma = state(&answer, &STATE[3..]);
    let (w, v) = (q[0], [q[1], q[2], q[3]]);
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    };
    let g = [gamma[0], gamma[1], gamma[2]];
    let first = cross(v, g);
    let second = cross(v, [0, 1, 2].map(|k| first[k] + w * g[k]));
    // From the identity, where the vertical is `[0, 0.6, 0.8]`; noise is constant in a step, which gauss8 then follows.
    for (k, space) in [0.0, 0.6, 0.8].into_iter().enumerate() {
        assert!((g[k] + 2.0 * second[k] - space).abs() < 1e-9, "{k}: {}", g[k] + 2.0 * second[k]);
    }
}

#[test]
fn what_noise_has_no_answer_for_is_refused() {
    let (top, kubo) = (top(), file("refused.hamel", KUBO));
    let noisy = |more: &[&str], expected: &str| {
        refused(&[&["simulate", &*top, "--scene", "stochastic"][..], more].concat(), expected);
    };
    noisy(&[], "give a step and no tolerances");
    noisy(&["--step", "0.01", "--method", "rk4"], "evaluates the rates at the ends of steps");
    noisy(&["--step", "0.01", "--method", "dop853"], "evaluates the rates at the ends of steps");
    noisy(&["--step", "0.01", "--t-final", "0.505"], "the time 0.505 is no multiple of the step 0.01");
    noisy(&["--step", "0.01", "--noise-step", "0.007"], "no whole part and no multiple");
    noisy(&["--step", "0.01", "--section", "Pi1"], "no event is watched for");
    noisy(&["--step", "0.01", "--sensitivity", "k"], "whose paths have no derivatives");
    noisy(&["--step", "0.01", "--reconstruct"], "one that takes the noises and wants `reconstruction`");
    noisy(&["--step", "0.01", "--input", "W1=1"], "`W1` is driven, which is a noise");
    let data = file("data.csv", "t,x\n0,1\n0.5,0.8\n1,0.5\n");
    let fit = ["fit", &*kubo, "--scene", "stochastic", "--data", &*data, "--free", "omega"];
    refused(&fit, "has noise, whose paths no fit follows");
    let asked = |noise: Value| {
        let mut request = json!({"initial": {"x": 1, "p": 0}, "t_final": 1, "step": 0.1});
        request.as_object_mut().unwrap().extend(noise.as_object().unwrap().clone());
        let out = run(&["simulate", &kubo, "--scene", "stochastic", "--json"], &request.to_string());
        assert!(!out.status.success());
        String::from_utf8(out.stderr).unwrap()
    };
    let told = asked(json!({"noise_path": 4_294_967_296_u64}));
    assert!(
        told.contains("noise_path is 4294967296, but the largest number of a path is 4294967295"),
        "{told}"
    );
    for step in [0.0, -0.1] {
        let told = asked(json!({"noise_step": step}));
        assert!(told.contains("have to be above zero"), "{told}");
    }
    refused(&["simulate", "heavy_top", "--noise-seed", "2"], "has no noise");
    let table = file("refused.csv", "");
    refused(&["ensemble", "heavy_top", "--count", "3", "-o", &table], "nothing is drawn");
    let swept =
        ["ensemble", &kubo, "--scene", "stochastic", "--sweep", "W=0..1:3", "--step", "0.01", "-o", &table];
    refused(&swept, "`W`");
    let particle = file(
        "particle.hamel",
        "model particle { coordinate x in real; lagrangian = x_dot^2; noise W: x^3; }",
    );
    refused(&["reduce", &particle], "noise");
    let text = format!(
        "model quotient {{ coordinate x in real; lagrangian = x_dot^2; noise W: x^3; reduces \"{particle}\" {{}} }}"
    );
    refused(&["check", &file("quotient.hamel", &text)], "has noise, of which the map says nothing");
    let out =
        run(&["simulate", "heavy_top", "--json"], "{\"initial\": {}, \"t_final\": 1, \"noise_seed\": 3}");
    assert!(String::from_utf8_lossy(&out.stderr).contains("has no noise"));
}

/// A path of one's own comes from a table of inputs that are held.
#[test]
fn increments_of_ones_own_come_from_a_table() {
    let model = file("own.hamel", KUBO);
    let table = file("own.csv", "t,W\n0,3\n0.5,-1\n1,0\n");
    let asked = ["--step", "0.5", "--t-final", "1"];
    let held = ["--input", &*table, "--interpolation", "hold", "--method", "gauss8"];
    let text = done(&[&["simulate", &*model, "--scene", "stochastic"][..], &held, &asked].concat());
    // The angle is the integral of `1 + W/2`.
    let angle = 1.0_f64 + (3.0 - 1.0) / 4.0;
    let line = text.lines().find(|line| line.trim_start().starts_with("x ")).unwrap();
    let x: f64 = line.split_whitespace().last().unwrap().parse().unwrap();
    assert!((x - angle.cos()).abs() < 1e-6, "{text}");
}
