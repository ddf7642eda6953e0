//! The exact flows of a scene as methods, and the traits of the runtime that ask for them.
//!
//! Does not know: how flows are found, how they are composed.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::tokens::{ident, pattern, size, statements, taken_apart};
use crate::emit::module::FlowRoutine;

impl Writer<'_> {
    /// A method for each flow.
    pub(super) fn flow_functions(&self) -> TokenStream {
        let mut methods = TokenStream::new();
        for FlowRoutine { name, text, routine } in &self.module.flows {
            let title = format!(
                "What the flow of the part of the Hamiltonian that is a function of `{}` adds to the state in the time \
                 `tau`.",
                text.forms.join("`, `")
            );
            let doc = self.function_doc(routine.function, &title, &[]);
            let (name, n) = (ident(name), size(self.module.state.len()));
            let tau = match routine.argument.first() {
                Some(Some(name)) => ident(name),
                _ => ident("_tau"),
            };
            let state = pattern(routine.state.iter().map(Option::as_ref));
            let taken_apart = match routine.code.reads_state() {
                true => taken_apart(&state, "*y"),
                false => quote! { let _ = y; },
            };
            let (statements, results) = (statements(&routine.code.statements), self.results(routine));
            methods.extend(quote! {
                #doc
                #[inline]
                #[must_use]
                pub fn #name(&self, #tau: R, y: &[R; #n]) -> [R; #n] {
                    #taken_apart
                    #statements
                    #results
                }
            });
        }
        methods
    }

    /// What compositions of flows ask for.
    pub(super) fn exact_flows(&self) -> TokenStream {
        let flows = &self.module.flows;
        if flows.is_empty() {
            return TokenStream::new();
        }
        let (rt, n, n_flows) = (&self.runtime, size(self.module.state.len()), size(flows.len()));
        let arms = flows.iter().enumerate().map(|(k, flow)| {
            let (k, name) = (size(k), ident(&flow.name));
            quote! { #k => self.#name(tau, y) }
        });
        quote! {
            impl<R: #rt::Real> #rt::ExactFlows<R> for Prepared<R> {
                #[inline]
                fn n_flows(&self) -> usize {
                    #n_flows
                }

                #[inline]
                fn flow(&self, index: usize, tau: R, y: &[R; #n], increment: &mut [R; #n]) {
                    *increment = match index {
                        #(#arms,)*
                        _ => [R::ZERO; #n],
                    };
                }
            }
        }
    }

    /// The same for drivers that serve any scene.
    pub(super) fn flow_of(&self) -> TokenStream {
        if self.module.flows.is_empty() {
            return TokenStream::new();
        }
        let (rt, n, n_flows) = (&self.runtime, size(self.module.state.len()), size(self.module.flows.len()));
        quote! {
            const N_FLOWS: usize = #n_flows;

            fn flow_of(&self, index: usize, tau: R, y: &[R; #n], increment: &mut [R; #n]) {
                #rt::ExactFlows::flow(self, index, tau, y, increment);
            }
        }
    }
}
