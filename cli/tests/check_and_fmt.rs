//! `check` and `fmt`: what is wrong with model files, and their form.

use crate::common::program;

use std::path::{Path, PathBuf};

use serde_json::Value;

/// An empty folder for a test.
fn scratch(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

/// Status, output and messages of a call in a folder.
fn try_run(folder: &Path, arguments: &[&str], input: &str) -> (i32, String, String) {
    let out = program::output(program::command(arguments).current_dir(folder), input);
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (out.status.code().unwrap(), text(out.stdout), text(out.stderr))
}

const GOOD: &str = "/// Rod\nmodel rod {\n    param l = 2 where l > 0;\n    coordinate x in real;\n    lagrangian = l*x_dot^2/2;\n}\n";

#[test]
fn check_tells_problems_with_their_places_as_json() {
    let folder = scratch("check");
    std::fs::write(folder.join("good.hamel"), GOOD).unwrap();
    std::fs::write(folder.join("bad.hamel"), GOOD.replace("l*x_dot", "k*x_dot")).unwrap();
    std::fs::write(folder.join("odd.hamel"), GOOD.replace("coordinate", "param unused = 1;\n    coordinate"))
        .unwrap();

    let (status, out, _) = try_run(&folder, &["check", "good.hamel", "odd.hamel", "--json"], "");
    let found: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((status, &found["errors"], &found["warnings"]), (0, &0.into(), &1.into()));
    assert_eq!(found["problems"][0]["severity"], "warning");

    let (status, out, err) = try_run(&folder, &["check", "good.hamel", "bad.hamel", "--json"], "");
    let found: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(status, 2);
    assert_eq!(err.trim(), "error: 1 error in the models");
    let problem = &found["problems"][0];
    assert_eq!((&problem["file"], &problem["severity"]), (&"bad.hamel".into(), &"error".into()));
    assert_eq!(
        (&problem["place"]["start"]["line"], &problem["place"]["start"]["column"]),
        (&5.into(), &18.into())
    );
    assert_eq!(problem["place"]["end"]["column"], 19);
    assert!(problem["message"].as_str().unwrap().contains('k'), "{problem}");

    let (status, out, err) = try_run(&folder, &["check", "bad.hamel", "missing.hamel"], "");
    assert!(status != 0 && out.is_empty(), "{out}");
    assert!(err.contains("bad.hamel:5:18") && err.contains("missing.hamel"), "{err}");
}

#[test]
fn check_derives_where_asked() {
    let folder = scratch("check_derive");
    let text = "model free {\n    coordinate x in real;\n    coordinate y in real;\n    lagrangian = (x_dot + y_dot)^2/2 + x;\n}\n";
    std::fs::write(folder.join("free.hamel"), text).unwrap();
    let (status, out, err) = try_run(&folder, &["check", "free.hamel"], "");
    assert_eq!((status, out.trim()), (0, "1 model, 0 warnings"), "{err}");
    let (status, _, err) = try_run(&folder, &["check", "free.hamel", "--derive"], "");
    assert!(status == 2 && err.contains("error"), "{err}");
}

#[test]
fn fmt_writes_what_changed_and_nothing_where_anything_is_wrong() {
    let folder = scratch("fmt");
    let untidy = GOOD.replace("    ", "\t").replace(" = ", "=");
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    write("good.hamel", GOOD);
    write("untidy.hamel", &untidy);
    write("bad.hamel", "model rod { param = ; }");

    let (status, _, err) = try_run(&folder, &["fmt", "good.hamel", "untidy.hamel", "bad.hamel"], "");
    assert!(status == 2 && err.contains("bad.hamel:1"), "{err}");
    assert_eq!(read("untidy.hamel"), untidy, "left as it was");

    let (status, _, err) = try_run(&folder, &["fmt", "--check", "good.hamel", "untidy.hamel"], "");
    assert_eq!(
        (status, err.trim()),
        (1, "error: not in form:\n  untidy.hamel\n  run: hamel fmt untidy.hamel")
    );
    assert_eq!(read("untidy.hamel"), untidy, "left as it was");

    let (status, out, _) = try_run(&folder, &["fmt", "good.hamel", "untidy.hamel"], "");
    assert_eq!((status, out.trim()), (0, "1 of 2 changed"));
    assert_eq!(read("untidy.hamel"), GOOD);

    let (status, out, _) = try_run(&folder, &["fmt", "-"], &untidy);
    assert_eq!((status, out.as_str()), (0, GOOD));
}

/// The workspace's root directory, and all model files in it that are meant to be right.
fn repository() -> (&'static Path, Vec<String>) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut files = vec![root.join("cli/src/commands/starter.hamel")];
    for folder in
        ["models/specs", "models/shelf", "xtask/bench/models", "docs/book", "tests/downstream/models"]
    {
        let listing = std::fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path());
        files.extend(listing.filter(|path| path.extension().is_some_and(|e| e == "hamel")));
    }
    assert!(files.len() > 40, "{files:?}");
    (root, files.iter().map(|path| path.to_str().unwrap().to_owned()).collect())
}

