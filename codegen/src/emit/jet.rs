//! The recurrence of the Taylor coefficients as a method of a scene's module.

use proc_macro2::TokenStream;
use quote::quote;

use super::body::{self, Body, parse, segments};
use super::names::Scope;
use super::scene::{ARGUMENTS, Module, allow, allow_names, allow_numbers, ident, size};
use super::{doc_attributes, names::legal};
use crate::error::Error;
use crate::program::{Function, Jet, Literal, Operand};

/// Convolutions in one loop: their sums fill four vector registers of four lanes, which hides the latency of an
/// addition and leaves room for the factors; with scalars that are vectors themselves they still fit the registers.
const LANES: usize = 16;

/// `impl Jet for Prepared`.
pub(super) fn emit(module: &Module<'_>, jet: &Jet) -> Result<TokenStream, Error> {
    let n = size(jet.n_state);
    let names = |prefix: &str, n: usize| (0..n).map(|k| format!("{prefix}{k}")).collect::<Vec<_>>();
    // Names of inputs that locals must not hide.
    let mut scope = Scope::with(&ARGUMENTS);
    for name in ["y", "workspace", "coefficient", "order", "inverse", "orders", "next", "derivative"] {
        scope.add(name);
    }
    let mut inputs: Vec<String> =
        jet.program.state[..jet.n_state].iter().map(|name| scope.add(name)).collect();
    for name in names("sum", jet.n_lanes).iter().chain(&names("kept", jet.n_kept)) {
        inputs.push(scope.add(name));
    }
    inputs.extend(["order".to_owned(), "inverse".to_owned()]);
    let write = |function: &Function| -> Result<(TokenStream, Vec<TokenStream>, Vec<bool>), Error> {
        let results: Vec<Operand> = function.results.iter().map(|(_, o)| *o).collect();
        let spell = |operand: Operand| match operand {
            Operand::Param(i) => format!("self.{}", module.fields[i as usize]),
            Operand::Slot(i) => format!("self.{}", module.slot_fields[i as usize]),
            Operand::State(i) => inputs[i as usize].clone(),
            _ => "t".to_owned(),
        };
        let mut scope = scope.clone();
        let body = Body::new(&jet.program, &function.instructions, &results, &mut scope, "t", spell);
        let statements = body.statements(&segments(&jet.program, &function.instructions), &results)?;
        let mut values = Vec::with_capacity(results.len());
        for operand in &results {
            values.push(parse(&match *operand {
                Operand::Value(v) => body.value(v),
                Operand::Constant(i) => body::constant(&jet.program.constants[i as usize], true).text,
                input => spell(input),
            })?);
        }
        let mut used = vec![false; jet.program.state.len() + 1];
        for operand in function.instructions.iter().flat_map(|i| i.op.operands()).chain(results) {
            match operand {
                Operand::State(i) => used[i as usize] = true,
                Operand::Time => used[jet.program.state.len()] = true,
                _ => {}
            }
        }
        Ok((statements, values, used))
    };
    let (first, first_results, first_used) = write(&jet.program.functions[Jet::FIRST])?;
    let (next, next_results, next_used) = write(&jet.program.functions[Jet::NEXT])?;
    let pattern = |range: std::ops::Range<usize>, used: &[bool]| {
        let names = range.map(|i| {
            let name = ident(&inputs[i]);
            if used[i] {
                quote! { #name }
            } else {
                quote! { _ }
            }
        });
        quote! { [#(#names),*] }
    };
    let (sums, kept) = (jet.n_state, jet.n_state + jet.n_lanes);
    let coefficients = pattern(0..sums, &first_used);
    let next_coefficients = pattern(0..sums, &next_used);
    let (derivative_first, kept_values) = first_results.split_at(jet.n_state);
    let kept_names = pattern(kept..kept + jet.n_kept, &next_used);

    // A panel for every group of convolutions.
    let (derivative, rows) = next_results.split_at(jet.n_state);
    let (left, right) = rows.split_at(jet.n_lanes);
    let mut types = Vec::new();
    let (mut read, mut write_rows, mut clear) = (TokenStream::new(), TokenStream::new(), TokenStream::new());
    for (panel, start) in (0..jet.n_lanes).step_by(LANES).enumerate() {
        let end = (start + LANES).min(jet.n_lanes);
        let (index, width) = (size(panel), size(end - start));
        types.push(quote! { ::hamel_runtime::Convolutions<R, #width> });
        let names = pattern(sums + start..sums + end, &next_used);
        let (left, right) = (&left[start..end], &right[start..end]);
        clear.extend(quote! { workspace.#index.clear(); });
        read.extend(quote! { let #names = workspace.#index.sums(); });
        write_rows.extend(quote! { workspace.#index.push([#(#left),*], [#(#right),*]); });
    }
    let make = types.iter().map(|_| quote! { ::core::default::Default::default() });
    let [order_used, inverse_used, time_used] =
        [jet.program.state.len() - 2, jet.program.state.len() - 1, jet.program.state.len()]
            .map(|i| next_used[i]);
    let order = order_used.then(|| quote! { let order = R::from_f64(f64::from(k)); });
    let inverse = inverse_used.then(|| quote! { let inverse = R::ratio(1.0, f64::from(k)); });
    let time = time_used.then(|| quote! { let t = if k == 1 { R::ONE } else { R::ZERO }; });
    let unused_time = (!first_used[jet.program.state.len()]).then(|| quote! { let _ = t; });
    let unused_workspace = types.is_empty().then(|| quote! { let _ = workspace; });
    let named = jet.program.functions.iter().flat_map(|f| &f.instructions).filter_map(|i| i.name.as_deref());
    let locals: Vec<_> = named.map(|name| ident(&legal(name))).chain(module.state.iter().cloned()).collect();
    let allow_locals = allow_names(&locals);
    let numbers = allow_numbers(jet.program.constants.iter().filter_map(|c| match c.literal() {
        Literal::Number(x) => Some(x),
        _ => None,
    }));
    let comments = allow("unused_doc_comments", "comments on statements say which formula they are");
    let counts = jet.program.functions[Jet::NEXT].counts();
    let lanes = jet.n_lanes;
    let doc = doc_attributes([
        "Writes the Taylor coefficients of the solution, at order zero by the equations and then by their recurrence."
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
        impl<R: ::hamel_runtime::Real> ::hamel_runtime::Jet<R> for Prepared<R> {
            type Workspace = (#(#types,)*);

            fn workspace(&self) -> Self::Workspace {
                (#(#make,)*)
            }

            #doc
            fn series(&self, t: R, y: &[R; #n], workspace: &mut Self::Workspace, out: &mut [[R; #n]]) {
                let mut orders = out.iter_mut().take(::hamel_runtime::MAX_ORDER + 1);
                if let Some(first) = orders.next() {
                    *first = *y;
                }
                let (mut coefficient, #kept_names) = {
                    let #coefficients = *y;
                    #unused_time
                    #first
                    ([#(#derivative_first),*], [#(#kept_values),*])
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
