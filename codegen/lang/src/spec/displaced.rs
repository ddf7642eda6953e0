//! Coordinates and elements of groups of rotations, moved by numbers.
//!
//! A direction is a base coordinate or a velocity of the algebra `xi`, along which an element `g` goes to `g exp(xi)`
//! (left), the value of `a' = -xi . a` at one: a series, as actions on elements are affine.
//!
//! Deliberately does not know: equations, constraints.

use std::collections::BTreeMap;

use super::model::{Model, Side};
use hamel_expr::{ExprId, Graph, SymbolId};

/// Terms of the exponential series: of steps below one, less than 1e-17 is left.
const N_TERMS: u32 = 18;

/// What of a model's positions moves in known directions.
pub(super) struct Displaced<'a> {
    graph: &'a Graph,
    n_base: usize,
    /// Elements of groups by entries, behind the coordinates.
    entries: Vec<SymbolId>,
    /// Rates of the entries by `xi`.
    rates: Vec<ExprId>,
    /// Whether `xi` moves by the negative of these, as a left action does.
    is_negative: bool,
    velocities: Vec<SymbolId>,
}

impl<'a> Displaced<'a> {
    /// Base coordinates, and the model's configurations in groups of rotations where `with_groups`.
    pub(super) fn new(model: &'a Model, with_groups: bool) -> Displaced<'a> {
        let groups = model.configurations.iter().filter(|c| with_groups && c.group.is_of_rotations());
        let of_action = |of: usize| {
            let advected = &model.advected[of];
            advected.components.iter().map(|(_, s)| *s).zip(advected.action.iter().copied())
        };
        let (entries, rates): (Vec<SymbolId>, Vec<ExprId>) =
            groups.flat_map(|c| of_action(c.advected)).unzip();
        let velocities = match (&model.frame, entries.is_empty()) {
            (_, true) => Vec::new(),
            (Some(frame), _) => frame.original.iter().skip(model.n_shape()).map(|(_, s)| *s).collect(),
            (None, _) => model.velocities.iter().map(|v| v.symbol).collect(),
        };
        let is_negative = model.action == Side::Left;
        Displaced { graph: &model.graph, n_base: model.base.len(), entries, rates, is_negative, velocities }
    }

    /// How many base coordinates there are, each of them a direction.
    pub(super) fn n_base(&self) -> usize {
        self.n_base
    }

    /// How many directions there are, base coordinates first.
    pub(super) fn n_directions(&self) -> usize {
        self.n_base + self.velocities.len()
    }

    /// The entries of elements, behind the base coordinates.
    pub(super) fn entries(&self) -> &[SymbolId] {
        &self.entries
    }

    /// Positions moved by the same part of each direction; `others` are values of what else is in the rates.
    pub(super) fn moved(&self, x: &[f64], by: &[f64], others: &BTreeMap<SymbolId, f64>) -> Option<Vec<f64>> {
        let (base, xi) = by.split_at(self.n_base);
        let mut moved: Vec<f64> = x.iter().zip(base).map(|(x, d)| x + d).collect();
        let element = &x[self.n_base..];
        if xi.iter().all(|part| *part == 0.0) {
            moved.extend(element);
            return Some(moved);
        }
        let mut known = others.clone();
        let sign = if self.is_negative { -1.0 } else { 1.0 };
        known.extend(self.velocities.iter().copied().zip(xi.iter().map(|part| sign * part)));
        let mut rates_at = |element: &[f64]| -> Option<Vec<f64>> {
            known.extend(self.entries.iter().copied().zip(element.iter().copied()));
            let values = self.graph.eval_known(&self.rates, &known);
            self.rates.iter().map(|e| values.get(e).copied()).collect()
        };
        // `u` of `r' = hat(xi) r + u` is in the first term alone.
        let constant = rates_at(&vec![0.0; element.len()])?;
        let (mut sum, mut term) = (element.to_vec(), element.to_vec());
        for k in 1..=N_TERMS {
            let rates = rates_at(&term)?;
            if k == 1 {
                term = rates;
            } else {
                term = rates.iter().zip(&constant).map(|(rate, c)| (rate - c) / f64::from(k)).collect();
            }
            sum.iter_mut().zip(&term).for_each(|(x, d)| *x += d);
        }
        moved.extend(sum);
        Some(moved)
    }
}
