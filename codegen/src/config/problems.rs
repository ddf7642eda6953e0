//! What can go wrong between model files and generated ones.
//!
//! Does not know: what to do about it.

use std::fmt;
use std::io;
use std::path::PathBuf;

use crate::error::Error;
use crate::spec::Diagnostics;

/// One thing that went wrong between model files and generated ones.
#[derive(Debug)]
#[non_exhaustive]
pub enum Problem {
    /// A model file cannot be read.
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A model is wrong, or has no such scene.
    Model(Diagnostics),
    /// Scenes were chosen of a model that is not among those given.
    UnknownModel {
        /// The name.
        name: String,
        /// The models there are.
        known: Vec<String>,
    },
    /// A size was asked for that no model file declares.
    UnknownSize {
        /// The name.
        name: String,
        /// The sizes there are.
        known: Vec<String>,
    },
    /// Two scenes whose modules would have the same name.
    SameModule {
        /// Name of the module.
        module: String,
        /// The scenes.
        scenes: [String; 2],
    },
    /// The file for `include!` has the name of a module's file, or is in another directory.
    IncludeFile {
        /// The name.
        name: String,
    },
    /// A scene could not be written down.
    Emission {
        /// The model.
        model: String,
        /// Why.
        source: Box<Error>,
    },
    /// No directory to write to.
    NoOutDir,
    /// A file cannot be written.
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl Problem {
    /// The message for a terminal; escape sequences only when `color` is set.
    pub fn render(&self, color: bool) -> String {
        match self {
            Problem::Model(diagnostics) => diagnostics.render(color).trim_end().to_owned(),
            other if color => format!("\u{1b}[1;31merror\u{1b}[0m: {other}"),
            other => format!("error: {other}"),
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::Read { path, source } => write!(f, "{} cannot be read: {source}", path.display()),
            Problem::Model(diagnostics) => f.write_str(diagnostics.render(false).trim_end()),
            Problem::UnknownModel { name, known } => {
                write!(f, "scenes of `{name}` were chosen, which is none of the models: {}", known.join(", "))
            }
            Problem::UnknownSize { name, known } if known.is_empty() => {
                write!(f, "size `{name}` was asked for, and the models have none: declare `size {name} = 3;`")
            }
            Problem::UnknownSize { name, known } => {
                write!(f, "size `{name}` was asked for, which is none of the models' sizes: {}", known.join(", "))
            }
            Problem::SameModule { module, scenes: [a, b] } => {
                write!(f, "{a} and {b} would both be generated as {module}.rs: rename one of them")
            }
            Problem::IncludeFile { name } => {
                write!(f, "{name} cannot be the file to include: use a plain name that no module has, and Rust")
            }
            Problem::Emission { model, source } => write!(f, "{model} could not be emitted: {source}"),
            Problem::NoOutDir => f.write_str(
                "OUT_DIR is not set: call this from a build script, which cargo sets it for, or give `Config::out_dir`",
            ),
            Problem::Write { path, source } => write!(f, "{} cannot be written: {source}", path.display()),
        }
    }
}

impl std::error::Error for Problem {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Problem::Read { source, .. } | Problem::Write { source, .. } => Some(source),
            Problem::Emission { source, .. } => Some(&**source),
            Problem::Model(diagnostics) => Some(diagnostics),
            _ => None,
        }
    }
}

/// Everything that went wrong. `Debug` prints it for people as `Display` does, because that is what a `main` that
/// returns it shows.
#[derive(Default)]
pub struct Problems {
    pub(super) list: Vec<Problem>,
}

impl Problems {
    /// The problems, model by model.
    pub fn iter(&self) -> std::slice::Iter<'_, Problem> {
        self.list.iter()
    }

    /// The message for a terminal; escape sequences only when `color` is set.
    pub fn render(&self, color: bool) -> String {
        self.list.iter().map(|p| p.render(color)).collect::<Vec<_>>().join("\n\n")
    }
}

impl From<Problem> for Problems {
    fn from(problem: Problem) -> Problems {
        Problems { list: vec![problem] }
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl fmt::Debug for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // `main` prints `Error: ` before it.
        write!(f, "hamel generated nothing\n\n{self}")
    }
}

impl std::error::Error for Problems {}

impl IntoIterator for Problems {
    type Item = Problem;
    type IntoIter = std::vec::IntoIter<Problem>;

    fn into_iter(self) -> Self::IntoIter {
        self.list.into_iter()
    }
}
