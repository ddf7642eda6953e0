//! The discrete equations of a scene: their functions as methods, and the trait of the runtime.
//!
//! Deliberately does not know: which principle the equations follow from, how steps are solved.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::lines::{self, documentation, literal};
use super::matrices::places;
use super::notation::Rust;
use super::tokens::{doc_attributes, ident, size};
use crate::emit::dialect::Dialect as _;
use crate::emit::module::{DISCRETE, DISCRETE_JACOBIAN, DISCRETE_STATE};

impl Writer<'_> {
    /// Names of the unknowns, places of the state among them and of the derivatives of rows.
    pub(super) fn discrete_constants(&self) -> TokenStream {
        let Some(discrete) = &self.module.discrete else { return TokenStream::new() };
        let text = discrete.text;
        let names: Vec<String> = text.unknowns.iter().map(|name| literal(name)).collect();
        let state: Vec<String> = text.state.iter().map(usize::to_string).collect();
        let doc = "Unknowns of a step by the discrete equations: coordinates at its end, velocities in its middle, velocities \
                   at its end.";
        let unknowns = lines::statements(&format!(
            "{}pub const {DISCRETE}: &[&str] = {};\n",
            documentation([doc]),
            lines::list("&[", &names, "]"),
        ));
        let doc = format!("The place in [`{DISCRETE}`] of each component of the state at the end of a step.");
        let state = lines::statements(&format!(
            "{}pub const {DISCRETE_STATE}: [usize; {}] = {};\n",
            documentation([doc.as_str()]),
            state.len(),
            lines::list("[", &state, "]"),
        ));
        let (name, n) = (ident(&Rust.places(DISCRETE_JACOBIAN)), size(text.pattern.len()));
        let places = places(&text.pattern);
        let doc = doc_attributes([format!(
            "Row and column of each entry that [`Prepared::{}`] computes; the others vanish identically.",
            discrete.jacobian.name
        )]);
        quote! {
            #unknowns

            #state

            #doc
            pub const #name: [(usize, usize); #n] = #places;
        }
    }

    /// The functions of `(h, y, z)`.
    pub(super) fn discrete_functions(&self) -> TokenStream {
        let mut methods = TokenStream::new();
        for function in self.module.discrete.iter().flat_map(|discrete| discrete.all()) {
            let results: Vec<String> =
                function.routine.function.results.iter().map(|(name, _)| name.clone()).collect();
            let doc = self.function_doc(function.routine.function, function.title, &results);
            methods.extend(self.of_variables(&function.name, doc, &function.routine));
        }
        methods
    }

    /// What methods by discrete equations ask for.
    pub(super) fn discrete(&self) -> TokenStream {
        let Some(discrete) = &self.module.discrete else { return TokenStream::new() };
        let (rt, text) = (&self.runtime, discrete.text);
        let (n_state, n) = (text.state.len(), text.unknowns.len());
        let [start, residual, jacobian] = discrete.all().map(|function| ident(&function.name));
        let (pattern, state) = (ident(&Rust.places(DISCRETE_JACOBIAN)), ident(DISCRETE_STATE));
        let (first, all) = (size(1 + n_state), size(1 + n_state + n));
        let (n_state, n) = (size(n_state), size(n));
        quote! {
            impl<R: #rt::Real> Prepared<R> {
                /// `(h, y, z)` as one vector.
                #[inline]
                fn discrete_variables(h: R, y: &[R; #n_state], z: &[R; #n]) -> [R; #all] {
                    let mut variables = [h; #all];
                    variables[1..#first].copy_from_slice(y);
                    variables[#first..].copy_from_slice(z);
                    variables
                }
            }

            impl<R: #rt::Real> #rt::Discrete<R> for Prepared<R> {
                type Unknowns = [R; #n];

                #[inline]
                fn discrete_unknowns(&self) -> [R; #n] {
                    [R::ZERO; #n]
                }

                #[inline]
                fn discrete_start(&self, t: R, h: R, y: &[R; #n_state], z: &mut [R; #n]) {
                    *z = self.#start(t, &Self::discrete_variables(h, y, z));
                }

                #[inline]
                fn discrete_residual(&self, t: R, h: R, y: &[R; #n_state], z: &[R; #n], residual: &mut [R; #n]) {
                    *residual = self.#residual(t, &Self::discrete_variables(h, y, z));
                }

                #[inline]
                fn discrete_jacobian(
                    &self,
                    t: R,
                    h: R,
                    y: &[R; #n_state],
                    z: &[R; #n],
                    jacobian: &mut [[R; #n]],
                ) {
                    let entries = self.#jacobian(t, &Self::discrete_variables(h, y, z));
                    for row in jacobian.iter_mut() {
                        *row = [R::ZERO; #n];
                    }
                    for (&(i, j), entry) in #pattern.iter().zip(entries) {
                        jacobian[i][j] = entry;
                    }
                }

                #[inline]
                fn discrete_end(&self, z: &[R; #n], y: &mut [R; #n_state]) {
                    for (component, place) in y.iter_mut().zip(#state) {
                        *component = z[place];
                    }
                }
            }
        }
    }
}
