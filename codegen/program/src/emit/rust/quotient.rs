//! The map from the system that the model is the quotient of.
//!
//! Deliberately does not know: what relates both systems.

use proc_macro2::TokenStream;

use super::Writer;
use super::lines::{self, documentation, literal};
use crate::emit::module::{TOTAL_PARAMS, TOTAL_STATE};

impl Writer<'_> {
    /// Names of the variables of the map.
    pub(super) fn quotient_constants(&self) -> TokenStream {
        let Some(text) = &self.module.text.quotient else { return TokenStream::new() };
        let names = |constant: &str, doc: String, names: &[String]| {
            let list: Vec<String> = names.iter().map(|name| literal(name)).collect();
            lines::statements(&format!(
                "{}pub const {constant}: &[&str] = {};\n",
                documentation([doc.as_str()]),
                lines::list("&[", &list, "]"),
            ))
        };
        let file = &text.file;
        let state =
            format!("Components of the state of `{file}`, the first variables of [`Prepared::quotient`].");
        let params = format!("Parameters of `{file}`, the last variables of [`Prepared::quotient`].");
        let mut constants = names(TOTAL_STATE, state, &text.state);
        constants.extend(names(TOTAL_PARAMS, params, &text.params));
        constants
    }

    /// The functions of the map.
    pub(super) fn quotient_functions(&self) -> TokenStream {
        let mut methods = TokenStream::new();
        for function in &self.module.quotient {
            let results: Vec<String> =
                function.routine.function.results.iter().map(|(name, _)| name.clone()).collect();
            let doc = self.function_doc(function.routine.function, function.title, &results);
            methods.extend(self.of_variables(&function.name, doc, &function.routine));
        }
        methods
    }
}
