//! Velocities that a model gives and the state has not, since constraints give them: their values at a state.
//!
//! Deliberately does not know: programs, how a start is found.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::{ExprId, Graph, SymbolId, rational_to_f64};
use hamel_lang::spec::{ConstraintKind, Model, circle_names};

/// Pivots below this part of the largest coefficient are rounding.
const ROUNDING: f64 = 1e-10;

/// The linear constraints of a model, at values of its parameters.
#[derive(Clone, Debug)]
pub(super) struct Dependent {
    graph: Graph,
    residuals: Vec<ExprId>,
    velocities: BTreeMap<String, SymbolId>,
    others: BTreeMap<String, SymbolId>,
    /// Angles, which a state may have as points of circles.
    angles: Vec<(String, SymbolId)>,
    known: BTreeMap<SymbolId, f64>,
}

impl Dependent {
    /// None where a model has no such constraints.
    pub(super) fn of(model: &Model, params: &BTreeMap<String, f64>) -> Option<Dependent> {
        let linear =
            model.constraints.iter().filter(|c| c.kind == ConstraintKind::Linear && c.mode.is_none());
        let residuals: Vec<ExprId> = linear.map(|c| c.residual).collect();
        if residuals.is_empty() {
            return None;
        }
        let all = model.all_velocities().into_iter().map(|(name, symbol)| (name.to_owned(), symbol));
        let quasi = model.quasi_velocities.iter().map(|v| (v.name.clone(), v.symbol));
        let angles: Vec<(String, SymbolId)> = model.base.iter().map(|c| (c.name.clone(), c.symbol)).collect();
        let advected = model.advected.iter().flat_map(|a| a.components.iter().cloned());
        let first_order = model.first_order.iter().flat_map(|s| s.components.iter().cloned());
        let values = model.params.iter().filter_map(|p| Some((p.symbol, *params.get(&p.name)?)));
        let held = model.inputs.iter().map(|input| (input.symbol, rational_to_f64(&input.default)));
        Some(Dependent {
            graph: model.graph.clone(),
            residuals,
            velocities: all.chain(quasi).collect(),
            others: angles.iter().cloned().chain(advected).chain(first_order).collect(),
            angles,
            known: values.chain(held).chain([(model.time, 0.0)]).collect(),
        })
    }

    /// Values at time zero of velocities that these names lack, as far as the constraints give them.
    pub(super) fn values(&self, names: &[String], state: &[f64]) -> BTreeMap<String, f64> {
        let mut values = self.known.clone();
        let of = |wanted: &str| names.iter().position(|name| name == wanted).map(|k| state[k]);
        let named = self.others.iter().chain(&self.velocities);
        values.extend(named.filter_map(|(name, symbol)| Some((*symbol, of(name)?))));
        for (name, symbol) in &self.angles {
            let [cosine, sine] = circle_names(name).map(|point| of(&point));
            if let (Some(cosine), Some(sine)) = (cosine, sine) {
                values.insert(*symbol, sine.atan2(cosine));
            }
        }
        let open: Vec<(&String, SymbolId)> =
            self.velocities.iter().map(|(n, s)| (n, *s)).filter(|(_, s)| !values.contains_key(s)).collect();
        values.extend(open.iter().map(|(_, symbol)| (*symbol, 0.0)));
        let mut rows = Vec::new();
        for residual in &self.residuals {
            let at = |values: &BTreeMap<SymbolId, f64>| self.graph.eval_f64(*residual, values);
            let Some(rest) = at(&values).filter(|x| x.is_finite()) else { continue };
            let slope = |symbol: SymbolId| {
                let mut moved = values.clone();
                moved.insert(symbol, 1.0);
                at(&moved).map_or(f64::NAN, |there| there - rest)
            };
            let mut row: Vec<f64> = open.iter().map(|(_, symbol)| slope(*symbol)).collect();
            row.push(-rest);
            if row.iter().all(|x| x.is_finite()) {
                rows.push(row);
            }
        }
        solved(rows, open.len()).into_iter().map(|(k, x)| (open[k].0.clone(), x)).collect()
    }
}

/// Unknowns of `A x = b`, rows `[A | b]`, that the rows determine: by Gauss and Jordan.
fn solved(mut rows: Vec<Vec<f64>>, n: usize) -> Vec<(usize, f64)> {
    let size = rows.iter().flat_map(|row| &row[..n]).fold(0.0_f64, |m, x| m.max(x.abs()));
    let mut pivots = Vec::new();
    for column in 0..n {
        let top = pivots.len();
        let best = (top..rows.len()).max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()));
        let Some(best) = best.filter(|k| rows[*k][column].abs() > ROUNDING * size) else { continue };
        rows.swap(top, best);
        let pivot = rows[top].clone();
        for (_, row) in rows.iter_mut().enumerate().filter(|(r, _)| *r != top) {
            let factor = row[column] / pivot[column];
            row.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
        }
        pivots.push(column);
    }
    let own: BTreeSet<usize> = pivots.iter().copied().collect();
    let is_alone = |row: &[f64]| (0..n).all(|k| own.contains(&k) || row[k].abs() <= ROUNDING * size);
    let found = pivots.iter().zip(&rows).filter(|(_, row)| is_alone(row));
    found.map(|(column, row)| (*column, row[n] / row[*column])).collect()
}
