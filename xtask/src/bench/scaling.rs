//! `bench scaling`: how long generation and compilation take, and how fast the result is, as systems grow.
//!
//! The systems are synthetic: free motions on so(n) and su(n), on nilpotent groups, on these by stages, and with a metric
//! that couples all velocities. Each is generated, compiled as a program of its own by one call of rustc, and timed.
//!
//! Deliberately does not know: how anything is derived or emitted, how a table is drawn ([`super::scaling_report`]).

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use hamel_codegen::program::Role;
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;

use super::scaling_report::Report;
use super::{TargetCpu, cpu, progress, rustc, target_dir};
use crate::compiled;
use crate::error::Error;
use crate::workspace::Workspace;

/// The runtime, which every program is linked with.
const RUNTIME: &str = "hamel-runtime";
/// The program around a generated module.
const MAIN: &str = include_str!("scaling_main.rs");

/// What to measure, and how.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Small systems only, and nothing is written.
    pub short: bool,
    /// How often each system is generated and compiled; the fastest time of each counts.
    pub rounds: u32,
    /// The instruction set.
    pub target_cpu: TargetCpu,
}

impl Options {
    /// The command that repeats the measurement.
    fn command(&self) -> String {
        let short = if self.short { "--short " } else { "" };
        format!(
            "cargo xtask bench scaling {short}--rounds {} --target-cpu {}",
            self.rounds,
            self.target_cpu.name()
        )
    }
}

/// A family of systems of growing dimension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// so(n), a diagonal metric: the free rigid body in n dimensions.
    Rotations,
    /// su(n), a diagonal metric.
    Unitary,
    /// Strictly upper triangular matrices, a diagonal metric.
    Nilpotent,
    /// The same by stages, along the lower central series.
    Chain,
    /// so(n), a metric with all entries different from zero.
    Coupled,
}

impl Family {
    /// All of them.
    pub const ALL: [Family; 5] =
        [Family::Rotations, Family::Unitary, Family::Nilpotent, Family::Chain, Family::Coupled];

    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Family::Rotations => "so(n)",
            Family::Unitary => "su(n)",
            Family::Nilpotent => "nilpotent",
            Family::Chain => "nilpotent by stages",
            Family::Coupled => "so(n), dense metric",
        }
    }

    /// Sizes of the matrices, from small to large; a parameter of a model has at most 200 components, which bounds the last family.
    fn sizes(self, short: bool) -> &'static [usize] {
        let sizes: &[usize] = match self {
            Family::Rotations => &[5, 6, 8, 10, 12, 13],
            Family::Unitary => &[3, 4, 6, 7, 8],
            Family::Nilpotent | Family::Chain => &[5, 6, 8, 10, 12, 13],
            Family::Coupled => &[4, 5, 6],
        };
        if short { &sizes[..2] } else { sizes }
    }

    /// The dimension of the algebra for matrices of that size.
    fn dim(self, n: usize) -> usize {
        match self {
            Family::Unitary => n * n - 1,
            _ => n * (n - 1) / 2,
        }
    }

    /// The system as the text of a model.
    pub fn text(self, n: usize) -> String {
        let dim = self.dim(n);
        let algebra = match self {
            Family::Rotations | Family::Coupled => rotations(n),
            Family::Unitary => format!("algebra g = su({n});\n"),
            Family::Nilpotent | Family::Chain => triangular(n),
        };
        let metric = match self {
            Family::Coupled => {
                // Diagonally dominant: the sum of 1/(i + j)^2 over a row is less than 1.
                let entry = |i: usize, j: usize| {
                    if i == j { format!("{}/4", 8 + i) } else { format!("1/{}", (i + j + 2).pow(2)) }
                };
                let upper = (0..dim).flat_map(|i| (i..dim).map(move |j| entry(i, j)));
                format!("symmetric({dim}) = [{}]", upper.collect::<Vec<_>>().join(", "))
            }
            _ => {
                let moments = (0..dim).map(|i| format!("{}/4", 4 + i)).collect::<Vec<_>>().join(", ");
                let positive = (1..=dim).map(|i| format!("I{i} > 0")).collect::<Vec<_>>().join(", ");
                format!("diagonal({dim}) = [{moments}] where {positive}")
            }
        };
        let mut stages = String::new();
        if self == Family::Chain {
            stages.push_str("stage s0;\n");
            // The first n - 1 elements lie on the first diagonal, n - 2 on the next one, and so on.
            let mut first = 1;
            for k in 1..n - 1 {
                first += n - k;
                let ideal = (first..=dim).map(|i| format!("xi{i}")).collect::<Vec<_>>().join(", ");
                let _ = writeln!(stages, "stage s{k} = ideal({ideal});");
            }
        }
        format!(
            "model scaling {{\n{algebra}param I: {metric};\nvelocity xi in g;\n{stages}lagrangian = 1/2*dot(xi, I*xi);\n}}\n"
        )
    }
}

