//! The exact flows of a scene, for people.
//!
//! Does not know: how they are found.

use super::{Page, SectionKind};
use crate::scene::BuiltScene;
use hamel_expr::Budget;
use hamel_mechanics::mechanics::Splitting;

impl Page {
    /// The pieces of the motion, where the scene wants its flows.
    pub(super) fn splitting(&mut self, scene: &BuiltScene) {
        if scene.flows().is_empty() {
            return;
        }
        let mut g = scene.equations.system.graph.clone();
        g.set_budget(Budget::UNLIMITED);
        let Ok(splitting) = Splitting::new(&mut g, &scene.equations) else { return };
        self.begin(SectionKind::Splitting);
        self.line(&format!(
            "The motion is the sum of {} with flows in closed form, each that of a function h of linear forms a which \
             commute; proved.",
            splitting.flows.len()
        ));
        for (k, flow) in splitting.flows.iter().enumerate() {
            self.line(&format!("flow {}, dh/da by the form:", k + 1));
            let rows = flow.forms.iter();
            let rows = rows.map(|(form, rate)| {
                let form = g.display(*form, self.style);
                (self.parenthesised(&form), g.display(*rate, self.style))
            });
            let rows: Vec<(String, String)> = rows.collect();
            self.readable_formulas(rows);
        }
        if !splitting.casimirs.is_empty() {
            self.line("Left out of the energy, because Casimirs move nothing, is this multiple of:");
            let rows = splitting.casimirs.iter();
            let rows = rows.map(|(name, factor)| (self.name(name), g.display(*factor, self.style)));
            let rows: Vec<(String, String)> = rows.collect();
            self.readable_formulas(rows);
        }
    }

    /// A derivative by a form, on the left of its value.
    fn parenthesised(&self, form: &str) -> String {
        match self.html() {
            true => format!("<mrow>{form}</mrow>"),
            false => form.to_owned(),
        }
    }
}
