//! `bench`: `rhs` here, `wp` in [`wp`](mod@wp), `scaling` in [`scaling`](mod@scaling).
//!
//! `bench rhs`: the generated right-hand sides beside opponents, in nanoseconds, executed instructions and operations.
//!
//! The measuring program is another process (package `hamel-bench`), built for the chosen instruction set in a target
//! directory of its own, so that the flags do not rebuild everything else.
//!
//! Deliberately does not know: generated code and opponents, what they compute, how a table is drawn ([`report`]).

mod instructions;
pub mod peers;
pub mod report;
pub mod scaling;
pub mod scaling_report;
pub mod wp;
pub mod wp_report;

use std::io::{BufRead, BufReader, IsTerminal as _, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use hamel_codegen::program::Counts;
use indicatif::{ProgressBar, ProgressStyle};

use crate::codegen_bridge as bridge;
use crate::compiled;
use crate::error::Error;
use crate::workspace::{Spec, Workspace};
use report::Report;

/// Name of the package and program that measures.
pub const PACKAGE: &str = "hamel-bench";

/// The instruction set to compile for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum TargetCpu {
    /// That of this machine; not counted where valgrind does not know its instructions, such as AVX-512.
    Native,
    /// AVX2 and fused multiply-add, as the peers were measured.
    #[value(name = "x86-64-v3")]
    X86_64V3,
    /// The least that the target has.
    Baseline,
}

impl TargetCpu {
    /// `x86-64-v3` where this machine has it, so that counts can be compared with those of the peers.
    pub fn of_host() -> TargetCpu {
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma") {
            return TargetCpu::X86_64V3;
        }
        TargetCpu::Baseline
    }

    /// As it is written on the command line.
    pub fn name(self) -> &'static str {
        match self {
            TargetCpu::Native => "native",
            TargetCpu::X86_64V3 => "x86-64-v3",
            TargetCpu::Baseline => "baseline",
        }
    }

    /// `RUSTFLAGS` for it, added to those of the user.
    pub fn rustflags(self) -> String {
        let own = match self {
            TargetCpu::Native | TargetCpu::X86_64V3 => format!("-C target-cpu={}", self.name()),
            TargetCpu::Baseline => String::new(),
        };
        let given = std::env::var("RUSTFLAGS").unwrap_or_default();
        format!("{given} {own}").trim().to_owned()
    }
}

/// What to measure, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Names of models; all when empty.
    pub models: Vec<String>,
    /// Rounds; the fastest and the median one are shown.
    pub rounds: u32,
    /// The instruction set.
    pub target_cpu: TargetCpu,
    /// Whether other code generators are measured, too.
    pub peers: bool,
}

impl Options {
    /// The command that repeats the measurement.
    fn command(&self) -> String {
        let mut words = vec!["cargo xtask bench rhs".to_owned()];
        words.extend(self.models.iter().cloned());
        words.push(format!("--rounds {} --target-cpu {}", self.rounds, self.target_cpu.name()));
        words.extend(self.peers.then(|| "--peers".to_owned()));
        words.join(" ")
    }
}

/// A right-hand side of the measuring program.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// Name of the model; `-` for the copy that is the floor of every measurement.
    pub model: String,
    /// Name of the scene.
    pub scene: String,
    /// By what means it is written; that of a peer names the compiler after a comma.
    pub kind: String,
    /// States of one call.
    pub lanes: u32,
}

impl Kernel {
    /// The copy kernel.
    pub fn is_copy(&self) -> bool {
        self.kind == "copy"
    }

    /// Its name in the measuring program.
    fn name(&self) -> String {
        let lanes = if self.lanes > 1 { format!("-{}", self.lanes) } else { String::new() };
        format!("{}/{}/{}{lanes}", self.model, self.scene, self.kind)
    }

    /// The kernel of a line of `hamel-bench list`.
    fn parse(line: &str) -> Option<Kernel> {
        let (name, lanes) = line.rsplit_once(' ')?;
        let lanes: u32 = lanes.parse().ok()?;
        let mut parts = name.split('/').map(str::to_owned);
        let (model, scene, kind) = (parts.next()?, parts.next()?, parts.next()?);
        let kind = kind.strip_suffix(&format!("-{lanes}")).unwrap_or(&kind).to_owned();
        Some(Kernel { model, scene, kind, lanes })
    }
}

