//! Steps by discrete equations: orders beside a reference, momenta to rounding, the way back, refusals, inputs.

use std::collections::BTreeMap;
use std::sync::Arc;

use hamel::commands::simulate::simulate_text;
use hamel_codegen::spec;
use hamel_run::cache::Cache;
use hamel_run::error::Error;
use hamel_run::interpreted::{self, Built};
use hamel_run::model::Checked;
use serde_json::{Value, json};

/// A scene, and the start that its model gives.
struct Started {
    scene: Built,
    initial: Value,
}

fn interpreted(text: &str) -> Started {
    let model = spec::parse("discrete.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let of_model: BTreeMap<String, f64> = (model.initial.iter())
        .map(|(name, e)| (name.clone(), model.graph.eval_f64(*e, &BTreeMap::new()).unwrap()))
        .collect();
    let checked = Arc::new(Checked::new(model, Cache::none()));
    let scene = interpreted::build(&checked, "steps").unwrap_or_else(|e| panic!("{e}"));
    let value = |name: &String| {
        // A rotation starts at the identity.
        let identity = if ["R11", "R22", "R33"].contains(&name.as_str()) { 1.0 } else { 0.0 };
        (name.clone(), json!(of_model.get(name).copied().unwrap_or(identity)))
    };
    let initial: serde_json::Map<String, Value> =
        scene.executable().program.state.iter().map(value).collect();
    Started { scene, initial: initial.into() }
}

fn scene(text: &str) -> Started {
    let Started { scene, initial } = interpreted(text);
    Started { scene: scene.in_memory(), initial }
}

fn simulate(Started { scene, initial }: &Started, request: &Value) -> Result<Value, Error> {
    let mut request = request.clone();
    if request.get("initial").is_none() {
        request["initial"] = initial.clone();
    }
    simulate_text(scene, &request.to_string()).map(|answer| serde_json::from_str(&answer).unwrap())
}

fn end(scene: &Started, method: &str, step: f64, t_final: f64) -> Vec<f64> {
    let request = json!({"t_final": t_final, "method": method, "step": step});
    values(&simulate(scene, &request).unwrap_or_else(|e| panic!("{e}"))["final"])
}

fn values(state: &Value) -> Vec<f64> {
    state.as_object().unwrap().values().map(|x| x.as_f64().unwrap()).collect()
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

const BODY: &str = "model body {
    param I: diagonal(3) = [1.3, 1.7, 0.6];
    configuration R in SO(3) velocity Omega;
    lagrangian = dot(Omega, I*Omega)/2;
    output in_space = R*(I*Omega);
    output length = (I1*Omega1)^2 + (I2*Omega2)^2 + (I3*Omega3)^2;
    output shape = [R11^2 + R21^2 + R31^2, R11*R12 + R21*R22 + R31*R32];
    initial Omega = [0.3, 1.1, -0.7];
    scene steps { discrete midpoint; want energy, in_space, length, shape; }
}";
const TOP: &str = "model top {
    param I: diagonal(3) = [1.3, 1.7, 0.6];
    velocity Omega in so(3);
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = dot(Omega, I*Omega)/2 - Gamma1/2 - Gamma3;
    output kept = [dot(Gamma, Gamma), dot(Gamma, I*Omega)];
    initial Omega = [0.3, 1.1, -0.7];
    initial Gamma = [0.6, 0, 0.8];
    scene steps { discrete midpoint; want energy, kept; }
}";
/// A snakeboard: shape, group and constraints.
const SNAKEBOARD: &str = "model snakeboard {
    coordinate psi in angle;
    coordinate phi in (pi/8, 3*pi/8);
    velocity omega, v in se(2);
    lagrangian = 2*dot(v, v) + omega^2 + omega*psi_dot/5 + psi_dot^2/10 + phi_dot^2/5;
    constraint back: v2*cos(phi) - v1*sin(phi) - omega*cos(phi)/2 = 0;
    constraint front: v2*cos(phi) + v1*sin(phi) + omega*cos(phi)/2 = 0;
    force psi_dot = sin(t);
    force phi_dot = cos(t)/20;
    independent psi_dot, phi_dot, v1;
    initial phi = 0.8;
    initial psi_dot = 0.4;
    initial v1 = 0.5;
    scene steps { discrete midpoint; want energy; }
}";
/// A right action with an affine constraint.
const BALL: &str = "model ball {
    coordinate x, y in real;
    velocity omega_x, omega_y, omega_z in so(3);
    action right;
    lagrangian = (x_dot^2 + y_dot^2)/2 + 9/500*(omega_x^2 + omega_y^2 + omega_z^2);
    constraint first: x_dot - 3/10*omega_y = -y;
    constraint second: y_dot + 3/10*omega_x = x;
    independent x_dot, y_dot, omega_z;
    initial x = 0.3;
    initial x_dot = 0.5;
    initial omega_z = 0.4;
    scene steps { discrete midpoint; want energy; }
}";
const HEISENBERG: &str = "model heisenberg {
    velocity u, v, w in heisenberg(1);
    lagrangian = u^2/2 + v^2 + (w + u/2)^2*3/4;
    initial u = 0.3;
    initial v = 0.5;
    initial w = 0.8;
    scene steps { discrete midpoint; retraction exp; want energy; }
}";

