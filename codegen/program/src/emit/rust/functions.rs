//! The functions of a scene as methods of `Prepared`: derivative, energy, outputs, products.
//!
//! Does not know: traits of the runtime; `guards` writes what says where the equations end.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::lines;
use super::tokens::{doc_attributes, ident, pattern, sentence, size, statements, taken_apart, wrapped};
use crate::emit::module::{OutputRoutine, ProductRoutine, Routine};
use crate::program::{Function, Role};
use hamel_expr::error::Error;

/// Longer formulas have lines of their own.
const MAX_INLINE: usize = 60;

impl Writer<'_> {
    /// The constructor, and all methods that compute something from time and state.
    pub(super) fn functions(&self) -> Result<TokenStream, Error> {
        let (module, rt) = (self.module, &self.runtime);
        let mut methods = self.constructor();
        methods.extend(self.rate());
        methods.extend(self.circle_functions());
        if let Some(energy) = &module.energy {
            let doc = self.function_doc(energy.function, "Energy.", &[]);
            methods.extend(self.scalar("energy", doc, energy));
        }
        for output in &module.outputs {
            methods.extend(self.output(output));
        }
        methods.extend(self.dense_matrices()?);
        for product in &module.products {
            methods.extend(self.product(product));
        }
        methods.extend(self.implicit_functions());
        methods.extend(self.discrete_functions());
        methods.extend(self.quotient_functions());
        methods.extend(self.flow_functions());
        if let Some(pivots) = &module.pivots {
            methods.extend(self.pivots(pivots));
        }
        if let Some(signature) = &module.signature {
            let title = "A number that stays the same along a motion while no matrix that is solved with \
                         becomes singular.";
            let doc = self.function_doc(signature.function, title, &[]);
            methods.extend(self.scalar("signature", doc, signature));
        }
        if let Some(domain) = &module.domain {
            methods.extend(self.domain(domain));
        }
        let tables = self.tables();
        Ok(quote! {
            #tables

            impl<R: #rt::Real> Prepared<R> {
                #methods
            }
        })
    }

    /// The arguments of a function of time and state.
    pub(super) fn arguments(&self) -> TokenStream {
        let n = size(self.module.state.len());
        quote! { &self, t: R, y: &[R; #n] }
    }

    fn rate(&self) -> TokenStream {
        let (arguments, n) = (self.arguments(), size(self.module.state.len()));
        let rate = &self.module.rate;
        let doc = self.function_doc(rate.function, "Writes the derivative of the state to `dy`.", &[]);
        let results = self.results(rate);
        if !self.module.text.inputs.is_empty() {
            let body = self.body_apart_from_inputs(rate);
            return self.rate_with_inputs(doc, &quote! { #body *dy = #results; });
        }
        let body = self.body(rate);
        quote! {
            #doc
            #[inline]
            pub fn rhs(#arguments, dy: &mut [R; #n]) {
                #body
                *dy = #results;
            }
        }
    }

    /// A method with one result.
    fn scalar(&self, name: &str, doc: TokenStream, routine: &Routine<'_>) -> TokenStream {
        let (name, arguments) = (ident(name), self.arguments());
        let body = self.body(routine);
        let results = routine.code.results.iter().map(|result| lines::expression(&result.text));
        quote! {
            #doc
            #[inline]
            #[must_use]
            pub fn #name(#arguments) -> R {
                #body
                #(#results)*
            }
        }
    }

    fn output(&self, output: &OutputRoutine<'_>) -> TokenStream {
        let OutputRoutine { text, name, routine, .. } = output;
        let meaning =
            if text.doc.trim().is_empty() { format!("Output `{}`.", text.name) } else { sentence(&text.doc) };
        if output.is_scalar() {
            return self.scalar(name, self.function_doc(routine.function, &meaning, &[]), routine);
        }
        let doc = self.function_doc(routine.function, &meaning, &text.components);
        let (body, results) = (self.body(routine), self.results(routine));
        let (name, arguments, k) = (ident(name), self.arguments(), size(routine.function.results.len()));
        quote! {
            #doc
            #[inline]
            #[must_use]
            pub fn #name(#arguments) -> [R; #k] {
                #body
                #results
            }
        }
    }

    fn product(&self, product: &ProductRoutine<'_>) -> TokenStream {
        let ProductRoutine { text, name, routine } = product;
        let doc = self.function_doc(routine.function, &sentence(&text.doc), &[]);
        let (body, results) = (self.body(routine), self.results(routine));
        let (name, vector, arguments) = (ident(name), ident(&text.vector), self.arguments());
        let (n_vector, n_results) = (size(routine.argument.len()), size(routine.function.results.len()));
        // This comes first: a component of the state may have the vector's name.
        let taken_apart = if routine.code.reads_argument() {
            let names = pattern(routine.argument.iter().map(Option::as_ref));
            taken_apart(&names, &format!("*{}", text.vector))
        } else if routine.contracts_argument() {
            TokenStream::new()
        } else {
            quote! { let _ = #vector; }
        };
        let whole = self.argument_of_loops(routine, &vector);
        quote! {
            #doc
            #[inline]
            #[must_use]
            pub fn #name(#arguments, #vector: &[R; #n_vector]) -> [R; #n_results] {
                #whole
                #taken_apart
                #body
                #results
            }
        }
    }

    /// The statements before the results.
    pub(super) fn body(&self, routine: &Routine<'_>) -> TokenStream {
        let (held, body) = (self.held(routine), self.body_apart_from_inputs(routine));
        quote! { #held #body }
    }

    /// The same where the inputs are known already.
    pub(super) fn body_apart_from_inputs(&self, routine: &Routine<'_>) -> TokenStream {
        let reads_time = routine.reads_time() || routine.function.role == Role::Domain;
        let state = pattern(routine.state.iter().map(Option::as_ref));
        let taken_apart = routine.code.reads_state().then(|| taken_apart(&state, "*y"));
        let unused = match (reads_time, routine.code.reads_state() || routine.contracts_state()) {
            (true, true) => None,
            (true, false) => Some(quote! { let _ = y; }),
            (false, true) => Some(quote! { let _ = t; }),
            (false, false) => Some(quote! { let _ = (t, y); }),
        };
        let (statements, loops) = (statements(&routine.code.statements), self.loops(routine));
        quote! { #taken_apart #unused #statements #loops }
    }

    /// What a function computes, by which formula, in which order, and what it costs.
    pub(super) fn function_doc(&self, function: &Function, title: &str, results: &[String]) -> TokenStream {
        let formulas = self.module.text.formulas.get(&function.role);
        doc_by(formulas.map_or(&[], Vec::as_slice), function, title, results)
    }
}

/// The documentation of a function with its formulas.
pub(super) fn doc_by(
    formulas: &[String],
    function: &Function,
    title: &str,
    results: &[String],
) -> TokenStream {
    let mut lines = vec![title.to_owned()];
    match formulas {
        [] => {}
        [formula] if formula.len() <= MAX_INLINE => lines[0].push_str(&format!(" `{formula}`.")),
        formulas => {
            lines.extend([String::new(), "```text".into()]);
            lines.extend(formulas.iter().cloned());
            lines.push("```".into());
        }
    }
    if !results.is_empty() {
        let (what, open) = if function.role == Role::Rate { ("State", "y = [") } else { ("Components", "[") };
        match wrapped(open, results, "]").as_slice() {
            [line] => lines.extend([String::new(), format!("{what}: `{line}`.")]),
            several => {
                lines.extend([String::new(), format!("{what}:"), String::new(), "```text".into()]);
                lines.extend_from_slice(several);
                lines.push("```".into());
            }
        }
    }
    lines.extend(operations(function));
    doc_attributes(lines)
}

/// What a function costs.
pub(super) fn operations(function: &Function) -> Vec<String> {
    let mut lines = vec![String::new(), format!("Operations: {}.", function.counts())];
    let n_products: usize = function.contractions.iter().map(|c| c.n_products).sum();
    if n_products > 0 {
        lines.push(format!("Loops over tables of {n_products} products."));
    }
    lines
}
