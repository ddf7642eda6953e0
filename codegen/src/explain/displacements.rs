//! Virtual displacements that a model gives, as text for people: their connection, and both forms of the equations.
//!
//! Deliberately does not know: how any of it was computed.

use hamel_expr::Style;
use hamel_lang::spec::Model;
use hamel_mechanics::mechanics::{DisplacementForms, Equations};

use super::{Page, SectionKind, latex, visible_width};

impl Page {
    /// Displacements of a model that says itself which there are.
    pub(super) fn displacements(&mut self, model: &Model, equations: &Equations) {
        if model.virtual_constraints.is_empty() {
            return;
        }
        let Some(forms) = DisplacementForms::new(equations, model.n_shape()) else { return };
        let frame = equations.system.algebroid.frame();
        let g = &forms.graph;
        self.begin(SectionKind::Displacements);
        let conditions = forms.conditions.iter().zip(&model.virtual_constraints).map(|(condition, own)| {
            let (left, zero) = (g.display(*condition, self.style), self.zero());
            (left, format!("{zero}{}", self.note(&own.name)))
        });
        let conditions: Vec<(String, String)> = conditions.collect();
        self.formulas(&conditions);
        let along: Vec<String> =
            forms.complement.iter().map(|c| self.name(&format!("e_{}", frame[*c]))).collect();
        let along = self.inline(&self.list(&along));
        let space = self.inline(&self.name("C_V"));
        self.line(&format!(
            "They are the horizontal space {space} of a connection with values in the complement along {along}:"
        ));
        let rows = forms.complement.iter().zip(&forms.connection);
        let rows = rows.map(|(c, e)| (self.name(&format!("A_{}", frame[*c])), g.display(*e, self.style)));
        let rows: Vec<(String, String)> = rows.collect();
        self.formulas(&rows);
        match &forms.curvature {
            None => self.line(&format!(
                "They depend on velocities or accelerations, so that {space} has no curvature on the base."
            )),
            Some(list) if list.is_empty() => {
                self.line("Its curvature vanishes: brackets of displacements are displacements.");
            }
            Some(list) => {
                self.line(&format!(
                    "Its curvature, minus the complement's part of brackets in {space}, as far as it does not vanish:"
                ));
                let rows = list.iter().map(|(a, b, c, value)| {
                    let symbol = self.indexed("B", &frame[*c], &[&frame[*a], &frame[*b]]);
                    (symbol, g.display(*value, self.style))
                });
                let rows: Vec<(String, String)> = rows.collect();
                self.formulas(&rows);
            }
        }
        let Some(both) = &forms.equations else { return };
        self.line("Reactions do no work on them. With");
        let rows =
            both.residuals.iter().map(|d| (self.name(g.name(d.symbol)), g.display(d.expr, self.style)));
        let rows: Vec<(String, String)> = rows.collect();
        self.formulas(&rows);
        self.line(&format!(
            "the equations with multipliers and their projection on {space}, proved of the motion:"
        ));
        let multipliers =
            both.with_multipliers.iter().map(|(l, r)| [*l, *r].map(|e| g.display(e, self.style)));
        let projected = both.projected.iter().map(|e| [g.display(*e, self.style), self.zero()]);
        let (multipliers, projected): (Vec<_>, Vec<_>) = (multipliers.collect(), projected.collect());
        self.side_by_side(&multipliers, &projected);
    }

    fn zero(&self) -> String {
        if self.html() { "<mn>0</mn>".to_owned() } else { "0".to_owned() }
    }

    /// A name behind a formula.
    fn note(&self, name: &str) -> String {
        match self.style {
            Style::Latex => format!("\\quad ({})", self.name(name)),
            Style::MathMl => format!("<mspace width=\"1em\"/><mo>(</mo>{}<mo>)</mo>", self.name(name)),
            _ => format!("   ({})", self.name(name)),
        }
    }

    /// Equations in two columns, of which the first is as long or longer.
    fn side_by_side(&mut self, left: &[[String; 2]], right: &[[String; 2]]) {
        let (latex, html) = (self.latex(), self.html());
        let equation = |[l, r]: &[String; 2]| match (latex, html) {
            (true, _) => format!("{l} &= {r}"),
            (_, true) => format!("<td><math>{l}<mo>=</mo>{r}</math></td>"),
            _ => format!("{l} = {r}"),
        };
        let width = left.iter().map(|e| visible_width(&equation(e))).max().unwrap_or(0);
        let rows: Vec<String> = (left.iter().enumerate())
            .map(|(k, one)| {
                let (one, other) = (equation(one), right.get(k).map(equation));
                match (latex, html) {
                    (true, _) => format!("  {one} & {}", other.unwrap_or_else(|| "&".to_owned())),
                    (_, true) => format!("<tr>{one}{}</tr>", other.unwrap_or_else(|| "<td></td>".to_owned())),
                    _ => {
                        let pad = " ".repeat(width - visible_width(&one));
                        format!("  {one}{}", other.map_or_else(String::new, |e| format!("{pad}     {e}")))
                    }
                }
            })
            .collect();
        match (latex, html) {
            (true, _) => self.raw(&latex::environments(&rows)),
            (_, true) => {
                self.raw(&format!("<div class=\"formulas\"><table>\n{}\n</table></div>\n", rows.join("\n")));
            }
            _ => rows.iter().for_each(|row| self.line(row)),
        }
    }
}
