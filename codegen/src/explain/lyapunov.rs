//! A function that the force of an actuator gives its rate, as text for people.
//!
//! Deliberately does not know: how the force was found.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Style, SymbolId};
use hamel_mechanics::mechanics::{Decrease, Equations, OutputKind};

use super::{Page, SectionKind};

impl Page {
    /// `V`, its rate, `dV_du` and the force.
    pub(super) fn lyapunov(&mut self, equations: &Equations) {
        let system = &equations.system;
        let Some(own) = &system.feedback else { return };
        let definitions = equations.sections.iter().flat_map(|section| &section.definitions);
        let values: BTreeMap<SymbolId, ExprId> = definitions.map(|d| (d.symbol, d.expr)).collect();
        let g = &equations.labelled();
        // A name alone says nothing.
        let spelled = |e: ExprId| {
            let alone = g.free_symbols(e).into_iter().find(|s| g.name(*s) == g.display(e, Style::Plain));
            alone.and_then(|s| values.get(&s)).copied().unwrap_or(e)
        };
        let output = |name: &str| {
            let found = equations.outputs.iter().find(|o| o.kind == OutputKind::OfModel && o.name == name);
            found.and_then(|o| o.components.first()).map(|(_, e)| *e)
        };
        let [Some(value), Some(force)] = [&own.function, &own.actuator].map(|name| output(name)) else {
            return;
        };
        self.begin(SectionKind::Lyapunov);
        let rate = self.name(&format!("dot_{}", own.function));
        let slope = (self.name(g.name(own.response)), spelled(own.slope));
        let rows = [
            Some((self.name(&own.function), value)),
            Some((rate, own.rate)),
            // The name of a definition that nothing else needs says nothing.
            Some(slope).filter(|(name, e)| *name != g.display(*e, self.style)),
            Some((self.name(&own.actuator), spelled(force))),
        ];
        let rows: Vec<(String, String)> =
            rows.into_iter().flatten().map(|(name, e)| (name, g.display(e, self.style))).collect();
        self.formulas(&rows);
        let [function, response, force] =
            [&own.function, g.name(own.response), &own.actuator].map(|name| self.inline(&self.name(name)));
        self.line(&format!("The rate at {force} = 0 lacks {response} {force} of this one: {force} is an exact quotient, proved,"));
        self.line(&format!("and nothing is divided by {response}."));
        self.line(&match equations.facts.decrease {
            Some(Decrease::Conserved) => format!("{function} is conserved."),
            Some(Decrease::Proved) => format!("{function} never increases."),
            Some(Decrease::Unseen) | None => format!("It is not seen that {function} never increases."),
        });
    }
}
