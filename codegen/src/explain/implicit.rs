//! The implicit form of a scene, for people.
//!
//! Does not know: how it is made.

use super::{Page, SectionKind};
use crate::scene::BuiltScene;
use hamel_expr::Budget;
use hamel_mechanics::mechanics::implicit_form;

impl Page {
    /// Variables, rows and index, where the scene wants them.
    pub(super) fn implicit(&mut self, scene: &BuiltScene) {
        if scene.implicit().is_none() {
            return;
        }
        let mut g = scene.equations.system.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        let Ok(form) = implicit_form(&mut g, &scene.equations, &scene.state) else { return };
        self.begin(SectionKind::Implicit);
        let names: Vec<String> = form.variables.iter().map(|v| self.name(&v.name)).collect();
        let names = self.inline(&self.list(&names));
        self.line(&format!("{} variables: {names}", form.variables.len()));
        self.line(&format!(
            "The index is {}; that of the equations with all momenta and multipliers is {}.",
            form.index, form.pontryagin_index
        ));
        for section in &form.sections {
            let title = self.prose(&section.title);
            self.line(&title);
            let rows: Vec<(String, String)> = (section.definitions.iter())
                .map(|d| (self.name(g.name(d.symbol)), g.display(d.expr, self.style)))
                .collect();
            self.formulas(&rows);
        }
        for (is_differential, title) in [(true, "differential equations"), (false, "algebraic equations")] {
            let rows = form.variables.iter().filter(|v| v.is_differential == is_differential);
            let rows: Vec<(String, String)> = rows
                .map(|v| {
                    let left = match is_differential {
                        true => self.rate(&self.name(&v.name)),
                        false => g.display(g.zero(), self.style),
                    };
                    (left, g.display(v.right, self.style))
                })
                .collect();
            if !rows.is_empty() {
                self.line(title);
                self.formulas(&rows);
            }
        }
    }
}
