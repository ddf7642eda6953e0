//! FMUs of scenes, each beside a program that moves it.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use hamel_codegen::scene::{self, Scenes, Writing};
use hamel_codegen::spec;

/// Who makes the steps: the FMU by co-simulation, or its importer by Runge and Kutta's method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum By {
    Itself,
    Importer,
}

/// An FMU beside a program that moves it.
pub(crate) struct Moved {
    program: PathBuf,
    token: String,
    by: By,
    pub(crate) n_states: usize,
    n_events: usize,
}

impl Moved {
    /// Of a scene of a model `m`, with what the command `generate` asks of it; nothing without a C compiler.
    pub(crate) fn new(name: &str, text: &str, scene: &str, by: By) -> Option<Moved> {
        let is_there =
            Command::new("cc").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !is_there.is_ok_and(|status| status.success()) {
            println!("no C compiler: FMUs are not tried");
            return None;
        }
        let model = spec::parse("m", text).unwrap_or_else(|e| panic!("{name}: {e}"));
        let built = Scenes::new(&model).for_fmus().build(scene).unwrap_or_else(|e| panic!("{name}: {e}"));
        let initial = scene::start(&model, &built).unwrap_or_else(|e| panic!("{name}: {e}"));
        let (c, fmu) = built.emit_fmu(&Writing::default(), initial).unwrap_or_else(|e| panic!("{name}: {e}"));
        let driver = if by == By::Itself { "cosimulation" } else { "model_exchange" };
        let name: String = name.chars().filter(char::is_ascii_alphanumeric).collect();
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("fmu_{name}_{scene}_{driver}"));
        std::fs::create_dir_all(&folder).unwrap();
        let [own, functions] = ["", "_fmu"].map(|what| format!("{}{what}.c", c.prefix));
        let header = format!("{}.h", c.prefix);
        for (file, text) in [(&header, &c.header), (&own, &c.source), (&functions, &fmu.source)] {
            std::fs::write(folder.join(file), text).unwrap();
        }
        let path = format!("{}/tests/events/{driver}.c", env!("CARGO_MANIFEST_DIR"));
        let mut compiler = Command::new("cc");
        compiler.args(["-std=c99", "-O1", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-o", "run"]);
        let out = compiler.args([&own, &functions, &path, "-lm"]).current_dir(&folder).output().unwrap();
        assert!(out.status.success(), "{name}: {}", String::from_utf8_lossy(&out.stderr));
        let told = |from: &str, to: char| {
            let rest = fmu.source.split(from).nth(1).and_then(|rest| rest.split(to).next());
            rest.unwrap().to_owned()
        };
        Some(Moved {
            program: folder.join("run"),
            token: told("FMU_TOKEN \"", '"'),
            by,
            n_states: built.state_names().len(),
            n_events: told("FMU_EVENTS = ", ' ').parse().unwrap(),
        })
    }

    /// Moves to a time in steps of a size, with variables that co-simulation sets: lines `failed: ..`, then how the
    /// motion has ended, the time and the state.
    pub(crate) fn to(&self, t_final: f64, step: f64, set: &[&str]) -> String {
        let numbers = [t_final.to_string(), step.to_string(), self.n_states.to_string()];
        let mut command = Command::new(&self.program);
        command.arg(&self.token).args(numbers).args(set);
        if self.by == By::Importer {
            command.arg(self.n_events.to_string());
        }
        let out = command.output().unwrap();
        assert!(out.status.success(), "{out:?}");
        String::from_utf8(out.stdout).unwrap()
    }
}

/// The time and the state that a motion tells.
pub(crate) fn numbers(told: &str) -> Vec<f64> {
    told.lines().filter_map(|line| line.parse().ok()).collect()
}