/// An algebra by the commutators of `E_ij - E_ji`, `i < j`.
fn rotations(n: usize) -> String {
    let pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j))).collect();
    by_brackets(&pairs, |(i, j), (k, l)| {
        let unit = |a: usize, b: usize, sign: i8| if a < b { ((a, b), sign) } else { ((b, a), -sign) };
        let terms = [(j == k, i, l, 1), (i == l, j, k, 1), (j == l, i, k, -1), (i == k, j, l, -1)];
        terms.into_iter().find(|(there, a, b, _)| *there && a != b).map(|(_, a, b, sign)| unit(a, b, sign))
    })
}

/// An algebra by the commutators of `E_ij`, `i < j`, diagonal by diagonal.
fn triangular(n: usize) -> String {
    let pairs: Vec<(usize, usize)> = (1..n).flat_map(|d| (0..n - d).map(move |i| (i, i + d))).collect();
    by_brackets(&pairs, |(i, j), (k, l)| match () {
        () if j == k => Some(((i, l), 1)),
        () if l == i => Some(((k, j), -1)),
        () => None,
    })
}

/// An algebra with a basis element for each pair, in which brackets of these are basis elements up to a sign.
fn by_brackets(
    pairs: &[(usize, usize)],
    bracket: impl Fn((usize, usize), (usize, usize)) -> Option<((usize, usize), i8)>,
) -> String {
    let place = |pair| pairs.iter().position(|p| *p == pair).map(|k| k + 1);
    let basis: Vec<String> = (1..=pairs.len()).map(|k| format!("e{k}")).collect();
    let mut text = format!("algebra g {{\nbasis {};\n", basis.join(", "));
    for (a, x) in pairs.iter().enumerate() {
        for (b, y) in pairs.iter().enumerate().skip(a + 1) {
            if let Some((pair, sign)) = bracket(*x, *y)
                && let Some(c) = place(pair)
            {
                let minus = if sign < 0 { "-" } else { "" };
                let _ = writeln!(text, "[e{}, e{}] = {minus}e{c};", a + 1, b + 1);
            }
        }
    }
    text + "}\n"
}

/// What was measured of one system.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The family.
    pub family: Family,
    /// Dimension of the algebra, which is that of the state.
    pub dim: usize,
    /// Operations of one call of the right-hand side.
    pub operations: usize,
    /// Operations of all functions and of the part that runs once.
    pub all_operations: usize,
    /// Time from the text of the model to the text of the module.
    pub generation: Duration,
    /// Lines of the module.
    pub lines: usize,
    /// Time that rustc takes for the whole program, optimised.
    pub rustc: Duration,
    /// Nanoseconds of one call of the right-hand side in the fastest round.
    pub ns: f64,
}

impl Row {
    /// The faster time of each kind from two measurements of one system.
    fn or_faster(self, other: &Row) -> Row {
        Row {
            generation: self.generation.min(other.generation),
            rustc: self.rustc.min(other.rustc),
            ns: self.ns.min(other.ns),
            ..self
        }
    }
}

/// Measures, writes `docs/benchmarks/scaling.*` unless it is a short run, and returns the table.
///
/// # Errors
/// [`Error::Failed`] when a program does not build or run, or when its result differs from that of the interpreter, which
/// is checked where both round alike; [`Error::Io`].
pub fn scaling(workspace: &Workspace, options: &Options) -> Result<String, Error> {
    let systems: Vec<(Family, usize)> = Family::ALL
        .into_iter()
        .flat_map(|family| family.sizes(options.short).iter().map(move |n| (family, *n)))
        .collect();
    let toolchain = Toolchain::new(workspace, options.target_cpu)?;
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
    let report = Report { command: options.command(), cpu: cpu(), rustc: rustc(), rows };
    let mut text = report.text();
    if options.short {
        text.push_str("docs/benchmarks is written without --short\n");
    } else {
        for path in report.write(&workspace.root().join("docs/benchmarks"))? {
            let _ = writeln!(text, "wrote {}", workspace.shown(&path));
        }
    }
    Ok(text)
}

