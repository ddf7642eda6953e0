//! Files and folders that are there until they take their place, and gone if they never do.
//!
//! Does not know: what is written.

use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// All that are there now, for a program that is interrupted.
static PRESENT: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn present() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    PRESENT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file or folder beside the place that it will take.
#[derive(Debug)]
pub struct Temporary(PathBuf);

impl Temporary {
    /// A name in the same folder, which is not there yet.
    pub fn beside(path: &Path) -> Temporary {
        Temporary::at(name_beside(path))
    }

    /// The same for a file that this process writes once.
    ///
    /// # Errors
    /// [`io::ErrorKind::AlreadyExists`] where the process writes it already, [`io::ErrorKind::IsADirectory`] for a
    /// folder, whose place a file cannot take.
    pub fn once_beside(path: &Path) -> io::Result<Temporary> {
        if path.is_dir() {
            let reason = "it is a folder: give the name of a file";
            return Err(io::Error::new(io::ErrorKind::IsADirectory, reason));
        }
        let path = name_beside(path);
        if !present().insert(path.clone()) {
            let reason = "the file is given twice: give it once";
            return Err(io::Error::new(io::ErrorKind::AlreadyExists, reason));
        }
        Ok(Temporary(path))
    }

    /// A path, which is not there yet.
    pub fn at(path: PathBuf) -> Temporary {
        present().insert(path.clone());
        Temporary(path)
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Moves it to its place.
    ///
    /// # Errors
    /// Those of the file system; it is removed then.
    pub fn rename_to(self, path: &Path) -> io::Result<()> {
        std::fs::rename(&self.0, path)
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        remove(&self.0);
        present().remove(&self.0);
    }
}

fn name_beside(path: &Path) -> PathBuf {
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or("file");
    // WebAssembly has one process, and no number for it.
    let process = if cfg!(target_family = "wasm") { 0 } else { std::process::id() };
    path.with_file_name(format!(".{name}.{process}.tmp"))
}

/// Removes all of this process, which ends now.
pub fn remove_all() {
    present().iter().for_each(|path| remove(path));
}

fn remove(path: &Path) {
    // Gone where it has taken its place.
    if path.is_dir() {
        let _ = std::fs::remove_dir_all(path);
    } else {
        let _ = std::fs::remove_file(path);
    }
}
