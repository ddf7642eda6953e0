//! The section about the nonholonomic bracket.
//!
//! Does not know: how any of it was found.

use super::{Page, SectionKind};
use crate::scene::BuiltScene;
use hamel_expr::error::Error;
use hamel_expr::{Budget, ExprId, Func, Rational, Style};
use hamel_lang::spec::{Coordinate, Domain, Model, Want};
use hamel_mechanics::mechanics::{BracketFacts, Density, Jacobi};
use hamel_mechanics::reduction::KinematicConstraint;

impl Page {
    /// The bracket of a constrained system, and of a scene that wants it.
    pub(super) fn bracket_of(&mut self, model: &Model, scene: &BuiltScene) {
        let is_constrained = match &scene.equations.system.constraint {
            KinematicConstraint::Solved(solved) => !solved.reactions.names.is_empty(),
            KinematicConstraint::Multipliers { .. } => true,
        };
        if !is_constrained && !scene.matrices().iter().any(|m| m.name == Want::Bracket.name()) {
            return;
        }
        self.begin(SectionKind::Bracket);
        match BracketFacts::new(&scene.equations, &scene.left_out()) {
            Ok(facts) => self.bracket_facts(model, &facts),
            Err(Error::NoBracket { reason }) => {
                let reason = self.prose(&reason);
                self.line(&format!("There is none: {reason}."));
            }
            Err(error) => {
                let reason = self.prose(&error.to_string());
                self.line(&format!("Nothing was found out about it: {reason}."));
            }
        }
    }

    fn bracket_facts(&mut self, model: &Model, facts: &BracketFacts) {
        let n = facts.coordinates.len();
        let remainder = if facts.remainder.is_empty() { "" } else { " + R" };
        let motion = match facts.dependent.is_empty() {
            true => format!("The motion is y' = Pi dE{remainder}, which is proved"),
            false => {
                self.line("On the constraint, with");
                let rows = facts.dependent.iter();
                let rows = rows.map(|(name, e)| (self.name(name), facts.graph.display(*e, self.style)));
                let rows: Vec<(String, String)> = rows.collect();
                self.readable_formulas(rows);
                format!("the motion is y' = Pi dE{remainder}, which is proved")
            }
        };
        let zeros = n * n.saturating_sub(1) / 2 - facts.entries.len();
        self.line(&format!("{motion}; the entries of Pi are {{y_i, y_j}}, {zeros} of them zero:"));
        let rows = facts.entries.iter().map(|([a, b], e)| {
            let [a, b] = [a, b].map(|name| self.name(name));
            (self.braces(&a, &b), facts.graph.display(*e, self.style))
        });
        let rows: Vec<(String, String)> = rows.collect();
        self.readable_formulas(rows);
        if !facts.remainder.is_empty() {
            self.line("R, by inhomogeneous constraints, explicit time or forces:");
            let rows = facts.remainder.iter();
            let rows = rows.map(|(name, e)| {
                let name = format!("R_{name}");
                (self.name(&name), facts.graph.display(*e, self.style))
            });
            let rows: Vec<(String, String)> = rows.collect();
            self.readable_formulas(rows);
        }
        if facts.is_of_one_root {
            self.line("The other solution of the constraint has its root with the opposite sign, here and in the entries.");
        }
        if !facts.dependent.is_empty() {
            let list: Vec<String> = facts.dependent.iter().map(|(name, _)| self.name(name)).collect();
            let list = self.inline(&self.list(&list));
            self.line(&format!("What follows is about the constraint surface, without {list}."));
        }
        let triple = |page: &Page, names: &[String; 3]| {
            let names: Vec<String> = names.iter().map(|name| page.name(name)).collect();
            page.inline(&page.list(&names))
        };
        let jacobi = match &facts.jacobi {
            Jacobi::Holds if facts.remainder.is_empty() => {
                "Jacobi holds: it is a Poisson bracket, and the motion is Hamiltonian.".to_owned()
            }
            Jacobi::Holds => "Jacobi holds: it is a Poisson bracket.".to_owned(),
            Jacobi::Fails(names) => format!("Jacobi fails, first for {}.", triple(self, names)),
            Jacobi::Unknown(names) => {
                format!("Whether Jacobi holds is not known, first for {}.", triple(self, names))
            }
        };
        self.line(&jacobi);
        self.line(&format!("Rank {} of {n} at a general state.", facts.rank));
        let ansatz = format!("polynomials of degree {} or less in coordinates and momenta p", facts.degree);
        if facts.casimirs.is_empty() {
            self.line(&format!("No Casimir among the {ansatz}."));
        } else {
            self.line(&format!("Casimirs among the {ansatz}, proved:"));
            let rows: Vec<(String, String)> = (facts.casimirs.iter().enumerate())
                .map(|(k, e)| (self.name(&format!("C{}", k + 1)), facts.graph.display(*e, self.style)))
                .collect();
            self.readable_formulas(rows);
        }
        let volume = "the volume of all components of the state";
        let on =
            if facts.dependent.is_empty() { "" } else { ", divided by the differentials of the constraints" };
        match &facts.measure {
            Density::Found { factors, exponent: None } if factors.is_empty() => {
                self.line(&format!("Invariant measure: the motion keeps {volume}{on}."));
            }
            Density::Found { factors, exponent } => {
                self.line(&format!("Invariant measure: N times {volume}{on}, proved, with"));
                let density = self.density(facts, factors.iter().map(|f| (f.base, &f.exponent)), *exponent);
                self.readable_formulas(vec![(self.name("N"), density)]);
                self.many_valued(model, facts, *exponent);
            }
            Density::Impossible { reason, conditions } => {
                self.line(&format!(
                    "No smooth invariant measure with a positive density N(x), proved: {reason}."
                ));
                // A number other than zero vanishes nowhere.
                let can_vanish = |e: &ExprId| !facts.graph.free_symbols(*e).is_empty();
                if !conditions.is_empty() && conditions.iter().all(can_vanish) {
                    self.line("There is one where all of these vanish:");
                    let rows = conditions.iter().enumerate();
                    let rows = rows.map(|(k, e)| {
                        (self.name(&format!("d{}", k + 1)), facts.graph.display(*e, self.style))
                    });
                    let rows: Vec<(String, String)> = rows.collect();
                    self.readable_formulas(rows);
                }
            }
            Density::NotFound { reason } => {
                self.line(&format!(
                    "No smooth invariant measure with a positive density N(x) found in the ansatz: {reason}."
                ));
            }
        }
        match &facts.multiplier {
            None => {}
            Some(Density::Found { factors, exponent }) => {
                self.line(
                    "Hamiltonian after a change of time: f Pi satisfies Jacobi, proved, dt = f dtau, with",
                );
                let density = self.density(facts, factors.iter().map(|f| (f.base, &f.exponent)), *exponent);
                self.readable_formulas(vec![(self.name("f"), density)]);
                self.many_valued(model, facts, *exponent);
            }
            Some(Density::Impossible { reason, .. }) => {
                self.line(&format!("No positive f(x) makes f Pi satisfy Jacobi, proved: {reason}."));
            }
            Some(Density::NotFound { reason }) => {
                self.line(&format!(
                    "No positive f(x) with which f Pi satisfies Jacobi found in the ansatz: {reason}."
                ));
            }
        }
    }

