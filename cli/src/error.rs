//! Every error of the command line, and the exit status it leads to.

use std::fmt;
use std::path::PathBuf;

use hamel_codegen::config::{Problem as GenerationProblem, Problems};
use hamel_codegen::spec::Diagnostics;

use crate::names;

/// Exit status of an interrupted program, as shells have it.
pub(crate) const INTERRUPTED: u8 = 130;

/// What can go wrong.
#[derive(Debug)]
#[non_exhaustive]
pub enum Error {
    /// No model of this name.
    UnknownModel {
        /// The name.
        name: String,
        /// The models there are.
        known: Vec<String>,
    },
    /// No command of this name.
    UnknownCommand {
        /// The name.
        name: String,
        /// The commands there are.
        known: Vec<String>,
    },
    /// A file that would have been overwritten.
    Exists {
        /// The file.
        file: String,
    },
    /// A name that no model can have.
    BadName {
        /// The name.
        name: String,
        /// Why not.
        reason: &'static str,
        /// What it could be instead, if that is plain.
        instead: Option<String>,
    },
    /// A file to be written into a folder that is not there.
    NoFolder {
        /// The file.
        file: String,
        /// The folder.
        folder: String,
    },
    /// A model has no scene of this name.
    UnknownScene {
        /// The model.
        model: String,
        /// The name.
        name: String,
        /// The scenes there are.
        known: Vec<String>,
    },
    /// Model files that do not parse, or models that cannot be derived.
    Models {
        /// All problems, one entry a model.
        problems: Vec<Diagnostics>,
    },
    /// A model file of the repository that is not called like its model.
    Misnamed {
        /// The file.
        file: String,
        /// Name of the model in it.
        model: String,
    },
    /// Models that could not be generated.
    Generation {
        /// All problems.
        problems: Problems,
    },
    /// Input that is not JSON.
    NotJson {
        /// Reason with line and column.
        reason: String,
        /// Whether there was no input at all.
        empty: bool,
    },
    /// A request that does not fit the scene.
    Request {
        /// Everything that is wrong.
        problems: Vec<Problem>,
    },
    /// Parameter values that the model does not allow.
    Params {
        /// The condition that does not hold.
        condition: String,
        /// What it means; may be empty.
        meaning: String,
        /// The values of the parameters named in the condition.
        values: Vec<(String, f64)>,
    },
    /// A state at which the scene has no value.
    State {
        /// Where in the request.
        path: String,
        /// Why.
        reason: String,
    },
    /// An initial state that does not keep the constraints.
    Inadmissible {
        /// Residuals that are more than rounding: name, value, size of the terms.
        broken: Vec<(String, f64, f64)>,
        /// The nearest state that keeps them, by name; none if there is none with the same positions.
        nearest: Option<Vec<(String, f64)>>,
    },
    /// A scene without state, because its constraints determine every velocity.
    NoState {
        /// The scene.
        scene: String,
        /// The model.
        model: String,
    },
    /// Trajectories none of which reached the end.
    NoneArrived {
        /// How many.
        n: usize,
        /// Why the first stopped.
        reason: String,
        /// The files that say so of each.
        files: Vec<PathBuf>,
    },
    /// Options that the integrator does not accept.
    Options {
        /// Why.
        reason: String,
    },
    /// An integration that could not go on.
    Stopped {
        /// The last time reached.
        t: f64,
        /// The state there, by name.
        state: Vec<(String, f64)>,
        /// Why.
        reason: String,
    },
    /// An integration that an interrupt has ended; what there was until then is told and written.
    Interrupted {
        /// The time reached.
        t: f64,
        /// The time that was to be reached.
        t_final: f64,
    },
    /// A fit that ended at no minimum.
    NotFitted {
        /// Why, and what to change.
        reason: String,
        /// The best values, by name.
        reached: Vec<(String, f64)>,
    },
    /// Unknowns of a fit that the data do not determine.
    Unidentifiable {
        /// A change of the unknowns along which nothing changes that was measured, by name, the largest one.
        along: Vec<(String, f64)>,
        /// The values at which this was found, by name.
        reached: Vec<(String, f64)>,
    },
    /// Several errors of independent work.
    Several {
        /// The errors.
        errors: Vec<Error>,
    },
    /// Generated files that are not what the models say.
    Stale {
        /// Files with what is wrong with each.
        files: Vec<(PathBuf, &'static str)>,
        /// The command that repairs it.
        command: String,
    },
    /// Model files that are not in the form of `hamel fmt`.
    NotInForm {
        /// The files.
        files: Vec<PathBuf>,
    },
    /// Errors of models that were told already.
    Found {
        /// How many.
        n_errors: usize,
    },
    /// Compiled scenes that cannot be had.
    NotCompiled {
        /// What was wanted.
        what: String,
        /// Why not.
        reason: String,
    },
    /// Reading, writing or starting something failed.
    Io {
        /// What was being done.
        doing: String,
        /// Why it failed.
        source: std::io::Error,
    },
    /// A command run for the user failed.
    Failed {
        /// The step.
        step: String,
        /// How it ended.
        status: String,
    },
}

/// One thing that is wrong with a request.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Problem {
    /// A value of the wrong kind.
    WrongKind {
        /// Where.
        path: String,
        /// What it is.
        found: String,
        /// What it should be.
        wanted: &'static str,
    },
    /// A number written as a string.
    QuotedNumber {
        /// Where.
        path: String,
        /// The string.
        text: String,
    },
    /// A name that does not exist.
    UnknownName {
        /// Where.
        path: String,
        /// What it would be.
        kind: &'static str,
        /// The name.
        name: String,
        /// The names that exist.
        known: Vec<String>,
    },
    /// Names that have to be there and are not.
    MissingNames {
        /// Where.
        path: String,
        /// The names that are missing.
        absent: Vec<String>,
        /// All names that have to be there.
        known: Vec<String>,
    },
    /// A name that is there twice.
    Repeated {
        /// Where.
        path: String,
        /// The name.
        name: String,
    },
    /// A field without a default that is not there.
    MissingField {
        /// Its name.
        name: String,
        /// What it is.
        meaning: &'static str,
    },
    /// A value that is not allowed.
    Unusable {
        /// Where.
        path: String,
        /// What is wrong and what to change.
        reason: String,
    },
}

