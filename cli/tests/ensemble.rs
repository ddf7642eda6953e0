//! `ensemble`: what results depend on, what becomes of trajectories that stop, files.

use std::collections::BTreeMap;
use std::io::{Cursor, Read as _};
use std::path::PathBuf;
use std::process::{Command, Output};

/// A bead whose equation has no value at `x = 0`, and whose mass has to be positive.
const BEAD: &str = "model bead {
    param m = 1 where m > 0;
    param k = 1;
    coordinate x in real;
    lagrangian = 1/2*m*x^2*x_dot^2 - k*x;
}";

/// A directory of its own for a test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("hamel-ensemble-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.0.join(name)).unwrap()
    }

    fn csv(&self, name: &str) -> Csv {
        Csv::new(&String::from_utf8(self.bytes(name)).unwrap())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A table by names; the column `error` may have commas in quotes and is the last.
struct Csv {
    names: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Csv {
    fn new(text: &str) -> Csv {
        let mut lines = text.lines();
        let names: Vec<String> = lines.next().unwrap().split(',').map(str::to_owned).collect();
        let rows: Vec<Vec<String>> =
            lines.map(|line| line.splitn(names.len(), ',').map(str::to_owned).collect()).collect();
        assert!(rows.iter().all(|row| row.len() == names.len()));
        Csv { names, rows }
    }

    fn cell(&self, row: usize, name: &str) -> &str {
        &self.rows[row][self.names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{name}"))]
    }

    fn number(&self, row: usize, name: &str) -> f64 {
        self.cell(row, name).parse().unwrap()
    }

    fn numbers(&self, name: &str) -> Vec<f64> {
        (0..self.rows.len()).map(|row| self.number(row, name)).collect()
    }
}

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_hamel"))
        .env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
        .args(arguments)
        .output()
        .unwrap()
}

/// Runs `ensemble` by the interpreter and returns its summary.
fn ensemble(model: &str, arguments: &[&str]) -> String {
    let arguments = [&["ensemble", model, "--via", "interpreter"], arguments].concat();
    let out = run(&arguments);
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

#[test]
fn results_are_the_same_bytes_for_one_two_and_four_threads() {
    let folder = Folder::new("threads");
    let mut files = Vec::new();
    for threads in ["1", "2", "4"] {
        let names = [format!("{threads}.csv"), format!("{threads}.npz")];
        let paths = names.clone().map(|name| folder.file(&name));
        // Seven and three points, twice: 42 trajectories, which four lanes do not divide.
        let varied = ["--sweep", "Omega3=0..20:7", "m=0.5..2:3", "--spread", "l=0.02", "--count", "2"];
        let written =
            ["--t-final", "1", "--samples", "4", "--threads", threads, "-o", &paths[0], "-o", &paths[1]];
        let summary = ensemble("heavy_top", &[&varied[..], &written[..]].concat());
        assert!(summary.starts_with("heavy_top: 42 trajectories, 0 stopped"), "{summary}");
        files.push(names.map(|name| folder.bytes(&name)));
    }
    assert_eq!(folder.csv("1.csv").rows.len(), 42 * 4);
    assert!(files.iter().all(|file| *file == files[0]));
}

/// Steps are shared by four trajectories: the table is another one, and as accurate. The disk has an angle, which one
/// lane has as a point of a circle, as `simulate` has.
#[test]
fn one_lane_gives_the_bits_of_simulate() {
    let folder = Folder::new("lanes");
    for (model, swept, range) in [("heavy_top", "Omega3", "1..9:5"), ("euler_disk", "theta", "0.7..1.2:5")] {
        let sweep = format!("{swept}={range}");
        for lanes in ["1", "4"] {
            let file = folder.file(&format!("{lanes}.csv"));
            let method = ["--method", "dop853", "--lanes", lanes, "-o", &file];
            ensemble(model, &[&["--sweep", &sweep, "--t-final", "2"][..], &method].concat());
        }
        let (one, four) = (folder.csv("1.csv"), folder.csv("4.csv"));
        assert_ne!(one.rows, four.rows);
        for row in 0..5 {
            let file = folder.file(&format!("single_{model}{row}.json"));
            let start = format!("{swept}={}", one.cell(row, &format!("{swept}(0)")));
            let out = run(&[
                "simulate",
                model,
                "--via",
                "interpreter",
                "--initial",
                &start,
                "--t-final",
                "2",
                "-o",
                &file,
            ]);
            assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
            let answer: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
            for (name, x) in answer["final"].as_object().unwrap() {
                let x = x.as_f64().unwrap();
                assert_eq!(one.number(row, name).to_bits(), x.to_bits(), "{name}");
                // The tolerances are 1e-10 and the motion lasts some turns.
                assert!((four.number(row, name) - x).abs() < 1e-7, "{name}");
            }
        }
    }
}

#[test]
fn a_trajectory_that_stops_keeps_its_state_and_spoils_no_other() {
    let folder = Folder::new("stops");
    let model = folder.file("bead.hamel");
    std::fs::write(&model, BEAD).unwrap();
    let (table, csv, npz) = (folder.file("starts.csv"), folder.file("out.csv"), folder.file("out.npz"));
    // The second falls onto the origin, the third has no mass.
    std::fs::write(&table, "m,x,x_dot\n1,3,0.5\n1,0.2,-1\n-1,3,0.5\n2,3,0\n").unwrap();
    let arguments =
        ["--table", &table, "--t-final", "1", "--samples", "11", "--lanes", "1", "-o", &csv, "-o", &npz];
    let summary = ensemble(&model, &arguments);
    assert!(
        summary.contains("4 trajectories, 2 stopped") && summary.contains("first that stopped is 1"),
        "{summary}"
    );
    let out = folder.csv("out.csv");
    assert_eq!(out.names, ["trajectory", "m", "x(0)", "x_dot(0)", "t", "x", "x_dot", "energy", "error"]);
    let of = |k: &str| (0..out.rows.len()).filter(|row| out.rows[*row][0] == k).collect::<Vec<usize>>();
    assert_eq!((of("0").len(), of("3").len(), of("2").len()), (11, 11, 1));
    assert!(of("0").iter().chain(&of("3")).all(|row| out.cell(*row, "error").is_empty()));

    let fallen = of("1");
    let last = *fallen.last().unwrap();
    assert!(out.number(last, "t") > 0.0 && out.number(last, "t") < 1.0);
    assert!(out.number(last, "x").abs() < out.number(fallen[0], "x"));
    assert!(!out.cell(last, "error").is_empty());
    assert!(fallen[..fallen.len() - 1].iter().all(|row| out.cell(*row, "error").is_empty()));
    assert_eq!(out.cell(of("2")[0], "t"), "");
    assert!(out.cell(of("2")[0], "error").contains("m > 0"), "{}", out.cell(of("2")[0], "error"));

    // The others have the bits that they have alone.
    std::fs::write(&table, "m,x,x_dot\n1,3,0.5\n2,3,0\n").unwrap();
    ensemble(&model, &["--table", &table, "--t-final", "1", "--samples", "11", "--lanes", "1", "-o", &csv]);
    let alone = folder.csv("out.csv");
    let both: Vec<usize> = of("0").into_iter().chain(of("3")).collect();
    for (row, with_others) in both.into_iter().enumerate() {
        assert_eq!(alone.rows[row][1..], out.rows[with_others][1..]);
    }

    let arrays = arrays(&folder.bytes("out.npz"));
    let Array { shape, numbers, .. } = &arrays["state"];
    assert_eq!(shape, &[4, 11, 2]);
    // Absent, not wrong: samples that were not reached, and the trajectory that never started.
    assert!(numbers[22..44].iter().any(|x| x.is_nan()) && numbers[22..24].iter().all(|x| x.is_finite()));
    assert!(numbers[44..66].iter().all(|x| x.is_nan()) && numbers[66..].iter().all(|x| x.is_finite()));
    assert_eq!(arrays["last_t"].numbers[1], out.number(last, "t"));
    assert_eq!(arrays["last_state"].numbers[2], out.number(last, "x"));
    let errors = &arrays["error"].texts;
    assert!(errors[0].is_empty() && !errors[1].is_empty() && errors[2].contains("m > 0"), "{errors:?}");
}

/// A table without a single end is a failure, though the table says why.
#[test]
fn an_ensemble_of_which_none_arrives_fails_after_it_was_written() {
    let folder = Folder::new("none");
    let model = folder.file("bead.hamel");
    std::fs::write(&model, BEAD).unwrap();
    let csv = folder.file("out.csv");
    let failing = |varied: &[&str]| {
        let out = run(&[&["ensemble", &model, "-o", &csv], varied].concat());
        assert_eq!(out.status.code(), Some(1), "{varied:?}");
        assert!(out.stdout.is_empty());
        String::from_utf8(out.stderr).unwrap()
    };
    let told = failing(&["--sweep", "m=-2..-1:3"]);
    assert!(told.contains("none of 3 trajectories reached the end") && told.contains("m > 0"), "{told}");
    assert!(told.contains(&format!("{csv} says why of each")), "{told}");
    assert_eq!(folder.csv("out.csv").rows.len(), 3);
    // All stop on the way.
    let fall = ["--sweep", "x_dot=-2..-1:3", "--initial", "x=0.2"];
    let told = failing(&[&fall[..], &["--lanes", "1"]].concat());
    assert!(told.contains("none of 3 trajectories"), "{told}");
    let told = failing(&["--sweep", "x=3..4:5", "--t-final", "1", "--method", "dop853", "--max-steps", "2"]);
    assert!(told.contains("2 steps were not enough"), "{told}");
    // One that arrives is enough.
    ensemble(&model, &["--sweep", "m=-1..1:3", "--initial", "x=3", "--t-final", "0.1", "-o", &csv]);
}

/// Trajectories whose velocities all vary are taken as they are, and stop before they start where that breaks a
/// constraint.
#[test]
fn starts_off_the_constraint_stop_alone() {
    let folder = Folder::new("inadmissible");
    let (table, csv) = (folder.file("starts.csv"), folder.file("out.csv"));
    let names = "Omega1,Omega2,Omega3,gamma1,gamma2,gamma3";
    std::fs::write(&table, format!("{names}\n1.2,0.3,-0.4,0,0.8,0.6\n1.2,0.4,-0.4,0,0.8,0.6\n")).unwrap();
    let summary = ensemble("veselova", &["--table", &table, "--t-final", "1", "-o", &csv]);
    assert!(summary.contains("2 trajectories, 1 stopped"), "{summary}");
    let out = folder.csv("out.csv");
    assert!(out.cell(0, "error").is_empty() && out.cell(1, "error").contains("residual_c1 = 0.08"));
    assert_eq!(out.cell(1, "t"), "");
}

/// Velocities that were not given are moved onto the constraint, for every trajectory anew.
#[test]
fn constraints_hold_at_every_start() {
    let folder = Folder::new("constraint");
    let file = folder.file("out.csv");
    ensemble("veselova", &["--sweep", "Omega2=-1..1:5", "--samples", "2", "--t-final", "1", "-o", &file]);
    let out = folder.csv("out.csv");
    assert_eq!(out.rows.len(), 10);
    for row in 0..10 {
        let along: f64 = (1..=3)
            .map(|k| out.number(row, &format!("Omega{k}")) * out.number(row, &format!("gamma{k}")))
            .sum();
        assert!(along.abs() < 1e-9, "{along:e}");
    }
    assert_eq!(out.numbers("Omega2(0)")[2..4], [-0.5, -0.5]);
}

#[test]
fn draws_are_around_the_value_without_them_and_follow_the_seed() {
    let folder = Folder::new("draws");
    let draw = |seed: &str, varied: &[&str]| {
        let file = folder.file("out.csv");
        let rest = ["--count", "5", "--seed", seed, "--step", "0.1", "--t-final", "0.1", "-o", &file];
        ensemble("heavy_top", &[varied, &rest[..]].concat());
        (folder.csv("out.csv"), folder.bytes("out.csv"))
    };
    let (first, bytes) = draw("3", &["--spread", "m=0.01", "Omega2=0", "l=0.5..0.6"]);
    assert_eq!(bytes, draw("3", &["--spread", "m=0.01", "Omega2=0", "l=0.5..0.6"]).1);
    assert_ne!(bytes, draw("4", &["--spread", "m=0.01", "Omega2=0", "l=0.5..0.6"]).1);
    // What is drawn for a name does not depend on the others.
    assert_eq!(first.numbers("m"), draw("3", &["--spread", "m=0.01"]).0.numbers("m"));
    let mass = first.numbers("m");
    assert_ne!(mass[0], mass[1]);
    assert!(mass.iter().all(|m| (m - 1.1).abs() < 0.05), "{mass:?}");
    assert!(first.numbers("l").iter().all(|l| (0.5..0.6).contains(l)));
    // No deviation: the component of the default initial state.
    let starts = first.numbers("Omega2(0)");
    assert!(starts.iter().all(|x| *x == starts[0]) && starts[0] != 0.0);
    // Around each point of a grid, with draws of its own.
    let (grid, _) = draw("3", &["--sweep", "m=1..2:2", "--spread", "m=0.01"]);
    let mass = grid.numbers("m");
    assert!(
        mass[..5].iter().all(|m| (m - 1.0).abs() < 0.05) && mass[5..].iter().all(|m| (m - 2.0).abs() < 0.05)
    );
    assert_ne!(mass[0] - 1.0, mass[5] - 2.0);
}

/// Starts are alike but for the values that are drawn, unless the model makes others of these.
#[test]
fn a_start_that_the_model_makes_of_a_parameter_follows_its_draws() {
    let folder = Folder::new("follows");
    let text = "model slider {
        param m = 1 where m > 0;
        param a = 3;
        coordinate x in real;
        lagrangian = m*x_dot^2/2 - a*x;
        initial x = 2*a;
        initial x_dot = 1;
    }";
    let (model, file) = (folder.file("slider.hamel"), folder.file("out.csv"));
    std::fs::write(&model, text).unwrap();
    for (spread, varies) in [("a=0.5", true), ("m=0.1", false), ("x_dot=0.1", false)] {
        let drawn = ["--spread", spread, "m=0.05"];
        let rest = ["--t-final", "1", "--samples", "2", "-o", &file];
        let drawn = if spread.starts_with('m') { &drawn[..2] } else { &drawn[..3] };
        ensemble(&model, &[drawn, &["--count", "9"], &rest[..]].concat());
        let table = folder.csv("out.csv");
        let starts: Vec<usize> = (0..table.rows.len()).filter(|row| table.number(*row, "t") == 0.0).collect();
        assert_eq!(starts.len(), 9);
        for row in &starts {
            let expected = if varies { 2.0 * table.number(*row, "a") } else { 6.0 };
            assert_eq!(table.number(*row, "x"), expected, "{spread}");
            let speed = if spread.starts_with('x') { table.number(*row, "x_dot(0)") } else { 1.0 };
            assert_eq!(table.number(*row, "x_dot"), speed, "{spread}");
        }
        let name = spread.split_once('=').map_or(spread, |(name, _)| name);
        let name = if name == "x_dot" { "x_dot(0)" } else { name };
        assert_ne!(table.number(starts[0], name), table.number(starts[1], name));
    }
}

#[test]
fn arrays_are_those_of_the_table() {
    let folder = Folder::new("arrays");
    let files = ["out.csv", "out.npz"].map(|name| folder.file(name));
    let varied = ["--sweep", "Omega3=0..2:3", "--set", "m=2", "--initial", "Omega1=0.25"];
    let written = ["--t-final", "-1", "--samples", "3", "-o", &files[0], "-o", &files[1]];
    ensemble("heavy_top", &[&varied[..], &written[..]].concat());
    let (table, arrays) = (folder.csv("out.csv"), arrays(&folder.bytes("out.npz")));
    assert_eq!(arrays["input_names"].texts, ["Omega3"]);
    assert_eq!((&arrays["inputs"].shape, &arrays["inputs"].numbers), (&vec![3, 1], &vec![0.0, 1.0, 2.0]));
    assert_eq!(arrays["t"].numbers, [0.0, -0.5, -1.0]);
    let names = &arrays["state_names"].texts;
    assert_eq!((names.len(), names[5].as_str()), (6, "Gamma3"));
    assert_eq!(arrays["state"].shape, [3, 3, 6]);
    for (row, state) in arrays["state"].numbers.chunks(6).enumerate() {
        for (name, x) in names.iter().zip(state) {
            assert_eq!(x.to_bits(), table.number(row, name).to_bits());
        }
        assert_eq!(arrays["energy"].numbers[row], table.number(row, "energy"));
    }
    assert_eq!(table.numbers("Omega1")[0], 0.25);
    assert_eq!((&arrays["last_state"].shape, arrays["last_t"].numbers[2]), (&vec![3, 6], -1.0));
    assert_eq!(arrays["last_state"].numbers[..6], arrays["state"].numbers[12..18]);
}

/// Lanes of compiled scenes are registers, those of the interpreter one number after the other.
#[test]
fn scenes_compiled_in_memory_give_the_bits_of_the_interpreter() {
    let folder = Folder::new("via");
    let all = ["jit", "interpreter"].map(|via| {
        let file = folder.file("out.csv");
        let varied = ["ensemble", "euler_disk", "--via", via, "--sweep", "theta=0.3..1.2:6"];
        let out = run(&[&varied[..], &["--t-final", "0.5", "--samples", "3", "-o", &file]].concat());
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        folder.bytes("out.csv")
    });
    assert_eq!(String::from_utf8_lossy(&all[0]), String::from_utf8_lossy(&all[1]));
    assert_eq!(folder.csv("out.csv").rows.len(), 18);
}

#[test]
fn mistakes_are_named_before_anything_is_integrated() {
    let folder = Folder::new("mistakes");
    let (file, table) = (folder.file("out.csv"), folder.file("starts.csv"));
    std::fs::write(&table, "m,Omega1\n1,x\n").unwrap();
    let cases: [(&[&str], &str); 16] = [
        (&["--sweep", "Omgea3=0..1:2"], "did you mean `Omega3`?"),
        (&["--sweep", "m=1..2:2", "--set", "m=3"], "gives m, which --set gives as well"),
        (&["--sweep", "m=1..2:2", "m=3..4:2"], "has `m` twice"),
        (&["--sweep", "m=1..2"], "name=a..b:n"),
        (&["--spread", "m=0.1"], "--count"),
        (&["--count", "3"], "--spread"),
        (&["--spread", "m=0.1", "--count", "0"], "--count leaves no trajectory"),
        // Each has a number that a double holds exactly.
        (
            &["--sweep", "m=1..2:999999999", "l=1..2:999999999"],
            "--sweep makes more than 9007199254740991 trajectories",
        ),
        (
            &["--spread", "m=0.1", "--count", "90000000000000000"],
            "--count makes more than 9007199254740991 trajectories",
        ),
        (
            &["--sweep", "l=1..2:3", "--spread", "m=0.1", "--count", "90000000000000000"],
            "(3 points of the grid times 90000000000000000 draws)",
        ),
        (
            &["--sweep", "l=1..2:9999999999", "--spread", "m=0.1", "--count", "6000000"],
            "--sweep makes more than",
        ),
        (&["--sweep", "m=1..2:2", "--samples", "1000000"], "--samples is 1000000, which makes more than"),
        (
            &["--sweep", "m=1..2:2", "--threads", "100000"],
            "--threads is 100000, but at most 1024 are started",
        ),
        (&["--table", &table], "\"x\" is not a finite number"),
        (&["--sweep", "m=1..2:2", "--samples", "0"], "give at least 1"),
        (&["--sweep", "m=1..2:2", "--rtol", "1e-17"], "relative tolerance 1e-17"),
    ];
    for (arguments, hint) in cases {
        let all = [&["ensemble", "heavy_top", "--via", "interpreter", "-o", &file], arguments].concat();
        let out = run(&all);
        let message = String::from_utf8_lossy(&out.stderr).into_owned();
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {message}");
        assert!(message.contains(hint), "{arguments:?}: {message}");
    }
    let out = run(&["ensemble", "heavy_top", "--sweep", "m=1..2:2", "-o", &folder.file("out.txt")]);
    assert_eq!(out.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&out.stderr).contains(".zarr, .csv or .npz"));
    assert!(!PathBuf::from(&file).exists());
}

/// An array of numbers or of texts.
#[derive(Default)]
struct Array {
    shape: Vec<usize>,
    numbers: Vec<f64>,
    texts: Vec<String>,
}

/// Reads an archive by the description of the format, version 1.0.
fn arrays(bytes: &[u8]) -> BTreeMap<String, Array> {
    let mut archive = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
    let mut arrays = BTreeMap::new();
    for k in 0..archive.len() {
        let mut entry = archive.by_index(k).unwrap();
        let name = entry.name().unwrap().strip_suffix(".npy").unwrap().to_owned();
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes).unwrap();
        assert_eq!(bytes[..8], *b"\x93NUMPY\x01\x00");
        let length = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
        assert!(length.is_multiple_of(64) && bytes[length - 1] == b'\n');
        let header = std::str::from_utf8(&bytes[10..length]).unwrap();
        let header = header.strip_prefix("{'descr': '<").unwrap().trim_end();
        let (kind, rest) = header.split_once("', 'fortran_order': False, 'shape': (").unwrap();
        let shape = rest.strip_suffix("), }").unwrap();
        let shape: Vec<usize> =
            shape.split(',').filter(|n| !n.trim().is_empty()).map(|n| n.trim().parse().unwrap()).collect();
        let mut array = Array { shape, ..Array::default() };
        let data = &bytes[length..];
        match kind.strip_prefix('U') {
            None => {
                assert_eq!(kind, "f8");
                array.numbers = data.chunks(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect();
                assert_eq!(array.numbers.len(), array.shape.iter().product::<usize>());
            }
            Some(n) => {
                let text = |bytes: &[u8]| -> String {
                    let codes = bytes.chunks(4).map(|c| u32::from_le_bytes(c.try_into().unwrap()));
                    codes.filter(|c| *c != 0).map(|c| char::from_u32(c).unwrap()).collect()
                };
                array.texts = data.chunks(4 * n.parse::<usize>().unwrap()).map(text).collect();
                assert_eq!(vec![array.texts.len()], array.shape);
            }
        }
        arrays.insert(name, array);
    }
    arrays
}

/// A cart that is pushed and pulled: `x = (push + pull) t^2/(2 m)` from rest.
const CART: &str = "model cart {
    param m = 2;
    input push = 1/2;
    input pull = 0;
    coordinate x in real;
    lagrangian = 1/2*m*x_dot^2;
    force x_dot = push + pull;
    initial x = 0;
    initial x_dot = 0;
}";

