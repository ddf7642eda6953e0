//! `generate`: model files to checked-in modules, all or nothing; those of the repository's models, and of the systems
//! of a benchmark ([`systems`]).
//!
//! Does not know: what is in a generated module, except the name of its model in the first line.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use clap::Args;
use hamel_codegen::config::{Bundle, Config, Problems, Progress};
use hamel_program::emit::SceneEntry as Entry;
use hamel_run::Error;
use hamel_run::model::{Model, show_warnings};
use hamel_run::repository::Repository;
use hamel_run::session::{ModelFile, Session};
use indicatif::{ProgressBar, ProgressStyle};

pub(crate) mod systems;

/// Writes the modules again; in the first line of each, with the name of its model.
const COMMAND: &str = "cargo xtask generate";

/// Write models/src/generated from models/specs, or check that it is up to date
///
/// The systems of `bench nonholonomic` are written alike, all of them when one is named: xtask/bench/src/generated from
/// xtask/bench/models.
///
/// All scenes of the models are parsed, derived and emitted first; when any model has a problem, nothing is
/// written. Files are written only when they change, and files of scenes that no longer exist are removed.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  cargo xtask generate                  all models
  cargo xtask generate heavy_top        one model; the index still covers all
  cargo xtask generate --check          write nothing, fail when something would be written")]
pub(crate) struct Arguments {
    /// Write nothing; fail and name the files that are not up to date
    #[arg(long)]
    check: bool,
    /// Names of models; all when none is given
    models: Vec<String>,
}

/// Writes or checks the files; a line about what was done.
///
/// # Errors
/// As [`generate`].
pub(crate) fn run(
    repository: &Repository,
    session: &Session,
    arguments: &Arguments,
) -> Result<String, Error> {
    let done = generate(repository, session, &arguments.models, arguments.check)?;
    let mut line = format!("{} models, {} scenes in {:.2} s", done.n_models, done.n_modules, done.seconds);
    if let (Some((name, seconds)), true) = (&done.slowest, done.n_models > 1) {
        let _ = write!(line, " (slowest: {name}, {seconds:.2} s)");
    }
    line.push_str(": ");
    if arguments.check {
        line.push_str("generated files are up to date");
    } else if done.written.is_empty() && done.removed.is_empty() {
        line.push_str("nothing changed");
    } else {
        let _ = write!(line, "{} files written", done.written.len());
        if !done.removed.is_empty() {
            let _ = write!(line, ", {} removed", done.removed.len());
        }
    }
    Ok(line)
}

/// What a run did.
#[derive(Debug)]
pub(crate) struct Summary {
    /// Models that were derived.
    pub(crate) n_models: usize,
    /// Modules of these models.
    pub(crate) n_modules: usize,
    /// Files that were written.
    pub(crate) written: Vec<PathBuf>,
    /// Files that were removed.
    pub(crate) removed: Vec<PathBuf>,
    /// Seconds of the whole run.
    pub(crate) seconds: f64,
    /// The model that took longest, with its seconds.
    pub(crate) slowest: Option<(String, f64)>,
}

