//! A model generated in a process of its own: what it takes, and what came of it.
//!
//! Does not know: which model it is, how it is compiled.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use hamel_codegen::scene;
use hamel_codegen::spec;
use hamel_program::program::{Counts, Role};
use hamel_run::Error;
use serde::{Deserialize, Serialize};

use crate::bench::toolchain::failed;

/// What generation took, and what came of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(in crate::bench) struct Generated {
    /// Names of the state's components.
    pub(in crate::bench) state: Vec<String>,
    /// Additions, multiplications and pairs that are fused, of the right-hand side.
    pub(in crate::bench) adds: usize,
    pub(in crate::bench) muls: usize,
    pub(in crate::bench) fused: usize,
    /// All operations of it.
    pub(in crate::bench) operations: usize,
    /// Operations of all functions and of the part that runs once.
    pub(in crate::bench) all_operations: usize,
    /// Lines of the module.
    pub(in crate::bench) lines: usize,
    /// Seconds from the text of the model to the text of the module.
    pub(in crate::bench) seconds: f64,
    /// Largest memory of the process in MiB, where the system tells.
    pub(in crate::bench) peak: Option<f64>,
}

impl Generated {
    /// The faster time and the smaller peak of two measurements of one model.
    pub(super) fn or_faster(self, other: Generated) -> Generated {
        let peak = self.peak.zip(other.peak).map(|(a, b)| a.min(b));
        Generated { seconds: self.seconds.min(other.seconds), peak, ..self }
    }
}

/// Generates the scene `bare` of a model, writes the module beside it and tells what that took: for
/// [`generate_apart`].
///
/// # Errors
/// [`Error::Failed`] with the problems of the model; [`Error::Io`].
pub(in crate::bench) fn generate(file: &Path) -> Result<String, Error> {
    let name = file.display().to_string();
    let text = std::fs::read_to_string(file).map_err(|e| Error::io(&*name, e))?;
    let clock = Instant::now();
    let model = spec::parse(&name, &text).map_err(|e| failed(&name, e))?;
    let built = scene::build(&model, "bare").map_err(|e| failed(&name, e))?;
    let module = built.emit().map_err(|e| failed(&name, e))?;
    let seconds = clock.elapsed().as_secs_f64();
    std::fs::write(file.with_extension("rs"), &module).map_err(|e| Error::io(&*name, e))?;
    let program = built.program();
    let counts = program.function(&Role::Rate).map_or_else(Counts::default, |f| f.counts());
    let all = program.functions.iter().map(|f| f.counts().total()).sum::<usize>();
    let generated = Generated {
        state: built.state_names(),
        adds: counts.add,
        muls: counts.mul,
        fused: counts.fma,
        operations: counts.total(),
        all_operations: all + program.prepare.counts().total(),
        lines: module.lines().count(),
        seconds,
        peak: peak(),
    };
    serde_json::to_string(&generated).map_err(|e| failed(&name, e))
}

/// The largest memory of this process so far, in MiB; Linux alone tells it in a file.
fn peak() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<f64>().ok()? / 1024.0)
}

/// [`generate`] in a process of its own.
///
/// # Errors
/// Those of it.
pub(super) fn generate_apart(name: &str, file: &Path) -> Result<Generated, Error> {
    let program = std::env::current_exe().map_err(|e| Error::io("this program", e))?;
    let output = Command::new(program).args(["bench", "scaling", "--generate"]).arg(file).output();
    let output = output.map_err(|e| Error::io("this program", e))?;
    if !output.status.success() {
        return Err(failed(name, String::from_utf8_lossy(&output.stderr)));
    }
    serde_json::from_slice(&output.stdout).map_err(|e| failed(name, e))
}
