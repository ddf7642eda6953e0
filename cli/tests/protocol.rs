//! The machine interfaces `eval` and `simulate --json`: shapes of answers, and what each mistake is told.

use std::sync::Arc;

use hamel::commands::eval::eval_text;
use hamel::commands::simulate::{reconstruct_text, simulate_text};
use hamel_codegen::scene::Prior;
use hamel_codegen::spec;
use hamel_run::cache::Cache;
use hamel_run::choice::{Choice, Via};
use hamel_run::dynamics::Factory as _;
use hamel_run::error::{Error, Problem};
use hamel_run::forms::Forms;
use hamel_run::interpreted;
use hamel_run::model::Checked;
use hamel_run::start::Chosen;
use serde_json::{Value, json};

/// A rigid body, small enough to know its answers by heart.
const TOP: &str = "/// Top\nmodel top {
    /// Principal moments of inertia [kg m^2].
    param I: diagonal(3) = [2, 1.5, 0.8] where I1 > 0, I2 > 0, I3 > 0;
    /// Angular velocity [rad/s].
    velocity Omega in so(3);
    lagrangian = 1/2*dot(Omega, I*Omega);
    casimir C = dot(I*Omega, I*Omega);
    scene bare { want rhs; }
}";

/// A bead on the half-line whose equation has no value at `x = 0`.
const BEAD: &str = "model bead {
    param k = 1;
    coordinate x in real;
    lagrangian = 1/2*x^2*x_dot^2 - k*x;
}";

/// A particle that falls out of its interval.
const FALL: &str = "model fall {
    coordinate x in (0, 2);
    lagrangian = x_dot^2/2 - x;
}";

/// A direction that the angular velocity stays orthogonal to, with multipliers.
const VESELOVA: &str = include_str!("../../models/specs/veselova.hamel");

/// What every answer of `simulate` has, in this order.
const ANSWER: [&str; 10] = [
    "t",
    "final",
    "samples",
    "steps",
    "rejected",
    "rhs_evals",
    "energy_drift",
    "constraint_residual",
    "initial_residual",
    "warnings",
];

fn model(text: &str) -> Arc<Checked> {
    let model = spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    Arc::new(Checked::new(model, Cache::none()))
}

fn scene(text: &str, name: &str) -> interpreted::Built {
    interpreted::build(&model(text), name).unwrap_or_else(|e| panic!("{e}"))
}

fn eval(text: &str, request: &Value) -> Result<Value, Error> {
    let answer = eval_text(&scene(text, "default"), &request.to_string())?;
    Ok(serde_json::from_str(&answer).expect("JSON"))
}

fn simulate(text: &str, request: &Value) -> Result<Value, Error> {
    let answer = simulate_text(&scene(text, "default"), &request.to_string())?;
    Ok(serde_json::from_str(&answer).expect("JSON"))
}

fn problems(result: Result<Value, Error>) -> Vec<Problem> {
    match result {
        Err(Error::Request { problems }) => problems,
        other => panic!("{other:?}"),
    }
}

fn keys(value: &Value) -> Vec<&str> {
    value.as_object().expect("object").keys().map(String::as_str).collect()
}

fn state(omega: [f64; 3]) -> Value {
    json!({"Omega1": omega[0], "Omega2": omega[1], "Omega3": omega[2]})
}

#[test]
fn eval_answers_in_the_documented_shape() {
    let request = json!({"params": {"I1": 1.0}, "states": [state([1.0, 2.0, 3.0]), state([0.0, 0.0, 1.0])]});
    let answer = eval(TOP, &request).unwrap();
    assert_eq!(keys(&answer), ["model", "state", "derivatives", "energy", "outputs"]);
    assert_eq!(answer["model"], "top");
    assert_eq!(answer["state"], json!(["Omega1", "Omega2", "Omega3"]));
    assert_eq!(answer["derivatives"][0][0], (1.5 - 0.8) * 2.0 * 3.0);
    assert_eq!(answer["derivatives"][1], json!([0.0, 0.0, 0.0]));
    assert_eq!(answer["energy"][0], 0.5 * (1.0 + 1.5 * 4.0 + 0.8 * 9.0));
    assert_eq!(answer["outputs"]["momentum"][0]["p_Omega2"], 3.0);
    assert_eq!(answer["outputs"]["momentum"].as_array().unwrap().len(), 2);
    assert_eq!(keys(&answer["outputs"]["casimirs"][1]), ["C"]);
}

#[test]
fn eval_answers_on_one_line_with_numbers_that_read_back() {
    let x = 0.1_f64 + 0.2;
    let request = json!({"states": [state([x, 1e-300, 1.0])]});
    let text = eval_text(&scene(TOP, "default"), &request.to_string()).unwrap();
    assert!(!text.contains('\n'));
    let answer: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(answer["outputs"]["momentum"][0]["p_Omega1"].as_f64().unwrap().to_bits(), (2.0 * x).to_bits());
}

#[test]
fn a_scene_without_energy_answers_null() {
    let request = json!({"states": [state([1.0, 2.0, 3.0])]}).to_string();
    let answer = eval_text(&scene(TOP, "bare"), &request).unwrap();
    let answer: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answer["energy"], Value::Null);
    assert_eq!(answer["outputs"], json!({}));
    let request = json!({"initial": state([1.0, 2.0, 3.0]), "t_final": 1}).to_string();
    let answer = simulate_text(&scene(TOP, "bare"), &request).unwrap();
    let answer: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answer["energy_drift"], Value::Null);
}

#[test]
fn every_model_has_a_scene_of_derivatives() {
    let request = json!({"states": [state([1.0, 2.0, 3.0])]}).to_string();
    let answer = eval_text(&scene(TOP, "derivatives"), &request).unwrap();
    let answer: Value = serde_json::from_str(&answer).unwrap();
    let entry = &answer["outputs"]["jacobian"][0]["d_dot_Omega1_d_Omega2"];
    assert_eq!(entry.as_f64(), Some((1.5 - 0.8) / 2.0 * 3.0));
    assert_eq!(keys(&answer["outputs"]["jacobian"][0]).len(), 6);
    assert_eq!(answer["outputs"]["time_derivative"][0]["d_dot_Omega1_d_t"], 0.0);
    assert_eq!(keys(&answer["outputs"]["sensitivity"][0]).len(), 9);
}

