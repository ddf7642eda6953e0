//! `generate`: model files to checked-in modules, all or nothing.
//!
//! Deliberately does not know: what is in a generated module, except the name of its model in the first line.

use std::collections::BTreeMap;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};

use crate::codegen_bridge::{self as bridge, Entry, Module};
use crate::error::Error;
use crate::workspace::{Spec, Workspace};

/// What a run did.
#[derive(Debug)]
pub struct Summary {
    /// Models that were derived.
    pub n_models: usize,
    /// Modules of these models.
    pub n_modules: usize,
    /// Files that were written.
    pub written: Vec<PathBuf>,
    /// Files that were removed.
    pub removed: Vec<PathBuf>,
    /// Seconds of the whole run.
    pub seconds: f64,
    /// The model that took longest, with its seconds.
    pub slowest: Option<(String, f64)>,
}

/// Generates the modules of `names`, or of all models, and the index of all.
///
/// With `check` nothing is written and every difference is an error.
///
/// # Errors
/// The problems of all models together; [`Error::Stale`] when checking. On an error nothing has been written.
pub fn generate(workspace: &Workspace, names: &[String], check: bool) -> Result<Summary, Error> {
    let start = Instant::now();
    let all = workspace.specs()?;
    let mut chosen: Vec<Spec> = Vec::new();
    let mut errors = Vec::new();
    for name in names {
        match all.iter().find(|s| s.name == *name) {
            Some(spec) if !chosen.contains(spec) => chosen.push(spec.clone()),
            Some(_) => {}
            None => errors.push(Error::UnknownModel {
                name: name.clone(),
                known: all.iter().map(|s| s.name.clone()).collect(),
            }),
        }
    }
    fail_on(errors)?;
    let folder = workspace.generated();
    // Models that were not asked for keep their entries in the index; those without entries are generated too, so that
    // the index covers all.
    let kept: Vec<Entry> = if names.is_empty() {
        Vec::new()
    } else {
        let is_kept = |e: &Entry| {
            let chosen = chosen.iter().any(|s| s.name == e.model);
            let known = all.iter().any(|s| s.name == e.model);
            known && !chosen && folder.join(format!("{}.rs", e.module)).is_file()
        };
        read_index(&folder.join("mod.rs")).into_iter().filter(is_kept).collect()
    };
    chosen = all
        .into_iter()
        .filter(|s| names.is_empty() || chosen.contains(s) || !kept.iter().any(|e| e.model == s.name))
        .collect();

    let results = derive_all(workspace, &chosen);
    let slowest = results
        .iter()
        .max_by(|a, b| a.seconds.total_cmp(&b.seconds))
        .map(|made| (made.name.clone(), made.seconds));
    let mut modules = Vec::new();
    let mut errors = Vec::new();
    for made in results {
        match made.modules {
            Ok(of_model) => modules.extend(of_model),
            Err(error) => errors.push(error),
        }
    }
    fail_on(errors)?;
    let n_modules = modules.len();

    let mut files: BTreeMap<String, String> = BTreeMap::new();
    let mut entries = kept;
    for Module { entry, text } in modules {
        if let Some(other) = entries.iter().find(|e| e.module == entry.module) {
            let scenes = [other, &entry].map(|e| format!("scene {} of {}", e.scene, e.model));
            return Err(Error::SameModule { module: entry.module, scenes });
        }
        files.insert(format!("{}.rs", entry.module), text);
        entries.push(entry);
    }
    entries.sort_by(|a, b| a.module.cmp(&b.module));
    files.insert("mod.rs".into(), bridge::emit_index(&entries)?);
    let stale = stale_files(&folder, &entries)?;

    let changed: Vec<(PathBuf, &String)> = files
        .iter()
        .map(|(name, text)| (folder.join(name), text))
        .filter(|(path, text)| std::fs::read(path).ok().as_deref() != Some(text.as_bytes()))
        .collect();
    if check {
        let wrong = |path: &Path| if path.is_file() { "is out of date" } else { "is missing" };
        let shown = |path: &Path| PathBuf::from(workspace.shown(path));
        let mut files: Vec<(PathBuf, &'static str)> =
            changed.iter().map(|(path, _)| (shown(path), wrong(path))).collect();
        files.extend(stale.iter().map(|path| (shown(path), "belongs to no scene")));
        if !files.is_empty() {
            let command = ["cargo xtask generate"].into_iter().chain(names.iter().map(String::as_str));
            return Err(Error::Stale { files, command: command.collect::<Vec<_>>().join(" ") });
        }
    } else {
        if !changed.is_empty() {
            std::fs::create_dir_all(&folder).map_err(|e| Error::io(workspace.shown(&folder), e))?;
        }
        for (path, text) in &changed {
            write_atomically(path, text.as_bytes())?;
        }
        for path in &stale {
            std::fs::remove_file(path).map_err(|e| Error::io(workspace.shown(path), e))?;
        }
    }
    Ok(Summary {
        n_models: chosen.len(),
        n_modules,
        written: changed.into_iter().map(|(path, _)| path).collect(),
        removed: stale,
        seconds: start.elapsed().as_secs_f64(),
        slowest,
    })
}

fn fail_on(mut errors: Vec<Error>) -> Result<(), Error> {
    match errors.len() {
        0 => Ok(()),
        1 => Err(errors.remove(0)),
        _ => Err(Error::Several { errors }),
    }
}

struct Made {
    name: String,
    modules: Result<Vec<Module>, Error>,
    seconds: f64,
}

/// Derives models side by side; results are in the order of `specs`.
fn derive_all(workspace: &Workspace, specs: &[Spec]) -> Vec<Made> {
    let bar = if std::io::stderr().is_terminal() && !specs.is_empty() {
        let bar = ProgressBar::new(specs.len() as u64);
        let template = "  {bar:40.cyan/blue} {pos}/{len} models  {msg}";
        // The template is a constant that indicatif accepts.
        bar.set_style(ProgressStyle::with_template(template).expect("valid template"));
        bar
    } else {
        ProgressBar::hidden()
    };
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, Made)>> = Mutex::new(Vec::new());
    let n_workers = std::thread::available_parallelism().map_or(1, usize::from).min(specs.len().max(1));
    std::thread::scope(|scope| {
        for _ in 0..n_workers {
            scope.spawn(|| {
                loop {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    let Some(spec) = specs.get(at) else { break };
                    bar.set_message(spec.name.clone());
                    let clock = Instant::now();
                    let modules = bridge::read(workspace, spec).and_then(|model| bridge::emit(&model));
                    let made =
                        Made { name: spec.name.clone(), modules, seconds: clock.elapsed().as_secs_f64() };
                    done.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((at, made));
                    bar.inc(1);
                }
            });
        }
    });
    bar.finish_and_clear();
    let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(at, _)| *at);
    done.into_iter().map(|(_, made)| made).collect()
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
fn stale_files(folder: &Path, entries: &[Entry]) -> Result<Vec<PathBuf>, Error> {
    let mut stale = Vec::new();
    let Ok(listing) = std::fs::read_dir(folder) else { return Ok(stale) };
    for file in listing {
        let path = file.map_err(|e| Error::io(folder.display().to_string(), e))?.path();
        let (Some(stem), true) =
            (path.file_stem().and_then(|s| s.to_str()), path.extension().is_some_and(|e| e == "rs"))
        else {
            continue;
        };
        if stem == "mod" || entries.iter().any(|e| e.module == stem) {
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

/// Writes a file such that it is there whole or not at all.
///
/// # Errors
/// [`Error::Io`].
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let fail = |e| Error::io(path.display().to_string(), e);
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("file");
    let temporary = path.with_file_name(format!(".{name}.{}.tmp", std::process::id()));
    let moved = std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, path));
    if moved.is_err() {
        let _ = std::fs::remove_file(&temporary);
    }
    moved.map_err(fail)
}

#[cfg(test)]
mod tests {
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
