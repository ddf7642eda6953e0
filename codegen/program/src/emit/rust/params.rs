//! `INFO`, `Params` and `State`: the names of a scene, and its numbers under these names.
//!
//! Does not know: equations.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::lines::{self, ALLOW, documentation, indented, literal};
use super::tokens::{MARKER, doc_attributes, sentence, size};
use crate::emit::text::{OutputText, ParamText, SceneText};
use hamel_expr::rational_to_f64;

impl Writer<'_> {
    /// Names, defaults and meanings as data.
    pub(super) fn info(&self) -> TokenStream {
        let SceneText { model, scene, params, outputs, .. } = self.module.text;
        let rt = &self.path;
        let names = |open: &str, names: &[String], close: &str| {
            let names: Vec<String> = names.iter().map(|name| literal(name)).collect();
            lines::list(open, &names, close)
        };
        let start = format!("{rt}::SceneInfo::new({}, {}, &[", literal(model), literal(scene));
        let mut value = names(&start, &self.module.program.state, "])");
        let mut with = |what: &str, items: Vec<String>| {
            if !items.is_empty() {
                let items: String = items.iter().map(|item| indented(item) + ",\n").collect();
                value.push_str(&format!("\n.with_{what}(&[\n{items}])"));
            }
        };
        with("params", params.iter().map(|param| self.param_info(param)).collect());
        let output = |OutputText { name, components, doc }: &OutputText| {
            let start = format!("{rt}::OutputInfo::new({}, &[", literal(name));
            names(&start, components, &format!("], {})", literal(doc)))
        };
        with("outputs", outputs.iter().map(output).collect());
        if self.module.energy.is_some() {
            value.push_str("\n.with_energy()");
        }
        let doc = documentation(["Names, defaults and meanings of all that the scene has."]);
        let declaration = format!("pub const INFO: {rt}::SceneInfo =");
        lines::statements(&format!("{doc}{ALLOW}\n{declaration}\n{};", indented(&value)))
    }

    /// A parameter or input as data.
    pub(super) fn param_info(&self, ParamText { name, default, doc }: &ParamText) -> String {
        let default = rational_to_f64(default);
        format!("{}::ParamInfo::new({}, {default:?}, {})", self.path, literal(name), literal(doc))
    }

    /// The structure of the parameters.
    pub(super) fn params(&self) -> TokenStream {
        let docs = self.module.text.params.iter().map(|p| {
            let meaning = meaning("Parameter", &p.name, &p.doc);
            format!("{meaning} Default: {:?}.", rational_to_f64(&p.default))
        });
        let title = format!("Parameters of {}, in the order of `INFO.params`.", self.module.title());
        self.structure("Params", &title, &self.module.params, docs, " defaults INFO")
    }

    /// The structure of the state.
    pub(super) fn state(&self) -> TokenStream {
        let components = self.module.text.state.iter();
        let docs = components.map(|s| meaning("Component", &s.name, &s.doc));
        let title = format!("State of {} by name, in the order of the array.", self.module.title());
        let structure = self.structure("State", &title, &self.module.state, docs, "");
        let initial = self.initial();
        quote! { #initial #structure }
    }

    /// A structure of named numbers, and the methods between it and an array.
    fn structure(
        &self,
        name: &str,
        title: &str,
        fields: &[String],
        docs: impl Iterator<Item = String>,
        more: &str,
    ) -> TokenStream {
        let mut text = format!("{}::numbers!({name}[{}] {} {{", self.path, fields.len(), literal(title));
        for (field, doc) in fields.iter().zip(docs) {
            text.push_str(&format!("\n    {field}: {},", literal(&doc)));
        }
        match fields.is_empty() {
            true => text.push_str(&format!("}} marker {MARKER}{more});")),
            false => text.push_str(&format!("\n}}{more});")),
        }
        lines::statements(&text)
    }

    /// The initial state, where there is one.
    fn initial(&self) -> TokenStream {
        let Some(initial) = &self.module.text.initial else { return TokenStream::new() };
        let (n, doc) = (size(initial.values.len()), doc_attributes(initial.doc()));
        // The sum with zero of what is zero has no sign.
        let values: Vec<String> = initial.values.iter().map(|value| format!("{:?}", value + 0.0)).collect();
        let values = super::tokens::array(&values);
        quote! {
            #doc
            pub const INITIAL: [f64; #n] = #values;
        }
    }
}

/// What a field means.
fn meaning(kind: &str, name: &str, doc: &str) -> String {
    if doc.trim().is_empty() { format!("{kind} `{name}`.") } else { sentence(doc) }
}
