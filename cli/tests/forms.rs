//! States given by velocities where a scene carries momenta, and by momenta where it carries velocities.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::process::{Command, Stdio};
use std::sync::Arc;

use hamel::commands::eval::eval_text;
use hamel_codegen::scene::Prior;
use hamel_codegen::spec;
use hamel_run::bars::simulate_with_bar;
use hamel_run::cache::Cache;
use hamel_run::dynamics::Factory as _;
use hamel_run::error::Error;
use hamel_run::evaluate::{EvalRequest, eval};
use hamel_run::forms::Forms;
use hamel_run::interpreted::{self, Built};
use hamel_run::model::Checked;
use hamel_run::simulation::SimulateRequest;
use hamel_run::start::{self, Chosen};
use serde_json::{Value, json};

/// A top that names its angular momentum, with a scene that carries it.
const TOP: &str = "model top {
    param I: diagonal(3) = [2, 1.5, 0.8] where I1 > 0, I2 > 0, I3 > 0;
    velocity Omega in so(3);
    momentum Pi of Omega;
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = 1/2*dot(Omega, I*Omega) - Gamma3;
    initial Omega = [1, 2, 3];
    scene momenta { carry Pi; want rhs, energy; }
}";

/// Two coupled coordinates, both with momenta, and an initial value of one of each kind.
const COUPLED: &str = "model coupled {
    coordinate x: vector(2) in real;
    momentum p1 of x1_dot;
    momentum p2 of x2_dot;
    lagrangian = x1_dot^2 + x1_dot*x2_dot + (1 + x1^2)*x2_dot^2 - x1^2 - x2^2;
    initial x = [0.5, -0.25];
    initial p1 = 1;
    initial x2_dot = 2;
    scene first { carry p1; want rhs, energy; }
    scene both { carry p1, p2; want rhs, energy; }
}";

/// A velocity on a cone, which multipliers keep it on.
const CONE: &str = "model cone {
    velocity v in R^3;
    momentum p of v;
    lagrangian = v1^2 + v2^2/2 + v3^2;
    constraint v1^2 + v2^2 = v3^2;
    carry p;
}";

/// Stages on a base, with a metric that couples them, a connection of their own and a momentum of the ideal.
const STAGED: &str = "model staged {
    param a = 2 where a > 0;
    coordinate x in real;
    velocity Omega, V in se(3);
    momentum P of V;
    lagrangian = dot(Omega, Omega)/2 + a/2*dot(V, V) + 1/4*dot(Omega, V) + x_dot^2*(1 + x^2)/2;
    inner_product = lagrangian;
    stage n0;
    stage n1 = ideal(V) { connection V = [x*x_dot, 0, x_dot]; }
    initial x = 0.2; initial x_dot = 0.5; initial Omega = [1, 0.2, 0.3]; initial V = [0.1, 0.4, -0.2];
    momentum beta of stages;
    scene levels { carry stages; want rhs, velocities; }
    scene mixed { carry stages, beta_n1_2; want rhs, velocities; }
    scene momenta { carry P; want rhs, velocities; }
    scene chosen { formulation auto(state); want rhs, velocities; }
}";

/// A constraint between the base and both levels: by the model's velocities and by those along the levels others are
/// independent.
const ROLLING: &str = "model rolling {
    coordinate x in real;
    velocity q, p, z in heisenberg(1);
    lagrangian = (q^2 + p^2 + z^2 + q*z)/2 + x_dot^2*(1 + x^2)/2;
    constraint x_dot = z + q/2;
    independent q, p, z;
    stage plane;
    stage centre = ideal(z);
    inner_product = lagrangian;
    initial x = 0.3; initial q = 1; initial p = -2; initial z = 0.5;
    scene levels { carry stages; want rhs, velocities; }
}";

fn model(text: &str) -> Arc<Checked> {
    let model = spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    Arc::new(Checked::new(model, Cache::none()))
}

fn built(text: &str, scene: &str) -> (Arc<Checked>, Built) {
    let model = model(text);
    let built = interpreted::build(&model, scene).unwrap_or_else(|e| panic!("{e}"));
    (model, built)
}

fn states(text: &str, scene: &str, state: &Value) -> Result<Vec<f64>, Error> {
    let (model, scene) = built(text, scene);
    let forms = Forms::of(&model, scene.info()).unwrap();
    let request = json!({"states": [state]}).to_string();
    Ok(EvalRequest::parse_in(&request, scene.info(), &forms)?.states.remove(0))
}

