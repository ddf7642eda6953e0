//! White noise: inputs whose integrals are Wiener processes, and the Hamiltonians that they multiply.
//!
//! Deliberately does not know: how a noise moves the state, where increments come from.

use std::collections::BTreeSet;

use num_traits::Zero;

use super::draft::{ModelBuilder, NoiseDraft};
use super::symbols::Special;
use crate::spec::diagnostic::Diagnostic;
use crate::spec::expressions::ExpressionRole;
use crate::spec::model::*;
use crate::spec::value::Value;
use hamel_expr::{Rational, SymbolId};

/// What a noise may stand in.
const PLACE: &str = "a noise is for `force`, `acceleration`, `field`, `state` and `reconstruct .. by`, or multiplies \
                     a Hamiltonian of its own, `noise W: h;`: it has increments, and no value at a time";

impl ModelBuilder {
    /// White noise: the derivative of a Wiener process `W` by time, in the sense of Stratonovich. It is an input that
    /// is held at zero.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("kicked");
    /// let (x, v) = b.coordinate("x", Domain::Real, "");
    /// let kick = b.noise("W", "");
    /// let _stretch = b.noise("V", "");
    /// let (energy, h) = (v.mul(b.graph(), &v).unwrap(), x.mul(b.graph(), &x).unwrap());
    /// b.lagrangian(&energy).force("x_dot", &kick).noise_hamiltonian("V", &h);
    /// let model = b.build().unwrap();
    /// assert_eq!(model.noises[1].name, "V");
    /// assert!(model.noises[0].hamiltonian.is_none());
    /// ```
    pub fn noise(&mut self, name: &str, doc: &str) -> Value {
        let value = self.input(name, Rational::zero(), doc);
        self.noises.push(NoiseDraft { name: name.to_owned(), hamiltonian: None, span: self.here });
        value
    }

    /// The function `h(x, p, a, t)` of coordinates, momenta, advected parameters and time that a noise multiplies: the
    /// motion gains `X_h` times the increments of the noise, `X_h` the Hamiltonian vector field of `h`.
    ///
    /// # Source
    /// Bismut 1981, Mecanique aleatoire; Holm 2015, Variational principles for stochastic fluid dynamics.
    pub fn noise_hamiltonian(&mut self, name: &str, h: &Value) -> &mut Self {
        let here = self.here;
        match self.noises.iter_mut().find(|noise| noise.name == name) {
            Some(noise) => noise.hamiltonian = Some((h.clone(), here)),
            None => self.problem(here, format!("`{name}` is not a noise"), "declare it first"),
        }
        self
    }

    pub(super) fn check_noises(&mut self) -> Vec<Noise> {
        let mut noises = Vec::new();
        for NoiseDraft { name, hamiltonian, span } in std::mem::take(&mut self.noises) {
            let Some(symbol) = self.inputs.iter().find(|input| input.name == name).map(|i| i.symbol) else {
                continue;
            };
            let mut noise = Noise { name, symbol, hamiltonian: None, span };
            if let Some((value, place)) = hamiltonian {
                let Value::Scalar(h) = value else {
                    let message = format!("{} must be a number, found {}", noise.function(), value.shape());
                    self.problem(place, message, "use `dot(a, b)` for the pairing of vectors");
                    continue;
                };
                self.reports_stray(h, place, &noise.function(), &[Special::Momentum]);
                noise.hamiltonian = Some((h, place));
            }
            noises.push(noise);
        }
        noises
    }

    /// Whether an input is white noise, which nothing drives.
    pub(super) fn is_noise(&self, name: &str) -> bool {
        self.noises.iter().any(|noise| noise.name == name)
    }
}

/// One problem for each item that would have the value of a noise, and for each Hamiltonian of a noise that is no
/// function of coordinates, momenta, advected parameters and time.
pub(super) fn misplaced_noises(model: &Model) -> Vec<Diagnostic> {
    let noises: BTreeSet<SymbolId> = model.noises.iter().map(|noise| noise.symbol).collect();
    let velocities: BTreeSet<SymbolId> =
        model.all_velocities().into_iter().map(|(_, symbol)| symbol).collect();
    let mut problems: Vec<Diagnostic> = Vec::new();
    let mut add = |problem: Diagnostic| {
        if !problems.iter().any(|p| p.span == problem.span && p.message == problem.message) {
            problems.push(problem);
        }
    };
    for (role, e) in model.expressions() {
        let free = model.graph.free_symbols(e);
        let name = |symbol: &SymbolId| model.graph.name(*symbol).to_owned();
        match role {
            ExpressionRole::Output(k) => {
                let Some(noise) = free.iter().find(|s| noises.contains(s)) else { continue };
                let output = &model.outputs[k].name;
                let message = format!("`{output}` contains the noise `{}`", name(noise));
                add(Diagnostic::new(model.places.outputs.get(output).copied(), message).with_help(PLACE));
            }
            ExpressionRole::Noise(k) => {
                let noise = &model.noises[k];
                let span = noise.hamiltonian.and_then(|(_, span)| span);
                if let Some(velocity) = free.iter().find(|s| velocities.contains(s)) {
                    let velocity = name(velocity);
                    let message = format!("{} contains the velocity `{velocity}`", noise.function());
                    let help = format!("name its momentum, `momentum p of {velocity};`, and write it by `p`");
                    add(Diagnostic::new(span, message).with_help(help));
                }
            }
            _ => {}
        }
    }
    problems
}
