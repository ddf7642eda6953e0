//! `bench wp`: time of whole integrations against the error at their end, for the methods of the runtime and
//! integrators of other crates, on the first trajectory of the reference files.
//!
//! Does not know: how anything is integrated, how a table is drawn ([`super::wp_report`]).

use std::collections::BTreeMap;
use std::process::Command;

use hamel::Error;
use hamel::repository::Repository;

use super::chosen::{self, Chosen};
use super::peers::{listen, script};
use super::point::Point;
use super::program::{PACKAGE, build, converse, progress};
use super::source::Source;
use super::trajectory::Trajectory;
use super::wp_report::Report;

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
    let bar = progress(u64::from(*rounds) * models.len() as u64);
    let mut points = BTreeMap::new();
    let mut notes = Vec::new();
    for model in &models {
        bar.set_message(model.clone());
        let mut command = Command::new(&program);
        let Trajectory { t_final, params, initial, last } = Trajectory::first(repository, model)?;
        command.args(["solve", &rounds.to_string(), model]).args([t_final, params, initial, last]);
        let mut found = Vec::new();
        converse(command, PACKAGE, &bar, |line| {
            found.push(Point::parse(line)?);
            Some(())
        })?;
        points.insert(model.clone(), found);
    }
    bar.finish_and_clear();
    if *has_peers {
        match peers(repository, &models, &mut points) {
            Ok(said) => notes.extend(said),
            Err(note) => notes.push(note),
        }
    }
    let points = models.iter().map(|m| (m.clone(), points.remove(m).unwrap_or_default())).collect();
    let own: Vec<String> =
        [format!("--rounds {rounds}")].into_iter().chain(chosen::peers(*has_peers)).collect();
    let report = Report { source: Source::here(chosen.command("wp", &own)), models: points, notes };
    chosen.finish(repository, report.text(), |folder| report.write(folder))
}

/// Runs the script of the integrators in Python, whose lines are those of the measuring program after the model's name,
/// and adds their solutions; the notes.
fn peers(
    repository: &Repository,
    models: &[String],
    points: &mut BTreeMap<String, Vec<Point>>,
) -> Result<Vec<String>, String> {
    let mut command = script(repository, "wp.py");
    command.args(models);
    let said = listen(command, "integrators in Python", |line| {
        let (model, point) = line.split_once(';')?;
        points.entry(model.to_owned()).or_default().push(Point::parse(point)?);
        Some(())
    })?;
    Ok(said.notes)
}
