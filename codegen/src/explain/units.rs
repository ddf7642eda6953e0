//! Units of the state, the outputs and the energy, those that doc comments say apart from those that follow.
//!
//! Does not know: how units are read or solved for.

use super::Page;
use crate::scene::BuiltScene;
use hamel_lang::spec::{Model, Unit};

impl Page {
    /// Parameters and inputs have their documentation beside them, so that those are told alone whose unit follows.
    pub(super) fn units(&mut self, model: &Model, scene: &BuiltScene) {
        let (system, units) = (&scene.equations.system, &model.units);
        let mut known: Vec<(String, &Unit)> = Vec::new();
        for name in system.params.iter().chain(&system.inputs).map(|p| &p.name) {
            known
                .extend(units.of(name).filter(|unit| unit.is_inferred()).map(|unit| (self.name(name), unit)));
        }
        let left_out = scene.left_out();
        for state in scene.equations.state.iter().filter(|s| !left_out.contains(&s.symbol)) {
            known.extend(units.of(&state.name).map(|unit| (self.name(&state.name), unit)));
        }
        for output in scene.outputs() {
            let n = output.components.len();
            let of = |k: usize| units.of_output(&output.name, k);
            if (1..n).all(|k| of(k) == of(0)) {
                known.extend(of(0).map(|unit| (self.name(&output.name), unit)));
                continue;
            }
            for (k, (component, _)) in output.components.iter().enumerate() {
                known.extend(of(k).map(|unit| (self.name(component), unit)));
            }
        }
        known.extend(
            units.energy().filter(|_| scene.equations.has_energy()).map(|unit| (self.name("E"), unit)),
        );
        for (is_inferred, title) in [(false, "Units"), (true, "Units that follow from the others")] {
            let mut groups: Vec<(&str, Vec<String>)> = Vec::new();
            for (name, unit) in known.iter().filter(|(_, unit)| unit.is_inferred() == is_inferred) {
                match groups.iter_mut().find(|(text, _)| *text == unit.text()) {
                    Some((_, names)) => names.push(name.clone()),
                    None => groups.push((unit.text(), vec![name.clone()])),
                }
            }
            let group = |(text, names): &(&str, Vec<String>)| {
                format!("{} [{}]", self.inline(&self.list(names)), self.prose(text))
            };
            let groups: Vec<String> = groups.iter().map(group).collect();
            if !groups.is_empty() {
                self.line(&format!("{title}: {}.", groups.join("; ")));
            }
        }
    }
}
