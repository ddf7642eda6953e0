//! The Rust back end: a module as items, documented for rustdoc and formatted.
//!
//! `notation` spells expressions, `tokens` has small pieces, `params`, `prepared`, `functions`, `circles`, `matrices`,
//! `implicit`, `discrete`, `quotient`, `flows`, `events`, `guards`, `inputs`, `loops`, `traits`, `series` and
//! `nalgebra` write the items of a scene, `lines` what is written line by line, `wasm` the root of a crate for
//! WebAssembly over it, `index` the list of modules, `fluid` the module of a fluid of matrices, `format` text. Does not
//! know: which functions there are and why, the order of their statements.

mod circles;
mod discrete;
mod events;
mod excerpt;
mod flows;
mod fluid;
mod format;
mod functions;
mod guards;
mod implicit;
mod index;
mod inputs;
mod lines;
mod loops;
mod matrices;
mod nalgebra;
mod notation;
mod params;
mod prepared;
mod quotient;
mod self_test;
mod series;
mod tokens;
mod traits;
mod wasm;

use hamel_runtime::CONTRACT;
use proc_macro2::TokenStream;

pub(super) use excerpt::method_text;
pub(super) use fluid::emit as emit_fluid;
pub use index::SceneEntry;
pub(super) use index::{emit_include, emit_index};

use self::notation::{FMA, Rust};
use super::module::Module;
use super::series::Series;
use super::text::SceneText;
use crate::program::{Circles, Jet, Program};
use hamel_expr::error::Error;

/// The module of a scene as text.
pub(super) fn emit(program: &Program, jet: Option<&Jet>, text: &SceneText) -> Result<String, Error> {
    let circles = Circles::of(program);
    let module = Module::new(&Rust, program, circles.as_ref(), text)?;
    let series = jet.map(|jet| Series::new(&Rust, &module, jet, &series::locals(jet)));
    let writer = Writer::new(&module, text)?;
    let items = [
        writer.info(),
        writer.params(),
        writer.state(),
        writer.patterns(),
        writer.implicit_constants(),
        writer.discrete_constants(),
        writer.quotient_constants(),
        writer.prepared(),
        writer.functions()?,
        writer.traits(series.is_some()),
        writer.controlled(),
        writer.circles(),
        writer.differentiable(),
        writer.adjoint(),
        writer.invariants(),
        writer.positions(),
        writer.independent_rows(),
        writer.implicit(),
        writer.discrete(),
        writer.exact_flows(),
        writer.events()?,
        series.map_or(TokenStream::new(), |series| writer.series(&series)),
        writer.groups()?,
        writer.self_test(),
    ];
    let items = format::format_module(items.into_iter().collect())?;
    let (header, rt) = (format::header(&text.command, text.formulation.as_deref()), &writer.path);
    let fused = if format::calls(&items, FMA) { format!("use {rt}::{FMA};\n") } else { String::new() };
    Ok(format!("{header}const _: () = {rt}::generated_for::<{CONTRACT}>();\n{fused}\n{items}"))
}

/// A scene for WebAssembly.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WasmModule {
    /// The text of the root of a crate, which takes the scene's module from the file beside it.
    pub root: String,
    /// The text of a module of JavaScript that calls it.
    pub script: String,
}

/// The texts that call a scene's module, which is in `file`, from outside of WebAssembly.
pub(super) fn emit_wasm(program: &Program, text: &SceneText, file: &str) -> Result<WasmModule, Error> {
    let module = Module::new(&Rust, program, None, text)?;
    let writer = Writer::new(&module, text)?;
    Ok(WasmModule { root: writer.wasm(file)?, script: writer.wasm_script() })
}

/// Writes the items of a module.
struct Writer<'a> {
    module: &'a Module<'a>,
    /// Path of the runtime.
    runtime: TokenStream,
    /// The same as text.
    path: String,
}

impl<'a> Writer<'a> {
    fn new(module: &'a Module<'a>, text: &SceneText) -> Result<Writer<'a>, Error> {
        let runtime = format::runtime_path(&text.runtime)?;
        let path = runtime.to_string().replace(' ', "");
        Ok(Writer { module, runtime, path })
    }
}

#[cfg(test)]
mod tests {
    use super::super::names::Scope;
    use super::notation::Rust;

    #[test]
    fn names_are_legal_and_unique() {
        let mut scope = Scope::with(&Rust, ["t"]);
        assert_eq!(scope.add("t"), "t_2");
        assert_eq!(scope.add("type"), "type_");
        assert_eq!(scope.add("p"), "p");
        assert_eq!(scope.add("p"), "p_2");
        assert_eq!(scope.add("2d-force"), "x2d_force");
        assert_eq!(scope.temporary("t"), "t0");
    }

    #[test]
    fn names_that_can_stay_do_and_the_others_give_way() {
        let mut scope = Scope::with(&Rust, []);
        let names = ["type", "self", "type_", "Self", "crate", "x", "type__2"];
        let identifiers = ["type__3", "self_", "type_", "Self_", "crate_", "x", "type__2"];
        assert_eq!(scope.add_all(names), identifiers);
    }
}
