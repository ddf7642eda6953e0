//! The cross-section of a group: the identity of coordinates that leave, with coordinates and velocities of the model
//! by the reduced ones.
//!
//! Does not know: how a model is written.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::{ExprId, Rational, SymbolId};
use hamel_lang::spec::Side;
use num_traits::Zero;

use super::angles::TurnedField;
use super::group::SymmetryGroup;
use super::setting::{Generator, Images, Setting};

/// Names and values at the cross-section.
pub(super) struct Section {
    /// Coordinates, velocities and displacements of the model.
    pub(super) at: Images,
    /// Names of the velocities of the group.
    pub(super) names: Vec<String>,
    pub(super) symbols: Vec<SymbolId>,
    /// Base coordinates that stay.
    pub(super) shape: Vec<usize>,
    /// Configurations that stay, with the names of their velocities.
    pub(super) kept: Vec<(usize, Vec<String>)>,
    /// The symbols of all reduced velocities.
    all: Vec<SymbolId>,
    /// `X_a` at the section by the velocities of the model.
    pub(super) tangents: Vec<Vec<ExprId>>,
    /// Displacements of the reduced velocities, in the order of `reduced`.
    pub(super) pairs: Vec<SymbolId>,
    /// Names of all reduced velocities: of the group, of the shape, of configurations that stay.
    pub(super) reduced: Vec<String>,
}

impl Section {
    /// The section of no group, where everything stays.
    pub(super) fn of_all(setting: &mut Setting<'_>) -> Section {
        setting.section(&SymmetryGroup::none(Side::Left))
    }

    /// Symbols of the velocities of the reduced model.
    pub(super) fn velocities(&self) -> &[SymbolId] {
        &self.all
    }
}

impl Setting<'_> {
    /// The cross-section.
    pub(super) fn section(&mut self, group: &SymmetryGroup) -> Section {
        let model = self.model;
        let is_pivot =
            |s: &Setting<'_>, generator| group.fields.iter().any(|f| s.generators[f.pivot] == generator);
        let mut at = Images::new();
        let (zero, one) = (self.graph.zero(), self.graph.one());
        let mut shape = Vec::new();
        for (i, coordinate) in model.base.iter().enumerate() {
            match is_pivot(self, Generator::Translation(i)) || group.value_of(i).is_some() {
                true => _ = at.insert(coordinate.symbol, group.value_of(i).unwrap_or(zero)),
                false => shape.push(i),
            }
        }
        let mut kept = Vec::new();
        for (k, configuration) in model.configurations.iter().enumerate() {
            if group.fields.iter().any(|f| self.configuration_of(f).is_some_and(|(of, _)| of == k)) {
                let n = configuration.group.n();
                let unit = |e: usize| if e < n * n && e / n == e % n { one } else { zero };
                at.extend(configuration.symbols.iter().enumerate().map(|(e, s)| (*s, unit(e))));
            } else {
                kept.push(k);
            }
        }
        if let Some(marked) = &self.marked {
            at.extend(marked.normal.iter().zip(marked.advected).map(|(n, a)| (*n, self.graph.sym(a))));
        }
        let tangents: Vec<Vec<ExprId>> =
            group.fields.iter().map(|field| self.tangent(&field.coefficients, &field.images, &at)).collect();
        let mut taken: BTreeSet<String> = model.places.declared.keys().cloned().collect();
        let (mut names, mut symbols) = (Vec::new(), Vec::new());
        for field in &group.fields {
            let (name, symbol) = match self.generators[field.pivot] {
                Generator::Left(k, a) | Generator::Right(k, a) => {
                    let velocity = &model.velocities[model.configurations[k].velocities[a]];
                    (velocity.name.clone(), velocity.symbol)
                }
                Generator::Translation(i)
                | Generator::Linear(i, _)
                | Generator::Turned(TurnedField { along: i, .. }) => {
                    let mut name = format!("v_{}", model.base[i].name);
                    while !taken.insert(name.clone()) {
                        name.push('_');
                    }
                    let symbol = self.graph.symbol(&name);
                    (name, symbol)
                }
            };
            names.push(name);
            symbols.push(symbol);
        }
        let n_base = model.base.len();
        // Velocities and displacements of the model by the reduced ones.
        let mut reduced = names.clone();
        let mut own: BTreeMap<usize, SymbolId> = BTreeMap::new();
        for i in &shape {
            reduced.push(model.base[*i].velocity_name.clone());
            own.insert(*i, self.velocities[*i]);
        }
        let mut kept_names = Vec::new();
        for k in kept {
            let mut of_group = Vec::new();
            for b in &model.configurations[k].velocities {
                let velocity = &model.velocities[*b];
                own.insert(n_base + b, velocity.symbol);
                reduced.push(velocity.name.clone());
                of_group.push(velocity.name.clone());
            }
            kept_names.push((k, of_group));
        }
        let pairs: Vec<SymbolId> =
            (0..reduced.len()).map(|k| self.graph.symbol(&format!("'pair{k}"))).collect();
        let order: Vec<usize> = own.keys().copied().collect();
        for k in 0..self.velocities.len() {
            let mut along = Vec::new();
            let mut paired = Vec::new();
            for (a, tangent) in tangents.iter().enumerate() {
                let [xi, pair] = [symbols[a], pairs[a]].map(|s| self.graph.sym(s));
                along.push(self.graph.mul(xi, tangent[k]));
                paired.push(self.graph.mul(pair, tangent[k]));
            }
            if let Some(symbol) = own.get(&k) {
                along.push(self.graph.sym(*symbol));
                // `reduced` lists the shape and then configurations, each in ascending order.
                let place = group.fields.len() + order.iter().position(|o| o == &k).unwrap_or_default();
                paired.push(self.graph.sym(pairs[place]));
            }
            let (along, paired) = (self.graph.sum(&along), self.graph.sum(&paired));
            at.insert(self.velocities[k], along);
            at.insert(self.displacements[k], paired);
        }
        let all = [symbols.clone(), own.values().copied().collect()].concat();
        Section { at, names, symbols, shape, kept: kept_names, all, tangents, pairs, reduced }
    }

    /// `X` at the section by the velocities of the model.
    fn tangent(&mut self, coefficients: &[Rational], images: &Images, at: &Images) -> Vec<ExprId> {
        let (model, zero) = (self.model, self.graph.zero());
        let mut tangent = Vec::with_capacity(self.velocities.len());
        for coordinate in &model.base {
            let image = images.get(&coordinate.symbol).copied().unwrap_or(zero);
            tangent.push(self.graph.subs(image, at).unwrap_or(image));
        }
        let mut of_groups = vec![Vec::new(); model.velocities.len()];
        for (generator, q) in
            self.generators.clone().into_iter().zip(coefficients).filter(|(_, q)| !q.is_zero())
        {
            let (Generator::Left(k, a) | Generator::Right(k, a)) = generator else { continue };
            let configuration = &model.configurations[k];
            let is_at_identity = configuration.symbols.iter().all(|s| at.contains_key(s));
            if matches!(generator, Generator::Right(..)) || is_at_identity {
                of_groups[configuration.velocities[a]].push((self.graph.one(), q.clone()));
                continue;
            }
            // An attitude that stays is told in the frame of the one that leaves, by its own angular velocity: the
            // field moves it without one.
        }
        for terms in of_groups {
            tangent.push(self.graph.linear_combination(&terms));
        }
        tangent
    }

    /// A function at the section.
    pub(super) fn at_section(&mut self, section: &Section, e: ExprId) -> ExprId {
        let value = self.graph.subs(e, &section.at).unwrap_or(e);
        self.graph.cancel_zero(value)
    }
}
