//! Ignorable coordinates: where a result does not depend on a base coordinate, it is computed at the value zero; where
//! it does not depend on an angle that is carried as a point of the circle, at `(1, 0)`.
//!
//! A constraint or a Lagrangian written in a space frame mentions coordinates (the azimuth of a disk, the heading of a
//! robot) on which, by symmetry, the rates do not depend. The dependence is tested, not guessed: a result is replaced
//! by its value there when the two are equal as functions. A coordinate that other rates need stays in all of them
//! where the value there shares fewer operations: accelerations of a floating base depend on the vertical by one
//! component each, and come out of one substitution.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::{Definition, ExprId, Graph, RealValues, Section, SymbolId, needed_sections};

use super::equations::Equations;
use super::written::n_operations;

/// Sets every base coordinate to such a value in the results that do not depend on it, and drops definitions that
/// nothing needs.
pub(super) fn evaluate_at_origin(equations: &mut Equations) {
    let (zero, one) = (equations.system.graph.zero(), equations.system.graph.one());
    let circles = equations.system.circles.clone();
    let mut mentions = Mentions::of(equations);
    for x in equations.system.algebroid.base().to_vec() {
        let before: Vec<ExprId> = equations.state.iter().map(|s| s.derivative).collect();
        let is_changed = match circles.iter().find(|c| [c.cosine, c.sine].contains(&x)) {
            None => {
                let place = format!("{}=0", equations.system.graph.name(x));
                set_to(equations, &mentions, BTreeMap::from([(x, zero)]), &place)
            }
            Some(circle) if x == circle.cosine => {
                let place = format!("{}=0", circle.angle);
                let values = BTreeMap::from([(circle.cosine, one), (circle.sine, zero)]);
                set_to(equations, &mentions, values, &place)
            }
            Some(_) => false,
        };
        if is_changed {
            mentions = Mentions::of(equations);
        }
        let is_moved = !equations.state.iter().map(|s| s.derivative).eq(before);
        if is_moved && !moves(&equations.system.graph, &equations.sections, &rates(equations), &[x]) {
            equations.facts.taken_at_origin.push(equations.system.graph.name(x).to_owned());
        }
    }
    let roots: Vec<ExprId> = equations.results();
    equations.sections = needed_sections(&equations.system.graph, &equations.sections, &roots);
}

fn rates(equations: &Equations) -> Vec<ExprId> {
    equations.state.iter().map(|s| s.derivative).collect()
}

/// Rates of the velocities in the state.
fn accelerations(equations: &Equations) -> impl Iterator<Item = ExprId> {
    let unknowns: BTreeSet<SymbolId> = equations.system.unknowns.iter().map(|u| u.symbol).collect();
    equations.state.iter().filter(move |s| unknowns.contains(&s.symbol)).map(|s| s.derivative)
}

/// Whether an expression mentions some coordinates, also by definitions.
fn moves(g: &Graph, sections: &[Section], roots: &[ExprId], coordinates: &[SymbolId]) -> bool {
    let mut concerned: BTreeSet<SymbolId> = coordinates.iter().copied().collect();
    for definition in sections.iter().flat_map(|s| &s.definitions) {
        if g.depends_on(definition.expr, &concerned) {
            concerned.insert(definition.symbol);
        }
    }
    roots.iter().any(|e| g.depends_on(*e, &concerned))
}

/// The symbols in every definition, in order, and in every root.
struct Mentions {
    definitions: Vec<BTreeSet<SymbolId>>,
    roots: Vec<BTreeSet<SymbolId>>,
    values: RealValues,
}

impl Mentions {
    fn of(equations: &mut Equations) -> Mentions {
        let results = equations.results();
        let values = RealValues::new(&mut equations.system.graph, &results);
        let g = &equations.system.graph;
        let definitions = equations.sections.iter().flat_map(|s| &s.definitions);
        Mentions {
            definitions: definitions.map(|d| g.free_symbols(d.expr)).collect(),
            roots: results.into_iter().map(|e| g.free_symbols(e)).collect(),
            values,
        }
    }
}

/// Replaces every root by its value there if that is equal, and keeps the definitions that the roots need then; whether
/// any was replaced. None is where some rate needs the coordinate all the same, and the rates take more operations.
fn set_to(
    equations: &mut Equations,
    mentions: &Mentions,
    values: BTreeMap<SymbolId, ExprId>,
    place: &str,
) -> bool {
    let coordinates: Vec<SymbolId> = values.keys().copied().collect();
    let mut concerned: BTreeSet<SymbolId> = coordinates.iter().copied().collect();
    let definitions = equations.sections.iter().flat_map(|s| &s.definitions);
    for (definition, symbols) in definitions.zip(&mentions.definitions) {
        if !symbols.is_disjoint(&concerned) {
            concerned.insert(definition.symbol);
        }
    }
    let is_concerned = |symbols: &BTreeSet<SymbolId>| !symbols.is_disjoint(&concerned);
    let before: Vec<ExprId> = equations.results();
    let roots: Vec<ExprId> = before
        .iter()
        .zip(&mentions.roots)
        .filter(|(_, symbols)| is_concerned(symbols))
        .map(|(e, _)| *e)
        .collect();
    if roots.is_empty() {
        return false;
    }
    let changing = mentions.values.seen_to_change(&mut equations.system.graph, &roots, &values);
    let stays = match equations.is_whole() {
        true => roots.iter().all(|e| changing.contains(e)),
        // What linked bodies share is there for all of them: a coordinate that one acceleration needs stays in all.
        false => accelerations(equations).any(|e| changing.contains(&e)),
    };
    if stays {
        return false;
    }
    // In a copy: where every result depends on the coordinate, nothing of the trial is left over for the next one.
    let mut g = equations.system.graph.clone();
    g.charge(g.n_nodes() / 4);
    let mut image = values;
    let mut sections = Vec::new();
    let mut varying = Vec::new();
    let mut taken_at = Vec::new();
    for section in &equations.sections {
        let mut definitions = section.definitions.clone();
        for definition in section.definitions.iter().filter(|d| concerned.contains(&d.symbol)) {
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
                let here = (!g.fingerprints_agree(value, original)).then_some(place);
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
    let after: Vec<ExprId> = (before.iter().zip(&mentions.roots))
        .map(|(root, symbols)| match is_concerned(symbols) {
            true => at_origin(&mut g, *root, &image),
            false => g.cancel_zero(*root),
        })
        .collect();
    if after == before || g.within_budget().is_err() {
        // Past the budget, too, the graph says so.
        equations.system.graph.take_over(&g);
        return false;
    }
    let mut all_varying = equations.varying.clone();
    all_varying.extend(varying);
    // The rates are the first results.
    let n = equations.state.len();
    let needed = needed_sections(&g, &sections, &after);
    if moves(&g, &needed, &after[..n], &coordinates)
        && n_operations(&g, &needed, &all_varying, &after[..n]) > equations.n_operations()
    {
        equations.system.graph.take_over(&g);
        return false;
    }
    equations.sections = needed;
    equations.varying = all_varying;
    equations.taken_at.extend(taken_at);
    equations.results_mut().into_iter().zip(after).for_each(|(root, value)| *root = value);
    equations.system.graph = g;
    true
}

fn at_origin(g: &mut Graph, root: ExprId, image: &BTreeMap<SymbolId, ExprId>) -> ExprId {
    match g.subs(root, image) {
        Ok(value) if g.is_equal(value, root) => g.cancel_zero(value),
        _ => root,
    }
}
