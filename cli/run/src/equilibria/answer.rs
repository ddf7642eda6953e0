//! An answer as JSON and as a table.
//!
//! Does not know: how anything was found.

use serde_json::{Map, Value};

use super::{Answer, Equilibrium, Verdict};
use crate::info::ParamEntry;
use crate::request::json::{by_name, number};

impl Answer {
    /// Everything by name.
    pub fn to_json(&self) -> Value {
        let mut all = Map::new();
        all.insert("model".into(), self.info.model.clone().into());
        all.insert("scene".into(), self.info.scene.clone().into());
        all.insert("symmetries".into(), self.symmetries.clone().into());
        if let Some(told) = hamel_codegen::scene::told_in_words(&self.told) {
            all.insert("start".into(), told.into());
        }
        all.insert("equilibria".into(), self.equilibria.iter().map(|e| self.one(e)).collect());
        let Some(end) = self.end else { return all.into() };
        let changes = self.changes.iter().map(|(behind, change, at)| {
            let mut found = Map::new();
            found.insert("behind".into(), (*behind).into());
            found.insert("change".into(), change.name().into());
            found.insert("at".into(), self.one(at));
            Value::from(found)
        });
        all.insert("changes".into(), changes.collect());
        all.insert("end".into(), end.name().into());
        all.into()
    }

    fn one(&self, of: &Equilibrium) -> Value {
        let entries = |entries: &[ParamEntry], values: &[f64]| {
            by_name(entries.iter().map(|entry| entry.name.as_str()), values)
        };
        let mut one = Map::new();
        if let Some(along) = of.along {
            one.insert("along".into(), number(along));
        }
        if let Some(period) = of.period {
            one.insert("period".into(), number(period));
        }
        one.insert("params".into(), entries(&self.info.params, &of.params));
        one.insert("inputs".into(), entries(&self.info.inputs, &of.inputs));
        one.insert("state".into(), by_name(self.info.state_names(), &of.state));
        one.insert("drifts".into(), of.drifts.iter().copied().map(number).collect());
        one.insert("residual".into(), number(of.residual));
        let stability = &of.stability;
        one.insert("verdict".into(), stability.verdict.name().into());
        if let Verdict::Unstable { rate } | Verdict::Asymptotic { rate } = stability.verdict {
            one.insert("rate".into(), number(rate));
        }
        let eigenvalues = stability.eigenvalues.iter().map(|z| z.map(number).into_iter().collect::<Value>());
        one.insert("eigenvalues".into(), eigenvalues.collect());
        if of.period.is_some() {
            let multipliers =
                stability.multipliers.iter().map(|z| z.map(number).into_iter().collect::<Value>());
            one.insert("multipliers".into(), multipliers.collect());
        }
        let counts = [
            ("invariants", stability.n_invariants),
            ("symmetries", stability.n_symmetries),
            ("neutral", stability.n_neutral),
        ];
        let counts = counts.map(|(name, n)| (name.to_owned(), Value::from(n)));
        one.insert("taken_out".into(), counts.into_iter().collect());
        if let Some(energy) = stability.energy {
            let signs =
                [("positive", energy.n_positive), ("negative", energy.n_negative), ("zero", energy.n_zero)];
            let signs = signs.map(|(name, n)| (name.to_owned(), Value::from(n)));
            one.insert("energy".into(), signs.into_iter().collect());
        }
        one.into()
    }

    /// A family as a table: names of the columns, and a row for each equilibrium or orbit. `name` is what it goes
    /// along.
    pub fn table(&self, name: &str) -> (Vec<String>, Vec<Vec<f64>>) {
        let drifts = (1..=self.symmetries.len()).map(|k| format!("drift_{k}"));
        let own = |state: &&String| *state != name;
        let mut names = vec![name.to_owned()];
        names.extend(self.info.state.iter().filter(own).cloned());
        let drifts: Vec<String> = match self.equilibria.first() {
            Some(first) => drifts.take(first.drifts.len()).collect(),
            None => Vec::new(),
        };
        names.extend(drifts);
        let has_period = self.equilibria.first().is_some_and(|first| first.period.is_some());
        names.extend(has_period.then(|| "period".to_owned()));
        names.push("largest_real_part".to_owned());
        let row = |of: &Equilibrium| {
            let state =
                self.info.state.iter().zip(&of.state).filter(|(state, _)| own(state)).map(|(_, x)| *x);
            let first = of.along.unwrap_or(f64::NAN);
            let growth = of.stability.eigenvalues.first().map_or(0.0, |z| z[0]);
            [first]
                .into_iter()
                .chain(state)
                .chain(of.drifts.iter().copied())
                .chain(of.period)
                .chain([growth])
                .collect()
        };
        (names, self.equilibria.iter().map(row).collect())
    }
}
