//! `list`: all models by topic, or some by kind with their scenes, state variables, parameters and sources.
//!
//! Does not know: how a scene is evaluated.

pub mod by_heart;
mod scene;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use clap::Args;
use hamel_codegen::spec::Kind;
use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};
use serde_json::{Map, Value};

use crate::output::terminal::{bold, width};
use hamel_run::dynamics::Factory as _;
use hamel_run::error::Error;
use hamel_run::interpreted;
use hamel_run::model;
use hamel_run::session::{ModelFile, Session};

use scene::{Scene, Values};

/// Show all models by topic, or some with their scenes, state variables, parameters and sources
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Examples:
  hamel list
  hamel list heavy_top rattleback
  hamel list --json")]
pub struct Arguments {
    /// Print JSON: an array with one object per model
    #[arg(long)]
    pub json: bool,
    /// Names of models, or paths that end in .hamel; all models when none is given
    pub models: Vec<String>,
}

/// What models without a topic are shown under.
const NO_TOPIC: &str = "Others";

struct Listed {
    name: String,
    kind: Kind,
    title: String,
    topic: Option<String>,
    sources: Vec<String>,
    scenes: Vec<Scene>,
}

/// All models, or those named, for people or as JSON.
///
/// # Errors
/// Unknown names; the problems of all models together.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    if arguments.models.is_empty() && !arguments.json {
        return by_topic(&session.all()?);
    }
    let files = session.find_all(&arguments.models)?;
    let mut listed = Vec::new();
    let mut errors = Vec::new();
    // Scenes that are not known by heart are derived and lowered.
    let described: Vec<_> = files.par_iter().map(|file| describe(session, file)).collect();
    for outcome in described {
        match outcome {
            Ok(entry) => listed.push(entry),
            Err(error) => errors.push(error),
        }
    }
    if !errors.is_empty() {
        return Err(Error::Several { errors });
    }
    if arguments.json {
        return Ok(Value::from_iter(listed.iter().map(Listed::to_json)).to_string());
    }
    let width = width();
    listed.sort_by_key(|entry| entry.kind);
    let mut text = String::new();
    for group in listed.chunk_by(|a, b| a.kind == b.kind) {
        let _ = writeln!(text, "{}\n", bold(&format!("[{}]", group[0].kind)));
        for entry in group {
            let _ = writeln!(text, "{}", entry.to_text(width));
        }
    }
    Ok(text.trim_end().to_owned())
}

/// Names and titles under their topics. Nothing is derived.
fn by_topic(files: &[ModelFile<'_>]) -> Result<String, Error> {
    let mut listed: BTreeMap<&str, Vec<(&str, String)>> = BTreeMap::new();
    let mut errors = Vec::new();
    for (file, model) in files.iter().map(|file| (file, file.model())) {
        match model {
            Ok(model) => {
                let topic = model.topic.as_deref().unwrap_or(NO_TOPIC);
                listed.entry(topic).or_default().push((file.name(), model::title(model)));
            }
            Err(error) => errors.push(error),
        }
    }
    Error::all_of(errors)?;
    let longest = files.iter().map(|file| file.name().len()).max().unwrap_or(0);
    let mut text = String::new();
    for (topic, models) in listed {
        let _ = writeln!(text, "{}\n", bold(&format!("[{topic}]")));
        for (name, title) in models {
            let _ = writeln!(text, "{}{}  {title}", bold(name), " ".repeat(longest - name.len()));
        }
        text.push('\n');
    }
    text.push_str("`list NAME ..` shows scenes, state, parameters and sources.");
    Ok(text)
}

fn describe(session: &Session, file: &ModelFile<'_>) -> Result<Listed, Error> {
    let model = file.model()?;
    let known = if session.may_know_by_heart() { by_heart::scenes(file.name(), &file.text()?) } else { None };
    let derived = || {
        let scenes = model.scene_names().into_iter().map(|name| {
            let built = interpreted::build(model, &name)?;
            Ok(Scene::of(&name, built.info()))
        });
        scenes.collect::<Result<Vec<Scene>, Error>>()
    };
    Ok(Listed {
        name: model.name.clone(),
        kind: model.kind(),
        title: model::title(model),
        topic: model.topic.clone(),
        sources: model.sources.clone(),
        scenes: known.map_or_else(derived, Ok)?,
    })
}

impl Listed {
    fn to_json(&self) -> Value {
        let mut entry = Map::new();
        entry.insert("model".into(), self.name.clone().into());
        entry.insert("title".into(), self.title.clone().into());
        entry.insert("topic".into(), self.topic.clone().into());
        entry.insert("sources".into(), self.sources.clone().into());
        entry.insert("scenes".into(), self.scenes.iter().map(|scene| serde_json::json!(scene)).collect());
        entry.into()
    }

    fn to_text(&self, width: usize) -> String {
        let mut text = format!("{}  {}\n", bold(&self.name), self.title);
        let mut row = |label: &str, items: Vec<String>, separator: &str| {
            if items.is_empty() {
                return;
            }
            let lines = wrap(&items, separator, width.saturating_sub(12).max(30));
            for (k, line) in lines.iter().enumerate() {
                let _ = writeln!(text, "  {:8}  {line}", if k == 0 { label } else { "" });
            }
        };
        let values = |entries: &Values| {
            let value = |v: &Value| v.as_f64().map_or_else(|| v.to_string(), |x| x.to_string());
            entries.iter().map(|(name, v)| format!("{name} = {}", value(v))).collect::<Vec<String>>()
        };
        for (k, info) in self.scenes.iter().enumerate() {
            let name = &info.scene;
            if k == 0 {
                row("state", info.state.clone(), " ");
                row("params", values(&info.params), ", ");
                row("inputs", values(&info.inputs), ", ");
                continue;
            }
            let default = &self.scenes[0];
            let fixed = default.params.keys().filter(|name| !info.params.contains_key(*name));
            let fixed: Vec<String> = fixed.cloned().collect();
            let mut parts = Vec::new();
            if !fixed.is_empty() {
                parts.push(format!("fixes {}", fixed.join(", ")));
            }
            if info.state != default.state {
                parts.push(format!("state {}", info.state.join(" ")));
            }
            if !info.inputs.is_empty() {
                let names: Vec<&str> = info.inputs.keys().map(String::as_str).collect();
                parts.push(format!("inputs {}", names.join(" ")));
            }
            let colon = if parts.is_empty() { "" } else { ": " };
            let line = format!("{name}{colon}{}", parts.join("; "));
            row("scene", line.split_whitespace().map(str::to_owned).collect(), " ");
        }
        for source in &self.sources {
            let words = source.split_whitespace().map(str::to_owned).collect();
            row("source", words, " ");
        }
        text
    }
}

fn wrap(items: &[String], separator: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    let mut length = 0;
    for (k, item) in items.iter().enumerate() {
        let piece = if k + 1 < items.len() { format!("{item}{separator}") } else { item.clone() };
        let size = piece.chars().count();
        if length > 0 && length + piece.trim_end().chars().count() > width {
            lines.push(String::new());
            length = 0;
        }
        length += size;
        // There is always a last line.
        if let Some(line) = lines.last_mut() {
            line.push_str(&piece);
        }
    }
    lines.into_iter().map(|line| line.trim_end().to_owned()).collect()
}
