//! The front end for build scripts, and the one way from models to files for everybody else.
//!
//! [`Config::generate`] is pure: checked models in, a [`Bundle`] of texts out. [`Config::compile`] reads model files before
//! it and writes the bundle to `OUT_DIR` after it; [`compile`] does so with everything left as it is. Nothing is
//! written before all of it is known, a file is replaced in one step, and only when its text changes.
//!
//! Deliberately does not know: how a scene becomes text, what is in the text.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use crate::emit::{self, SceneEntry};
use crate::error::Error;
use crate::expr::Budget;
use crate::scene::{self, Scenes, Writing};
use crate::spec::{self, Diagnostics, Model};

/// Generates the scenes of one model file into `OUT_DIR`, for a build script, and tells cargo to show warnings and to run the
/// script again when the file changes.
///
/// ```no_run
/// // build.rs
/// fn main() -> Result<(), hamel_codegen::config::Problems> {
///     hamel_codegen::compile("models/spinning_plate.hamel")
/// }
/// ```
///
/// # Errors
/// As [`Config::compile`].
pub fn compile(model: impl AsRef<Path>) -> Result<(), Problems> {
    Config::new().emit_rerun_if_changed(true).emit_warnings(true).compile(&[model])
}

/// Reads and checks a model file.
///
/// # Errors
/// [`Problem::Read`]; [`Problem::Model`] with everything that is wrong with the text.
pub fn read(path: impl AsRef<Path>) -> Result<Model, Problem> {
    read_within(Budget::default(), path.as_ref())
}

fn read_within(budget: Budget, path: &Path) -> Result<Model, Problem> {
    let text =
        std::fs::read_to_string(path).map_err(|source| Problem::Read { path: path.to_owned(), source })?;
    spec::parse_within(budget, &path.display().to_string(), &text).map_err(Problem::Model)
}

/// What is generated, and where it goes.
///
/// ```no_run
/// // build.rs
/// fn main() -> Result<(), hamel_codegen::config::Problems> {
///     hamel_codegen::Config::new()
///         .scenes("spinning_plate", ["default"])
///         .include_file("models.rs")
///         .emit_rerun_if_changed(true)
///         .emit_warnings(true)
///         .compile(&["models/spinning_plate.hamel", "models/rolling_hoop.hamel"])
/// }
/// ```
#[derive(Clone, Debug, Default)]
pub struct Config {
    out_dir: Option<PathBuf>,
    scenes: BTreeMap<String, Vec<String>>,
    include_file: Option<String>,
    emit_rerun_if_changed: bool,
    emit_warnings: bool,
    writing: Writing,
    budget: Option<Budget>,
}

impl Config {
    /// All scenes of every model, into `OUT_DIR`, silently.
    pub fn new() -> Config {
        Config::default()
    }

    /// Writes to another directory than the one that cargo gives build scripts in `OUT_DIR`.
    pub fn out_dir(&mut self, folder: impl Into<PathBuf>) -> &mut Config {
        self.out_dir = Some(folder.into());
        self
    }

    /// Generates these scenes of a model only. Models that are not named keep all of theirs.
    pub fn scenes<S: Into<String>>(
        &mut self,
        model: impl Into<String>,
        scenes: impl IntoIterator<Item = S>,
    ) -> &mut Config {
        self.scenes.insert(model.into(), scenes.into_iter().map(S::into).collect());
        self
    }

    /// Path by which generated code finds the runtime, for a crate that re-exports it: `::hamel_runtime` unless given.
    pub fn runtime_path(&mut self, path: impl Into<String>) -> &mut Config {
        self.writing.runtime = Some(path.into());
        self
    }

    /// Writes one more file, which has a module for each scene; a crate includes it alone.
    pub fn include_file(&mut self, name: impl Into<String>) -> &mut Config {
        self.include_file = Some(name.into());
        self
    }

    /// Limits of what each scene of a model may take, from the text to the program: expressions, memory and work, counted
    /// alike on every machine. Models keep their own unless it is set, which is [`Budget::default`] for those read from files.
    pub fn budget(&mut self, budget: Budget) -> &mut Config {
        self.budget = Some(budget);
        self
    }

