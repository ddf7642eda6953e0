//! `bench wp`: time of whole integrations against the error at their end, for the methods of the runtime and
//! integrators of other crates, on the trajectories of the reference files.
//!
//! Does not know: how anything is integrated, how a table is drawn ([`super::wp_report`]).

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use hamel_run::Error;
use hamel_run::repository::Repository;

use super::chosen::{self, Chosen};
use super::peers::{listen, script};
use super::point::{OWN, Point};
use super::program::{PACKAGE, TargetCpu, build, build_in, converse, progress, second_target_dir};
use super::source::Source;
use super::trajectory::Trajectory;
use super::wp_report::{Report, Run};

/// The models that are measured when none is named.
pub(crate) const MODELS: [&str; 5] =
    ["heavy_top", "euler_disk", "chaplygin_ball", "two_arm_satellite", "snakeboard"];

/// What to measure, and how.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// [`MODELS`] where none is named.
    pub(crate) chosen: Chosen,
    /// Rounds; the fastest solution counts.
    pub(crate) rounds: u32,
    /// Whether integrators in Python are measured, too.
    pub(crate) peers: bool,
}

/// Measures, writes `docs/benchmarks/wp*` when all models were measured, and returns the tables.
///
/// # Errors
/// [`Error::Failed`] when the measuring program does not build, run or know a model, [`Error::Io`].
pub(crate) fn wp(repository: &Repository, options: &Options) -> Result<String, Error> {
    let Options { chosen, rounds, peers: has_peers } = options;
    let models = chosen.or(&MODELS);
    let features = ["--no-default-features", "--features", "integrators"];
    let program = build(repository, chosen.target_cpu(), &features)?;
    // Several trajectories side by side, by the widest registers of the machine as well.
    let wide = TargetCpu::wide().filter(|wide| *wide != chosen.target_cpu());
    let wide = wide.map(|cpu| {
        build_in(&second_target_dir(repository), repository, cpu, &features).map(|program| (cpu, program))
    });
    let wide = wide.transpose()?;
    let mut runs = Vec::new();
    for model in &models {
        let trajectories = Trajectory::of(repository, model)?;
        runs.extend(
            (1..).zip(trajectories).map(|(k, trajectory)| (Run { model: model.clone(), k }, trajectory)),
        );
    }
    let per_run = u64::from(*rounds) * (1 + u64::from(wide.is_some()));
    let bar = progress(per_run * runs.len() as u64);
    let mut points = BTreeMap::new();
    let mut notes = Vec::new();
    for (run, Trajectory { t_final, params, initial, last }) in &runs {
        bar.set_message(run.to_string());
        let mut found = Vec::new();
        let mut ask = |program: &Path, what: &str, cpu: Option<TargetCpu>| {
            let mut command = Command::new(program);
            command.args([what, &rounds.to_string(), &run.model]).args([t_final, params, initial, last]);
            converse(command, PACKAGE, &bar, |line| {
                let mut point = Point::parse(line)?;
                if let Some(cpu) = cpu {
                    point.by = format!("{OWN}, {}", cpu.name());
                }
                found.push(point);
                Some(())
            })
        };
        ask(&program, "solve", None)?;
        if let Some((cpu, program)) = &wide {
            ask(program, "lanes", Some(*cpu))?;
        }
        points.insert(run.clone(), found);
    }
    bar.finish_and_clear();
    if *has_peers {
        match peers(repository, &models, &mut points) {
            Ok(said) => notes.extend(said),
            Err(note) => notes.push(note),
        }
    }
    let points = runs.into_iter().map(|(run, _)| {
        let found = points.remove(&run).unwrap_or_default();
        (run, found)
    });
    let points = points.collect();
    let own: Vec<String> =
        [format!("--rounds {rounds}")].into_iter().chain(chosen::peers(*has_peers)).collect();
    let report = Report { source: Source::here(chosen.command("wp", &own)), runs: points, notes };
    chosen.finish(repository, report.text(), |folder| report.write(folder))
}

/// Runs the script of the integrators in Python, whose lines are those of the measuring program after the name of the
/// model and the number of the trajectory, and adds their solutions; the notes.
fn peers(
    repository: &Repository,
    models: &[String],
    points: &mut BTreeMap<Run, Vec<Point>>,
) -> Result<Vec<String>, String> {
    let mut command = script(repository, "wp.py");
    command.args(models);
    let said = listen(command, "integrators in Python", |line| {
        let (model, rest) = line.split_once(';')?;
        let (k, point) = rest.split_once(';')?;
        let run = Run { model: model.to_owned(), k: k.parse().ok()? };
        points.entry(run).or_default().push(Point::parse(point)?);
        Some(())
    })?;
    Ok(said.notes)
}
