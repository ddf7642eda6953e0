//! What was derived once, kept in the user's cache folder.
//!
//! A value is kept under a hash of everything that it depends on: what decides of the model's text, what was made of
//! it, the budget, and which program it was, so that another version never reads it.
//!
//! Does not know: what is kept.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::SystemTime;

use hamel_codegen::config::store::{Key, Store};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Bytes of all files together.
const MAX_BYTES: u64 = 256_000_000;

/// A folder of values, or none.
#[derive(Clone, Debug)]
pub struct Cache {
    store: Option<Store>,
    /// The file whose code makes the values, where it is not the program itself.
    library: Option<PathBuf>,
}

impl Cache {
    /// Keeps nothing.
    pub fn none() -> Cache {
        Cache { store: None, library: None }
    }

    /// Keeps values in a folder, which is made when the first is kept.
    pub fn at(folder: impl Into<PathBuf>) -> Cache {
        Cache { store: Some(Store::new(folder, MAX_BYTES)), library: None }
    }

    /// Keeps values in the folder that `HAMEL_CACHE_DIR` names, otherwise where the system wants such files; nowhere
    /// when it does not say.
    pub fn of_user() -> Cache {
        let folder = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
        let own = std::env::var_os("HAMEL_CACHE_DIR").filter(|path| !path.is_empty()).map(PathBuf::from);
        let of_system = || match std::env::consts::OS {
            "windows" => folder("LOCALAPPDATA").map(|data| data.join("hamel").join("cache")),
            "macos" => folder("HOME").map(|home| home.join("Library/Caches/hamel")),
            _ => {
                let caches = folder("XDG_CACHE_HOME").or_else(|| Some(folder("HOME")?.join(".cache")));
                caches.map(|caches| caches.join("hamel"))
            }
        };
        own.or_else(of_system).map_or_else(Cache::none, Cache::at)
    }

    /// For a library that another program has loaded, such as a module of Python: `file` has the code.
    #[must_use]
    pub fn of_library(self, file: impl Into<PathBuf>) -> Cache {
        Cache { library: Some(file.into()), ..self }
    }

    /// The value that was kept under a key and that `is_sound`, or the one that `make` makes, which is kept then.
    ///
    /// A cache that cannot be read or written costs time and nothing else.
    ///
    /// # Errors
    /// That of `make`; nothing is kept.
    pub fn get_or_make<T: Serialize + DeserializeOwned, E>(
        &self,
        key: &[&str],
        is_sound: impl FnOnce(&T) -> bool,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        let Some(store) = &self.store else { return make() };
        let stamp = match &self.library {
            Some(library) => stamp(library),
            None => program().map(str::to_owned),
        };
        let Some(program) = stamp else { return make() };
        let key = Key::of(&(env!("CARGO_PKG_VERSION"), program, key));
        let kept = store.read(key).and_then(|text| serde_json::from_str(&text).ok());
        if let Some(value) = kept.filter(is_sound) {
            return Ok(value);
        }
        let value = make()?;
        if let Ok(text) = serde_json::to_string(&value) {
            store.keep(key, &text);
        }
        Ok(value)
    }
}

/// What tells this program from another one of the same version, as there are many while hamel is developed.
fn program() -> Option<&'static str> {
    static STAMP: OnceLock<Option<String>> = OnceLock::new();
    STAMP.get_or_init(|| stamp(&std::env::current_exe().ok()?)).as_deref()
}

/// What tells a file from another one: its path, its size and when it was written. Its bytes would tell as much, but
/// reading all of them takes longer than most answers.
fn stamp(path: &Path) -> Option<String> {
    let data = std::fs::metadata(path).ok()?;
    let written = data.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    Some(format!("{} {} {}", path.display(), data.len(), written.as_nanos()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn get(cache: &Cache, key: &[&str], value: i32) -> i32 {
        cache.get_or_make::<i32, ()>(key, |kept| *kept > 0, || Ok(value)).unwrap()
    }

    #[test]
    fn a_value_is_made_once_for_each_key() {
        let folder = std::env::temp_dir().join(format!("hamel-cache-once-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        let cache = Cache::at(&folder);
        assert_eq!([get(&cache, &["a", "b"], 1), get(&cache, &["a", "b"], 2)], [1, 1]);
        // Where a part ends matters.
        assert_eq!([get(&cache, &["ab", ""], 3), get(&cache, &["a", "c"], 4)], [3, 4]);
        assert_eq!(cache.get_or_make::<i32, &str>(&["wrong"], |_| true, || Err("why")), Err("why"));
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 3);
        assert_eq!([get(&Cache::none(), &["a", "b"], 5), get(&Cache::none(), &["a", "b"], 6)], [5, 6]);
        // What is no value of that type is made anew.
        let text = || Ok("text".into());
        assert_eq!(cache.get_or_make::<String, ()>(&["a", "b"], |_| true, text), Ok("text".into()));
        // So is what is not sound.
        assert_eq!([get(&cache, &["c"], -1), get(&cache, &["c"], 2), get(&cache, &["c"], 3)], [-1, 2, 2]);
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn another_library_makes_values_of_its_own() {
        let folder = std::env::temp_dir().join(format!("hamel-cache-library-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        let library = folder.join("library");
        let cache = Cache::at(folder.join("kept")).of_library(&library);
        // Without the file nobody knows whose values they would be.
        assert_eq!([get(&cache, &["a"], 1), get(&cache, &["a"], 2)], [1, 2]);
        std::fs::write(&library, "one").unwrap();
        assert_eq!([get(&cache, &["a"], 3), get(&cache, &["a"], 4)], [3, 3]);
        std::fs::write(&library, "another").unwrap();
        assert_eq!(get(&cache, &["a"], 5), 5);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
