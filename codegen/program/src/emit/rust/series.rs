//! The recurrence of the Taylor coefficients as an implementation of `Jet`.
//!
//! Does not know: the rules of the recurrence.

use std::collections::BTreeMap;
use std::ops::Range;

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::lines::{self, allow};
use super::loops::array_of_results;
use super::tokens::{array, doc_attributes, ident, pattern, size, statements, taken_apart, texts};
use crate::emit::body::Code;
use crate::emit::expression::Text;
use crate::emit::series::{INVERSE, ORDER, Part, Series};
use crate::program::{Factors, Jet, Operand, ProductKind};

/// Convolutions in one loop: their sums fill four vector registers of four lanes, which hides the latency of an
/// addition and leaves room for the factors; with scalars that are vectors themselves they still fit the registers.
const LANES: usize = 16;

/// Variables of the method, besides the arguments of other functions and what [`Series`] names.
const LOCALS: [&str; 8] = ["y", "workspace", "coefficient", "orders", "last", "k", "next", "derivative"];

/// The argument that has the coefficients of inputs, where there are any.
const COEFFICIENTS_OF_INPUTS: &str = "u";

/// The variables of the method for a recurrence.
pub(super) fn locals(jet: &Jet) -> Vec<&'static str> {
    let of_inputs = (!jet.program.inputs.is_empty()).then_some(COEFFICIENTS_OF_INPUTS);
    LOCALS.into_iter().chain(of_inputs).collect()
}

