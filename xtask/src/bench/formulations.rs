//! `bench formulations`: what the best formulation of every model costs beside the one that it is written in.
//!
//! No clock is read: the table is the same on every machine.
//!
//! Does not know: how formulations are found and proved.

use std::sync::Arc;

use hamel_codegen::scene::{self, Candidate};
use hamel_codegen::spec::Scene;
use hamel_run::Error;
use hamel_run::interpreted;
use hamel_run::model::Checked;
use hamel_run::repository::Repository;
use hamel_run::session::Session;

use super::program::progress;
use super::table::{Table, cells, write_files};

/// What the page says before its table.
const HEAD: &str = "\
# Formulations of the shipped models

Of each default scene, by `hamel explain MODEL --formulations`: the right-hand side as it is written, the cheapest whose
state is the same, and the cheapest of all. `cost` counts an addition, a multiplication, a fused pair or a sign as 1, a
division as 5, a root as 6, an elementary function as 20; `chain` is the longest chain of operations in cycles; `error`
bounds the rounding error of a rate, in units of the roundoff times what rounding the inputs does to it. All are proved
to be one motion. `formulation auto;` takes the cheapest of the same state that is no less accurate, `formulation
auto(state);` that of any state with conversions. `shipped` is the least cost of a scene of the model that has all of
its variables and parameters. [Which formulation](../book/formulations.md) says more.
";

/// Searches the formulations of models and returns the table; all models write `docs/benchmarks/formulations.md`.
///
/// # Errors
/// Models that are not there or wrong, [`Error::Io`].
pub(crate) fn formulations(
    repository: &Repository,
    session: &Session,
    models: &[String],
) -> Result<String, Error> {
    let files = if models.is_empty() { session.compiled()? } else { session.find_all(models)? };
    let bar = progress(files.len() as u64);
    let head = [
        "model",
        "same state",
        "any state",
        "cost",
        "same state",
        "any state",
        "shipped",
        "chain",
        "same state",
        "any state",
        "error",
        "same state",
        "any state",
        "tried in vain",
    ];
    let mut lines = vec![cells(head)];
    for file in files {
        let model = file.model()?;
        bar.set_message(model.name.clone());
        let found = scene::formulations(model, scene::DEFAULT, &|_, _| {})?;
        bar.inc(1);
        let own = found.own();
        let cheapest = |fits: &dyn Fn(&Candidate) -> bool| {
            let fitting = found.candidates.iter().filter(|c| fits(c));
            fitting
                .min_by_key(|c| c.counts.cost())
                .filter(|c| c.counts.cost() < own.counts.cost())
                .unwrap_or(own)
        };
        let three = [own, cheapest(&Candidate::keeps_state), cheapest(&|_| true)];
        let mut line = vec![model.name.clone()];
        line.extend(three[1..].iter().map(|c| c.title()));
        line.extend(three.iter().map(|c| c.counts.cost().to_string()));
        line.push(least_shipped(model)?.to_string());
        line.extend(three.iter().map(|c| c.latency.to_string()));
        line.extend(three.iter().map(|c| format!("{:.1}", c.rounding)));
        line.push(found.left_out.len().to_string());
        lines.push(line);
    }
    bar.finish_and_clear();
    let table = Table { lines, n_words: 3 };
    let mut text = table.text();
    if models.is_empty() {
        let page = format!("{HEAD}\nWritten by `cargo xtask bench formulations`.\n\n{}", table.markdown());
        let folder = repository.root().join("docs/benchmarks");
        for path in write_files(&folder, [("formulations.md".to_owned(), page)])? {
            text.push_str(&format!("wrote {}\n", repository.shown(&path)));
        }
    }
    Ok(text)
}

/// The least cost of a right-hand side among the scenes of a model that fix, leave out and let vary nothing.
fn least_shipped(model: &Arc<Checked>) -> Result<u64, Error> {
    let is_whole = |s: &&Scene| s.fixed.is_empty() && s.drops.is_empty() && s.inputs.is_empty();
    let named = model.scenes.iter().filter(is_whole).map(|s| s.name.as_str());
    let mut least = u64::MAX;
    for scene in std::iter::once(scene::DEFAULT).chain(named) {
        let built = interpreted::build(model, scene)?;
        least = least.min(built.rhs_counts().cost());
    }
    Ok(least)
}
