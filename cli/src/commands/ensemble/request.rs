//! What the results of an ensemble depend on, as a document.
//!
//! Does not know: where the document is kept.

use std::collections::BTreeMap;
use std::sync::Arc;

use clap::ValueEnum;
use serde_json::{Map, Value, json};

use super::arguments::Arguments;
use super::plan::Plan;
use crate::commands::options::{InputOptions, is_table};
use hamel_run::ensemble::{Cancel, EnsembleRequest};
use hamel_run::error::Error;
use hamel_run::hash::fnv1a;
use hamel_run::info::{Info, ParamEntry};
use hamel_run::interpreted::Built;
use hamel_run::method::Steps;
use hamel_run::model::blocks::blocks;
use hamel_run::model::{Checked, Model, title};

/// The scene of an ensemble.
#[derive(Debug)]
pub struct Subject<'a> {
    /// Its model.
    pub model: &'a Arc<Checked>,
    /// The text of the model.
    pub text: &'a str,
    /// The scene, to choose initial states.
    pub built: &'a Built,
    /// What drives its inputs, for the document of a store; nothing where they are the model's own.
    pub inputs: Value,
    /// Whether it is called off.
    pub cancel: Cancel,
}

/// Everything that decides about a bit of a result, and what people want to know of it; neither threads nor who
/// evaluates.
pub(super) fn document(
    subject: &Subject<'_>,
    info: &Info,
    asked: &EnsembleRequest,
    plan: &Plan<'_>,
    arguments: &Arguments,
    n_chunk: usize,
) -> Value {
    let steps = match asked.steps {
        Steps::Adaptive { rtol, atol, max: None } => json!({"rtol": rtol, "atol": atol}),
        Steps::Adaptive { rtol, atol, max } => json!({"rtol": rtol, "atol": atol, "max_step": max}),
        Steps::Fixed { step } => json!({"step": step}),
    };
    let named = |values: &[(String, f64)]| {
        values.iter().map(|(name, x)| (name.clone(), *x)).collect::<BTreeMap<String, f64>>()
    };
    let set = named(&arguments.motion.set);
    let param = |p: &ParamEntry| {
        let value = set.get(&p.name).copied().unwrap_or(p.default);
        json!({"name": p.name, "value": value, "doc": p.doc})
    };
    let mut document = json!({
        "version": env!("CARGO_PKG_VERSION"),
        "model": info.model,
        "model_hash": fnv1a(subject.text.bytes()),
        "model_text": subject.text,
        "scene": info.scene,
        "params": info.params.iter().map(param).collect::<Vec<Value>>(),
        "set": set,
        "initial": named(&arguments.motion.initial),
        "table_hash": plan.table_hash(),
        "sweep": arguments.sweep.iter().map(ToString::to_string).collect::<Vec<String>>(),
        "spread": arguments.spread.iter().map(ToString::to_string).collect::<Vec<String>>(),
        "count": arguments.count,
        "seed": arguments.seed,
        "trajectories": plan.len(),
        "t_final": asked.t_final,
        "samples": asked.samples,
        "method": asked.method.name(),
        "steps": steps,
        "max_steps": asked.max_steps,
        "lanes": asked.width.lanes(),
        "chunk": n_chunk,
    });
    if !info.noises.is_empty() {
        document["noise"] = json!(asked.noise);
    }
    if !subject.inputs.is_null() {
        document["inputs"] = subject.inputs.clone();
    }
    // A store of trajectories says nothing of them, as those that are there do not.
    if !arguments.statistics.is_empty() {
        let names = arguments.statistics.iter().filter_map(ValueEnum::to_possible_value);
        document["statistics"] = names.map(|name| name.get_name().to_owned()).collect::<Vec<String>>().into();
        document["quantiles"] = arguments.quantiles.clone().into();
        document["bins"] = arguments.bins.into();
    }
    document
}

/// What drives the inputs: expressions, and a hash of a table; nothing where nothing does.
///
/// # Errors
/// [`Error::Io`].
pub(super) fn inputs(options: &InputOptions) -> Result<Value, Error> {
    if options.input.is_empty() {
        return Ok(Value::Null);
    }
    let one = |input: &String| {
        if !is_table(input) {
            return Ok(json!(input));
        }
        let bytes = std::fs::read(input).map_err(|e| Error::io(input.clone(), e))?;
        Ok(
            json!({"table_hash": fnv1a(bytes.into_iter()), "interpolation": format!("{:?}", options.interpolation)}),
        )
    };
    options.input.iter().map(one).collect::<Result<Vec<Value>, Error>>().map(Value::Array)
}

/// What is said about the components of a state: units, meanings and the title of the model, as far as it says them.
pub(super) fn of_state(model: &Model, info: &Info) -> Map<String, Value> {
    let blocks = blocks(model);
    let of =
        |name: &String| blocks.iter().find(|block| block.members.iter().any(|(member, _)| member == name));
    let each = |what: fn(&hamel_run::model::blocks::Block) -> &str| -> Value {
        info.state.iter().map(|name| of(name).map_or("", what)).collect::<Vec<&str>>().into()
    };
    let mut attributes = Map::new();
    attributes.insert("model".into(), title(model).into());
    attributes.insert("units".into(), each(|block| &block.unit));
    attributes.insert("descriptions".into(), each(|block| &block.doc));
    attributes
}
