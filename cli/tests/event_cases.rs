//! One table of motions with events through everything that carries them out: the command with all methods, by options
//! and by JSON, ensembles, and FMUs whose C is compiled here.
//!
//! `common/event_table.rs` has the cases with what has to come out, computed without hamel. Without a C compiler the
//! test of FMUs says so and passes.

use std::collections::BTreeMap;
use std::path::Path;

use hamel_codegen::scene;
use serde_json::{Value, json};

use crate::common::fmus::{self, By, Moved};
use crate::common::program;

use crate::common::event_table::{Case, End, cases};

/// Methods with tolerances, and those with fixed steps and their steps.
const ADAPTIVE: [&str; 7] = ["auto", "tsit5", "dop853", "vern9", "gbs14", "dopri5", "taylor"];
const FIXED: [(&str, f64); 7] = [
    ("rk4", 0.002),
    ("gauss4", 0.002),
    ("gauss6", 0.05),
    ("gauss8", 0.05),
    ("gauss16", 0.2),
    ("gauss8-newton", 0.05),
    ("splitting6", 0.01),
];

/// Errors of times and states: those of the methods at these tolerances and steps, over up to twenty impacts.
const TOLERANCE: f64 = 1e-7;

/// An event that is located on rounding of the values of its function, the square root of it where it is grazed.
const GRAZED: f64 = 1e-6;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn folder() -> &'static Path {
    Path::new(env!("CARGO_TARGET_TMPDIR"))
}

/// The text of the model of a case, which starts as the case does.
fn model(case: &Case) -> String {
    let initial = case.initial.iter().map(|(name, value)| format!("initial {name} = {};", decimal(*value)));
    format!("model m {{ {} {} }}", case.model, initial.collect::<String>())
}

/// A number as the language writes it: exact for those of the cases.
fn decimal(value: f64) -> String {
    if value.abs() < 1e-20 && value != 0.0 { "1e-300".to_owned() } else { format!("{value}") }
}

fn file(case: &Case) -> String {
    let name: String = case.name.chars().filter(char::is_ascii_alphanumeric).collect();
    let path = folder().join(format!("case_{name}.hamel"));
    std::fs::write(&path, model(case)).unwrap();
    path.to_str().unwrap().to_owned()
}

fn is_close(a: f64, b: f64) -> bool {
    (a - b).abs() <= TOLERANCE * (1.0 + b.abs())
}

fn numbers(values: &Value) -> Vec<f64> {
    values.as_object().unwrap().values().map(|value| value.as_f64().unwrap()).collect()
}

/// Holds an answer, or what is said about a refusal, to a case.
fn check(case: &Case, how: &str, answer: Result<Value, String>) {
    let what = format!("{}, {how}", case.name);
    let answer = match (&case.end, answer) {
        (End::Accumulates(t), Err(told)) => {
            assert!(told.contains("accumulate"), "{what}: {told}");
            let at = told.split("accumulate at t = ").nth(1).and_then(|rest| rest.split(':').next()).unwrap();
            assert!(is_close(at.trim().parse().unwrap(), *t), "{what}: {told}");
            return;
        }
        (End::Accumulates(_), Ok(answer)) => panic!("{what}: {answer}"),
        (_, answer) => answer.unwrap_or_else(|told| panic!("{what}: {told}")),
    };
    let events = answer["events"].as_array().unwrap();
    let found: Vec<(&str, f64)> =
        events.iter().map(|e| (e["name"].as_str().unwrap(), e["t"].as_f64().unwrap())).collect();
    assert_eq!(found.len(), case.events.len(), "{what}: {found:?}");
    let tolerance = if case.name.contains("grazed") { GRAZED } else { TOLERANCE };
    for ((name, t), (expected, at)) in found.iter().zip(&case.events) {
        assert!(
            name == expected && (t - at).abs() < tolerance * (1.0 + at.abs()),
            "{what}: {name} at {t}, {expected} at {at}"
        );
    }
    match &case.end {
        End::Reached(last) => {
            let found = numbers(&answer["final"]);
            assert!(found.iter().zip(last).all(|(a, b)| is_close(*a, *b)), "{what}: {found:?}, not {last:?}");
            assert!(answer.get("ended_by").is_none(), "{what}");
        }
        End::By(name) => assert_eq!(answer["ended_by"], *name, "{what}"),
        End::Accumulates(_) => unreachable!(),
    }
}