/// The models of the repository have no warnings: everything in them has an effect, and their units fit.
#[test]
fn models_of_the_repository_have_no_warnings() {
    let (root, files) = repository();
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let (status, out, err) = try_run(root, &[&["check"], files.as_slice()].concat(), "");
    // Before it are the models that are quotients of others.
    let last = out.trim().lines().last().unwrap_or_default();
    assert_eq!((status, last), (0, format!("{} models, 0 warnings", files.len()).as_str()), "{err}");
}

/// The models of the repository are in form, and what is in form stays as it is.
#[test]
fn models_of_the_repository_are_in_form() {
    let (root, files) = repository();
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let (status, out, err) = try_run(root, &[&["fmt", "--check"], files.as_slice()].concat(), "");
    assert_eq!(status, 0, "{err}");
    assert_eq!(out.trim(), format!("{} in form", files.len()));
}

const PLANAR: &str = "/// Body in the plane
model planar {
    param m = 2;
    coordinate x, y in real;
    coordinate theta in angle;
    lagrangian = m*(x_dot^2 + y_dot^2)/2 + theta_dot^2/2;
    constraint sin(theta)*x_dot = cos(theta)*y_dot;
}
";

/// Scenes that fail by one problem say it once, and others say theirs.
#[test]
fn a_problem_of_all_scenes_is_told_once() {
    let folder = scratch("check_scenes");
    let text = "model m { coordinate x, q, p in real; lagrangian = x_dot^2/2 + x_dot^4 + p*q_dot - p^2; momentum P of x_dot; \
                scene first { carry P; want rhs; } scene second { carry P; want rhs, energy; } \
                scene third { want rhs, dirac; } }";
    std::fs::write(folder.join("m.hamel"), text).unwrap();
    let (status, _, err) = try_run(&folder, &["check", "m.hamel", "--derive"], "");
    assert_eq!((status, err.matches("not quadratic in the velocities").count()), (2, 1), "{err}");
    assert!(err.contains("the Lagrangian gives velocities that no constraint restricts"), "{err}");
}

/// A reduced model names the file that it was made from, from the folder that it is in, and `check` holds it to that.
#[test]
fn a_reduced_model_is_held_to_the_file_that_it_was_made_from() {
    let folder = scratch("reduced");
    std::fs::create_dir_all(folder.join("made/here")).unwrap();
    std::fs::write(folder.join("planar.hamel"), PLANAR).unwrap();
    let made = "made/here/reduced.hamel";
    let (status, out, err) = try_run(&folder, &["reduce", "planar.hamel", "-o", made], "");
    assert_eq!(status, 0, "{err}");
    assert!(out.contains("Proved: a quotient of the model, by "), "{out}");
    let text = std::fs::read_to_string(folder.join(made)).unwrap();
    assert!(text.contains("reduces \"../../planar.hamel\" {"), "{text}");
    let (status, out, err) = try_run(&folder, &["check", made], "");
    assert!(status == 0 && out.contains("conditions proved"), "{out}{err}");
    // A model that is there may have been edited.
    let (status, _, err) = try_run(&folder, &["reduce", "planar.hamel", "-o", made], "");
    assert!(status != 0 && err.contains("add --force to replace it"), "{err}");
    let (status, _, err) = try_run(&folder, &["reduce", "planar.hamel", "-o", made, "--force"], "");
    assert_eq!(status, 0, "{err}");
    let wrong = text.replace("v_theta = theta_dot;", "v_theta = -theta_dot;");
    assert_ne!(wrong, text);
    std::fs::write(folder.join(made), wrong).unwrap();
    let (status, _, err) = try_run(&folder, &["check", made], "");
    assert!(status != 0 && err.contains("this model is not the quotient of"), "{err}");
    let (status, out, err) = try_run(&folder, &["reduce", "planar.hamel", "--json"], "");
    assert_eq!(status, 0, "{err}");
    let answer: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(answer["map"]["v_theta"], "theta_dot");
}
