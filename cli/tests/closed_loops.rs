//! Coordinates that equations give, on the command line: initial values, what cannot be met, drift.

use std::path::PathBuf;
use std::process::{Command, Output};

/// A four-bar linkage whose crank turns all the way round.
const FOUR_BAR: &str = "/// Four-bar linkage
model four_bar {
    param a = 0.3 where a > 0;
    param b = 0.9 where b > 0;
    param c = 0.7 where c > 0;
    param d = 0.8;
    coordinate alpha in angle;
    coordinate beta, gamma in angle by
        a*[cos(alpha), sin(alpha)] + b*[cos(beta), sin(beta)] - c*[cos(gamma), sin(gamma)] = [d, 0];
    lagrangian = alpha_dot^2 + beta_dot^2 + gamma_dot^2 - 9.81*(sin(beta) + sin(gamma))/4;
    initial alpha = 1;
    initial alpha_dot = 4;
    initial beta = 0.5;
    initial gamma = 1.5;
    scene kept { want rhs, energy, invariants, constraint; }
}
";

fn file() -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("four_bar.hamel");
    std::fs::write(&path, FOUR_BAR).unwrap();
    path
}

fn hamel(arguments: &[&str]) -> Output {
    let path = file();
    let (command, rest) = arguments.split_first().unwrap();
    Command::new(env!("CARGO_BIN_EXE_hamel"))
        .env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
        .arg(command)
        .arg(path)
        .args(rest)
        .output()
        .unwrap()
}

/// The number behind a word of the first line that contains it.
fn number(text: &str, word: &str) -> f64 {
    let line = text.lines().find(|line| line.contains(word)).unwrap_or_else(|| panic!("{word}: {text}"));
    let behind = line.split(word).nth(1).unwrap().split_whitespace().next().unwrap();
    behind.parse().unwrap_or_else(|e| panic!("{behind}: {e}"))
}

#[test]
fn a_scene_without_a_coordinate_keeps_the_equations_of_the_others() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let simulate = |name: &str, text: &str, scene: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        Command::new(env!("CARGO_BIN_EXE_hamel"))
            .args(["simulate", path.to_str().unwrap(), "--scene", scene, "--t-final", "1"])
            .output()
            .unwrap()
    };
    let crank = "model crank {
        coordinate theta in angle;
        coordinate phi in angle by sin(theta) + 3*sin(phi) = 0;
        coordinate x in real by x = cos(theta) + 3*cos(phi);
        lagrangian = theta_dot^2*(2 + cos(phi)) + phi_dot^2;
        initial theta = 1/2; initial theta_dot = 1;
    }";
    for scene in ["default", "minimal"] {
        let out = simulate("crank.hamel", crank, scene);
        let text = String::from_utf8(out.stdout).unwrap();
        assert_eq!(text.contains("\n  x "), scene == "default", "{text}");
        let phi = number(&text, "  phi");
        assert!((phi + (0.5_f64.sin() / 3.0).asin()).abs() < 1e-15, "{scene}: {phi}");
    }
    // Both equations contain the coordinate that is left out.
    let tied = "model tied {
        coordinate theta in angle;
        coordinate phi, psi in angle by [sin(theta) + 3*sin(phi) + psi, phi + 2*psi - theta] = [0, 0];
        lagrangian = theta_dot^2*(2 + cos(phi));
        initial theta = 1/2; initial theta_dot = 1;
        scene without { drop psi; want rhs; }
    }";
    let out = simulate("tied.hamel", tied, "without");
    let text = String::from_utf8(out.stderr).unwrap();
    assert!(!out.status.success() && text.contains("leaves out a coordinate"), "{text}");
}

