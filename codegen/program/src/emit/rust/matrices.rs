//! Matrices from their entries, and the traits of the runtime that ask for matrices or products with them.
//!
//! Does not know: which derivatives a scene wants, or how their entries are computed.

use std::collections::BTreeSet;

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::lines;
use super::notation::Rust;
use super::tokens::{array, doc_attributes, ident, sentence, size, taken_apart};
use crate::emit::dialect::Dialect as _;
use hamel_expr::error::Error;

impl Writer<'_> {
    /// Where the entries of each matrix are.
    pub(super) fn patterns(&self) -> TokenStream {
        let mut constants = TokenStream::new();
        for output in &self.module.outputs {
            let Some((matrix, _)) = &output.matrix else { continue };
            let (name, n) = (ident(&Rust.places(&matrix.name)), size(matrix.pattern.len()));
            let places = places(&matrix.pattern);
            let others = if matrix.is_antisymmetric {
                "those below the diagonal are minus these, the others vanish identically"
            } else {
                "the others vanish identically"
            };
            let title = format!(
                "Row and column of each entry that [`Prepared::{}`] computes; {others}.",
                output.name
            );
            let doc = doc_attributes([title]);
            constants.extend(quote! {
                #doc
                pub const #name: [(usize, usize); #n] = #places;
            });
        }
        constants
    }

    /// Each matrix with its zeros.
    pub(super) fn dense_matrices(&self) -> Result<TokenStream, Error> {
        let mut methods = TokenStream::new();
        let arguments = self.arguments();
        for output in &self.module.outputs {
            let Some((matrix, method)) = &output.matrix else { continue };
            let (entries, method) = (ident(&output.name), ident(method));
            let (n_rows, n_columns) = matrix.shape;
            let names: Vec<String> = (0..matrix.pattern.len()).map(|k| format!("e{k}")).collect();
            let mut values = vec![vec!["R::ZERO".to_owned(); n_columns]; n_rows];
            for ((i, j), name) in matrix.pattern.iter().zip(&names) {
                let place = values.get_mut(*i).and_then(|row| row.get_mut(*j));
                let place = place.ok_or_else(|| Error::ShapeMismatch {
                    what: format!("row or column of an entry of {}", matrix.name),
                    found: *i.max(j),
                    expected: n_rows.max(n_columns),
                })?;
                place.clone_from(name);
                if matrix.is_antisymmetric {
                    values[*j][*i] = format!("-{name}");
                }
            }
            let rows = rows(&values);
            let (n_rows, n_columns) = (size(n_rows), size(n_columns));
            let constant = Rust.places(&matrix.name);
            let elsewhere = if matrix.is_antisymmetric { "minus these below the diagonal, " } else { "" };
            let doc = doc_attributes([
                sentence(&matrix.doc),
                String::new(),
                format!(
                    "The entries of [`Self::{entries}`] at the places [`{constant}`], {elsewhere}zero elsewhere."
                ),
            ]);
            let call = if names.is_empty() {
                quote! { let _ = (t, y); }
            } else {
                taken_apart(&lines::array(&names), &format!("self.{}(t, y)", output.name))
            };
            methods.extend(quote! {
                #doc
                #[inline]
                #[must_use]
                pub fn #method(#arguments) -> [[R; #n_columns]; #n_rows] {
                    #call
                    #rows
                }
            });
        }
        Ok(methods)
    }

    /// What implicit methods ask for.
    pub(super) fn differentiable(&self) -> TokenStream {
        let Some(jacobian) = self.module.jacobian().map(ident) else { return TokenStream::new() };
        let (rt, arguments, n) = (&self.runtime, self.arguments(), size(self.module.state.len()));
        quote! {
            impl<R: #rt::Real> #rt::Differentiable<R> for Prepared<R> {
                #[inline]
                fn jacobian(#arguments, jacobian: &mut [[R; #n]]) {
                    for (row, values) in jacobian.iter_mut().zip(self.#jacobian(t, y)) {
                        *row = values;
                    }
                }
            }
        }
    }

    /// What gradients in reverse mode ask for.
    pub(super) fn adjoint(&self) -> TokenStream {
        let Some([by_state, by_params]) = self.module.pull_backs() else { return TokenStream::new() };
        let (by_state, by_params) = (ident(by_state), ident(by_params));
        let (rt, arguments) = (&self.runtime, self.arguments());
        let (n, n_params) = (size(self.module.state.len()), size(self.module.params.len()));
        quote! {
            impl<R: #rt::Real> #rt::Adjoint<R> for Prepared<R> {
                const N_PARAMS: usize = #n_params;

                #[inline]
                fn pull_back(#arguments, w: &[R; #n], by_state: &mut [R; #n], by_params: &mut [R]) {
                    *by_state = self.#by_state(t, y, w);
                    for (sum, term) in by_params.iter_mut().zip(self.#by_params(t, y, w)) {
                        *sum += term;
                    }
                }
            }
        }
    }

    /// What projection asks for.
    pub(super) fn invariants(&self) -> TokenStream {
        let Some((n_invariants, values, gradients)) = self.module.invariants() else {
            return TokenStream::new();
        };
        let (values, gradients) = (ident(values), ident(gradients));
        let (rt, arguments) = (&self.runtime, self.arguments());
        let (n, k) = (size(self.module.state.len()), size(n_invariants));
        quote! {
            impl<R: #rt::Real> #rt::Invariants<R, #k> for Prepared<R> {
                #[inline]
                fn values(#arguments) -> [R; #k] {
                    self.#values(t, y)
                }

                #[inline]
                fn gradients(#arguments, gradients: &mut [[R; #n]; #k]) {
                    *gradients = self.#gradients(t, y);
                }
            }
        }
    }

    /// The same for drivers that serve any scene.
    pub(super) fn invariants_of(&self) -> TokenStream {
        let Some((n_invariants, ..)) = self.module.invariants() else { return TokenStream::new() };
        let (rt, arguments) = (&self.runtime, self.arguments());
        let (n, k) = (size(self.module.state.len()), size(n_invariants));
        quote! {
            const N_INVARIANTS: usize = #k;

            fn invariants_of(#arguments, values: &mut [R]) {
                if let Ok(values) = <&mut [R; #k]>::try_from(values) {
                    *values = #rt::Invariants::values(self, t, y);
                }
            }

            fn invariant_gradients_of(#arguments, gradients: &mut [[R; #n]]) {
                if let Ok(gradients) = <&mut [[R; #n]; #k]>::try_from(gradients) {
                    #rt::Invariants::gradients(self, t, y, gradients);
                }
            }
        }
    }

    /// What following the rank of constraints asks for.
    pub(super) fn independent_rows(&self) -> TokenStream {
        let Some((text, output)) = self.module.ranks() else { return TokenStream::new() };
        let pattern = output.pattern();
        let (rt, arguments) = (&self.runtime, self.arguments());
        let own = || pattern.iter().enumerate().filter(|(_, (i, _))| text.rows.contains(i));
        let columns: BTreeSet<usize> = own().map(|(_, (_, j))| *j).collect();
        let mut values = vec![vec!["R::ZERO".to_owned(); columns.len()]; text.rows.len()];
        let mut read = vec!["_".to_owned(); pattern.len()];
        for (k, (i, j)) in own() {
            read[k] = format!("e{k}");
            let row = text.rows.iter().position(|own| own == i).unwrap_or_default();
            values[row][columns.range(..j).count()].clone_from(&read[k]);
        }
        let call = taken_apart(&lines::array(&read), &format!("self.{}(t, y)", output.name));
        let (rows, n, k) = (rows(&values), size(columns.len()), size(text.rows.len()));
        let moving = text.moving.iter().map(|at| size(*at));
        quote! {
            impl<R: #rt::Real> #rt::IndependentRows<R> for Prepared<R> {
                type Row = [R; #n];

                type Rows = [[R; #n]; #k];

                #[inline]
                fn moving(&self) -> &[usize] {
                    &[#(#moving),*]
                }

                #[inline]
                fn rows(#arguments) -> [[R; #n]; #k] {
                    #call
                    #rows
                }
            }
        }
    }

    /// What solving the equations between coordinates asks for.
    pub(super) fn positions(&self) -> TokenStream {
        let Some((text, n_functions, values, gradients)) = self.module.positions() else {
            return TokenStream::new();
        };
        let (values, gradients) = (ident(values), ident(gradients));
        let (rt, arguments) = (&self.runtime, self.arguments());
        let (n, k) = (size(self.module.state.len()), size(n_functions));
        let (n_equations, moved) = (size(text.n_equations), text.moved.iter().map(|at| size(*at)));
        quote! {
            impl<R: #rt::Real> #rt::Positions<R, #k> for Prepared<R> {
                #[inline]
                fn n_equations(&self) -> usize {
                    #n_equations
                }

                #[inline]
                fn moved(&self) -> &[usize] {
                    &[#(#moved),*]
                }

                #[inline]
                fn residuals(#arguments) -> [R; #k] {
                    self.#values(t, y)
                }

                #[inline]
                fn residual_gradients(#arguments, gradients: &mut [[R; #n]; #k]) {
                    *gradients = self.#gradients(t, y);
                }
            }
        }
    }

    /// The same for drivers that serve any scene.
    pub(super) fn positions_of(&self) -> TokenStream {
        let Some((text, n_functions, ..)) = self.module.positions() else { return TokenStream::new() };
        let (rt, arguments) = (&self.runtime, self.arguments());
        let (n, k) = (size(self.module.state.len()), size(n_functions));
        let (n_equations, moved) = (size(text.n_equations), text.moved.iter().map(|at| size(*at)));
        quote! {
            const N_POSITIONS: usize = #k;

            const POSITION_EQUATIONS: usize = #n_equations;

            const MOVED: &'static [usize] = &[#(#moved),*];

            fn positions_of(#arguments, values: &mut [R]) {
                if let Ok(values) = <&mut [R; #k]>::try_from(values) {
                    *values = #rt::Positions::residuals(self, t, y);
                }
            }

            fn position_gradients_of(#arguments, gradients: &mut [[R; #n]]) {
                if let Ok(gradients) = <&mut [[R; #n]; #k]>::try_from(gradients) {
                    #rt::Positions::residual_gradients(self, t, y, gradients);
                }
            }
        }
    }
}

/// Rows and columns as an array.
pub(super) fn places(pattern: &[(usize, usize)]) -> TokenStream {
    array(&pattern.iter().map(|(i, j)| format!("({i}, {j})")).collect::<Vec<_>>())
}

/// The array of the rows of a matrix, line by line.
pub(super) fn rows(values: &[Vec<String>]) -> TokenStream {
    let rows = values.iter().map(|row| lines::indented(&lines::array(row)) + ",\n");
    lines::expression(&format!("[\n{}]", rows.collect::<String>()))
}
