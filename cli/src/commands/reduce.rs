//! `reduce`: an unreduced model to the model reduced by its symmetries.
//!
//! Does not know: how symmetries are found ([`symmetry`]).

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use hamel_codegen::symmetry;
use serde_json::json;

use crate::output::opened::Opened;
use hamel_run::error::Error;
use hamel_run::session::Session;

/// Find the symmetries of an unreduced model, and write the model reduced by them
///
/// The model is a Lagrangian in coordinates and configurations (`configuration R in SO(3) velocity Omega;`), with
/// forces and linear constraints. Symmetries are looked for among translations, linear fields and translations of
/// groups, and proved. The reduced model has the algebra, the reduced Lagrangian, advected parameters for what forces
/// and constraints break, and the reconstruction of coordinates that leave. For the model of a file it says by
/// `reduces` of what it is the quotient, and by which map, which `hamel check` proves. Without a file it is printed.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel reduce top.hamel                        the reduced model
  hamel reduce top.hamel -o top_reduced.hamel   into a file, with a report
  hamel reduce top.hamel --json                 text, report and dimension of the group as JSON"
)]
pub struct Arguments {
    /// Path to a .hamel file, or name of a shipped model
    pub model: String,
    /// File of the reduced model
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Replace a file that is there
    #[arg(long, requires = "output")]
    pub force: bool,
    /// Print text, report and dimension of the group as JSON
    #[arg(long)]
    pub json: bool,
}

/// The reduced model, or the report where the model goes to a file.
///
/// # Errors
/// Problems of the model, what cannot be looked into, and files that cannot be written.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let file = session.find(&arguments.model)?;
    let opened =
        arguments.output.as_deref().map(|path| Opened::new_text(path, arguments.force)).transpose()?;
    let model = file.model()?;
    let reduced = symmetry::reduce(model)?;
    let text = match file.path() {
        Some(path) => reduced.text_of(&seen_from(arguments.output.as_deref(), path)?),
        None => reduced.text.clone(),
    };
    let text = hamel_codegen::spec::format("reduced", &text)?;
    opened.map_or(Ok(()), |file| file.write(text.as_bytes()))?;
    if arguments.json {
        let map = reduced.map.as_ref().map(|map| map.images.iter().cloned().collect::<BTreeMap<_, _>>());
        let answer = json!({ "text": text, "report": reduced.report, "dim": reduced.dim, "map": map });
        return Ok(answer.to_string());
    }
    let Some(path) = &arguments.output else { return Ok(text.trim_end().to_owned()) };
    let mut lines = reduced.report.clone();
    lines.push(format!(
        "{} has the model reduced by a group of dimension {}",
        session.shown(path),
        reduced.dim
    ));
    Ok(lines.join("\n"))
}

/// A file by its path from the folder of another one, or as it is for a text that is printed.
fn seen_from(other: Option<&Path>, path: &Path) -> Result<String, Error> {
    let Some(other) = other else { return Ok(path.display().to_string()) };
    let real = |path: &Path| path.canonicalize().map_err(|e| Error::io(path.display().to_string(), e));
    let folder = match other.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => real(folder)?,
        _ => real(Path::new("."))?,
    };
    let path = real(path)?;
    let n_shared = folder.components().zip(path.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(n_shared).map(|_| "..".to_owned());
    let down = path.components().skip(n_shared).map(|c| c.as_os_str().to_string_lossy().into_owned());
    // The language writes paths with `/` on every system.
    Ok(up.chain(down).collect::<Vec<_>>().join("/"))
}
