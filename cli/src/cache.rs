//! What was derived once, kept in the user's cache folder.
//!
//! A value is kept under a hash of everything that it depends on: the text of the model, what was made of it, the
//! budget, and which program it was, so that another version never reads it. The file begins with a line that repeats
//! that hash and has one of the value, so that a file that is damaged, or somebody else's, is made anew.
//!
//! Does not know: what is kept.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::SystemTime;

use hamel_codegen::config::write_atomically;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Bytes of all files together; the ones that were not used for longest go first.
const MAX_BYTES: u64 = 256_000_000;
/// The ending of files that are the cache's own.
const ENDING: &str = "hamel-cache";

/// A folder of values, or none.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: Option<PathBuf>,
}

impl Cache {
    /// Keeps nothing.
    pub fn none() -> Cache {
        Cache { folder: None }
    }

    /// Keeps values in a folder, which is made when the first is kept.
    pub fn at(folder: impl Into<PathBuf>) -> Cache {
        Cache { folder: Some(folder.into()) }
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
        Cache { folder: own.or_else(of_system) }
    }

    /// The value that was kept under a key, or the one that `make` makes, which is kept then.
    ///
    /// A cache that cannot be read or written costs time and nothing else.
    ///
    /// # Errors
    /// That of `make`; nothing is kept.
    pub fn get_or_make<T: Serialize + DeserializeOwned, E>(
        &self,
        key: &[&str],
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        let Some(folder) = &self.folder else { return make() };
        let Some(program) = program() else { return make() };
        let mut parts = vec![env!("CARGO_PKG_VERSION").as_bytes(), program.as_bytes()];
        parts.extend(key.iter().map(|part| part.as_bytes()));
        let key = digest(&parts);
        let path = folder.join(format!("{key}.{ENDING}"));
        if let Some(value) = read(&path, &key) {
            return Ok(value);
        }
        let value = make()?;
        if let Ok(text) = serde_json::to_string(&value) {
            keep(folder, &path, &key, &text);
        }
        Ok(value)
    }
}

/// The value in a file, if it is whole and the one that is looked for.
fn read<T: DeserializeOwned>(path: &Path, key: &str) -> Option<T> {
    let text = std::fs::read_to_string(path).ok()?;
    let (head, body) = text.split_once('\n')?;
    if head != self::head(key, body) {
        return None;
    }
    let value = serde_json::from_str(body).ok()?;
    // Used now. Whether that can be noted is no matter.
    let _ = std::fs::File::options().append(true).open(path).and_then(|f| f.set_modified(SystemTime::now()));
    Some(value)
}

fn head(key: &str, body: &str) -> String {
    format!("hamel {key} {}", digest(&[body.as_bytes()]))
}

/// Writes a file, and removes the oldest ones when there is too much.
fn keep(folder: &Path, path: &Path, key: &str, body: &str) {
    let text = format!("{}\n{body}", head(key, body));
    if std::fs::create_dir_all(folder).and_then(|()| write_atomically(path, text.as_bytes())).is_ok() {
        let _ = trim(folder, MAX_BYTES);
    }
}

/// Removes the files of the cache that were not used for longest until the others have at most `most` bytes.
fn trim(folder: &Path, most: u64) -> std::io::Result<()> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == ENDING)
            && let Ok(data) = std::fs::metadata(&path)
        {
            files.push((data.modified().unwrap_or(SystemTime::UNIX_EPOCH), data.len(), path));
        }
    }
    let mut total: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
    files.sort();
    for (_, bytes, path) in files {
        if total <= most {
            break;
        }
        std::fs::remove_file(path)?;
        total -= bytes;
    }
    Ok(())
}

/// What tells this program from another one of the same version, as there are many while hamel is developed: its path,
/// its size and when it was written. Its bytes would tell as much, but reading all of them takes longer than most
/// answers.
fn program() -> Option<&'static str> {
    static STAMP: OnceLock<Option<String>> = OnceLock::new();
    let of_file = || {
        let path = std::env::current_exe().ok()?;
        let data = std::fs::metadata(&path).ok()?;
        let written = data.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
        Some(format!("{} {} {}", path.display(), data.len(), written.as_nanos()))
    };
    STAMP.get_or_init(of_file).as_deref()
}

