//! Files that another file names, from its folder.
//!
//! Does not know: their contents.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hamel_lang::spec::{Diagnostics, Origin, compose};

/// The text of a file with the texts of its parts, `use "motor.hamel" as motor;`, which is read as a model.
///
/// # Errors
/// As [`compose`].
pub fn compose_file(shown: &str, path: &Path, text: String) -> Result<String, Diagnostics> {
    let mut files = Files::of(shown, path);
    let origin = Origin { file: shown.to_owned(), text };
    compose(origin, &mut |here, file| files.read(here, file)).map(|whole| whole.text)
}

/// Files by the names that they are shown by, which may not be their paths.
pub(crate) struct Files(BTreeMap<String, PathBuf>);

impl Files {
    pub(crate) fn of(shown: &str, path: &Path) -> Files {
        Files(BTreeMap::from([(shown.to_owned(), path.to_owned())]))
    }

    /// A file that another one names.
    pub(crate) fn read(&mut self, here: &str, file: &str) -> Result<Origin, String> {
        let beside = |path: &Path| path.parent().unwrap_or(Path::new("")).join(file);
        let path = beside(self.0.get(here).map_or(Path::new(here), PathBuf::as_path));
        let text = std::fs::read_to_string(&path).map_err(|e| e.to_string())?;
        let shown = beside(Path::new(here)).display().to_string();
        self.0.insert(shown.clone(), path);
        Ok(Origin { file: shown, text })
    }
}
