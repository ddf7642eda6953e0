//! The cache of what was derived: answers have the same bits with it and without, and nothing depends on what is in it.

use std::collections::BTreeSet;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Output, Stdio};

use hamel_codegen::config::store::Key;
use serde_json::Value;

/// A cache of its own for a test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("hamel-kept-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn run(&self, arguments: &[&str], input: &str) -> Output {
        let mut child = Command::new(env!("CARGO_BIN_EXE_hamel"))
            .env("HAMEL_CACHE_DIR", self.0.join("cache"))
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        child.wait_with_output().unwrap()
    }

    fn kept(&self) -> Vec<(PathBuf, String)> {
        let Ok(listing) = std::fs::read_dir(self.0.join("cache")) else { return Vec::new() };
        let mut paths: Vec<PathBuf> = listing.map(|file| file.unwrap().path()).collect();
        paths.sort();
        let text = |path: PathBuf| (std::fs::read_to_string(&path).unwrap_or_default(), path);
        paths.into_iter().map(text).map(|(text, path)| (path, text)).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// What a program said, and how it ended.
fn said(out: &Output) -> (Vec<u8>, Vec<u8>, Option<i32>) {
    (out.stdout.clone(), out.stderr.clone(), out.status.code())
}

const REQUEST: &str = r#"{"params": {"m": 1.3}, "t_final": 0.7, "samples": 3, "METHOD": 0,
    "initial": {"Omega1": 0.3, "Omega2": -0.2, "Omega3": 1.1, "Gamma1": 0, "Gamma2": 0.6, "Gamma3": 0.8}}"#;

#[test]
fn answers_have_the_same_bits_with_the_cache_and_without() {
    let folder = Folder::new("bits");
    let top = |method: &str| REQUEST.replace("\"METHOD\": 0", &format!("\"method\": \"{method}\""));
    let gauss = top("gauss6-newton").replace("0.7,", "0.7, \"step\": 0.01,");
    let veselova = |omega2: &str| {
        format!(
            r#"{{"initial": {{"Omega1": 1.2, "Omega2": {omega2}, "Omega3": -0.4, "gamma1": 0, "gamma2": 0.8, "gamma3": 0.6}},
            "t_final": 1}}"#
        )
    };
    let state = r#"{"states": [{"Omega1": 0.3, "Omega2": -0.2, "Omega3": 1.1, "Gamma1": 0, "Gamma2": 0.6, "Gamma3": 0.8}]}"#;
    let runs: [(&[&str], &str); 10] = [
        (&["eval", "heavy_top"], state),
        (&["eval", "heavy_top", "--scene", "derivatives"], state),
        (&["simulate", "heavy_top", "--json"], &top("dop853")),
        (&["simulate", "heavy_top", "--json"], &top("taylor")),
        (&["simulate", "heavy_top", "--json"], &top("projected")),
        (&["simulate", "heavy_top", "--json"], &top("auto")),
        (&["simulate", "heavy_top", "--json"], &gauss),
        // Judged by a scene of its own.
        (&["simulate", "veselova", "--scene", "invariants", "--json"], &veselova("0.3")),
        (&["simulate", "veselova", "--scene", "invariants", "--json"], &veselova("0.4")),
        (
            &["simulate", "chaplygin_sleigh", "--json"],
            r#"{"initial": {"omega": 1, "v1": 0.5}, "t_final": 1, "reconstruct": {}}"#,
        ),
    ];
    let run = |(arguments, input): &(&[&str], &str), more: &[&str]| {
        said(&folder.run(&[arguments, &["--via", "interpreter"][..], more].concat(), input))
    };
    let without: Vec<_> = runs.iter().map(|r| run(r, &["--no-cache"])).collect();
    assert!(folder.kept().is_empty());
    // All but the inadmissible state are answered.
    assert_eq!(without.iter().filter(|(.., code)| *code == Some(0)).count(), 9, "{without:?}");
    let first: Vec<_> = runs.iter().map(|r| run(r, &[])).collect();
    assert_eq!(first, without);
    let kept = folder.kept();
    assert!(kept.len() > 5, "{}", kept.len());
    let second: Vec<_> = runs.iter().map(|r| run(r, &[])).collect();
    assert_eq!(second, without);
    assert_eq!(folder.kept(), kept);

    // Damaged files are as good as none.
    for (k, (path, text)) in kept.iter().enumerate() {
        let mut bytes = text.clone().into_bytes();
        let at = bytes.len() - 1 - k;
        bytes[at] ^= 1;
        std::fs::write(path, bytes).unwrap();
    }
    let third: Vec<_> = runs.iter().map(|r| run(r, &[])).collect();
    assert_eq!(third, without);
}