#[test]
fn errors_have_the_order_of_the_method() {
    for (name, text) in
        [("body", BODY), ("top", TOP), ("snakeboard", SNAKEBOARD), ("ball", BALL), ("heisenberg", HEISENBERG)]
    {
        let scene = scene(text);
        let exact = json!({"t_final": 2, "rtol": 1e-13, "atol": 1e-14, "method": "vern9"});
        let exact = values(&simulate(&scene, &exact).unwrap()["final"]);
        for (method, order, step) in
            [("discrete", 2.0, 0.02), ("discrete4", 4.0, 0.1), ("discrete6", 6.0, 0.2)]
        {
            let error = |h: f64| distance(&end(&scene, method, h, 2.0), &exact);
            let (coarse, fine) = (error(step), error(step / 2.0));
            let found = (coarse / fine).log2();
            // The next terms of the expansion are two orders further.
            assert!((found - order).abs() < 0.3 || fine < 1e-11, "{name} by {method}: {coarse:e}, {fine:e}");
        }
    }
}

/// The largest distance of an output from where it starts, over so many steps.
fn drift(scene: &Started, output: &str, steps: u32) -> f64 {
    let t_final = f64::from(steps) / 20.0;
    let request = json!({"t_final": t_final, "method": "discrete", "step": 0.05, "samples": 51});
    let answer = simulate(scene, &request).unwrap_or_else(|e| panic!("{e}"));
    let rows = answer["samples"].as_array().unwrap().iter();
    let states: Vec<Value> = rows.map(|row| row[1].clone()).collect();
    let answer =
        hamel::commands::eval::eval_text(&scene.scene, &json!({"states": states}).to_string()).unwrap();
    let answer: Value = serde_json::from_str(&answer).unwrap();
    let rows: Vec<Vec<f64>> = answer["outputs"][output].as_array().unwrap().iter().map(values).collect();
    assert_eq!(rows.len(), 51);
    rows.iter().map(|row| distance(row, &rows[0])).fold(0.0, f64::max)
}

#[test]
fn momenta_of_symmetries_stay_to_rounding() {
    let body = scene(BODY);
    for output in ["in_space", "length", "shape"] {
        let moved = drift(&body, output, 20_000);
        // Rounding of twenty thousand steps that is a random walk, ten times.
        assert!(moved < 1e-12, "{output}: {moved:e}");
    }
    let moved = drift(&scene(TOP), "kept", 20_000);
    assert!(moved < 1e-12, "{moved:e}");
}

#[test]
#[ignore = "a million steps"]
fn momenta_stay_over_a_million_steps() {
    let body = scene(BODY);
    for output in ["in_space", "length", "shape"] {
        let moved = drift(&body, output, 1_000_000);
        assert!(moved < 1e-10, "{output}: {moved:e}");
    }
    let moved = drift(&scene(TOP), "kept", 1_000_000);
    assert!(moved < 1e-10, "{moved:e}");
}

#[test]
fn the_energy_stays_near() {
    for text in [BODY, TOP] {
        let request = json!({"t_final": 1000, "method": "discrete", "step": 0.05});
        let early = json!({"t_final": 100, "method": "discrete", "step": 0.05});
        let scene = scene(text);
        let change = |request: &Value| simulate(&scene, request).unwrap()["energy_drift"].as_f64().unwrap();
        let (short, long) = (change(&early), change(&request));
        assert!(long < 2.0 * short, "{short:e} in the first tenth, {long:e} in all");
    }
}

#[test]
fn a_step_back_leads_to_the_start() {
    // Requests begin at the time zero: only motions without explicit times lead back.
    for text in [BODY, TOP, BALL, HEISENBERG] {
        let scene = scene(text);
        let there = simulate(&scene, &json!({"t_final": 0.05, "method": "discrete", "step": 0.05})).unwrap();
        let mut back = json!({"t_final": -0.05, "method": "discrete", "step": 0.05});
        back["initial"] = there["final"].clone();
        let again = simulate(&scene, &back).unwrap();
        let apart = distance(&values(&again["final"]), &values(&scene.initial));
        assert!(apart < 1e-13, "{apart:e}");
    }
}

#[test]
fn other_scenes_and_long_steps_are_refused() {
    let text = TOP.replace("discrete midpoint; ", "");
    let request = json!({"t_final": 1, "method": "discrete", "step": 0.1});
    let message = simulate(&scene(&text), &request).unwrap_err().to_string();
    assert!(message.contains("method discrete: scene steps of top has no discrete equations"), "{message}");
    let unstepped = json!({"t_final": 1, "method": "discrete4"});
    let message = simulate(&scene(TOP), &unstepped).unwrap_err().to_string();
    assert!(message.contains("discrete4 has no error estimate"), "{message}");
    let long = json!({"t_final": 400, "method": "discrete", "step": 40});
    let message = simulate(&scene(TOP), &long).unwrap_err().to_string();
    assert!(message.contains("did not converge") || message.contains("converge"), "{message}");
}

#[test]
fn machine_code_and_interpreter_have_the_same_bits() {
    let [a, b] = [
        end(&interpreted(SNAKEBOARD), "discrete6", 0.1, 1.0),
        end(&scene(SNAKEBOARD), "discrete6", 0.1, 1.0),
    ];
    assert_eq!(a, b);
}
