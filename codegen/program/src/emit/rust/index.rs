//! The file that lists the generated modules, and the macro that visits all scenes.
//!
//! Does not know: what a module holds.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};

use super::super::dialect::Dialect as _;
use super::super::names::legal;
use super::format::{format_file, header};
use super::notation::Rust;
use super::tokens::{doc_attributes, escaped};
use hamel_expr::error::Error;

/// A module in the index.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneEntry {
    /// Name of the module and of its file, such as `heavy_top_lagrange`.
    pub module: String,
    /// Name of the model.
    pub model: String,
    /// Name of the scene.
    pub scene: String,
    /// Dimension of the state.
    pub n_state: usize,
    /// One sentence.
    pub doc: String,
}

impl SceneEntry {
    /// The module name of a scene: the model's for the scene `default`, otherwise `<model>_<scene>`; followed by `_`
    /// where it would be a word of Rust.
    pub fn module_name(model: &str, scene: &str) -> String {
        let name = if scene == "default" { model.to_owned() } else { format!("{model}_{scene}") };
        legal(Rust.reserved(), &name)
    }
}

/// As [`emit_index`](crate::emit::emit_index).
pub(in crate::emit) fn emit_index(scenes: &[SceneEntry], command: &str) -> Result<String, Error> {
    let modules = modules(scenes, |_| quote! { ; })?;
    let mut list = String::new();
    for SceneEntry { module, model, scene, n_state, .. } in sorted(scenes) {
        list.push_str(&format!("            ({module}, {model:?}, {scene:?}, {n_state})\n"));
    }
    // Written by hand: the formatter leaves macros as it finds them.
    let visitor = format!(
        "\n/// Calls a macro with every scene: `$visit! {{ (module, \"model\", \"scene\", dimension) .. }}`.\n\
         ///\n\
         /// The module of a scene is `$crate::generated::module`.\n\
         #[macro_export]\n\
         macro_rules! for_each_scene {{\n    \
             ($visit:ident) => {{\n        \
                 $visit! {{\n{list}        }}\n    \
             }};\n\
         }}\n"
    );
    let text = format!("{}{}{visitor}", header(command, None), format_file(modules)?);
    syn::parse_file(&text)
        .map_err(|e| Error::Emission { model: "the index".to_owned(), reason: e.to_string() })?;
    Ok(text)
}

/// As [`emit_include`](crate::emit::emit_include).
pub(in crate::emit) fn emit_include(
    scenes: &[SceneEntry],
    command: &str,
    beside: bool,
) -> Result<String, Error> {
    let modules = modules(scenes, |entry| {
        let file = format!("{}.rs", entry.module);
        if beside {
            return quote! { { include!(#file); } };
        }
        let file = format!("/{file}");
        quote! { { include!(concat!(env!("OUT_DIR"), #file)); } }
    })?;
    Ok(format!("{}{}", header(command, None), format_file(modules)?))
}

fn sorted(scenes: &[SceneEntry]) -> Vec<&SceneEntry> {
    let mut sorted: Vec<&SceneEntry> = scenes.iter().collect();
    sorted.sort_by(|a, b| a.module.cmp(&b.module));
    sorted
}

/// `pub mod` for each scene, documented, followed by `body`.
fn modules(scenes: &[SceneEntry], body: impl Fn(&SceneEntry) -> TokenStream) -> Result<TokenStream, Error> {
    let mut modules = TokenStream::new();
    for entry in sorted(scenes) {
        let SceneEntry { module, model, scene, doc, .. } = entry;
        syn::parse_str::<syn::Ident>(module)
            .map_err(|e| Error::Emission { model: model.clone(), reason: format!("module {module}: {e}") })?;
        let name = format_ident!("{module}");
        let fallback = format!("Model `{model}`, scene `{scene}`.");
        let doc = doc_attributes([escaped(if doc.trim().is_empty() { &fallback } else { doc })]);
        let body = body(entry);
        modules.extend(quote! { #doc pub mod #name #body });
    }
    Ok(modules)
}