#[test]
fn a_state_of_momenta_may_be_given_by_velocities_and_the_other_way_round() {
    let by_velocities = json!({"Omega1": 1, "Omega2": 2, "Omega3": 3, "Gamma1": 0, "Gamma2": 0, "Gamma3": 1});
    let by_momenta =
        json!({"Pi1": 2, "Pi2": 3, "Pi3": 2.4000000000000004, "Gamma1": 0, "Gamma2": 0, "Gamma3": 1});
    let momenta = [2.0, 3.0, 2.4000000000000004, 0.0, 0.0, 1.0];
    assert_eq!(states(TOP, "momenta", &by_velocities).unwrap(), momenta);
    assert_eq!(states(TOP, "momenta", &by_momenta).unwrap(), momenta);
    assert_eq!(states(TOP, "default", &by_velocities).unwrap(), [1.0, 2.0, 3.0, 0.0, 0.0, 1.0]);
    let back = states(TOP, "default", &by_momenta).unwrap();
    assert!(back.iter().zip([1.0, 2.0, 3.0, 0.0, 0.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-15), "{back:?}");
}

#[test]
fn simulate_takes_either_form_and_answers_in_that_of_the_scene() {
    let (model, scene) = built(TOP, "momenta");
    let forms = Forms::of(&model, scene.info()).unwrap();
    let initial = json!({"Omega1": 1, "Omega2": 2, "Omega3": 3, "Gamma1": 0, "Gamma2": 0, "Gamma3": 1});
    let text = json!({"initial": initial, "t_final": 1}).to_string();
    assert!(SimulateRequest::has_other_names(&text, scene.info()).unwrap());
    let request = SimulateRequest::parse_in(&text, scene.info(), &forms, 0, &|_| Vec::new(), None).unwrap();
    assert_eq!(request.initial[..2], [2.0, 3.0]);
    let answer = simulate_with_bar(&scene, &request).unwrap().to_json(scene.info(), 0);
    let names: Vec<&String> = answer["final"].as_object().unwrap().keys().collect();
    assert_eq!(names, ["Pi1", "Pi2", "Pi3", "Gamma1", "Gamma2", "Gamma3"]);
}

#[test]
fn each_mistake_tells_both_names() {
    let told = |state: Value| states(TOP, "momenta", &state).unwrap_err().to_string();
    let mixed = json!({"Omega1": 1, "Pi2": 3, "Omega3": 3, "Gamma1": 0, "Gamma2": 0, "Gamma3": 1});
    let text = told(mixed);
    assert!(text.contains("states[0] mixes velocities (Omega1, Omega3) with momenta (Pi2)"), "{text}");
    let text = told(json!({"Omega1": 1, "Omega2": 3, "Gamma1": 0, "Gamma2": 0, "Gamma3": 1}));
    assert!(text.contains("states[0] lacks Omega3"), "{text}");
    let text = told(json!({"Omega1": 1, "Omeha2": 3, "Omega3": 2, "Gamma1": 0, "Gamma2": 0, "Gamma3": 1}));
    assert!(text.contains("no state `Omeha2`") && text.contains("Pi3") && text.contains("Omega3"), "{text}");
    // A scene knows its own names without its model.
    let (_, scene) = built(TOP, "momenta");
    let text = eval_text(&scene, &json!({"states": [{"Omega1": 1}]}).to_string()).unwrap_err().to_string();
    assert!(text.contains("no state `Omega1`"), "{text}");
}

fn started(text: &str, scene: &str, given: &[(&str, f64)]) -> Result<BTreeMap<String, f64>, Error> {
    let (model, built) = built(text, scene);
    let prior = Prior::of(&model, scene, &BTreeMap::new());
    let given = given.iter().map(|(name, x)| ((*name).to_owned(), *x)).collect();
    let forms = Forms::of(&model, built.info()).unwrap();
    let values = built.info().defaults();
    let chosen = Chosen { prior: &prior, given: &given, positions: None };
    let y = start::state(&built, None, (&values, &values), &forms, chosen)?;
    Ok(built.info().state.iter().cloned().zip(y).collect())
}

#[test]
fn a_start_keeps_what_the_model_and_the_user_give_in_whatever_form() {
    let y = started(TOP, "momenta", &[]).unwrap();
    assert_eq!([y["Pi1"], y["Pi2"]], [2.0, 3.0]);
    // By velocity, the others stay as the model has them; by momentum likewise.
    let y = started(TOP, "momenta", &[("Omega2", 4.0)]).unwrap();
    assert_eq!([y["Pi1"], y["Pi2"]], [2.0, 6.0]);
    let y = started(TOP, "momenta", &[("Pi2", 4.0)]).unwrap();
    assert_eq!([y["Pi1"], y["Pi2"]], [2.0, 4.0]);
    let y = started(TOP, "default", &[("Pi2", 4.5)]).unwrap();
    assert!((y["Omega2"] - 3.0).abs() < 1e-15 && (y["Omega1"] - 1.0).abs() < 1e-15, "{y:?}");
    let error = started(TOP, "momenta", &[("Pi2", 4.0), ("Omega1", 1.0)]).unwrap_err().to_string();
    assert!(error.contains("mixes velocities (Omega1) with momenta (Pi2)"), "{error}");
}

#[test]
fn initial_values_of_the_model_may_be_of_both_kinds() {
    // p1 = 2 v1 + v2 and p2 = v1 + 2 (1 + x1^2) v2.
    let (p1, v2) = (1.0, 2.0);
    let v1 = (p1 - v2) / 2.0;
    let p2 = v1 + 2.0 * 1.25 * v2;
    for (scene, expected) in [
        ("default", [("x1_dot", v1), ("x2_dot", v2)]),
        ("first", [("p1", p1), ("x2_dot", v2)]),
        ("both", [("p1", p1), ("p2", p2)]),
    ] {
        let y = started(COUPLED, scene, &[]).unwrap();
        for (name, value) in expected {
            assert!((y[name] - value).abs() < 1e-15, "{scene}: {name} is {} instead of {value}", y[name]);
        }
    }
}

fn outputs(text: &str, scene: &str, state: Vec<f64>) -> BTreeMap<String, f64> {
    let (_, built) = built(text, scene);
    let params = built.info().defaults();
    let names: Vec<String> = built.info().outputs.iter().flat_map(|o| o.components.clone()).collect();
    let answer =
        eval(&built, &EvalRequest { params, t: 0.0, states: vec![state], ..EvalRequest::default() }).unwrap();
    names.into_iter().zip(answer.outputs[0].iter().copied()).collect()
}

#[test]
fn a_state_along_levels_may_be_given_by_velocities_and_momenta() {
    let by_velocities = json!({"x": 0.2, "x_dot": 0.5, "Omega1": 1, "Omega2": 0.2, "Omega3": 0.3,
        "V1": 0.1, "V2": 0.4, "V3": -0.2});
    // P = a V + Omega/4.
    let by_momenta = json!({"x": 0.2, "x_dot": 0.5, "Omega1": 1, "Omega2": 0.2, "Omega3": 0.3,
        "P1": 0.45, "P2": 0.85, "P3": -0.325});
    let along = states(STAGED, "levels", &by_velocities).unwrap();
    // The level of the ideal: V plus the mechanical part Omega/(4 a) plus the connection of the stage.
    let expected = [0.2, 0.5, 1.0, 0.2, 0.3, 0.1 + 0.125 + 0.1, 0.4 + 0.025, -0.2 + 0.0375 + 0.5];
    let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15);
    assert!(close(&along, &expected), "{along:?}");
    assert!(close(&states(STAGED, "levels", &by_momenta).unwrap(), &expected));
    let y = started(STAGED, "levels", &[]).unwrap();
    assert!((y["n1_1"] - expected[5]).abs() < 1e-15 && y["x_dot"] == 0.5, "{y:?}");
    let back = outputs(STAGED, "levels", along);
    assert!((back["V3"] + 0.2).abs() < 1e-15 && (back["V1"] - 0.1).abs() < 1e-15, "{back:?}");
    let mixed = states(STAGED, "levels", &json!({"n1_1": 1, "V2": 1})).unwrap_err().to_string();
    assert!(mixed.contains("mixes velocities (V2) with what the scene carries (n1_1)"), "{mixed}");
}

