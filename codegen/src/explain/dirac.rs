//! The reduced Dirac structure of a scene, for people.
//!
//! Does not know: how it is made.

use super::{Page, SectionKind};
use hamel_expr::{ExprId, Style, SymbolId};
use hamel_mechanics::mechanics::{DiracStructure, Equations};

impl Page {
    /// Coordinates, conditions with the numbers of the model, and what makes equations of motion of them.
    pub(super) fn dirac(&mut self, equations: &Equations) {
        let system = &equations.system;
        let found = DiracStructure::new(system);
        let g = &found.graph;
        self.begin(SectionKind::Dirac);
        let name = |page: &Page, s: &SymbolId| page.name(g.name(*s));
        let names = |page: &Page, list: &[SymbolId]| {
            let names: Vec<String> = list.iter().map(|s| name(page, s)).collect();
            page.inline(&page.list(&names))
        };
        let show = |page: &Page, e: &ExprId| g.display(*e, page.style);
        let (n_velocities, has_base) = (found.eta.len(), !found.alpha.is_empty());
        let base = names(self, system.algebroid.base());
        let momenta = names(self, &found.momenta);
        match has_base {
            true => self.line(&format!("At a place {base} with momenta {momenta}: pairs of")),
            false => self.line(&format!("At momenta {momenta}: pairs of")),
        }
        let rates: Vec<String> = found.momenta.iter().map(|p| self.rate(&name(self, p))).collect();
        let rates = self.inline(&self.list(&rates));
        let (eta, beta) = (names(self, &found.eta), names(self, &found.beta));
        self.line(&format!("a velocity {eta}, with {rates}, and"));
        let places = match has_base {
            true => format!(" {} along the rates of places,", names(self, &found.alpha)),
            false => String::new(),
        };
        let w: Vec<String> =
            system.algebroid.frame().iter().map(|frame| self.name(&format!("w_{frame}"))).collect();
        let w_names = self.inline(&self.list(&w));
        self.line(&format!(
            "a covector{places} {beta} along the velocity, {w_names} along the rates of momenta,"
        ));
        self.line("such that");
        if has_base {
            self.line("the places move by the anchor");
            let rows: Vec<(String, String)> = (system.algebroid.base().iter().zip(&found.rates))
                .map(|(x, e)| (self.rate(&self.name(g.name(*x))), show(self, e)))
                .collect();
            self.formulas(&rows);
        }
        if !found.annihilator.is_empty() {
            self.line(match found.has_own_velocities {
                true => "the velocity satisfies the constraint",
                false => "the velocity is a virtual displacement",
            });
            let zero = g.display(g.zero(), self.style);
            let rows: Vec<(String, String)> =
                found.annihilator.iter().map(|e| (show(self, e), zero.clone())).collect();
            self.formulas(&rows);
        }
        self.line("the covector along the rates of momenta is the velocity");
        let rows: Vec<(String, String)> =
            w.iter().zip(&found.eta).map(|(w, eta)| (w.clone(), name(self, eta))).collect();
        self.formulas(&rows);
        let bracket = match (&system.connection, found.lambda.is_empty()) {
            (Some(_), true) => "the momenta change by anchor, bracket and curvature",
            (Some(_), false) => "the momenta change by anchor, bracket and curvature, up to the annihilator",
            (None, true) => "the momenta change by anchor and bracket",
            (None, false) => "the momenta change by anchor and bracket, up to the annihilator",
        };
        self.line(bracket);
        let rows: Vec<(String, String)> = (found.momenta.iter().zip(&found.momentum_rates))
            .map(|(p, e)| (self.rate(&name(self, p)), show(self, e)))
            .collect();
        self.formulas(&rows);
        if !found.lambda.is_empty() {
            let lambda = names(self, &found.lambda);
            self.line(&format!("for some {lambda}."));
        }
        if !system.algebroid.has_drift() {
            if has_base {
                self.line(
                    "What pairs with the rates of places pairs with the velocity, by the anchor. So counted,",
                );
            }
            self.line(&format!(
                "{} of {} dimensions are in it, and any two of its elements pair to zero.",
                2 * n_velocities,
                4 * n_velocities
            ));
        }
        self.motion(equations, found.has_own_velocities);
    }

    /// What the equations of motion are in the structure.
    fn motion(&mut self, equations: &Equations, has_own_velocities: bool) {
        let (e, l, p, y) = match self.style {
            Style::MathMl => ("<mi>E</mi>", "<mi>L</mi>", "<mi>p</mi>", "<mi>y</mi>"),
            _ => ("E", "L", "p", "y"),
        };
        let [e, l, p, y] = [e, l, p, y].map(|text| self.inline(text));
        let is_hamiltonian = equations.system.hamiltonian.is_some();
        if !has_own_velocities {
            let eta = self.inline(&self.name("eta"));
            self.line(&format!(
                "The velocity {y} of a motion satisfies the constraint and is no displacement, so that it is not in the"
            ));
            self.line(&format!(
                "structure. Its momenta have the rates above all the same, with {y} for {eta} and, for the covector, the"
            ));
            self.line(&match is_hamiltonian {
                true => "differential of h less the force.".to_owned(),
                false => format!(
                    "differential of {e} = {p}.{y} - {l} less the force, where {p} is the slope of {l} along {y}."
                ),
            });
            return;
        }
        match is_hamiltonian {
            true => {
                self.line(
                    "The motion is the velocity that is in it with the differential of h less the force.",
                );
            }
            false => {
                self.line(&format!(
                    "The motion is the velocity {y} that is in it with the differential of {e} = {p}.{y} - {l} less the"
                ));
                self.line(&format!("force, where {p} is the slope of {l} along {y}."));
            }
        }
    }
}