/// What was measured of a kernel; times and instructions are those of one lane of one call.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The kernel.
    pub kernel: Kernel,
    /// Operations of the generated program.
    pub counts: Option<Counts>,
    /// Executed instructions, functions of the mathematical library and the loop around the call included.
    pub instructions: Option<f64>,
    /// Nanoseconds in the fastest round.
    pub min: f64,
    /// Nanoseconds in the median round.
    pub median: f64,
}

/// Measures, writes `docs/benchmarks` when all models were measured, and returns the table.
///
/// # Errors
/// Unknown models and problems of them, [`Error::Failed`] when the measuring program does not build or run, [`Error::Io`].
pub fn rhs(workspace: &Workspace, options: &Options) -> Result<String, Error> {
    let specs = if options.models.is_empty() {
        workspace.specs()?
    } else {
        options.models.iter().map(|m| workspace.spec(m)).collect::<Result<_, _>>()?
    };
    let program = build(workspace, options.target_cpu, &[])?;
    let mut kernels = list(&program)?;
    kernels.retain(|k| k.is_copy() || specs.iter().any(|s| s.name == k.model));
    kernels.retain(|k| k.scene != bridge::RECONSTRUCTION_SCENE);
    let mut programs = vec![Program { path: program, kernels }];
    let mut notes = Vec::new();
    let mut using = None;
    if options.peers {
        let models = specs.iter().map(|s| s.name.as_str());
        let models: Vec<&str> = models.filter(|m| peers::PEERS.iter().any(|p| p.model == *m)).collect();
        match peers::generate(workspace, options.target_cpu, &models) {
            Ok(made) => {
                programs.push(Program { kernels: list(&made.program)?, path: made.program });
                notes.extend(made.notes);
                using = Some(made.using);
            }
            Err(note) => notes.push(note),
        }
    }
    let mut rows = measure(&programs, options.rounds, &mut notes)?.into_iter();
    let mut own = rows.next().unwrap_or_default();
    for row in own.iter_mut().filter(|row| row.kernel.kind == "hamel") {
        if let Some(spec) = specs.iter().find(|s| s.name == row.kernel.model) {
            row.counts = Some(operations(workspace, spec, &row.kernel.scene)?);
        }
    }
    let peers = using.zip(rows.next()).map(|(using, rows)| peers::Peers { rows, using });
    let report = Report { command: options.command(), cpu: cpu(), rustc: rustc(), rows: own, peers, notes };
    let mut text = report.text();
    if options.models.is_empty() {
        for path in report.write(&workspace.root().join("docs/benchmarks"))? {
            text.push_str(&format!("wrote {}\n", workspace.shown(&path)));
        }
    } else {
        text.push_str("docs/benchmarks is written when all models are measured\n");
    }
    Ok(text)
}

/// A program that measures, and those of its kernels that are wanted.
struct Program {
    path: PathBuf,
    kernels: Vec<Kernel>,
}

/// How often the programs take turns: each start lays memory out anew, which some kernels feel.
const TURNS: u32 = 4;

/// Times and counts the kernels of all programs, which take turns; a list of rows a program.
fn measure(programs: &[Program], rounds: u32, notes: &mut Vec<String>) -> Result<Vec<Vec<Row>>, Error> {
    let counter = instructions::Counter::find();
    let kernels = programs.iter().map(|p| p.kernels.len() as u64).sum::<u64>();
    let n_rounds = u64::from(rounds) * programs.len() as u64;
    let bar = progress(n_rounds + counter.as_ref().map_or(0, |_| kernels));
    let mut timings: Vec<Vec<Vec<[f64; 2]>>> = vec![Vec::new(); programs.len()];
    for turn in 0..TURNS.min(rounds) {
        let rounds = (rounds + turn) / TURNS.min(rounds);
        for (program, timings) in programs.iter().zip(&mut timings) {
            timings.push(time(&program.path, &program.kernels, rounds, &bar)?);
        }
    }
    let mut all = Vec::new();
    for (program, timings) in programs.iter().zip(timings) {
        let counted = match &counter {
            Ok(counter) => counter.count(&program.path, &program.kernels, &bar),
            Err(_) => vec![None; program.kernels.len()],
        };
        let rows = program.kernels.iter().zip(counted).enumerate().map(|(k, (kernel, instructions))| {
            let lanes = f64::from(kernel.lanes);
            let of = |which: usize| timings.iter().map(move |turn| turn[k][which] / lanes);
            let mut medians: Vec<f64> = of(1).collect();
            medians.sort_by(f64::total_cmp);
            Row {
                kernel: kernel.clone(),
                counts: None,
                instructions: instructions.map(|n| n / lanes),
                min: of(0).fold(f64::INFINITY, f64::min),
                median: medians[medians.len() / 2],
            }
        });
        all.push(rows.collect::<Vec<_>>());
    }
    bar.finish_and_clear();
    // heyoka's code is for this machine, whatever was chosen; its batches are not counted anywhere.
    let lacks = |row: &Row| row.instructions.is_none() && !row.kernel.kind.starts_with("heyoka");
    match counter {
        Err(note) => notes.push(note),
        Ok(_) if all.iter().flatten().any(lacks) => {
            notes.push(
                "valgrind could not run every kernel: choose --target-cpu x86-64-v3 or baseline".into(),
            );
        }
        Ok(_) => (),
    }
    Ok(all)
}