    fn braces(&self, a: &str, b: &str) -> String {
        match self.style {
            Style::Latex => format!("\\{{{a}, {b}\\}}"),
            Style::MathMl => {
                format!("<mo stretchy=\"false\">{{</mo>{a}<mo>,</mo>{b}<mo stretchy=\"false\">}}</mo>")
            }
            _ => format!("{{{a}, {b}}}"),
        }
    }

    fn density<'f>(
        &self,
        facts: &BracketFacts,
        factors: impl Iterator<Item = (ExprId, &'f Rational)>,
        exponent: Option<ExprId>,
    ) -> String {
        let mut g = facts.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        let mut parts: Vec<(ExprId, Rational)> = factors.map(|(e, q)| (e, q.clone())).collect();
        if let Some(exponent) = exponent {
            let growth = g.func(Func::Exp, exponent);
            parts.push((growth, Rational::from_integer(1.into())));
        }
        // Factors are functions that do not vanish identically.
        let one = g.one();
        let product = g.power_product(&parts).unwrap_or(one);
        g.display(product, self.style)
    }

    /// Says which angles an exponential of coordinates has.
    fn many_valued(&mut self, model: &Model, facts: &BracketFacts, exponent: Option<ExprId>) {
        let Some(exponent) = exponent else { return };
        let used = facts.graph.free_symbols(exponent);
        let is_angle = |c: &&Coordinate| {
            matches!(c.domain, Domain::Angle) && used.iter().any(|s| facts.graph.name(*s) == c.name)
        };
        let angles: Vec<String> = model.base.iter().filter(is_angle).map(|c| self.name(&c.name)).collect();
        if !angles.is_empty() {
            let list = self.inline(&self.list(&angles));
            self.line(&format!(
                "It has many values on the circles of {list}: it is one of the motion on their covering only."
            ));
        }
    }
}