#[test]
fn unknown_and_missing_names_list_the_right_ones() {
    let request = json!({"params": {"I4": 1, "I1": 1}, "states": [{"Omega1": 1, "omega2": 1}]});
    let problems = problems(eval(TOP, &request));
    assert_eq!(problems.len(), 3, "{problems:?}");
    let text: Vec<String> = problems.iter().map(Problem::to_string).collect();
    assert!(
        text[0].contains("no parameter `I4`; did you mean") && text[0].contains("I1, I2, I3"),
        "{}",
        text[0]
    );
    assert!(text[1].contains("states[0] has no state `omega2`; did you mean `Omega2`?"), "{}", text[1]);
    assert!(text[2].contains("states[0] lacks Omega2, Omega3"), "{}", text[2]);
    assert!(text[2].contains("Omega1, Omega2, Omega3"), "{}", text[2]);
}

#[test]
fn unknown_fields_and_wrong_kinds_are_told() {
    let texts = |request: Value| -> String {
        problems(eval(TOP, &request)).iter().map(|p| format!("{p}\n")).collect()
    };
    assert!(texts(json!({"state": []})).contains("no field `state`; did you mean `states`?"));
    assert!(texts(json!({})).contains("states is missing"));
    assert!(texts(json!([])).contains("the request is an array"));
    assert!(texts(json!({"states": {}})).contains("states is an object, but has to be an array"));
    assert!(texts(json!({"states": [1]})).contains("states[0] is the number 1.0"));
    assert!(texts(json!({"states": [], "t": true})).contains("t is true"));
}

#[test]
fn numbers_in_quotes_are_an_error_that_says_so() {
    let mut quoted = state([1.0, 2.0, 3.0]);
    quoted["Omega2"] = json!("1.3");
    let found = problems(eval(TOP, &json!({"params": {"I1": "2"}, "states": [quoted]})));
    let expected = [("params.I1", "2"), ("states[0].Omega2", "1.3")]
        .map(|(path, text)| Problem::QuotedNumber { path: path.into(), text: text.into() });
    assert_eq!(found, expected);
    assert!(found[0].to_string().ends_with("write the number without quotes"));
}

#[test]
fn repeated_names_are_an_error() {
    let text = r#"{"params": {"I1": 1, "I1": 2}, "states": []}"#;
    let result = eval_text(&scene(TOP, "default"), text);
    assert!(
        matches!(result, Err(Error::Request { problems }) if matches!(problems[0], Problem::Repeated { .. }))
    );
}

#[test]
fn text_that_is_not_json_is_an_error_with_its_place() {
    let result = eval_text(&scene(TOP, "default"), "{\"states\": [NaN]}");
    assert!(matches!(&result, Err(Error::NotJson { reason, empty: false }) if reason.contains("line 1")));
    for text in ["", "  \n"] {
        let result = eval_text(&scene(TOP, "default"), text);
        assert!(matches!(result, Err(Error::NotJson { empty: true, .. })));
    }
    let result = eval_text(&scene(TOP, "default"), "{\"states\": [{\"Omega1\": 1e999}]}");
    assert!(matches!(result, Err(Error::NotJson { .. })));
}

