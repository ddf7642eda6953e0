//! The implicit form of a scene: its right-hand side and Jacobian as methods, and the trait of the runtime.
//!
//! Does not know: what the variables are, or why a row is algebraic.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::lines::{self, documentation, literal};
use super::matrices::{places, rows};
use super::notation::Rust;
use super::tokens::{array, doc_attributes, ident, pattern, size, statements, taken_apart, texts};
use crate::emit::dialect::Dialect as _;
use crate::emit::module::{IMPLICIT, IMPLICIT_JACOBIAN, ImplicitRoutines, Routine};

impl Writer<'_> {
    /// What the variables are, and where the entries of the Jacobian are.
    pub(super) fn implicit_constants(&self) -> TokenStream {
        let Some(ImplicitRoutines { text, .. }) = &self.module.implicit else { return TokenStream::new() };
        let rt = &self.path;
        let variables: String = (text.variables.iter())
            .map(|variable| {
                let (name, doc) = (literal(&variable.name), literal(&variable.doc));
                format!("        {rt}::ImplicitVariable::new({name}, {doc}, {}),\n", variable.is_differential)
            })
            .collect();
        let state: Vec<String> = text.state.iter().map(usize::to_string).collect();
        let info = lines::statements(&format!(
            "{}{}\npub const {IMPLICIT}: {rt}::ImplicitInfo = {rt}::ImplicitInfo::new(\n    &[\n{variables}    ],\n    \
             {},\n{},\n);",
            documentation([
                "The variables `z` of the implicit form `M z' = f(t, z)`, its mass matrix and its index."
            ]),
            lines::ALLOW,
            text.index,
            lines::indented(&lines::list("&[", &state, "]")),
        ));
        let (name, n) = (ident(&Rust.places(IMPLICIT_JACOBIAN)), size(text.pattern.len()));
        let places = places(&text.pattern);
        let entries = &self.module.implicit.as_ref().map_or("", |routines| &routines.entries);
        let doc = doc_attributes([format!(
            "Row and column of each entry that [`Prepared::{entries}`] computes; the others vanish identically."
        )]);
        quote! {
            #info

            #doc
            pub const #name: [(usize, usize); #n] = #places;
        }
    }

    /// `f(t, z)` and `df/dz`.
    pub(super) fn implicit_functions(&self) -> TokenStream {
        let Some(implicit) = &self.module.implicit else { return TokenStream::new() };
        let ImplicitRoutines { text, right, rhs, jacobian, entries, all, .. } = implicit;
        let title = "Right-hand side `f(t, z)` of the implicit form `M z' = f(t, z)`; rows whose variable is algebraic \
                     vanish along the motion.";
        let names: Vec<String> = text.variables.iter().map(|v| v.name.clone()).collect();
        let mut methods = self.of_variables(rhs, self.function_doc(right.function, title, &names), right);
        let title = "Entries `df_i/dz_j` of the Jacobian of the implicit form that do not vanish identically, row by \
                     row.";
        methods.extend(self.of_variables(
            entries,
            self.function_doc(jacobian.function, title, &[]),
            jacobian,
        ));
        let n = names.len();
        let locals: Vec<String> = (0..text.pattern.len()).map(|k| format!("e{k}")).collect();
        let mut values = vec![vec!["R::ZERO".to_owned(); n]; n];
        for ((i, j), name) in text.pattern.iter().zip(&locals) {
            values[*i][*j].clone_from(name);
        }
        let rows = rows(&values);
        let apart = taken_apart(&lines::array(&locals), &format!("self.{entries}(t, z)"));
        let (constant, n) = (Rust.places(IMPLICIT_JACOBIAN), size(n));
        let doc = doc_attributes([
            "Matrix `df_i/dz_j` of the implicit form.".to_owned(),
            String::new(),
            format!("The entries of [`Self::{entries}`] at the places [`{constant}`], zero elsewhere."),
        ]);
        let all = ident(all);
        methods.extend(quote! {
            #doc
            #[inline]
            #[must_use]
            pub fn #all(&self, t: R, z: &[R; #n]) -> [[R; #n]; #n] {
                #apart
                #rows
            }
        });
        methods
    }

    /// A method of time and variables.
    pub(super) fn of_variables(&self, name: &str, doc: TokenStream, routine: &Routine<'_>) -> TokenStream {
        let (statements, results) =
            (statements(&routine.code.statements), array(&texts(&routine.code.results)));
        let (n, k) = (size(routine.argument.len()), size(routine.code.results.len()));
        let name = ident(name);
        let variables = pattern(routine.argument.iter().map(Option::as_ref));
        let taken_apart = match routine.code.reads_argument() {
            true => taken_apart(&variables, "*z"),
            false => quote! { let _ = z; },
        };
        let held = self.held(routine);
        let unused = (!routine.reads_time()).then(|| quote! { let _ = t; });
        quote! {
            #doc
            #[inline]
            #[must_use]
            pub fn #name(&self, t: R, z: &[R; #n]) -> [R; #k] {
                #unused
                #held
                #taken_apart
                #statements
                #results
            }
        }
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
