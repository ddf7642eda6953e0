//! Scenes that an earlier run of a build script has generated, by what they were made from.
//!
//! A scene is known by what of its model's text decides about it, the texts of models that it maps from, its name, the
//! way it is written down, the budget, and the sources of the generator. A scene that warns is not kept, so that its
//! warnings are found again. Does not know: how a scene is made.

use std::path::PathBuf;

use super::store::{Key, Store};
use crate::scene::Writing;
use hamel_expr::Budget;
use hamel_lang::spec::{Made, Model, decisive};
use hamel_program::emit::SceneEntry;

/// Bytes of all scenes together.
const MAX_BYTES: u64 = 64_000_000;

/// A folder of generated scenes.
#[derive(Debug)]
pub(super) struct Cache(Store);

/// What is kept of one model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kept<'a> {
    store: &'a Store,
    model: &'a Model,
    text: &'a str,
    /// Of the generator and how it writes.
    key: Key,
}

impl Cache {
    pub(super) fn new(folder: PathBuf) -> Cache {
        Cache(Store::new(folder, MAX_BYTES))
    }

    /// What is kept of a model; none of one that was not read from a text.
    pub(super) fn of<'a>(&'a self, model: &'a Model, writing: &Writing, budget: &Budget) -> Option<Kept<'a>> {
        let text = model.origin.as_ref()?.text.as_str();
        let generator = (env!("CARGO_PKG_VERSION"), env!("HAMEL_CODEGEN_SOURCES"));
        let totals: Vec<_> = model.totals.iter().filter_map(|total| total.origin.as_ref()).collect();
        let totals: Vec<&str> = totals.into_iter().map(|origin| origin.text.as_str()).collect();
        let key = Key::of(&(generator, writing, budget, totals));
        Some(Kept { store: &self.0, model, text, key })
    }
}

impl Kept<'_> {
    /// Whether the model has coordinates on which nothing depends, or what `find` finds, which is kept then.
    pub(super) fn has_ignorable_coordinates(&self, find: impl FnOnce() -> bool) -> bool {
        let key = self.key.with(&("has ignorable coordinates", decisive(self.text, Made::Common)));
        match self.store.read(key).as_deref() {
            Some("yes") => true,
            Some("no") => false,
            _ => {
                let found = find();
                self.store.keep(key, if found { "yes" } else { "no" });
                found
            }
        }
    }

    /// A scene's entry and module.
    pub(super) fn scene(&self, scene: &str) -> Option<(SceneEntry, String)> {
        let text = self.store.read(self.key_of(scene))?;
        let (n_state, rest) = text.split_once('\n')?;
        let (doc, module) = rest.split_once('\n')?;
        let entry = SceneEntry {
            module: SceneEntry::module_name(&self.model.name, scene),
            model: self.model.name.clone(),
            scene: scene.to_owned(),
            n_state: n_state.parse().ok()?,
            doc: doc.to_owned(),
        };
        Some((entry, module.to_owned()))
    }

    /// Keeps a scene's module.
    pub(super) fn keep(&self, entry: &SceneEntry, module: &str) {
        let text = format!("{}\n{}\n{module}", entry.n_state, entry.doc);
        self.store.keep(self.key_of(&entry.scene), &text);
    }

    fn key_of(&self, scene: &str) -> Key {
        self.key.with(&(scene, decisive(self.text, Made::Scene(scene))))
    }
}
