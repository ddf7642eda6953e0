//! Where things are: the repository, its model files, cargo.
//!
//! Deliberately does not know: what is in a model file.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::error::Error;

/// The repository's root directory.
#[derive(Clone, Debug)]
pub struct Workspace {
    root: PathBuf,
}

/// A model file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Spec {
    /// Name of the model: the file's, without extension.
    pub name: String,
    /// The file.
    pub path: PathBuf,
    /// Whether it is one of the repository's, so that it may have been generated.
    pub in_repository: bool,
}

impl Workspace {
    /// The repository that this program was started from, otherwise the one it was built in.
    ///
    /// # Errors
    /// [`Error::Io`] when neither is there any more.
    pub fn find() -> Result<Workspace, Error> {
        let started = std::env::var_os("CARGO_MANIFEST_DIR").map(PathBuf::from);
        let built = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
        for package in started.into_iter().chain([built]) {
            if let Some(root) = package.parent()
                && root.join("models/specs").is_dir()
            {
                return Ok(Workspace { root: root.to_owned() });
            }
        }
        let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
        Err(Error::io("models/specs: start this program with `cargo xtask` in the repository", missing))
    }

    /// A repository at a given place.
    pub fn at(root: impl Into<PathBuf>) -> Workspace {
        Workspace { root: root.into() }
    }

    /// The root directory.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// The workspace's manifest.
    pub fn manifest(&self) -> PathBuf {
        self.root.join("Cargo.toml")
    }

    /// Directory of the generated modules.
    pub fn generated(&self) -> PathBuf {
        self.root.join("models/src/generated")
    }

    /// Directory of the model files.
    pub fn specs_folder(&self) -> PathBuf {
        self.root.join("models/specs")
    }

    /// A path as shown to people: relative to the repository when it is inside.
    pub fn shown(&self, path: &Path) -> String {
        path.strip_prefix(&self.root).unwrap_or(path).display().to_string()
    }

    /// The cargo that started this program, otherwise the one in the path.
    pub fn cargo() -> OsString {
        std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
    }

    /// All model files of the repository by name.
    ///
    /// # Errors
    /// [`Error::Io`] when the directory cannot be read.
    pub fn specs(&self) -> Result<Vec<Spec>, Error> {
        let folder = self.specs_folder();
        let fail = |e| Error::io(folder.display().to_string(), e);
        let mut specs = Vec::new();
        for entry in std::fs::read_dir(&folder).map_err(fail)? {
            let path = entry.map_err(fail)?.path();
            if path.extension().is_some_and(|e| e == "hamel")
                && let Some(name) = path.file_stem().and_then(|s| s.to_str())
            {
                specs.push(Spec { name: name.to_owned(), path: path.clone(), in_repository: true });
            }
        }
        specs.sort();
        Ok(specs)
    }

    /// The model file for an argument: a model's name, or a path that ends in `.hamel`.
    ///
    /// # Errors
    /// [`Error::UnknownModel`] with the models there are; [`Error::Io`] for a path that is no file.
    pub fn spec(&self, argument: &str) -> Result<Spec, Error> {
        if argument.ends_with(".hamel") {
            let path = PathBuf::from(argument);
            let real = path.canonicalize().map_err(|e| Error::io(argument, e))?;
            let folder = self.specs_folder();
            let in_repository =
                folder.canonicalize().is_ok_and(|folder| real.parent() == Some(folder.as_path()));
            let name = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default().to_owned();
            return Ok(Spec { name, path, in_repository });
        }
        let specs = self.specs()?;
        let known = specs.iter().map(|s| s.name.clone()).collect();
        specs
            .into_iter()
            .find(|s| s.name == argument)
            .ok_or_else(|| Error::UnknownModel { name: argument.to_owned(), known })
    }
}
