//! A [`Program`] as the text of a documented module.
//!
//! [`text`] is what the documentation says; `module` names everything and writes down the code of every function with
//! `body` and `expression`, `series` that of Taylor coefficients; `dialect` is what they ask of a target language.
//! `rust`, `c` and `script` are the back ends, each the only module that knows its languages. Deliberately does not
//! know: mechanics, expressions. Everything the documentation says comes in as text.

mod body;
mod c;
mod dialect;
mod expression;
mod literal;
mod module;
mod names;
mod rust;
mod script;
mod series;
pub mod text;

use crate::program::{Jet, Program, Role};
use hamel_expr::error::Error;
use hamel_expr::parallel::with_own_tokens;

pub use c::{CModule, Fmu, Precision};
pub use rust::{SceneEntry, WasmModule};
pub use script::{Script, ScriptLanguage};
pub use text::{
    CarriedText, DiscreteText, EventText, FlowText, FluidModeText, FluidTermText, FluidText, GroupKind,
    GroupText, GroupTexts, ImplicitText, ImplicitVariableText, InitialText, MatrixText, OutputText,
    ParamText, PositionsText, ProductText, QuotientText, RanksText, SceneText, SelfTestText, StateText,
    SurfaceText, TraceText, UnitText, UnitTexts,
};

/// Emits the module of one scene.
///
/// The program has a function [`Role::Rate`] with one result for each component of the state, and one function for each
/// output and product; what the other functions are, [`Role`] says. With a `jet`, made from [`Role::Rate`], the module
/// has the Taylor coefficients of solutions.
///
/// # Errors
/// [`Error::ShapeMismatch`] when text and program disagree on a number, [`Error::UnknownName`] when a function is
/// missing, [`Error::Emission`] when the result is not Rust.
pub fn emit_scene(program: &Program, jet: Option<&Jet>, text: &SceneText) -> Result<String, Error> {
    with_own_tokens(|| rust::emit(program, jet, text)).map_err(|e| match e {
        Error::Emission { reason, .. } => {
            Error::Emission { model: format!("{} {}", text.model, text.scene), reason }
        }
        other => other,
    })
}

/// Emits a scene as C99: a header and a source.
///
/// The functions are those of [`emit_scene`] but for Taylor coefficients and for angles as points of circles.
///
/// # Errors
/// [`Error::ShapeMismatch`] and [`Error::UnknownName`] as [`emit_scene`]; [`Error::NotSingle`].
pub fn emit_c(program: &Program, text: &SceneText, precision: Precision) -> Result<CModule, Error> {
    c::emit(program, text, precision)
}

/// Emits a scene as C99, with what an FMU of FMI 3.0 has besides.
///
/// # Errors
/// As [`emit_c`]; [`Error::NoInitialState`].
pub fn emit_fmu(program: &Program, text: &SceneText) -> Result<(CModule, Fmu), Error> {
    c::emit_fmu(program, text)
}

/// Emits a scene as one file in a language of formulas.
///
/// The file has the functions of [`emit_scene`] but for Taylor coefficients and for angles as points of circles. Each
/// takes inputs, where there are any, as its last argument.
///
/// # Errors
/// [`Error::ShapeMismatch`] and [`Error::UnknownName`] as [`emit_scene`].
pub fn emit_script(program: &Program, text: &SceneText, language: ScriptLanguage) -> Result<Script, Error> {
    script::emit(program, text, language)
}

/// Emits what calls the module of [`emit_scene`], which is in `file`, from outside of WebAssembly.
///
/// # Errors
/// As [`emit_scene`].
pub fn emit_wasm(program: &Program, text: &SceneText, file: &str) -> Result<WasmModule, Error> {
    with_own_tokens(|| rust::emit_wasm(program, text, file))
}

/// Emits `mod.rs`: a module for each scene, and `for_each_scene!`.
///
/// The macro calls `$visit! { (module, "model", "scene", dimension) .. }`; the module is at
/// `$crate::generated::module`.
///
/// # Errors
/// [`Error::Emission`] when a module name is no identifier.
pub fn emit_index(scenes: &[SceneEntry], command: &str) -> Result<String, Error> {
    with_own_tokens(|| rust::emit_index(scenes, command))
}

/// Emits a file for `include!`: a module for each scene, which includes the scene's own file.
///
/// The file is looked for in the crate's `OUT_DIR`, or beside this file when `beside` is set.
///
/// # Errors
/// [`Error::Emission`] when a module name is no identifier.
pub fn emit_include(scenes: &[SceneEntry], command: &str, beside: bool) -> Result<String, Error> {
    with_own_tokens(|| rust::emit_include(scenes, command, beside))
}

/// The lines of a method of an emitted module, without its documentation and the indentation of its first line; none if
/// the module has no such method.
pub fn method_text(module: &str, role: &Role) -> Option<String> {
    with_own_tokens(|| rust::method_text(module, role))
}

/// Emits the module of a fluid that is moved as products of matrices.
///
/// # Errors
/// [`Error::NotAPath`] for a runtime that is no path, [`Error::Emission`] when the result is not Rust.
pub fn emit_fluid(text: &FluidText) -> Result<String, Error> {
    with_own_tokens(|| rust::emit_fluid(text)).map_err(|e| match e {
        Error::Emission { reason, .. } => Error::Emission { model: text.model.clone(), reason },
        other => other,
    })
}
