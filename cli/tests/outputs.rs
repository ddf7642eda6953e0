//! Output that does not arrive: full disks, readers that have gone, files that cannot be written, interrupts.
#![cfg(unix)]

use std::fs::File;
use std::process::{Output, Stdio};

use crate::common::program::{self, Folder, done, refused, text};

/// A device on which every write fails for lack of space; none where the system has none.
fn full() -> Option<File> {
    File::options().write(true).open("/dev/full").ok()
}

const STATE: &str = r#"{"states": [{"Omega1": 1, "Omega2": 0.2, "Omega3": 0.1}]}"#;
const MOTION: &str = r#"{"initial": {"Omega1": 1, "Omega2": 0.2, "Omega3": 0.1}, "t_final": 1}"#;
const MODEL: &str = "model m { coordinate x in real; lagrangian = 1/2*x_dot^2; }";

/// A robot of which nothing is left out.
const FLYER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../codegen/tests/robots/flyer.urdf");
const TOP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/book/top_in_space.hamel");

/// Every command that prints, with what it reads.
const PRINTED: [(&[&str], &str); 19] = [
    (&["--version"], ""),
    (&["--help"], ""),
    (&["simulate", "--help"], ""),
    (&["list"], ""),
    (&["list", "--json", "free_rigid_body"], ""),
    (&["explain", "free_rigid_body"], ""),
    (&["eval", "free_rigid_body"], STATE),
    (&["simulate", "free_rigid_body", "--json"], MOTION),
    (&["simulate", "free_rigid_body", "--t-final", "1"], ""),
    (&["linearize", "free_rigid_body"], ""),
    (&["trim", "free_rigid_body"], ""),
    (&["reduce", TOP], ""),
    (&["reduce", "--json", TOP], ""),
    (&["fmt", "-"], MODEL),
    (&["import", FLYER, "--floating"], ""),
    (&["check", "free_rigid_body"], ""),
    (&["check", "--json", "free_rigid_body"], ""),
    (&["completions", "bash"], ""),
    (&["man"], ""),
];

fn into(stdout: impl Into<Stdio>, stderr: impl Into<Stdio>, arguments: &[&str], input: &str) -> Output {
    use std::io::Write as _;
    let mut command = program::command(arguments);
    command.stdin(Stdio::piped()).stdout(stdout).stderr(stderr);
    let mut child = command.spawn().unwrap();
    // The program may end before it reads.
    let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
    child.wait_with_output().unwrap()
}

#[test]
fn what_does_not_arrive_on_a_full_disk_is_a_failure() {
    let Some(full) = full() else { return };
    for (arguments, input) in PRINTED {
        // The same call succeeds where there is space.
        let there = program::output(&mut program::command(arguments), input);
        assert!(there.status.success() && !there.stdout.is_empty(), "{arguments:?}: {}", text(&there.stderr));
        let out = into(full.try_clone().unwrap(), Stdio::piped(), arguments, input);
        assert_eq!(out.status.code(), Some(1), "{arguments:?}");
        assert!(text(&out.stderr).contains("standard output: "), "{arguments:?}: {}", text(&out.stderr));
    }
    // Findings that do not arrive are worse than findings.
    let path = std::env::temp_dir().join(format!("hamel-full-{}.hamel", std::process::id()));
    std::fs::write(&path, "model m {").unwrap();
    let arguments = ["check", "--json", path.to_str().unwrap()];
    let out = into(full.try_clone().unwrap(), Stdio::piped(), &arguments, "");
    std::fs::remove_file(&path).unwrap();
    assert_eq!(out.status.code(), Some(1));
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    for (arguments, input) in PRINTED {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let out = into(writer, Stdio::piped(), arguments, input);
        assert_eq!((out.status.code(), text(&out.stderr).as_str()), (Some(0), ""), "{arguments:?}");
    }
}

/// A message that nobody can be told changes nothing.
#[test]
fn a_full_disk_for_messages_is_no_panic() {
    let Some(full) = full() else { return };
    let out = into(Stdio::piped(), full.try_clone().unwrap(), &["eval", "nothing"], "");
    assert_eq!(out.status.code(), Some(2));
    let warned = "model m { param unused = 1; coordinate x in real; lagrangian = 1/2*x_dot^2; }";
    let path = std::env::temp_dir().join(format!("hamel-warned-{}.hamel", std::process::id()));
    std::fs::write(&path, warned).unwrap();
    let state = r#"{"states": [{"x": 1, "x_dot": 0}]}"#;
    let out = into(Stdio::piped(), full, &["eval", path.to_str().unwrap()], state);
    std::fs::remove_file(&path).unwrap();
    assert!(out.status.success() && text(&out.stdout).contains("derivatives"), "{:?}", out.status);
}

