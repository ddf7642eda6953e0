//! FMUs of scenes, compiled with a program that moves them.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use hamel_codegen::scene::{self, Scenes, Writing};
use hamel_codegen::spec;

/// Who integrates: the FMU, or its importer by Runge and Kutta's method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum By {
    Itself,
    Importer,
}

/// An FMU with programs that move it.
pub(crate) struct Fmu {
    folder: PathBuf,
    token: String,
    n_state: usize,
}

/// Whether there is a C compiler.
pub(crate) fn has_compiler() -> bool {
    let status = Command::new("cc").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

impl Fmu {
    /// Of a scene of a model `m`, with what the command `generate` asks of it.
    pub(crate) fn of(name: &str, text: &str, scene: &str) -> Fmu {
        let model = spec::parse("m", text).unwrap_or_else(|e| panic!("{name}: {e}"));
        let built =
            Scenes::new(&model).with_ranks(true).build(scene).unwrap_or_else(|e| panic!("{name}: {e}"));
        let initial = scene::start(&model, &built).unwrap_or_else(|e| panic!("{name}: {e}"));
        let n_state = initial.as_ref().map_or(0, |start| start.state.len());
        let (c, fmu) = built.emit_fmu(&Writing::default(), initial).unwrap_or_else(|e| panic!("{name}: {e}"));
        let name: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fmu_{name}"));
        std::fs::create_dir_all(&folder).unwrap();
        let [own, functions] = ["", "_fmu"].map(|what| format!("{}{what}.c", c.prefix));
        let header = format!("{}.h", c.prefix);
        for (file, text) in [(&header, &c.header), (&own, &c.source), (&functions, &fmu.source)] {
            std::fs::write(folder.join(file), text).unwrap();
        }
        let driver = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/events/fmu.c");
        let mut compiler = Command::new("cc");
        compiler.args(["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-o", "run"]);
        let out = compiler.args([&own, &functions, driver, "-lm"]).current_dir(&folder).output().unwrap();
        assert!(out.status.success(), "{name}: {}", String::from_utf8_lossy(&out.stderr));
        let token = fmu.source.split("FMU_TOKEN \"").nth(1).and_then(|rest| rest.split('"').next());
        Fmu { folder, token: token.unwrap().to_owned(), n_state }
    }

    /// Moves to a time in steps of a size: lines `failed: ..` that it tells, then how the motion has ended, the time
    /// and the state.
    pub(crate) fn moved(&self, by: By, t_final: f64, size: f64) -> (Vec<String>, String, Vec<f64>) {
        let (t_final, size, n) = (t_final.to_string(), size.to_string(), self.n_state.to_string());
        let by = if by == By::Itself { "itself" } else { "importer" };
        let mut command = Command::new(self.folder.join("run"));
        let out = command.args([&self.token, &t_final, &size, &n, by]).output().unwrap();
        let told = String::from_utf8_lossy(&out.stdout);
        assert!(out.status.success(), "{told}");
        let mut lines = told.lines().map(str::to_owned);
        let mut failures = Vec::new();
        let end = loop {
            match lines.next().unwrap() {
                line if line.starts_with("failed: ") => failures.push(line),
                end => break end,
            }
        };
        (failures, end, lines.map(|line| line.parse().unwrap()).collect())
    }
}
