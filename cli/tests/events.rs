//! Events and sections of the program: what happens along a motion, when, and what is written about it.

use std::process::Output;

use serde_json::{Value, json};

use crate::common::program;

fn hamel(arguments: &[&str], input: &str) -> Output {
    program::output(&mut program::command(arguments), input)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The answer to a request about a model that is a file, or shipped.
fn answer(model: &str, request: &Value) -> Value {
    let out = hamel(&["simulate", model, "--via", "interpreter", "--json"], &request.to_string());
    assert!(out.status.success(), "{}", text(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

/// What is said about a request that is refused.
fn refusal(model: &str, request: &Value) -> String {
    let out = hamel(&["simulate", model, "--via", "interpreter", "--json"], &request.to_string());
    assert!(!out.status.success(), "{}", text(&out.stdout));
    text(&out.stderr)
}

/// A file in a folder of the tests.
fn file(name: &str, text: &str) -> String {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("events_{name}"));
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

const BALL: &str = "/// A ball above the ground.
model ball {
    param e = 0.8 where e >= 0;
    param g = 9.81;
    coordinate z in real;
    lagrangian = z_dot^2/2 - g*z;
    event impact = z falling { then z_dot = -e*z_dot; }
    event top = z_dot falling;
    event late = t - 6 { stop; }
    scene free { want rhs, energy; }
} // { the end }
";

fn list(value: &Value) -> &[Value] {
    value.as_array().map(Vec::as_slice).unwrap_or_default()
}

fn times(answer: &Value, name: &str) -> Vec<f64> {
    let own = list(&answer["events"]).iter().filter(|e| e["name"] == name);
    own.map(|e| e["t"].as_f64().unwrap()).collect()
}

#[test]
fn a_ball_bounces_at_the_times_of_its_closed_form() {
    let model = file("bounces.hamel", BALL);
    let request = json!({"initial": {"z": 0, "z_dot": 9.81}, "t_final": 20, "samples": 5});
    let answer = answer(&model, &request);
    let (mut expected, mut flight) = (2.0, 2.0);
    let impacts = times(&answer, "impact");
    assert_eq!(impacts.len(), 4);
    for t in impacts {
        assert!((t - expected).abs() < 1e-12, "{t} instead of {expected}");
        flight *= 0.8;
        expected += flight;
    }
    assert_eq!(times(&answer, "top").len(), 4, "{answer}");
    assert!((times(&answer, "top")[0] - 1.0).abs() < 1e-12);
    // The state of an event is the one before it.
    let first = list(&answer["events"]).iter().find(|e| e["name"] == "impact").unwrap();
    assert!((first["state"]["z_dot"].as_f64().unwrap() + 9.81).abs() < 1e-11);
    assert_eq!((&answer["ended_by"], answer["t"].as_f64()), (&json!("late"), Some(6.0)));
    // Samples after the end are missing; the energy is kept between impacts.
    assert_eq!(list(&answer["samples"]).len(), 2);
    assert!(answer["energy_drift"].as_f64().unwrap() < 1e-11);

    // A scene without events falls through the ground.
    let out = hamel(&["simulate", &model, "--scene", "free", "--json"], &request.to_string());
    let free: Value = serde_json::from_slice(&out.stdout).unwrap();
    assert!(free.get("events").is_none() && free.get("ended_by").is_none());
    assert!(free["final"]["z"].as_f64().unwrap() < -1000.0);
}

#[test]
fn impacts_without_end_are_told() {
    let model = file("zeno.hamel", &BALL.replace("event late = t - 6 { stop; }", ""));
    let request = json!({"initial": {"z": 0, "z_dot": 9.81}, "t_final": 100});
    let told = refusal(&model, &request);
    assert!(told.contains("event impact: events of function 0 accumulate at t = 9.99999"), "{told}");
    let mut few = request.clone();
    few["max_events"] = json!(3);
    let told = refusal(&model, &few);
    assert!(told.contains("limit of 3 events reached"), "{told}");
}

#[test]
fn a_billiard_keeps_energy_and_angular_momentum() {
    let text = "model billiard {
        coordinate x, y in real;
        lagrangian = (x_dot^2 + y_dot^2)/2;
        let into = 2*(x*x_dot + y*y_dot)/(x^2 + y^2);
        event wall = x^2 + y^2 - 1 rising {
            then x_dot = x_dot - into*x;
            then y_dot = y_dot - into*y;
        }
        output turning = x*y_dot - y*x_dot;
    }";
    let model = file("billiard.hamel", text);
    let initial = json!({"x": 0.3, "y": 0.0, "x_dot": 0.2, "y_dot": 1.0});
    let answer = answer(&model, &json!({"initial": initial, "t_final": 50, "samples": 101}));
    let walls = times(&answer, "wall");
    // Chords of one length: of a line that passes the centre at the distance L/|v|.
    let speed = 1.04_f64.sqrt();
    let chord = 2.0 * (1.0 - (0.3 / speed).powi(2)).sqrt() / speed;
    assert!(walls.len() > 25);
    for pair in walls.windows(2) {
        assert!((pair[1] - pair[0] - chord).abs() < 1e-11, "{pair:?}, {chord}");
    }
    for sample in list(&answer["samples"]) {
        let of = |name: &str| sample[1][name].as_f64().unwrap();
        let turning = of("x") * of("y_dot") - of("y") * of("x_dot");
        assert!((turning - 0.3).abs() < 1e-12, "{turning}");
        assert!(of("x").hypot(of("y")) < 1.0 + 1e-12);
    }
    assert!(answer["energy_drift"].as_f64().unwrap() < 1e-12);
}

#[test]
fn sections_of_a_closed_orbit_are_one_point() {
    // The free rigid body: its angular velocity is periodic.
    let request = json!({
        "params": {"I1": 1, "I2": 2, "I3": 3},
        "initial": {"Omega1": 1, "Omega2": 0.1, "Omega3": 0.3},
        "t_final": 100,
        "rtol": 1e-13,
        "atol": 1e-13,
        "method": "vern9",
        "sections": ["Omega2 rising", "Omega2 - 10"],
    });
    let answer = answer("free_rigid_body", &request);
    let events = list(&answer["events"]);
    assert!(events.len() > 5, "{answer}");
    let of = |event: &Value, name: &str| event["state"][name].as_f64().unwrap();
    for event in events {
        assert_eq!(event["name"], "section1");
        for name in ["Omega1", "Omega2", "Omega3"] {
            assert!((of(event, name) - of(&events[0], name)).abs() < 1e-10, "{event}");
        }
    }
    let times = times(&answer, "section1");
    for pair in times.windows(2) {
        assert!((pair[1] - pair[0] - (times[1] - times[0])).abs() < 1e-9);
    }
}

#[test]
fn a_pendulum_has_the_period_of_its_elliptic_integral() {
    let model =
        file("pendulum.hamel", "model pendulum { coordinate q in angle; lagrangian = q_dot^2/2 + cos(q); }");
    let amplitude: f64 = 2.0;
    // 4 K(k) = 2 pi / agm(1, cos(amplitude/2)).
    let (mut a, mut b) = (1.0_f64, (0.5 * amplitude).cos());
    for _ in 0..10 {
        (a, b) = (0.5 * (a + b), (a * b).sqrt());
    }
    let period = 2.0 * std::f64::consts::PI / a;
    let tight = json!({"rtol": 1e-13, "atol": 1e-13});
    for method in ["vern9", "dop853", "taylor", "gbs14"] {
        let mut request = json!({"initial": {"q": amplitude, "q_dot": 0}, "t_final": 80, "method": method,
                                 "sections": ["q falling"]});
        request.as_object_mut().unwrap().extend(tight.as_object().unwrap().clone());
        let times = times(&answer(&model, &request), "section1");
        assert!(times.len() >= 8, "{method}");
        for (n, t) in times.iter().enumerate() {
            let expected = (n as f64 + 0.25) * period;
            assert!((t - expected).abs() < 1e-10, "{method}: {t} instead of {expected}");
        }
    }
}

#[test]
fn sections_are_expressions() {
    let initial = json!({"Omega1": 1, "Omega2": 0.1, "Omega3": 0.3});
    for (section, expected) in [
        ("Omega9", "unknown name `Omega9`"),
        ("Omega", "must watch a number, found vector(3)"),
        ("1; param x = 1", "give one expression"),
        ("I1 - 1", "without state and time"),
        ("Omega1 upwards", "expected `rising`, `falling`, `{` or `;`, found `upwards`"),
    ] {
        let told =
            refusal("free_rigid_body", &json!({"initial": initial, "t_final": 1, "sections": [section]}));
        assert!(told.contains(expected), "{section}: {told}");
    }
    let told = refusal("free_rigid_body", &json!({"initial": initial, "t_final": 1, "sections": "Omega1"}));
    assert!(told.contains("list of texts"), "{told}");
    let many: Vec<String> = (0..33).map(|k| format!("Omega1 - {k}")).collect();
    let told = refusal("free_rigid_body", &json!({"initial": initial, "t_final": 1, "sections": many}));
    assert!(told.contains("more than 32"), "{told}");
}

#[test]
fn a_reset_that_violates_a_constraint_is_told() {
    let text = |value: &str| {
        format!(
            "model skate {{
                velocity omega, v in se(2);
                lagrangian = (omega^2 + dot(v, v))/2;
                constraint v2 = 0;
                multipliers;
                event kick = t - 1 {{ then v = {value}; }}
            }}"
        )
    };
    let request = json!({"initial": {"omega": 1, "v1": 1, "v2": 0}, "t_final": 2});
    let told = refusal(&file("violates.hamel", &text("[1, 1]")), &request);
    assert!(told.contains("event kick violates the constraint: its residual is 1.0e0 after it"), "{told}");
    let kept = answer(&file("keeps.hamel", &text("[-2*v1, v2]")), &request);
    assert!((kept["final"]["v1"].as_f64().unwrap().abs() - 2.0).abs() < 1e-10, "{kept}");
}

#[test]
fn events_are_summarised_and_written() {
    let model = file("written.hamel", BALL);
    let [table, picture] = ["events.csv", "events.svg"].map(|name| {
        std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name).to_str().unwrap().to_owned()
    });
    let out = hamel(
        &[
            "simulate",
            &model,
            "--initial",
            "z=0",
            "z_dot=9.81",
            "--t-final",
            "20",
            "--section",
            "z - 1 rising",
            "--events",
            &table,
            "--events",
            &picture,
            "--plane",
            "z_dot,z",
        ],
        "",
    );
    let said = text(&out.stdout);
    assert!(out.status.success(), "{}", text(&out.stderr));
    for expected in [
        "events     impact 4 times, last at t = 5.90",
        "late 1 times",
        "section1 4 times",
        "ended by event late",
    ] {
        assert!(said.contains(expected), "{expected:?} is not in\n{said}");
    }
    let table = std::fs::read_to_string(table).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!((lines[0], lines.len()), ("event,t,z,z_dot", 1 + 13));
    assert!(lines[1].starts_with("section1,0.107"), "{}", lines[1]);
    let picture = std::fs::read_to_string(picture).unwrap();
    // A point for each, and one for each name.
    assert_eq!(picture.matches("<circle").count(), 13 + 4);
    let out = hamel(&["simulate", &model, "--events", "events.txt"], "");
    assert!(text(&out.stderr).contains("let the name end in .csv, .svg, .png or .pdf"));
    // Ensembles carry events out, each trajectory its own.
    let many = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("many_impacts.csv");
    let many = many.to_str().unwrap();
    let out = hamel(&["ensemble", &model, "--spread", "e=0.1", "--count", "3", "-o", many], "");
    assert!(!out.status.success(), "{}", text(&out.stdout));
    let table = std::fs::read_to_string(many).unwrap();
    assert_eq!(table.matches("event impact: events of function 0 accumulate").count(), 3, "{table}");
}
