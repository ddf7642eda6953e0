//! `bench wp`: time of whole integrations against the error at their end, for the methods of the runtime and
//! integrators of other crates, on the first trajectory of the reference files.
//!
//! Does not know: how anything is integrated, how a table is drawn ([`super::wp_report`]).

use std::collections::BTreeMap;
use std::process::Command;

use hamel::Error;
use hamel::repository::Repository;

use super::peers::{listen, script};
use super::point::Point;
use super::program::{PACKAGE, TargetCpu, build, converse, progress};
use super::source::Source;
use super::trajectory::Trajectory;
use super::wp_report::Report;

/// The models that are measured when none is named.
pub(crate) const MODELS: [&str; 5] =
    ["heavy_top", "euler_disk", "chaplygin_ball", "two_arm_satellite", "snakeboard"];

/// What to measure, and how.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// Names of models; [`MODELS`] when empty.
    pub(crate) models: Vec<String>,
    /// Rounds; the fastest solution counts.
    pub(crate) rounds: u32,
    /// The instruction set.
    pub(crate) target_cpu: TargetCpu,
    /// Whether integrators in Python are measured, too.
    pub(crate) peers: bool,
}

impl Options {
    /// The command that repeats the measurement.
    fn command(&self) -> String {
        let mut words = vec!["cargo xtask bench wp".to_owned()];
        words.extend(self.models.iter().cloned());
        words.push(format!("--rounds {} --target-cpu {}", self.rounds, self.target_cpu.name()));
        words.extend(self.peers.then(|| "--peers".to_owned()));
        words.join(" ")
    }
}

/// Measures, writes `docs/benchmarks/wp*` when all models were measured, and returns the tables.
///
/// # Errors
/// [`Error::Failed`] when the measuring program does not build, run or know a model, [`Error::Io`].
pub(crate) fn wp(repository: &Repository, options: &Options) -> Result<String, Error> {
    let models: Vec<String> =
        if options.models.is_empty() { MODELS.map(str::to_owned).to_vec() } else { options.models.clone() };
    let program =
        build(repository, options.target_cpu, &["--no-default-features", "--features", "integrators"])?;
    let bar = progress(u64::from(options.rounds) * models.len() as u64);
    let mut points = BTreeMap::new();
    let mut notes = Vec::new();
    for model in &models {
        bar.set_message(model.clone());
        let mut command = Command::new(&program);
        let Trajectory { t_final, params, initial, last } = Trajectory::first(repository, model)?;
        command.args(["solve", &options.rounds.to_string(), model]).args([t_final, params, initial, last]);
        let mut found = Vec::new();
        converse(command, PACKAGE, &bar, |line| {
            found.push(Point::parse(line)?);
            Some(())
        })?;
        points.insert(model.clone(), found);
    }
    bar.finish_and_clear();
    if options.peers {
        match peers(repository, &models, &mut points) {
            Ok(said) => notes.extend(said),
            Err(note) => notes.push(note),
        }
    }
    let points = models.iter().map(|m| (m.clone(), points.remove(m).unwrap_or_default())).collect();
    let report = Report { source: Source::here(options.command()), models: points, notes };
    let mut text = report.text();
    if options.models.is_empty() {
        for path in report.write(&repository.root().join("docs/benchmarks"))? {
            text.push_str(&format!("wrote {}\n", repository.shown(&path)));
        }
    } else {
        text.push_str("docs/benchmarks is written when no models are named\n");
    }
    Ok(text)
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
