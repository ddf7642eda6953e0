//! `bench drift`: errors of the energy over many steps, of the methods of the runtime and of other programs.
//!
//! Does not know: how anything is integrated, how a table is drawn ([`super::drift_report`]).

use std::process::Command;

use hamel::Error;
use hamel::repository::Repository;

use super::drift_report::{Report, Row};
use super::program::{PACKAGE, TargetCpu, build, converse, progress};
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
    /// Names of models; [`MODELS`] when empty.
    pub(crate) models: Vec<String>,
    /// Steps of the longest runs.
    pub(crate) steps: u64,
    /// The instruction set.
    pub(crate) target_cpu: TargetCpu,
}

impl Options {
    /// The command that repeats the measurement.
    fn command(&self) -> String {
        let mut words = vec!["cargo xtask bench drift".to_owned()];
        words.extend(self.models.iter().cloned());
        words.push(format!("--steps {} --target-cpu {}", self.steps, self.target_cpu.name()));
        words.join(" ")
    }
}

/// Methods of one model at most.
const METHODS: u64 = 8;

/// Measures, writes `docs/benchmarks/drift.*` when all models were measured, and returns the table.
///
/// # Errors
/// [`Error::Failed`] when the measuring program does not build, run or know a model, [`Error::Io`].
pub(crate) fn drift(repository: &Repository, options: &Options) -> Result<String, Error> {
    let program = build(repository, options.target_cpu, &["--no-default-features", "--features", "drift"])?;
    let models: Vec<String> =
        if options.models.is_empty() { MODELS.map(str::to_owned).to_vec() } else { options.models.clone() };
    let bar = progress(METHODS * models.len() as u64);
    let mut rows = Vec::new();
    for model in &models {
        bar.set_message(model.clone());
        let Trajectory { t_final, params, initial, .. } = Trajectory::first(repository, model)?;
        let mut command = Command::new(&program);
        command.args(["drift", &options.steps.to_string(), model]).args([t_final, params, initial]);
        converse(command, PACKAGE, &bar, |line| {
            rows.push(Row::parse(model, line)?);
            Some(())
        })?;
    }
    bar.finish_and_clear();
    let report = Report { source: Source::here(options.command()), rows };
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