/// Every whole number of a document, one of each kind of place, with what stands around it.
fn numbers(value: &mut Value, place: &str, seen: &mut BTreeSet<String>, change: &mut dyn FnMut(&mut Value)) {
    match value {
        Value::Array(list) => {
            list.iter_mut().for_each(|x| numbers(x, &format!("{place}[]"), seen, change));
        }
        Value::Object(fields) => {
            fields.iter_mut().for_each(|(key, x)| numbers(x, &format!("{place}.{key}"), seen, change));
        }
        Value::Number(number) if number.is_u64() && seen.insert(place.to_owned()) => change(value),
        _ => {}
    }
}

/// The last elements of all lists, one list of each kind of place.
fn lists(value: &mut Value, place: &str, seen: &mut BTreeSet<String>, change: &mut dyn FnMut(&mut Value)) {
    if let Value::Array(list) = value
        && !list.is_empty()
        && seen.insert(place.to_owned())
    {
        change(value);
    }
    match value {
        Value::Array(list) => list.iter_mut().for_each(|x| lists(x, &format!("{place}[]"), seen, change)),
        Value::Object(fields) => {
            fields.iter_mut().for_each(|(key, x)| lists(x, &format!("{place}.{key}"), seen, change));
        }
        _ => {}
    }
}

/// Entries that somebody wrote, digest and all: numbers that point nowhere, and lists that are too short.
#[test]
fn entries_that_break_the_rules_of_programs_are_as_good_as_none() {
    const EVENTS: &str =
        "model ball { param g = 9.81; coordinate z, x, h in real; constraint rod: h^2 + x^2 = 1;
        initial h = 1; initial x = 0; lagrangian = (z_dot^2 + x_dot^2 + h_dot^2)/2 - g*(z + h);
        event floor = z falling { then z_dot = -0.9*z_dot; } }";
    let folder = Folder::new("crafted");
    let path = folder.0.join("ball.hamel");
    std::fs::write(&path, EVENTS).unwrap();
    let model = path.to_str().unwrap();
    let arguments =
        ["simulate", model, "--via", "interpreter", "--initial", "z=1", "z_dot=0", "--t-final", "0.7"];
    let expected = {
        let first = folder.run(&arguments, "");
        assert!(first.status.success(), "{first:?}");
        without_times(&first)
    };
    let kept = folder.kept();
    assert!(kept.len() >= 3, "{}", kept.len());
    let mut n_crafted = 0;
    for (path, text) in &kept {
        let (_, body) = text.split_once('\n').unwrap();
        let whole: Value = serde_json::from_str(body).unwrap();
        let mut crafted = Vec::new();
        // How many of one kind of place there are is found by counting; each is changed alone.
        for walk in [numbers, lists] {
            let mut n = 0;
            walk(&mut whole.clone(), "", &mut BTreeSet::new(), &mut |_| n += 1);
            for chosen in 0..n {
                let (mut value, mut at) = (whole.clone(), 0);
                walk(&mut value, "", &mut BTreeSet::new(), &mut |x| {
                    if at == chosen {
                        match x {
                            Value::Array(list) => _ = list.pop(),
                            other => *other = 4_000_000_000_u64.into(),
                        }
                    }
                    at += 1;
                });
                crafted.push(value.to_string());
            }
        }
        for body in crafted {
            n_crafted += 1;
            let key = path.file_stem().unwrap().to_str().unwrap();
            std::fs::write(path, format!("hamel {key} {}\n{body}", Key::of(&body.as_str()).name())).unwrap();
            let out = folder.run(&arguments, "");
            assert!(out.status.success(), "{body}: {out:?}");
            // A list that is shorter may still be a program, but none that writes nonsense: the motion of the ball has
            // its events or the entry was made anew.
            assert_eq!(without_times(&out), expected, "{body}");
        }
        std::fs::write(path, text).unwrap();
    }
    assert!(n_crafted > 60, "{n_crafted}");
}

/// The summary of a simulation without what differs between two runs.
fn without_times(out: &Output) -> Vec<String> {
    let text = String::from_utf8(out.stdout.clone()).unwrap();
    text.lines().filter(|line| !line.contains(" evaluations, ")).map(str::to_owned).collect()
}

