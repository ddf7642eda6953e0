//! The section about momenta along sections: those of the model with their rates, and conserved ones that were
//! found.
//!
//! Does not know: how any of it was found.

use super::{Page, SectionKind};
use hamel_expr::{Graph, Vanishing};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{ConservedMomenta, ConservedMomentum, Equations, OutputKind};

impl Page {
    /// The momenta along the sections of the model and whether they are conserved, and what else of the kind is.
    pub(super) fn along_sections(&mut self, equations: &Equations) {
        let found = ConservedMomenta::new(equations).ok();
        let found = found.filter(|found| !found.momenta.is_empty() || found.moving_energy.is_some());
        if equations.along_sections.is_empty() && found.is_none() {
            return;
        }
        self.begin(SectionKind::Sections);
        self.named_sections(equations);
        if let Some(found) = found {
            self.found_sections(&found);
        }
    }

    /// Conserved momenta and the moving energy that were found.
    fn found_sections(&mut self, found: &ConservedMomenta) {
        let ConservedMomenta { graph: g, momenta, moving_energy, is_on_constraint } = found;
        let place = if *is_on_constraint { " where the constraint holds" } else { "" };
        if !momenta.is_empty() {
            let s = self.inline(&self.name("s"));
            self.line(&format!(
                "Conserved{place}, proved: the momenta along these sections {s} with coefficients on the base, and"
            ));
            self.line("functions of them:");
            for momentum in momenta {
                self.section("s", g, momentum);
            }
        }
        if let Some(energy) = moving_energy {
            let value = self.inline(&match self.html() {
                true => "<mi>E</mi><mo>−</mo><mo>⟨</mo><mi>p</mi><mo>,</mo><mi>Y</mi><mo>⟩</mo>".to_owned(),
                false if self.latex() => "E - \\langle p, Y\\rangle".to_owned(),
                false => "E - <p, Y>".to_owned(),
            });
            self.line(&format!("The moving energy {value} is conserved{place}, proved, with the section"));
            self.section("Y", g, energy);
        }
    }

    /// `s = f along v, ..`.
    fn section(&mut self, name: &str, g: &Graph, momentum: &ConservedMomentum) {
        let parts = momentum.section.iter().map(|(velocity, e)| {
            let along = self.inline(&self.name(velocity));
            format!("{} along {along}", self.inline(&g.display(*e, self.style)))
        });
        let parts: Vec<String> = parts.collect();
        let name = self.inline(&self.name(name));
        self.line(&format!("  {name}: {}", parts.join(", ")));
    }

    fn named_sections(&mut self, equations: &Equations) {
        let g = &equations.labelled();
        let values = equations.outputs.iter().filter(|o| o.kind == OutputKind::Group(Want::Sections));
        let values = values.flat_map(|o| &o.components);
        let rows = values.map(|(name, e)| (self.name(name), g.display(*e, self.style))).collect();
        self.readable_formulas(rows);
        for section in &equations.along_sections {
            let name = self.inline(&self.name(&section.name));
            let kind = match section.is_displacement {
                Some(true) => "a section of virtual displacements",
                Some(false) => "not a section of virtual displacements, so that reactions act along it",
                None => "a section of which it is not known whether reactions act along it",
            };
            let is_constrained = equations.system.constraint.texts().next().is_some();
            let kind = if is_constrained { format!(", {kind}") } else { String::new() };
            let rate = self.short(g, section.rate);
            let verdict = match section.verdict {
                Vanishing::Zero => "conserved, proved".to_owned(),
                _ if equations.vanishes_on_constraint(section.rate) => {
                    "conserved where the constraint holds, proved".to_owned()
                }
                Vanishing::NonZero => format!("not conserved, its rate is {rate}"),
                Vanishing::Unknown => {
                    format!("its rate could not be shown to vanish, nor not to: {rate}")
                }
            };
            self.line(&format!("{name}{kind}: {verdict}."));
        }
    }
}