#[test]
fn momenta_along_levels_are_given_by_velocities_and_momenta() {
    let by_velocities = json!({"x": 0.2, "x_dot": 0.5, "Omega1": 1, "Omega2": 0.2, "Omega3": 0.3,
        "V1": 0.1, "V2": 0.4, "V3": -0.2});
    let by_momenta = json!({"x": 0.2, "x_dot": 0.5, "Omega1": 1, "Omega2": 0.2, "Omega3": 0.3,
        "P1": 0.45, "P2": 0.85, "P3": -0.325});
    // The metric of the ideal is a: beta = a n1.
    let expected = [0.2, 0.5, 1.0, 0.2, 0.3, 0.1 + 0.125 + 0.1, 2.0 * (0.4 + 0.025), -0.2 + 0.0375 + 0.5];
    let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15);
    for given in [by_velocities.clone(), by_momenta] {
        let along = states(STAGED, "mixed", &given).unwrap();
        assert!(close(&along, &expected), "{along:?}");
    }
    let names = built(STAGED, "mixed").1.info().state.clone();
    assert_eq!(names[5..], ["n1_1", "beta_n1_2", "n1_3"]);
    let y = started(STAGED, "mixed", &[]).unwrap();
    assert!((y["beta_n1_2"] - expected[6]).abs() < 1e-15, "{y:?}");
    // Whatever a search chooses is given by velocities, and gives them back.
    for scene in ["mixed", "chosen"] {
        let back = outputs(STAGED, scene, states(STAGED, scene, &by_velocities).unwrap());
        for (name, value) in back.iter().filter(|(name, _)| by_velocities.get(name.as_str()).is_some()) {
            let given = by_velocities[name.as_str()].as_f64().unwrap();
            assert!((value - given).abs() < 1e-15, "{scene}: {name} is {value}");
        }
    }
}

