//! `bench scaling`: how long generation and compilation take, and how fast the result is, as systems grow.
//!
//! The systems are synthetic: free motions on so(n) and su(n), on nilpotent groups, on these by stages, and with a
//! metric that couples all velocities. Each is generated, compiled as a program of its own by one call of rustc, and
//! timed. Chains of bodies are another part ([`super::chains`]).
//!
//! Does not know: how anything is derived or emitted, how a table is drawn ([`super::scaling_report`]).

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use hamel::Error;
use hamel::repository::Repository;
use hamel::run::cargo;
use hamel_codegen::program::Role;
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;

use super::chains::chains;
use super::family::{Family, Row};
use super::program::{TargetCpu, progress, target_dir};
use super::scaling_report::Report;
use super::source::Source;

/// The runtime, which every program is linked with.
const RUNTIME: &str = "hamel-runtime";
/// The program around a generated module.
const MAIN: &str = include_str!("scaling_main.rs");

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
    fn command(&self) -> String {
        let short = if self.short { "--short " } else { "" };
        let peers = if self.peers { " --peers" } else { "" };
        format!(
            "cargo xtask bench scaling {short}--rounds {} --target-cpu {}{peers}",
            self.rounds,
            self.target_cpu.name()
        )
    }
}

/// Measures, writes `docs/benchmarks/scaling.*` unless it is a short run, and returns the table.
///
/// # Errors
/// [`Error::Failed`] when a program does not build or run, or when its result differs from that of the interpreter,
/// which is checked where both round alike; [`Error::Io`].
pub(crate) fn scaling(repository: &Repository, options: &Options) -> Result<String, Error> {
    let systems: Vec<(Family, usize)> = Family::ALL
        .into_iter()
        .flat_map(|family| family.sizes(options.short).iter().map(move |n| (family, *n)))
        .collect();
    let toolchain = Toolchain::new(repository, options.target_cpu)?;
    let bar = progress(u64::from(options.rounds) * systems.len() as u64);
    let mut rows = Vec::with_capacity(systems.len());
    for (family, n) in systems {
        bar.set_message(format!("{} {}", family.name(), family.dim(n)));
        let mut fastest: Option<Row> = None;
        for _ in 0..options.rounds {
            let row = toolchain.measure(family, n)?;
            fastest = Some(fastest.map_or(row.clone(), |before| before.or_faster(&row)));
            bar.inc(1);
        }
        rows.extend(fastest);
    }
    bar.finish_and_clear();
    let chains = chains(repository, &toolchain, options)?;
    let report = Report { source: Source::here(options.command()), rows, chains };
    let mut text = report.text();
    if options.short {
        text.push_str("docs/benchmarks is written without --short\n");
    } else {
        for path in report.write(&repository.root().join("docs/benchmarks"))? {
            let _ = writeln!(text, "wrote {}", repository.shown(&path));
        }
    }
    Ok(text)
}

pub(super) fn failed(step: &str, status: impl std::fmt::Display) -> Error {
    Error::Failed { step: step.into(), status: status.to_string() }
}

/// Where the measuring program evaluates: component `k` of the state.
fn component(k: usize) -> f64 {
    // As in `scaling_main.rs`.
    0.5 + 0.125 * (k % 7) as f64
}

/// The bits of the right-hand side by the interpreter.
fn interpreted(built: &BuiltScene) -> Vec<u64> {
    let params: Vec<f64> =
        built.params().iter().map(|p| hamel_codegen::expr::rational_to_f64(&p.default)).collect();
    let state: Vec<f64> = (0..built.program.state.len()).map(component).collect();
    let mut rates = vec![0.0; state.len()];
    if let Ok(interpreter) = built.prepare(&params) {
        interpreter.rhs(0.0, &state, &mut rates);
    }
    rates.into_iter().map(f64::to_bits).collect()
}

/// A line with nanoseconds, and one with the bits of the right-hand side.
fn parse(output: &str) -> Option<(f64, Vec<u64>)> {
    let (ns, bits) = output.split_once('\n')?;
    let bits = bits.split_whitespace().map(|word| u64::from_str_radix(word, 16).ok());
    Some((ns.parse().ok()?, bits.collect::<Option<_>>()?))
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
        let mut cargo = cargo::cargo_build(repository, RUNTIME);
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

    /// Generates, compiles and times the system of a family with matrices of size `n`.
    ///
    /// # Errors
    /// [`Error::Failed`] when the program does not build or run, or when its result differs from that of the
    /// interpreter, which is checked on the baseline, where both round alike; [`Error::Io`].
    pub(crate) fn measure(&self, family: Family, n: usize) -> Result<Row, Error> {
        let name = format!("{} {}", family.name(), family.dim(n));
        let clock = Instant::now();
        let model = spec::parse("scaling.hamel", &family.text(n)).map_err(|e| failed(&name, e))?;
        let built = scene::build(&model, scene::DEFAULT).map_err(|e| failed(&name, e))?;
        let text = built.emit().map_err(|e| failed(&name, e))?;
        let generation = clock.elapsed();
        let (rustc, program) = self.compile(&name, "", [("main.rs", MAIN), ("scene.rs", &text)])?;
        let output = output(&name, Command::new(&program))?;
        let (ns, result) = parse(&output).ok_or_else(|| failed(&name, format!("unexpected {output:?}")))?;
        if self.target_cpu == TargetCpu::Baseline && result != interpreted(&built) {
            return Err(failed(&name, "the compiled right-hand side differs from the interpreted one"));
        }
        let program = &built.program;
        let rhs = program.function(&Role::Rate);
        let functions = program.functions.iter().map(|f| f.counts().total()).sum::<usize>();
        Ok(Row {
            family,
            dim: family.dim(n),
            operations: rhs.map_or(0, |f| f.counts().total()),
            all_operations: functions + program.prepare.counts().total(),
            generation,
            lines: text.lines().count(),
            rustc,
            ns,
        })
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
fn output(name: &str, mut command: Command) -> Result<String, Error> {
    let shown = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|e| Error::io(shown, e))?;
    if !output.status.success() {
        return Err(failed(name, String::from_utf8_lossy(&output.stderr)));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

#[cfg(test)]
mod tests {
    use hamel::repository::Repository;

    use super::{Family, TargetCpu, Toolchain, parse};

    #[test]
    fn what_the_program_prints_is_read() {
        assert_eq!(parse("12.5\n0 3ff0000000000000\n"), Some((12.5, vec![0, 0x3ff0_0000_0000_0000])));
        assert_eq!(parse("12.5"), None);
    }

    /// A large generated function, compiled, equals the interpreter bit for bit.
    #[test]
    fn the_compiled_free_body_in_thirteen_dimensions_equals_the_interpreter() {
        let repository = Repository::around(std::path::Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
        // The comparison is part of the measurement where the target rounds like the interpreter does.
        let toolchain = Toolchain::new(&repository, TargetCpu::Baseline).unwrap_or_else(|e| panic!("{e}"));
        let row = toolchain.measure(Family::Rotations, 13).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(row.dim, 78);
        // More than fit one block of bindings; see `MAX_BINDINGS` of the emitter.
        assert!(row.operations > 2000 && row.lines > 4000, "{row:?}");
    }
}
