//! `stress`: starts the program that measures rounding errors and drifts of the models.
//!
//! Does not know: generated code, and what is measured.

use std::process::Command;

use crate::cargo;
use clap::Args;
use hamel::Error;
use hamel::repository::Repository;
use hamel::session::Session;

/// Name of the package and program.
const PACKAGE: &str = "hamel-stress";

/// Measure rounding errors of all right-hand sides and drifts of long runs
///
/// Every scene is evaluated in f64 and in double-double numbers at random states, at extreme parameters and next to
/// singularities, those of models without generated code operation by operation; selected models are integrated for
/// long. A run of all models that is not short writes
/// docs/stress.md, docs/stress.csv and docs/stress_runs.csv. A short run compares the errors with pinned bounds and
/// fails above them.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  cargo xtask stress --short            what continuous integration runs
  cargo xtask stress euler_disk         one model; writes nothing
  cargo xtask stress                    all models; takes half an hour")]
pub(crate) struct Arguments {
    /// Few states and short runs, against pinned bounds; default scenes alone of models without generated code
    #[arg(long)]
    short: bool,
    /// Number of random states per scene [default: 20000, short: 2000]
    #[arg(long, value_name = "N")]
    samples: Option<u64>,
    /// Number of steps per run [default: 10000000, short: 100000]
    #[arg(long, value_name = "N")]
    steps: Option<u64>,
    /// Names of models; all when none is given
    models: Vec<String>,
}

/// Measures all models, or the given ones. The program prints its summary itself.
///
/// # Errors
/// Unknown names, problems of a model, [`Error::NotCompiled`], and [`Error::Failed`] when a bound is exceeded.
pub(crate) fn stress(
    repository: &Repository,
    session: &Session,
    arguments: &Arguments,
) -> Result<String, Error> {
    // Before minutes of compilation.
    for file in session.find_all(&arguments.models)? {
        file.model()?;
    }
    // Millions of steps are worth minutes of compilation, a few are not.
    let profile = if arguments.short { cargo::Profile::OfThisProgram } else { cargo::Profile::Release };
    let build = cargo::cargo_build(repository, PACKAGE, profile);
    let program = cargo::run_build(build, PACKAGE, "building the stress tests")?.ok_or_else(|| {
        Error::NotCompiled { what: "stress".into(), reason: "the compiled models do not build".into() }
    })?;
    let mut command = Command::new(&program);
    command.arg("--root").arg(repository.root());
    if arguments.short {
        command.arg("--short");
    }
    for (option, value) in [("--samples", arguments.samples), ("--steps", arguments.steps)] {
        if let Some(value) = value {
            command.arg(option).arg(value.to_string());
        }
    }
    let status = command.args(&arguments.models).status();
    let status = status.map_err(|e| Error::io(program.display().to_string(), e))?;
    if status.success() {
        Ok(String::new())
    } else {
        Err(Error::Failed { step: "stress".into(), status: status.to_string() })
    }
}
