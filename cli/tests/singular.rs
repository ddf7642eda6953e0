//! Motions into singular places, on the command line: poles, lost ranks of constraints on velocities, and places that
//! only look singular. Equations between coordinates are in `folds`.

use std::path::PathBuf;
use std::process::Command;

/// What a run of a model says: whether it succeeded, its output and its messages.
fn simulate(name: &str, text: &str, arguments: &[&str]) -> (bool, String, String) {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, text).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_hamel"))
        .env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
        .args(["simulate", path.to_str().unwrap()])
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.success(), text(output.stdout), text(output.stderr))
}

const POLE: &str = include_str!("../../codegen/tests/edges/pole_in_force.hamel");

#[test]
fn fixed_steps_do_not_walk_through_a_pole_of_a_force() {
    for (method, step) in [("rk4", "0.3"), ("rk4", "0.03"), ("vern9", "0.3"), ("gauss8", "0.03")] {
        let arguments = ["--method", method, "--step", step, "--t-final", "2"];
        let (succeeds, _, message) = simulate("pole.hamel", POLE, &arguments);
        assert!(!succeeds, "{method} {step} passes the pole");
        assert!(message.contains("pivot t - 1/2 passes through zero"), "{method} {step}: {message}");
    }
}

/// `(1 - cos x)/x` has the value zero at zero.
#[test]
fn a_quotient_that_has_a_value_is_passed() {
    let text = "model soft { coordinate x in real; lagrangian = x_dot^2/2; force x_dot = -(1 - cos(x))/x;
        initial x = 1; initial x_dot = -1; }";
    let mut ends = Vec::new();
    for (method, step) in [("rk4", "0.01"), ("vern9", "0.1"), ("gauss8", "0.03")] {
        let (succeeds, text, message) =
            simulate("soft.hamel", text, &["--method", method, "--step", step, "--t-final", "2"]);
        assert!(succeeds, "{method}: {message}");
        ends.push(text.lines().find(|line| line.contains("x ")).map(str::to_owned));
    }
    assert!(ends[0].is_some(), "{ends:?}");
}

/// Nonholonomic constraints whose one-forms are one where `x` is zero, by every method; and two whose forms have
/// factors there, which lose nothing.
#[test]
fn constraints_that_fold_together_stop_every_method() {
    let model = |constraints: &str| {
        format!(
            "model folding {{
                coordinate x, y, z in real;
                lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2;
                {constraints}
                multipliers;
                initial x = 1; initial x_dot = -0.5; initial y_dot = 0.1;
            }}"
        )
    };
    let opposed = model("constraint y_dot = x*z_dot; constraint y_dot = -x*z_dot;");
    let bent =
        model("constraint y_dot = x*z_dot + z_dot; constraint sin(x)*z_dot + y_dot = x*x_dot + z_dot;");
    let with_factors = model("constraint x*y_dot = x*sin(z)*z_dot;");
    let [opposed, bent] = [opposed, bent].map(|text| text.replace(" initial y_dot = 0.1;", ""));
    let explicit = [
        "tsit5", "dopri5", "dop853", "vern9", "gbs14", "taylor", "rk4", "gauss4", "gauss6", "gauss8",
        "gauss16", "auto",
    ];
    for (name, text, stops) in
        [("opposed", opposed, true), ("bent", bent, true), ("factors", with_factors, false)]
    {
        for method in explicit {
            let steps: &[&str] =
                if method == "rk4" || method.starts_with("gauss") { &["--step", "0.03"] } else { &[] };
            let arguments = [&["--t-final", "6", "--method", method], steps].concat();
            let (succeeds, output, message) = simulate(&format!("{name}.hamel"), &text, &arguments);
            assert_eq!(succeeds, !stops, "{name} {method}: {output}{message}");
            // Steps that shrink next to the place may stop at the pivot, and stages of implicit ones do not converge
            // there.
            let is_named =
                ["the constraints depend on each other", "pivot response to constraint", "did not converge"];
            assert!(
                !stops || is_named.iter().any(|told| message.contains(told)),
                "{name} {method}: {message}"
            );
        }
    }
}

/// Gradients that turn all the way round, in long steps, keep their rank.
#[test]
fn a_pendulum_in_place_coordinates_goes_round() {
    let text = "model pendulum {
        coordinate x in real;
        coordinate y in real by x^2 + y^2 = 1;
        lagrangian = x_dot^2/2 + y_dot^2/2;
        multipliers;
        initial x = 1; initial x_dot = 0; initial y = 0; initial y_dot = 1;
    }";
    for method in ["dop853", "gbs14", "vern9"] {
        let arguments = ["--t-final", "60", "--method", method, "--rtol", "1e-6"];
        let (succeeds, output, message) = simulate("pendulum.hamel", text, &arguments);
        assert!(succeeds, "{method}: {output}{message}");
    }
}

/// The warning of an energy that moves is one of adaptive steps as well: at a tolerance that is none.
#[test]
fn adaptive_steps_tell_that_an_energy_moves() {
    let text = "model oscillator { coordinate x in real; lagrangian = x_dot^2/2 - x^4/4;
        initial x = 1; initial x_dot = 1; }";
    let arguments = ["--t-final", "20000", "--rtol", "1e-4", "--atol", "1e-4", "--method", "tsit5"];
    let (succeeds, output, message) = simulate("oscillator.hamel", text, &arguments);
    assert!(succeeds, "{message}");
    assert!(message.contains("the energy is conserved but moved"), "{output}{message}");
}
