//! `ensemble` into a store, and its statistics: the same bytes however the work is cut, interrupted and shared.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// A directory of its own for a test, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("hamel-store-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// All files below a folder, by their paths.
    fn files(&self, name: &str) -> BTreeMap<PathBuf, Vec<u8>> {
        fn walk(root: &Path, folder: &Path, files: &mut BTreeMap<PathBuf, Vec<u8>>) {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    walk(root, &path, files);
                } else {
                    files.insert(path.strip_prefix(root).unwrap().to_owned(), std::fs::read(&path).unwrap());
                }
            }
        }
        let (root, mut files) = (self.0.join(name), BTreeMap::new());
        walk(&root, &root, &mut files);
        files
    }

    /// Number of finished chunks of a store.
    fn n_finished(&self, name: &str) -> usize {
        std::fs::read_dir(self.0.join(name).join("status/c")).map_or(0, Iterator::count)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_hamel"));
    command.env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache")).args(arguments);
    command
}

fn run(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

/// Runs and returns the summary.
fn done(arguments: &[&str]) -> String {
    let out = run(arguments);
    assert!(out.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
    String::from_utf8(out.stdout).unwrap()
}

/// Runs into exit status 2 and returns the message.
fn refused(arguments: &[&str]) -> String {
    let out = run(arguments);
    let message = String::from_utf8(out.stderr).unwrap();
    assert_eq!(out.status.code(), Some(2), "{arguments:?}: {message}");
    message
}

/// Trajectories whose samples make chunks of 648: 13 of them, the last with 8.
const TOPS: [&str; 10] = [
    "ensemble",
    "heavy_top",
    "--spread",
    "m=0.05",
    "l=0.3..0.4",
    "--count",
    "7784",
    "--samples",
    "101",
    "-o",
];
const N_CHUNKS: usize = 13;

fn tops<'a>(store: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&TOPS[..], &[store], &["--t-final", "1"], more].concat()
}

/// Waits until a store has some chunks, but not all.
fn wait_for_chunks(folder: &Folder, name: &str, child: &mut Child) {
    while folder.n_finished(name) < 2 {
        assert!(child.try_wait().unwrap().is_none(), "ended before it was killed");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn a_killed_run_goes_on_to_the_bytes_of_one_that_was_not() {
    let folder = Folder::new("killed");
    let [whole, broken] = ["whole.zarr", "broken.zarr"].map(|name| folder.file(name));
    done(&tops(&whole, &[]));
    let expected = folder.files("whole.zarr");
    assert_eq!(folder.n_finished("whole.zarr"), N_CHUNKS);

    let mut child = command(&tops(&broken, &["--threads", "1"])).stdout(Stdio::null()).spawn().unwrap();
    wait_for_chunks(&folder, "broken.zarr", &mut child);
    child.kill().unwrap();
    child.wait().unwrap();
    let n = folder.n_finished("broken.zarr");
    assert!((2..N_CHUNKS).contains(&n), "{n}");

    assert!(refused(&tops(&broken, &[])).contains("is there already: give --resume"));
    let told = refused(&tops(&broken, &["--resume", "--seed", "3", "--rtol", "1e-8"]));
    assert!(told.contains("seed is 0 there and 3 here"), "{told}");
    assert!(
        told.contains("steps.rtol is 1e-10 there and 1e-8 here") || told.contains("steps.rtol is"),
        "{told}"
    );
    assert_eq!(folder.n_finished("broken.zarr"), n);

    let told = done(&tops(&broken, &["--resume", "--threads", "3"]));
    assert!(told.contains("7784 trajectories, 0 stopped"), "{told}");
    assert!(told.contains(&format!("{} of them now, 0 of 7784 are left", 7784 - 648 * n)), "{told}");
    assert!(folder.files("broken.zarr") == expected);
    // Nothing is left to do, and nothing changes.
    assert!(done(&tops(&broken, &["--resume"])).contains("0 of them now"));
    assert!(folder.files("broken.zarr") == expected);
}

#[test]
fn shares_and_processes_side_by_side_make_one_store() {
    let folder = Folder::new("shares");
    let [whole, shares, crowd] = ["whole.zarr", "shares.zarr", "crowd.zarr"].map(|name| folder.file(name));
    done(&tops(&whole, &["--via", "interpreter"]));
    let expected = folder.files("whole.zarr");

    for part in ["2/3", "3/3"] {
        let told = done(&tops(&shares, &["--part", part]));
        assert!(told.contains(" are left"), "{told}");
    }
    // Chunks 0, 3, 6, 9 and 12, of which the last has 8 trajectories.
    assert_eq!(folder.n_finished("shares.zarr"), N_CHUNKS - 5);
    let told = done(&tops(&shares, &["--part", "1/3"]));
    assert!(told.contains(&format!("{} of them now, 0 of 7784", 4 * 648 + 8)), "{told}");
    assert!(folder.files("shares.zarr") == expected);

    // Of three processes at once one is killed, and the others do its work.
    let start =
        || command(&tops(&crowd, &["--resume", "--threads", "1"])).stdout(Stdio::piped()).spawn().unwrap();
    let mut all = [start(), start(), start()];
    wait_for_chunks(&folder, "crowd.zarr", &mut all[0]);
    all[0].kill().unwrap();
    let [mut killed, a, b] = all;
    killed.wait().unwrap();
    for other in [a, b] {
        let out = other.wait_with_output().unwrap();
        let told = String::from_utf8_lossy(&out.stdout).into_owned();
        assert!(out.status.success() && told.contains("heavy_top: 7784 trajectories"), "{told}");
    }
    assert!(folder.files("crowd.zarr") == expected);
}

/// A bead whose equation has no value at `x = 0`, and whose mass has to be positive.
const BEAD: &str = "model bead {
    param m = 1 where m > 0;
    param k = 1;
    coordinate x in real;
    lagrangian = 1/2*m*x^2*x_dot^2 - k*x;
}";

/// The numbers of a chunk, before its checksum.
fn floats(file: &[u8]) -> Vec<f64> {
    file[..file.len() - 4].chunks(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect()
}

/// A cell of a table; NaN where it is empty.
fn cell(text: &str, row: usize, name: &str) -> f64 {
    let mut lines = text.lines();
    let at = lines.next().unwrap().split(',').position(|n| n == name).unwrap();
    lines.nth(row).unwrap().split(',').nth(at).unwrap().parse().unwrap_or(f64::NAN)
}

#[test]
fn a_store_has_the_numbers_of_a_table_and_says_what_stopped() {
    let folder = Folder::new("numbers");
    let [model, table, csv, store] =
        ["bead.hamel", "starts.csv", "out.csv", "out.zarr"].map(|name| folder.file(name));
    std::fs::write(&model, BEAD).unwrap();
    // The second falls onto the origin, the third has no mass.
    std::fs::write(&table, "m,x,x_dot\n1,3,0.5\n1,0.2,-1\n-1,3,0.5\n2,3,0\n").unwrap();
    for file in [&csv, &store] {
        let told = done(&[
            "ensemble",
            &model,
            "--table",
            &table,
            "--t-final",
            "1",
            "--samples",
            "2",
            "--lanes",
            "1",
            "-o",
            file,
        ]);
        assert!(
            told.contains("4 trajectories, 2 stopped") && told.contains("first that stopped is 1"),
            "{told}"
        );
    }
    let (text, files) = (std::fs::read_to_string(&csv).unwrap(), folder.files("out.zarr"));
    let file = |name: &str| &files[Path::new(name)];
    let y = floats(file("y/c/0/0/0"));
    // Lines of the table: two samples, start and stop, one line, two samples.
    for (k, (trajectory, sample, row)) in
        [(0, 0, 0), (0, 1, 1), (1, 0, 2), (3, 0, 5), (3, 1, 6)].into_iter().enumerate()
    {
        for (c, name) in ["x", "x_dot"].iter().enumerate() {
            let there = y[(trajectory * 2 + sample) * 2 + c];
            assert_eq!(there.to_bits(), cell(&text, row, name).to_bits(), "{k} {name}");
        }
    }
    assert!(y[6..12].iter().all(|x| x.is_nan()), "{y:?}");
    assert_eq!(floats(file("inputs/c/0/0"))[3..6], [1.0, 0.2, -1.0]);
    assert_eq!(file("status/c/0")[..4], [0, 1, 2, 0]);
    let stopped = floats(file("stopped_t/c/0"));
    assert!(stopped[0].is_nan() && stopped[2].is_nan() && stopped[1] == cell(&text, 3, "t"));
    assert_eq!(floats(file("stopped_y/c/0/0"))[2], cell(&text, 3, "x"));
    assert!(String::from_utf8_lossy(file("error/c/0")).contains("m > 0"));
    let group: serde_json::Value = serde_json::from_slice(file("zarr.json")).unwrap();
    assert_eq!(group["attributes"]["hamel"]["model_text"], BEAD);
    assert_eq!(group["consolidated_metadata"]["metadata"]["y"]["dimension_names"][1], "t");
    let array: serde_json::Value = serde_json::from_slice(file("y/zarr.json")).unwrap();
    assert_eq!(array["shape"], serde_json::json!([4, 2, 2]));
    assert_eq!(array["codecs"][1], serde_json::json!({"name": "crc32c"}));

    // What is absent where nothing has stopped is missed where something has.
    for name in ["error/c/0", "stopped_t/c/0", "stopped_y/c/0/0"] {
        std::fs::remove_file(folder.0.join("out.zarr").join(name)).unwrap();
        let arguments = ["ensemble", &model, "--table", &table, "--t-final", "1", "--samples", "2"];
        let told = done(&[&arguments[..], &["--lanes", "1", "-o", &store, "--resume"]].concat());
        // All are integrated, so that it is not told how many.
        assert!(told.contains("4 trajectories, 2 stopped") && !told.contains("of them now"), "{told}");
        assert!(folder.files("out.zarr") == files, "{name}");
    }
}

/// Changes a byte of a file.
fn flip(path: &Path, at: usize) {
    let mut bytes = std::fs::read(path).unwrap();
    bytes[at] ^= 1;
    std::fs::write(path, bytes).unwrap();
}

/// Cuts a file after some bytes.
fn cut(path: &Path, n: u64) {
    File::options().write(true).open(path).unwrap().set_len(n).unwrap();
}

#[test]
fn damaged_chunks_are_made_anew() {
    let folder = Folder::new("damaged");
    let store = folder.file("tops.zarr");
    done(&tops(&store, &[]));
    let expected = folder.files("tops.zarr");
    let at = |name: &str| folder.0.join("tops.zarr").join(name);
    let resumed = |n: usize| {
        let out = run(&tops(&store, &["--resume"]));
        let (told, warned) = (String::from_utf8(out.stdout).unwrap(), String::from_utf8(out.stderr).unwrap());
        assert!(out.status.success(), "{warned}");
        let sentence = format!("warning: {n} finished chunks were damaged and are made anew");
        assert_eq!(warned.contains(&sentence), n > 0, "{warned}");
        assert!(told.contains(&format!("{} of them now, 0 of 7784 are left", 648 * n)), "{told}");
        assert!(folder.files("tops.zarr") == expected);
    };
    resumed(0);
    std::fs::remove_file(at("y/c/1/0/0")).unwrap();
    cut(&at("energy/c/2/0"), 1000);
    cut(&at("inputs/c/3/0"), 0);
    flip(&at("y/c/4/0/0"), 12345);
    flip(&at("steps/c/5"), 3);
    flip(&at("status/c/6"), 1);
    cut(&at("status/c/7"), 0);
    // Longer than it is, with a checksum of its own.
    std::fs::copy(at("y/c/8/0/0"), at("energy/c/8/0")).unwrap();
    resumed(8);
    resumed(0);
    // A share looks at its own chunks only.
    flip(&at("y/c/1/0/0"), 0);
    flip(&at("y/c/2/0/0"), 0);
    let out = run(&tops(&store, &["--part", "2/3"]));
    assert!(String::from_utf8_lossy(&out.stderr).contains("1 finished chunks were damaged"), "{out:?}");
    resumed(1);
}

#[test]
fn files_that_do_not_suit_are_refused_before_anything_is_written() {
    let folder = Folder::new("refused");
    let [csv, svg, store] = ["out.csv", "out.svg", "out.zarr"].map(|name| folder.file(name));
    let some = ["ensemble", "heavy_top", "--sweep", "m=1..2:2"];
    let cases: [(&[&str], &str); 6] = [
        (&["-o", &csv, "--resume"], "--resume needs a store, but"),
        (&["-o", &csv, "--part", "1/2"], "--part needs a store"),
        (&["-o", &store, "--part", "3/2"], "there is no part 3 of 2"),
        (&["-o", &store, "-o", &csv], "is written alone"),
        (&["-o", &svg], "is a figure of statistics"),
        (&["-o", &store, "--method", "rk4"], "rk4"),
    ];
    for (arguments, hint) in cases {
        let message = refused(&[&some[..], arguments].concat());
        assert!(message.contains(hint), "{arguments:?}: {message}");
    }
    assert_eq!(std::fs::read_dir(&folder.0).unwrap().count(), 0);
}

#[test]
fn statistics_are_those_of_the_trajectories_for_any_number_of_threads() {
    let folder = Folder::new("statistics");
    let [all, one, four, npz, svg] =
        ["all.csv", "1.csv", "4.csv", "1.npz", "1.svg"].map(|name| folder.file(name));
    let some =
        ["ensemble", "heavy_top", "--spread", "m=0.1", "--count", "200", "--samples", "3", "--t-final", "1"];
    done(&[&some[..], &["-o", &all]].concat());
    let what = ["--statistics", "mean,variance,quantiles,histogram", "--quantiles", "0.1,0.5", "--bins", "4"];
    done(&[&some[..], &what, &["--threads", "1", "-o", &one, "-o", &npz, "-o", &svg]].concat());
    done(&[&some[..], &what, &["--threads", "4", "-o", &four]].concat());
    let (text, table) = (std::fs::read_to_string(&one).unwrap(), std::fs::read_to_string(&all).unwrap());
    assert_eq!(text, std::fs::read_to_string(&four).unwrap());
    assert!(text.starts_with("t,quantity,n,min,max,mean,variance,q0.1,q0.5,h1,h2,h3,h4\n"), "{text}");
    assert_eq!(text.lines().count(), 1 + 3 * 7);
    // Omega2 at the end: the second of the last seven lines.
    let row = 2 * 7 + 1;
    let mut values: Vec<f64> = (0..200).map(|k| cell(&table, 3 * k + 2, "Omega2")).collect();
    values.sort_by(f64::total_cmp);
    let mean = values.iter().sum::<f64>() / 200.0;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 199.0;
    // Sums of 200 numbers of size 1 in another order.
    assert!((cell(&text, row, "mean") - mean).abs() < 1e-13);
    assert!((cell(&text, row, "variance") / variance - 1.0).abs() < 1e-10);
    assert_eq!((cell(&text, row, "min"), cell(&text, row, "max")), (values[0], values[199]));
    assert_eq!(cell(&text, row, "n"), 200.0);
    // Half a percent of the levels around the median, as documented, and the two numbers between which it lies.
    let median = cell(&text, row, "q0.5");
    assert!(values[97] <= median && median <= values[102], "{median}");
    let shares: f64 = (1..=4).map(|k| cell(&text, row, &format!("h{k}"))).sum();
    assert!((shares - 1.0).abs() < 1e-12);
    assert!(std::fs::read_to_string(&svg).unwrap().contains("<polygon"));
    assert!(std::fs::metadata(&npz).unwrap().len() > 1000);
}

/// Statistics of every kind, in a store that is whole, in shares, killed and shared: the numbers of a table, and the
/// same bytes.
#[test]
fn stores_of_statistics_have_the_same_bytes_however_the_work_is_cut() {
    const WHAT: [&str; 4] = ["--statistics", "mean,variance,quantiles,histogram", "--bins", "7"];
    let folder = Folder::new("told");
    let [whole, table] = ["whole.zarr", "table.csv"].map(|name| folder.file(name));
    let told = done(&tops(&whole, &WHAT));
    assert!(told.contains("heavy_top: 7784 trajectories, 0 stopped"), "{told}");
    let expected = folder.files("whole.zarr");
    assert!(!expected.keys().any(|path| path.starts_with("y") || path.starts_with(".hamel")));

    // The numbers of a file, which one process writes chunk by chunk.
    done(&tops(&table, &WHAT));
    let text = std::fs::read_to_string(&table).unwrap();
    let read = |name: &str| floats(&expected[Path::new(name)]);
    let [mean, variance, quantiles, shares] =
        ["mean/c/0/0", "variance/c/0/0", "quantiles/c/0/0/0", "histogram/c/0/0/0"].map(read);
    assert_eq!((mean.len(), quantiles.len(), shares.len()), (101 * 7, 101 * 7 * 5, 101 * 7 * 7));
    for row in 0..101 * 7 {
        assert_eq!(cell(&text, row, "mean").to_bits(), mean[row].to_bits());
        assert_eq!(cell(&text, row, "variance").to_bits(), variance[row].to_bits());
        assert_eq!(cell(&text, row, "q0.75").to_bits(), quantiles[5 * row + 3].to_bits());
        assert_eq!(cell(&text, row, "h3").to_bits(), shares[7 * row + 2].to_bits());
    }
    let numbers = &expected[Path::new("n/c/0/0")];
    let numbers = numbers[..numbers.len() - 4].chunks(8).map(|n| u64::from_le_bytes(n.try_into().unwrap()));
    assert!(numbers.eq(std::iter::repeat_n(7784, 101 * 7)));

    let shares = folder.file("shares.zarr");
    for part in ["3/3", "1/3"] {
        let told = done(&tops(&shares, &[&WHAT[..], &["--part", part]].concat()));
        assert!(told.contains(" are left"), "{told}");
        assert!(!folder.0.join("shares.zarr/mean/c").exists());
    }
    done(&tops(&shares, &[&WHAT[..], &["--part", "2/3"]].concat()));
    assert!(folder.files("shares.zarr") == expected);

    let crowd = folder.file("crowd.zarr");
    let more = [&WHAT[..], &["--resume", "--threads", "1"]].concat();
    let start = || command(&tops(&crowd, &more)).stdout(Stdio::null()).spawn().unwrap();
    let [mut killed, mut other] = [start(), start()];
    wait_for_chunks(&folder, "crowd.zarr", &mut killed);
    for child in [&mut killed, &mut other] {
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert!(folder.n_finished("crowd.zarr") < N_CHUNKS);
    assert!(refused(&tops(&crowd, &["--resume"])).contains("statistics is"));
    assert!([start(), start()].iter_mut().all(|child| child.wait().unwrap().success()));
    assert!(folder.files("crowd.zarr") == expected);
    assert!(done(&tops(&crowd, &more)).contains("0 of them now"));
    assert!(folder.files("crowd.zarr") == expected);

    // What was gathered went when it was told: all chunks are made anew for statistics that are damaged, and no others
    // for a chunk that says what became of its trajectories.
    let at = |name: &str| folder.0.join("crowd.zarr").join(name);
    flip(&at("mean/c/0/0"), 100);
    // All are integrated, so that it is not told how many.
    assert!(!done(&tops(&crowd, &more)).contains("of them now"));
    assert!(folder.files("crowd.zarr") == expected);
    cut(&at("steps/c/3"), 8);
    assert!(done(&tops(&crowd, &more)).contains("648 of them now"));
    assert!(folder.files("crowd.zarr") == expected);
}
