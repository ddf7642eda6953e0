//! The machine interfaces `eval` and `simulate --json`: shapes of answers, and what each mistake is told.

use hamel_codegen::spec;
use serde_json::{Value, json};
use xtask::backend::{Backend, Local};
use xtask::codegen_bridge as bridge;
use xtask::commands::{Choice, Via, eval_text, reconstruct_text, simulate_text};
use xtask::error::{Error, Problem};

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

fn backend(text: &str, scene: &str) -> Local<bridge::Built> {
    let model = spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    Local::new(bridge::build(&model, scene).unwrap_or_else(|e| panic!("{e}")))
}

fn eval(text: &str, request: &Value) -> Result<Value, Error> {
    let answer = eval_text(&mut backend(text, "default"), &request.to_string())?;
    Ok(serde_json::from_str(&answer).expect("JSON"))
}

fn simulate(text: &str, request: &Value) -> Result<Value, Error> {
    let answer = simulate_text(&mut backend(text, "default"), &request.to_string())?;
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
    let text = eval_text(&mut backend(TOP, "default"), &request.to_string()).unwrap();
    assert!(!text.contains('\n'));
    let answer: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(answer["outputs"]["momentum"][0]["p_Omega1"].as_f64().unwrap().to_bits(), (2.0 * x).to_bits());
}

#[test]
fn a_scene_without_energy_answers_null() {
    let request = json!({"states": [state([1.0, 2.0, 3.0])]}).to_string();
    let answer = eval_text(&mut backend(TOP, "bare"), &request).unwrap();
    let answer: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answer["energy"], Value::Null);
    assert_eq!(answer["outputs"], json!({}));
    let request = json!({"initial": state([1.0, 2.0, 3.0]), "t_final": 1}).to_string();
    let answer = simulate_text(&mut backend(TOP, "bare"), &request).unwrap();
    let answer: Value = serde_json::from_str(&answer).unwrap();
    assert_eq!(answer["energy_drift"], Value::Null);
}

#[test]
fn every_model_has_a_scene_of_derivatives() {
    let request = json!({"states": [state([1.0, 2.0, 3.0])]}).to_string();
    let answer = eval_text(&mut backend(TOP, "derivatives"), &request).unwrap();
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
    let result = eval_text(&mut backend(TOP, "default"), text);
    assert!(
        matches!(result, Err(Error::Request { problems }) if matches!(problems[0], Problem::Repeated { .. }))
    );
}