/// Whoever waits for a motion learns before it that its file cannot be written.
#[test]
fn files_that_cannot_be_written_are_told_before_anything_is_integrated() {
    let folder = Folder::new("before");
    std::fs::create_dir(folder.0.join("taken.csv")).unwrap();
    let nowhere = folder.file("nowhere/top.csv");
    let taken = folder.file("taken.csv");
    let twice = folder.file("twice.csv");
    // Nobody waits for the end.
    fn motion<'a>(more: &[&'a str]) -> Vec<&'a str> {
        let long = ["--via", "interpreter", "--t-final", "1e9", "--max-steps", "1000000000000"];
        [&["simulate", "heavy_top"], &long[..], more].concat()
    }
    let cases: [(Vec<&str>, i32, &str); 6] = [
        (motion(&["-o", &nowhere]), 1, "there is no folder"),
        (motion(&["-o", &taken]), 1, "is a folder"),
        (motion(&["-o", &twice, "-o", &twice]), 1, "given twice"),
        (motion(&["--events", &nowhere]), 1, "there is no folder"),
        (vec!["report", "heavy_top", "--t-final", "1e9", "-o", "/nowhere/top.html"], 1, "there is no folder"),
        (
            vec![
                "ensemble",
                "heavy_top",
                "--sweep",
                "m=1..2:9",
                "--t-final",
                "1e9",
                "--samples",
                "2",
                "-o",
                &taken,
            ],
            1,
            "is a folder",
        ),
    ];
    for (arguments, code, message) in cases {
        let told = refused(&arguments, code);
        assert!(told.contains(message), "{arguments:?}: {told}");
    }
    assert_eq!(folder.names(), ["taken.csv"]);
}

