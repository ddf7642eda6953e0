//! A test within a module: rates at some states are those that the generator computed.
//!
//! Does not know: how states were chosen, what the rates mean.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::tokens::size;
use crate::emit::text::SelfTestText;

impl Writer<'_> {
    /// The test; nothing where the module has none.
    pub(super) fn self_test(&self) -> TokenStream {
        let cases = &self.module.text.self_test;
        if cases.is_empty() {
            return TokenStream::new();
        }
        let (n, n_params, n_cases) =
            (size(self.module.state.len()), size(self.module.text.params.len()), size(cases.len()));
        let rows = cases.iter().map(|SelfTestText { params, t, state, rates }| {
            quote! { ([#(#params),*], #t, [#(#state),*], [#(#rates),*]) }
        });
        quote! {
            #[cfg(test)]
            mod tests {
                /// Rates at states that were drawn when hamel held this scene to its definition. Another order of
                /// rounding moves their last digits, a wrong formula the first ones.
                #[test]
                fn rates_are_those_of_the_generator() {
                    let cases: [([f64; #n_params], f64, [f64; #n], [f64; #n]); #n_cases] = [#(#rows),*];
                    for (params, t, y, expected) in cases {
                        let prepared = super::Prepared::<f64>::new(&super::Params::from_array(params));
                        let mut rates = [0.0; #n];
                        if let Ok(prepared) = prepared {
                            prepared.rhs(t, &y, &mut rates);
                        }
                        let size = expected.iter().fold(0.0_f64, |size, rate| size.max(rate.abs()));
                        for (rate, expected) in rates.iter().zip(&expected) {
                            assert!((rate - expected).abs() <= 1e-9 * size, "{rates:?} at {y:?}");
                        }
                    }
                }
            }
        }
    }
}
