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
    let out = folder.run(&["simulate", "heavy_top", "--via", "compiled", "--t-final", "1"], "");
    assert!(out.status.success() && text(&out.stderr).contains("evaluated by the interpreter"));
    let out = folder.run(&["explain", "havy_top"], "");
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("did you mean `heavy_top`?"), "{}", text(&out.stderr));
}
