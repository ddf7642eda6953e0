//! What says where the equations end: pivots and their check, the domain of the coordinates.
//!
//! Does not know: how rounding errors of pivots are bounded.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::functions::operations;
use super::tokens::{doc_attributes, parse_all, size};
use crate::emit::module::Routine;
use hamel_expr::error::Error;

impl Writer<'_> {
    /// What is divided by, and the function that fails with the first of it that cannot be divided by.
    pub(super) fn pivots(&self, routine: &Routine<'_>) -> Result<TokenStream, Error> {
        let (rt, arguments) = (&self.runtime, self.arguments());
        let (body, results) = (self.body(routine)?, parse_all(&routine.code.results)?);
        let (values, scales) = results.split_at(results.len() / 2);
        let names = routine.function.results[..values.len()].iter().map(|(name, _)| name);
        let title = "What the right-hand side divides by that may vanish or overflow, each with the scale of its \
                     rounding errors.";
        let doc = self.function_doc(routine.function, title, &[]);
        let check_doc = doc_attributes([
            "Says which pivot vanishes at a point, or is not finite.",
            "",
            "# Errors",
            "",
            "`Singular` with the first pivot that is zero up to the rounding errors of what it is computed from, or",
            "`PivotNotFinite`.",
        ]);
        let n_pivots = size(values.len());
        Ok(quote! {
            #doc
            #[must_use]
            pub fn pivots(#arguments) -> [#rt::Pivot<R>; #n_pivots] {
                #body
                [#(#rt::Pivot { name: #names, value: #values, scale: #scales }),*]
            }

            #check_doc
            pub fn check(#arguments) -> Result<(), #rt::Failure> {
                #rt::Pivot::verify_all(t, &self.pivots(t, y))
            }
        })
    }

    /// The function that fails with the first end of a coordinate's interval that does not hold.
    pub(super) fn domain(&self, routine: &Routine<'_>) -> Result<TokenStream, Error> {
        let (rt, arguments) = (&self.runtime, self.arguments());
        let (body, results) = (self.body(routine)?, parse_all(&routine.code.results)?);
        let conditions = routine.function.results.iter().map(|(name, _)| name);
        let tuples: Vec<TokenStream> =
            results.iter().zip(conditions).map(|(v, c)| quote! { (#v, #c) }).collect();
        let title = [
            "Says whether a point lies outside the domain of the coordinates.",
            "",
            "# Errors",
            "",
            "`OutsideDomain` with the first condition that does not hold.",
        ];
        let doc = doc_attributes(title.map(str::to_owned).into_iter().chain(operations(routine.function)));
        // Not a number is not greater than anything.
        let failure = quote! {
            if !value.all_gt(R::ZERO) {
                let t = if t.all_ge(R::ZERO) { t.magnitude() } else { -t.magnitude() };
                return Err(#rt::Failure::OutsideDomain { t, condition });
            }
        };
        let test = match tuples.as_slice() {
            [tuple] => quote! { let (value, condition) = #tuple; #failure },
            _ => quote! { for (value, condition) in [#(#tuples),*] { #failure } },
        };
        Ok(quote! {
            #doc
            #[inline]
            pub fn domain(#arguments) -> Result<(), #rt::Failure> {
                #body
                #test
                Ok(())
            }
        })
    }
}
