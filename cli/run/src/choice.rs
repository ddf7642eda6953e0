//! Which scene of a model is run, and who evaluates it: machine code made in memory, or the interpreter.
//!
//! Does not know: requests, what is asked of the scene.

use std::sync::Arc;

use super::dynamics::Factory as _;
use super::info::Info;
use super::inputs::InputTable;
use super::interpreted::{self, Built};
use super::machine;
use crate::error::{Error, Problem};
use crate::model::{self, Checked};
use crate::session::ModelFile;

/// Who evaluates a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Via {
    /// Machine code of the lowered program, made in this process.
    Jit,
    /// The lowered program, operation by operation, in this process.
    Interpreter,
}

/// Which scene, and who evaluates it.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Name of the scene.
    pub scene: String,
    /// Who evaluates it; machine code made in this process unless it is given.
    pub via: Option<Via>,
    /// Inputs from a table.
    pub table: Option<Arc<InputTable>>,
}

impl Choice {
    /// The same model with the coordinates of the group; `path` is how the user asked for them.
    ///
    /// # Errors
    /// [`Error::Request`] when the model does not reconstruct any, or when another scene than the default was chosen;
    /// [`Error::UnknownScene`].
    pub fn reconstructing(&self, model: &Checked, path: &str) -> Result<Choice, Error> {
        let known = model.scene_names();
        if !known.contains(&self.scene) {
            return Err(Error::UnknownScene { model: model.name.clone(), name: self.scene.clone(), known });
        }
        let fail = |reason: String| Error::Request {
            problems: vec![Problem::Unusable { path: path.to_owned(), reason }],
        };
        if model::group_coordinates(model).is_empty() {
            return Err(fail(format!(
                "is not possible: {} does not say how the group moves, and has no cyclic coordinate; leave it out, or \
                 add `reconstruct .. ;` to the model",
                model.name
            )));
        }
        if self.scene != model::DEFAULT_SCENE {
            return Err(fail(format!(
                "chooses the scene itself, but scene {} is chosen as well: leave out --scene {}, and give parameters \
                 that it fixes as values; or leave out {path}",
                self.scene, self.scene
            )));
        }
        Ok(Choice { scene: model::RECONSTRUCTION_SCENE.to_owned(), ..self.clone() })
    }

    /// Who evaluates the scene: the interpreter where no machine code can be made.
    pub fn via(&self) -> Via {
        match self.via {
            None if !machine::IS_THERE => Via::Interpreter,
            chosen => chosen.unwrap_or(Via::Jit),
        }
    }

    /// The scene, ready to answer.
    ///
    /// # Errors
    /// Unknown names and problems of the model.
    pub fn open(&self, file: &ModelFile<'_>) -> Result<Built, Error> {
        let mut built = interpreted::build(file.model()?, &self.scene)?;
        if let Some(table) = &self.table {
            if let Some(scene) = gives_way(file.model()?, built.info(), table) {
                built = interpreted::build(file.model()?, scene)?;
            }
            built = built.driven_by(table)?;
        }
        Ok(if self.via() == Via::Jit { built.in_memory() } else { built })
    }
}

/// The scene that a scene gives way to, which takes the inputs of its model, or the noises as well where the table has
/// one: the default scene takes none unless the model says so, and the other one has the same besides.
pub fn gives_way(model: &Checked, scene: &Info, table: &InputTable) -> Option<&'static str> {
    if scene.scene != model::DEFAULT_SCENE || table.fits(scene) || model.inputs.is_empty() {
        return None;
    }
    let has_noise = model.noises.iter().any(|noise| table.has(&noise.name));
    Some(if has_noise { model::STOCHASTIC_SCENE } else { model::CONTROLLED_SCENE })
}
