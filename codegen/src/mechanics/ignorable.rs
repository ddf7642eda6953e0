//! Ignorable coordinates: where a result does not depend on a base coordinate, it is computed at the value zero; where it
//! does not depend on an angle that is carried as a point of the circle, at `(1, 0)`.
//!
//! A constraint or a Lagrangian written in a space frame mentions coordinates (the azimuth of a disk, the heading of a
//! robot) on which, by symmetry, the rates do not depend. The dependence is tested, not guessed: a result is replaced by
//! its value there when the two are equal as functions.

use std::collections::BTreeMap;

use crate::expr::{Definition, ExprId, Graph, Section, SymbolId, needed_sections};

use super::derive::Equations;

/// Sets every base coordinate to such a value in the results that do not depend on it, and drops definitions that nothing needs.
pub(super) fn settle(equations: &mut Equations) {
    let (zero, one) = (equations.system.graph.zero(), equations.system.graph.one());
    let circles = equations.system.circles.clone();
    for x in equations.system.algebroid.base().to_vec() {
        let before: Vec<ExprId> = equations.state.iter().map(|s| s.derivative).collect();
        match circles.iter().find(|c| [c.cosine, c.sine].contains(&x)) {
            None => {
                let place = format!("{}=0", equations.system.graph.name(x));
                set_to(equations, BTreeMap::from([(x, zero)]), &place);
            }
            Some(circle) if x == circle.cosine => {
                let place = format!("{}=0", circle.angle);
                set_to(equations, BTreeMap::from([(circle.cosine, one), (circle.sine, zero)]), &place);
            }
            Some(_) => {}
        }
        if !equations.state.iter().map(|s| s.derivative).eq(before) {
            equations.facts.ignorable.push(equations.system.graph.name(x).to_owned());
        }
    }
    let roots: Vec<ExprId> = equations.roots().into_iter().copied().collect();
    equations.sections = needed_sections(&equations.system.graph, &equations.sections, &roots);
}

/// Replaces every root by its value there if that is equal, and keeps the definitions that the roots need then.
fn set_to(equations: &mut Equations, values: BTreeMap<SymbolId, ExprId>, place: &str) {
    let names_one = |g: &Graph, e: ExprId| g.free_symbols(e).iter().any(|symbol| values.contains_key(symbol));
    let definitions = equations.sections.iter().flat_map(|s| &s.definitions).map(|d| d.expr);
    let mut everything = definitions.chain(equations.roots().into_iter().copied());
    if !everything.any(|e| names_one(&equations.system.graph, e)) {
        return;
    }
    // In a copy: where every result depends on the coordinate, nothing of the trial is left over for the next one.
    let mut g = equations.system.graph.clone();
    let mut image = values.clone();
    let mut sections = Vec::new();
    let mut varying = Vec::new();
    let mut taken_at = Vec::new();
    for section in &equations.sections {
        let mut definitions = section.definitions.clone();
        for definition in &section.definitions {
            // A definition without a value there is left alone; what needs it will not come out equal.
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
                    varying.push(symbol);
                }
                let original = g.sym(definition.symbol);
                let before = equations.taken_at.get(&definition.symbol).map(String::as_str);
                let here = (!g.is_seen_to_be_equal(value, original)).then_some(place);
                let places: Vec<&str> = before.into_iter().chain(here).collect();
                if !places.is_empty() {
                    let places = places.join(",");
                    taken_at.push((symbol, places));
                }
                definitions.push(Definition { symbol, expr: value });
                g.sym(symbol)
            };
            image.insert(definition.symbol, replacement);
        }
        sections.push(Section { title: section.title.clone(), definitions });
    }
    let before: Vec<ExprId> = equations.roots().into_iter().copied().collect();
    let after: Vec<ExprId> = before.iter().map(|root| settled(&mut g, *root, &image)).collect();
    if after == before {
        return;
    }
    equations.sections = needed_sections(&g, &sections, &after);
    equations.varying.extend(varying);
    equations.taken_at.extend(taken_at);
    equations.roots_mut().into_iter().zip(after).for_each(|(root, value)| *root = value);
    equations.system.graph = g;
}

fn settled(g: &mut Graph, root: ExprId, image: &BTreeMap<SymbolId, ExprId>) -> ExprId {
    match g.subs(root, image) {
        Ok(value) if g.is_equal(value, root) => g.cancel_zero(value),
        _ => root,
    }
}
