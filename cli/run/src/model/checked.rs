//! A model that was read and checked, and what is derived from it: once in a process, and once while the cache keeps
//! it.
//!
//! Does not know: how a scene is evaluated, what is kept where.

use std::any::Any;
use std::collections::BTreeMap;
use std::ops::Deref;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use hamel_codegen::scene::{self, BuiltScene, Scenes};
use hamel_codegen::spec::{Made, Model, Origin, decisive};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{DEFAULT_SCENE, RECONSTRUCTION_SCENE};
use crate::cache::Cache;
use crate::error::Error;

/// A model that was read and checked.
#[derive(Debug)]
pub struct Checked {
    model: Arc<Model>,
    cache: Cache,
    /// Equations, each formulation derived once, and the scenes built from them.
    derived: Mutex<Derived>,
    /// Results of the model by their kinds and scenes.
    made: Mutex<BTreeMap<(String, String), Value>>,
}

/// Equations, and the scenes built from them by their names.
type Derived = (Scenes, BTreeMap<String, Arc<BuiltScene>>);

/// A value of any type.
type Value = Arc<dyn Any + Send + Sync>;

impl Deref for Checked {
    type Target = Model;

    fn deref(&self) -> &Model {
        &self.model
    }
}

impl Checked {
    /// The model, with a cache of what is derived from it.
    pub fn new(model: Model, cache: Cache) -> Checked {
        let model = Arc::new(model);
        let derived = Mutex::new((Scenes::of(Arc::clone(&model)), BTreeMap::new()));
        Checked { model, cache, derived, made: Mutex::default() }
    }

    /// The model alone.
    pub fn into_model(self) -> Model {
        drop(self.derived);
        Arc::unwrap_or_clone(self.model)
    }

    /// What `make` makes of the model, or made of it in this process before, or of a text with the same [`decisive`]
    /// parts within the same budget in another one; `what` names it, with the scene, which is empty where it depends on
    /// none. What another process made counts if it `is_sound`: a cache is a file that anybody may have written.
    ///
    /// # Errors
    /// That of `make`.
    pub fn cached<T: Clone + Serialize + DeserializeOwned + Send + Sync + 'static>(
        &self,
        what: &str,
        scene: &str,
        is_sound: impl FnOnce(&T) -> bool,
        make: impl FnOnce() -> Result<T, Error>,
    ) -> Result<T, Error> {
        let key = (what.to_owned(), scene.to_owned());
        let known = self.made.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        if let Some(known) = known.as_ref().and_then(|known| known.downcast_ref::<T>()) {
            return Ok(known.clone());
        }
        let made = match &self.model.origin {
            Some(Origin { text, .. }) => {
                let budget = format!("{:?}", self.model.graph.budget());
                // Which of several equations between coordinates is left out is found next to the initial values.
                let is_of_loops = self.model.constraints.iter().any(|c| c.position.is_some());
                let made = if is_of_loops { Made::Scene(scene) } else { Made::Program(scene) };
                let text = decisive(text, made);
                let totals = self.model.totals.iter().filter_map(|total| total.origin.as_ref());
                let totals = totals.map(|origin| origin.text.as_str());
                let key = [what, scene, &budget].into_iter().chain(text.iter().map(String::as_str));
                let key: Vec<&str> = key.chain(totals).collect();
                self.cache.get_or_make(&key, is_sound, make)?
            }
            // A model that somebody built in memory has no text.
            None => make()?,
        };
        let kept: Value = Arc::new(made.clone());
        self.made.lock().unwrap_or_else(PoisonError::into_inner).insert(key, kept);
        Ok(made)
    }

    fn scenes(&self) -> MutexGuard<'_, Derived> {
        self.derived.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Names of the scenes, the default first.
    pub fn scene_names(&self) -> Vec<String> {
        let find = || Ok(self.scenes().0.has_ignorable_coordinates());
        // Whether there are some never fails to be told.
        let has_some = || self.cached("has ignorable coordinates", "", |_| true, find).unwrap_or_default();
        scene::names_of(&self.model, has_some)
    }

    /// Derives and lowers a scene, once in a process: also the one of derivatives, which is emitted only for models
    /// that declare it.
    ///
    /// # Errors
    /// [`Error::UnknownScene`], [`Error::Models`].
    pub fn derive(&self, scene: &str) -> Result<Arc<BuiltScene>, Error> {
        self.known_scene(scene)?;
        let mut derived = self.scenes();
        let (scenes, built) = &mut *derived;
        if let Some(known) = built.get(scene) {
            return Ok(Arc::clone(known));
        }
        let made = Arc::new(scenes.build(scene)?);
        built.insert(scene.to_owned(), Arc::clone(&made));
        Ok(made)
    }

    /// Whether the model has a scene, or could have it.
    ///
    /// # Errors
    /// [`Error::UnknownScene`].
    pub fn known_scene(&self, scene: &str) -> Result<(), Error> {
        let has_scene = self.scenes().0.has(scene);
        if !has_scene {
            let mut known = self.scene_names();
            if !known.iter().any(|k| k == scene::DERIVATIVES) {
                known.push(scene::DERIVATIVES.to_owned());
            }
            return Err(Error::UnknownScene { model: self.model.name.clone(), name: scene.into(), known });
        }
        Ok(())
    }

    /// Whether a state can violate a constraint of a scene without the scene's own outputs telling it; the automatic
    /// scenes with all outputs would.
    ///
    /// # Errors
    /// [`Error::Models`].
    pub fn hides_residuals(&self, scene: &str) -> Result<bool, Error> {
        let has_all = [DEFAULT_SCENE, RECONSTRUCTION_SCENE].contains(&scene)
            && self.model.scenes.iter().all(|own| own.name != scene)
            && self.model.carries.is_empty();
        let has_residuals = || Ok(scene::has_residuals(&self.model)?);
        Ok(!has_all && self.cached("has residuals", "", |_| true, has_residuals)?)
    }
}
