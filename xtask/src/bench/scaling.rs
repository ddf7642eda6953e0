//! `bench scaling`: how long generation and compilation take, and how fast the result is, as systems grow.
//!
//! The systems are synthetic: free motions on so(n) and su(n), on nilpotent groups, on these by stages, and with a
//! metric that couples all velocities. Each is generated, compiled as a program of its own by one call of rustc, and
//! timed. Chains of bodies are another part ([`super::chains`]).
//!
//! Does not know: how anything is derived or emitted, how a table is drawn ([`super::scaling_report`]).

use std::fmt::Write as _;
use std::process::Command;
use std::time::Instant;

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_program::program::Role;
use hamel_run::Error;
use hamel_run::repository::Repository;

use super::chains::chains;
use super::family::{Family, Row};
use super::program::{TargetCpu, progress};
use super::scaling_report::Report;
use super::source::Source;
use super::toolchain::{Options, Toolchain, failed, output};

/// The program around a generated module.
const MAIN: &str = include_str!("scaling_main.rs");

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

/// Where the measuring program evaluates: component `k` of the state.
fn component(k: usize) -> f64 {
    // As in `scaling_main.rs`.
    0.5 + 0.125 * (k % 7) as f64
}

/// The bits of the right-hand side by the interpreter.
fn interpreted(built: &BuiltScene) -> Vec<u64> {
    let params: Vec<f64> = built.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let state: Vec<f64> = (0..built.program().state.len()).map(component).collect();
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

impl Toolchain {
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
        if self.target_cpu() == TargetCpu::Baseline && result != interpreted(&built) {
            return Err(failed(&name, "the compiled right-hand side differs from the interpreted one"));
        }
        let program = built.program();
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
}

#[cfg(test)]
mod tests {
    use hamel_run::repository::Repository;

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
        assert!(row.operations > 2000 && row.lines > 1500, "{row:?}");
    }
}
