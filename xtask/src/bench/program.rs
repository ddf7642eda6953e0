//! The measuring program, package `hamel-bench`: how it is built and talked to, and what measurements say of the
//! machine.
//!
//! Does not know: what is measured, how it is shown.

use std::io::{BufRead, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::cargo;
use hamel_run::Error;
use hamel_run::repository::Repository;
use indicatif::{ProgressBar, ProgressStyle};

/// Name of the package and program that measures.
pub(super) const PACKAGE: &str = "hamel-bench";

/// The instruction set to compile for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum TargetCpu {
    /// That of this machine; not counted where valgrind does not know its instructions, such as AVX-512.
    Native,
    /// AVX-512 as well: eight lanes are one register.
    #[value(name = "x86-64-v4")]
    X86_64V4,
    /// AVX2 and fused multiply-add, as the peers were measured.
    #[value(name = "x86-64-v3")]
    X86_64V3,
    /// The least that the target has.
    Baseline,
}

impl TargetCpu {
    /// `x86-64-v3` where this machine has it, so that counts can be compared with those of the peers.
    pub(crate) fn of_host() -> TargetCpu {
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma") {
            return TargetCpu::X86_64V3;
        }
        TargetCpu::Baseline
    }

    /// `x86-64-v4` where this machine has more than `x86-64-v3` that way.
    pub(crate) fn wide() -> Option<TargetCpu> {
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx512f")
            && std::is_x86_feature_detected!("avx512bw")
            && std::is_x86_feature_detected!("avx512cd")
            && std::is_x86_feature_detected!("avx512dq")
            && std::is_x86_feature_detected!("avx512vl")
        {
            return Some(TargetCpu::X86_64V4);
        }
        None
    }

    /// As it is written on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            TargetCpu::Native => "native",
            TargetCpu::X86_64V4 => "x86-64-v4",
            TargetCpu::X86_64V3 => "x86-64-v3",
            TargetCpu::Baseline => "baseline",
        }
    }

    /// `RUSTFLAGS` for it, added to those of the user.
    pub(crate) fn rustflags(self) -> String {
        let own = match self {
            TargetCpu::Native | TargetCpu::X86_64V4 | TargetCpu::X86_64V3 => {
                format!("-C target-cpu={}", self.name())
            }
            TargetCpu::Baseline => String::new(),
        };
        let given = std::env::var("RUSTFLAGS").unwrap_or_default();
        format!("{given} {own}").trim().to_owned()
    }
}

/// Where the measuring program is built: apart, for other flags would rebuild everything else.
pub(super) fn target_dir(repository: &Repository) -> PathBuf {
    repository.root().join("target/bench")
}

/// Where it is built once more, for a second instruction set of the same measurement.
pub(super) fn second_target_dir(repository: &Repository) -> PathBuf {
    repository.root().join("target/bench-wide")
}

pub(super) fn build(repository: &Repository, cpu: TargetCpu, features: &[&str]) -> Result<PathBuf, Error> {
    build_in(&target_dir(repository), repository, cpu, features)
}

pub(super) fn build_in(
    folder: &Path,
    repository: &Repository,
    cpu: TargetCpu,
    features: &[&str],
) -> Result<PathBuf, Error> {
    let mut cargo = cargo::cargo_build(repository, PACKAGE, cargo::Profile::Release);
    cargo.args(features).arg("--target-dir").arg(folder).env("RUSTFLAGS", cpu.rustflags());
    cargo::run_build(cargo, PACKAGE, "building the benchmarks")?.ok_or_else(|| Error::Failed {
        step: format!("building {PACKAGE}"),
        status: "see above; `cargo xtask generate` writes the generated files anew".into(),
    })
}

pub(super) fn failed(status: impl std::fmt::Display) -> Error {
    Error::Failed { step: PACKAGE.into(), status: status.to_string() }
}

/// Runs a program that measures: lines `round` move the bar, the others are results, which `take` has to understand.
pub(super) fn converse(
    mut command: Command,
    name: &str,
    bar: &ProgressBar,
    mut take: impl FnMut(&str) -> Option<()>,
) -> Result<(), Error> {
    let spawned = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = spawned.map_err(|e| Error::io(name, e))?;
    // Piped above.
    for line in BufReader::new(child.stdout.take().expect("piped standard output")).lines() {
        let line = line.map_err(|e| Error::io(name, e))?;
        if line == "round" {
            bar.inc(1);
        } else if take(&line).is_none() {
            return Err(failed(format!("unexpected {line:?}")));
        }
    }
    let mut said = String::new();
    let _ = child.stderr.take().expect("piped standard error").read_to_string(&mut said);
    let status = child.wait().map_err(|e| Error::io(name, e))?;
    if status.success() { Ok(()) } else { Err(failed(said.trim())) }
}

pub(super) fn progress(length: u64) -> ProgressBar {
    if !hamel_run::signs::are_shown() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new(length);
    // The template is a constant that indicatif accepts.
    bar.set_style(
        ProgressStyle::with_template("  {msg:22} {bar:40} {percent:>3} % {elapsed}").expect("valid template"),
    );
    bar
}

/// What the system calls its processor.
pub(super) fn cpu() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = info.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let of_macos = || {
        let output = Command::new("sysctl").args(["-n", "machdep.cpu.brand_string"]).output().ok()?;
        let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        (output.status.success() && !text.is_empty()).then_some(text)
    };
    let name = model.map(|(_, name)| name.trim().to_owned()).or_else(of_macos);
    name.unwrap_or_else(|| format!("unknown {}", std::env::consts::ARCH))
}

pub(super) fn rustc() -> String {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("--version").output();
    output.map_or_else(|_| "rustc".into(), |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
}
