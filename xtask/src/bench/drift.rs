//! `bench drift`: errors of the energy over many steps, of the methods of the runtime and of other programs.
//!
//! Does not know: how anything is integrated, how a table is drawn ([`super::drift_report`]).

use std::path::Path;
use std::process::Command;

use hamel_run::Error;
use hamel_run::repository::Repository;

use super::chosen::{Chosen, peers};
use super::drift_report::{Report, Row};
use super::peers::{listen, script};
use super::program::{PACKAGE, build, converse, failed, progress};
use super::source::Source;
use super::trajectory::Trajectory;

/// The models that are measured when none is named: five that are Hamiltonian, then five with nonholonomic constraints.
pub(crate) const MODELS: [&str; 10] = [
    "free_rigid_body",
    "heavy_top",
    "kirchhoff_body",
    "two_arm_satellite",
    "zeitlin_euler_3",
    "euler_disk",
    "euler_disk_advected",
    "chaplygin_ball",
    "veselova",
    "snakeboard",
];

/// What to measure, and how.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// [`MODELS`] where none is named.
    pub(crate) chosen: Chosen,
    /// Steps of the longest runs.
    pub(crate) steps: u64,
    /// Whether heyoka is measured, too.
    pub(crate) peers: bool,
}

/// Methods of one model at most.
const METHODS: u64 = 12;
/// Runs of each method of another program, and the part of the longest runs' steps that they make.
const RUNS: u64 = 4;
const OTHERS: u64 = 10;

/// Measures, writes `docs/benchmarks/drift.*` when all models were measured, and returns the table.
///
/// # Errors
/// [`Error::Failed`] when the measuring program does not build, run or know a model, [`Error::Io`].
pub(crate) fn drift(repository: &Repository, options: &Options) -> Result<String, Error> {
    let Options { chosen, steps, peers: with_peers } = options;
    let program = build(repository, chosen.target_cpu(), &["--no-default-features", "--features", "drift"])?;
    let models = chosen.or(&MODELS);
    let bar = progress(METHODS * models.len() as u64);
    let mut rows = Vec::new();
    for model in &models {
        bar.set_message(model.clone());
        let Trajectory { t_final, params, initial, .. } = Trajectory::first(repository, model)?;
        let mut command = Command::new(&program);
        command.args(["drift", &steps.to_string(), model]).args([t_final, params, initial]);
        converse(command, PACKAGE, &bar, |line| {
            rows.push(Row::parse(model, line)?);
            Some(())
        })?;
    }
    bar.finish_and_clear();
    let (mut notes, mut using) = (Vec::new(), Vec::new());
    if *with_peers {
        let mut command = script(repository, "drift.py");
        command.args([(steps / OTHERS).to_string(), RUNS.to_string()]).args(&models);
        let mut states = Vec::new();
        let said = listen(command, "other programs", |line| {
            states.push(State::parse(line)?);
            Some(())
        });
        match said {
            Ok(said) => {
                (notes, using) = (said.notes, said.using);
                for model in &models {
                    rows.extend(of_states(repository, &program, model, &states)?);
                }
            }
            Err(note) => notes.push(note),
        }
    }
    let words = [Some(format!("--steps {steps}")), peers(*with_peers)];
    let source = Source::here(chosen.command("drift", &words.into_iter().flatten().collect::<Vec<_>>()));
    let report = Report { source, rows, using, notes };
    chosen.finish(repository, report.text(), |folder| report.write(folder))
}

/// A state of a run of another program.
struct State {
    model: String,
    steps: f64,
    t: f64,
    ns: f64,
    /// `<name>=<value>` joined by commas.
    values: String,
}

impl State {
    /// The state of a line `<model>;<steps>;<t>;<ns>;<values>`.
    fn parse(line: &str) -> Option<State> {
        let fields: Vec<&str> = line.split(';').collect();
        let [model, steps, t, ns, values] = fields[..] else { return None };
        Some(State {
            model: model.to_owned(),
            steps: steps.parse().ok()?,
            t: t.parse().ok()?,
            ns: ns.parse().ok()?,
            values: values.to_owned(),
        })
    }
}

/// The rows of a model's runs, each of which begins with a state after no steps.
fn of_states(
    repository: &Repository,
    program: &Path,
    model: &str,
    states: &[State],
) -> Result<Vec<Row>, Error> {
    let states: Vec<&State> = states.iter().filter(|state| state.model == model).collect();
    let runs: Vec<&[&State]> = states.chunk_by(|_, next| next.steps > 0.0).collect();
    let params = Trajectory::first(repository, model)?.params;
    // Errors of a run, the zero of its first state included.
    let mut errors: Vec<Vec<f64>> = Vec::new();
    for run in &runs {
        let mut of_run = Vec::new();
        let mut command = Command::new(program);
        command.args(["energies", model, &params]).args(run.iter().map(|state| &state.values));
        converse(command, PACKAGE, &progress(1), |line| {
            of_run.push(line.parse().ok()?);
            Some(())
        })?;
        if of_run.len() != run.len() || run.len() != runs[0].len() {
            return Err(failed(format!("{model}: runs of other programs are not alike")));
        }
        errors.push(of_run);
    }
    let Some((first, last)) = runs.first().and_then(|run| Some((run, run.last()?))) else {
        return Ok(Vec::new());
    };
    let n = runs.len() as f64;
    let ends = || runs.iter().filter_map(|run| run.last());
    let (time, ns): (f64, f64) = (ends().map(|s| s.t).sum(), ends().map(|s| s.ns).sum());
    let row = |k: usize| Row {
        model: model.to_owned(),
        method: "heyoka".to_owned(),
        h: time / (n * last.steps),
        us: 1e-3 * ns / time,
        steps: first[k].steps,
        rms: (errors.iter().map(|of_run| of_run[k] * of_run[k]).sum::<f64>() / n).sqrt(),
        mean: errors.iter().map(|of_run| of_run[k]).sum::<f64>() / n,
        invariants: None,
    };
    Ok((1..first.len()).map(row).collect())
}
