//! What `bench scaling` is asked for, and rustc, by which it compiles generated modules as programs.
//!
//! Does not know: which modules there are, what their programs measure.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use crate::cargo;
use hamel::Error;
use hamel::repository::Repository;

use super::program::{TargetCpu, target_dir};

/// The runtime, which every program is linked with.
const RUNTIME: &str = "hamel-runtime";

/// What to measure, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Options {
    /// Small systems only, and nothing is written.
    pub(crate) short: bool,
    /// How often each system is generated and compiled; the fastest time of each counts.
    pub(crate) rounds: u32,
    /// The instruction set.
    pub(crate) target_cpu: TargetCpu,
    /// Whether Pinocchio moves the chains, too.
    pub(crate) peers: bool,
}

impl Options {
    /// The command that repeats the measurement.
    pub(super) fn command(&self) -> String {
        let short = if self.short { "--short " } else { "" };
        let peers = if self.peers { " --peers" } else { "" };
        format!(
            "cargo xtask bench scaling {short}--rounds {} --target-cpu {}{peers}",
            self.rounds,
            self.target_cpu.name()
        )
    }
}

pub(super) fn failed(step: &str, status: impl std::fmt::Display) -> Error {
    Error::Failed { step: step.into(), status: status.to_string() }
}

/// rustc, with the compiled runtime.
#[derive(Clone, Debug)]
pub(crate) struct Toolchain {
    /// Arguments of every call.
    arguments: Vec<String>,
    /// Where sources and programs are.
    folder: PathBuf,
    /// The folder that decides which rustc it is.
    root: PathBuf,
    target_cpu: TargetCpu,
}

impl Toolchain {
    /// Builds the runtime for an instruction set.
    ///
    /// # Errors
    /// [`Error::Failed`] when it does not build; [`Error::Io`].
    pub(crate) fn new(repository: &Repository, target_cpu: TargetCpu) -> Result<Toolchain, Error> {
        let mut cargo = cargo::cargo_build(repository, RUNTIME, cargo::Profile::Release);
        let flags = target_cpu.rustflags();
        cargo
            .args(["--features", "std"])
            .arg("--target-dir")
            .arg(target_dir(repository))
            .env("RUSTFLAGS", &flags);
        let library = cargo::run_library_build(cargo, "hamel_runtime", "building the runtime")?;
        let library = library.ok_or_else(|| failed("building hamel-runtime", "see above"))?;
        let mut arguments: Vec<String> =
            ["--edition", "2024", "-C", "opt-level=3"].map(str::to_owned).to_vec();
        arguments.extend(flags.split_whitespace().map(str::to_owned));
        arguments.push("--extern".into());
        arguments.push(format!("hamel_runtime={}", library.display()));
        arguments.push("-L".into());
        let beside = library.parent().unwrap_or(Path::new("."));
        arguments.push(format!("dependency={}", beside.join("deps").display()));
        let folder = target_dir(repository).join(format!("scaling-{}", target_cpu.name()));
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(folder.display().to_string(), e))?;
        Ok(Toolchain { arguments, folder, root: repository.root().to_owned(), target_cpu })
    }

    /// The time rustc takes for a program of these sources, the first of which is its root, in a folder of their own
    /// within that of all, and the program.
    ///
    /// # Errors
    /// [`Error::Failed`] with what rustc says when it does not build; [`Error::Io`].
    pub(super) fn compile<'s>(
        &self,
        name: &str,
        folder: &str,
        sources: impl IntoIterator<Item = (&'s str, &'s str)>,
    ) -> Result<(Duration, PathBuf), Error> {
        let folder = self.folder.join(folder);
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(folder.display().to_string(), e))?;
        for (file, text) in sources {
            let path = folder.join(file);
            std::fs::write(&path, text).map_err(|e| Error::io(path.display().to_string(), e))?;
        }
        let program = folder.join(format!("scaling{}", std::env::consts::EXE_SUFFIX));
        let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let mut command = Command::new(compiler);
        command.current_dir(&self.root);
        command.args(&self.arguments).arg("-o").arg(&program).arg(folder.join("main.rs"));
        let clock = Instant::now();
        output(name, command)?;
        Ok((clock.elapsed(), program))
    }

    /// Where sources and programs are.
    pub(super) fn folder(&self) -> &Path {
        &self.folder
    }

    /// The instruction set.
    pub(super) fn target_cpu(&self) -> TargetCpu {
        self.target_cpu
    }
}

/// What a program prints.
pub(super) fn output(name: &str, mut command: Command) -> Result<String, Error> {
    let shown = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|e| Error::io(shown, e))?;
    if !output.status.success() {
        return Err(failed(name, String::from_utf8_lossy(&output.stderr)));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}