    /// Whether [`Config::compile`] prints `cargo::rerun-if-changed` for every model file.
    ///
    /// A build script that prints such a line runs again for the files in these lines alone, so print one for every other
    /// file that it reads. One that prints none runs again for every file of its package.
    pub fn emit_rerun_if_changed(&mut self, enable: bool) -> &mut Config {
        self.emit_rerun_if_changed = enable;
        self
    }

    /// Whether [`Config::compile`] and [`Config::compile_models`] print a `cargo::warning` for every declaration of a
    /// model that has no effect, and where its defaults make no motion.
    ///
    /// Without it, [`Model::warnings`] and [`Bundle::warnings`] still have them.
    pub fn emit_warnings(&mut self, enable: bool) -> &mut Config {
        self.emit_warnings = enable;
        self
    }

    /// The command in the first line of generated files, for modules that are checked in: it writes the file again when
    /// the name of a model follows it.
    pub fn command(&mut self, command: impl Into<String>) -> &mut Config {
        self.writing.command = Some(command.into());
        self
    }

    /// Generates the scenes of model files, each into a file `<module>.rs` of the output directory.
    ///
    /// A module is called like its model (not like the file), followed by `_` and the scene's name unless that is
    /// `default`.
    ///
    /// # Errors
    /// Everything that is wrong with any of the files; [`Problem::NoOutDir`] when cargo does not run this and no directory
    /// was given; [`Problem::Write`]. Nothing has been written unless the last is among them.
    pub fn compile(&mut self, paths: &[impl AsRef<Path>]) -> Result<(), Problems> {
        if self.emit_rerun_if_changed {
            // Before anything can fail, and for files that do not exist as well.
            for path in paths {
                println!("cargo::rerun-if-changed={}", path.as_ref().display());
            }
        }
        let folder = self.folder(std::env::var_os("OUT_DIR"))?;
        let models: Vec<Model> = collect(paths.iter().map(|path| {
            read_within(self.budget.unwrap_or_default(), path.as_ref()).map_err(Problems::from)
        }))?;
        self.compile_to(&folder, &models)
    }

    /// As [`Config::compile`] for models that are there already, such as those of [`spec::ModelBuilder`].
    ///
    /// Prints no `cargo::rerun-if-changed`: the code that built them is tracked by cargo, and files that it read are its own
    /// affair.
    ///
    /// # Errors
    /// As [`Config::compile`].
    pub fn compile_models(&mut self, models: &[Model]) -> Result<(), Problems> {
        let folder = self.folder(std::env::var_os("OUT_DIR"))?;
        self.compile_to(&folder, models)
    }

    fn compile_to(&self, folder: &Path, models: &[Model]) -> Result<(), Problems> {
        // Before anything can fail.
        for line in self.warnings(models) {
            println!("cargo::warning={line}");
        }
        let bundle = self.generate(models)?;
        for line in bundle.warnings.iter().filter(|_| self.emit_warnings).flat_map(Diagnostics::lines) {
            println!("cargo::warning={line}");
        }
        bundle.write(folder)?;
        Ok(())
    }

    /// What cargo is asked to show about models that are not wrong.
    fn warnings(&self, models: &[Model]) -> Vec<String> {
        let shown = models.iter().filter(|_| self.emit_warnings);
        shown.flat_map(|model| model.warnings.lines()).collect()
    }

    /// The directory to write to; `from_cargo` is the value of `OUT_DIR`.
    fn folder(&self, from_cargo: Option<OsString>) -> Result<PathBuf, Problem> {
        self.out_dir.clone().or(from_cargo.map(PathBuf::from)).ok_or(Problem::NoOutDir)
    }

