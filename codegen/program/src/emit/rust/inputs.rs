//! Inputs: the field that holds them, the right-hand side at others, and `Controlled`.
//!
//! Does not know: what the functions compute, when an input has which value.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::tokens::{allow_numbers, doc_attributes, number, pattern, size, wrapped};
use crate::emit::module::Routine;
use crate::emit::text::ParamText;
use hamel_expr::rational_to_f64;

/// The matrix of the derivatives of the right-hand side by the inputs.
const INPUT_JACOBIAN: &str = "input_jacobian";

impl Writer<'_> {
    fn inputs(&self) -> &[ParamText] {
        &self.module.text.inputs
    }

    /// What the inputs are held at where nothing else was said.
    pub(super) fn input_defaults(&self) -> impl Iterator<Item = f64> + '_ {
        self.inputs().iter().map(|input| rational_to_f64(&input.default))
    }

    /// The field of the structure; nothing where there are no inputs, as everywhere here.
    pub(super) fn input_field(&self) -> TokenStream {
        if self.inputs().is_empty() {
            return TokenStream::new();
        }
        let n = size(self.inputs().len());
        let mut lines =
            vec!["Values that the inputs are held at.".to_owned(), String::new(), "```text".into()];
        let names: Vec<String> = self.inputs().iter().map(|input| input.name.clone()).collect();
        lines.extend(wrapped("u = [", &names, "]"));
        lines.push("```".into());
        let doc = doc_attributes(lines);
        quote! { #doc pub inputs: [R; #n], }
    }

    /// The field in the constructor.
    pub(super) fn inputs_at_defaults(&self) -> TokenStream {
        if self.inputs().is_empty() {
            return TokenStream::new();
        }
        let values = self.input_defaults().map(|x| match x {
            0.0 => quote! { R::ZERO },
            1.0 => quote! { R::ONE },
            x => {
                let x = number(x);
                quote! { R::from_f64(#x) }
            }
        });
        quote! { inputs: [#(#values),*], }
    }

    /// The field over another scalar.
    pub(super) fn inputs_over(&self) -> TokenStream {
        if self.inputs().is_empty() {
            TokenStream::new()
        } else {
            quote! { inputs: self.inputs.map(convert), }
        }
    }

    /// The variables of the inputs that a function reads.
    pub(super) fn held(&self, routine: &Routine<'_>) -> Option<TokenStream> {
        let names = pattern(routine.inputs.iter().map(Option::as_ref));
        routine.reads_inputs().then(|| quote! { let #names = self.inputs; })
    }

    /// The right-hand side at any inputs, and at those that are held.
    pub(super) fn rate_with_inputs(&self, doc: TokenStream, body: &TokenStream) -> TokenStream {
        let (arguments, n, m) = (self.arguments(), size(self.module.state.len()), size(self.inputs().len()));
        let rate = &self.module.rate;
        let names = pattern(rate.inputs.iter().map(Option::as_ref));
        // This comes first: a component of the state may be called `u`.
        let taken_apart = match rate.reads_inputs() {
            true => quote! { let #names = *u; },
            false => quote! { let _ = u; },
        };
        quote! {
            /// Writes the derivative of the state to `dy`, with the inputs at the values that they are held at.
            #[inline]
            pub fn rhs(#arguments, dy: &mut [R; #n]) {
                self.rhs_with(t, y, &self.inputs, dy);
            }

            #doc
            #[inline]
            pub fn rhs_with(#arguments, u: &[R; #m], dy: &mut [R; #n]) {
                #taken_apart
                #body
            }
        }
    }

    /// What signals ask for.
    pub(super) fn controlled(&self) -> TokenStream {
        if self.inputs().is_empty() {
            return TokenStream::new();
        }
        let (rt, arguments, inputs) = (&self.runtime, self.arguments(), self.inputs());
        let (n, m) = (size(self.module.state.len()), size(inputs.len()));
        let infos = inputs.iter().map(|p| {
            let (name, default, doc) = (&p.name, number(rational_to_f64(&p.default)), &p.doc);
            quote! { #rt::ParamInfo { name: #name, default: #default, doc: #doc } }
        });
        let allow = allow_numbers(self.input_defaults());
        let has_jacobian = self.module.matrix_function(INPUT_JACOBIAN).map(super::tokens::ident);
        let jacobian = has_jacobian.map(|function| {
            quote! {
                impl<R: #rt::Real> #rt::InputDifferentiable<R, #m> for Prepared<R> {
                    #[inline]
                    fn input_jacobian(#arguments, jacobian: &mut [[R; #m]]) {
                        for (row, values) in jacobian.iter_mut().zip(self.#function(t, y)) {
                            *row = values;
                        }
                    }
                }
            }
        });
        quote! {
            #allow
            impl<R: #rt::Real> #rt::Controlled<R, #m> for Prepared<R> {
                const INPUTS: [#rt::ParamInfo; #m] = [#(#infos),*];

                #[inline]
                fn held_inputs(&self) -> &[R; #m] {
                    &self.inputs
                }

                #[inline]
                fn hold_inputs(&mut self, u: &[R; #m]) {
                    self.inputs = *u;
                }

                #[inline]
                fn rhs_with(#arguments, u: &[R; #m], dy: &mut [R; #n]) {
                    self.rhs_with(t, y, u, dy);
                }
            }

            #jacobian
        }
    }

    /// The same for drivers that serve any scene.
    pub(super) fn inputs_of(&self) -> TokenStream {
        if self.inputs().is_empty() {
            return TokenStream::new();
        }
        let (rt, m) = (&self.runtime, size(self.inputs().len()));
        quote! {
            const INPUTS_OF: &'static [#rt::ParamInfo] = &<Self as #rt::Controlled<R, #m>>::INPUTS;

            fn hold_inputs_of(&mut self, values: &[R]) {
                if let Ok(values) = <[R; #m]>::try_from(values) {
                    self.inputs = values;
                }
            }
        }
    }
}