#[test]
fn a_changed_model_is_another_and_warnings_stay() {
    let folder = Folder::new("changed");
    let path = folder.0.join("spring.hamel");
    let name = path.to_str().unwrap();
    let write = |k: u32| {
        let text = format!(
            "model spring {{ param unused = 1; coordinate x in real; lagrangian = 1/2*x_dot^2 - {k}*x^2; }}"
        );
        std::fs::write(&path, text).unwrap();
    };
    let rate = |k: u32| {
        write(k);
        let out = folder.run(&["eval", name], r#"{"states": [{"x": 1, "x_dot": 0}]}"#);
        let told = String::from_utf8(out.stderr).unwrap();
        assert!(told.contains("unused") && told.matches("warning").count() == 1, "{told}");
        let answer: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        answer["derivatives"][0][1].as_f64().unwrap()
    };
    assert_eq!([rate(1), rate(2), rate(1), rate(2)], [-2.0, -4.0, -2.0, -4.0]);
}

/// A pendulum with everything that decides about no program, and what does.
const PENDULUM: &str = "model pendulum {
    param g = 9.81; // gravity
    coordinate x in angle;
    initial x = 0.3;
    lagrangian = 1/2*x_dot^2 + g*cos(x);
    output height = -cos(x);
    view bob = point([sin(x), -cos(x), 0]);
    scene light { fix g = 1.62; want rhs; }
}";

#[test]
fn what_decides_about_no_program_derives_nothing_anew() {
    let folder = Folder::new("decisive");
    let path = folder.0.join("pendulum.hamel");
    let name = path.to_str().unwrap();
    // What a simulation from the initial values says, and how much was kept since the one before.
    let mut n_before = 0;
    let mut run = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let out = folder.run(&["simulate", name, "--t-final", "0.5"], "");
        let cold = folder.run(&["simulate", name, "--t-final", "0.5", "--no-cache"], "");
        assert!(out.status.success(), "{out:?}");
        assert_eq!(without_times(&out), without_times(&cold), "{text}");
        let n_kept = folder.kept().len();
        let n_new = n_kept - n_before;
        n_before = n_kept;
        (without_times(&out), n_new)
    };
    let (first, n_new) = run(PENDULUM);
    assert!(n_new > 0);
    let silent = [
        ("// gravity", "// of the Earth"),
        ("view bob = point", "view weight = point"),
        ("    view bob = point([sin(x), -cos(x), 0]);\n", ""),
        ("want rhs;", "want rhs, energy;"),
        ("coordinate x", "\n\n  coordinate   x"),
    ];
    for (from, to) in silent {
        let changed = PENDULUM.replace(from, to);
        assert_ne!(changed, PENDULUM);
        assert_eq!(run(&changed), (first.clone(), 0), "{to}");
    }
    let (other, n_new) = run(&PENDULUM.replace("x = 0.3", "x = 0.4"));
    assert!(other != first && n_new == 0, "{n_new}");
    let decisive = [
        ("g = 9.81", "g = 9.82"),
        ("1/2*x_dot^2", "2/3*x_dot^2"),
        ("in angle", "in real"),
        ("height = -cos(x)", "height = 2 - cos(x)"),
        ("output", "force x_dot = -x_dot; output"),
        ("x = 0.3", "x = sqrt(0.09)"),
        ("model pendulum", "/// Swings.\nmodel pendulum"),
    ];
    for (from, to) in decisive {
        assert!(run(&PENDULUM.replace(from, to)).1 > 0, "{to}");
    }
}

/// Equations between coordinates are told apart next to the initial values, which are part of the key then.
#[test]
fn initial_values_decide_where_equations_hold_between_coordinates() {
    let folder = Folder::new("loops");
    let path = folder.0.join("rod.hamel");
    let run = |z: &str| {
        let text = format!(
            "model rod {{ coordinate x, z in real; lagrangian = (x_dot^2 + z_dot^2)/2 - z; \
             constraint x^2 + z^2 = 1; initial z = {z}; }}"
        );
        std::fs::write(&path, text).unwrap();
        let out = folder.run(&["simulate", path.to_str().unwrap(), "--t-final", "0.5"], "");
        assert!(out.status.success(), "{out:?}");
        folder.kept().len()
    };
    let n_kept = run("-1");
    assert_eq!(run("-1"), n_kept);
    assert!(run("1") > n_kept);
}