#[test]
fn every_method_carries_the_events_out() {
    for case in cases() {
        let path = file(&case);
        let initial: BTreeMap<&str, f64> = case.initial.iter().copied().collect();
        let run = |request: Value| -> Result<Value, String> {
            let mut command = program::command(&["simulate", &path, "--via", "interpreter", "--json"]);
            let out = program::output(&mut command, &request.to_string());
            if !out.status.success() {
                return Err(text(&out.stderr));
            }
            Ok(serde_json::from_slice(&out.stdout).unwrap())
        };
        let request = json!({"initial": initial, "t_final": case.t_final});
        let with = |fields: Value| {
            let mut request = request.clone();
            let own = request.as_object_mut().unwrap();
            own.extend(fields.as_object().unwrap().clone());
            request
        };
        for method in ADAPTIVE {
            check(&case, method, run(with(json!({"method": method, "rtol": 1e-11, "atol": 1e-12}))));
        }
        // What a bound on steps changes is no event.
        check(&case, "max_step", run(with(json!({"method": "dop853", "rtol": 1e-11, "max_step": 0.03}))));
        for (method, step) in FIXED {
            let answer = run(with(json!({"method": method, "step": step})));
            match answer {
                Err(told) if method == "splitting6" && !told.contains("accumulate") => {
                    println!("{} has no exact flows: {told}", case.name);
                }
                answer => check(&case, method, answer),
            }
        }
    }
}

#[test]
fn options_of_the_command_give_what_json_gives() {
    let case = &cases()[0];
    let path = file(case);
    let table = folder().join("case_events.csv");
    let run = |more: &[&str]| {
        let mut arguments = vec!["simulate", &path, "--t-final", "3", "--events", table.to_str().unwrap()];
        arguments.extend(more);
        let out = program::output(&mut program::command(&arguments), "");
        (out.status.success(), text(&out.stdout) + &text(&out.stderr))
    };
    let (is_done, told) = run(&["--max-step", "0.01"]);
    assert!(is_done && told.contains("steps up to 0.01"), "{told}");
    // 300 steps, and those that events cut.
    assert!(told.contains(": 301 steps") || told.contains(": 302 steps"), "{told}");
    let lines = std::fs::read_to_string(&table).unwrap();
    let names: Vec<&str> = lines.lines().skip(1).filter_map(|line| line.split(',').next()).collect();
    assert_eq!(names, ["right", "up"]);
    for (bad, message) in [
        (&["--max-step", "0"][..], "--max-step is 0.0: give a positive, finite time"),
        (&["--max-step", "-1"], "--max-step is -1.0: give a positive, finite time"),
        (&["--max-step", "nan"], "is not a finite number"),
        (&["--max-step", "1", "--step", "0.1"], "--max-step is given together with a fixed step"),
        (&["--max-step", "1e-12"], "max_step 1e-12 is too small for t_final = 3.0"),
    ] {
        let (is_done, told) = run(bad);
        assert!(!is_done && told.contains(message), "{bad:?}: {told}");
    }
    let mut command = program::command(&["simulate", &path, "--json"]);
    let out = program::output(
        &mut command,
        r#"{"initial": {"x": 0, "y": 0, "x_dot": 1, "y_dot": 1}, "t_final": 1, "max_step": 0}"#,
    );
    assert!(!out.status.success() && text(&out.stderr).contains("max_step is 0.0"), "{}", text(&out.stderr));
}

