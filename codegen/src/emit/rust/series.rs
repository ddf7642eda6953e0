//! The recurrence of the Taylor coefficients as an implementation of `Jet`.
//!
//! Does not know: the rules of the recurrence.

use std::collections::BTreeSet;
use std::ops::Range;

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::tokens::{
    allow_comments, allow_names, allow_numbers, doc_attributes, ident, parse_all, pattern, size, statements,
};
use crate::emit::body::Code;
use crate::emit::series::{INVERSE, ORDER, Series};
use crate::error::Error;
use crate::program::{Jet, Literal, Operand};

/// Convolutions in one loop: their sums fill four vector registers of four lanes, which hides the latency of an
/// addition and leaves room for the factors; with scalars that are vectors themselves they still fit the registers.
const LANES: usize = 16;

/// Variables of the method, besides the arguments of other functions and what [`Series`] names.
pub(super) const LOCALS: [&str; 7] = ["y", "workspace", "coefficient", "orders", "k", "next", "derivative"];

impl Writer<'_> {
    /// `impl Jet for Prepared`.
    pub(super) fn series(&self, series: &Series<'_>) -> Result<TokenStream, Error> {
        let (jet, rt, n) = (series.jet, &self.runtime, size(series.jet.n_state));
        let names = |range: Range<usize>, code: &Code| {
            let is_read = |i: usize| code.reads.contains(&Operand::State(i as u32));
            pattern(range.map(|i| is_read(i).then(|| &series.inputs[i])))
        };
        let (sums, kept) = (jet.n_state, jet.n_state + jet.n_lanes);
        let coefficients = names(0..sums, &series.start);
        let next_coefficients = names(0..sums, &series.step);
        let kept_names = names(kept..kept + jet.n_kept, &series.step);
        let (first, first_results) =
            (statements(&series.start.statements)?, parse_all(&series.start.results)?);
        let (next, next_results) = (statements(&series.step.statements)?, parse_all(&series.step.results)?);
        let (derivative_first, kept_values) = first_results.split_at(jet.n_state);

        // An array of nothing would have elements of an unknown type: those of linear equations keep nothing.
        let derivative_first = quote! { [#(#derivative_first),*] };
        let (at_order_zero, value_at_order_zero) = if kept_values.is_empty() {
            (quote! { mut coefficient }, derivative_first)
        } else {
            let kept_values = quote! { [#(#kept_values),*] };
            (quote! { (mut coefficient, #kept_names) }, quote! { (#derivative_first, #kept_values) })
        };

        // A panel for every group of convolutions.
        let (derivative, rows) = next_results.split_at(jet.n_state);
        let (left, right) = rows.split_at(jet.n_lanes);
        let mut types = Vec::new();
        let (mut read, mut write_rows, mut clear) =
            (TokenStream::new(), TokenStream::new(), TokenStream::new());
        for (panel, start) in (0..jet.n_lanes).step_by(LANES).enumerate() {
            let end = (start + LANES).min(jet.n_lanes);
            let (index, width) = (size(panel), size(end - start));
            types.push(quote! { #rt::Convolutions<R, #width> });
            let names = names(sums + start..sums + end, &series.step);
            let (left, right) = (&left[start..end], &right[start..end]);
            clear.extend(quote! { workspace.#index.clear(); });
            read.extend(quote! { let #names = workspace.#index.sums(); });
            write_rows.extend(quote! { workspace.#index.push([#(#left),*], [#(#right),*]); });
        }
        let make = types.iter().map(|_| quote! { ::core::default::Default::default() });
        let reads = |code: &Code, operand: Operand| code.reads.contains(&operand);
        let (order_name, inverse_name) = (ident(ORDER), ident(INVERSE));
        let order = reads(&series.step, Operand::State(series.order()))
            .then(|| quote! { let #order_name = R::from_f64(f64::from(k)); });
        let inverse = reads(&series.step, Operand::State(series.inverse()))
            .then(|| quote! { let #inverse_name = R::ratio(1.0, f64::from(k)); });
        let time = reads(&series.step, Operand::Time)
            .then(|| quote! { let t = if k == 1 { R::ONE } else { R::ZERO }; });
        let unused_time = (!reads(&series.start, Operand::Time)).then(|| quote! { let _ = t; });
        // Nothing to keep is an empty array: lints complain of a unit that is bound to a name.
        let (workspace, new_workspace) = match types.is_empty() {
            true => (quote! { [R; 0] }, quote! { [] }),
            false => (quote! { (#(#types,)*) }, quote! { (#(#make,)*) }),
        };
        let unused_workspace = types.is_empty().then(|| quote! { let _ = workspace; });
        let variables: BTreeSet<&String> =
            series.start.variables.iter().chain(&series.step.variables).collect();
        let allow_locals = allow_names(variables.into_iter().chain(&self.module.state));
        let numbers = allow_numbers(jet.program.constants.iter().filter_map(|c| match c.literal() {
            Literal::Number(x) => Some(x),
            _ => None,
        }));
        let comments = allow_comments();
        let counts = jet.program.functions[Jet::NEXT].counts();
        let lanes = jet.n_lanes;
        let doc = doc_attributes([
            "Writes the Taylor coefficients of the solution, at order zero by the equations and then by their \
             recurrence."
                .to_owned(),
            String::new(),
            "# Operations".to_owned(),
            String::new(),
            format!("At each order k: {counts}, and {lanes} sums of k - 1 products."),
        ]);
        Ok(quote! {
            #allow_locals
            #numbers
            #comments
            impl<R: #rt::Real> #rt::Jet<R> for Prepared<R> {
                type Workspace = #workspace;

                fn workspace(&self) -> Self::Workspace {
                    #new_workspace
                }

                #doc
                fn series(&self, t: R, y: &[R; #n], workspace: &mut Self::Workspace, out: &mut [[R; #n]]) {
                    let mut orders = out.iter_mut().take(#rt::MAX_ORDER + 1);
                    if let Some(first) = orders.next() {
                        *first = *y;
                    }
                    let #at_order_zero = {
                        let #coefficients = *y;
                        #unused_time
                        #first
                        #value_at_order_zero
                    };
                    #clear
                    #unused_workspace
                    for (next, k) in orders.zip(1u32..) {
                        *next = coefficient;
                        #order
                        #inverse
                        #time
                        let #next_coefficients = coefficient;
                        #read
                        #next
                        #write_rows
                        let derivative = [#(#derivative),*];
                        let scale = R::ratio(1.0, f64::from(k + 1));
                        coefficient = derivative.map(|derivative| derivative * scale);
                    }
                }
            }
        })
    }
}
