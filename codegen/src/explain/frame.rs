//! Frames and algebroids that a model declares, and coefficients of connections, as text for people.
//!
//! Deliberately does not know: how any of it was computed.

use hamel_expr::{Budget, ExprId, Graph, Style};
use hamel_lang::spec::{Model, OwnAlgebroid};
use hamel_mechanics::mechanics::{Coefficients, Equations};

use super::{Page, SectionKind};

impl Page {
    /// The quasi-velocities, and Hamel's symbols `[e_a, e_b] = gamma^c_ab e_c` of their frame.
    pub(super) fn frame(&mut self, model: &Model, equations: &Equations) {
        let system = &equations.system;
        let Some(frame) = system.quasi_frame.as_ref().filter(|_| model.frame.is_some()) else { return };
        self.begin(SectionKind::Frame);
        let mut g = system.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        let old: Vec<ExprId> = frame.original.iter().map(|u| g.sym(u.symbol)).collect();
        let names = system.algebroid.frame().to_vec();
        let own: Vec<ExprId> = system.velocities.iter().map(|s| g.sym(*s)).collect();
        let values = frame.velocities(&mut g, &own);
        let (mut forth, mut back) = (Vec::new(), Vec::new());
        for (k, name) in names.iter().enumerate().filter(|(k, _)| own[*k] != old[*k]) {
            let sum = g.dot(&frame.inverse[k], &old);
            forth.push((self.name(name), g.display(sum, self.style)));
            back.push((self.name(&frame.original[k].name), g.display(values[k], self.style)));
        }
        self.formulas(&forth);
        self.line("and back:");
        self.formulas(&back);
        let rows = self.symbols_of_hamel(&mut g, equations);
        if rows.is_empty() {
            self.line("Hamel's symbols vanish: the sections of the frame commute.");
        } else {
            self.line("Hamel's symbols of the sections, [e_a, e_b] = gamma^c_ab e_c, those that do not vanish for a < b:");
            self.formulas(&rows);
        }
    }

    fn symbols_of_hamel(&self, g: &mut Graph, equations: &Equations) -> Vec<(String, String)> {
        let algebroid = &equations.system.algebroid;
        let names = algebroid.frame();
        let mut rows = Vec::new();
        for a in 0..names.len() {
            for b in a + 1..names.len() {
                for (c, value) in algebroid.bracket(g, a, b) {
                    let symbol = self.indexed("gamma", &names[c], &[&names[a], &names[b]]);
                    rows.push((symbol, g.display(value, self.style)));
                }
            }
            for (c, value) in algebroid.drift(a) {
                let symbol = self.indexed("gamma", &names[*c], &["t", &names[a]]);
                rows.push((symbol, g.display(*value, self.style)));
            }
        }
        rows
    }

    /// `stem^upper_lower`.
    pub(super) fn indexed(&self, stem: &str, upper: &str, lower: &[&str]) -> String {
        let (stem, upper) = (self.name(stem), self.name(upper));
        let lower: Vec<String> = lower.iter().map(|name| self.name(name)).collect();
        match self.style {
            Style::Latex => format!("{stem}^{{{upper}}}_{{{}}}", lower.join("\\,")),
            Style::MathMl => format!(
                "<msubsup>{stem}<mrow>{}</mrow><mrow>{upper}</mrow></msubsup>",
                lower.join("<mspace width=\"0.2em\"/>")
            ),
            _ => format!("{stem}^{upper}_({})", lower.join(", ")),
        }
    }

    /// The algebroid that the model declares, by its brackets; its anchor is the kinematics.
    pub(super) fn own_algebroid(&mut self, model: &Model, own: &OwnAlgebroid) {
        self.begin(SectionKind::Algebroid);
        let g = &model.graph;
        let basis: Vec<String> = own.basis.iter().map(|b| self.name(b)).collect();
        self.line(&format!("Rank {} over {} base coordinates.", basis.len(), model.base.len()));
        let names = model.frame.as_ref().map_or_else(
            || model.velocities.iter().map(|v| v.name.clone()).collect::<Vec<_>>(),
            |frame| frame.original.iter().map(|(name, _)| name.clone()).collect(),
        );
        let pairs: Vec<String> = names
            .iter()
            .zip(&basis)
            .map(|(v, b)| match self.style {
                Style::MathMl => self.style.product(&[self.name(v), b.clone()]),
                _ => format!("{} {b}", self.name(v)),
            })
            .collect();
        let sum = self.inline(&if self.html() { self.sum(&pairs) } else { pairs.join(" + ") });
        self.line(&format!("Velocity {sum}, with the brackets"));
        let rows: Vec<(String, String)> = own
            .brackets
            .iter()
            .filter(|bracket| !bracket.value.is_empty())
            .map(|bracket| {
                let [a, b] = bracket.pair;
                let terms: Vec<String> =
                    bracket.value.iter().map(|(c, e)| self.term(g, *e, &basis[*c])).collect();
                let right = if self.html() { self.sum(&terms) } else { terms.join(" + ") };
                (self.bracket(&basis[a], &basis[b]), right)
            })
            .collect();
        if rows.is_empty() {
            self.line("All brackets of the basis vanish.");
        }
        if own.is_almost {
            self.line("Almost algebroid: neither Jacobi nor the anchor condition is claimed. Energy follows from antisymmetry.");
        }
        self.formulas(&rows);
    }

    /// Coefficients of the connections of the kinetic energy.
    pub(super) fn coefficients(&mut self, coefficients: &Coefficients) {
        let g = &coefficients.graph;
        self.begin(SectionKind::Coefficients);
        self.line("Levi-Civita connection of the kinetic energy, nabla_a e_b = Gamma^c_ab e_c:");
        self.coefficient_rows(g, "Gamma", &coefficients.frame, &coefficients.levi_civita);
        if let Some(constrained) = &coefficients.constrained {
            self.line("Constrained connection, the orthogonal projection P nabla_a w_b = Gamma^c_ab w_c along allowed velocities:");
            self.coefficient_rows(g, "Gamma", &constrained.velocities, &constrained.values);
        }
    }

    fn coefficient_rows(&mut self, g: &Graph, stem: &str, names: &[String], values: &[Vec<Vec<ExprId>>]) {
        let mut rows = Vec::new();
        for (c, of_c) in values.iter().enumerate() {
            for (a, row) in of_c.iter().enumerate() {
                for (b, value) in row.iter().enumerate().filter(|(_, value)| **value != g.zero()) {
                    let symbol = self.indexed(stem, &names[c], &[&names[a], &names[b]]);
                    rows.push((symbol, g.display(*value, self.style)));
                }
            }
        }
        if rows.is_empty() {
            self.line("All coefficients vanish.");
        }
        self.readable_formulas(rows);
    }
}
