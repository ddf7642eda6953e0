//! The implicit form of a scene: its right-hand side and Jacobian as methods, and the trait of the runtime.
//!
//! Does not know: what the variables are, or why a row is algebraic.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::notation::Rust;
use super::tokens::{doc_attributes, ident, idents, parse_all, pattern, size, statements};
use crate::emit::dialect::Dialect as _;
use crate::emit::module::{IMPLICIT, IMPLICIT_JACOBIAN, ImplicitRoutines, Routine};
use hamel_expr::error::Error;

impl Writer<'_> {
    /// What the variables are, and where the entries of the Jacobian are.
    pub(super) fn implicit_constants(&self) -> TokenStream {
        let Some(ImplicitRoutines { text, .. }) = &self.module.implicit else { return TokenStream::new() };
        let rt = &self.runtime;
        let variables = text.variables.iter().map(|variable| {
            let (name, doc, is_differential) = (&variable.name, &variable.doc, variable.is_differential);
            quote! { #rt::ImplicitVariable { name: #name, doc: #doc, is_differential: #is_differential } }
        });
        let (name, index) = (ident(IMPLICIT), size(text.index));
        let state = text.state.iter().map(|place| size(*place));
        let (places, n) = (ident(&Rust.places(IMPLICIT_JACOBIAN)), size(text.pattern.len()));
        let pairs = text.pattern.iter().map(|(i, j)| {
            let (i, j) = (size(*i), size(*j));
            quote! { (#i, #j) }
        });
        let entries = &self.module.implicit.as_ref().map_or("", |routines| &routines.entries);
        let doc = doc_attributes([format!(
            "Row and column of each entry that [`Prepared::{entries}`] computes; the others vanish identically."
        )]);
        quote! {
            /// The variables `z` of the implicit form `M z' = f(t, z)`, its mass matrix and its index.
            pub const #name: #rt::ImplicitInfo = #rt::ImplicitInfo {
                variables: &[#(#variables),*],
                index: #index,
                state: &[#(#state),*],
            };

            #doc
            pub const #places: [(usize, usize); #n] = [#(#pairs),*];
        }
    }

    /// `f(t, z)` and `df/dz`.
    pub(super) fn implicit_functions(&self) -> Result<TokenStream, Error> {
        let Some(implicit) = &self.module.implicit else { return Ok(TokenStream::new()) };
        let ImplicitRoutines { text, right, rhs, jacobian, entries, all, .. } = implicit;
        let title = "Right-hand side `f(t, z)` of the implicit form `M z' = f(t, z)`; rows whose variable is algebraic \
                     vanish along the motion.";
        let names: Vec<String> = text.variables.iter().map(|v| v.name.clone()).collect();
        let mut methods = self.of_variables(rhs, self.function_doc(right.function, title, &names), right)?;
        let title = "Entries `df_i/dz_j` of the Jacobian of the implicit form that do not vanish identically, row by \
                     row.";
        methods.extend(self.of_variables(
            entries,
            self.function_doc(jacobian.function, title, &[]),
            jacobian,
        )?);
        let n = names.len();
        let locals = idents((0..text.pattern.len()).map(|k| format!("e{k}")));
        let mut values = vec![vec![quote! { R::ZERO }; n]; n];
        for ((i, j), name) in text.pattern.iter().zip(&locals) {
            values[*i][*j] = quote! { #name };
        }
        let rows = values.iter().map(|row| quote! { [#(#row),*] });
        let (constant, n) = (Rust.places(IMPLICIT_JACOBIAN), size(n));
        let doc = doc_attributes([
            "Matrix `df_i/dz_j` of the implicit form.".to_owned(),
            String::new(),
            format!("The entries of [`Self::{entries}`] at the places [`{constant}`], zero elsewhere."),
        ]);
        let (all, entries) = (ident(all), ident(entries));
        methods.extend(quote! {
            #doc
            #[inline]
            #[must_use]
            pub fn #all(&self, t: R, z: &[R; #n]) -> [[R; #n]; #n] {
                let [#(#locals),*] = self.#entries(t, z);
                [#(#rows),*]
            }
        });
        Ok(methods)
    }

    /// A method of time and variables.
    fn of_variables(
        &self,
        name: &str,
        doc: TokenStream,
        routine: &Routine<'_>,
    ) -> Result<TokenStream, Error> {
        let (statements, results) =
            (statements(&routine.code.statements)?, parse_all(&routine.code.results)?);
        let (name, n, k) = (ident(name), size(routine.argument.len()), size(results.len()));
        let variables = pattern(routine.argument.iter().map(Option::as_ref));
        let taken_apart = match routine.code.reads_argument() {
            true => quote! { let #variables = *z; },
            false => quote! { let _ = z; },
        };
        let held = self.held(routine);
        let unused = (!routine.reads_time()).then(|| quote! { let _ = t; });
        Ok(quote! {
            #doc
            #[inline]
            #[must_use]
            pub fn #name(&self, t: R, z: &[R; #n]) -> [R; #k] {
                #unused
                #held
                #taken_apart
                #statements
                [#(#results),*]
            }
        })
    }

    /// What solvers of equations with a mass matrix ask for.
    pub(super) fn implicit(&self) -> TokenStream {
        let Some(implicit) = &self.module.implicit else { return TokenStream::new() };
        let (rt, arguments) = (&self.runtime, self.arguments());
        let (n, info) = (size(implicit.text.variables.len()), ident(IMPLICIT));
        let [rhs, all, values] = [&implicit.rhs, &implicit.all, &implicit.values].map(|name| ident(name));
        quote! {
            impl<R: #rt::Real> #rt::Implicit<R> for Prepared<R> {
                type Variables = [R; #n];
                const IMPLICIT: #rt::ImplicitInfo = #info;

                #[inline]
                fn consistent(#arguments) -> [R; #n] {
                    self.#values(t, y)
                }

                #[inline]
                fn implicit_rhs(&self, t: R, z: &[R; #n], f: &mut [R; #n]) {
                    *f = self.#rhs(t, z);
                }

                #[inline]
                fn implicit_jacobian(&self, t: R, z: &[R; #n], jacobian: &mut [[R; #n]]) {
                    for (row, values) in jacobian.iter_mut().zip(self.#all(t, z)) {
                        *row = values;
                    }
                }
            }
        }
    }
}