impl Error {
    /// Exit status: 2 for bad input, 1 for everything else.
    pub fn exit_code(&self) -> u8 {
        match self {
            Error::Stopped { .. }
            | Error::NoneArrived { .. }
            | Error::NotFitted { .. }
            | Error::NoFolder { .. }
            | Error::Stale { .. }
            | Error::NotInForm { .. }
            | Error::NotCompiled { .. }
            | Error::Io { .. }
            | Error::Failed { .. } => 1,
            Error::Generation { problems } => {
                let is_input = |p: &GenerationProblem| {
                    use GenerationProblem::{Emission, Write};
                    !matches!(p, Emission { .. } | Write { .. })
                };
                if problems.iter().all(is_input) { 2 } else { 1 }
            }
            Error::Interrupted { .. } => INTERRUPTED,
            Error::Several { errors } => errors.iter().map(Error::exit_code).max().unwrap_or(1),
            _ => 2,
        }
    }

    /// An error of reading, writing or starting something.
    pub fn io(doing: impl Into<String>, source: std::io::Error) -> Error {
        Error::Io { doing: doing.into(), source }
    }

    /// Nothing, the error, or all of them.
    ///
    /// # Errors
    /// The errors, when there are any.
    pub fn all_of(mut errors: Vec<Error>) -> Result<(), Error> {
        match errors.len() {
            0 => Ok(()),
            1 => Err(errors.remove(0)),
            _ => Err(Error::Several { errors }),
        }
    }

    /// One value that is not allowed; `path` says where it was given, `reason` what is wrong and what to change.
    pub fn unusable(path: impl Into<String>, reason: impl Into<String>) -> Error {
        Error::Request { problems: vec![Problem::Unusable { path: path.into(), reason: reason.into() }] }
    }

    /// The same about a state at another place of the request.
    pub(crate) fn at(self, path: &str) -> Error {
        match self {
            Error::State { reason, .. } => Error::unusable(path, reason),
            other => other,
        }
    }