/// Inputs vary from trajectory to trajectory, in lanes too, with the bits of the motion in which they are held there.
#[test]
fn inputs_vary_as_parameters_do() {
    let folder = Folder::new("inputs");
    let (model, table) = (folder.file("cart.hamel"), folder.file("table.csv"));
    std::fs::write(&model, CART).unwrap();
    let grid = ["--sweep", "push=-1..1:5", "m=1..2:2", "--t-final", "2"];
    for (via, name) in [("interpreter", "a.csv"), ("jit", "b.csv")] {
        let file = folder.file(name);
        let out = run(&[&["ensemble", &model, "--via", via][..], &grid, &["-o", &file]].concat());
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    }
    assert_eq!(folder.bytes("a.csv"), folder.bytes("b.csv"));
    let found = folder.csv("a.csv");
    assert_eq!(found.rows.len(), 10);
    for row in 0..10 {
        let (push, m, x) = (found.number(row, "push"), found.number(row, "m"), found.number(row, "x"));
        assert!((x - 2.0 * push / m).abs() < 1e-14, "{push} {m}: {x}");
    }
    // Drawn around the model's own value, and one of two by an expression.
    let file = folder.file("drawn.csv");
    let more =
        ["--spread", "push=0.5..1.5", "--count", "8", "--input", "pull=1", "--t-final", "2", "-o", &file];
    ensemble(&model, &more);
    let drawn = folder.csv("drawn.csv");
    // The weights of gbs14 are up to 56 in sum, and `x` is up to 2.5.
    let rounding = 56.0 * f64::EPSILON * 2.5;
    for row in 0..8 {
        let push = drawn.number(row, "push");
        assert!((0.5..1.5).contains(&push) && (drawn.number(row, "x") - (push + 1.0)).abs() < rounding);
    }
    std::fs::write(&table, "t,pull\n0,0\n1,1\n").unwrap();
    let out = run(&["ensemble", &model, "--sweep", "push=0..1:2", "--input", &table, "-o", &file]);
    let message = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(2), "{message}");
    assert!(message.contains("drive the others by expressions"), "{message}");
    // Held from row to row: adaptive steps find the jump.
    std::fs::write(&table, "t,push\n0,1\n1,-1\n").unwrap();
    let held = folder.file("held.csv");
    let out = run(&[
        "simulate",
        &model,
        "--input",
        &table,
        "--interpolation",
        "hold",
        "--t-final",
        "2",
        "--samples",
        "2",
        "-o",
        &held,
    ]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let held = folder.csv("held.csv");
    let (x, v) = (held.number(1, "x"), held.number(1, "x_dot"));
    assert!((x - 0.5).abs() < 1e-8 && v.abs() < 1e-8, "{x} {v}");
}
