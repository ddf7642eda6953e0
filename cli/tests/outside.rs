//! The program in an empty folder outside the repository: an own model from `new` to a module, and shipped models by
//! name.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// An empty folder that is no part of any repository, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Folder {
        let path = std::env::temp_dir().join(format!("hamel-outside-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        Folder(path)
    }

    fn run(&self, arguments: &[&str], input: &str) -> Output {
        let mut child = Command::new(env!("CARGO_BIN_EXE_hamel"))
            .env("HAMEL_CACHE_DIR", concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"))
            .args(arguments)
            .current_dir(&self.0)
            // As a user's shell has it.
            .env_remove("CARGO_MANIFEST_DIR")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // The program may end before it reads.
        let _ = child.stdin.take().unwrap().write_all(input.as_bytes());
        child.wait_with_output().unwrap()
    }

    /// What a command prints that succeeds and has nothing to remark.
    fn done(&self, arguments: &[&str], input: &str) -> String {
        let out = self.run(arguments, input);
        assert!(out.status.success(), "{arguments:?}: {}", text(&out.stderr));
        assert_eq!(text(&out.stderr), "", "{arguments:?}");
        text(&out.stdout)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn a_model_of_ones_own_goes_all_the_way() {
    let folder = Folder::new("own");
    let told = folder.done(&["new", "sled"], "");
    assert!(told.contains("hamel explain sled.hamel") && !told.contains("cargo xtask"), "{told}");
    assert!(folder.done(&["explain", "sled.hamel"], "").contains("sled"));
    folder.done(&["simulate", "sled.hamel", "--reconstruct", "-o", "sled.svg"], "");
    assert!(read(&folder.path("sled.svg")).contains("Path: position of the contact"));
    folder.done(&["report", "sled.hamel", "--t-final", "1"], "");
    assert!(read(&folder.path("sled.html")).ends_with("</html>\n"));

    let generate = [
        "generate",
        "sled.hamel",
        "--out-dir",
        "src/generated",
        "--scene",
        "default",
        "--mod-file",
        "mod.rs",
    ];
    let check = [&generate[..], &["--check"]].concat();
    let out = folder.run(&check, "");
    assert_eq!(out.status.code(), Some(1), "{}", text(&out.stdout));
    assert!(text(&out.stderr).contains("sled.rs is missing"), "{}", text(&out.stderr));
    assert!(folder.done(&generate, "").contains("1 scenes: 2 files written"));
    assert!(read(&folder.path("src/generated/sled.rs")).contains("pub fn rhs"));
    assert!(read(&folder.path("src/generated/mod.rs")).contains("pub mod sled"));
    assert!(folder.done(&generate, "").contains("nothing changed"));
    folder.done(&check, "");
    std::fs::write(folder.path("src/generated/sled.rs"), "mine").unwrap();
    let out = folder.run(&check, "");
    let told = text(&out.stderr);
    assert!(told.contains("sled.rs is out of date") && told.contains(&generate[..4].join(" ")), "{told}");
}

/// A flow is shown as pictures of its field.
#[test]
fn fields_on_the_torus_are_drawn() {
    let folder = Folder::new("field");
    let model = "model flow {
        algebra fluid = zeitlin(3);
        momentum omega in fluid as *;
        action right;
        hamiltonian = -dot(omega, laplacian(fluid)^-1*omega);
        initial re_0_1 = 1; initial im_0_1 = 0; initial re_1_m1 = 0; initial im_1_m1 = 0;
        initial re_1_0 = 0.5; initial im_1_0 = 0; initial re_1_1 = 0; initial im_1_1 = 0.2;
        /// Stream function [m^2/s].
        view stream = field(-laplacian(fluid)^-1*omega);
        /// Vorticity times time.
        view rate = field(t*omega);
    }";
    std::fs::write(folder.path("flow.hamel"), model).unwrap();
    folder.done(&["simulate", "flow.hamel", "--t-final", "3", "-o", "flow.svg"], "");
    let drawn = read(&folder.path("flow.svg"));
    assert!(
        drawn.contains("Stream function [m²/s]") && drawn.contains("Vorticity times time"),
        "{}",
        drawn.len()
    );
    for time in ["t = 0.00 s", "t = 0.60 s", "t = 3.00 s"] {
        assert_eq!(drawn.matches(time).count(), 2, "{time}");
    }
    folder.done(&["report", "flow.hamel", "--t-final", "1"], "");
    let page = read(&folder.path("flow.html"));
    assert!(page.contains("id=\"field1\"") && !page.contains("id=\"view\""));
    // The first frame is the initial stream function.
    let waves = "\"waves\":[[0,1],[1,-1],[1,0],[1,1]],\"frames\":[[1.0000e0,0,0,0,5.0000e-1,0,0,1.0000e-1],";
    assert!(page.contains(waves));
}

#[test]
fn shipped_models_are_known_by_name() {
    let folder = Folder::new("shipped");
    assert!(folder.done(&["list", "suslov"], "").contains("Suslov"));
    let request = r#"{"states": [{"Omega1": 1, "Omega2": 0.2, "Omega3": 0.1}]}"#;
    let answer = folder.done(&["eval", "free_rigid_body"], request);
    assert!(answer.starts_with(r#"{"model":"free_rigid_body","state":["Omega1""#), "{answer}");
    let request = r#"{"initial": {"Omega1": 1, "Omega2": 0.2, "Omega3": 0.1}, "t_final": 1}"#;
    let answer = folder.done(&["simulate", "free_rigid_body", "--json"], request);
    assert!(answer.starts_with(r#"{"t":1.0,"final":{"Omega1""#), "{answer}");
    folder.done(&["ensemble", "heavy_top", "--sweep", "m=1..2:3", "--t-final", "1", "-o", "tops.csv"], "");
    assert_eq!(read(&folder.path("tops.csv")).lines().count(), 4);

    // What was asked for and cannot be had is told.
    let out = folder.run(&["explain", "havy_top"], "");
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("did you mean `heavy_top`?"), "{}", text(&out.stderr));
}
