//! The events of a scene, as integrators carry them out.
//!
//! Does not know: what the functions compute, how events are located.

use proc_macro2::{Literal, TokenStream};
use quote::quote;

use super::Writer;
use super::tokens::{ident, idents, size};
use crate::emit::text::EventText;
use hamel_expr::error::Error;

impl Writer<'_> {
    /// What integrators through events ask for; nothing where the scene has none.
    pub(super) fn events(&self) -> Result<TokenStream, Error> {
        let Some(values) = self.module.event_functions() else { return Ok(TokenStream::new()) };
        let (rt, arguments, events) = (&self.runtime, self.arguments(), &self.module.text.events);
        let (values, n, k) = (ident(values), size(self.module.state.len()), size(events.len()));
        let directions = events.iter().map(|event| match event.directions {
            (true, false) => quote! { #rt::Direction::Rising },
            (false, true) => quote! { #rt::Direction::Falling },
            _ => quote! { #rt::Direction::Either },
        });
        let mut arms = TokenStream::new();
        for (index, event) in events.iter().enumerate() {
            arms.extend(self.effect(index, event)?);
        }
        let has_conditions = events.iter().any(|event| event.is_condition);
        let conditions = events.iter().map(|event| event.is_condition);
        let sets_nothing = events.iter().all(|event| event.sets.is_none());
        let unused = sets_nothing.then(|| quote! { let _ = (t, y); });
        let effects = quote! {
            #unused
            match index {
                #arms
                _ => #rt::Action::Continue,
            }
        };
        let apply = match has_conditions {
            false => effects,
            true => quote! {
                let effect = |index: usize, y: &mut [R; #n]| { #effects };
                #rt::cascade(index, [#(#conditions),*], y, |y| self.event_values(t, y), effect)
            },
        };
        Ok(quote! {
            impl<R: #rt::Real> #rt::Events<R, #k> for Prepared<R> {
                const DIRECTIONS: [#rt::Direction; #k] = [#(#directions),*];

                #[inline]
                fn event_values(#arguments) -> [R; #k] {
                    self.#values(t, y)
                }

                fn event_apply(&self, index: usize, t: R, y: &mut [R; #n]) -> #rt::Action {
                    #apply
                }
            }
        })
    }

    /// The arm of an event that does something.
    fn effect(&self, index: usize, event: &EventText) -> Result<TokenStream, Error> {
        let (rt, number) = (&self.runtime, Literal::usize_unsuffixed(index));
        let Some((output, places)) = &event.sets else {
            return Ok(match event.stops {
                true => quote! { #number => #rt::Action::Stop, },
                false => TokenStream::new(),
            });
        };
        let function = self.module.output(output).ok_or_else(|| Error::UnknownName {
            name: output.clone(),
            kind: "output with what an event sets",
            known: self.module.outputs.iter().map(|o| o.text.name.clone()).collect(),
        })?;
        let (function, values) = (ident(function), idents((0..places.len()).map(|k| format!("v{k}"))));
        let places = places.iter().map(|place| Literal::usize_unsuffixed(*place));
        let action = match event.stops {
            true => quote! { #rt::Action::ChangeAndStop },
            false => quote! { #rt::Action::Restart },
        };
        Ok(quote! {
            #number => {
                let [#(#values),*] = self.#function(t, y);
                #(y[#places] = #values;)*
                #action
            }
        })
    }
}
