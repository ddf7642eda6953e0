//! The back ends for languages of formulas: one file a scene, which needs nothing but a library that is there already.
//!
//! `spelling` has expressions and names of all of them, `item` the functions of a module before any language lays them
//! out, `form` what a language answers to lay out a module, `python`, `julia` and `matlab` the answers, `writer` the
//! order of a file. Deliberately does not know: which functions there are and why, the order of their statements.

mod form;
mod item;
mod julia;
mod matlab;
mod python;
mod spelling;
mod writer;

pub use form::Script;
pub use spelling::ScriptLanguage;

use self::spelling::Spelling;
use super::module::Module;
use super::text::SceneText;
use crate::program::Program;
use hamel_expr::error::Error;

/// The file of a scene.
pub(super) fn emit(program: &Program, text: &SceneText, language: ScriptLanguage) -> Result<Script, Error> {
    let module = Module::new(&Spelling(language), program, None, text)?;
    writer::write(&module, language)
}
