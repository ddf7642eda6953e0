//! A model that was read and checked, and what is derived from it, at most once while the cache keeps it.
//!
//! Does not know: how a scene is evaluated, what is kept where.

use std::ops::Deref;

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{Model, Origin};
use serde::Serialize;
use serde::de::DeserializeOwned;

use super::{DEFAULT_SCENE, RECONSTRUCTION_SCENE};
use crate::cache::Cache;
use crate::error::Error;

/// A model that was read and checked.
#[derive(Debug)]
pub struct Checked {
    model: Model,
    cache: Cache,
}

impl Deref for Checked {
    type Target = Model;

    fn deref(&self) -> &Model {
        &self.model
    }
}

impl Checked {
    /// The model, with a cache of what is derived from it.
    pub fn new(model: Model, cache: Cache) -> Checked {
        Checked { model, cache }
    }

    /// The model alone.
    pub fn into_model(self) -> Model {
        self.model
    }

    /// What `make` makes of the model, or made of the same text within the same budget before; `what` names it, with
    /// the scene. What was made before counts if it `is_sound`: a cache is a file that anybody may have written.
    ///
    /// # Errors
    /// That of `make`.
    pub fn cached<T: Serialize + DeserializeOwned>(
        &self,
        what: &str,
        scene: &str,
        is_sound: impl FnOnce(&T) -> bool,
        make: impl FnOnce() -> Result<T, Error>,
    ) -> Result<T, Error> {
        // A model that somebody built in memory has no text.
        let Some(Origin { text, .. }) = &self.model.origin else { return make() };
        let budget = format!("{:?}", self.model.graph.budget());
        self.cache.get_or_make(&[what, scene, &budget, text], is_sound, make)
    }

    /// Names of the scenes, the default first.
    pub fn scene_names(&self) -> Vec<String> {
        let names = || Ok(scene::names(&self.model));
        // Names never fail to be there.
        self.cached("scene names", "", |names: &Vec<String>| !names.is_empty(), names).unwrap_or_default()
    }

    /// Derives and lowers a scene: also the one of derivatives, which is emitted only for models that declare it.
    ///
    /// # Errors
    /// [`Error::UnknownScene`], [`Error::Models`].
    pub fn derive(&self, scene: &str) -> Result<BuiltScene, Error> {
        self.known_scene(scene)?;
        Ok(scene::build(&self.model, scene)?)
    }

    /// Whether the model has a scene, or could have it.
    ///
    /// # Errors
    /// [`Error::UnknownScene`].
    pub fn known_scene(&self, scene: &str) -> Result<(), Error> {
        if !scene::has_scene(&self.model, scene) {
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
