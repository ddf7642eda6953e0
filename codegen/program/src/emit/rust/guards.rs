//! What says where the equations end: pivots and their check, the domain of the coordinates.
//!
//! Does not know: how rounding errors of pivots are bounded.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::functions::operations;
use super::lines::{self, literal};
use super::tokens::{array, doc_attributes, size};
use crate::emit::module::Routine;

impl Writer<'_> {
    /// What is divided by, and the function that fails with the first of it that cannot be divided by.
    pub(super) fn pivots(&self, routine: &Routine<'_>) -> TokenStream {
        let (rt, arguments, body) = (&self.runtime, self.arguments(), self.body(routine));
        let (values, scales) = routine.code.results.split_at(routine.code.results.len() / 2);
        let names = routine.function.results.iter().map(|(name, _)| name);
        let pivots = names.zip(values.iter().zip(scales)).map(|(name, (value, scale))| {
            format!("{}::Pivot::new({}, {}, {})", self.path, literal(name), value.text, scale.text)
        });
        let pivots = array(&pivots.collect::<Vec<_>>());
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
        quote! {
            #doc
            #[must_use]
            pub fn pivots(#arguments) -> [#rt::Pivot<R>; #n_pivots] {
                #body
                #pivots
            }

            #check_doc
            pub fn check(#arguments) -> Result<(), #rt::Failure> {
                #rt::Pivot::verify_all(t, &self.pivots(t, y))
            }
        }
    }

    /// The function that fails with the first end of a coordinate's interval that does not hold.
    pub(super) fn domain(&self, routine: &Routine<'_>) -> TokenStream {
        let (rt, arguments, body) = (&self.runtime, self.arguments(), self.body(routine));
        let conditions = routine.function.results.iter().map(|(name, _)| name);
        let tests = routine.code.results.iter().zip(conditions).map(|(value, condition)| {
            format!("{}::Failure::require_positive(t, {}, {})?;", self.path, value.text, literal(condition))
        });
        let tests = lines::statements(&tests.collect::<Vec<_>>().join("\n"));
        let title = [
            "Says whether a point lies outside the domain of the coordinates.",
            "",
            "# Errors",
            "",
            "`OutsideDomain` with the first condition that does not hold.",
        ];
        let doc = doc_attributes(title.map(str::to_owned).into_iter().chain(operations(routine.function)));
        quote! {
            #doc
            #[inline]
            pub fn domain(#arguments) -> Result<(), #rt::Failure> {
                #body
                #tests
                Ok(())
            }
        }
    }
}
