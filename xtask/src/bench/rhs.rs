//! `bench rhs`: the generated right-hand sides beside opponents, in nanoseconds, executed instructions and operations.
//!
//! The measuring program is another process (package `hamel-bench`), built for the chosen instruction set in a target
//! directory of its own, so that the flags do not rebuild everything else.
//!
//! Does not know: generated code and opponents, what they compute, how a table is drawn ([`super::rhs_report`]).

use std::path::{Path, PathBuf};
use std::process::Command;

use hamel_program::program::Counts;
use hamel_run::Error;
use hamel_run::interpreted;
use hamel_run::model::RECONSTRUCTION_SCENE;
use hamel_run::repository::Repository;
use hamel_run::session::{ModelFile, Session};
use indicatif::ProgressBar;

use super::chosen::{self, Chosen};
use super::kernel::{Kernel, Row};
use super::program::{PACKAGE, build, converse, failed, progress};
use super::rhs_report::Report;
use super::source::Source;
use super::{instructions, peers};

/// What to measure, and how.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// All models where none is named.
    pub(crate) chosen: Chosen,
    /// Rounds; the fastest and the median one are shown.
    pub(crate) rounds: u32,
    /// Whether other code generators are measured, too.
    pub(crate) peers: bool,
}

/// Measures, writes `docs/benchmarks` when all models were measured, and returns the table.
///
/// # Errors
/// Unknown models and problems of them, [`Error::Failed`] when the measuring program does not build or run,
/// [`Error::Io`].
pub(crate) fn rhs(repository: &Repository, session: &Session, options: &Options) -> Result<String, Error> {
    let Options { chosen, rounds, peers: has_peers } = options;
    let files = session.find_compiled(&chosen.models)?;
    let program = build(repository, chosen.target_cpu(), &[])?;
    let mut own = Program::open(program)?;
    own.kernels.retain(|k| k.is_copy() || files.iter().any(|file| file.name() == k.model));
    own.kernels.retain(|k| k.scene != RECONSTRUCTION_SCENE);
    let mut programs = vec![own];
    let mut notes = Vec::new();
    let mut using = None;
    if *has_peers {
        let models = files.iter().map(ModelFile::name);
        let models: Vec<&str> = models.filter(|m| peers::PEERS.iter().any(|p| p.model == *m)).collect();
        match peers::generate(repository, chosen.target_cpu(), &models) {
            Ok(made) => {
                programs.push(Program::open(made.program)?);
                notes.extend(made.notes);
                using = Some(made.using);
            }
            Err(note) => notes.push(note),
        }
    }
    let mut rows = measure(&programs, *rounds, &mut notes)?.into_iter();
    let mut own = rows.next().unwrap_or_default();
    for row in own.iter_mut().filter(|row| row.kernel.kind == "hamel") {
        if let Some(file) = files.iter().find(|file| file.name() == row.kernel.model) {
            row.counts = Some(operations(file, &row.kernel.scene)?);
        }
    }
    let peers = using.zip(rows.next()).map(|(using, rows)| peers::Peers { rows, using });
    let words: Vec<String> =
        [format!("--rounds {rounds}")].into_iter().chain(chosen::peers(*has_peers)).collect();
    let report = Report { source: Source::here(chosen.command("rhs", &words)), rows: own, peers, notes };
    chosen.finish(repository, report.text(), |folder| report.write(folder))
}

/// A program that measures, and those of its kernels that are wanted.
pub(super) struct Program {
    path: PathBuf,
    pub(super) kernels: Vec<Kernel>,
}

impl Program {
    /// With all of its kernels.
    ///
    /// # Errors
    /// [`Error::Failed`] when it does not tell them; [`Error::Io`].
    pub(super) fn open(path: PathBuf) -> Result<Program, Error> {
        Ok(Program { kernels: list(&path)?, path })
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

/// How often the programs take turns: each start lays memory out anew, which some kernels feel.
const TURNS: u32 = 4;

/// Times and counts the kernels of all programs, which take turns; a list of rows a program.
///
/// # Errors
/// [`Error::Failed`] when a program does not run.
pub(super) fn measure(
    programs: &[Program],
    rounds: u32,
    notes: &mut Vec<String>,
) -> Result<Vec<Vec<Row>>, Error> {
    let counter = instructions::Counter::find();
    let kernels = programs.iter().map(|p| p.kernels.len() as u64).sum::<u64>();
    let n_rounds = u64::from(rounds) * programs.len() as u64;
    let bar = progress(n_rounds + counter.as_ref().map_or(0, |_| kernels));
    let mut timings: Vec<Vec<Vec<Timing>>> = vec![Vec::new(); programs.len()];
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
            let of = |which: fn(&Timing) -> Option<f64>| {
                timings.iter().filter_map(move |turn| which(&turn[k]).map(|ns| ns / lanes))
            };
            let mut medians: Vec<f64> = of(|t| Some(t.1)).collect();
            medians.sort_by(f64::total_cmp);
            Row {
                kernel: kernel.clone(),
                counts: None,
                instructions: instructions.map(|n| n / lanes),
                min: of(|t| Some(t.0)).fold(f64::INFINITY, f64::min),
                median: medians[medians.len() / 2],
                chain: of(|t| t.2).min_by(f64::total_cmp),
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
fn operations(file: &ModelFile<'_>, scene: &str) -> Result<Counts, Error> {
    interpreted::build(file.model()?, scene).map(|built| built.rhs_counts())
}

fn list(program: &Path) -> Result<Vec<Kernel>, Error> {
    let output = Command::new(program).arg("list").output();
    let output = output.map_err(|e| Error::io(PACKAGE, e))?;
    let text = String::from_utf8_lossy(&output.stdout);
    text.lines()
        .map(|line| Kernel::parse(line).ok_or_else(|| failed(format!("unexpected {line:?}"))))
        .collect()
}

/// Nanoseconds of a call in the fastest and the median round, and where the program tells them those of a call that
/// waits for the one before.
type Timing = (f64, f64, Option<f64>);

fn time(program: &Path, kernels: &[Kernel], rounds: u32, bar: &ProgressBar) -> Result<Vec<Timing>, Error> {
    bar.set_message("timing");
    let mut command = Command::new(program);
    command.arg("time").arg(rounds.to_string()).args(kernels.iter().map(Kernel::name));
    let mut timings = Vec::new();
    converse(command, PACKAGE, bar, |line| {
        let times = line.strip_prefix(&kernels.get(timings.len())?.name())?.split_whitespace();
        let times: Vec<f64> = times.map(|x| x.parse().unwrap_or(f64::NAN)).collect();
        let [min, median, ref chain @ ..] = times[..] else { return None };
        timings.push((min, median, chain.first().copied()));
        Some(())
    })?;
    if timings.len() == kernels.len() { Ok(timings) } else { Err(failed("not every kernel was timed")) }
}
