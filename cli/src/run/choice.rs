//! Which scene of a model is run, and who evaluates it: machine code made in memory, the compiled module, or the
//! interpreter.
//!
//! Does not know: requests, what is asked of the scene.

use std::sync::Arc;

use hamel_codegen::spec::Want;

use super::backend::{Backend, Local};
use super::dynamics::Factory as _;
use super::info::Info;
use super::inputs::InputTable;
use super::method::MethodName;
use super::remote::Remote;
use super::{interpreted, machine};
use crate::error::{Error, Problem};
use crate::model::{self, Checked};
use crate::session::ModelFile;
use crate::streams::tell;

/// Who evaluates a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Via {
    /// Machine code of the lowered program, made in this process.
    Jit,
    /// The generated module of a model of hamel's repository, compiled by rustc, in another process.
    #[value(alias = "rustc")]
    Compiled,
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

    /// Who evaluates the scene: rustc compiles models of the repository alone.
    pub fn via(&self, file: &ModelFile<'_>) -> Via {
        match self.via {
            Some(Via::Interpreter) => Via::Interpreter,
            Some(Via::Compiled) if file.repository().is_some() && self.table.is_none() => Via::Compiled,
            None if !machine::IS_THERE => Via::Interpreter,
            Some(Via::Compiled | Via::Jit) | None => Via::Jit,
        }
    }

    /// The scene as a method needs it: what was compiled without the invariants that a projection needs, or without the
    /// exact flows of a splitting, is interpreted.
    ///
    /// # Errors
    /// Problems of the model.
    pub fn suited_to(&self, file: &ModelFile<'_>, method: MethodName) -> Result<Choice, Error> {
        if self.via(file) != Via::Compiled {
            return Ok(self.clone());
        }
        // Every method keeps equations between coordinates.
        let positions = model::has_positions(file.model()?).then_some(Want::Positions);
        let Some(needed) = method.asks_for().or(positions) else { return Ok(self.clone()) };
        if model::wants(file.model()?, &self.scene, needed) {
            return Ok(self.clone());
        }
        tell(format_args!(
            "note: scene {} does not want `{}`, so it is compiled in memory, with those that are found",
            self.scene,
            needed.name()
        ));
        Ok(Choice { via: Some(Via::Jit), ..self.clone() })
    }

    /// The scene, ready to answer.
    ///
    /// # Errors
    /// Unknown names, problems of the model, [`Error::NotCompiled`].
    pub fn open(&self, file: &ModelFile<'_>) -> Result<Box<dyn Backend>, Error> {
        let via = self.via(file);
        if let (Via::Compiled, Some(repository)) = (via, file.repository()) {
            return Ok(Box::new(Remote::open(repository, file.name(), &self.scene)?));
        }
        if self.via == Some(Via::Compiled) && (self.table.is_some() || file.is_driven()) {
            tell(format_args!(
                "note: {} is compiled in memory: rustc's module has other inputs",
                file.shown()
            ));
        } else if self.via == Some(Via::Compiled) {
            tell(format_args!(
                "note: {} is compiled in memory: rustc compiles the models of hamel's repository, for programs started \
                 inside it",
                file.shown()
            ));
        }
        let mut built = interpreted::build(file.model()?, &self.scene)?;
        if let Some(table) = &self.table {
            if gives_way(file.model()?, built.info(), table) {
                built = interpreted::build(file.model()?, model::CONTROLLED_SCENE)?;
            }
            built = built.driven_by(table)?;
        }
        Ok(Box::new(Local::new(if via == Via::Jit { built.in_memory() } else { built })))
    }
}

/// Whether a scene gives way to the one that takes the inputs of its model: the default scene takes none unless the
/// model says so, and the other one has the same besides.
pub fn gives_way(model: &Checked, scene: &Info, table: &InputTable) -> bool {
    scene.scene == model::DEFAULT_SCENE && !table.fits(scene) && !model.inputs.is_empty()
}