/// Generates the modules of `names`, or of all models and systems, and the indices of all.
///
/// With `check` nothing is written and every difference is an error.
///
/// # Errors
/// The problems of all models together; [`Error::Stale`] when checking. On an error nothing has been written.
pub(crate) fn generate(
    repository: &Repository,
    session: &Session,
    names: &[String],
    check: bool,
) -> Result<Summary, Error> {
    let start = Instant::now();
    let systems = systems::systems(repository, session)?;
    let (of_systems, of_models): (Vec<String>, Vec<String>) =
        names.iter().cloned().partition(|name| systems.iter().any(|system| system.name == *name));
    let mut plans = Vec::new();
    let mut derived = Derived::default();
    if names.is_empty() || !of_models.is_empty() {
        let plan;
        (plan, derived) = of_repository(repository, session, &of_models)?;
        plans.push(plan);
    }
    if names.is_empty() || !of_systems.is_empty() {
        let folder = repository.root().join(systems::MODULES);
        derived.n_models += systems.len();
        let bundle = systems::generate(systems, COMMAND)?;
        bundle.warnings.iter().for_each(show_warnings);
        let stale = stale_files(&folder, bundle.entries.iter())?;
        plans.push(Plan { folder, bundle, stale });
    }
    if check {
        let wrong = |path: &Path| if path.is_file() { "is out of date" } else { "is missing" };
        let shown = |path: &Path| PathBuf::from(repository.shown(path));
        let mut files: Vec<(PathBuf, &'static str)> = Vec::new();
        for Plan { folder, bundle, stale } in &plans {
            files.extend(bundle.changed(folder).iter().map(|(path, _)| (shown(path), wrong(path))));
            files.extend(stale.iter().map(|path| (shown(path), "belongs to no scene")));
        }
        if !files.is_empty() {
            let command = [COMMAND].into_iter().chain(names.iter().map(String::as_str));
            return Err(Error::Stale { files, command: command.collect::<Vec<_>>().join(" ") });
        }
    }
    let (mut written, mut removed, mut n_modules) = (Vec::new(), Vec::new(), 0);
    for Plan { folder, bundle, stale } in plans {
        n_modules += bundle.entries.len();
        if !check {
            written.extend(bundle.write(&folder)?);
            for path in &stale {
                std::fs::remove_file(path).map_err(|e| Error::io(repository.shown(path), e))?;
            }
        }
        removed.extend(stale);
    }
    let Derived { n_models, slowest } = derived;
    Ok(Summary { n_models, n_modules, written, removed, seconds: start.elapsed().as_secs_f64(), slowest })
}

/// What a folder of modules is to be.
struct Plan {
    folder: PathBuf,
    bundle: Bundle,
    /// Files that no longer stand for a scene.
    stale: Vec<PathBuf>,
}

/// Which models were derived.
#[derive(Default)]
struct Derived {
    n_models: usize,
    /// The one that took longest, with its seconds.
    slowest: Option<(String, f64)>,
}

/// The modules of `names`, or of all models of the repository, and the index of all.
fn of_repository(
    repository: &Repository,
    session: &Session,
    names: &[String],
) -> Result<(Plan, Derived), Error> {
    let all = session.compiled()?;
    let known: Vec<String> = all.iter().map(|file| file.name().to_owned()).collect();
    let unknown = names.iter().filter(|name| !known.contains(name));
    let unknown = unknown.map(|name| Error::UnknownModel { name: name.clone(), known: known.clone() });
    Error::all_of(unknown.collect())?;
    let folder = repository.root().join("models/src/generated");
    // Models that were not asked for keep their entries in the index; those without entries are generated too, so that
    // the index covers all.
    let kept: Vec<Entry> = if names.is_empty() {
        Vec::new()
    } else {
        let is_kept = |e: &Entry| {
            known.contains(&e.model)
                && !names.contains(&e.model)
                && folder.join(format!("{}.rs", e.module)).is_file()
        };
        read_index(&folder.join("mod.rs")).into_iter().filter(is_kept).collect()
    };
    let is_chosen = |file: &ModelFile<'_>| {
        names.is_empty()
            || names.iter().any(|n| n == file.name())
            || !kept.iter().any(|e| e.model == file.name())
    };
    let (mut models, mut errors) = (Vec::new(), Vec::new());
    for file in all.into_iter().filter(is_chosen) {
        match file.into_model() {
            Ok(model) => models.push(model),
            Err(error) => errors.push(error),
        }
    }
    // The others are derived all the same, so that the problems of all models are told.
    let (generated, slowest) = generate_all(&models);
    let mut bundle = match generated {
        Ok(bundle) => bundle,
        Err(problems) => {
            errors.push(problems.into());
            Bundle::default()
        }
    };
    Error::all_of(errors)?;
    bundle.warnings.iter().for_each(show_warnings);
    bundle.add_index(&kept, COMMAND)?;
    let stale = stale_files(&folder, bundle.entries.iter().chain(&kept))?;
    Ok((Plan { folder, bundle, stale }, Derived { n_models: models.len(), slowest }))
}

