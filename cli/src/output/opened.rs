//! A file that is written at the end of some work, and opened before it: what cannot be written costs no work.
//!
//! Does not know: what is written.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use hamel_run::error::Error;
use hamel_run::temporary::Temporary;

/// Says at once whether files can be written to a folder, which is made with them where it is not there.
///
/// # Errors
/// [`Error::Io`] for a file at its place, and for a folder that takes no files.
pub(crate) fn writable(folder: &Path) -> Result<(), Error> {
    let there = folder.ancestors().find(|path| path.as_os_str().is_empty() || path.exists());
    let there = there.filter(|path| !path.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let fail = |e| Error::io(there.display().to_string(), e);
    if !there.is_dir() {
        return Err(fail(std::io::ErrorKind::NotADirectory.into()));
    }
    let temporary = Temporary::once_beside(&there.join("written")).map_err(fail)?;
    File::create(temporary.path()).map(drop).map_err(fail)
}

/// A file beside the place that it takes when it is written.
#[derive(Debug)]
pub(crate) struct Opened {
    path: PathBuf,
    temporary: Temporary,
    file: File,
}

impl Opened {
    /// Opens a file; what is at its place stays until it is written.
    ///
    /// # Errors
    /// [`Error::NoFolder`]; [`Error::Io`], also for a folder and for a file that is open already.
    pub(crate) fn new(path: &Path) -> Result<Opened, Error> {
        let shown = path.display().to_string();
        if let Some(folder) =
            path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir())
        {
            return Err(Error::NoFolder { file: shown, folder: folder.display().to_string() });
        }
        let fail = |e| Error::io(shown.clone(), e);
        let temporary = Temporary::once_beside(path).map_err(fail)?;
        let file = File::create(temporary.path()).map_err(fail)?;
        Ok(Opened { path: path.to_owned(), temporary, file })
    }

    /// As [`Opened::new`] for a text that people go on with: one that is there stays, unless by force.
    ///
    /// # Errors
    /// As [`Opened::new`]; [`Error::Request`] for a file that is there and not empty.
    pub(crate) fn new_text(path: &Path, by_force: bool) -> Result<Opened, Error> {
        if !by_force && std::fs::metadata(path).is_ok_and(|there| there.is_file() && there.len() > 0) {
            let shown = path.display().to_string();
            return Err(Error::unusable(shown, "is there: give another name, or add --force to replace it"));
        }
        Opened::new(path)
    }

    /// Where it will be.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Where it is until then.
    pub(crate) fn temporary(&self) -> &Path {
        self.temporary.path()
    }

    /// Writes all of it and puts it into its place.
    ///
    /// # Errors
    /// [`Error::Io`]; what was at its place is there still.
    pub(crate) fn write(mut self, bytes: &[u8]) -> Result<(), Error> {
        let written = self.file.write_all(bytes).and_then(|()| self.file.flush());
        written.map_err(|e| Error::io(self.path.display().to_string(), e))?;
        self.place()
    }

    /// Puts what was written to [`Opened::temporary`] into its place.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn place(self) -> Result<(), Error> {
        let Opened { path, temporary, file } = self;
        drop(file);
        temporary.rename_to(&path).map_err(|e| Error::io(path.display().to_string(), e))
    }
}
