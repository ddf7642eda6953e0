//! The front end for build scripts, and the one way from models to files for everybody else.
//!
//! [`Config::generate`] is pure: checked models in, a [`Bundle`] of texts out. [`Config::compile`] reads model files
//! before it and writes the bundle to `OUT_DIR` after it; [`compile`] does so with everything left as it is. Nothing is
//! written before all of it is known, a file is replaced in one step, and only when its text changes.
//!
//! Scenes that an earlier run has made from the same text are taken from `cache`, beside the other files in `OUT_DIR`.
//!
//! Does not know: how a scene becomes text, what is in the text.

mod bundle;
mod cache;
mod fluid;
mod problems;
pub mod store;

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::files::compose_file;
use crate::quotient;
use crate::scene::{self, BuiltScene, Scenes, Writing};
use hamel_expr::Budget;
use hamel_expr::error::Error;
use hamel_expr::parallel::side_by_side;
use hamel_lang::spec::{self, Diagnostics, Model};
use hamel_program::emit::{self, CModule, SceneEntry, ScriptLanguage};

use bundle::{emission, unique};
use cache::Cache;

pub use bundle::{Bundle, write_atomically};
pub use problems::{Problem, Problems};

pub use crate::scene::Language;
pub use hamel_program::emit::Precision;

/// Generates the scenes of one model file into `OUT_DIR`, for a build script, and tells cargo to show warnings and to
/// run the script again when the file changes.
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

/// The checked model of a robot's description, and what the model lacks of the file. Files that it includes are read
/// beside it.
///
/// ```no_run
/// // build.rs
/// use hamel_codegen::{Config, config, import::Options};
/// fn main() -> Result<(), Box<dyn std::error::Error>> {
///     println!("cargo:rerun-if-changed=arm.urdf");
///     let (model, notes) = config::import("arm.urdf", &Options::default())?;
///     for note in notes.lines() {
///         println!("cargo:warning={note}");
///     }
///     Ok(Config::new().compile_models(&[model])?)
/// }
/// ```
///
/// # Errors
/// As [`read`]; [`Problem::Model`] with everything that keeps the file from being a model.
pub fn import(
    path: impl AsRef<Path>,
    options: &hamel_import::Options,
) -> Result<(Model, spec::Diagnostics), Problem> {
    let path = path.as_ref();
    let files = hamel_import::beside(path);
    let imported = hamel_import::import_with(&path.display().to_string(), &text_of(path)?, options, &files);
    let imported = imported.map_err(Problem::Model)?;
    let model = parsed(Budget::default(), &path.with_extension("hamel"), &imported.text)?;
    Ok((model, imported.notes))
}

fn read_within(budget: Budget, path: &Path) -> Result<Model, Problem> {
    parsed(budget, path, &model_text(path)?)
}

/// The text of a model, with the texts of its parts.
fn model_text(path: &Path) -> Result<String, Problem> {
    let text = text_of(path)?;
    compose_file(&path.display().to_string(), path, text).map_err(Problem::Model)
}

fn text_of(path: &Path) -> Result<String, Problem> {
    std::fs::read_to_string(path)
        .map_err(|source| Problem::Read { path: path.to_owned(), source: with_neighbours(path, source) })
}

