//! `INFO`, `Params` and `State`: the names of a scene, and its numbers under these names.
//!
//! Does not know: equations.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::tokens::{allow_names, allow_numbers, doc_attributes, idents, number, phantom, sentence, size};
use crate::emit::text::{OutputText, SceneText};
use hamel_expr::rational_to_f64;

impl Writer<'_> {
    /// Names, defaults and meanings as data.
    pub(super) fn info(&self) -> TokenStream {
        let SceneText { model, scene, params, outputs, .. } = self.module.text;
        let rt = &self.runtime;
        let state = &self.module.program.state;
        let params = params.iter().map(|p| {
            let (name, default, doc) = (&p.name, number(rational_to_f64(&p.default)), &p.doc);
            quote! { #rt::ParamInfo { name: #name, default: #default, doc: #doc } }
        });
        let outputs = outputs.iter().map(|OutputText { name, components, doc }| {
            quote! { #rt::OutputInfo { name: #name, components: &[#(#components),*], doc: #doc } }
        });
        let has_energy = self.module.energy.is_some();
        let allow = allow_numbers(self.defaults());
        quote! {
            /// Names, defaults and meanings of all that the scene has.
            #allow
            pub const INFO: #rt::SceneInfo = #rt::SceneInfo {
                model: #model,
                scene: #scene,
                state: &[#(#state),*],
                params: &[#(#params),*],
                outputs: &[#(#outputs),*],
                has_energy: #has_energy,
            };
        }
    }

    fn defaults(&self) -> impl Iterator<Item = f64> + '_ {
        self.module.text.params.iter().map(|p| rational_to_f64(&p.default))
    }

    /// The structure of the parameters.
    pub(super) fn params(&self) -> TokenStream {
        let rt = &self.runtime;
        let fields = idents(&self.module.params);
        let n = size(fields.len());
        let mut docs = Vec::with_capacity(fields.len());
        for p in &self.module.text.params {
            let default = rational_to_f64(&p.default);
            let meaning = meaning("Parameter", &p.name, &p.doc);
            docs.push(doc_attributes([meaning, String::new(), format!("Default: {default:?}.")]));
        }
        let defaults = self.defaults().map(|x| match x {
            0.0 => quote! { R::ZERO },
            1.0 => quote! { R::ONE },
            x => {
                let x = number(x);
                quote! { R::from_f64(#x) }
            }
        });
        let (names, numbers) = (allow_names(&self.module.params), allow_numbers(self.defaults()));
        let title = doc_attributes([format!("Parameters of {}.", self.module.title())]);
        let (marker, marked) = if fields.is_empty() { phantom() } else { Default::default() };
        quote! {
            #title
            #[derive(Clone, Copy, Debug, PartialEq)]
            #names
            pub struct Params<R = f64> {
                #(#docs pub #fields: R,)*
                #marker
            }

            #names
            impl<R: #rt::Real> Params<R> {
                /// The parameters from their values in the order of `INFO.params`.
                #[must_use]
                pub fn from_array(values: [R; #n]) -> Self {
                    let [#(#fields),*] = values;
                    Self { #(#fields,)* #marked }
                }

                /// The values in the order of `INFO.params`.
                #[must_use]
                pub fn to_array(self) -> [R; #n] {
                    [#(self.#fields),*]
                }
            }

            #numbers
            impl<R: #rt::Real> Default for Params<R> {
                fn default() -> Self {
                    Self { #(#fields: #defaults,)* #marked }
                }
            }
        }
    }

    /// The structure of the state.
    pub(super) fn state(&self) -> TokenStream {
        let rt = &self.runtime;
        let fields = idents(&self.module.state);
        let n = size(fields.len());
        let components = self.module.text.state.iter();
        let docs = components.map(|s| doc_attributes([meaning("Component", &s.name, &s.doc)]));
        let names = allow_names(&self.module.state);
        let title =
            doc_attributes([format!("State of {} by name, in the order of the array.", self.module.title())]);
        let (marker, marked) = if fields.is_empty() { phantom() } else { Default::default() };
        let initial = self.initial();
        quote! {
            #initial

            #title
            #[derive(Clone, Copy, Debug, PartialEq)]
            #names
            pub struct State<R = f64> {
                #(#docs pub #fields: R,)*
                #marker
            }

            #names
            impl<R: #rt::Real> State<R> {
                /// The named components of an array.
                #[must_use]
                pub fn from_array(y: [R; #n]) -> Self {
                    let [#(#fields),*] = y;
                    Self { #(#fields,)* #marked }
                }

                /// The components as the array that [`Prepared::rhs`] takes.
                #[must_use]
                pub fn to_array(self) -> [R; #n] {
                    [#(self.#fields),*]
                }
            }
        }
    }

    /// The initial state, where there is one.
    fn initial(&self) -> TokenStream {
        let Some(initial) = &self.module.text.initial else { return TokenStream::new() };
        let (n, doc) = (size(initial.values.len()), doc_attributes(initial.doc()));
        let values = initial.values.iter().copied().map(number);
        let allow = allow_numbers(initial.values.iter().copied());
        quote! {
            #doc
            #allow
            pub const INITIAL: [f64; #n] = [#(#values),*];
        }
    }
}

/// What a field means.
fn meaning(kind: &str, name: &str, doc: &str) -> String {
    if doc.trim().is_empty() { format!("{kind} `{name}`.") } else { sentence(doc) }
}
