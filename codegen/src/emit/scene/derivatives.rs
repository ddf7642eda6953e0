//! Matrices from their entries, and functions that take a vector besides time and state.

use proc_macro2::TokenStream;
use quote::quote;

use super::{Ident, Module, Written, doc_attributes, expect_size, ident, missing, sentence, size};
use crate::emit::{MatrixText, ProductText};
use crate::error::Error;
use crate::program::{Function, Role};

/// The matrix that [`hamel_runtime::Differentiable`] is about.
const JACOBIAN: &str = "jacobian";

/// The output that [`hamel_runtime::Invariants`] is about, and the matrix of its gradients.
const INVARIANTS: &str = "invariants";
const GRADIENTS: &str = "invariant_gradients";

/// Name of the method that computes the entries of a matrix.
pub(super) fn entries_method(matrix: &str) -> String {
    format!("{matrix}_nonzeros")
}

fn pattern_constant(matrix: &MatrixText) -> Ident {
    ident(&format!("{}_PATTERN", matrix.name.to_ascii_uppercase()))
}

impl<'a> Module<'a> {
    /// Whether an output is the entries of a matrix.
    pub(super) fn matrix(&self, output: &str) -> Option<&'a MatrixText> {
        self.text.matrices.iter().find(|m| m.name == output)
    }

    /// The entries' method and the matrix's.
    fn matrix_methods(&self, matrix: &MatrixText) -> Result<(&Ident, Ident), Error> {
        let found = self.outputs.iter().find(|(output, ..)| output.name == matrix.name);
        let (output, _, entries) = found.ok_or_else(|| Error::UnknownName {
            name: matrix.name.clone(),
            kind: "output with the entries of a matrix",
            known: self.text.outputs.iter().map(|o| o.name.clone()).collect(),
        })?;
        let what = format!("pattern of {}", matrix.name);
        expect_size(&what, matrix.pattern.len(), output.components.len())?;
        Ok((entries, ident(&matrix.name)))
    }

    /// Where the entries of each matrix are.
    pub(super) fn patterns(&self) -> TokenStream {
        let mut constants = TokenStream::new();
        for matrix in &self.text.matrices {
            let (name, n) = (pattern_constant(matrix), size(matrix.pattern.len()));
            let pairs = matrix.pattern.iter().map(|(i, j)| {
                let (i, j) = (size(*i), size(*j));
                quote! { (#i, #j) }
            });
            let title = format!(
                "Row and column of each entry that [`Prepared::{}`] computes; the others vanish identically.",
                entries_method(&matrix.name)
            );
            let doc = doc_attributes([title]);
            constants.extend(quote! {
                #doc
                pub const #name: [(usize, usize); #n] = [#(#pairs),*];
            });
        }
        constants
    }

    /// Each matrix with its zeros.
    pub(super) fn dense_matrices(&self) -> Result<TokenStream, Error> {
        let mut methods = TokenStream::new();
        let n = size(self.state.len());
        for matrix in &self.text.matrices {
            let (entries, method) = self.matrix_methods(matrix)?;
            let (n_rows, n_columns) = matrix.shape;
            let names: Vec<Ident> = (0..matrix.pattern.len()).map(|k| ident(&format!("e{k}"))).collect();
            let mut values = vec![vec![quote! { R::ZERO }; n_columns]; n_rows];
            for ((i, j), name) in matrix.pattern.iter().zip(&names) {
                let place = values.get_mut(*i).and_then(|row| row.get_mut(*j));
                let place = place.ok_or_else(|| Error::ShapeMismatch {
                    what: format!("row or column of an entry of {}", matrix.name),
                    found: *i.max(j),
                    expected: n_rows.max(n_columns),
                })?;
                *place = quote! { #name };
            }
            let rows = values.iter().map(|row| quote! { [#(#row),*] });
            let (n_rows, n_columns) = (size(n_rows), size(n_columns));
            let constant = pattern_constant(matrix);
            let doc = doc_attributes([
                sentence(&matrix.doc),
                String::new(),
                format!("The entries of [`Self::{entries}`] at the places [`{constant}`], zero elsewhere."),
            ]);
            let call = if names.is_empty() {
                quote! { let _ = (t, y); }
            } else {
                quote! { let [#(#names),*] = self.#entries(t, y); }
            };
            methods.extend(quote! {
                #doc
                #[inline]
                #[must_use]
                pub fn #method(&self, t: R, y: &[R; #n]) -> [[R; #n_columns]; #n_rows] {
                    #call
                    [#(#rows),*]
                }
            });
        }
        Ok(methods)
    }

    /// The function of a product, its sizes checked.
    pub(super) fn product(&self, product: &ProductText) -> Result<&'a Function, Error> {
        let role = Role::Product(product.name.clone());
        let function = self.function(&role).ok_or_else(|| missing(self.program, &role))?;
        expect_size(&format!("product {}", product.name), product.components.len(), function.results.len())?;
        Ok(function)
    }

    /// The method of a product.
    pub(super) fn product_method(
        &self,
        product: &ProductText,
        function: &Function,
        written: Written,
    ) -> TokenStream {
        let (n, n_vector, n_results) =
            (size(self.state.len()), size(function.argument.len()), size(function.results.len()));
        let (method, vector) = (ident(&product.name), ident(&product.vector));
        let doc = self.function_doc(function, &sentence(&product.doc), &[]);
        let Written { statements, results, .. } = written;
        quote! {
            #doc
            #[inline]
            #[must_use]
            pub fn #method(&self, t: R, y: &[R; #n], #vector: &[R; #n_vector]) -> [R; #n_results] {
                #statements
                [#(#results),*]
            }
        }
    }

    /// Number of the invariants, and the methods of their values and gradients.
    fn invariant_methods(&self) -> Option<(usize, &Ident, Ident)> {
        let gradients = self.matrix(GRADIENTS)?;
        let (output, _, values) = self.outputs.iter().find(|(output, ..)| output.name == INVARIANTS)?;
        Some((output.components.len(), values, ident(&gradients.name)))
    }

    /// What projection asks for.
    pub(super) fn invariants(&self) -> TokenStream {
        let Some((n_invariants, values, gradients)) = self.invariant_methods() else {
            return TokenStream::new();
        };
        let (n, k) = (size(self.state.len()), size(n_invariants));
        quote! {
            impl<R: ::hamel_runtime::Real> ::hamel_runtime::Invariants<R, #k> for Prepared<R> {
                #[inline]
                fn values(&self, t: R, y: &[R; #n]) -> [R; #k] {
                    self.#values(t, y)
                }

                #[inline]
                fn gradients(&self, t: R, y: &[R; #n], gradients: &mut [[R; #n]; #k]) {
                    *gradients = self.#gradients(t, y);
                }
            }
        }
    }

    /// The same for drivers that serve any scene.
    pub(super) fn invariants_of(&self) -> TokenStream {
        let Some((n_invariants, ..)) = self.invariant_methods() else { return TokenStream::new() };
        let (n, k) = (size(self.state.len()), size(n_invariants));
        quote! {
            const N_INVARIANTS: usize = #k;

            fn invariants_of(&self, t: R, y: &[R; #n], values: &mut [R]) {
                if let Ok(values) = <&mut [R; #k]>::try_from(values) {
                    *values = ::hamel_runtime::Invariants::values(self, t, y);
                }
            }

            fn invariant_gradients_of(&self, t: R, y: &[R; #n], gradients: &mut [[R; #n]]) {
                if let Ok(gradients) = <&mut [[R; #n]; #k]>::try_from(gradients) {
                    ::hamel_runtime::Invariants::gradients(self, t, y, gradients);
                }
            }
        }
    }

    /// What implicit methods ask for.
    pub(super) fn differentiable(&self) -> TokenStream {
        if self.matrix(JACOBIAN).is_none() {
            return TokenStream::new();
        }
        let n = size(self.state.len());
        quote! {
            impl<R: ::hamel_runtime::Real> ::hamel_runtime::Differentiable<R> for Prepared<R> {
                #[inline]
                fn jacobian(&self, t: R, y: &[R; #n], jacobian: &mut [[R; #n]]) {
                    for (row, values) in jacobian.iter_mut().zip(self.jacobian(t, y)) {
                        *row = values;
                    }
                }
            }
        }
    }
}