#[test]
fn ensembles_bound_their_steps_and_carry_events_out() {
    let out = folder().join("case_ensemble.csv");
    let sweep = |path: &str, sweep: &str, t_final: f64, more: &[&str]| {
        let t_final = t_final.to_string();
        let mut arguments =
            vec!["ensemble", path, "--sweep", sweep, "--t-final", &t_final, "-o", out.to_str().unwrap()];
        arguments.extend(more);
        let out = program::output(&mut program::command(&arguments), "");
        (out.status.success(), text(&out.stdout) + &text(&out.stderr))
    };
    let run = |path: &str, more: &[&str]| sweep(path, "x=0.1..0.2:5", 0.5, more);
    let mut n_compared = 0;
    for case in cases().into_iter().filter(|case| case.t_final > 0.0) {
        let (name, start) = case.initial[0];
        // The motion of the case, and one beside it.
        let around = format!("{name}={start}..{}:2", start + 0.25);
        let (is_done, told) = sweep(
            &file(&case),
            &around,
            case.t_final,
            &["--method", "dop853", "--rtol", "1e-11", "--atol", "1e-12"],
        );
        let table = std::fs::read_to_string(&out).unwrap_or_default();
        let rows: Vec<Vec<&str>> = table.lines().skip(1).map(|line| line.split(',').collect()).collect();
        match &case.end {
            End::Accumulates(_) => {
                assert!(told.contains("accumulate") || table.contains("accumulate"), "{}: {told}", case.name)
            }
            End::By(event) => {
                assert!(is_done || told.contains(event), "{}: {told}", case.name);
                assert!(
                    table.contains(&format!("event {event} has ended the motion")),
                    "{}: {table}",
                    case.name
                );
            }
            End::Reached(last) => {
                assert!(is_done, "{}: {told}", case.name);
                let found: Vec<f64> = rows[0].iter().filter_map(|x| x.parse().ok()).collect();
                let is_there = |x: &f64| found.iter().any(|found| is_close(*found, *x));
                assert!(last.iter().all(is_there), "{}: {:?}, not {last:?}", case.name, rows[0]);
                // Trajectories that no event changes have steps in common.
                if !["then", "enter", "leave", "impact", "stop"].iter().any(|act| case.model.contains(act)) {
                    continue;
                }
                // The steps of `simulate` by the same method, to the last bit.
                n_compared += 1;
                let arguments = ["simulate", &file(&case), "--json"];
                let initial: BTreeMap<&str, f64> = case.initial.iter().copied().collect();
                let (rtol, atol) = (1e-11, 1e-12);
                let request = json!({"initial": initial, "t_final": case.t_final, "method": "dop853", "rtol": rtol, "atol": atol});
                let single = program::output(&mut program::command(&arguments), &request.to_string());
                let single: Value = serde_json::from_slice(&single.stdout).unwrap();
                for value in numbers(&single["final"]) {
                    assert!(found.contains(&value), "{}: {found:?} without {value}", case.name);
                }
            }
        }
        let _ = std::fs::remove_file(&out);
    }
    assert!(n_compared > 8, "{n_compared} cases were compared bit by bit");
    let free = folder().join("case_free.hamel");
    std::fs::write(
        &free,
        "model m { coordinate x in real; lagrangian = x_dot^2/2 - x^4; initial x_dot = 1; }",
    )
    .unwrap();
    let path = free.to_str().unwrap();
    for lanes in ["1", "4"] {
        let (is_done, told) = run(path, &["--lanes", lanes, "--max-step", "0.01"]);
        assert!(is_done, "{told}");
        // As many steps are too many.
        let (_, told) = run(path, &["--lanes", lanes, "--max-step", "0.01", "--max-steps", "49"]);
        assert!(told.contains("max_step 0.01 is too small for t_final = 0.5"), "{told}");
    }
    // All steps of one size, more than one.
    let (is_done, told) = run(path, &["--method", "rk4", "--step", "0.01"]);
    assert!(is_done, "{told}");
    let (is_done, told) = run(path, &["--max-step", "0"]);
    assert!(!is_done && told.contains("--max-step is 0.0"), "{told}");
}

#[test]
fn co_simulation_carries_the_events_out_whatever_the_communication_step() {
    for case in cases() {
        if case.t_final < 0.0 {
            println!("{}: FMUs have no motion backward", case.name);
            continue;
        }
        let Some(fmu) = Moved::new(case.name, &model(&case), scene::DEFAULT, By::Itself) else { return };
        for size in [0.01, 0.37, 2.0, 5.0, 10.0] {
            let told = fmu.to(case.t_final, size, &[]);
            let (what, end) = (format!("{} in steps of {size}: {told}", case.name), fmus::numbers(&told));
            match &case.end {
                End::Accumulates(t) => {
                    assert!(told.contains("stopped") && told.contains("events accumulate"), "{what}");
                    assert!((end[0] - t).abs() < 1e-6, "{what}");
                }
                End::By(_) => {
                    assert!(told.starts_with("ended"), "{what}");
                    assert!(is_close(end[0], case.events[0].1), "{what}");
                }
                End::Reached(last) => {
                    assert!(told.starts_with("reached"), "{what}");
                    // Methods of order five at a tolerance of 1e-11.
                    let is_close = |a: &f64, b: &f64| (a - b).abs() < 1e-6 * (1.0 + b.abs());
                    assert!(end[1..].iter().zip(last).all(|(a, b)| is_close(a, b)), "{what}, not {last:?}");
                }
            }
        }
    }
}