#[test]
fn text_that_is_not_json_is_an_error_with_its_place() {
    let result = eval_text(&mut backend(TOP, "default"), "{\"states\": [NaN]}");
    assert!(matches!(&result, Err(Error::NotJson { reason, empty: false }) if reason.contains("line 1")));
    for text in ["", "  \n"] {
        let result = eval_text(&mut backend(TOP, "default"), text);
        assert!(matches!(result, Err(Error::NotJson { empty: true, .. })));
    }
    let result = eval_text(&mut backend(TOP, "default"), "{\"states\": [{\"Omega1\": 1e999}]}");
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
    match eval(BEAD, &request) {
        Err(Error::State { path, reason }) => {
            assert_eq!(path, "states[1]");
            assert!(reason.contains("singular") || reason.contains("not finite"), "{reason}");
        }
        other => panic!("{other:?}"),
    }
    match eval(TOP, &json!({"states": [state([1.0, 1e300, 1e300])]})) {
        Err(Error::State { path, reason }) => {
            assert_eq!(path, "states[0]");
            assert!(reason.contains("Omega1"), "{reason}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn simulate_answers_in_the_documented_shape() {
    let request = json!({"params": {"I1": 2}, "initial": state([1.0, 0.2, 0.1]), "t_final": 4, "method": "tsit5",
        "rtol": 1e-10, "atol": 1e-12, "samples": 5});
    let answer = simulate(TOP, &request).unwrap();
    assert_eq!(keys(&answer), ["t", "final", "samples", "steps", "rejected", "rhs_evals", "energy_drift"]);
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
        ("gauss4-newton", Some(1e-3)),
        ("gauss6-newton", Some(0.01)),
        ("gauss8-newton", Some(0.02)),
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
    for method in ["gauss4", "gauss6", "gauss8"] {
        let Err(error) = simulate(STIFF, &request(method)) else { panic!("{method} converged") };
        let words = format!("take a smaller step, or {method}-newton");
        assert!(error.to_string().contains(&words), "{error}");
        // What is recommended works.
        let answer = simulate(STIFF, &request(&format!("{method}-newton"))).unwrap();
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
            .contains("methods: tsit5, dop853, vern9, dopri5, rk4, gauss4, gauss6")
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
    let model = spec::parse("veselova.hamel", VESELOVA).unwrap_or_else(|e| panic!("{e}"));
    let mut backend = Local::new(bridge::build(&model, "default").unwrap_or_else(|e| panic!("{e}")));
    let params = bridge::all_params(&model, "default", &Default::default());
    let roles = bridge::roles(&model, &params);
    let values = backend.info().defaults();
    let given = [("Omega1".to_owned(), 2.0)].into();
    let start = |backend: &mut Local<bridge::Built>, given| {
        let none = Default::default();
        xtask::initial::state(backend, None, (&values, &[]), &roles, &none, given).unwrap()
    };
    for (given, first) in [(&Default::default(), None), (&given, Some(2.0))] {
        let y = start(&mut backend, given);
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
    let model = spec::parse("test.hamel", SLEIGH).unwrap_or_else(|e| panic!("{e}"));
    let mut backend = backend(SLEIGH, "reconstruction");
    let answer = reconstruct_text(&mut backend, &model, &request.to_string())?;
    Ok(serde_json::from_str(&answer).expect("JSON"))
}

#[test]
fn simulate_reconstructs_the_group_beside_the_state() {
    let mut request = json!({"initial": {"omega": 0, "v1": 1.5}, "t_final": 2, "samples": 3,
        "reconstruct": {"theta": 0.3, "x": 1, "y": -1}});
    let answer = reconstruct(&request).unwrap();
    let expected =
        ["t", "final", "samples", "steps", "rejected", "rhs_evals", "energy_drift", "reconstruction"];
    assert_eq!(keys(&answer), expected);
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
    let choice = |scene: &str| Choice { model: "any".into(), scene: scene.into(), via: Via::Interpreter };
    let told = |model: &str, scene: &str| match choice(scene)
        .reconstructing(&spec::parse("test.hamel", model).unwrap_or_else(|e| panic!("{e}")), "reconstruct")
    {
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
    // The energy changes, and the momentum is a component of the state.
    let damped = "model damped { coordinate q in real; lagrangian = q_dot^2/2; force q_dot = -q_dot; }";
    let request = json!({"initial": {"q": 1, "q_dot": 1}, "t_final": 1, "method": "projected"});
    let error = simulate(damped, &request).unwrap_err().to_string();
    assert!(error.contains("has no invariant besides components of its state"), "{error}");
}

fn number_of(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn auto_takes_a_method_that_suits_tolerance_and_scene() {
    let request = |method: &str, rtol: f64| {
        let initial = state([1.0, 2.0, 3.0]);
        json!({"initial": initial, "t_final": 5, "method": method, "rtol": rtol, "atol": rtol})
    };
    let answer = |method: &str, rtol: f64| simulate(TOP, &request(method, rtol)).unwrap();
    // A cheap scene, and the interpreter has series for any.
    for rtol in [1e-5, 1e-12] {
        assert_eq!(answer("auto", rtol), answer("taylor", rtol));
    }
    let fixed = json!({"initial": state([1.0, 2.0, 3.0]), "t_final": 1, "method": "auto", "step": 0.1});
    assert!(problems(simulate(TOP, &fixed))[0].to_string().contains("auto chooses by tolerances"));
}