/// Operations of the right-hand side of a scene.
fn operations(workspace: &Workspace, spec: &Spec, scene: &str) -> Result<Counts, Error> {
    bridge::build(&bridge::read(workspace, spec)?, scene).map(|built| built.rhs_counts())
}

/// Where the measuring program is built: apart, for other flags would rebuild everything else.
pub fn target_dir(workspace: &Workspace) -> PathBuf {
    workspace.root().join("target/bench")
}

fn build(workspace: &Workspace, cpu: TargetCpu, features: &[&str]) -> Result<PathBuf, Error> {
    let mut cargo = compiled::cargo_build(workspace, PACKAGE);
    cargo.args(features).arg("--target-dir").arg(target_dir(workspace)).env("RUSTFLAGS", cpu.rustflags());
    compiled::run_build(cargo, PACKAGE, "building the benchmarks")?.ok_or_else(|| Error::Failed {
        step: format!("building {PACKAGE}"),
        status: "see above; `cargo xtask generate` writes the generated files anew".into(),
    })
}

fn failed(status: impl std::fmt::Display) -> Error {
    Error::Failed { step: PACKAGE.into(), status: status.to_string() }
}

fn list(program: &Path) -> Result<Vec<Kernel>, Error> {
    let output = Command::new(program).arg("list").output();
    let output = output.map_err(|e| Error::io(PACKAGE, e))?;
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines()
        .map(|line| Kernel::parse(line).ok_or_else(|| failed(format!("unexpected {line:?}"))))
        .collect()
}

/// Nanoseconds of a call, in the fastest and the median round.
fn time(program: &Path, kernels: &[Kernel], rounds: u32, bar: &ProgressBar) -> Result<Vec<[f64; 2]>, Error> {
    bar.set_message("timing");
    let mut command = Command::new(program);
    command.arg("time").arg(rounds.to_string()).args(kernels.iter().map(Kernel::name));
    let mut timings = Vec::new();
    converse(command, PACKAGE, bar, |line| {
        let words: Vec<&str> = line.rsplitn(3, ' ').collect();
        let [median, min, _] = words[..] else { return None };
        timings.push([min, median].map(|x| x.parse().unwrap_or(f64::NAN)));
        Some(())
    })?;
    if timings.len() == kernels.len() { Ok(timings) } else { Err(failed("not every kernel was timed")) }
}

/// Runs a program that measures: lines `round` move the bar, the others are results, which `take` has to understand.
fn converse(
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

fn progress(length: u64) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
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
fn cpu() -> String {
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

fn rustc() -> String {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("--version").output();
    output.map_or_else(|_| "rustc".into(), |o| String::from_utf8_lossy(&o.stdout).trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::Kernel;

    #[test]
    fn kernels_are_read_as_they_are_named() {
        let peer = "heavy_top/default/wrenfold C++, gcc-8 8";
        for line in ["heavy_top/default/hamel 1", "heavy_top/default/hamel-8 8", "-/-/copy 1", peer] {
            let kernel = Kernel::parse(line).unwrap_or_else(|| panic!("{line}"));
            assert_eq!(format!("{} {}", kernel.name(), kernel.lanes), line);
        }
        assert_eq!(Kernel::parse("heavy_top/default/hamel-8 8").map(|k| k.kind), Some("hamel".to_owned()));
        assert_eq!(Kernel::parse("heavy_top 1"), None);
    }
}