/// 128 bits in hexadecimal digits that depend on all bytes of all parts, and on where parts end.
///
/// Two chains `h' = mix(h xor word)` over words of eight bytes, whose `mix` are permutations with different factors in
/// which every bit of the result depends on every bit of the argument. What this has to tell apart are versions of
/// files, not what somebody made in order to collide.
fn digest(parts: &[&[u8]]) -> String {
    const FACTORS: [[u64; 2]; 2] =
        [[0xff51_afd7_ed55_8ccd, 0xc4ce_b9fe_1a85_ec53], [0xbf58_476d_1ce4_e5b9, 0x94d0_49bb_1331_11eb]];
    let mut chains = [0x243f_6a88_85a3_08d3_u64, 0x1319_8a2e_0370_7344];
    let mut take = |word: u64| {
        for (chain, [first, second]) in chains.iter_mut().zip(FACTORS) {
            let x = *chain ^ word;
            let x = (x ^ (x >> 32)).wrapping_mul(first);
            let x = (x ^ (x >> 29)).wrapping_mul(second);
            *chain = x ^ (x >> 32);
        }
    };
    for part in parts {
        take(part.len() as u64);
        let words = part.chunks_exact(8);
        let rest = words.remainder();
        // A chunk has eight bytes.
        words.for_each(|word| take(u64::from_le_bytes(word.try_into().unwrap_or_default())));
        let mut last = [0; 8];
        last[..rest.len()].copy_from_slice(rest);
        take(u64::from_le_bytes(last));
    }
    format!("{:016x}{:016x}", chains[0], chains[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Folder {
            let path = std::env::temp_dir().join(format!("hamel-cache-{name}-{}", std::process::id()));
            let _ = std::fs::remove_dir_all(&path);
            Folder(path)
        }

        fn files(&self) -> Vec<PathBuf> {
            let listing = std::fs::read_dir(&self.0).unwrap();
            let mut files: Vec<PathBuf> = listing.map(|file| file.unwrap().path()).collect();
            files.sort();
            files
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    fn get(cache: &Cache, key: &[&str], value: i32) -> i32 {
        cache.get_or_make::<i32, ()>(key, || Ok(value)).unwrap()
    }

    #[test]
    fn a_value_is_made_once_for_each_key() {
        let folder = Folder::new("once");
        let cache = Cache::at(&folder.0);
        assert_eq!([get(&cache, &["a", "b"], 1), get(&cache, &["a", "b"], 2)], [1, 1]);
        // Where a part ends matters.
        assert_eq!([get(&cache, &["ab", ""], 3), get(&cache, &["a", "c"], 4)], [3, 4]);
        assert_eq!(cache.get_or_make::<i32, &str>(&["wrong"], || Err("why")), Err("why"));
        assert_eq!(folder.files().len(), 3);
        assert_eq!([get(&Cache::none(), &["a", "b"], 5), get(&Cache::none(), &["a", "b"], 6)], [5, 6]);
    }

    #[test]
    fn what_is_damaged_or_of_another_is_made_anew() {
        let folder = Folder::new("damaged");
        let cache = Cache::at(&folder.0);
        get(&cache, &["a"], 1);
        let path = &folder.files()[0];
        let whole = std::fs::read_to_string(path).unwrap();
        for text in ["", "\n", &whole[..whole.len() - 1], &whole.replace("\n1", "\n7"), "hamel 0 0\n1"] {
            std::fs::write(path, text).unwrap();
            assert_eq!(get(&cache, &["a"], 1), 1, "{text:?}");
            assert_eq!(std::fs::read_to_string(path).unwrap(), whole);
        }
        std::fs::write(path, [0xff, 0xfe]).unwrap();
        assert_eq!(get(&cache, &["a"], 1), 1);
        // A file of another key under this name.
        get(&cache, &["b"], 2);
        let other = folder.files().into_iter().find(|file| file != path).unwrap();
        std::fs::copy(&other, path).unwrap();
        assert_eq!(get(&cache, &["a"], 1), 1);
    }

    #[test]
    fn a_folder_that_cannot_be_made_costs_nothing_but_time() {
        let folder = Folder::new("file");
        std::fs::write(&folder.0, "").unwrap();
        assert_eq!(get(&Cache::at(folder.0.join("below")), &["a"], 1), 1);
        let _ = std::fs::remove_file(&folder.0);
    }

    #[test]
    fn the_oldest_files_go_first_and_others_stay() {
        let folder = Folder::new("bounded");
        let cache = Cache::at(&folder.0);
        std::fs::create_dir_all(&folder.0).unwrap();
        std::fs::write(folder.0.join("mine.txt"), "of somebody else").unwrap();
        for key in ["a", "b", "c"] {
            get(&cache, &[key], 1);
        }
        let own: Vec<PathBuf> =
            folder.files().into_iter().filter(|f| f.extension().is_some_and(|e| e == ENDING)).collect();
        for (path, hours) in own.iter().zip([2, 3, 1]) {
            let then = SystemTime::now() - std::time::Duration::from_secs(3600 * hours);
            std::fs::File::options().append(true).open(path).unwrap().set_modified(then).unwrap();
        }
        let bytes = std::fs::metadata(&own[0]).unwrap().len();
        trim(&folder.0, 2 * bytes).unwrap();
        let left = folder.files();
        assert!(left.contains(&own[0]) && !left.contains(&own[1]) && left.contains(&own[2]), "{left:?}");
        assert!(left.iter().any(|f| f.ends_with("mine.txt")));
    }

    #[test]
    fn every_byte_counts() {
        let texts: Vec<Vec<u8>> = (0..40).map(|n| vec![7; n]).collect();
        let mut seen: Vec<String> = texts.iter().map(|text| digest(&[text])).collect();
        for at in 0..24 {
            for bit in 0..8 {
                let mut text = vec![7; 24];
                text[at] ^= 1 << bit;
                seen.push(digest(&[&text]));
            }
        }
        let n = seen.len();
        seen.sort();
        seen.dedup();
        assert_eq!(seen.len(), n);
    }
}
