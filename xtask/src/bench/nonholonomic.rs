//! `bench nonholonomic`: errors of energy and constraint over many steps against the cost.
//!
//! A case is a model with its parameters, and with those that a scene of its file fixes.
//!
//! Does not know: how anything is integrated, how a table is drawn ([`super::nonholonomic_report`]).

use std::collections::BTreeMap;
use std::process::Command;

use hamel_run::Error;
use hamel_run::model::{DEFAULT_SCENE, Model, roles};
use hamel_run::repository::Repository;
use hamel_run::session::Session;

use super::chosen::Chosen;
use super::nonholonomic_report::{Case, Report, Row};
use super::program::{PACKAGE, build, converse, progress};
use super::source::Source;
use crate::generate::systems::systems;

/// The bodies of the repository that are measured beside the systems of the benchmark.
const BODIES: [&str; 2] = ["chaplygin_ball", "snakeboard"];

/// What to measure, and how.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// All systems and [`BODIES`] where none is named.
    pub(crate) chosen: Chosen,
    /// Steps of each run.
    pub(crate) steps: u64,
    /// Names of methods; all when empty.
    pub(crate) methods: Vec<String>,
}

/// Measures, writes `docs/benchmarks/nonholonomic*` when everything was measured, and returns the tables.
///
/// # Errors
/// [`Error::UnknownModel`], problems of models, [`Error::Failed`] when the measuring program does not build, run or
/// know a model or method, [`Error::Io`].
pub(crate) fn nonholonomic(
    repository: &Repository,
    session: &Session,
    options: &Options,
) -> Result<String, Error> {
    let Options { chosen, steps, methods } = options;
    let mut models = systems(repository, session)?;
    let n_systems = models.len();
    for name in BODIES {
        models.push(session.find(name)?.into_model()?);
    }
    let known: Vec<String> = models.iter().map(|model| model.name.clone()).collect();
    let names = chosen.or(&known.iter().map(String::as_str).collect::<Vec<_>>());
    let unknown = names.iter().filter(|name| !known.contains(name));
    let unknown = unknown.map(|name| Error::UnknownModel { name: name.clone(), known: known.clone() });
    Error::all_of(unknown.collect())?;
    let mut todo: Vec<(&Model, &str)> = Vec::new();
    for (k, model) in models.iter().enumerate().filter(|(_, model)| names.contains(&model.name)) {
        todo.push((model, DEFAULT_SCENE));
        // The scenes of other models are no cases.
        let own = model.scenes.iter().filter(|_| k < n_systems);
        todo.extend(own.map(|scene| (model, scene.name.as_str())));
    }
    let features = ["--no-default-features", "--features", "nonholonomic"];
    let program = build(repository, chosen.target_cpu(), &features)?;
    let bar = progress(todo.len() as u64);
    let mut cases = Vec::new();
    for (model, scene) in todo {
        let name =
            if scene == DEFAULT_SCENE { model.name.clone() } else { format!("{}_{scene}", model.name) };
        bar.set_message(name.clone());
        let params = roles::all_params(model, scene, &BTreeMap::new());
        let initial = roles::initial_values(model, &params);
        let mut command = Command::new(&program);
        command.args(["nonholonomic", &steps.to_string(), &methods.join(";"), &model.name]);
        command.args([joined(&params), joined(&initial)]);
        let mut rows = Vec::new();
        converse(command, PACKAGE, &bar, |line| {
            rows.push(Row::parse(line)?);
            Some(())
        })?;
        let doc = hamel_run::model::title(model);
        cases.push(Case { name, doc, rows });
    }
    bar.finish_and_clear();
    let own = [format!("--steps {steps}")];
    let own: Vec<String> =
        own.into_iter().chain(methods.iter().map(|name| format!("--methods {name:?}"))).collect();
    let report = Report { source: Source::here(chosen.command("nonholonomic", &own)), steps: *steps, cases };
    if methods.is_empty() {
        chosen.finish(repository, report.text(), |folder| report.write(folder))
    } else {
        Ok(report.text() + "docs/benchmarks is written when no methods are named\n")
    }
}

/// `<name>=<value>` joined by commas.
fn joined(numbers: &BTreeMap<String, f64>) -> String {
    numbers.iter().map(|(name, value)| format!("{name}={value:?}")).collect::<Vec<_>>().join(",")
}
