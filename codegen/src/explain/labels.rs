//! How levels of stages, their forms and the parts of equations by stages are spelled.
//!
//! Does not know: what any of it is equal to.

use super::Page;
use hamel_expr::{Graph, Style};
use hamel_mechanics::mechanics::{ConnectionName, PairingKind};
use hamel_mechanics::reduction::{Stages, VerticalKind};

impl Page {
    /// `stem^(i,i+1)`, what belongs to level `i`.
    pub(super) fn of_level(&self, stem: &str, level: usize) -> String {
        let (stem, next) = (self.name(stem), level + 1);
        match self.style {
            Style::Latex => format!("{stem}^{{({level},{next})}}"),
            Style::MathMl => format!("<msup>{stem}<mtext>({level},{next})</mtext></msup>"),
            _ => format!("{stem}^({level},{next})"),
        }
    }

    /// The form `a` or `b` of level `i`: `a_01`.
    pub(super) fn form_of_level(&self, letter: &str, level: usize) -> String {
        match self.style {
            Style::Latex | Style::MathMl => self.of_level(letter, level),
            _ => format!("{letter}_{level}{}", level + 1),
        }
    }

    /// `of(first, second)`.
    pub(super) fn applied(&self, of: &str, arguments: &[&str]) -> String {
        match self.html() {
            true => format!(
                "<mrow>{of}<mo stretchy=\"false\">(</mo>{}<mo stretchy=\"false\">)</mo></mrow>",
                arguments.join("<mo>,</mo>")
            ),
            false => format!("{of}({})", arguments.join(", ")),
        }
    }

    /// `<first, second>`.
    pub(super) fn paired(&self, first: &str, second: &str) -> String {
        match self.style {
            Style::Latex => format!("\\langle {first}, {second}\\rangle"),
            Style::MathMl => format!(
                "<mrow><mo stretchy=\"false\">⟨</mo>{first}<mo>,</mo>{second}<mo stretchy=\"false\">⟩</mo></mrow>"
            ),
            _ => format!("⟨{first}, {second}⟩"),
        }
    }

    /// `ad*_first second`.
    pub(super) fn coadjoint(&self, first: &str, second: &str) -> String {
        match self.style {
            Style::Latex => format!("\\operatorname{{ad}}^*_{{{first}}} {second}"),
            Style::MathMl => {
                format!("<mrow><msubsup><mi>ad</mi>{first}<mo>*</mo></msubsup>{second}</mrow>")
            }
            _ => format!("ad*({first}) {second}"),
        }
    }

    /// The partial derivative along a coordinate, as a vector.
    pub(super) fn along(&self, coordinate: &str) -> String {
        let name = self.name(coordinate);
        match self.style {
            Style::Latex => format!("\\partial_{{{name}}}"),
            Style::MathMl => format!("<msub><mo>∂</mo>{name}</msub>"),
            _ => format!("∂_{name}"),
        }
    }

    /// Gives a component of a connection or its curvature the name by which it is read: `A^(1)_x` where indices can be
    /// set, `A1_x` elsewhere.
    pub(super) fn call_component(&self, g: &mut Graph, name: &ConnectionName) {
        let along: Vec<String> = name.coordinates.iter().map(|x| self.name(g.name(*x))).collect();
        let (stem, k) = (self.name(name.stem), name.component + 1);
        let label = match self.style {
            Style::Latex => format!("{stem}^{{({k})}}_{{{}}}", along.join("")),
            Style::MathMl => {
                format!("<msubsup>{stem}<mrow>{}</mrow><mtext>({k})</mtext></msubsup>", along.join(""))
            }
            _ => return,
        };
        g.rename(name.definition.symbol, Page::spelled(&label));
    }

    /// `A` at a coordinate.
    pub(super) fn connection_along(&self, coordinate: &str) -> String {
        self.name(&format!("A_{coordinate}"))
    }

    /// The sum of what belongs to the levels behind one.
    pub(super) fn behind_level(&self, stem: &str, level: usize, n_levels: usize) -> String {
        let terms: Vec<String> = (level + 1..n_levels).map(|l| self.of_level(stem, l)).collect();
        match self.html() {
            true => format!("<mrow>{}</mrow>", self.sum(&terms)),
            false => self.sum(&terms),
        }
    }

    /// How a part of an equation by stages is called, with the adapted basis called `stem`.
    pub(super) fn pairing(&self, kind: PairingKind, stages: &Stages, stem: &str, base: &[String]) -> String {
        let beta = self.name("beta");
        let element = |k: usize| self.name(&format!("{stem}{}", k + 1));
        let velocity = |level: usize| self.of_level("eta", level);
        match kind {
            PairingKind::Level { kind, element: k } => {
                let own = stages.level_of(k);
                let f = element(k);
                match kind {
                    VerticalKind::Coadjoint => {
                        let of = self.coadjoint(&velocity(own), &self.of_level("beta", own));
                        self.paired(&of, &f)
                    }
                    VerticalKind::Curvature => {
                        let form = self.form_of_level("a", own);
                        self.paired(&beta, &self.applied(&form, &[&velocity(own), &f]))
                    }
                    VerticalKind::Below => {
                        let form = self.form_of_level("b", own);
                        let below = self.behind_level("eta", own, stages.levels.len());
                        self.paired(&beta, &self.applied(&form, &[&f, &below]))
                    }
                    VerticalKind::Above(level) => {
                        let form = self.form_of_level("b", level);
                        self.paired(&beta, &self.applied(&form, &[&velocity(level), &f]))
                    }
                }
            }
            PairingKind::Turning { element: k } => {
                let rate = match self.style {
                    Style::Latex => format!("\\dot{{{}}}", element(k)),
                    _ => self.name(&format!("dot_{stem}{}", k + 1)),
                };
                self.paired(&beta, &rate)
            }
            PairingKind::ShapeCurvature { coordinate } => {
                let (x, rate) = (self.along(&base[coordinate]), self.name("dot_x"));
                self.paired(&beta, &self.applied(&self.name("B"), &[&x, &rate]))
            }
            PairingKind::ShapeBracket { coordinate } => {
                let bracket = self.bracket(&self.connection_along(&base[coordinate]), &self.name("v"));
                let bracket = if self.html() { format!("<mrow>{bracket}</mrow>") } else { bracket };
                self.paired(&beta, &bracket)
            }
            PairingKind::ShapeDrift { coordinate } => {
                let time = match self.style {
                    Style::Latex => "\\tfrac{d}{dt}",
                    Style::MathMl => "<mfrac><mi>d</mi><mrow><mi>d</mi><mi>t</mi></mrow></mfrac>",
                    _ => "d/dt",
                };
                let bracket = self.bracket(time, &self.name(&format!("D_{}", base[coordinate])));
                let bracket = if self.html() { format!("<mrow>{bracket}</mrow>") } else { bracket };
                self.paired(&beta, &bracket)
            }
        }
    }
}
