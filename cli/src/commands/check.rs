//! `check`: what is wrong with models, for people and for editors.
//!
//! Does not know: what can be wrong.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use clap::Args;
use hamel_codegen::quotient::{Quotient, Step};
use hamel_codegen::spec::{Diagnostic, Diagnostics, Origin, Replacement, Severity, Span};
use serde::Serialize;

use hamel_run::error::Error;
use hamel_run::model::show_warnings;
use hamel_run::session::{ModelFile, Session};
use hamel_run::streams::print;

/// Say everything that is wrong with models: errors and warnings, with their places and how to repair them
///
/// The text is read and checked as a whole. With --derive every scene is derived and lowered as well, which finds what
/// only equations show, such as a singular mass matrix.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel check my_model.hamel
  hamel check my_model.hamel --derive
  hamel check my_model.hamel --json         for editors: one object on standard output, whatever is found

Exit status: 0 no errors, 2 errors."
)]
pub struct Arguments {
    /// Paths that end in .hamel, or names of models
    #[arg(required = true, value_name = "MODEL")]
    pub models: Vec<String>,
    /// Derive and lower every scene
    #[arg(long)]
    pub derive: bool,
    /// Print what is found as JSON
    #[arg(long)]
    pub json: bool,
}

/// What is found.
#[derive(Debug, Default, Serialize)]
struct Findings {
    /// Number of errors.
    errors: usize,
    /// Number of warnings.
    warnings: usize,
    /// In the order of files, then of places.
    problems: Vec<Finding>,
    /// Which models are proved to be quotients of which.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    quotients: Vec<Related>,
}

/// Two models, one of which is proved to be the quotient of the other; numbers are of the total system and of the
/// quotient.
#[derive(Debug, Serialize)]
struct Related {
    quotient: String,
    total: String,
    base: (usize, usize),
    velocities: (usize, usize),
    displacements: (usize, usize),
    conditions: usize,
}

impl From<Step> for Related {
    fn from(step: Step) -> Related {
        let Step { quotient, total, proved } = step;
        let Quotient { base, velocities, displacements, n_conditions } = proved;
        Related { quotient, total, base, velocities, displacements, conditions: n_conditions }
    }
}

/// A step for people.
fn told(step: &Step) -> String {
    let Step { quotient, total, proved } = step;
    let Quotient { base, velocities, displacements, n_conditions } = proved;
    let pairs = [("base", base), ("velocities", velocities), ("displacements", displacements)];
    let pairs = pairs.map(|(what, (from, to))| format!("{what} {from} -> {to}")).join(", ");
    format!("{quotient}: the quotient of {total}, {n_conditions} conditions proved: {pairs}")
}

/// A problem and its places.
#[derive(Debug, Serialize)]
struct Finding {
    file: String,
    /// `error` or `warning`.
    severity: &'static str,
    message: String,
    /// None where there is no text to point at.
    place: Option<Place>,
    /// A remark about the place, or empty.
    label: String,
    /// Further places with a remark each.
    others: Vec<(Place, String)>,
    /// What to change.
    help: Option<String>,
    /// What the help proposes to write.
    replacement: Option<Proposal>,
}

/// A word in the place of another.
#[derive(Debug, Serialize)]
struct Proposal {
    wrong: String,
    right: String,
}

/// A range of a text.
#[derive(Clone, Copy, Debug, Serialize)]
struct Place {
    start: Point,
    /// After the last character.
    end: Point,
}

/// A position in a text: line and column counted from one, columns in characters, bytes from zero.
#[derive(Clone, Copy, Debug, Serialize)]
struct Point {
    line: usize,
    column: usize,
    byte: usize,
}

impl Place {
    fn new(origin: &Origin, span: Span) -> Place {
        let point = |byte: usize| {
            let (line, column) = origin.line_column(byte);
            Point { line, column, byte }
        };
        Place { start: point(span.start), end: point(span.end) }
    }
}

impl Findings {
    fn push(&mut self, finding: Finding) {
        match finding.severity {
            "error" => self.errors += 1,
            _ => self.warnings += 1,
        }
        self.problems.push(finding);
    }

    fn add(&mut self, file: &str, problems: &Diagnostics) {
        let origin = problems.origin();
        let place = |span: Span| origin.map(|origin| Place::new(origin, span));
        for Diagnostic { severity, message, span, label, labels, help, replacement } in problems.iter() {
            self.push(Finding {
                file: origin.map_or(file, |origin| origin.file.as_str()).to_owned(),
                severity: match severity {
                    Severity::Error => "error",
                    Severity::Warning => "warning",
                },
                message: message.clone(),
                place: span.and_then(place),
                label: label.clone(),
                others: labels
                    .iter()
                    .filter_map(|(span, text)| Some((place(*span)?, text.clone())))
                    .collect(),
                help: help.clone(),
                replacement: replacement.as_ref().map(|Replacement { wrong, right }| Proposal {
                    wrong: wrong.clone(),
                    right: right.clone(),
                }),
            });
        }
    }

    fn add_error(&mut self, file: &str, error: &Error) {
        match error {
            Error::Models { problems } => problems.iter().for_each(|problems| self.add(file, problems)),
            Error::Several { errors } => errors.iter().for_each(|error| self.add_error(file, error)),
            other => self.push(Finding {
                file: file.to_owned(),
                severity: "error",
                message: other.to_string(),
                place: None,
                label: String::new(),
                others: Vec::new(),
                help: None,
                replacement: None,
            }),
        }
    }
}

/// The warnings of a model, whose scenes are derived where `derive` says so, and what it is proved to be the quotient
/// of; none for a fluid of matrices.
fn check(file: &ModelFile<'_>, derive: bool) -> Result<Option<(Diagnostics, Vec<Step>)>, Error> {
    if file.fluid()?.is_some() {
        return Ok(None);
    }
    let model = file.checked()?;
    let steps = file.quotients()?;
    if derive {
        // Scenes that fail by the same problem say it once.
        let mut told = BTreeSet::new();
        let scenes = model.scene_names();
        let failed = scenes.iter().filter_map(|scene| model.derive(scene).err());
        Error::all_of(failed.filter(|error| told.insert(error.to_string())).collect())?;
    }
    Ok(Some((model.warnings.clone(), steps)))
}

/// Checks all models; a line about what was found, or the JSON object.
///
/// # Errors
/// Everything that is wrong with the models, together; with `--json`, which has printed it, [`Error::Found`].
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let (mut findings, mut errors, mut lines) = (Findings::default(), Vec::new(), String::new());
    for argument in &arguments.models {
        let checked = session.find(argument).and_then(|file| check(&file, arguments.derive));
        match checked {
            Ok(None) => {}
            Ok(Some((warnings, steps))) => {
                if !arguments.json {
                    show_warnings(&warnings);
                }
                findings.add(argument, &warnings);
                for step in steps {
                    let _ = writeln!(lines, "{}", told(&step));
                    findings.quotients.push(step.into());
                }
            }
            Err(error) => {
                findings.add_error(argument, &error);
                errors.push(error);
            }
        }
    }
    if arguments.json {
        let text =
            serde_json::to_string_pretty(&findings).map_err(|e| Error::io("the findings", e.into()))?;
        if errors.is_empty() {
            return Ok(text);
        }
        print(&text)?;
        return Err(Error::Found { n_errors: findings.errors });
    }
    Error::all_of(errors)?;
    let (n, warnings) = (arguments.models.len(), findings.warnings);
    let s = |n: usize| if n == 1 { "" } else { "s" };
    Ok(format!("{lines}{n} model{}, {warnings} warning{}", s(n), s(warnings)))
}