impl Writer<'_> {
    /// `impl Jet for Prepared`, by way of `ControlledJet` where there are inputs.
    pub(super) fn series(&self, series: &Series<'_>) -> TokenStream {
        let (jet, rt, n) = (series.jet, &self.runtime, size(series.jet.n_state));
        let (start, step) = (&series.start.code, &series.step.code);
        let is_read = |i: usize, code: &Code| code.reads.contains(&Operand::State(i as u32));
        let names = |range: Range<usize>, code: &Code| {
            pattern(range.map(|i| is_read(i, code).then(|| &series.inputs[i])))
        };
        let (sums, kept) = (jet.n_state, jet.n_state + jet.n_lanes);
        // Loops may be all that reads the state.
        let state = |code: &Code, value: &str| {
            let names = names(0..sums, code);
            (0..sums).any(|i| is_read(i, code)).then(|| taken_apart(&names, value))
        };
        let (coefficients, next_coefficients) = (state(start, "*y"), state(step, "coefficient"));
        let kept_names = names(kept..kept + jet.n_kept, step);
        let (first, next) = (statements(&start.statements), statements(&step.statements));
        let (_, kept_values) = start.results.split_at(jet.n_state);

        let derivative = |part: &Part<'_>, results: &[Text]| {
            array_of_results(part.function, part.loops.as_ref(), &results[..jet.n_state])
        };
        // An array of nothing would have elements of an unknown type: those of linear equations keep nothing.
        let derivative_first = derivative(&series.start, &start.results);
        let (at_order_zero, value_at_order_zero) = if kept_values.is_empty() {
            (quote! { mut coefficient }, derivative_first)
        } else {
            let (kept_names, kept_values) = (lines::expression(&kept_names), array(&texts(kept_values)));
            (quote! { (mut coefficient, #kept_names) }, quote! { (#derivative_first, #kept_values) })
        };

        // A panel for every group of convolutions.
        let (left, right) = step.results[jet.n_state..].split_at(jet.n_lanes);
        let (mut types, mut make) = (Vec::new(), Vec::new());
        let (mut read, mut write_rows, mut clear) =
            (TokenStream::new(), TokenStream::new(), TokenStream::new());
        for (panel, start) in (0..jet.n_lanes).step_by(LANES).enumerate() {
            let end = (start + LANES).min(jet.n_lanes);
            let (index, width) = (size(panel), size(end - start));
            types.push(quote! { #rt::Convolutions<R, #width> });
            make.push(quote! { ::core::default::Default::default() });
            let names = names(sums + start..sums + end, step);
            let factors = [left, right].map(|factors| lines::array(&texts(&factors[start..end])));
            clear.extend(quote! { workspace.#index.clear(); });
            read.extend(taken_apart(&names, &format!("workspace.{panel}.sums()")));
            let [left, right] = factors.map(|factors| lines::indented(&format!("{factors},")));
            write_rows.extend(lines::statements(&format!("workspace.{panel}.push(\n{left}\n{right}\n);")));
        }
        // Places for the coefficients of all orders of what loops take as factors.
        let mut stored = BTreeMap::new();
        for factors in jet.convolved_factors() {
            let function = series.step.function;
            let n = size(match factors {
                Factors::State => jet.n_state,
                Factors::Scalars => function.scalars.len(),
                Factors::Contraction(k) => function.contractions[k as usize].n_results,
                // A vector that does not change is not convolved.
                Factors::Argument => continue,
            });
            let index = size(types.len());
            stored.insert(factors, quote! { workspace.#index });
            types.push(quote! { [[R; #rt::MAX_ORDER]; #n] });
            make.push(quote! { [[R::ZERO; #rt::MAX_ORDER]; #n] });
        }
        let stored = |factors: Factors| stored.get(&factors).cloned();
        let loops_first = self.loops_of_series(jet, &series.start, (&quote! { y }, None), stored);
        let of_order = (&quote! { &coefficient }, Some(&quote! { k }));
        let loops_next = self.loops_of_series(jet, &series.step, of_order, stored);
        let derivative_next = derivative(&series.step, &step.results);
        let reads = |code: &Code, operand: Operand| code.reads.contains(&operand);
        let (order_name, inverse_name) = (ident(ORDER), ident(INVERSE));
        let order = reads(step, Operand::State(series.order()))
            .then(|| quote! { let #order_name = R::from_f64(f64::from(k)); });
        let inverse = reads(step, Operand::State(series.inverse()))
            .then(|| quote! { let #inverse_name = R::ratio(1.0, f64::from(k)); });
        let time =
            reads(step, Operand::Time).then(|| quote! { let t = if k == 1 { R::ONE } else { R::ZERO }; });
        let (m, u) = (size(series.held.len()), ident(COEFFICIENTS_OF_INPUTS));
        let inputs_of = |code: &Code, coefficients: &str| {
            let read = |(name, i)| reads(code, Operand::Input(i)).then_some(name);
            let names: Vec<Option<&String>> = series.held.iter().zip(0u32..).map(read).collect();
            let is_read = names.iter().any(Option::is_some);
            let names = pattern(names);
            let held = format!("{coefficients}.copied().unwrap_or([R::ZERO; {}])", series.held.len());
            is_read.then(|| taken_apart(&names, &held))
        };
        let inputs_first = inputs_of(start, &format!("{COEFFICIENTS_OF_INPUTS}.first()"));
        let inputs_next = inputs_of(step, &format!("{COEFFICIENTS_OF_INPUTS}.get(k as usize)"));
        let is_unread = inputs_first.is_none() && inputs_next.is_none() && !series.held.is_empty();
        let unused_inputs = is_unread.then(|| quote! { let _ = #u; });
        let unused_time = (!reads(start, Operand::Time)).then(|| quote! { let _ = t; });
        // Nothing to keep is an empty array: lints complain of a unit that is bound to a name.
        let (workspace, new_workspace) = match types.is_empty() {
            true => (quote! { [R; 0] }, quote! { [] }),
            false => (quote! { (#(#types,)*) }, quote! { (#(#make,)*) }),
        };
        let unused_workspace = types.is_empty().then(|| quote! { let _ = workspace; });
        let counts = series.step.function.straight_counts();
        let lanes = jet.n_lanes;
        let mut doc = vec![
            "Writes the Taylor coefficients of the solution, at order zero by the equations and then by their \
             recurrence."
                .to_owned(),
            String::new(),
            format!("Operations at each order k: {counts}, and {lanes} sums of k - 1 products."),
        ];
        let terms = || series.step.function.contractions.iter().flat_map(|c| &c.terms);
        let n_products = |kind: ProductKind| -> usize {
            let of_kind = terms().filter(|products| jet.kind(products) == kind);
            of_kind.map(|products| jet.program.tables[products.table as usize].n_products()).sum()
        };
        let kinds = [(ProductKind::Convolved, "sums of k + 1 products"), (ProductKind::Scaled, "products")];
        let counted = kinds.map(|(kind, what)| (n_products(kind), what));
        let counted: Vec<String> =
            counted.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} {what}")).collect();
        if !counted.is_empty() {
            doc.push(format!("Loops over tables of {}.", counted.join(" and ")));
        }
        let doc = doc_attributes(doc);
        let method = quote! {
            #unused_inputs
            let mut orders = out.iter_mut().take(#rt::MAX_ORDER + 1);
            if let Some(first) = orders.next() {
                *first = *y;
            }
            let #at_order_zero = {
                #inputs_first
                #coefficients
                #unused_time
                #first
                #loops_first
                #value_at_order_zero
            };
            #clear
            #unused_workspace
            let last = orders.len();
            for (next, k) in orders.zip(1u32..) {
                *next = coefficient;
                if k as usize == last {
                    break;
                }
                #order
                #inverse
                #time
                #inputs_next
                #next_coefficients
                #read
                #next
                #write_rows
                #loops_next
                let derivative = #derivative_next;
                let scale = R::ratio(1.0, f64::from(k + 1));
                coefficient = derivative.map(|derivative| derivative * scale);
            }
        };
        let allow = allow();
        let of_jet = quote! {
            type Workspace = #workspace;

            fn workspace(&self) -> Self::Workspace {
                #new_workspace
            }
        };
        let arguments = quote! { &self, t: R, y: &[R; #n] };
        let results = quote! { workspace: &mut Self::Workspace, out: &mut [[R; #n]] };
        if series.held.is_empty() {
            return quote! {
                #allow
                impl<R: #rt::Real> #rt::Jet<R> for Prepared<R> {
                    #of_jet

                    #doc
                    fn series(#arguments, #results) {
                        #method
                    }
                }
            };
        }
        quote! {
            impl<R: #rt::Real> #rt::Jet<R> for Prepared<R> {
                #of_jet

                /// Writes the Taylor coefficients of the solution, with the inputs at the values that they are held at.
                #[inline]
                fn series(#arguments, #results) {
                    #rt::ControlledJet::series_with(self, t, y, &[self.inputs], workspace, out);
                }
            }

            #allow
            impl<R: #rt::Real> #rt::ControlledJet<R, #m> for Prepared<R> {
                #doc
                fn series_with(#arguments, #u: &[[R; #m]], #results) {
                    #method
                }
            }
        }
    }
}