    /// The files of all scenes as text. Reads no files and no environment, and writes nothing.
    ///
    /// ```
    /// let text = "model spring { coordinate x in real; lagrangian = 1/2*x_dot^2 - 2*x^2; }";
    /// let model = hamel_codegen::spec::parse("spring.hamel", text).unwrap();
    /// let bundle = hamel_codegen::Config::new().generate(&[model]).unwrap();
    /// assert!(bundle.files["spring.rs"].contains("pub fn rhs"));
    /// ```
    ///
    /// # Errors
    /// The problems of all models together.
    pub fn generate(&self, models: &[Model]) -> Result<Bundle, Problems> {
        self.generate_with(models, &|_| {})
    }

    /// As [`Config::generate`], calling `note` whenever a model is begun or done, possibly from several threads.
    ///
    /// # Errors
    /// As [`Config::generate`].
    pub fn generate_with(
        &self,
        models: &[Model],
        note: &(dyn Fn(Progress<'_>) + Sync),
    ) -> Result<Bundle, Problems> {
        let known: Vec<String> = models.iter().map(|m| m.name.clone()).collect();
        let unknown = self.scenes.keys().filter(|name| !known.contains(name));
        collect(unknown.map(|name| {
            Err::<(), _>(Problem::UnknownModel { name: name.clone(), known: known.clone() }.into())
        }))?;
        let made = side_by_side(models, |model| {
            note(Progress::Begun { model: &model.name });
            let clock = Instant::now();
            let files = self.generate_one(model);
            note(Progress::Done { model: &model.name, elapsed: clock.elapsed() });
            files
        });
        let mut bundle = Bundle::default();
        for (files, warnings) in collect(made)? {
            for (entry, text) in files {
                bundle.files.insert(format!("{}.rs", entry.module), text);
                bundle.entries.push(entry);
            }
            bundle.warnings.extend(Some(warnings).filter(|warnings| !warnings.is_empty()));
        }
        unique(&bundle.entries)?;
        bundle.entries.sort_by(|a, b| a.module.cmp(&b.module));
        if let Some(name) = &self.include_file {
            if bundle.files.contains_key(name) || Path::new(name).components().count() != 1 {
                return Err(Problem::IncludeFile { name: name.clone() }.into());
            }
            let command = self.writing.command.as_deref().unwrap_or("do not edit, change the models");
            let text = emit::emit_include(&bundle.entries, command, self.out_dir.is_some())
                .map_err(|source| emission(name, source))?;
            bundle.files.insert(name.clone(), text);
        }
        Ok(bundle)
    }

    fn generate_one(&self, model: &Model) -> Result<Generated, Problems> {
        let within = self.budget.map(|budget| {
            let mut model = model.clone();
            model.graph.set_budget(budget);
            model
        });
        let model = within.as_ref().unwrap_or(model);
        let mut scenes = Scenes::new(model);
        let names = match self.scenes.get(&model.name) {
            Some(chosen) => chosen.clone(),
            None => scenes.names(),
        };
        let mut files = Vec::new();
        let scenes = scenes.build_all(&names).map_err(Problem::Model)?;
        for built in &scenes {
            let text = built.emit_as(&self.writing).map_err(|source| emission(&model.name, source))?;
            files.push((built.entry(), text));
        }
        Ok((files, scene::warnings(model, &scenes)))
    }
}

/// The modules of one model, and what is questionable about it.
type Generated = (Vec<(SceneEntry, String)>, Diagnostics);

/// Does independent work on all cores; the results are in the order of `items`.
fn side_by_side<T: Sync, U: Send>(items: &[T], work: impl Fn(&T) -> U + Sync) -> Vec<U> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, U)>> = Mutex::new(Vec::new());
    let n_workers = std::thread::available_parallelism().map_or(1, usize::from).min(items.len());
    std::thread::scope(|scope| {
        for _ in 0..n_workers {
            scope.spawn(|| {
                while let Some((at, item)) = {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    items.get(at).map(|item| (at, item))
                } {
                    let result = work(item);
                    done.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((at, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(at, _)| *at);
    done.into_iter().map(|(_, result)| result).collect()
}

/// All values, or the problems of all that failed.
fn collect<T>(results: impl IntoIterator<Item = Result<T, Problems>>) -> Result<Vec<T>, Problems> {
    let (mut values, mut list) = (Vec::new(), Vec::new());
    for result in results {
        match result {
            Ok(value) => values.push(value),
            Err(problems) => list.extend(problems.list),
        }
    }
    if list.is_empty() { Ok(values) } else { Err(Problems { list }) }
}

/// What [`Config::generate_with`] tells about a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Progress<'a> {
    /// It is being derived.
    Begun {
        /// Its name.
        model: &'a str,
    },
    /// Its scenes are derived and written down, or have failed.
    Done {
        /// Its name.
        model: &'a str,
        /// How long it took.
        elapsed: Duration,
    },
}

/// Generated files by name, not written yet.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bundle {
    /// Name of each file and its whole text.
    pub files: BTreeMap<String, String>,
    /// The scenes, by module.
    pub entries: Vec<SceneEntry>,
    /// For each model whose defaults make no motion in some scene: what [`scene::warnings`] says.
    pub warnings: Vec<Diagnostics>,
}

impl Bundle {
    /// Adds a file `mod.rs` for modules that are checked in: the scenes of this bundle, those of `kept`, which were
    /// generated before, and a macro that visits all of them.
    ///
    /// # Errors
    /// [`Problem::SameModule`], [`Problem::Emission`].
    pub fn add_index(&mut self, kept: &[SceneEntry], command: &str) -> Result<(), Problems> {
        let all = [kept, &self.entries].concat();
        unique(&all)?;
        let text = emit::emit_index(&all, command).map_err(|source| emission("mod.rs", source))?;
        self.files.insert("mod.rs".into(), text);
        Ok(())
    }

    /// The files that are missing in a directory or have another text there, by path.
    pub fn changed(&self, folder: &Path) -> Vec<(PathBuf, &str)> {
        let paths = self.files.iter().map(|(name, text)| (folder.join(name), text.as_str()));
        paths.filter(|(path, text)| std::fs::read(path).ok().as_deref() != Some(text.as_bytes())).collect()
    }

    /// Writes the files that changed, and returns their paths. The others keep their time of modification.
    ///
    /// # Errors
    /// [`Problem::Write`]; every file is then either the old or the new one.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, Problems> {
        let changed = self.changed(folder);
        if !changed.is_empty() {
            std::fs::create_dir_all(folder)
                .map_err(|source| Problem::Write { path: folder.to_owned(), source })?;
        }
        for (path, text) in &changed {
            write_atomically(path, text.as_bytes())
                .map_err(|source| Problem::Write { path: path.clone(), source })?;
        }
        Ok(changed.into_iter().map(|(path, _)| path).collect())
    }
}

fn emission(model: &str, source: Error) -> Problem {
    Problem::Emission { model: model.to_owned(), source: Box::new(source) }
}

fn unique(entries: &[SceneEntry]) -> Result<(), Problem> {
    let mut seen: BTreeMap<&str, &SceneEntry> = BTreeMap::new();
    for entry in entries {
        if let Some(other) = seen.insert(&entry.module, entry) {
            let scenes = [other, entry].map(|e| format!("scene {} of {}", e.scene, e.model));
            return Err(Problem::SameModule { module: entry.module.clone(), scenes });
        }
    }
    Ok(())
}

/// Writes a file such that it is there whole or not at all.
///
/// # Errors
/// Those of the file system; the file is as it was then.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("file");
    let temporary = path.with_file_name(format!(".{name}.{}.tmp", std::process::id()));
    let moved = std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, path));
    if moved.is_err() {
        let _ = std::fs::remove_file(&temporary);
    }
    moved
}

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
            Problem::SameModule { module, scenes: [a, b] } => {
                write!(f, "{a} and {b} would both be generated as {module}.rs: rename one of them")
            }
            Problem::IncludeFile { name } => {
                write!(f, "{name} cannot be the file to include: use a plain name that no module has")
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

/// Everything that went wrong. `Debug` prints it for people as `Display` does, because that is what a `main` that returns
/// it shows.
#[derive(Default)]
pub struct Problems {
    list: Vec<Problem>,
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

#[cfg(test)]
mod tests;