#[test]
fn initial_values_are_found_on_the_branch_of_the_model_and_kept() {
    let out = hamel(&["simulate", "--scene", "kept", "--method", "projected", "--t-final", "50"]);
    let text = String::from_utf8(out.stdout).unwrap();
    assert!(out.status.success(), "{text}{}", String::from_utf8_lossy(&out.stderr));
    let (beta, gamma) = (number(&text, "  beta"), number(&text, "  gamma"));
    let (a, b, c, d) = (0.3, 0.9, 0.7, 0.8);
    let x = a * 1.0_f64.cos() + b * beta.cos() - c * gamma.cos() - d;
    let y = a * 1.0_f64.sin() + b * beta.sin() - c * gamma.sin();
    // Shortest digits of doubles.
    assert!(x.abs() < 1e-15 && y.abs() < 1e-15, "{x} {y}");
    assert!(0.0 < beta && beta < gamma && gamma < 1.6, "{text}");
    // A crank that has turned thirty times is rounded by 3e-14, of which its length, 0.3, comes into the residual.
    assert!(number(&text, "residual at most") < 1e-14, "{text}");
}

#[test]
fn what_cannot_be_met_is_told_with_what_is_left() {
    let out = hamel(&["simulate", "--set", "a=5", "--t-final", "1"]);
    let text = String::from_utf8(out.stderr).unwrap();
    assert!(
        !out.status.success() && text.contains("equations between coordinates are violated by"),
        "{text}"
    );
    let given = ["alpha=1", "beta=0.5", "gamma=1.5"];
    let mut arguments = vec!["simulate", "--t-final", "1"];
    given.iter().for_each(|value| arguments.extend(["--initial", value]));
    let out = hamel(&arguments);
    let text = String::from_utf8(out.stderr).unwrap();
    // 0.3 cos 1 + 0.9 cos 0.5 - 0.7 cos 1.5 - 0.8.
    assert!(!out.status.success() && text.contains("position_beta = 0.1023"), "{text}");
}

#[test]
fn an_fmu_begins_where_the_equations_are_met() {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("four_bar.fmu");
    let out = hamel(&["generate", "--language", "fmu", "--output", path.to_str().unwrap()]);
    let told = String::from_utf8_lossy(&out.stderr);
    if told.contains("no C compiler") {
        println!("skipped: {told}");
        return;
    }
    assert!(out.status.success(), "{told}");
    // What an FMU consists of is not compressed.
    let text = String::from_utf8_lossy(&std::fs::read(&path).unwrap()).into_owned();
    let start = |name: &str| -> f64 {
        let own = text.split(&format!("<Float64 name=\"{name}\"")).nth(1).unwrap();
        own.split("start=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
    };
    let (a, b, c, d) = (0.3, 0.9, 0.7, 0.8);
    let [alpha, beta, gamma] = ["alpha", "beta", "gamma"].map(start);
    assert_eq!(alpha, 1.0);
    let x = a * alpha.cos() + b * beta.cos() - c * gamma.cos() - d;
    let y = a * alpha.sin() + b * beta.sin() - c * gamma.sin();
    assert!(x.abs() < 1e-15 && y.abs() < 1e-15, "{x} {y}");
}

#[test]
fn every_method_keeps_the_loop_closed() {
    for method in [["vern9", "1e-6"], ["dopri5", "1e-4"]] {
        let [name, rtol] = method;
        let arguments = ["simulate", "--scene", "kept", "--method", name, "--rtol", rtol, "--t-final", "20"];
        let out = hamel(&arguments);
        let text = String::from_utf8(out.stdout).unwrap();
        assert!(out.status.success(), "{text}{}", String::from_utf8_lossy(&out.stderr));
        assert!(number(&text, "residual at most") < 1e-14, "{name}: {text}");
    }
}

#[test]
fn a_dead_centre_is_told() {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("dead_centre.hamel");
    let text = "model slider_crank {
        param r = 0.3; param l = 0.9;
        coordinate theta in angle;
        coordinate phi in angle by r*sin(theta) + l*sin(phi) = 0;
        lagrangian = theta_dot^2 + phi_dot^2;
        initial theta = 0.4;
        initial phi = pi/2;
    }";
    std::fs::write(&path, text).unwrap();
    let out = Command::new(env!("CARGO_BIN_EXE_hamel"))
        .args(["simulate", path.to_str().unwrap(), "--t-final", "1"])
        .output()
        .unwrap();
    let text = String::from_utf8(out.stderr).unwrap();
    assert!(!out.status.success() && text.contains("(position_phi), at a dead centre"), "{text}");
}