/// An error of reading a file with the model files that are beside it, where it is not there.
fn with_neighbours(path: &Path, source: io::Error) -> io::Error {
    if source.kind() != io::ErrorKind::NotFound {
        return source;
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let Ok(listing) = std::fs::read_dir(folder) else {
        let here = std::env::current_dir().unwrap_or_default();
        let text = format!("there is no folder {} in {}", folder.display(), here.display());
        return io::Error::new(source.kind(), text);
    };
    let names = listing.filter_map(|file| file.ok()?.file_name().into_string().ok());
    let mut models: Vec<String> = names.filter(|name| name.ends_with(".hamel")).collect();
    models.sort();
    let there = if models.is_empty() { "no model".to_owned() } else { models.join(", ") };
    io::Error::new(source.kind(), format!("there is no such file; {} has {there}", folder.display()))
}

fn parsed(budget: Budget, path: &Path, text: &str) -> Result<Model, Problem> {
    let model = spec::parse_within(budget, &path.display().to_string(), text);
    model.and_then(|model| quotient::read_totals_of_file(model, path)).map_err(Problem::Model)
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
    sizes: BTreeMap<String, i64>,
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

    /// Reads model files as if a [size](spec::Model::sizes) had this value, whatever `size n = 3;` in a file says.
    /// Every file that declares a size of this name is meant, and one has to.
    ///
    /// ```no_run
    /// // build.rs
    /// fn main() -> Result<(), hamel_codegen::config::Problems> {
    ///     hamel_codegen::Config::new().size("n", 10).compile(&["models/chain.hamel"])
    /// }
    /// ```
    pub fn size(&mut self, name: impl Into<String>, value: i64) -> &mut Config {
        self.sizes.insert(name.into(), value);
        self
    }

    /// The language of the files: Rust unless given. Files in C are called like modules, `heavy_top.h` and
    /// `heavy_top.c`; a build script compiles them with the crate `cc`.
    ///
    /// ```
    /// use hamel_codegen::{Config, config::Language};
    ///
    /// let text = "model spring { coordinate x in real; lagrangian = 1/2*x_dot^2 - 2*x^2; }";
    /// let model = hamel_codegen::spec::parse("spring.hamel", text).unwrap();
    /// let bundle = Config::new().language(Language::C).generate(&[model]).unwrap();
    /// assert!(bundle.files["spring.h"].contains("void spring_rhs(const spring_prepared *p, double t,"));
    /// ```
    pub fn language(&mut self, language: Language) -> &mut Config {
        self.writing.language = language;
        self
    }

    /// Precision of the numbers of C and C++, double unless given. A module of Rust computes with `f32` as it stands:
    /// `Prepared<f32>`.
    ///
    /// ```
    /// use hamel_codegen::{Config, config::{Language, Precision}};
    ///
    /// let text = "model spring { coordinate x in real; lagrangian = 1/2*x_dot^2 - 2*x^2; }";
    /// let model = hamel_codegen::spec::parse("spring.hamel", text).unwrap();
    /// let bundle = Config::new().language(Language::C).precision(Precision::Single).generate(&[model]).unwrap();
    /// assert!(bundle.files["spring.h"].contains("void spring_rhs(const spring_prepared *p, float t,"));
    /// ```
    pub fn precision(&mut self, precision: Precision) -> &mut Config {
        self.writing.precision = precision;
        self
    }

    /// Path by which generated code finds the runtime, for a crate that re-exports it: `::hamel_runtime` unless given.
    pub fn runtime_path(&mut self, path: impl Into<String>) -> &mut Config {
        self.writing.runtime = Some(path.into());
        self
    }

    /// Whether every module has a test of its own (`#[cfg(test)]`): the rates at three states are those that the
    /// generator computed when it held the scene to its definition.
    pub fn self_test(&mut self, enable: bool) -> &mut Config {
        self.writing.self_test = enable;
        self
    }

    /// Whether modules have vectors, matrices, attitudes and places in the types of the crate `nalgebra` too: methods
    /// of `Params` and `State` by the names of the model, and `Prepared::on_vectors`.
    ///
    /// The crate that the modules are for needs the feature `nalgebra` of the runtime.
    pub fn nalgebra(&mut self, enable: bool) -> &mut Config {
        self.writing.nalgebra = enable;
        self
    }

    /// Writes one more file, which has a module for each scene; a crate includes it alone.
    pub fn include_file(&mut self, name: impl Into<String>) -> &mut Config {
        self.include_file = Some(name.into());
        self
    }

    /// Limits of what each scene of a model may take, from the text to the program: expressions, memory and work,
    /// counted alike on every machine. Models keep their own unless it is set, which is [`Budget::default`] for those
    /// read from files.
    pub fn budget(&mut self, budget: Budget) -> &mut Config {
        self.budget = Some(budget);
        self
    }

    /// Whether [`Config::compile`] prints `cargo::rerun-if-changed` for every model file.
    ///
    /// A build script that prints such a line runs again for the files in these lines alone, so print one for every
    /// other file that it reads. One that prints none runs again for every file of its package.
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
    /// Everything that is wrong with any of the files; [`Problem::NoOutDir`] when cargo does not run this and no
    /// directory was given; [`Problem::Write`]. Nothing has been written unless the last is among them.
    pub fn compile(&mut self, paths: &[impl AsRef<Path>]) -> Result<(), Problems> {
        if self.emit_rerun_if_changed {
            // Before anything can fail, and for files that do not exist as well.
            for path in paths {
                println!("cargo::rerun-if-changed={}", path.as_ref().display());
            }
        }
        let clock = Instant::now();
        let folder = self.folder(std::env::var_os("OUT_DIR"))?;
        let models = self.read_all(paths)?;
        self.hold_quotients(&models, paths)?;
        // A folder that was chosen holds what is checked in.
        let cache = self.out_dir.is_none().then(|| Cache::new(folder.join(CACHE)));
        self.compile_to(&folder, &models, cache.as_ref())?;
        if self.emit_warnings && is_unoptimised() && clock.elapsed() > PATIENCE {
            for line in advice(clock.elapsed()) {
                println!("cargo::warning={line}");
            }
        }
        Ok(())
    }

    /// Proves what models say of others that they are quotients of.
    fn hold_quotients(&self, models: &[Model], paths: &[impl AsRef<Path>]) -> Result<(), Problems> {
        collect(models.iter().zip(paths).map(|(model, path)| {
            let path = path.as_ref();
            if self.emit_rerun_if_changed {
                let folder = path.parent().unwrap_or(Path::new(""));
                let totals = model.totals.iter().map(|total| folder.join(&total.file));
                for file in totals.chain(model.parts.iter().map(PathBuf::from)) {
                    println!("cargo::rerun-if-changed={}", file.display());
                }
            }
            let held = quotient::hold_file(model, path);
            held.map(|_| ()).map_err(|list| Problems { list: list.into_iter().map(Problem::Model).collect() })
        }))?;
        Ok(())
    }

    /// The models of files, with the sizes that were asked for.
    fn read_all(&self, paths: &[impl AsRef<Path>]) -> Result<Vec<Model>, Problems> {
        let mut known: BTreeSet<String> = BTreeSet::new();
        let models = collect(paths.iter().map(|path| {
            let (path, budget) = (path.as_ref(), self.budget.unwrap_or_default());
            let text = model_text(path)?;
            let model = parsed(budget, path, &text)?;
            let own: Vec<String> = model.sizes.iter().map(|size| size.name.clone()).collect();
            let asked = self.sizes.iter().filter(|(name, _)| own.contains(name));
            let asked: Vec<(String, i64)> = asked.map(|(name, value)| (name.clone(), *value)).collect();
            known.extend(own);
            if asked.is_empty() {
                return Ok(model);
            }
            let text =
                spec::with_sizes(&path.display().to_string(), &text, &asked).map_err(Problem::Model)?;
            Ok(parsed(budget, path, &text)?)
        }))?;
        let known: Vec<String> = known.into_iter().collect();
        let unknown = self.sizes.keys().filter(|name| !known.contains(name));
        collect(unknown.map(|name| {
            Err::<(), _>(Problem::UnknownSize { name: name.clone(), known: known.clone() }.into())
        }))?;
        Ok(models)
    }

    /// As [`Config::compile`] for models that are there already, such as those of [`spec::ModelBuilder`].
    ///
    /// Prints no `cargo::rerun-if-changed`: the code that built them is tracked by cargo, and files that it read are
    /// its own affair.
    ///
    /// # Errors
    /// As [`Config::compile`].
    pub fn compile_models(&mut self, models: &[Model]) -> Result<(), Problems> {
        let folder = self.folder(std::env::var_os("OUT_DIR"))?;
        self.compile_to(&folder, models, None)
    }

    fn compile_to(&self, folder: &Path, models: &[Model], cache: Option<&Cache>) -> Result<(), Problems> {
        // Before anything can fail.
        for line in self.warnings(models) {
            println!("cargo::warning={line}");
        }
        let bundle = self.generate_cached(models, &|_| {}, cache)?;
        for line in bundle.warnings.iter().filter(|_| self.emit_warnings).flat_map(lines_of) {
            println!("cargo::warning={line}");
        }
        bundle.write(folder)?;
        Ok(())
    }

    /// What cargo is asked to show about models that are not wrong.
    fn warnings(&self, models: &[Model]) -> Vec<String> {
        let shown = models.iter().filter(|_| self.emit_warnings);
        shown.flat_map(|model| lines_of(&model.warnings)).collect()
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
        self.generate_cached(models, note, None)
    }

    /// As [`Config::generate`], with scenes that an earlier run has left in a folder, as [`Config::compile`] finds
    /// them.
    ///
    /// # Errors
    /// As [`Config::generate`].
    pub fn generate_within(&self, models: &[Model], cache: &Path) -> Result<Bundle, Problems> {
        self.generate_cached(models, &|_| {}, Some(&Cache::new(cache.to_owned())))
    }

    fn generate_cached(
        &self,
        models: &[Model],
        note: &(dyn Fn(Progress<'_>) + Sync),
        cache: Option<&Cache>,
    ) -> Result<Bundle, Problems> {
        let known: Vec<String> = models.iter().map(|m| m.name.clone()).collect();
        let unknown = self.scenes.keys().filter(|name| !known.contains(name));
        collect(unknown.map(|name| {
            Err::<(), _>(Problem::UnknownModel { name: name.clone(), known: known.clone() }.into())
        }))?;
        let has_precision = matches!(self.writing.language, Language::C | Language::Cpp);
        if self.writing.precision != Precision::Double && !has_precision {
            return Err(Problem::Precision.into());
        }
        let made = side_by_side(models, |model| {
            note(Progress::Begun { model: &model.name });
            let clock = Instant::now();
            let files = self.generate_one(model, cache);
            note(Progress::Done { model: &model.name, elapsed: clock.elapsed() });
            files
        });
        let mut bundle = Bundle::default();
        for (files, warnings) in collect(made)? {
            for (entry, texts) in files {
                bundle.files.extend(texts);
                bundle.entries.push(entry);
            }
            bundle.warnings.extend(Some(warnings).filter(|warnings| !warnings.is_empty()));
        }
        unique(&bundle.entries)?;
        bundle.entries.sort_by(|a, b| a.module.cmp(&b.module));
        if let Some(name) = &self.include_file {
            let is_rust = self.writing.language == Language::Rust;
            if !is_rust || bundle.files.contains_key(name) || Path::new(name).components().count() != 1 {
                return Err(Problem::IncludeFile { name: name.clone() }.into());
            }
            let command = self.writing.command.as_deref().unwrap_or("do not edit, change the models");
            let text = emit::emit_include(&bundle.entries, command, self.out_dir.is_some())
                .map_err(|source| emission(name, source))?;
            bundle.files.insert(name.clone(), text);
        }
        Ok(bundle)
    }

    fn generate_one(&self, model: &Model, cache: Option<&Cache>) -> Result<Generated, Problems> {
        let within = self.budget.map(|budget| {
            let mut model = model.clone();
            model.graph.set_budget(budget);
            model
        });
        let model = within.as_ref().unwrap_or(model);
        // What is kept is one file a scene.
        let cache = cache.filter(|_| self.writing.language == Language::Rust);
        let kept = cache.and_then(|cache| cache.of(model, &self.writing, &self.budget.unwrap_or_default()));
        let language = self.writing.language;
        let mut scenes = Scenes::new(model).for_language(language);
        let names = match (self.scenes.get(&model.name), &kept) {
            (Some(chosen), _) => chosen.clone(),
            (None, None) => scenes.names(),
            (None, Some(kept)) => {
                let find = || scenes.has_ignorable_coordinates();
                scene::names_of(model, || kept.has_ignorable_coordinates(find))
            }
        };
        let known = |name: &String| {
            let (entry, text) = kept.as_ref().and_then(|kept| kept.scene(name))?;
            let file = format!("{}.rs", entry.module);
            Some((entry, vec![(file, text)]))
        };
        let mut files: Vec<Option<Files>> = names.iter().map(known).collect();
        let missing = names.iter().zip(&files).filter(|(_, file)| file.is_none());
        let missing: Vec<String> = missing.map(|(name, _)| name.clone()).collect();
        let built = scenes.build_all(&missing).map_err(Problem::Model)?;
        let emitted = side_by_side(&built, |scene| {
            let texts = self
                .texts_of(model, scene)
                .map_err(|source| Problems::from(emission(&model.name, source)))?;
            let entry = scene.entry();
            if let (Some(kept), [(_, text)]) = (&kept, texts.as_slice())
                && scene::warnings(model, std::slice::from_ref(scene)).is_empty()
            {
                kept.keep(&entry, text);
            }
            Ok((entry, texts))
        });
        let mut emitted = collect(emitted)?.into_iter();
        for file in files.iter_mut().filter(|file| file.is_none()) {
            *file = emitted.next();
        }
        Ok((files.into_iter().flatten().collect(), scene::warnings(model, &built)))
    }

    /// The files of a scene by name.
    fn texts_of(&self, model: &Model, scene: &BuiltScene) -> Result<Vec<(String, String)>, Error> {
        Ok(match self.writing.language {
            Language::Rust => {
                let text = scene.emit_from(&self.writing, scene::start(model, scene)?)?;
                vec![(format!("{}.rs", scene.module_name()), text)]
            }
            Language::Wasm => {
                let name = scene.module_name();
                let initial = scene::start(model, scene)?;
                let wasm = scene.emit_wasm(&self.writing, initial.clone())?;
                vec![
                    (format!("{name}.rs"), scene.emit_from(&self.writing, initial)?),
                    (format!("{name}_wasm.rs"), wasm.root),
                    (format!("{name}.mjs"), wasm.script),
                ]
            }
            Language::C => self.c_of(model, scene, |_| None)?,
            Language::Cpp => self.c_of(model, scene, |c| Some((".hpp", c.cpp)))?,
            Language::Casadi => self.c_of(model, scene, |c| Some(("_casadi.c", c.casadi)))?,
            Language::CasadiExpr => self.script_of(model, scene, ScriptLanguage::Casadi)?,
            Language::Jax => self.script_of(model, scene, ScriptLanguage::Jax)?,
            Language::Sympy => self.script_of(model, scene, ScriptLanguage::Sympy)?,
            Language::Julia => self.script_of(model, scene, ScriptLanguage::Julia)?,
            Language::Matlab => self.script_of(model, scene, ScriptLanguage::Matlab)?,
        })
    }

    /// Header and source, and one more file.
    fn c_of(
        &self,
        model: &Model,
        scene: &BuiltScene,
        more: impl Fn(CModule) -> Option<(&'static str, String)>,
    ) -> Result<Vec<(String, String)>, Error> {
        let c = scene.emit_c(&self.writing, scene::start(model, scene)?)?;
        let prefix = c.prefix.clone();
        let files = [(".h", c.header.clone()), (".c", c.source.clone())].into_iter().chain(more(c));
        Ok(files.map(|(ending, text)| (format!("{prefix}{ending}"), text)).collect())
    }

    /// The file of a language of formulas.
    fn script_of(
        &self,
        model: &Model,
        scene: &BuiltScene,
        language: ScriptLanguage,
    ) -> Result<Vec<(String, String)>, Error> {
        let script = scene.emit_script(language, &self.writing, scene::start(model, scene)?)?;
        Ok(vec![(script.file, script.text)])
    }
}

/// Warnings with their places in the text, line by line: cargo shows no longer texts, and says itself that they warn.
fn lines_of(warnings: &Diagnostics) -> Vec<String> {
    let text = warnings.render(false);
    let lines = text.lines().filter(|line| !line.trim().is_empty());
    lines.map(|line| line.strip_prefix("warning: ").unwrap_or(line).to_owned()).collect()
}

/// Folder in `OUT_DIR` for scenes that need not be made again.
const CACHE: &str = "hamel-cache";

/// A build script that takes longer without optimisation is told how to be faster.
const PATIENCE: Duration = Duration::from_secs(5);

/// Whether cargo compiled this crate without optimisation, as it does for build scripts unless it is told otherwise.
fn is_unoptimised() -> bool {
    env!("HAMEL_CODEGEN_OPT_LEVEL") == "0"
}

/// What to do about a slow build script, a line each.
fn advice(elapsed: Duration) -> [String; 3] {
    let seconds = elapsed.as_secs_f64();
    [
        format!("hamel took {seconds:.0} s without optimisation; faster with these lines in Cargo.toml:"),
        "    [profile.dev.build-override]".to_owned(),
        "    opt-level = 2".to_owned(),
    ]
}

/// A scene and its files by name.
type Files = (SceneEntry, Vec<(String, String)>);

/// The files of one model, and what is questionable about it.
type Generated = (Vec<Files>, Diagnostics);

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

#[cfg(test)]
mod tests;