fn failed(step: &str, status: impl std::fmt::Display) -> Error {
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
pub struct Toolchain {
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
    pub fn new(workspace: &Workspace, target_cpu: TargetCpu) -> Result<Toolchain, Error> {
        let mut cargo = compiled::cargo_build(workspace, RUNTIME);
        let flags = target_cpu.rustflags();
        cargo
            .args(["--features", "std"])
            .arg("--target-dir")
            .arg(target_dir(workspace))
            .env("RUSTFLAGS", &flags);
        let library = compiled::run_library_build(cargo, "hamel_runtime", "building the runtime")?;
        let library = library.ok_or_else(|| failed("building hamel-runtime", "see above"))?;
        let mut arguments: Vec<String> =
            ["--edition", "2024", "-C", "opt-level=3"].map(str::to_owned).to_vec();
        arguments.extend(flags.split_whitespace().map(str::to_owned));
        arguments.push("--extern".into());
        arguments.push(format!("hamel_runtime={}", library.display()));
        arguments.push("-L".into());
        let beside = library.parent().unwrap_or(Path::new("."));
        arguments.push(format!("dependency={}", beside.join("deps").display()));
        let folder = target_dir(workspace).join(format!("scaling-{}", target_cpu.name()));
        std::fs::create_dir_all(&folder).map_err(|e| Error::io(folder.display().to_string(), e))?;
        Ok(Toolchain { arguments, folder, root: workspace.root().to_owned(), target_cpu })
    }

    /// Generates, compiles and times the system of a family with matrices of size `n`.
    ///
    /// # Errors
    /// [`Error::Failed`] when the program does not build or run, or when its result differs from that of the interpreter,
    /// which is checked on the baseline, where both round alike; [`Error::Io`].
    pub fn measure(&self, family: Family, n: usize) -> Result<Row, Error> {
        let name = format!("{} {}", family.name(), family.dim(n));
        let clock = Instant::now();
        let model = spec::parse("scaling.hamel", &family.text(n)).map_err(|e| failed(&name, e))?;
        let built = scene::build(&model, scene::DEFAULT).map_err(|e| failed(&name, e))?;
        let text = built.emit().map_err(|e| failed(&name, e))?;
        let generation = clock.elapsed();
        let (rustc, output) = self.compile_and_run(&name, &text)?;
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

    /// The time rustc takes for a module and the program around it, and what the program prints.
    fn compile_and_run(&self, name: &str, module: &str) -> Result<(Duration, String), Error> {
        for (file, text) in [("main.rs", MAIN), ("scene.rs", module)] {
            let path = self.folder.join(file);
            std::fs::write(&path, text).map_err(|e| Error::io(path.display().to_string(), e))?;
        }
        let program = self.folder.join(format!("scaling{}", std::env::consts::EXE_SUFFIX));
        let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let mut command = Command::new(compiler);
        command.current_dir(&self.root);
        command.args(&self.arguments).arg("-o").arg(&program).arg(self.folder.join("main.rs"));
        let clock = Instant::now();
        let output = command.output().map_err(|e| Error::io("rustc could not be started", e))?;
        let elapsed = clock.elapsed();
        if !output.status.success() {
            return Err(failed(name, String::from_utf8_lossy(&output.stderr)));
        }
        let output = Command::new(&program).output();
        let output = output.map_err(|e| Error::io(program.display().to_string(), e))?;
        if !output.status.success() {
            return Err(failed(name, String::from_utf8_lossy(&output.stderr)));
        }
        Ok((elapsed, String::from_utf8_lossy(&output.stdout).into_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::{Family, parse};
    use hamel_codegen::spec;

    #[test]
    fn every_family_is_a_model_of_its_dimension() {
        for family in Family::ALL {
            for n in &family.sizes(false)[..2] {
                let text = family.text(*n);
                let model = spec::parse("scaling.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
                let params: usize = model.params.len();
                let metric = |dim: usize| if family == Family::Coupled { dim * (dim + 1) / 2 } else { dim };
                assert_eq!(params, metric(family.dim(*n)), "{} {n}", family.name());
            }
        }
    }

    #[test]
    fn what_the_program_prints_is_read() {
        assert_eq!(parse("12.5\n0 3ff0000000000000\n"), Some((12.5, vec![0, 0x3ff0_0000_0000_0000])));
        assert_eq!(parse("12.5"), None);
    }
}
