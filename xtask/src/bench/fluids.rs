//! `bench fluids`: fluids as products of matrices, steps that keep the spectrum, beside other programs.
//!
//! Does not know: how anything is integrated, how a table is drawn ([`super::fluids_report`]).

use std::process::Command;

use hamel_run::Error;
use hamel_run::repository::Repository;

use super::fluids_report::{Long, Report, Row};
use super::peers::{listen, script};
use super::program::{PACKAGE, TargetCpu, build, converse, progress, target_dir};
use super::source::Source;

/// What to measure, and how.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Options {
    /// Rounds; the fastest counts.
    pub(crate) rounds: u32,
    /// The instruction set.
    pub(crate) target_cpu: TargetCpu,
    /// Whether programs in Python are measured, too.
    pub(crate) peers: bool,
}

impl Options {
    /// The command that repeats the measurement.
    fn command(self) -> String {
        let peers = if self.peers { " --peers" } else { "" };
        let Options { rounds, target_cpu, .. } = self;
        format!("cargo xtask bench fluids --rounds {rounds} --target-cpu {}{peers}", target_cpu.name())
    }
}

/// Measures, writes `docs/benchmarks/fluids.*`, and returns the table.
///
/// # Errors
/// [`Error::Failed`] when the measuring program does not build or run, [`Error::Io`].
pub(crate) fn fluids(repository: &Repository, options: Options) -> Result<String, Error> {
    let program = build(repository, options.target_cpu, &["--no-default-features", "--features", "measure"])?;
    let folder = target_dir(repository).join("flows");
    std::fs::create_dir_all(&folder).map_err(|e| Error::io(folder.display().to_string(), e))?;
    let (mut rows, mut long) = (Vec::new(), Vec::new());
    // Sixteen sizes with three tolerances each, and two long runs.
    let bar = progress(50);
    let mut command = Command::new(&program);
    command.args(["fluids", &options.rounds.to_string()]).arg(&folder);
    converse(command, PACKAGE, &bar, |line| {
        match line.strip_prefix("long;") {
            Some(run) => long.push(Long::parse(run)?),
            None => rows.push(Row::parse(line)?),
        }
        Some(())
    })?;
    bar.finish_and_clear();
    let mut notes = Vec::new();
    let mut using = Vec::new();
    if options.peers {
        let mut sizes: Vec<String> =
            rows.iter().filter(|r: &&Row| r.surface == "sphere").map(|r| r.n.to_string()).collect();
        sizes.dedup();
        let mut command = script(repository, "fluids.py");
        command.arg(&folder).args(sizes);
        let said = listen(command, "programs in Python", |line| {
            rows.push(Row::parse(line)?);
            Some(())
        });
        match said {
            Ok(said) => (notes, using) = (said.notes, said.using),
            Err(note) => notes.push(note),
        }
    }
    let report = Report { source: Source::here(options.command()), rows, long, using, notes };
    let mut text = report.text();
    for path in report.write(&repository.root().join("docs/benchmarks"))? {
        text.push_str(&format!("wrote {}\n", repository.shown(&path)));
    }
    Ok(text)
}
