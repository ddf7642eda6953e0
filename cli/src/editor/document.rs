//! An open text: what it declares, and what is known of the model that it was last.
//!
//! Does not know: messages of the protocol, what is asked.

use std::path::PathBuf;
use std::str::FromStr as _;
use std::sync::Arc;

use hamel_codegen::files::compose_file;
use hamel_codegen::quotient;
use hamel_codegen::spec::{self, Diagnostic, Diagnostics, Model, Outline, Span};
use hamel_mechanics::mechanics::{self, Equations};
use hamel_mechanics::reduction::{self, Formulation};
use lsp_types::Uri;

use super::position::Lines;

/// An open text.
#[derive(Clone, Debug)]
pub(crate) struct Document {
    /// Its text as the editor has it.
    pub(crate) text: Arc<str>,
    /// Counts changes, as the editor does.
    pub(crate) version: i32,
    /// What it declares and mentions.
    pub(crate) outline: Arc<Outline>,
}

impl Document {
    pub(crate) fn new(text: String, version: i32) -> Document {
        // The places of problems are counted without the mark that some editors on Windows write.
        let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
        let outline = Arc::new(Outline::new(text));
        Document { text: text.into(), version, outline }
    }

    pub(crate) fn lines(&self) -> Lines<'_> {
        Lines::new(&self.text)
    }
}

/// What came of checking a text.
#[derive(Clone, Debug)]
pub(crate) struct Checked {
    /// The text.
    pub(crate) text: Arc<str>,
    /// Errors, or warnings of the model.
    pub(crate) found: Diagnostics,
    /// The model, where the text is one with equations.
    pub(crate) model: Option<Arc<Model>>,
}

/// Checks a text; `file` is its address, beside which other models are looked for.
pub(crate) fn check(file: &str, text: Arc<str>) -> Checked {
    let (found, model) = match spec::matrix_fluid(file, &text) {
        Ok(Some(_)) => (Diagnostics::new(None, Vec::new()), None),
        Err(problems) => (problems, None),
        Ok(None) => match with_parts(file, &text).and_then(|whole| spec::parse(file, &whole)) {
            Ok(model) => {
                let found = false_quotients(file, &model).unwrap_or_else(|| model.warnings.clone());
                (found, Some(Arc::new(model)))
            }
            Err(problems) => (problems, None),
        },
    };
    Checked { text, found, model }
}

/// The path that an address stands for.
fn path_of(file: &str) -> Option<PathBuf> {
    let path = Uri::from_str(file).ok()?.path().as_estr().decode().into_string().ok()?.into_owned();
    // `/C:/folder/file` on Windows.
    Some(PathBuf::from(path.strip_prefix('/').filter(|rest| rest.contains(':')).unwrap_or(&path)))
}

/// A text with the texts of its parts. Problems of a part are told where the text begins.
fn with_parts(file: &str, text: &str) -> Result<String, Diagnostics> {
    let Some(path) = path_of(file) else { return Ok(text.to_owned()) };
    compose_file(file, &path, text.to_owned()).map_err(|problems| {
        let Some(other) = problems.origin().filter(|origin| origin.file != file) else { return problems };
        let first = problems.iter().next().map_or("", |problem| problem.message.as_str());
        let problem = Diagnostic::new(Some(Span::new(0, 0)), format!("{}: {first}", other.file));
        Diagnostics::new(None, vec![problem])
    })
}

/// Problems of a text with models that the model says to be the quotient of.
fn false_quotients(file: &str, model: &Model) -> Option<Diagnostics> {
    let path = path_of(file).filter(|_| !model.totals.is_empty())?;
    let problems = quotient::hold_file(model, &path).err()?;
    problems.into_iter().find(|list| list.origin().is_some_and(|origin| origin.file == file))
}

/// The equations of motion of a model as it is written; nothing where they cannot be derived.
pub(crate) fn derive(model: &Model) -> Option<Equations> {
    let system = reduction::reduce(model, &Formulation::of(model)).ok()?;
    mechanics::derive(&system).ok()
}
