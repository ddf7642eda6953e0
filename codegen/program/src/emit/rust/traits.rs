//! What makes a scene usable by every integrator and by name: `System`, `OverScalar` and `Scene`.
//!
//! Does not know: what the methods compute.

use proc_macro2::{Ident, TokenStream};
use quote::quote;

use super::Writer;
use super::tokens::{ident, idents, phantom, size};

impl Writer<'_> {
    /// The traits, calling the methods.
    pub(super) fn traits(&self, has_series: bool) -> TokenStream {
        let (module, rt) = (self.module, &self.runtime);
        let (n, n_params) = (size(module.state.len()), size(module.params.len()));
        let arguments = self.arguments();
        let check = module.pivots.is_some().then(|| {
            quote! {
                fn check(#arguments) -> Result<(), #rt::Failure> {
                    self.check(t, y)
                }

                fn pivots(#arguments, visit: &mut dyn FnMut(#rt::Pivot<R>)) {
                    self.pivots(t, y).into_iter().for_each(visit);
                }
            }
        });
        let signature = module.signature.is_some().then(|| {
            quote! {
                #[inline]
                fn signature(#arguments) -> R {
                    self.signature(t, y)
                }
            }
        });
        let domain = module.domain.is_some().then(|| {
            quote! {
                #[inline]
                fn domain(#arguments) -> Result<(), #rt::Failure> {
                    self.domain(t, y)
                }
            }
        });
        let energy = if module.energy.is_some() {
            quote! { Some(self.energy(t, y)) }
        } else {
            quote! { let _ = (t, y); None }
        };
        let is_kept = module.text.conserves_energy && module.energy.is_some();
        let conserves_energy = is_kept.then(|| quote! { const CONSERVES_ENERGY: bool = true; });
        let wrong_number = format!("the number of values is {n_params}");
        let (outputs, invariants, flows) = (self.outputs_of(), self.invariants_of(), self.flow_of());
        let positions = self.positions_of();
        let fields = self.fields();
        let inputs = self.inputs_over();
        let over = if fields.is_empty() && inputs.is_empty() {
            let (_, marked) = phantom();
            quote! { let _ = convert; Prepared { #marked } }
        } else {
            quote! { Prepared { #(#fields: convert(self.#fields),)* #inputs } }
        };
        let circles = self.circles_of();
        let inputs = self.inputs_of();
        let series = has_series.then(|| {
            quote! {
                fn series_of(#arguments, out: &mut [[R; #n]]) -> bool {
                    let mut workspace = #rt::Jet::workspace(self);
                    #rt::Jet::series(self, t, y, &mut workspace, out);
                    true
                }
            }
        });
        quote! {
            impl<R: #rt::Real> #rt::System<R> for Prepared<R> {
                type State = [R; #n];

                #[inline]
                fn rhs(#arguments, dy: &mut [R; #n]) {
                    self.rhs(t, y, dy);
                }

                #check

                #signature

                #domain
            }

            impl<Q: #rt::Real, R: #rt::Real> #rt::OverScalar<Q, R> for Prepared<R> {
                type Over = Prepared<Q>;

                fn over(&self, convert: impl Fn(R) -> Q) -> Prepared<Q> {
                    #over
                }

                fn state_over(state: &[R; #n], convert: impl Fn(R) -> Q) -> [Q; #n] {
                    state.map(convert)
                }
            }

            impl<R: #rt::Real> #rt::Scene<R> for Prepared<R> {
                const INFO: #rt::SceneInfo = INFO;

                #conserves_energy

                fn prepare(values: &[R]) -> Result<Self, #rt::ParamError> {
                    let Ok(values) = <[R; #n_params]>::try_from(values) else {
                        return Err(#rt::ParamError {
                            condition: #wrong_number,
                            meaning: "one for each of INFO.params",
                        });
                    };
                    Self::new(&Params::from_array(values))
                }

                fn energy_of(#arguments) -> Option<R> {
                    #energy
                }

                fn outputs_of(#arguments, out: &mut [R]) {
                    #outputs
                }

                #circles

                #series

                #invariants

                #positions

                #flows

                #inputs
            }
        }
    }

    fn outputs_of(&self) -> TokenStream {
        if self.module.outputs.is_empty() {
            return quote! { let _ = (t, y, out); };
        }
        let mut names: Vec<Ident> = Vec::new();
        let mut calls = TokenStream::new();
        for output in &self.module.outputs {
            let method = ident(&output.name);
            let own = idents((0..output.text.components.len()).map(|k| format!("v{}", names.len() + k)));
            calls.extend(if output.is_scalar() {
                quote! { let #(#own)* = self.#method(t, y); }
            } else {
                quote! { let [#(#own),*] = self.#method(t, y); }
            });
            names.extend(own);
        }
        let total = size(names.len());
        quote! {
            if let Ok(out) = <&mut [R; #total]>::try_from(out) {
                #calls
                *out = [#(#names),*];
            }
        }
    }
}