    /// The message for a terminal; escape sequences only when `color` is set.
    pub fn render(&self, color: bool) -> String {
        match self {
            Error::Models { problems } => {
                problems.iter().map(|d| d.render(color)).collect::<Vec<_>>().join("\n").trim_end().to_owned()
            }
            Error::Generation { problems } => problems.render(color),
            Error::Several { errors } => {
                errors.iter().map(|e| e.render(color)).collect::<Vec<_>>().join("\n\n")
            }
            other if color => format!("\u{1b}[1;31merror\u{1b}[0m: {other}"),
            other => format!("error: {other}"),
        }
    }
}

impl From<Diagnostics> for Error {
    fn from(problems: Diagnostics) -> Error {
        Error::Models { problems: vec![problems] }
    }
}

impl From<Problems> for Error {
    fn from(problems: Problems) -> Error {
        Error::Generation { problems }
    }
}

fn quoted(known: &[String]) -> String {
    names::list(known.iter().map(String::as_str))
}

fn hint(name: &str, known: &[String]) -> String {
    names::hint(name, known.iter().map(String::as_str))
}

fn values(f: &mut fmt::Formatter<'_>, values: &[(String, f64)]) -> fmt::Result {
    for (k, (name, x)) in values.iter().enumerate() {
        write!(f, "{}{name} = {x:?}", if k == 0 { "" } else { ", " })?;
    }
    Ok(())
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Problem::WrongKind { path, found, wanted } => {
                write!(f, "{path} is {found}, but has to be {wanted}")
            }
            Problem::QuotedNumber { path, text } => {
                write!(f, "{path} is the string {text:?}: write the number without quotes")
            }
            Problem::UnknownName { path, kind, name, known } => {
                write!(f, "{path} has no {kind} `{name}`{}\n  {kind}s: {}", hint(name, known), quoted(known))
            }
            Problem::MissingNames { path, absent, known } => {
                write!(f, "{path} lacks {}\n  all of: {}", quoted(absent), quoted(known))
            }
            Problem::Repeated { path, name } => write!(f, "{path} has `{name}` twice: keep one of them"),
            Problem::MissingField { name, meaning } => write!(f, "{name} is missing: {meaning}"),
            Problem::Unusable { path, reason } => write!(f, "{path} {reason}"),
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Error::UnknownModel { name, known } => write!(
                f,
                "no model `{name}`{}\n  models: {}\n  a path that ends in .hamel is read as a model file",
                hint(name, known),
                quoted(known)
            ),
            Error::UnknownCommand { name, known } => {
                write!(f, "no command `{name}`{}\n  commands: {}", hint(name, known), quoted(known))
            }
            Error::Exists { file } => {
                write!(f, "{file} exists and is left as it is: choose another name, or remove it")
            }
            Error::BadName { name, reason, instead } => {
                write!(f, "`{name}` cannot name a model: {reason}")?;
                instead.iter().try_for_each(|instead| write!(f, "; `{instead}` can"))
            }
            Error::NoFolder { file, folder } => {
                write!(f, "{file} cannot be written: there is no folder {folder}, make it first")
            }
            Error::UnknownScene { model, name, known } => {
                write!(f, "{model} has no scene `{name}`{}\n  scenes: {}", hint(name, known), quoted(known))
            }
            Error::Models { .. } | Error::Generation { .. } | Error::Several { .. } => {
                f.write_str(&self.render(false))
            }
            Error::Misnamed { file, model } => {
                write!(
                    f,
                    "{file} contains the model `{model}`: name the file {model}.hamel, or the model like the file"
                )
            }
            Error::NotJson { empty: true, .. } => {
                f.write_str("standard input is empty: give a JSON request, see --help for an example")
            }
            Error::NotJson { reason, .. } => write!(f, "the request is not JSON: {reason}"),
            Error::Request { problems } => {
                for (k, problem) in problems.iter().enumerate() {
                    write!(f, "{}{problem}", if k == 0 { "" } else { "\n  " })?;
                }
                Ok(())
            }
            Error::Params { condition, meaning, values: given } => {
                write!(f, "{condition} does not hold")?;
                if !meaning.is_empty() {
                    write!(f, " ({meaning})")?;
                }
                if !given.is_empty() {
                    f.write_str(" for ")?;
                    values(f, given)?;
                }
                f.write_str(": change the parameters")
            }
            Error::State { path, reason } => write!(f, "{path} cannot be evaluated: {reason}"),
            Error::Inadmissible { broken, nearest } => {
                f.write_str("initial does not keep the constraints:")?;
                for (k, (name, residual, size)) in broken.iter().enumerate() {
                    let comma = if k == 0 { "" } else { "," };
                    write!(f, "{comma} {name} = {residual:?}")?;
                    // No velocity is in a residual of positions.
                    if *size > 0.0 {
                        write!(f, " beside terms of {size:.1e}")?;
                    }
                }
                match nearest {
                    Some(nearest) => {
                        f.write_str(
                            "\n  the nearest state that does, with the same positions and the least kinetic energy of \
                             the change: ",
                        )?;
                        values(f, nearest)
                    }
                    None if broken.iter().any(|(.., size)| *size == 0.0) => {
                        f.write_str("\n  no velocities keep them at these positions: give others")
                    }
                    None => {
                        f.write_str("\n  no velocities were found that do at these positions: give others")
                    }
                }
            }
            Error::NoState { scene, model } => write!(
                f,
                "scene {scene} of {model} has no state, so there is nothing to integrate: its constraints determine every \
                 velocity, and it has no coordinate; `eval` with the state {{}} has the outputs, and --reconstruct (in JSON \
                 \"reconstruct\") moves the group where the model says how"
            ),
            Error::NoneArrived { n, reason, files } => {
                let reason = reason.replace('\n', "\n    ");
                write!(f, "none of {n} trajectories reached the end; the first stopped: {reason}")?;
                files.iter().try_for_each(|file| write!(f, "\n  {} says why of each", file.display()))
            }
            Error::Options { reason } => f.write_str(reason),
            Error::Stopped { t, state, reason } => {
                write!(f, "integration stopped at t = {t:?}: {reason}\n  state reached: ")?;
                values(f, state)
            }
            Error::Interrupted { t, t_final } => {
                write!(f, "interrupted at t = {t:?} of {t_final:?}: what is told and written ends there")
            }
            Error::NotFitted { reason, reached } => {
                write!(f, "{reason}\n  the best values: ")?;
                values(f, reached)
            }
            Error::Unidentifiable { along, reached } => {
                match &along[..] {
                    [(name, _)] => write!(
                        f,
                        "{name} changes nothing that was measured: leave it out of --free, or add columns that depend on it"
                    )?,
                    _ => {
                        let names = names::list(along.iter().map(|(name, _)| name.as_str()));
                        write!(f, "the data determine combinations of {names} only: the change ")?;
                        for (k, (name, x)) in along.iter().enumerate() {
                            write!(f, "{}d{name} = {x:.4}", if k == 0 { "" } else { ", " })?;
                        }
                        f.write_str(
                            " alters nothing that was measured; leave one of them out of --free, or add columns that tell \
                             them apart",
                        )?;
                    }
                }
                f.write_str("\n  found at ")?;
                values(f, reached)
            }
            Error::Stale { files, command } => {
                f.write_str("generated files are not what the models say:")?;
                for (file, what) in files {
                    write!(f, "\n  {} {what}", file.display())?;
                }
                write!(f, "\n  run: {command}")
            }
            Error::NotInForm { files } => {
                f.write_str("not in form:")?;
                let mut command = "hamel fmt".to_owned();
                for file in files {
                    write!(f, "\n  {}", file.display())?;
                    command.push_str(&format!(" {}", file.display()));
                }
                write!(f, "\n  run: {command}")
            }
            Error::Found { n_errors: 1 } => f.write_str("1 error in the models"),
            Error::Found { n_errors } => write!(f, "{n_errors} errors in the models"),
            Error::NotCompiled { what, reason } => {
                write!(f, "{what} is not available compiled: {reason}\n  run `cargo xtask generate`")
            }
            Error::Io { doing, source } => write!(f, "{doing}: {source}"),
            Error::Failed { step, status } => write!(f, "{step} failed: {status}"),
        }
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Error::Io { source, .. } => Some(source),
            Error::Generation { problems } => Some(problems),
            _ => None,
        }
    }
}
