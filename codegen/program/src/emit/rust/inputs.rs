//! Inputs: the field that holds them, the right-hand side at others, and `Controlled`.
//!
//! Does not know: what the functions compute, when an input has which value.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::lines;
use super::lines::{allow, array, documentation, indented};
use super::tokens::{pattern, size, taken_apart, wrapped};
use crate::emit::module::Routine;
use crate::emit::text::ParamText;
use hamel_expr::rational_to_f64;

/// The matrix of the derivatives of the right-hand side by the inputs.
const INPUT_JACOBIAN: &str = "input_jacobian";

impl Writer<'_> {
    fn inputs(&self) -> &[ParamText] {
        &self.module.text.inputs
    }

    /// The field of the structure; nothing where there are no inputs, as everywhere here.
    pub(super) fn input_field(&self) -> String {
        if self.inputs().is_empty() {
            return String::new();
        }
        let mut doc = vec!["Values that the inputs are held at.".to_owned(), String::new(), "```text".into()];
        let names: Vec<String> = self.inputs().iter().map(|input| input.name.clone()).collect();
        doc.extend(wrapped("u = [", &names, "]"));
        doc.push("```".into());
        indented(&format!("{}pub inputs: [R; {}],", documentation(doc), names.len())) + "\n"
    }

    /// The field in the constructor: the values of the model.
    pub(super) fn inputs_at_defaults(&self) -> Option<String> {
        let values = self.inputs().iter().map(|input| match rational_to_f64(&input.default) {
            0.0 => "R::ZERO".to_owned(),
            1.0 => "R::ONE".to_owned(),
            x => format!("R::from_f64({x:?})"),
        });
        let values: Vec<String> = values.collect();
        (!values.is_empty()).then(|| format!("inputs: {}", array(&values)))
    }

    /// The variables of the inputs that a function reads.
    pub(super) fn held(&self, routine: &Routine<'_>) -> Option<TokenStream> {
        let names = pattern(routine.inputs.iter().map(Option::as_ref));
        routine.reads_inputs().then(|| taken_apart(&names, "self.inputs"))
    }

    /// The right-hand side at any inputs, and at those that are held.
    pub(super) fn rate_with_inputs(&self, doc: TokenStream, body: &TokenStream) -> TokenStream {
        let (arguments, n, m) = (self.arguments(), size(self.module.state.len()), size(self.inputs().len()));
        let rate = &self.module.rate;
        let names = pattern(rate.inputs.iter().map(Option::as_ref));
        // This comes first: a component of the state may be called `u`.
        let apart = match rate.reads_inputs() {
            true => taken_apart(&names, "*u"),
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
                #apart
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
        let infos: Vec<String> = inputs.iter().map(|input| self.param_info(input)).collect();
        let (infos, allow) = (lines::expression(&array(&infos)), allow());
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
                const INPUTS: [#rt::ParamInfo; #m] = #infos;

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
