//! Scenes that an earlier run of a build script has generated, by what they were made from.
//!
//! A scene is known by the text of its model without the blocks of other scenes, its name, the way it is written down,
//! the budget, and the sources of the generator. A scene that warns is not kept, so that its warnings are found again.
//! A file that is missing, broken or of another version is as good as none. Does not know: how a scene is made.

use std::collections::hash_map::DefaultHasher;
use std::fs;
use std::hash::{Hash, Hasher};
use std::path::{Path, PathBuf};

use super::bundle::write_atomically;
use crate::emit::SceneEntry;
use crate::expr::Budget;
use crate::scene::Writing;
use crate::spec::Model;

/// The first line of every file.
const HEAD: &str = concat!("hamel ", env!("CARGO_PKG_VERSION"), " ", env!("HAMEL_CODEGEN_SOURCES"));
/// More files than this are not kept.
const MAX_FILES: usize = 256;

/// A folder of generated scenes.
#[derive(Debug)]
pub(super) struct Cache {
    folder: PathBuf,
}

/// What all scenes of a model are made from, as a hash of 128 bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Key([u64; 2]);

impl Key {
    /// The key of a model; none for one that was not read from a text.
    pub(super) fn of(model: &Model, writing: &Writing, budget: &Budget) -> Option<Key> {
        let text = &model.origin.as_ref()?.text;
        let mut blocks: Vec<_> = model.scenes.iter().filter_map(|scene| scene.extent).collect();
        blocks.sort_by_key(|span| span.start);
        let mut shared = Vec::new();
        let mut start = 0;
        for block in blocks {
            shared.push(text.get(start..block.start)?);
            start = block.end;
        }
        shared.push(text.get(start..)?);
        Some(Key([0, 1]).with(&(HEAD, shared, writing, budget)))
    }

    /// The key of a scene of the model.
    fn of_scene(self, model: &Model, scene: &str) -> Key {
        let own = model.scenes.iter().find(|own| own.name == scene).and_then(|own| own.extent);
        let block = own.and_then(|span| model.origin.as_ref()?.text.get(span.start..span.end));
        self.with(&(scene, block))
    }

    fn with(self, more: &impl Hash) -> Key {
        Key(self.0.map(|half| {
            // The same on every run, as it has no random key.
            let mut hasher = DefaultHasher::new();
            half.hash(&mut hasher);
            more.hash(&mut hasher);
            hasher.finish()
        }))
    }

    fn file_name(self) -> String {
        format!("{:016x}{:016x}", self.0[0], self.0[1])
    }
}

impl Cache {
    pub(super) fn new(folder: PathBuf) -> Cache {
        Cache { folder }
    }

    /// Names of the scenes of a model.
    pub(super) fn names(&self, key: Key) -> Option<Vec<String>> {
        let text = self.read(key.with(&"names"))?;
        Some(text.lines().map(str::to_owned).collect())
    }

    pub(super) fn keep_names(&self, key: Key, names: &[String]) {
        self.write(key.with(&"names"), &names.join("\n"));
    }

    /// A scene's entry and module.
    pub(super) fn scene(&self, key: Key, model: &Model, scene: &str) -> Option<(SceneEntry, String)> {
        let text = self.read(key.of_scene(model, scene))?;
        let (n_state, rest) = text.split_once('\n')?;
        let (doc, module) = rest.split_once('\n')?;
        let entry = SceneEntry {
            module: SceneEntry::module_name(&model.name, scene),
            model: model.name.clone(),
            scene: scene.to_owned(),
            n_state: n_state.parse().ok()?,
            doc: doc.to_owned(),
        };
        Some((entry, module.to_owned()))
    }

    pub(super) fn keep_scene(&self, key: Key, model: &Model, entry: &SceneEntry, module: &str) {
        let text = format!("{}\n{}\n{module}", entry.n_state, entry.doc);
        self.write(key.of_scene(model, &entry.scene), &text);
    }

    fn read(&self, key: Key) -> Option<String> {
        let text = fs::read_to_string(self.folder.join(key.file_name())).ok()?;
        let (head, rest) = text.split_once('\n')?;
        (head == HEAD).then(|| rest.to_owned())
    }

    /// Keeps a text; what cannot be kept is made again.
    fn write(&self, key: Key, text: &str) {
        let text = format!("{HEAD}\n{text}");
        let written = fs::create_dir_all(&self.folder)
            .and_then(|()| write_atomically(&self.folder.join(key.file_name()), text.as_bytes()));
        if written.is_ok() {
            remove_oldest(&self.folder);
        }
    }
}

fn remove_oldest(folder: &Path) {
    let Ok(listing) = fs::read_dir(folder) else { return };
    let mut files: Vec<_> = listing
        .filter_map(|file| {
            let path = file.ok()?.path();
            let modified = path.metadata().ok()?.modified().ok()?;
            Some((modified, path))
        })
        .collect();
    files.sort();
    for (_, path) in files.iter().take(files.len().saturating_sub(MAX_FILES)) {
        let _ = fs::remove_file(path);
    }
}
