//! Files of a release, as an archive and as a tree.
//!
//! Archives have the same bytes whenever the files have: no times, no owners. Does not know: which files there are.

use std::fs;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;
use hamel_run::Error;

/// A file below a prefix.
#[derive(Debug)]
pub(super) struct Entry {
    path: String,
    bytes: Vec<u8>,
    is_program: bool,
}

impl Entry {
    pub(super) fn file(path: &str, bytes: Vec<u8>) -> Entry {
        Entry { path: path.to_owned(), bytes, is_program: false }
    }

    pub(super) fn program(path: &str, bytes: Vec<u8>) -> Entry {
        Entry { path: path.to_owned(), bytes, is_program: true }
    }

    /// In bytes.
    pub(super) fn size(&self) -> usize {
        self.bytes.len()
    }

    fn mode(&self) -> u32 {
        if self.is_program { 0o755 } else { 0o644 }
    }
}

/// Writes files below a folder into a compressed archive.
///
/// # Errors
/// [`Error::Io`].
pub(super) fn write(path: &Path, folder: &str, entries: &[Entry]) -> Result<(), Error> {
    let fail = |e| Error::io(path.display().to_string(), e);
    let file = fs::File::create(path).map_err(fail)?;
    let mut archive = tar::Builder::new(GzEncoder::new(file, Compression::best()));
    for entry in entries {
        let mut header = tar::Header::new_gnu();
        header.set_size(entry.bytes.len() as u64);
        header.set_mode(entry.mode());
        header.set_mtime(0);
        let name = format!("{folder}/{}", entry.path);
        archive.append_data(&mut header, name, entry.bytes.as_slice()).map_err(fail)?;
    }
    let file = archive.into_inner().and_then(GzEncoder::finish).map_err(fail)?;
    file.sync_all().map_err(fail)
}

/// Writes files below a folder.
///
/// # Errors
/// [`Error::Io`].
pub(super) fn lay_out(folder: &Path, entries: &[Entry]) -> Result<(), Error> {
    for entry in entries {
        let path: PathBuf = folder.join(&entry.path);
        let fail = |e| Error::io(path.display().to_string(), e);
        if let Some(parent) = path.parent() {
            fs::create_dir_all(parent).map_err(fail)?;
        }
        fs::write(&path, &entry.bytes).map_err(fail)?;
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt as _;
            fs::set_permissions(&path, fs::Permissions::from_mode(entry.mode())).map_err(fail)?;
        }
    }
    Ok(())
}

/// Removes a folder where it is there.
///
/// # Errors
/// [`Error::Io`].
pub(super) fn remove(folder: &Path) -> Result<(), Error> {
    match fs::remove_dir_all(folder) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(folder.display().to_string(), e)),
        _ => Ok(()),
    }
}

/// An empty folder.
///
/// # Errors
/// [`Error::Io`].
pub(super) fn clear(folder: &Path) -> Result<(), Error> {
    remove(folder)?;
    fs::create_dir_all(folder).map_err(|e| Error::io(folder.display().to_string(), e))
}

#[cfg(test)]
mod tests {
    use super::{Entry, write};

    #[test]
    fn archives_have_the_same_bytes_twice_and_what_was_put_in() {
        let folder = std::env::temp_dir().join(format!("hamel-archive-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let entries =
            [Entry::program("bin/a", b"program".to_vec()), Entry::file("share/b", b"text".to_vec())];
        let [one, two] = ["one", "two"].map(|name| {
            let path = folder.join(name);
            write(&path, "a-1", &entries).expect("an archive");
            std::fs::read(path).expect("a file")
        });
        assert_eq!(one, two);
        let mut archive = tar::Archive::new(flate2::read::GzDecoder::new(one.as_slice()));
        let found: Vec<(String, u32, u64)> = archive
            .entries()
            .expect("entries")
            .map(|entry| {
                let entry = entry.expect("an entry");
                let header = entry.header();
                let path = entry.path().expect("a path").display().to_string();
                (path, header.mode().expect("a mode"), header.size().expect("a size"))
            })
            .collect();
        assert_eq!(found, [("a-1/bin/a".to_owned(), 0o755, 7), ("a-1/share/b".to_owned(), 0o644, 4)]);
        std::fs::remove_dir_all(&folder).expect("the folder");
    }
}
