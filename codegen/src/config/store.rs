//! Texts that were made once, in a folder, by what they were made from.
//!
//! A file begins with a line that repeats its key and has a digest of the text, so that a file that is damaged, or
//! somebody else's, is as good as none. Does not know: what the texts are.

use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::bundle::write_atomically;

/// The ending of files that are a store's own.
const ENDING: &str = "hamel-cache";

/// What a text is made from, as a hash of 128 bits.
///
/// SipHash tells versions of files apart, not what somebody made in order to collide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key([u64; 2]);

impl Key {
    /// The key of some parts.
    pub fn of(parts: &impl Hash) -> Key {
        Key([0, 1]).with(parts)
    }

    /// The key of these parts and more.
    #[must_use]
    pub fn with(self, more: &impl Hash) -> Key {
        Key(self.0.map(|half| {
            // The same on every run, as it has no random key.
            let mut hasher = DefaultHasher::new();
            half.hash(&mut hasher);
            more.hash(&mut hasher);
            hasher.finish()
        }))
    }

    /// Its digits, the name of the file that is kept.
    pub fn name(self) -> String {
        format!("{:016x}{:016x}", self.0[0], self.0[1])
    }
}

/// A folder of texts, which is made when the first is kept.
///
/// What cannot be read or written costs time and nothing else.
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
    most: u64,
}

impl Store {
    /// Keeps at most so many bytes in a folder; the texts that were not used for longest go first.
    pub fn new(folder: impl Into<PathBuf>, most: u64) -> Store {
        Store { folder: folder.into(), most }
    }

    /// The text under a key, if it is there and whole.
    pub fn read(&self, key: Key) -> Option<String> {
        let path = self.path(key);
        let text = fs::read_to_string(&path).ok()?;
        let (head, body) = text.split_once('\n')?;
        if head != self::head(key, body) {
            return None;
        }
        // Used now. Whether that can be noted is no matter.
        let _ = fs::File::options().append(true).open(path).and_then(|f| f.set_modified(SystemTime::now()));
        Some(body.to_owned())
    }

    /// Keeps a text under a key.
    pub fn keep(&self, key: Key, text: &str) {
        let whole = format!("{}\n{text}", head(key, text));
        let written = fs::create_dir_all(&self.folder)
            .and_then(|()| write_atomically(&self.path(key), whole.as_bytes()));
        if written.is_ok() {
            let _ = trim(&self.folder, self.most);
        }
    }

    fn path(&self, key: Key) -> PathBuf {
        self.folder.join(format!("{}.{ENDING}", key.name()))
    }
}

fn head(key: Key, body: &str) -> String {
    format!("hamel {} {}", key.name(), Key::of(&body).name())
}

/// Removes the files of a store that were not used for longest until the others have at most `most` bytes.
fn trim(folder: &Path, most: u64) -> io::Result<()> {
    let mut files = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == ENDING)
            && let Ok(data) = fs::metadata(&path)
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
        fs::remove_file(path)?;
        total -= bytes;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Folder {
            let path = std::env::temp_dir().join(format!("hamel-store-{name}-{}", std::process::id()));
            let _ = fs::remove_dir_all(&path);
            Folder(path)
        }

        fn files(&self) -> Vec<PathBuf> {
            let listing = fs::read_dir(&self.0).unwrap();
            let mut files: Vec<PathBuf> = listing.map(|file| file.unwrap().path()).collect();
            files.sort();
            files
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
            let _ = fs::remove_file(&self.0);
        }
    }

    #[test]
    fn a_text_is_under_its_key_and_where_a_part_ends_matters() {
        let folder = Folder::new("keys");
        let store = Store::new(&folder.0, 1000);
        let keys =
            [Key::of(&("a", "b")), Key::of(&("ab", "")), Key::of(&"a").with(&"b"), Key::of(&"b").with(&"a")];
        for (k, key) in keys.iter().enumerate() {
            assert_eq!(store.read(*key), None);
            store.keep(*key, &k.to_string());
        }
        for (k, key) in keys.iter().enumerate() {
            assert_eq!(store.read(*key), Some(k.to_string()));
        }
    }

    #[test]
    fn what_is_damaged_or_of_another_is_as_good_as_none() {
        let folder = Folder::new("damaged");
        let store = Store::new(&folder.0, 1000);
        let [a, b] = ["a", "b"].map(|part| Key::of(&part));
        store.keep(a, "one");
        let path = &folder.files()[0];
        let whole = fs::read_to_string(path).unwrap();
        for text in ["", "\n", &whole[..whole.len() - 1], &whole.replace("\none", "\ntwo"), "hamel 0 0\none"]
        {
            fs::write(path, text).unwrap();
            assert_eq!(store.read(a), None, "{text:?}");
        }
        fs::write(path, [0xff, 0xfe]).unwrap();
        assert_eq!(store.read(a), None);
        // A file of another key under this name.
        store.keep(b, "two");
        let other = folder.files().into_iter().find(|file| file != path).unwrap();
        fs::copy(&other, path).unwrap();
        assert_eq!(store.read(a), None);
        store.keep(a, "one");
        assert_eq!(store.read(a).as_deref(), Some("one"));
    }

    #[test]
    fn a_folder_that_cannot_be_made_costs_nothing_but_time() {
        let folder = Folder::new("file");
        fs::write(&folder.0, "").unwrap();
        let store = Store::new(folder.0.join("below"), 1000);
        store.keep(Key::of(&"a"), "one");
        assert_eq!(store.read(Key::of(&"a")), None);
    }

    #[test]
    fn the_oldest_files_go_first_and_others_stay() {
        let folder = Folder::new("bounded");
        let keys = ["a", "b", "c"].map(|part| Key::of(&part));
        let store = Store::new(&folder.0, 1000);
        keys.iter().for_each(|key| store.keep(*key, "one"));
        fs::write(folder.0.join("mine.txt"), "of somebody else").unwrap();
        for (key, hours) in keys.iter().zip([2, 3, 1]) {
            let then = SystemTime::now() - Duration::from_secs(3600 * hours);
            fs::File::options().append(true).open(store.path(*key)).unwrap().set_modified(then).unwrap();
        }
        let bytes = fs::metadata(store.path(keys[0])).unwrap().len();
        // One more than there is room for.
        let small = Store::new(&folder.0, 3 * bytes);
        small.keep(Key::of(&"d"), "one");
        assert_eq!(keys.map(|key| store.path(key).exists()), [true, false, true]);
        assert!(folder.0.join("mine.txt").exists());
        // What was read is young again.
        assert!(store.read(keys[0]).is_some());
        small.keep(Key::of(&"e"), "one");
        assert_eq!(keys.map(|key| store.path(key).exists()), [true, false, false]);
    }
}
