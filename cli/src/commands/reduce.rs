//! `reduce`: an unreduced model to the model reduced by its symmetries.
//!
//! Does not know: how symmetries are found ([`symmetry`]).

use std::path::PathBuf;

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
/// and constraints break, and the reconstruction of coordinates that leave. Without a file it is printed.
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
    let opened = arguments.output.as_deref().map(Opened::new).transpose()?;
    let model = file.model()?;
    let reduced = symmetry::reduce(model)?;
    let text = hamel_codegen::spec::format("reduced", &reduced.text)?;
    opened.map_or(Ok(()), |file| file.write(text.as_bytes()))?;
    if arguments.json {
        let answer = json!({ "text": text, "report": reduced.report, "dim": reduced.dim });
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
