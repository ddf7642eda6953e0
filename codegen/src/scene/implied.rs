//! Whether a start keeps the equations that were left out because they follow from others: a linkage can have a second
//! way to be assembled, where they would not.
//!
//! Deliberately does not know: programs, how a start is found.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::spec::Model;

/// How far from an equation a start may be, in units of its coordinates: far more than Newton's method leaves, and far
/// less than the distance to another way of assembly.
const REACH: f64 = 1e-6;

/// Step of central differences.
const STEP: f64 = 1e-6;

/// The equations that a model leaves out, at values of its parameters.
#[derive(Clone, Debug)]
pub(super) struct Implied {
    graph: Graph,
    /// As written, with the residual.
    equations: Vec<(String, ExprId)>,
    /// Base coordinates, and entries of configurations.
    coordinates: Vec<(String, SymbolId)>,
    others: BTreeMap<SymbolId, f64>,
}

fn positions(model: &Model) -> impl Iterator<Item = (String, SymbolId)> {
    let base = model.base.iter().map(|c| (c.name.clone(), c.symbol));
    base.chain(
        model.configurations.iter().flat_map(|c| c.names.iter().cloned().zip(c.symbols.iter().copied())),
    )
}

impl Implied {
    /// None where a model leaves out nothing.
    pub(super) fn of(model: &Model, params: &BTreeMap<String, f64>) -> Option<Implied> {
        if model.implied.is_empty() {
            return None;
        }
        let values = model.params.iter().filter_map(|p| Some((p.symbol, *params.get(&p.name)?)));
        Some(Implied {
            graph: model.graph.clone(),
            equations: model.implied.iter().map(|e| (e.text.clone(), e.residual)).collect(),
            coordinates: positions(model).collect(),
            others: values.chain([(model.time, 0.0)]).collect(),
        })
    }

    /// Why a state at time zero is no start. Nothing where all equations hold, or the names lack a coordinate of them.
    pub(super) fn refusal(&self, names: &[String], state: &[f64]) -> Option<String> {
        let mut values = self.others.clone();
        let given = names.iter().zip(state);
        let found = given.filter_map(|(name, x)| {
            let (_, symbol) = self.coordinates.iter().find(|(own, _)| own == name)?;
            Some((*symbol, *x))
        });
        values.extend(found);
        self.equations.iter().find_map(|(text, residual)| {
            let at = |values: &BTreeMap<SymbolId, f64>| self.graph.eval_f64(*residual, values);
            let here = at(&values)?;
            let slope = |symbol: &SymbolId| {
                let x = *values.get(symbol)?;
                let mut moved = values.clone();
                let mut by = |d: f64| {
                    moved.insert(*symbol, x + d);
                    at(&moved)
                };
                Some((by(STEP)? - by(-STEP)?) / (2.0 * STEP))
            };
            let slopes = self.coordinates.iter().filter_map(|(_, symbol)| slope(symbol));
            let length = slopes.map(|d| d * d).sum::<f64>().sqrt();
            (here.abs() > REACH * length.max(f64::MIN_POSITIVE)).then(|| {
                format!(
                    "`{text}` was left out, as it follows from the other equations next to the initial coordinates of \
                     the model, and does not hold at this start, {here:.3e}: it belongs to another way of assembly; \
                     give `initial` values next to the start"
                )
            })
        })
    }
}