#[test]
fn a_state_along_levels_on_a_constraint_is_given_by_the_velocities_that_the_model_keeps() {
    let own = built(ROLLING, "default").1.info().state.clone();
    assert_eq!(own, ["x", "q", "p", "z"]);
    let given: BTreeMap<&str, f64> = [("x", 0.3), ("q", 1.0), ("p", -2.0), ("z", 0.5), ("x_dot", 1.0)].into();
    let state: BTreeMap<&String, f64> = own.iter().map(|name| (name, given[name.as_str()])).collect();
    let along = states(ROLLING, "levels", &json!(state)).unwrap();
    let (y, names) =
        (started(ROLLING, "levels", &[]).unwrap(), built(ROLLING, "levels").1.info().state.clone());
    assert_eq!(names, ["x", "x_dot", "plane_1", "plane_2"]);
    assert_eq!(names.iter().map(|name| y[name]).collect::<Vec<f64>>(), along);
    let back = outputs(ROLLING, "levels", along);
    for (name, value) in back {
        assert!((value - given[name.as_str()]).abs() < 1e-15, "{name} is {value}");
    }
}

#[test]
fn a_start_in_momenta_keeps_constraints() {
    for given in [&[][..], &[("v3", 2.0)], &[("p3", 1.0)]] {
        let y = started(CONE, "default", given).unwrap();
        let v = [y["p1"] / 2.0, y["p2"], y["p3"] / 2.0];
        let residual = v[0] * v[0] + v[1] * v[1] - v[2] * v[2];
        assert!(residual.abs() < 1e-12, "{given:?}: {y:?}");
        assert!(given.iter().all(|(name, x)| *name != "p3" || y["p3"] == *x));
        assert!(given.iter().all(|(name, x)| *name != "v3" || (v[2] - *x).abs() < 1e-15));
    }
}

#[test]
fn a_start_of_a_hamiltonian_keeps_constraints_on_its_velocities() {
    let text = "model suslov {
        momentum Pi in so(3);
        hamiltonian = Pi1^2/4 + Pi2^2/3 + Pi3^2 + Pi1*Pi3/5;
        constraint dh_dPi3 = 0;
    }";
    let y = started(text, "default", &[("Pi2", 2.0)]).unwrap();
    assert_eq!(y["Pi2"], 2.0);
    assert!((2.0 * y["Pi3"] + y["Pi1"] / 5.0).abs() < 1e-12 && y["Pi1"] != 0.0, "{y:?}");
}

#[test]
fn a_cyclic_coordinate_is_reconstructed_by_the_program() {
    let request = json!({
        "initial": {"theta1": 0.35, "theta2": 0.45, "phi": 0.3, "theta1_dot": 0.2, "theta2_dot": -0.3, "phi_dot": 0.4},
        "t_final": 0.5, "reconstruct": {"phi1": 1},
    });
    let run = |request: &Value| -> Value {
        let out = program(
            &["simulate", "double_spherical_pendulum", "--json", "--via", "interpreter"],
            &request.to_string(),
        );
        serde_json::from_str(&out).unwrap()
    };
    let answer = run(&request);
    let turned = answer["reconstruction"]["phi1"].as_f64().unwrap();
    assert!(answer["final"].get("phi1").is_none() && turned > 1.1, "{answer}");
    // All defaults: the model starts it at zero.
    let mut from_zero = request;
    from_zero["reconstruct"] = json!({});
    let other = run(&from_zero)["reconstruction"]["phi1"].as_f64().unwrap();
    assert!((turned - other - 1.0).abs() < 1e-9, "{turned} {other}");
}

#[test]
fn an_ensemble_varies_velocities_of_a_scene_that_carries_momenta() {
    let file = concat!(env!("CARGO_TARGET_TMPDIR"), "/forms_ensemble.csv");
    let arguments =
        ["ensemble", "heavy_top", "--scene", "momenta", "--via", "interpreter", "--sweep", "Omega3=1..2:2"];
    program(&[&arguments[..], &["--t-final", "0", "-o", file]].concat(), "");
    let table = std::fs::read_to_string(file).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split(',').collect()).collect();
    let at = rows[0].iter().position(|name| *name == "Pi3").unwrap_or_else(|| panic!("{table}"));
    let pi = |row: usize| rows[row][at].parse::<f64>().unwrap();
    // I3 = 0.6.
    assert!((pi(1) - 0.6).abs() < 1e-15 && (pi(2) - 1.2).abs() < 1e-15, "{table}");
}

fn program(arguments: &[&str], input: &str) -> String {
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
    String::from_utf8(out.stdout).unwrap()
}
