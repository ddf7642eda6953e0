//! A question about equilibria, and what its names mean.
//!
//! Does not know: how it is answered.

use std::collections::BTreeMap;

use super::field::Variable;
use super::search::Quantity;
use crate::error::{Error, Problem};
use crate::forms::Forms;
use crate::info::{Info, ParamEntry};

/// A question.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// Parameters that differ from the scene's.
    pub set: BTreeMap<String, f64>,
    /// Components of the guess, in any form of the state.
    pub at: BTreeMap<String, f64>,
    /// Inputs that differ from the values that the model holds them at.
    pub hold: BTreeMap<String, f64>,
    /// What keeps its value of the guess, or another one: components of the state, invariants, outputs.
    pub keep: Vec<(String, Option<f64>)>,
    /// Inputs and parameters that are solved for.
    pub free: Vec<String>,
    /// Whether nothing drifts.
    pub at_rest: bool,
    /// The time that equations with time in them are frozen at.
    pub t: Option<f64>,
    /// What a family goes along.
    pub along: Option<Along>,
    /// About how long an orbit takes: then a relative periodic orbit is sought.
    pub period: Option<f64>,
    /// What messages put before the name of an option: `--` on the command line.
    pub dashes: &'static str,
}

/// The way of a family.
#[derive(Clone, Debug)]
pub struct Along {
    /// A parameter, an input, a component of the state, an invariant, or an output.
    pub name: String,
    /// The first value.
    pub from: f64,
    /// The last value.
    pub to: f64,
    /// Number of points at equal distances where the family does not turn back.
    pub n_points: usize,
}

/// What names may mean.
pub(super) struct Names<'a> {
    pub(super) info: &'a Info,
    pub(super) invariants: Vec<String>,
}

impl Names<'_> {
    pub(super) fn outputs(&self) -> impl Iterator<Item = &String> {
        self.info.outputs.iter().flat_map(|group| &group.components)
    }

    pub(super) fn variable(&self, name: &str) -> Option<Variable> {
        let input = self.info.inputs.iter().position(|input| input.name == name).map(Variable::Input);
        let param = || self.info.params.iter().position(|p| p.name == name).map(Variable::Param);
        input.or_else(param)
    }

    pub(super) fn quantity(&self, name: &str) -> Option<Quantity> {
        let state = self.info.state.iter().position(|own| own == name);
        let state = state.map(|k| Quantity::Variable(Variable::State(k)));
        let other = || self.variable(name).map(Quantity::Variable);
        let invariant = || self.invariants.iter().position(|own| own == name).map(Quantity::Invariant);
        let output = || self.outputs().position(|own| own == name).map(Quantity::Output);
        state.or_else(other).or_else(invariant).or_else(output)
    }

    /// All names that something can be kept at.
    fn kept(&self) -> Vec<String> {
        self.info.state.iter().chain(&self.invariants).chain(self.outputs()).cloned().collect()
    }

    /// Inputs and parameters.
    fn variables(&self) -> Vec<String> {
        self.info.inputs.iter().chain(&self.info.params).map(|entry| entry.name.clone()).collect()
    }

    pub(super) fn check(&self, asked: &Asked, forms: &Forms) -> Result<(), Error> {
        let mut problems = Vec::new();
        let unknown = |path: &str, name: &String, kind: &'static str, known: Vec<String>| {
            Problem::UnknownName { path: path.into(), name: name.clone(), kind, known }
        };
        let own = |names: &[ParamEntry]| names.iter().map(|entry| entry.name.clone()).collect();
        let of_state: Vec<String> = forms.known().into_iter().map(str::to_owned).collect();
        let given = [
            (&asked.set, "set", "parameter", own(&self.info.params)),
            (&asked.hold, "hold", "input", own(&self.info.inputs)),
            (&asked.at, "at", "state", of_state),
        ];
        for (list, path, kind, known) in given {
            let wrong = list.keys().filter(|name| !known.contains(name));
            problems.extend(wrong.map(|name| unknown(path, name, kind, known.clone())));
        }
        for (name, _) in &asked.keep {
            if self.quantity(name).is_none() || self.variable(name).is_some() {
                problems.push(unknown("keep", name, "value", self.kept()));
            }
        }
        for name in &asked.free {
            if self.variable(name).is_none() {
                problems.push(unknown("free", name, "input or parameter", self.variables()));
            }
        }
        if let Some(along) = &asked.along {
            let known = || self.variables().into_iter().chain(self.kept()).collect();
            if self.quantity(&along.name).is_none() {
                problems.push(unknown("along", &along.name, "value", known()));
            }
            let is_said_twice = asked.free.contains(&along.name)
                || asked.keep.iter().any(|(name, _)| *name == along.name)
                || [&asked.set, &asked.hold].iter().any(|list| list.contains_key(&along.name));
            if is_said_twice {
                let reason = format!("goes along {}, which is given or set free besides", along.name);
                problems.push(Problem::Unusable { path: format!("{}along", asked.dashes), reason });
            }
        }
        if problems.is_empty() { Ok(()) } else { Err(Error::Request { problems }) }
    }
}