/// All scenes of the models under a progress bar, and the model that took longest, with its seconds.
fn generate_all(models: &[Model]) -> (Result<Bundle, Problems>, Option<(String, f64)>) {
    let bar = if hamel_run::signs::are_shown() && !models.is_empty() {
        let bar = ProgressBar::new(models.len() as u64);
        let template = "  {bar:40.cyan/blue} {pos}/{len} models  {msg}";
        // The template is a constant that indicatif accepts.
        bar.set_style(ProgressStyle::with_template(template).expect("valid template"));
        bar
    } else {
        ProgressBar::hidden()
    };
    let times: Mutex<Vec<(String, f64)>> = Mutex::new(Vec::new());
    let bundle = Config::new().command(COMMAND).generate_with(models, &|progress| match progress {
        Progress::Begun { model } => bar.set_message(model.to_owned()),
        Progress::Done { model, elapsed } => {
            bar.inc(1);
            let mut times = times.lock().unwrap_or_else(PoisonError::into_inner);
            times.push((model.to_owned(), elapsed.as_secs_f64()));
        }
        _ => {}
    });
    bar.finish_and_clear();
    let times = times.into_inner().unwrap_or_else(PoisonError::into_inner);
    (bundle, times.into_iter().max_by(|(_, a), (_, b)| a.total_cmp(b)))
}

/// The entries of an index written earlier; none when there is no such file.
fn read_index(path: &Path) -> Vec<Entry> {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let mut docs: BTreeMap<String, String> = BTreeMap::new();
    let mut doc: Vec<&str> = Vec::new();
    let mut entries = Vec::new();
    for line in text.lines() {
        let line = line.trim();
        if let Some(words) = line.strip_prefix("///") {
            doc.push(words.trim());
            continue;
        }
        if let Some(module) = line.strip_prefix("pub mod ").and_then(|l| l.strip_suffix(';')) {
            docs.insert(module.to_owned(), doc.join("\n"));
        }
        doc.clear();
        let Some(inner) = line.strip_prefix('(').and_then(|l| l.strip_suffix(')')) else { continue };
        let parts: Vec<&str> = inner.split(',').map(|part| part.trim().trim_matches('"')).collect();
        if let [module, model, scene, n_state] = parts[..]
            && let Ok(n_state) = n_state.parse()
        {
            entries.push(Entry {
                module: module.into(),
                model: model.into(),
                scene: scene.into(),
                n_state,
                doc: docs.get(module).cloned().unwrap_or_default(),
            });
        }
    }
    entries
}

/// Generated files that no entry of the index stands for.
///
/// A file without the first line of generated files was written by somebody and stays.
fn stale_files<'a>(folder: &Path, entries: impl Iterator<Item = &'a Entry>) -> Result<Vec<PathBuf>, Error> {
    let modules: BTreeSet<&str> = entries.map(|e| e.module.as_str()).collect();
    let mut stale = Vec::new();
    let Ok(listing) = std::fs::read_dir(folder) else { return Ok(stale) };
    for file in listing {
        let path = file.map_err(|e| Error::io(folder.display().to_string(), e))?.path();
        let (Some(stem), true) =
            (path.file_stem().and_then(|s| s.to_str()), path.extension().is_some_and(|e| e == "rs"))
        else {
            continue;
        };
        if stem == "mod" || modules.contains(stem) {
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        if text.starts_with("// @generated by hamel ") {
            stale.push(path);
        }
    }
    stale.sort();
    Ok(stale)
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod index_tests {
    use super::read_index;

    #[test]
    fn an_index_is_read_back() {
        let folder = std::env::temp_dir().join(format!("hamel-index-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("mod.rs");
        let text = "// @generated by hamel 0.1.0: cargo xtask generate\n/// Heavy top\npub mod heavy_top;\n\
                    /// Heavy top\npub mod heavy_top_lagrange;\n\n#[macro_export]\nmacro_rules! for_each_scene {\n    \
                    ($visit:ident) => {\n        $visit! {\n            (heavy_top, \"heavy_top\", \"default\", 6)\n\
                    \x20           (heavy_top_lagrange, \"heavy_top\", \"lagrange\", 6)\n        }\n    };\n}\n";
        std::fs::write(&path, text).unwrap();
        let entries = read_index(&path);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(entries.len(), 2);
        assert_eq!(
            (entries[1].module.as_str(), entries[1].scene.as_str()),
            ("heavy_top_lagrange", "lagrange")
        );
        assert_eq!((entries[0].n_state, entries[0].doc.as_str()), (6, "Heavy top"));
    }
}
