//! The program itself: exit status, where output goes, help.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

fn xtask(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_xtask"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The program may end before it reads.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A directory of its own for a test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("hamel-xtask-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn answers_go_to_standard_output_alone() {
    let request = r#"{"states": [{"Omega1": 1, "Omega2": 0.2, "Omega3": 0.1}]}"#;
    let out = xtask(&["eval", "free_rigid_body", "--via", "interpreter"], request);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert_eq!(text(&out.stderr), "");
    let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(answer["model"], "free_rigid_body");
    assert_eq!(text(&out.stdout).lines().count(), 1);
}

#[test]
fn bad_input_has_status_two_and_a_hint() {
    let cases: [(&[&str], &str); 8] = [
        (&["eval", "free_rigid_bdy"], "did you mean `free_rigid_body`?"),
        (&["eval", "heavy_top", "--scene", "lagrang", "--via", "interpreter"], "did you mean `lagrange`?"),
        (&["eval", "heavy_top", "--via", "interpreter"], "standard input is empty"),
        (&["simulate", "heavy_top", "--set", "m"], "name=value"),
        (&["simulate", "heavy_top", "--via", "interpreter", "--initial", "Omega9=1"], "no state `Omega9`"),
        (&["simulate", "heavy_top", "--via", "interpreter", "--initial", "qw=1"], "with --reconstruct only"),
        (&["simulate", "heavy_top", "--scene", "lagrange", "--reconstruct"], "leave out --scene lagrange"),
        (&["simulate", "heavy_top", "-o", "top.pdf"], ".csv, .svg or .json"),
    ];
    for (arguments, hint) in cases {
        let out = xtask(arguments, "");
        assert_eq!(out.status.code(), Some(2), "{arguments:?}");
        assert_eq!(text(&out.stdout), "", "{arguments:?}");
        assert!(text(&out.stderr).contains(hint), "{arguments:?}: {}", text(&out.stderr));
    }
}

#[test]
fn a_file_of_ones_own_is_interpreted() {
    let folder = Folder::new("own");
    let path = folder.file("mine.hamel");
    std::fs::write(&path, "model mine { coordinate x in real; lagrangian = 1/2*x_dot^2 - 2*x^2; }").unwrap();
    let out = xtask(&["eval", &path], r#"{"states": [{"x": 1, "x_dot": 3}]}"#);
    assert!(out.status.success(), "{}", text(&out.stderr));
    assert!(text(&out.stderr).contains("evaluated by the interpreter"));
    let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    assert_eq!(answer["derivatives"], serde_json::json!([[3.0, -4.0]]));
    std::fs::write(&path, "model mine { coordinate x in real; lagrangian = 1/2*x_dt^2; }").unwrap();
    let out = xtask(&["explain", &path], "");
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("mine.hamel:1:"), "{}", text(&out.stderr));
}

#[test]
fn a_simulation_writes_all_formats() {
    let folder = Folder::new("formats");
    let files = ["top.csv", "top.svg", "top.json"].map(|name| folder.file(name));
    let arguments = ["simulate", "heavy_top", "--via", "interpreter", "--t-final", "1", "--samples", "11"];
    let outputs = files.iter().flat_map(|file| ["-o", file.as_str()]);
    let out = xtask(&arguments.into_iter().chain(outputs).collect::<Vec<_>>(), "");
    assert!(out.status.success(), "{}", text(&out.stderr));
    let summary = text(&out.stdout);
    assert!(summary.contains("drift") && summary.contains("Gamma3"), "{summary}");
    let csv = std::fs::read_to_string(&files[0]).unwrap();
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 12);
    assert!(lines[0].starts_with("t,Omega1,Omega2,Omega3,Gamma1,Gamma2,Gamma3,energy,"), "{}", lines[0]);
    let columns = lines[0].split(',').count();
    for line in &lines[1..] {
        let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
        assert_eq!(numbers.len(), columns);
    }
    let svg = std::fs::read_to_string(&files[1]).unwrap();
    assert!(svg.starts_with("<svg ") && svg.contains("Ω₁") && svg.contains("[rad/s]"));
    let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&files[2]).unwrap()).unwrap();
    assert_eq!(json["samples"].as_array().unwrap().len(), 11);
}

#[test]
fn a_reconstructed_simulation_draws_the_path() {
    let folder = Folder::new("path");
    let files = ["robot.svg", "robot.json", "robot.csv"].map(|name| folder.file(name));
    let arguments = ["simulate", "mobile_robot", "--reconstruct", "--via", "interpreter", "--initial", "x=1"];
    let outputs = files.iter().flat_map(|file| ["-o", file.as_str()]);
    let out = xtask(&arguments.into_iter().chain(outputs).collect::<Vec<_>>(), "");
    assert!(out.status.success(), "{}", text(&out.stderr));
    let svg = std::fs::read_to_string(&files[0]).unwrap();
    assert!(svg.contains("Heading [rad]") && svg.contains("Position of P [m]"));
    assert!(svg.contains("Path: position of P") && svg.contains("y [m]"));
    let json: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&files[1]).unwrap()).unwrap();
    assert_eq!(json["reconstruction"].as_object().unwrap().len(), 3);
    assert!(json["final"].get("x").is_none());
    let csv = std::fs::read_to_string(&files[2]).unwrap();
    assert!(csv.starts_with("t,psi1,psi2,psi1_dot,psi2_dot,theta,x,y,energy"));
    assert!(csv.lines().nth(1).unwrap().starts_with("0.0,0.0,0.0,-4.0,-6.0,0.0,1.0,0.0,"));
}

#[test]
fn every_command_has_help_with_an_example() {
    for command in ["generate", "list", "explain", "eval", "simulate", "test"] {
        let out = xtask(&[command, "--help"], "");
        assert!(out.status.success());
        assert!(text(&out.stdout).contains(&format!("cargo xtask {command}")), "{command}");
    }
}
