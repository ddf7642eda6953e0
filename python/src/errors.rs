//! Errors of the library as exceptions of the package, with the text that the command prints: arguments of Python
//! stand in the place of options.
//!
//! Deliberately does not know: where an error comes from.

use hamel_codegen::spec::{Diagnostics, Severity};
use hamel_run::Error;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A problem of a model: file, line, column, severity, message, what to change.
type Problem = (Option<String>, Option<usize>, Option<usize>, &'static str, String, Option<String>);

/// The problems of a text with their places, lines and columns counted from one.
fn problems(all: &[Diagnostics]) -> Vec<Problem> {
    let each = all.iter().flat_map(|list| list.iter().map(move |problem| (list.origin(), problem)));
    each.map(|(origin, problem)| {
        let place = origin.zip(problem.span).map(|(origin, span)| origin.line_column(span.start));
        let severity = match problem.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        (
            origin.map(|origin| origin.file.clone()),
            place.map(|(line, _)| line),
            place.map(|(_, column)| column),
            severity,
            problem.message.clone(),
            problem.help.clone(),
        )
    })
    .collect()
}

/// The exception of an error, in words of Python.
pub(crate) fn exception(py: Python<'_>, error: &Error) -> PyErr {
    let by_name = |values: &[(String, f64)]| -> PyResult<Bound<'_, PyDict>> {
        let found = PyDict::new(py);
        values.iter().try_for_each(|(name, value)| found.set_item(name, value))?;
        Ok(found)
    };
    let raised = || -> PyResult<PyErr> {
        let classes = py.import("pyhamel._errors")?;
        let text = in_arguments(&error.to_string());
        let made = match error {
            // Models have the messages of the command.
            Error::Models { problems: all } => {
                classes.getattr("ModelError")?.call1((error.to_string(), problems(all)))?
            }
            Error::Misnamed { .. } => classes.getattr("ModelError")?.call1((text, Vec::<Problem>::new()))?,
            Error::Stopped { t, state, .. } => {
                classes.getattr("IntegrationError")?.call1((text, *t, by_name(state)?))?
            }
            Error::NotFitted { reached, .. } | Error::Unidentifiable { reached, .. } => {
                classes.getattr("FitError")?.call1((text, by_name(reached)?))?
            }
            Error::Io { .. } => classes.getattr("FileError")?.call1((text,))?,
            // The status of bad input.
            other if other.exit_code() == 2 => classes.getattr("InputError")?.call1((text,))?,
            _ => classes.getattr("Error")?.call1((text,))?,
        };
        Ok(PyErr::from_value(made))
    };
    raised().unwrap_or_else(|failure| failure)
}

/// Words of the command that stand for more than an option, and words of Python.
const PHRASES: &[(&str, &str)] = &[
    ("--columns NAME=HEADER,..", "columns={name: header}"),
    ("--initial name=value ..", "y0={name: value}"),
    ("the files of --language c", "the files of `generate(\"c\")`"),
];

/// Options of the command, and the arguments that have their place.
const ARGUMENTS: &[(&str, &str)] = &[
    ("--at", "y"),
    ("--bounds", "bounds"),
    ("--columns", "columns"),
    ("--free", "unknowns"),
    ("--hold", "inputs"),
    ("--initial", "y0"),
    ("--input", "inputs"),
    ("--interpolation", "interpolation"),
    ("--log", "log"),
    ("--method", "method"),
    ("--prior", "prior"),
    ("--resume", "resume=True"),
    ("--samples", "samples"),
    ("--scene", "scene"),
    ("--section", "events"),
    ("--segments", "segments"),
    ("--sensitivity", "sensitivity"),
    ("--set", "params"),
    ("--sigma", "sigma"),
    ("--statistics", "statistics"),
    ("--step", "step"),
    ("--t0", "t0"),
    ("--threads", "threads"),
    ("--time", "time"),
];

/// A text with the arguments of Python in the place of options of the command; an option without an argument stays.
pub(crate) fn in_arguments(text: &str) -> String {
    let text = PHRASES.iter().fold(text.to_owned(), |text, (words, argument)| text.replace(words, argument));
    let mut parts = text.split("--");
    let mut said = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|c: char| !c.is_ascii_alphanumeric() && c != '-').unwrap_or(part.len());
        let (name, rest) = part.split_at(end);
        match ARGUMENTS.iter().find(|(option, _)| option.strip_prefix("--") == Some(name)) {
            Some((_, argument)) => said.push_str(argument),
            None => said.extend(["--", name]),
        }
        said.push_str(rest);
    }
    said
}

/// Results with exceptions.
pub(crate) trait OrRaise<T> {
    /// The value, or the exception of the error.
    fn or_raise(self, py: Python<'_>) -> PyResult<T>;
}

impl<T> OrRaise<T> for Result<T, Error> {
    fn or_raise(self, py: Python<'_>) -> PyResult<T> {
        self.map_err(|error| exception(py, &error))
    }
}