/// Ends a program by a signal once it has begun its file, and returns what came of it; earlier it would not have
/// integrated yet, so that later moments are tried where nothing was written.
fn interrupted(
    signal: &str,
    folder: &Folder,
    arguments: &[&str],
    is_done: impl Fn(&Output) -> bool,
) -> Output {
    let mut pause = 400;
    loop {
        let mut command = program::command(arguments);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        while !folder.names().iter().any(|name| name.ends_with(".tmp")) {
            assert!(child.try_wait().unwrap().is_none(), "ended before it was interrupted");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        std::thread::sleep(std::time::Duration::from_millis(pause));
        let id = child.id().to_string();
        assert!(std::process::Command::new("kill").args([signal, &id]).status().unwrap().success());
        let out = child.wait_with_output().unwrap();
        assert_eq!(out.status.code(), Some(130), "{}", text(&out.stderr));
        assert!(!folder.names().iter().any(|name| name.ends_with(".tmp")), "{:?}", folder.names());
        if is_done(&out) || pause > 20_000 {
            return out;
        }
        pause *= 2;
    }
}

#[test]
fn an_interrupted_motion_is_written_as_far_as_it_came() {
    let folder = Folder::new("motion");
    let [csv, svg] = ["top.csv", "top.svg"].map(|name| folder.file(name));
    // About an hour, with a sample every few milliseconds.
    let long = ["--t-final", "1e6", "--samples", "1000001", "--max-steps", "100000000000"];
    let arguments =
        [&["simulate", "heavy_top", "--via", "interpreter"], &long[..], &["-o", &csv, "-o", &svg]].concat();
    for signal in ["-INT", "-TERM"] {
        let _ = std::fs::remove_file(&csv);
        let out =
            interrupted(signal, &folder, &arguments, |out| text(&out.stderr).contains("interrupted at t = "));
        let told = text(&out.stderr);
        assert!(told.contains("of 1000000.0: what is told and written ends there"), "{told}");
        let told = text(&out.stdout);
        assert!(told.contains("wrote ") && told.contains("Omega1"), "{told}");
        let table = folder.read("top.csv");
        let n = table.lines().count();
        assert!((2..1_000_001).contains(&n), "{n}");
        assert!(table.ends_with('\n') && table.lines().all(|line| line.split(',').count() > 6));
        assert!(folder.read("top.svg").trim_end().ends_with("</svg>"));
    }
}

/// Files of trajectories lack what was not integrated, and are gone; SIGTERM is what batch systems send.
#[test]
fn an_interrupted_ensemble_leaves_no_files() {
    let folder = Folder::new("ensemble");
    for (name, signal) in [("tops.csv", "-TERM"), ("tops.npz", "-TERM"), ("tops.csv", "-INT")] {
        let file = folder.file(name);
        let many = ["ensemble", "heavy_top", "--sweep", "Omega3=0..9:4000", "m=1..2:50", "--t-final", "50"];
        let arguments = [&many[..], &["--threads", "1", "-o", &file]].concat();
        let out = interrupted(signal, &folder, &arguments, |_| true);
        assert!(text(&out.stderr).contains("interrupted: nothing was written"), "{}", text(&out.stderr));
        assert!(folder.names().is_empty(), "{:?}", folder.names());
    }
}

#[test]
fn more_than_a_disk_holds_is_refused_with_its_size() {
    let folder = Folder::new("size");
    for (name, samples) in [("tops.zarr", "2"), ("tops.npz", "2"), ("tops.csv", "1000")] {
        let file = folder.file(name);
        let many =
            ["ensemble", "heavy_top", "--spread", "m=0.05", "--count", "1000000000000", "--samples", samples];
        let told = refused(&[&many[..], &["-o", &file]].concat(), 2);
        assert!(told.contains("B for 1000000000000 trajectories, and its disk has room for"), "{told}");
    }
    assert!(folder.names().is_empty(), "{:?}", folder.names());
}

#[test]
fn what_nobody_has_generated_is_not_overwritten() {
    let folder = Folder::new("own");
    let spring = |name: &str, more: &str| {
        format!(
            "model {name} {{ param k = 2; coordinate x in real; lagrangian = x_dot^2/2 - k*x^2; {more} }}"
        )
    };
    let a = folder.write("a.hamel", &spring("a", "scene b { fix k = 3; }"));
    let a_b = folder.write("a_b.hamel", &spring("a_b", ""));
    let out = folder.file("out");
    std::fs::create_dir(&out).unwrap();
    let path = folder.write("out/a.rs", "fn mine() {}\n");
    for language in ["rust", "c"] {
        if language == "c" {
            folder.write("out/a.h", "int mine;\n");
        }
        let told = refused(&["generate", &a, "--language", language, "--out-dir", &out], 2);
        assert!(told.contains("was not generated by hamel, and is left as it is"), "{told}");
    }
    assert_eq!(folder.read("out/a.rs"), "fn mine() {}\n");
    // Nothing else was written either.
    assert!(!folder.0.join("out/a_b.rs").exists());
    std::fs::write(&path, "").unwrap();
    done(&["generate", &a, "--out-dir", &out]);
    let module = folder.read("out/a_b.rs");
    // Scene b of a has the file of a_b.
    let told = refused(&["generate", &a_b, "--out-dir", &out], 2);
    assert!(told.contains("a_b.rs was generated from the model a, and is left as it is"), "{told}");
    assert_eq!(folder.read("out/a_b.rs"), module);
    // A changed model is generated anew.
    folder.write("a.hamel", &spring("a", "scene b { fix k = 4; }"));
    assert!(done(&["generate", &a, "--out-dir", &out]).contains("1 files written"));

    let mine = folder.write("mine.rs", "fn mine() {}\n");
    let told = refused(&["report", "free_rigid_body", "--no-run", "-o", &mine], 2);
    assert!(told.contains("let the name end in .html"), "{told}");
    let told = refused(&["generate", &a, "--scene", "b", "--language", "fmu", "-o", &mine], 2);
    assert!(told.contains("let the name end in .fmu"), "{told}");
    let fmu = folder.write("mine.fmu", "not an archive");
    let told = refused(&["generate", &a, "--scene", "b", "--language", "fmu", "-o", &fmu], 2);
    assert!(told.contains("is there and no FMU"), "{told}");
    assert_eq!(
        (folder.read("mine.rs"), folder.read("mine.fmu")),
        ("fn mine() {}\n".into(), "not an archive".into())
    );
}
