//! Inputs on the command line: expressions, tables, and the linear system.

use std::process::Output;

use crate::common::program;

fn hamel(arguments: &[&str], input: &str) -> Output {
    program::output(&mut program::command(arguments), input)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A model file with inputs in a folder of its own.
fn pushed(name: &str) -> (std::path::PathBuf, String) {
    let folder = std::env::temp_dir().join(format!("hamel-inputs-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("pushed.hamel");
    let model = "model pushed {
    param k = 2;
    /// Push [N].
    input push = 0;
    input pull = 0.5;
    coordinate x in real;
    lagrangian = x_dot^2/2 - k*x^2/2;
    force x_dot = push - pull;
    output there = x + push;
    initial x = 1;
    initial x_dot = 0;
}";
    std::fs::write(&path, model).unwrap();
    let path = path.display().to_string();
    (folder, path)
}

/// The value behind a name in the last line of a table.
fn last(folder: &std::path::Path, file: &str, name: &str) -> f64 {
    let table = std::fs::read_to_string(folder.join(file)).unwrap();
    let names: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let at = names.iter().position(|n| *n == name).unwrap_or_else(|| panic!("{name} in {names:?}"));
    table.lines().last().unwrap().split(',').nth(at).unwrap().parse().unwrap()
}

fn refused(arguments: &[&str], part: &str) {
    let out = hamel(arguments, "");
    let told = text(&out.stderr);
    assert!(!out.status.success() && told.contains(part), "{told}");
}

#[test]
fn expressions_close_the_loop_in_every_scene() {
    let (folder, path) = pushed("expressions");
    let file = folder.join("end.csv").display().to_string();
    // x'' = -2 x - x + 1/2 - 1/2, from x = 1.
    for method in ["dop853", "taylor", "gbs14"] {
        let arguments = [
            "simulate",
            &path,
            "--input",
            "push=-x + 0.5",
            "--t-final",
            "2",
            "-o",
            &file,
            "--method",
            method,
        ];
        let out = hamel(&arguments, "");
        assert!(out.status.success(), "{}", text(&out.stderr));
        let expected = (2.0 * 3.0_f64.sqrt()).cos();
        assert!((last(&folder, "end.csv", "x") - expected).abs() < 1e-8, "{method}");
        // The output sees the driven input.
        assert!((last(&folder, "end.csv", "there.there") - 0.5).abs() < 1e-12);
    }
}

#[test]
fn tables_drive_inputs_by_lines_and_cubics() {
    let (folder, path) = pushed("tables");
    let table = folder.join("push.csv").display().to_string();
    let mut rows = "t,push\n".to_owned();
    for k in 0..=400 {
        let t = 0.005 * f64::from(k);
        rows.push_str(&format!("{t},{}\n", t.sin()));
    }
    std::fs::write(&table, rows).unwrap();
    let end = |arguments: &[&str]| {
        let file = folder.join("end.csv").display().to_string();
        let mut all = vec!["simulate", &path, "--t-final", "2", "-o", &file];
        all.extend(arguments);
        let out = hamel(&all, "");
        assert!(out.status.success(), "{}", text(&out.stderr));
        last(&folder, "end.csv", "x")
    };
    let by_expression = end(&["--input", "push=sin(t)"]);
    let by_cubics = end(&["--input", &table, "--interpolation", "cubic", "--via", "interpreter"]);
    let by_lines = end(&["--input", &table]);
    assert!((by_cubics - by_expression).abs() < 1e-8, "{by_cubics} and {by_expression}");
    // Lines lie below the sine by an eighth of the square of the distance of the rows.
    assert!((by_lines - by_expression).abs() < 1e-5 && (by_lines - by_cubics).abs() > 1e-8);
    // Series go from row to row, and kinks cost them nothing; no step of these stages goes over one.
    for between in ["cubic", "linear"] {
        let tight = ["--rtol", "1e-12", "--atol", "1e-14"];
        let [by_series, by_stages] =
            [("taylor", &tight[..]), ("vern9", &["--step", "0.005"])].map(|(method, steps)| {
                end(&[&["--input", &table, "--interpolation", between, "--method", method][..], steps]
                    .concat())
            });
        assert!((by_series - by_stages).abs() < 1e-10, "{between}: {by_series} and {by_stages}");
    }
    // Lanes and numbers have the same inputs.
    let on_lanes = end(&["--input", &table, "--interpolation", "cubic", "--method", "gbs14"]);
    assert!((on_lanes - by_cubics).abs() < 1e-8);
}

#[test]
fn series_are_exact_from_row_to_row() {
    let (folder, path) = pushed("series");
    let table = folder.join("push.csv").display().to_string();
    std::fs::write(&table, "t,push\n0,0.5\n0.75,1.5\n1.25,-0.5\n").unwrap();
    let end = |t: &str, interpolation: &str| {
        let file = folder.join("end.csv").display().to_string();
        let arguments = [
            "simulate",
            &path,
            "--input",
            &table,
            "--interpolation",
            interpolation,
            "--method",
            "taylor",
            "--t-final",
            t,
            "-o",
            &file,
        ];
        for via in ["jit", "interpreter"] {
            let out =
                hamel(&[&arguments[..], &["--rtol", "1e-13", "--atol", "1e-13", "--via", via]].concat(), "");
            assert!(out.status.success(), "{}", text(&out.stderr));
        }
        last(&folder, "end.csv", "x")
    };
    // x'' = -2 x + u(t) - 1/2 from x = 1 at rest: by pieces, with u held or a straight line.
    let w = 2.0_f64.sqrt();
    let step = |[x, v]: [f64; 2], force: f64, slope: f64, h: f64| {
        let (rest, drift) = (x - force / 2.0, v - slope / 2.0);
        let (sin, cos) = (w * h).sin_cos();
        [rest * cos + drift / w * sin + (force + slope * h) / 2.0, drift * cos - rest * w * sin + slope / 2.0]
    };
    let held = step(step([1.0, 0.0], 0.0, 0.0, 0.75), 1.0, 0.0, 0.5);
    assert!((end("2", "hold") - step(held, -1.0, 0.0, 0.75)[0]).abs() < 1e-12);
    let straight = step(step([1.0, 0.0], 0.0, 1.0 / 0.75, 0.75), 1.0, -4.0, 0.5);
    assert!((end("2", "linear") - step(straight, -1.0, 0.0, 0.75)[0]).abs() < 1e-12);
    // Where time goes back, the first row stays.
    assert!((end("-1", "linear") - (-w).cos()).abs() < 1e-12);
}

#[test]
fn what_drives_no_input_is_refused() {
    let (folder, path) = pushed("refused");
    let simulate = |input: &str, part: &str| refused(&["simulate", &path, "--input", input], part);
    simulate("psh=1", "is driven, which is not an input");
    simulate("push=psi", "unknown name `psi`");
    simulate("push=1; force x_dot = 1", "give one expression");
    simulate("push", "write name=expression");
    simulate("push=pull", "contains the input `pull`");
    refused(&["simulate", "heavy_top", "--input", "u=1"], "declares no input");
    let table = folder.join("bad.csv").display().to_string();
    for (rows, part) in [
        ("time,push\n0,1\n", "has no column `t`"),
        ("t,psh\n0,1\n", "no input of scene"),
        ("t,push\n0,1\n0,2\n", "times that do not grow"),
        ("t\n0\n", "no column besides `t`"),
    ] {
        std::fs::write(&table, rows).unwrap();
        simulate(&table, part);
    }
}

#[test]
fn the_linear_system_is_that_of_the_equations() {
    let (_, path) = pushed("linear");
    let out =
        hamel(&["linearize", &path, "--at", "x=0.25", "--hold", "push=1", "--set", "k=2", "--json"], "");
    assert!(out.status.success(), "{}", text(&out.stderr));
    let answer: serde_json::Value = serde_json::from_str(&text(&out.stdout)).unwrap();
    assert_eq!(answer["A"], serde_json::json!([[0.0, 1.0], [-2.0, 0.0]]));
    assert_eq!(answer["B"], serde_json::json!([[0.0, 0.0], [1.0, -1.0]]));
    assert_eq!(answer["C"], serde_json::json!([[1.0, 0.0]]));
    assert_eq!(answer["D"], serde_json::json!([[1.0, 0.0]]));
    // An equilibrium: the push less the pull holds the spring.
    assert_eq!(answer["rates"], serde_json::json!({"x": 0.0, "x_dot": 0.0}));
    let eigenvalue = &answer["eigenvalues"][0];
    assert!((eigenvalue[1].as_f64().unwrap() - 2.0_f64.sqrt()).abs() < 1e-12, "{answer}");
    let out = hamel(&["linearize", &path], "");
    assert!(text(&out.stdout).contains("B = df/du"), "{}", text(&out.stdout));
    refused(&["linearize", &path, "--hold", "x=1"], "push");
}
