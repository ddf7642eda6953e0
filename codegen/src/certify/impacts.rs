//! Multipliers in functions of events, and what impacts make of velocities, beside their definitions.
//!
//! Does not know: how impulses are solved for, rates.

use std::collections::BTreeMap;

use hamel_runtime::Real;

use hamel_expr::SymbolId;
use hamel_lang::spec::{Event, Impact, Want};
use hamel_mechanics::mechanics::{Output, OutputKind};

use super::definition::Missing;
use super::linear::Reduced;
use super::random::Random;
use super::results::{Open, Outcome, Results};
use super::sheet::Sheet;
use super::tape::{Env, Tape};
use super::wide::Wide;

impl Results<'_, '_> {
    /// Whether a multiplier `lambda_c` is that of a constraint of a mode that is off here.
    pub(super) fn is_off(&self, name: &str) -> bool {
        let model = self.setting.definition.model;
        let own = |c: &&hamel_lang::spec::Constraint| name.strip_prefix("lambda_") == Some(&c.name);
        let mode = model.constraints.iter().find(own).and_then(|c| c.mode);
        let value = mode.and_then(|mode| self.motion.at.env.get(model.modes[mode].symbol));
        value.is_some_and(|s| s.to_f64() == 0.0)
    }

    /// Multipliers by their definition, `E = lambda_A a^A` along every velocity, zero where a mode is off.
    pub(super) fn add_multipliers(&self, env: &mut Env<Wide>) -> Result<(), Missing> {
        let definition = &self.setting.definition;
        let model = definition.model;
        let symbols = model.multipliers.iter().map(|(_, symbol)| *symbol).collect();
        let mut values = model.outputs.iter().flat_map(|o| &o.components).map(|(_, e)| *e);
        if !values.any(|e| model.graph.depends_on(e, &symbols)) {
            return Ok(());
        }
        let group = |o: &&Output| o.kind == OutputKind::Group(Want::Multipliers);
        let Some(known) = self.setting.claim.equations.outputs.iter().find(group) else { return Ok(()) };
        let by_order = !model.virtual_constraints.is_empty();
        let forms: Vec<Vec<Wide>> = (definition.one_forms(&self.motion.at)?.into_iter().enumerate())
            .filter(|(k, (name, _))| match by_order {
                true => *k < known.components.len(),
                false => known.components.iter().any(|(own, _)| *own == format!("lambda_{name}")),
            })
            .map(|(_, (_, form))| form)
            .collect();
        let n = forms.len();
        let mut rows = Vec::new();
        for alpha in 0..definition.m {
            let unit: Vec<Wide> =
                (0..definition.m).map(|k| if k == alpha { Wide::ONE } else { Wide::ZERO }).collect();
            let w = definition.group_velocities(&self.motion.at.env, &unit)?;
            let terms = self.motion.unbalanced(self.setting, &w)?;
            let sum = terms.into_iter().fold(Wide::ZERO, |sum, term| sum + term);
            let row = forms.iter().map(|form| form[alpha]);
            rows.push(row.chain([sum]).collect::<Vec<Wide>>());
        }
        for (k, (name, _)) in known.components.iter().enumerate() {
            if self.is_off(name) {
                let unit = (0..n).map(|j| if j == k { Wide::ONE } else { Wide::ZERO });
                rows.push(unit.chain([Wide::ZERO]).collect());
            }
        }
        let solution = Reduced::new(rows, n).solution(&vec![Wide::ZERO; n]);
        for ((name, _), lambda) in known.components.iter().zip(solution) {
            let own = model.multipliers.iter().find(|(own, _)| name.strip_prefix("lambda_") == Some(own));
            if let Some((_, symbol)) = own {
                env.set(*symbol, lambda);
            }
        }
        Ok(())
    }

    /// What an event sets; of an impact the velocities by momentum and constraints.
    pub(super) fn after(
        &self,
        output: &Output,
        found: &[Wide],
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Outcome {
        let model = self.setting.definition.model;
        let event = model.events.iter().find(|event| Event::after(&event.name) == output.name);
        let Some((event, impact)) = event.and_then(|event| Some((event, event.impact.as_ref()?))) else {
            return self.of_model(output, found, sheet);
        };
        let of_impact = |symbol: &SymbolId| self.setting.velocity_symbols.contains(symbol);
        let set: BTreeMap<SymbolId, Wide> = event.sets.iter().copied().zip(found.iter().copied()).collect();
        let others = event.sets.iter().zip(&output.components).filter(|(symbol, _)| !of_impact(symbol));
        let (values, components): (Vec<Wide>, Vec<_>) =
            others.map(|(symbol, component)| (set[symbol], component.clone())).unzip();
        self.of_model(&Output { components, ..output.clone() }, &values, sheet)?;
        self.impact((&output.name, impact), &set, sheet, random)
    }

    /// `p(y+) = p(y-)` along what the constraints allow that are there at the impact, and `phi(y+) = -e phi(y-)` of
    /// these, with `e` zero where they hold.
    fn impact(
        &self,
        (function, impact): (&str, &Impact),
        set: &BTreeMap<SymbolId, Wide>,
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Outcome {
        let definition = &self.setting.definition;
        let model = definition.model;
        let at = &self.motion.at;
        let mut there = at.env.clone();
        for (symbol, e) in &impact.modes {
            there.set(*symbol, Tape::new(&model.graph, &[*e]).eval(&at.env)?.roots[0]);
        }
        let before = definition.place(there.clone(), at.of_system.clone())?;
        if !definition.modes_agree(&before)? {
            return Ok(());
        }
        let symbols = self.setting.velocity_symbols.iter();
        let after: Vec<Wide> =
            symbols.zip(&at.of_system).map(|(s, y)| set.get(s).copied().unwrap_or(*y)).collect();
        if impact.velocities.len() != after.len() {
            return Err(Open::Because("the system has other velocities than the model"));
        }
        let after = definition.place(there, after)?;
        let [was, is] = [definition.residuals(&before.env)?, definition.residuals(&after.env)?];
        let scale = at.of_model.iter().chain(&after.of_model).map(|y| y.size()).fold(1.0, f64::max);
        for (k, constraint) in model.constraints.iter().enumerate() {
            let mode = constraint.mode.map(|mode| model.modes[mode].symbol);
            let back = impact.restitution.iter().find(|(symbol, _)| Some(*symbol) == mode);
            let e = match back {
                Some((_, e)) => Tape::new(&model.graph, &[*e]).eval(&at.env)?.roots[0],
                None => Wide::ZERO,
            };
            let what = format!("the constraint `{}` after it", constraint.text);
            sheet.vanishes(function, what, is[k] + e * was[k], scale);
        }
        let n = definition.n_displacements();
        let forms = definition.one_forms(&before)?.into_iter();
        let rows = forms.map(|(_, form)| form.into_iter().chain([Wide::ZERO]).collect()).collect();
        let displacement = Reduced::new(rows, n).solution(&random.vector(n));
        let along = definition.group_velocities(&before.env, &displacement[..definition.m])?;
        let [p, q] = [&after, &before].map(|place| definition.lagrangian(place, &along, &Vec::new()));
        sheet.equal(function, "the momentum along what the constraints allow", p?.derivative, q?.derivative);
        Ok(())
    }
}
