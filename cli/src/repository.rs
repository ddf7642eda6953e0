//! hamel's own repository: its model files, and cargo for what is built from it.
//!
//! Does not know: what is in a model file.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::error::Error;

/// The repository's root directory.
#[derive(Clone, Debug)]
pub struct Repository {
    root: PathBuf,
}

impl Repository {
    /// The repository that a folder is in.
    pub fn around(folder: &Path) -> Option<Repository> {
        // Both together are in no other repository: model files, and the package of the chores.
        let is_root = |at: &&Path| at.join("models/specs").is_dir() && at.join("xtask/Cargo.toml").is_file();
        folder.ancestors().find(is_root).map(Repository::at)
    }

    /// A repository at a given place.
    pub fn at(root: impl Into<PathBuf>) -> Repository {
        Repository { root: root.into() }
    }

    /// The root directory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The workspace's manifest.
    pub fn manifest(&self) -> PathBuf {
        self.root.join("Cargo.toml")
    }

    /// Directory of the model files.
    pub fn specs_folder(&self) -> PathBuf {
        self.root.join("models/specs")
    }

    /// Directory of the model files that are not compiled.
    pub fn shelf_folder(&self) -> PathBuf {
        self.root.join("models/shelf")
    }

    /// A path as shown to people: relative to the repository when it is inside.
    pub fn shown(&self, path: &Path) -> String {
        path.strip_prefix(&self.root).unwrap_or(path).display().to_string()
    }

    /// The cargo that started this program, otherwise the one in the path.
    pub fn cargo() -> OsString {
        std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
    }

    /// Names and paths of the model files that are compiled, sorted.
    ///
    /// # Errors
    /// [`Error::Io`] when the directory cannot be read.
    pub fn specs(&self) -> Result<Vec<(String, PathBuf)>, Error> {
        Repository::models_in(&self.specs_folder())
    }

    /// Names and paths of the model files that are not, sorted; none where there is no such folder.
    ///
    /// # Errors
    /// [`Error::Io`] when the directory cannot be read.
    pub fn shelf(&self) -> Result<Vec<(String, PathBuf)>, Error> {
        let folder = self.shelf_folder();
        if folder.is_dir() { Repository::models_in(&folder) } else { Ok(Vec::new()) }
    }

    fn models_in(folder: &Path) -> Result<Vec<(String, PathBuf)>, Error> {
        let fail = |e| Error::io(folder.display().to_string(), e);
        let mut specs = Vec::new();
        for entry in std::fs::read_dir(folder).map_err(fail)? {
            let path = entry.map_err(fail)?.path();
            if path.extension().is_some_and(|e| e == "hamel")
                && let Some(name) = path.file_stem().and_then(|s| s.to_str())
            {
                specs.push((name.to_owned(), path.clone()));
            }
        }
        specs.sort();
        Ok(specs)
    }
}
