//! Comparison of the program's answers with reference values made without any reduced theory.

pub(crate) mod event_table;
pub(crate) mod fmus;
pub(crate) mod pages;
pub(crate) mod program;

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use serde_json::{Map, Value, json};

/// Error of a derivative, relative to the largest component of that point's derivative, and of an energy.
const POINT: f64 = 1e-13;
/// Points at which terms cancel in the right-hand side, so that the derivative is known less well, with the bound
/// there: near an equilibrium, and near the flat disk, where terms grow like `1/theta^2`.
const CANCELLING: [(&str, usize, f64); 3] =
    [("chaplygin_ball", 9, 1e-12), ("euler_disk", 7, 4e-9), ("euler_disk", 8, 2e-11)];
/// Error of a final state, relative to its norm, at `rtol = atol = 1e-12`.
const MOTION: f64 = 1e-9;

type Numbers = BTreeMap<String, f64>;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).parent().expect("the workspace").to_owned()
}

/// Runs the program and returns its answer.
fn hamel(arguments: &[&str], input: &str) -> Value {
    let mut child = Command::new(env!("CARGO_BIN_EXE_hamel"))
        .env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(input.as_bytes()).unwrap();
    let out = child.wait_with_output().unwrap();
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

fn file(model: &str) -> Value {
    let path = root().join("tests/reference").join(format!("{model}.json"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// A decimal string, or a number, as the nearest double.
fn number(value: &Value) -> f64 {
    match value {
        Value::String(text) => text.parse().unwrap_or_else(|e| panic!("{text}: {e}")),
        other => other.as_f64().unwrap_or_else(|| panic!("{other} is no number")),
    }
}

fn numbers(value: &Value) -> Numbers {
    let object = value.as_object().unwrap_or_else(|| panic!("{value} is no object"));
    object.iter().map(|(name, value)| (name.clone(), number(value))).collect()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().map(Vec::as_slice).unwrap_or_default()
}

/// Models with both a model file and reference values.
pub(crate) fn models() -> Vec<String> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(root().join("tests/reference")).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        let has_spec = root().join("models/specs").join(format!("{name}.hamel")).is_file();
        if path.extension().is_some_and(|e| e == "json") && has_spec {
            names.push(name);
        }
    }
    names.sort();
    names
}

/// Compares `eval` at every point of every case, and returns the number of points.
///
/// Components are compared to 1e-13 of the largest one of their point: a test with tracked sizes of terms, component by
/// component and also where they cancel, is in the workspace's `tests/tests/reference.rs`; here the interface is shown
/// to lose no digits.
pub(crate) fn check_points(model: &str, via: &str) -> usize {
    let mut n_points = 0;
    for case in list(&file(model)["cases"]) {
        let points = list(&case["points"]);
        let states: Vec<Numbers> = points.iter().map(|p| numbers(&p["state"])).collect();
        let request = json!({"params": numbers(&case["params"]), "states": states}).to_string();
        let answer = hamel(&["eval", model, "--via", via], &request);
        let names: Vec<&str> = list(&answer["state"]).iter().map(|n| n.as_str().unwrap()).collect();
        assert_eq!(list(&answer["derivatives"]).len(), points.len(), "{model}");
        for (k, point) in points.iter().enumerate() {
            let expected = numbers(&point["derivative"]);
            assert_eq!(expected.len(), names.len(), "{model}: {names:?}");
            let size = expected.values().fold(0.0_f64, |max, x| max.max(x.abs()));
            let listed = CANCELLING.iter().find(|(name, at, _)| *name == model && *at == k);
            let bound = listed.map_or(POINT, |(_, _, bound)| *bound);
            for (name, found) in names.iter().zip(list(&answer["derivatives"][k])) {
                let error = (number(found) - expected[*name]).abs();
                assert!(error <= bound * size, "{model} point {k}, {name}: error {error:e} of {size:e}");
            }
            if !point["energy"].is_null() {
                let (found, expected) = (number(&answer["energy"][k]), number(&point["energy"]));
                let error = (found - expected).abs();
                assert!(error <= POINT * expected.abs(), "{model} point {k}: energy {found} for {expected}");
            }
        }
        n_points += points.len();
    }
    n_points
}

/// Names of the coordinates that a model reconstructs, as `list --json` shows them.
fn group_coordinates(model: &str) -> Vec<String> {
    let listed = hamel(&["list", "--json", model], "");
    let state = |scene: &str| -> Vec<String> {
        let found = list(&listed[0]["scenes"]).iter().find(|s| s["scene"] == scene);
        found.map_or_else(Vec::new, |s| serde_json::from_value(s["state"].clone()).unwrap())
    };
    let own = state("default");
    state("reconstruction").into_iter().filter(|name| !own.contains(name)).collect()
}

/// What was compared of a model's trajectories.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Compared {
    /// Trajectories.
    pub(crate) motions: usize,
    /// Those of them in whose files the group has coordinates.
    pub(crate) of_group: usize,
    /// Those of them whose group coordinates were compared as well.
    pub(crate) reconstructions: usize,
}

/// Compares the ends of all trajectories, reconstructed where the reference has the same coordinates.
pub(crate) fn check_motions(model: &str, via: &str) -> Compared {
    let group = group_coordinates(model);
    let mut compared = Compared::default();
    for trajectory in list(&file(model)["trajectories"]) {
        let mut request = Map::new();
        request.insert("params".into(), json!(numbers(&trajectory["params"])));
        request.insert("initial".into(), json!(numbers(&trajectory["initial"])));
        request.insert("t_final".into(), json!(number(&trajectory["t_final"])));
        request.insert("method".into(), json!("dop853"));
        request.insert("rtol".into(), json!(1e-12));
        request.insert("atol".into(), json!(1e-12));
        let reconstruction = &trajectory["reconstruction"];
        let start = reconstruction["initial"].is_object().then(|| numbers(&reconstruction["initial"]));
        let start = start.filter(|s| s.len() == group.len() && group.iter().all(|n| s.contains_key(n)));
        if let Some(start) = &start {
            request.insert("reconstruct".into(), json!(start));
        }
        let answer = hamel(&["simulate", model, "--json", "--via", via], &Value::from(request).to_string());
        assert_near(model, &numbers(&answer["final"]), &numbers(&trajectory["final"]));
        assert_eq!(start.is_some(), !answer["reconstruction"].is_null());
        compared.motions += 1;
        compared.of_group += usize::from(!reconstruction.is_null());
        if start.is_some() {
            let mut found = numbers(&answer["reconstruction"]);
            let expected = numbers(&reconstruction["final"]);
            align_quaternion(&mut found, &expected);
            assert_near(model, &found, &expected);
            compared.reconstructions += 1;
        }
    }
    compared
}

/// A quaternion and its negative are the same attitude.
fn align_quaternion(found: &mut Numbers, expected: &Numbers) {
    const NAMES: [&str; 4] = ["qw", "qx", "qy", "qz"];
    if NAMES.iter().all(|name| expected.contains_key(*name)) {
        let product: f64 = NAMES.iter().map(|name| found[*name] * expected[*name]).sum();
        for name in NAMES {
            *found.get_mut(name).unwrap() *= product.signum();
        }
    }
}

fn assert_near(model: &str, found: &Numbers, expected: &Numbers) {
    assert!(found.keys().eq(expected.keys()), "{model}: {found:?} for {expected:?}");
    let norm = |square: f64| square.sqrt();
    let size = norm(expected.values().map(|x| x * x).sum());
    let error = norm(found.iter().map(|(name, x)| (x - expected[name]).powi(2)).sum());
    assert!(error <= MOTION * size, "{model}: error {error:e} of {size:e}\n{found:?}\n{expected:?}");
}
