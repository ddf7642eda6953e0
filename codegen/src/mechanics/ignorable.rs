//! Ignorable coordinates: where a result does not depend on a base coordinate, it is computed at the value zero.
//!
//! A constraint or a Lagrangian written in a space frame mentions coordinates (the azimuth of a disk, the heading of a
//! robot) on which, by symmetry, the rates do not depend. The dependence is tested, not guessed: a result is replaced by
//! its value at zero when the two are equal as functions.

use std::collections::BTreeMap;

use crate::expr::{Definition, ExprId, Graph, Section, SymbolId, needed_sections};

use super::derive::Equations;

/// Sets every base coordinate to zero in the results that do not depend on it, and drops definitions that nothing needs.
pub(super) fn settle(equations: &mut Equations) {
    for x in equations.system.algebroid.base().to_vec() {
        set_to_zero(equations, x);
    }
    let roots: Vec<ExprId> = equations.roots().into_iter().copied().collect();
    equations.sections = needed_sections(&equations.system.graph, &equations.sections, &roots);
}

fn set_to_zero(equations: &mut Equations, x: SymbolId) {
    let mut g = std::mem::take(&mut equations.system.graph);
    let zero = g.zero();
    let mut image: BTreeMap<SymbolId, ExprId> = BTreeMap::from([(x, zero)]);
    let mut sections = Vec::new();
    for section in &equations.sections {
        let mut definitions = section.definitions.clone();
        for definition in &section.definitions {
            // A definition without a value at zero is left alone; what needs it will not come out equal.
            let Ok(value) = g.subs(definition.expr, &image) else { continue };
            if value == definition.expr {
                continue;
            }
            let value = g.cancel_zero(value);
            let replacement = if g.is_trivial(value) {
                value
            } else {
                let name = g.name(definition.symbol).to_owned();
                let symbol = g.define(&name, value);
                if equations.varying.contains(&definition.symbol) {
                    equations.varying.insert(symbol);
                }
                definitions.push(Definition { symbol, expr: value });
                g.sym(symbol)
            };
            image.insert(definition.symbol, replacement);
        }
        sections.push(Section { title: section.title.clone(), definitions });
    }
    if image.len() > 1 || equations.roots().iter().any(|e| g.free_symbols(**e).contains(&x)) {
        equations.sections = sections;
        for root in equations.roots_mut() {
            *root = settled(&mut g, *root, &image);
        }
    }
    equations.system.graph = g;
}

fn settled(g: &mut Graph, root: ExprId, image: &BTreeMap<SymbolId, ExprId>) -> ExprId {
    match g.subs(root, image) {
        Ok(value) if g.is_equal(value, root) => g.cancel_zero(value),
        _ => root,
    }
}