#[test]
fn bad_parameters_name_the_condition_and_the_value() {
    let result = eval(TOP, &json!({"params": {"I2": -1.5}, "states": []}));
    match result {
        Err(error @ Error::Params { .. }) => {
            assert_eq!(error.exit_code(), 2);
            let text = error.to_string();
            assert!(text.contains("I2 > 0 does not hold for I2 = -1.5"), "{text}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn singular_and_overflowing_states_are_errors_with_their_index() {
    let request = json!({"states": [{"x": 1, "x_dot": 0}, {"x": 0, "x_dot": 1}]});
    let told = |text: &str, request: &Value| eval(text, request).unwrap_err().to_string();
    assert_eq!(
        told(BEAD, &request),
        "states[1] cannot be evaluated: pivot inertia along x_dot vanishes at t = 0: the equations are singular there"
    );
    let overflow = told(TOP, &json!({"states": [state([1.0, 1e300, 1e300])]}));
    assert!(overflow.starts_with("states[0] cannot") && overflow.contains("Omega1"), "{overflow}");
}

#[test]
fn eval_tells_every_bad_state_with_its_index_and_pivot() {
    let at = |x: f64| json!({"x": x, "x_dot": 1});
    let request = json!({"states": [at(0.0), at(1.0), at(1e300), at(0.0)], "t": 2});
    let lines: Vec<(String, String)> = problems(eval(BEAD, &request))
        .into_iter()
        .map(|p| match p {
            Problem::Unusable { path, reason } => (path, reason),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(
        lines.iter().map(|l| l.0.as_str()).collect::<Vec<_>>(),
        ["states[0]", "states[2]", "states[3]"]
    );
    assert!(lines[0].1.contains("pivot inertia along x_dot vanishes at t = 2"), "{lines:?}");
    assert!(lines[1].1.contains("pivot inertia along x_dot is not finite"), "{lines:?}");
    let many = json!({"states": vec![at(0.0); 30]});
    let told = problems(eval(BEAD, &many));
    assert_eq!(told.len(), 21);
    assert!(told[20].to_string().contains("30 of 30"), "{}", told[20]);
}

#[test]
fn eval_names_what_vanishes_for_a_flat_disk() {
    let disk = include_str!("../../models/specs/euler_disk_advected.hamel");
    let flat = json!({"Omega1": 0.3, "Omega2": 0.8, "Omega3": -6, "Gamma1": 0, "Gamma2": 0, "Gamma3": 1});
    let told = eval(disk, &json!({"states": [flat]})).unwrap_err().to_string();
    assert!(told.starts_with("states[0] cannot be evaluated: pivot Gamma1^2 + Gamma2^2 vanishes"), "{told}");
}

/// A mass that becomes negative at `x = 1`, where the motion from the origin with speed one ends at `t = pi/4`.
const THINNING: &str = "model thinning {
    coordinate x, w in real;
    lagrangian = 1/2*(1 - x^2)*x_dot^2 + 1/2*w_dot^2 - 1/2*w^2;
}";

#[test]
fn fixed_steps_end_where_a_pivot_vanishes_and_say_which() {
    let initial = json!({"x": 0, "w": 0, "x_dot": 1, "w_dot": 0});
    for method in
        ["rk4", "gauss4", "gauss6", "gauss8", "gauss16", "tsit5", "dop853", "vern9", "dopri5", "taylor"]
    {
        let request = json!({"initial": initial, "t_final": 3, "method": method, "step": 0.1});
        match simulate(THINNING, &request) {
            Err(Error::Stopped { t, state, reason }) => {
                assert!(
                    reason.contains("pivot inertia along x_dot passes through zero"),
                    "{method}: {reason}"
                );
                assert!(t > 0.5 && t < 0.9 && state[0].1 < 1.0, "{method}: {t} {state:?}");
            }
            other => panic!("{method}: {other:?}"),
        }
    }
    for method in ["tsit5", "dop853", "vern9", "dopri5", "taylor", "projected"] {
        let request = json!({"initial": initial, "t_final": 3, "method": method});
        match simulate(THINNING, &request) {
            Err(Error::Stopped { t, reason, .. }) => {
                assert!(reason.contains("pivot inertia along x_dot"), "{method}: {reason}");
                assert!((t - std::f64::consts::FRAC_PI_4).abs() < 1e-6, "{method}: {t}");
            }
            other => panic!("{method}: {other:?}"),
        }
    }
}

#[test]
fn a_conserved_energy_that_moves_is_a_warning_with_fixed_steps() {
    // A spring: rk4 with a step of 1.2 loses energy, and keeps it with 0.1.
    let spring = "model spring { coordinate x in real; lagrangian = 1/2*x_dot^2 - 1/2*x^2; }";
    let driven =
        "model driven { coordinate x in real; lagrangian = 1/2*x_dot^2 - 1/2*x^2; force x_dot = -x_dot; }";
    let run = |text: &str, step: f64| {
        let initial = json!({"x": 1, "x_dot": 0});
        simulate(text, &json!({"initial": initial, "t_final": 12, "method": "rk4", "step": step})).unwrap()
    };
    let warnings = run(spring, 1.2)["warnings"].as_array().unwrap().clone();
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    let told = warnings[0].as_str().unwrap();
    assert!(told.starts_with("the energy is conserved but moved by") && told.contains("step 1.2"), "{told}");
    assert_eq!(run(spring, 0.1)["warnings"], json!([]));
    // Friction takes energy by right.
    assert_eq!(run(driven, 1.2)["warnings"], json!([]));
}

#[test]
fn simulate_answers_in_the_documented_shape() {
    let request = json!({"params": {"I1": 2}, "initial": state([1.0, 0.2, 0.1]), "t_final": 4, "method": "tsit5",
        "rtol": 1e-10, "atol": 1e-12, "samples": 5});
    let answer = simulate(TOP, &request).unwrap();
    assert_eq!(keys(&answer), ANSWER);
    // No state breaks a constraint that is not there.
    assert_eq!((&answer["constraint_residual"], &answer["initial_residual"]), (&Value::Null, &Value::Null));
    assert_eq!(answer["t"], 4.0);
    let samples = answer["samples"].as_array().unwrap();
    let times: Vec<f64> = samples.iter().map(|s| s[0].as_f64().unwrap()).collect();
    assert_eq!(times, [0.0, 1.0, 2.0, 3.0, 4.0]);
    assert_eq!(samples[0][1], state([1.0, 0.2, 0.1]));
    assert_eq!(samples[4][1], answer["final"]);
    assert_eq!(keys(&answer["final"]), ["Omega1", "Omega2", "Omega3"]);
    // Fifth order at rtol 1e-10, errors of some tens of steps.
    let drift = answer["energy_drift"].as_f64().unwrap();
    assert!(drift > 0.0 && drift < 1e-8, "{drift:e}");
    assert!(answer["steps"].as_u64().unwrap() > 10);
}

#[test]
fn simulate_takes_defaults_and_all_methods() {
    let initial = state([1.0, 0.2, 0.1]);
    let reference = simulate(TOP, &json!({"initial": initial, "t_final": 2})).unwrap();
    assert_eq!(reference["samples"], json!([]));
    let methods = [
        ("rk4", Some(1e-3)),
        ("dop853", Some(0.05)),
        ("dopri5", None),
        ("tsit5", None),
        ("vern9", None),
        ("gauss4", Some(1e-3)),
        ("gauss6", Some(0.01)),
        ("gauss8", Some(0.02)),
        ("gauss16", Some(0.1)),
        ("gauss16-projected", Some(0.1)),
        ("gauss4-newton", Some(1e-3)),
        ("gauss6-newton", Some(0.01)),
        ("gauss8-newton", Some(0.02)),
        ("splitting2", Some(1e-4)),
        ("splitting4", Some(5e-3)),
        ("splitting6", Some(0.02)),
    ];
    for (method, step) in methods {
        let mut request = json!({"initial": initial, "t_final": 2, "method": method});
        if let Some(step) = step {
            request["step"] = json!(step);
        }
        let answer = simulate(TOP, &request).unwrap();
        for name in ["Omega1", "Omega2", "Omega3"] {
            let (x, y) =
                (answer["final"][name].as_f64().unwrap(), reference["final"][name].as_f64().unwrap());
            assert!((x - y).abs() < 1e-8, "{method} {name}: {x} and {y}");
        }
    }
    let back = simulate(TOP, &json!({"initial": reference["final"], "t_final": -2, "samples": 2})).unwrap();
    assert_eq!(back["samples"][1][0], -2.0);
    assert!((back["final"]["Omega1"].as_f64().unwrap() - 1.0).abs() < 1e-8);
    let nothing = simulate(TOP, &json!({"initial": initial, "t_final": 0, "samples": 1})).unwrap();
    assert_eq!((nothing["final"].clone(), nothing["steps"].as_u64()), (initial.clone(), Some(0)));
}

/// Two masses on springs, one of which is stiffer by four orders; linear, so that energy is quadratic.
const STIFF: &str = "model stiff {
    param k = 1e4;
    coordinate x in real;
    coordinate y in real;
    lagrangian = 1/2*(x_dot^2 + y_dot^2) - 1/2*(x^2 + k*(y - x)^2);
}";

#[test]
fn newton_takes_steps_that_fixed_points_cannot_and_is_recommended_by_its_name() {
    let request = |method: &str| {
        let initial = json!({"x": 1, "y": 1, "x_dot": 0, "y_dot": 0});
        json!({"initial": initial, "t_final": 10, "method": method, "step": 0.05})
    };
    let recommended = [("gauss4", "gauss4-newton"), ("gauss6", "gauss6-newton"), ("gauss8", "gauss8-newton")];
    for (method, other) in recommended.into_iter().chain([("gauss16", "gauss8-newton")]) {
        let Err(error) = simulate(STIFF, &request(method)) else { panic!("{method} converged") };
        let words = format!("take a smaller step, or {other}");
        assert!(error.to_string().contains(&words), "{error}");
        // What is recommended works.
        let answer = simulate(STIFF, &request(other)).unwrap();
        assert_eq!(answer["steps"], 200);
        // Both masses together: x'' = -x/2, but for the stretch of the stiff spring.
        let x = answer["final"]["x"].as_f64().unwrap();
        assert!((x - (10.0 / 2.0_f64.sqrt()).cos()).abs() < 1e-3, "{method}: {x}");
        assert!(answer["energy_drift"].as_f64().unwrap() < 1e-6, "{method}: {answer}");
    }
}

#[test]
fn results_do_not_depend_on_the_scale_of_the_state() {
    let oscillator = "model oscillator { coordinate x in real; lagrangian = 1/2*x_dot^2 - 1/2*x^2; }";
    for method in ["tsit5", "dopri5", "dop853", "vern9", "taylor"] {
        let end = |amplitude: f64| {
            let initial = json!({"x": amplitude, "x_dot": 0.5 * amplitude});
            let request =
                json!({"initial": initial, "t_final": 10, "method": method, "rtol": 1e-9, "atol": 0});
            simulate(oscillator, &request).unwrap()["final"]["x"].as_f64().unwrap() / amplitude
        };
        let expected = 10.0_f64.cos() + 0.5 * 10.0_f64.sin();
        for amplitude in [1.0, 1e-40, 1e-300, 1e-100, 1e100] {
            let found = end(amplitude);
            assert!((found - expected).abs() < 1e-6, "{method} {amplitude:e}: {found} and {expected}");
        }
    }
}

#[test]
fn simulate_rejects_contradictions_and_what_it_cannot_do() {
    let text = |change: Value| -> String {
        let mut request = json!({"initial": state([1.0, 0.2, 0.1]), "t_final": 1});
        for (name, value) in change.as_object().unwrap() {
            request[name] = value.clone();
        }
        match simulate(TOP, &request) {
            Err(error) => {
                assert_eq!(error.exit_code(), 2, "{error}");
                error.to_string()
            }
            Ok(answer) => panic!("{answer}"),
        }
    };
    assert!(
        text(json!({"method": "rk45"}))
            .contains("methods: tsit5, dop853, vern9, gbs14, dopri5, rk4, midpoint, gauss4, gauss6")
    );
    assert!(text(json!({"method": "rk4"})).contains("step is missing: rk4"));
    assert!(text(json!({"method": "gauss6"})).contains("step is missing: gauss6"));
    assert!(text(json!({"step": 0.1, "rtol": 1e-6})).contains("either step, or rtol and atol"));
    assert!(text(json!({"samples": -1})).contains("samples is -1.0"));
    assert!(text(json!({"samples": 1.5})).contains("whole number"));
    assert!(text(json!({"t_final": null})).contains("t_final is missing"));
    assert!(text(json!({"t_final": "3"})).contains("without quotes"));
    assert!(text(json!({"step": 0})).contains("step size"));
    assert!(text(json!({"step": 1e-30})).contains("too small"));
    assert!(text(json!({"rtol": 1e-20})).contains("relative tolerance"));
    assert!(text(json!({"initial": {"Omega1": 1}})).contains("initial lacks Omega2, Omega3"));
    assert!(text(json!({"tfinal": 1})).contains("did you mean `t_final`?"));
    for bad in [json!(0), json!(-1), json!(1.5), json!(1e300)] {
        assert!(text(json!({"max_steps": bad})).contains("max_steps is"), "{bad}");
    }
    assert!(text(json!({"samples": 1e300})).contains("whole number"));
    // Refused before anything is allocated, with what it would take and how many would do.
    let told = text(json!({"samples": 20_000_000}));
    assert!(told.contains("samples is 20000000, which would take about 18.1 GB of memory"), "{told}");
    assert!(told.contains("take 4419889 or fewer"), "{told}");
    // A step more than there may be.
    let told = text(json!({"step": 0.01, "method": "rk4", "max_steps": 99}));
    assert!(told.contains("needs 1.0e2 steps, and at most 99 are taken"), "{told}");
}

#[test]
fn a_failed_integration_reports_time_and_state_reached() {
    // Falls onto x = 0, where the inertia vanishes.
    let request = json!({"initial": {"x": 1, "x_dot": 0}, "t_final": 100});
    match simulate(BEAD, &request) {
        Err(error @ Error::Stopped { .. }) => {
            assert_eq!(error.exit_code(), 1);
            let text = error.to_string();
            let Error::Stopped { t, state, .. } = error else { unreachable!() };
            assert!(t > 0.5 && t < 100.0, "{text}");
            assert_eq!(state.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["x", "x_dot"]);
            assert!(state.iter().all(|(_, x)| x.is_finite()), "{text}");
            assert!(text.contains("integration stopped at t = ") && text.contains("x_dot = "), "{text}");
        }
        other => panic!("{other:?}"),
    }
    let result = simulate(BEAD, &json!({"initial": {"x": 0, "x_dot": 0}, "t_final": 1}));
    assert!(matches!(&result, Err(Error::State { path, .. }) if path == "initial"), "{result:?}");
}

#[test]
fn the_drift_is_relative_to_something_even_where_the_energy_cancels() {
    let model = "model pendulum { coordinate theta in angle; lagrangian = 1/2*theta_dot^2 + cos(theta); }";
    // E = 0 at rest at the height of the pivot.
    let initial = json!({"theta": std::f64::consts::FRAC_PI_2, "theta_dot": 0});
    let answer = simulate(model, &json!({"initial": initial, "t_final": 10})).unwrap();
    let drift = answer["energy_drift"].as_f64().unwrap();
    assert!(drift < 1e-5, "{drift:e}");
}

#[test]
fn the_default_initial_state_meets_the_constraint() {
    let model = model(VESELOVA);
    let scene = interpreted::build(&model, "default").unwrap_or_else(|e| panic!("{e}"));
    let prior = Prior::of(&model, "default", &Default::default());
    let values = scene.info().defaults();
    let given = [("Omega1".to_owned(), 2.0)].into();
    let start = |given| {
        let chosen = Chosen { prior: &prior, given, positions: None };
        let forms = Forms::own(scene.info());
        hamel_run::start::state(&scene, None, (&values, &[]), &forms, chosen).unwrap()
    };
    for (given, first) in [(&Default::default(), None), (&given, Some(2.0))] {
        let y = start(given);
        assert!(first.is_none_or(|x| y[0] == x), "{y:?}");
        let residual: f64 = (0..3).map(|k| y[k] * y[3 + k]).sum();
        assert!(residual.abs() < 1e-15, "{residual:e}");
        let norm: f64 = (0..3).map(|k| y[3 + k] * y[3 + k]).sum();
        assert!((norm - 1.0).abs() < 1e-15);
        assert!(y[..3].iter().any(|x| x.abs() > 0.1));
    }
}

/// A sleigh with a planar pose, and an initial heading of its own.
const SLEIGH: &str = "model sleigh {
    param m = 2 where m > 0;
    param h = 0.5;
    velocity omega, v in se(2);
    lagrangian = 1/2*omega^2 + m/2*dot(v, v);
    constraint v2 = 0;
    reconstruct theta, x, y in SE(2);
    initial theta = h;
    scene bare { want rhs; }
}";

fn reconstruct(request: &Value) -> Result<Value, Error> {
    let model = model(SLEIGH);
    let scene = scene(SLEIGH, "reconstruction");
    let forms = Forms::own(scene.info());
    let answer = reconstruct_text(&scene, &model, &request.to_string(), &forms)?;
    Ok(serde_json::from_str(&answer).expect("JSON"))
}

#[test]
fn simulate_reconstructs_the_group_beside_the_state() {
    let mut request = json!({"initial": {"omega": 0, "v1": 1.5}, "t_final": 2, "samples": 3,
        "reconstruct": {"theta": 0.3, "x": 1, "y": -1}});
    let answer = reconstruct(&request).unwrap();
    assert_eq!(keys(&answer), [&ANSWER[..], &["reconstruction"]].concat());
    assert_eq!(keys(&answer["final"]), ["omega", "v1"]);
    assert_eq!(keys(&answer["samples"][1][1]), ["omega", "v1"]);
    assert_eq!(keys(&answer["reconstruction"]), ["theta", "x", "y"]);
    let close = |found: &Value, x: f64| assert!((found.as_f64().unwrap() - x).abs() < 1e-12, "{found} {x}");
    close(&answer["reconstruction"]["x"], 1.0 + 3.0 * 0.3_f64.cos());
    close(&answer["reconstruction"]["y"], -1.0 + 3.0 * 0.3_f64.sin());
    // Nothing given: as the model says, otherwise the identity. The model's values depend on its parameters.
    for (params, heading) in [(json!({}), 0.5), (json!({"h": 0.7}), 0.7)] {
        request["reconstruct"] = json!({});
        request["params"] = params;
        let answer = reconstruct(&request).unwrap();
        close(&answer["reconstruction"]["theta"], heading);
        close(&answer["reconstruction"]["x"], 3.0 * heading.cos());
    }
}

#[test]
fn reconstruct_takes_all_coordinates_of_the_group_and_no_others() {
    let text = |group: Value| -> String {
        let request = json!({"initial": {"omega": 0, "v1": 1}, "t_final": 1, "reconstruct": group});
        problems(reconstruct(&request)).iter().map(|p| format!("{p}\n")).collect()
    };
    let found = text(json!({"theta": 0, "x": 1, "z": 2}));
    assert!(found.contains("no group coordinate `z`"), "{found}");
    assert!(found.contains("reconstruct lacks y") && found.contains("theta, x, y"), "{found}");
    assert!(text(json!({"omega": 1, "theta": 0, "x": 0, "y": 0})).contains("group coordinates: theta, x, y"));
    assert!(text(json!({"theta": "0", "x": 0, "y": 0})).contains("without quotes"));
    assert!(text(json!(true)).contains("reconstruct is true"));
    let request = json!({"initial": {"omega": 0, "v1": 1, "x": 1}, "t_final": 1, "reconstruct": {}});
    assert!(problems(reconstruct(&request))[0].to_string().contains("initial has no state `x`"));
}

#[test]
fn reconstruct_needs_a_group_and_the_default_scene() {
    let choice = |scene: &str| Choice { scene: scene.into(), via: Some(Via::Interpreter), table: None };
    let told =
        |model: &str, scene: &str| match choice(scene).reconstructing(&self::model(model), "reconstruct") {
            Err(error) => error.to_string(),
            Ok(choice) => choice.scene,
        };
    assert_eq!(told(SLEIGH, "default"), "reconstruction");
    assert!(told(SLEIGH, "bare").contains("leave out --scene bare"));
    assert!(told(SLEIGH, "reconstruction").contains("leave out --scene reconstruction"));
    assert!(told(BEAD, "default").contains("bead does not say how the group moves"));
}

#[test]
fn leaving_the_domain_of_a_coordinate_is_told_with_the_last_state_inside() {
    for method in ["dop853", "tsit5", "vern9", "taylor"] {
        let request = json!({"initial": {"x": 1, "x_dot": 0}, "t_final": 10, "method": method});
        let Err(error @ Error::Stopped { .. }) = simulate(FALL, &request) else { panic!("{method}") };
        assert!(error.to_string().contains("x > 0 does not hold"), "{error}");
        let Error::Stopped { t, state, .. } = error else { unreachable!() };
        assert!((t - 2.0_f64.sqrt()).abs() < 1e-8, "{method}: {t}");
        assert!(state[0].1 > 0.0 && state[0].1 < 1e-10, "{method}: {state:?}");
    }
    let request = json!({"initial": {"x": 3, "x_dot": 0}, "t_final": 1});
    let error = simulate(FALL, &request).unwrap_err().to_string();
    assert!(error.contains("initial") && error.contains("x < 2 does not hold"), "{error}");
}

#[test]
fn the_projected_method_keeps_what_is_conserved_and_needs_something_to_keep() {
    let request = |method: &str| {
        let initial = state([1.0, 2.0, 3.0]);
        json!({"initial": initial, "t_final": 50, "method": method, "rtol": 1e-6, "atol": 1e-6})
    };
    let drift = |method: &str| number_of(&simulate(TOP, &request(method)).unwrap()["energy_drift"]);
    let (free, kept) = (drift("vern9"), drift("projected"));
    assert!(free > 1e-10 && kept < 1e-15, "{free:e}, {kept:e}");
    // With fixed steps, at which the method alone has an error of its own.
    let drift = |method: &str| {
        let request =
            json!({"initial": state([1.0, 2.0, 3.0]), "t_final": 10_000, "method": method, "step": 0.5});
        number_of(&simulate(TOP, &request).unwrap()["energy_drift"])
    };
    let (free, kept) = (drift("gauss16"), drift("gauss16-projected"));
    assert!(free > 2e-15 && kept < 1e-15, "{free:e}, {kept:e}");
    let unstepped = json!({"initial": state([1.0, 2.0, 3.0]), "t_final": 1, "method": "gauss16-projected"});
    let error = simulate(TOP, &unstepped).unwrap_err().to_string();
    assert!(error.contains("step is missing: gauss16-projected has no error estimate"), "{error}");
    // The energy changes, and the momentum is a component of the state.
    let damped = "model damped { coordinate q in real; lagrangian = q_dot^2/2; force q_dot = -q_dot; }";
    for (method, step) in [("projected", Value::Null), ("gauss16-projected", json!(0.1))] {
        let initial = json!({"q": 1, "q_dot": 1});
        let request = json!({"initial": initial, "t_final": 1, "method": method, "step": step});
        let error = simulate(damped, &request).unwrap_err().to_string();
        let words = format!("method {method}: scene default of damped has no invariant besides components");
        assert!(error.contains(&words), "{error}");
    }
}

#[test]
fn splitting_keeps_casimirs_at_long_steps_and_says_what_it_needs() {
    let request = |method: &str| {
        let initial = state([1.0, 2.0, 3.0]);
        json!({"initial": initial, "t_final": 100, "method": method, "step": 0.1})
    };
    let answer = simulate(TOP, &request("splitting4")).unwrap();
    // The energy is nearly kept, and not exactly.
    let drift = number_of(&answer["energy_drift"]);
    assert!(drift > 1e-12 && drift < 1e-3, "{drift:e}");
    let momenta = [("Omega1", 2.0), ("Omega2", 1.5), ("Omega3", 0.8)];
    let casimir: f64 =
        momenta.iter().map(|(name, inertia)| (inertia * number_of(&answer["final"][name])).powi(2)).sum();
    // 1000 steps of some ten flows, each rounded.
    assert!((casimir - 18.76).abs() < 1e-12, "{casimir}");
    let unstepped = json!({"initial": state([1.0, 2.0, 3.0]), "t_final": 1, "method": "splitting4"});
    let error = simulate(TOP, &unstepped).unwrap_err().to_string();
    assert!(error.contains("step is missing: splitting4 has no error estimate"), "{error}");
    let damped = "model damped { coordinate q in real; lagrangian = q_dot^2/2; force q_dot = -q_dot; }";
    let request = json!({"initial": {"q": 1, "q_dot": 1}, "t_final": 1, "method": "splitting2", "step": 0.1});
    let error = simulate(damped, &request).unwrap_err().to_string();
    let words = "method splitting2: scene default of damped is not split into exact flows: an affine constraint, explicit \
                 time or a force acts";
    assert!(error.contains(words), "{error}");
}

fn number_of(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn auto_takes_a_method_that_suits_tolerance_and_scene() {
    let request = |method: &str, rtol: f64, samples: usize| {
        let initial = state([1.0, 2.0, 3.0]);
        json!({
            "initial": initial, "t_final": 5, "method": method, "rtol": rtol, "atol": rtol, "samples": samples
        })
    };
    let answer =
        |method: &str, rtol: f64, samples: usize| simulate(TOP, &request(method, rtol, samples)).unwrap();
    for (rtol, inside_of_steps) in [(1e-5, "dop853"), (1e-12, "vern9")] {
        assert_eq!(answer("auto", rtol, 2), answer("gbs14", rtol, 2));
        // Series are interpreted beside rates that are compiled, and for whom asks for them.
        assert_eq!(answer("auto", rtol, 20), answer(inside_of_steps, rtol, 20));
    }
    let fixed = json!({"initial": state([1.0, 2.0, 3.0]), "t_final": 1, "method": "auto", "step": 0.1});
    assert!(problems(simulate(TOP, &fixed))[0].to_string().contains("auto chooses by tolerances"));
}

#[test]
fn an_integration_stops_at_the_largest_number_of_steps_and_says_where() {
    let request = |max_steps: u64| json!({"initial": state([1.0, 0.2, 0.1]), "t_final": 1e15, "max_steps": max_steps, "method": "tsit5"});
    let mut reached = 0.0;
    for max_steps in [1, 10, 1000] {
        match simulate(TOP, &request(max_steps)) {
            Err(error @ Error::Stopped { .. }) => {
                assert_eq!(error.exit_code(), 1);
                let text = error.to_string();
                assert!(text.contains(&format!("{max_steps} steps were not enough")), "{text}");
                assert!(text.contains("raise max_steps"), "{text}");
                let Error::Stopped { t, .. } = error else { unreachable!() };
                assert!(t > reached && t < 1e4, "{text}");
                reached = t;
            }
            other => panic!("{other:?}"),
        }
    }
    // Exactly as many as it takes are enough, also fixed ones.
    for method in [json!({"method": "tsit5"}), json!({"method": "rk4", "step": 0.125})] {
        let mut request = json!({"initial": state([1.0, 0.2, 0.1]), "t_final": 4});
        request.as_object_mut().unwrap().extend(method.as_object().unwrap().clone());
        let free = simulate(TOP, &request).unwrap();
        let n = free["steps"].as_u64().unwrap() + free["rejected"].as_u64().unwrap();
        request["max_steps"] = json!(n);
        assert_eq!(simulate(TOP, &request).unwrap(), free, "{n} steps");
        request["max_steps"] = json!(n - 1);
        assert!(simulate(TOP, &request).is_err(), "{n} steps");
    }
}

#[test]
fn a_scene_without_state_says_that_there_is_nothing_to_integrate() {
    let fixed = "model fixed {
        velocity omega in R;
        lagrangian = omega^2;
        constraint omega = t;
        reconstruct s by omega;
    }";
    let error = simulate(fixed, &json!({"initial": {}, "t_final": 1})).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    let text = error.to_string();
    assert!(text.contains("scene default of fixed has no state") && text.contains("--reconstruct"), "{text}");
    // Both pieces of advice hold.
    let answer = eval(fixed, &json!({"states": [{}], "t": 2})).unwrap();
    assert_eq!(answer["energy"], json!([4.0]));
    let model = model(fixed);
    let request = json!({"initial": {}, "t_final": 2, "reconstruct": {}}).to_string();
    let scene = scene(fixed, "reconstruction");
    let forms = Forms::own(scene.info());
    let answer = reconstruct_text(&scene, &model, &request, &forms).unwrap();
    let answer: Value = serde_json::from_str(&answer).unwrap();
    assert!((answer["reconstruction"]["s"].as_f64().unwrap() - 2.0).abs() < 1e-12, "{answer}");
}

/// Appell's machine, whose constraint is quadratic in the velocities.
const APPELL: &str = include_str!("../../models/specs/appell_machine.hamel");

/// Two constraints, one of them affine and driven by time, with positions in the coefficients.
const DRIVEN: &str = "model driven {
    param a = 0.3;
    coordinate x, y, z in real;
    coordinate theta in angle;
    lagrangian = x_dot^2 + 2*y_dot^2 + 3*z_dot^2 + theta_dot^2/5 + x_dot*y_dot/2;
    constraint x_dot*sin(theta) - y_dot*cos(theta) = a*(1 + t);
    constraint z_dot - x*theta_dot = 0;
    multipliers;
    scene residuals { want rhs, constraint; }
    scene bare { want rhs; }
}";

fn gyroscope(omega: [f64; 3], gamma: [f64; 3]) -> Value {
    let mut state = state(omega);
    for (k, x) in gamma.into_iter().enumerate() {
        state[format!("gamma{}", k + 1)] = json!(x);
    }
    state
}

/// The nearest admissible state of an error, and the residuals that it names.
fn inadmissible(result: Result<Value, Error>) -> (Vec<(String, f64, f64)>, Value) {
    match result {
        Err(Error::Inadmissible { broken, nearest }) => {
            let nearest = nearest.unwrap_or_else(|| panic!("no state near {broken:?}"));
            (broken, nearest.into_iter().map(|(name, x)| (name, json!(x))).collect())
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn residuals_of_the_constraint_are_reported() {
    let on = gyroscope([1.2, 0.3, -0.4], [0.0, 0.8, 0.6]);
    let answer = simulate(VESELOVA, &json!({"initial": on, "t_final": 5, "samples": 11})).unwrap();
    let residual = |y: &Value| -> f64 {
        (1..=3).map(|k| number_of(&y[format!("Omega{k}")]) * number_of(&y[format!("gamma{k}")])).sum()
    };
    // As eval has it: a value, not a ratio.
    let initial = number_of(&answer["initial_residual"]);
    assert_eq!(initial, residual(&on).abs());
    let largest = number_of(&answer["constraint_residual"]);
    assert!(
        largest >= initial && largest >= residual(&answer["final"]).abs() && largest < 1e-8,
        "{largest:e}"
    );
    for sample in answer["samples"].as_array().unwrap() {
        // The model adds in an order of its own.
        assert!(residual(&sample[1]).abs() <= largest + 1e-15);
    }
    // Coarse steps leave the constraint, also where nobody samples.
    let coarse = json!({"initial": on, "t_final": 5, "method": "rk4", "step": 0.25});
    assert!(number_of(&simulate(VESELOVA, &coarse).unwrap()["constraint_residual"]) > 1e-6);
}

#[test]
fn an_initial_state_off_the_constraint_is_an_error_with_the_nearest_that_is_not() {
    let (omega, gamma, inertia) = ([1.2, 0.4, -0.4], [0.0, 0.8, 0.6], [1.1, 1.4, 0.7]);
    let request = |initial: &Value| json!({"initial": initial, "t_final": 1});
    let result = simulate(VESELOVA, &request(&gyroscope(omega, gamma)));
    let text = result.as_ref().unwrap_err().to_string();
    assert!(text.contains("initial does not keep the constraints: residual_c1 = 0.08"), "{text}");
    assert_eq!(result.as_ref().unwrap_err().exit_code(), 2);
    let (broken, nearest) = inadmissible(result);
    assert_eq!((broken.len(), broken[0].0.as_str()), (1, "residual_c1"));
    assert!((broken[0].1 - 0.08).abs() < 1e-15);
    // Omega - I^-1 gamma (Omega . gamma)/(gamma . I^-1 gamma), and gamma as it was.
    let product: f64 = (0..3).map(|k| omega[k] * gamma[k]).sum();
    let size: f64 = (0..3).map(|k| gamma[k] * gamma[k] / inertia[k]).sum();
    for k in 0..3 {
        let expected = omega[k] - gamma[k] / inertia[k] * product / size;
        let found = number_of(&nearest[format!("Omega{}", k + 1)]);
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        assert_eq!(nearest[format!("gamma{}", k + 1)], json!(gamma[k]));
    }
    assert!(simulate(VESELOVA, &request(&nearest)).is_ok());
}

/// What is nearest is accepted, has the positions of what was given, and differs from it by a change of the velocities
/// without kinetic product with any admissible change; for constraints of every form that a state can break.
#[test]
fn the_nearest_state_is_admissible_and_nearest() {
    for (text, affine) in [(VESELOVA, true), (APPELL, false), (DRIVEN, true)] {
        let mut numbers = Numbers(11);
        let own = scene(text, "default");
        let names = own.info().state.clone();
        let momenta = |y: &Value| -> Vec<(String, f64)> {
            let answer = eval(text, &json!({"states": [y]})).unwrap();
            let of = answer["outputs"]["momentum"][0].as_object().unwrap().clone();
            of.into_iter().map(|(name, p)| (name[2..].to_owned(), number_of(&p))).collect()
        };
        let mut draw = || -> Value { names.iter().map(|n| (n.clone(), json!(numbers.next()))).collect() };
        for _ in 0..25 {
            let far = draw();
            let request = |y: &Value| json!({"initial": y, "t_final": 0});
            let (_, near) = inadmissible(simulate(text, &request(&far)));
            let again = simulate(text, &request(&near)).unwrap_or_else(|e| panic!("{e}"));
            assert!(number_of(&again["initial_residual"]) < 1e-12, "{again}");
            let velocities: Vec<String> = momenta(&far).into_iter().map(|(name, _)| name).collect();
            let difference = |a: &Value, b: &Value, name: &str| number_of(&a[name]) - number_of(&b[name]);
            for name in names.iter().filter(|name| !velocities.contains(name)) {
                assert_eq!(far[name], near[name], "{name}");
            }
            // The momenta of the change, of Lagrangians that are quadratic.
            let p: Vec<f64> = momenta(&near).iter().zip(momenta(&far)).map(|(a, b)| a.1 - b.1).collect();
            let product = |other: &Value| -> f64 {
                velocities.iter().zip(&p).map(|(name, p)| p * difference(other, &near, name)).sum()
            };
            // Another state at the same positions that keeps the constraints.
            let mut other = draw();
            for name in names.iter().filter(|name| !velocities.contains(name)) {
                other[name] = far[name].clone();
            }
            let (_, other) = inadmissible(simulate(text, &request(&other)));
            if affine {
                assert!(product(&other).abs() < 1e-10, "{}", product(&other));
            } else {
                // Nothing near is nearer: small admissible changes cost only in second order.
                let mut beside = near.clone();
                for name in &velocities {
                    let x = number_of(&near[name]);
                    beside[name] = json!(x + 1e-5 * difference(&other, &near, name));
                }
                let (_, beside) = inadmissible(simulate(text, &request(&beside)));
                let size: f64 =
                    velocities.iter().map(|n| difference(&beside, &near, n).powi(2)).sum::<f64>().sqrt();
                assert!(product(&beside).abs() <= 0.05 * size.max(1e-9), "{} {size}", product(&beside));
            }
        }
    }
}

/// Rounding of any size of motion, in components that vanish and in turns, is accepted; a millionth is not.
#[test]
fn rounding_is_admissible_at_every_scale() {
    let accepted = |text: &str, y: &Value| match simulate(text, &json!({"initial": y, "t_final": 0})) {
        Ok(_) => true,
        Err(Error::Inadmissible { .. }) => false,
        Err(other) => panic!("{other}"),
    };
    for exponent in (-140..=140).step_by(20) {
        let s = 10.0_f64.powi(exponent);
        for (gamma, omega) in [([0.0, 0.8, 0.6], [1.2, 0.3, -0.4]), ([0.0, 0.0, 1.0], [0.7, -0.2, 0.0])] {
            let omega = omega.map(|x| s * x);
            let off = |part: f64| gyroscope([omega[0], omega[1], omega[2] + part * s], gamma);
            for part in [0.0, 1e-16, -1e-13, 1e-11] {
                assert!(accepted(VESELOVA, &off(part)), "{s:e} {part:e}");
            }
            for part in [1e-6, -1e-3, 1.0] {
                assert!(!accepted(VESELOVA, &off(part)), "{s:e} {part:e}");
            }
        }
    }
    for turns in [0.0_f64, 1.0, 1e6, 1e12] {
        let theta = std::f64::consts::TAU * turns + 0.7;
        let at = |part: f64| {
            // a = 0.3 at t = 0.
            let x_dot = (0.3 + 2.0 * theta.cos()) / theta.sin() + part;
            json!({"x": 5, "y": 0, "z": 0, "theta": theta, "x_dot": x_dot, "y_dot": 2, "z_dot": 15, "theta_dot": 3})
        };
        assert!(accepted(DRIVEN, &at(0.0)), "{turns:e}");
        // What the angle's last digit amounts to cannot be told from rounding.
        let last_digit = (f64::EPSILON * theta).max(1e-9);
        assert!(!accepted(DRIVEN, &at(1e3 * last_digit)), "{turns:e}");
    }
    // At rest, nothing is broken, and nothing can be rounding.
    assert!(accepted(VESELOVA, &gyroscope([0.0; 3], [0.0, 0.8, 0.6])));
    let rest: Value = scene(DRIVEN, "default").info().state.iter().map(|n| (n.clone(), json!(0))).collect();
    let (broken, nearest) = inadmissible(simulate(DRIVEN, &json!({"initial": rest, "t_final": 0})));
    assert_eq!((broken.len(), broken[0].1), (1, -0.3));
    assert_eq!(number_of(&nearest["z_dot"]), 0.0);
}

/// Pseudo-random numbers between -2 and 2 for tests.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        4.0 * ((self.0 >> 12) as f64 / (1_u64 << 52) as f64) - 2.0
    }
}
