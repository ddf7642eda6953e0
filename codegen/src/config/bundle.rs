//! Generated files before and after they are written.
//!
//! Does not know: how their texts were made.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use super::problems::{Problem, Problems};
use crate::emit::{self, SceneEntry};
use crate::error::Error;
use crate::spec::Diagnostics;

/// Generated files by name, not written yet.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bundle {
    /// Name of each file and its whole text.
    pub files: BTreeMap<String, String>,
    /// The scenes, by module.
    pub entries: Vec<SceneEntry>,
    /// For each model whose defaults make no motion in some scene: what
    /// [`scene::warnings`](crate::scene::warnings) says.
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

pub(super) fn emission(model: &str, source: Error) -> Problem {
    Problem::Emission { model: model.to_owned(), source: Box::new(source) }
}

pub(super) fn unique(entries: &[SceneEntry]) -> Result<(), Problem> {
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
    // WebAssembly has one process, and no number for it.
    let process = if cfg!(target_family = "wasm") { 0 } else { std::process::id() };
    let temporary = path.with_file_name(format!(".{name}.{process}.tmp"));
    let moved = std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, path));
    if moved.is_err() {
        let _ = std::fs::remove_file(&temporary);
    }
    moved
}
