//! What makes a scene usable by every integrator and by name: `System`, `OverScalar` and `Scene`.
//!
//! Does not know: what the methods compute.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::lines;
use super::tokens::size;

impl Writer<'_> {
    /// The traits, calling the methods.
    pub(super) fn traits(&self, has_series: bool) -> TokenStream {
        let (module, rt) = (self.module, &self.runtime);
        let (n, arguments) = (module.state.len(), self.arguments());
        let mut methods = String::new();
        let optional = [
            ("pivots", module.pivots.is_some()),
            ("signature", module.signature.is_some()),
            ("domain", module.domain.is_some()),
            ("ranks", module.ranks().is_some()),
        ];
        for (name, _) in optional.iter().filter(|(_, is_there)| *is_there) {
            methods.push_str(&format!(" {name}"));
        }
        let system = lines::statements(&format!("{}::system!(Prepared[{n}]{methods});", self.path));
        let energy = match (module.energy.is_some(), module.text.conserves_energy) {
            (true, true) => "conserved",
            (true, false) => "energy",
            (false, _) => "without_energy",
        };
        let scene =
            lines::statements(&format!("{}::scene!([{n}] {energy}, {});", self.path, self.outputs_of()));
        let (invariants, flows) = (self.invariants_of(), self.flow_of());
        let (positions, over_scalar) = (self.positions_of(), self.over_scalar());
        let (circles, inputs, n) = (self.circles_of(), self.inputs_of(), size(n));
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
            #system

            #over_scalar

            impl<R: #rt::Real> #rt::Scene<R> for Prepared<R> {
                #scene

                #circles

                #series

                #invariants

                #positions

                #flows

                #inputs
            }
        }
    }

    /// The methods of outputs with their places: arrays, then numbers.
    fn outputs_of(&self) -> String {
        let (mut at, mut arrays, mut numbers) = (0, Vec::new(), Vec::new());
        for output in &self.module.outputs {
            let (name, end) = (&output.name, at + output.text.components.len());
            match output.is_scalar() {
                true => numbers.push(format!("{name}[{at}],")),
                false => arrays.push(format!("{name}[{at}..{end}],")),
            }
            at = end;
        }
        let list = |items: &[String]| match items {
            [] => "{}".to_owned(),
            items => format!("{{ {} }}", items.join(" ")),
        };
        format!("outputs [{at}] {} {}", list(&arrays), list(&numbers))
    }
}
