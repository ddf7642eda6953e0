//! Holds a model with its parts to the models of their files.
//!
//! The text with the parts is read without the items that the model itself adds, and its Lagrangian has to be the sum
//! of the Lagrangians of the parts, each as its own file makes it, with the variables of the whole in the place of its
//! own. Every constraint, force, rate, event and output of a part has to be there as well, and the algebra has to be
//! the product of the algebras of the parts. This looks at values alone, not at texts: a name of a part that stood for
//! something else in the whole would make another value.
//!
//! Deliberately does not know: how the text with the parts came about.

use std::collections::{BTreeMap, BTreeSet};
use std::mem::discriminant;

use super::super::ast::{File, ItemKind, Name};
use super::super::diagnostic::Origin;
use super::super::elaborate::elaborate;
use super::super::event::Event;
use super::super::expressions::ExpressionRole;
use super::super::images::with_items;
use super::super::mode::after_impact;
use super::super::model::Model;
use super::super::parser;
use super::taken::{Part, blanked};
use hamel_expr::{Budget, ExprId, Graph, SymbolId};

/// What begins the names of outputs that are added.
const GIVEN: &str = "given_to_";

/// Holds a text, in which nothing drives inputs of parts, to the models of these; `host` is the text without them.
///
/// # Errors
/// The part that is not there as its file has it, and what of it.
pub(super) fn hold(whole: &Origin, host: &File, parts: &[Part]) -> Result<(), (Name, String)> {
    let own = host.items.iter().filter(|item| adds(&item.kind));
    let own: Vec<_> = own.map(|item| item.span).collect();
    let mut outputs = String::new();
    for part in parts {
        for name in &part.bound {
            let value = part.renamed(name);
            outputs.push_str(&format!("\noutput {GIVEN}{value} = {value};"));
        }
    }
    let text = with_items(&blanked(&whole.text, &own), &outputs);
    let origin = Origin { file: whole.file.clone(), text };
    let outcome = parser::Outcome { is_part: true, ..parser::parse_file(&origin.text) };
    let Ok(mut model) = elaborate(outcome, origin, Budget::default()) else {
        // Whoever reads the whole is told its problems.
        let is_model = elaborate(parser::parse_file(&whole.text), whole.clone(), Budget::default()).is_ok();
        return match parts.first().filter(|_| is_model) {
            Some(part) => Err((part.name.clone(), "without the items around it it is no model".into())),
            None => Ok(()),
        };
    };
    let symbols = symbols_of(&model);
    let mut sum = Vec::new();
    for part in parts {
        let told = |what: String| (part.name.clone(), what);
        let replaced = replacement(&model, part, &symbols).map_err(told)?;
        let roots = expressions(&part.model);
        let values: Vec<ExprId> = roots.iter().map(|(_, e)| *e).collect();
        let here = model.graph.import_with(&part.model.graph, &values, &replaced);
        let here = here.map_err(|_| told("a denominator vanishes with the given values".into()))?;
        let all = model.expressions();
        for ((role, _), value) in roots.iter().zip(here) {
            match role {
                ExpressionRole::Lagrangian => sum.push(value),
                role => {
                    let place = place_of(&part.model, *role).map(|name| part.renamed(&name));
                    let same = all.iter().filter(|(other, _)| {
                        discriminant(other) == discriminant(role) && place_of(&model, *other) == place
                    });
                    let candidates: Vec<ExprId> = same.map(|(_, e)| *e).collect();
                    let is_there = candidates.contains(&value)
                        || candidates.iter().any(|e| model.graph.is_equal(*e, value));
                    if !is_there {
                        return Err(told(format!("{role:?} is not there")));
                    }
                }
            }
        }
        check_algebra(&model, part).map_err(told)?;
        check_events(&model, part).map_err(told)?;
    }
    let known = model.lagrangian;
    if !is_sum(&mut model.graph, known, &sum) {
        let place = parts.first().map(|part| part.name.clone());
        return match place {
            Some(name) => Err((name, "the Lagrangian is another one than the sum over the parts".into())),
            None => Ok(()),
        };
    }
    Ok(())
}

fn is_sum(g: &mut Graph, whole: ExprId, terms: &[ExprId]) -> bool {
    let sum = g.sum(terms);
    g.is_equal(whole, sum)
}

/// The expressions of a part that the whole has to have. Claims, sections and stages stay with the part; initial values
/// may be given anew.
fn expressions(part: &Model) -> Vec<(ExpressionRole, ExprId)> {
    use ExpressionRole::{Casimir, Ideal, Initial, InnerProduct, Section, StageConnection};
    let mut all = part.expressions();
    all.retain(|(role, _)| {
        !matches!(role, Casimir(_) | Section(_) | Initial(_) | Ideal | InnerProduct | StageConnection)
    });
    all
}

/// Whether an item of the model itself adds to the motion, or speaks of it. The other items declare names.
fn adds(kind: &ItemKind) -> bool {
    matches!(
        kind,
        ItemKind::Lagrangian(_)
            | ItemKind::Actuate { .. }
            | ItemKind::Lyapunov { .. }
            | ItemKind::Force { .. }
            | ItemKind::AppliedForce { .. }
            | ItemKind::Constraint { .. }
            | ItemKind::Virtual { .. }
            | ItemKind::VirtualThermo
            | ItemKind::Independent(_)
            | ItemKind::Multipliers
            | ItemKind::Drive { .. }
            | ItemKind::Event(_)
            | ItemKind::Scene { .. }
            | ItemKind::Carry(_)
            | ItemKind::Casimir { .. }
            | ItemKind::Section { .. }
            | ItemKind::Output { .. }
            | ItemKind::View { .. }
            | ItemKind::Initial { .. }
    )
}

/// The name of what an expression belongs to, where it is more than one among others of its kind.
fn place_of(model: &Model, role: ExpressionRole) -> Option<String> {
    use ExpressionRole::{AdvectedAction, DomainEnd, FirstOrderRate, Force};
    match role {
        Force(k) => model.all_velocities().get(k).map(|(name, _)| name.to_string()),
        AdvectedAction(k) => model.advected.get(k).map(|a| a.name.clone()),
        FirstOrderRate(k) => model.first_order.get(k).map(|s| s.name.clone()),
        DomainEnd(k) => Some(model.name_of_domain(k).to_owned()),
        _ => None,
    }
}

/// The symbols in a model's expressions, by name.
fn symbols_of(model: &Model) -> BTreeMap<String, SymbolId> {
    let all: BTreeSet<SymbolId> =
        model.expressions().iter().flat_map(|(_, e)| model.graph.free_symbols(*e)).collect();
    let named = all.into_iter().map(|s| (model.graph.name(s).to_owned(), s));
    let mut symbols: BTreeMap<String, SymbolId> = named.collect();
    symbols.extend(model.params.iter().chain(&model.inputs).map(|p| (p.name.clone(), p.symbol)));
    // With given values nothing may contain them.
    for c in &model.base {
        symbols.insert(c.name.clone(), c.symbol);
        symbols.insert(c.velocity_name.clone(), c.velocity);
    }
    symbols.extend(model.velocities.iter().map(|v| (v.name.clone(), v.symbol)));
    symbols
}

/// What stands in the whole for the symbols of a part.
fn replacement(
    model: &Model,
    part: &Part,
    symbols: &BTreeMap<String, SymbolId>,
) -> Result<BTreeMap<SymbolId, ExprId>, String> {
    let mut graph = model.graph.clone();
    let given = |name: &str| {
        let output = format!("{GIVEN}{}", part.renamed(name));
        let found = model.outputs.iter().find(|o| o.name == output)?;
        Some(found.components.iter().map(|(_, e)| *e).collect::<Vec<ExprId>>())
    };
    let mut replaced = BTreeMap::from([(part.model.time, graph.sym(model.time))]);
    for name in &part.bound {
        let values = given(name).ok_or_else(|| format!("`{name}` is not given"))?;
        let of_array = part.model.param_arrays.iter().find(|array| array.name == *name);
        let own = match of_array {
            Some(array) => array.symbols.clone(),
            None => part.model.params.iter().filter(|p| p.name == *name).map(|p| p.symbol).collect(),
        };
        replaced.extend(own.into_iter().zip(values));
    }
    // Velocities after an impact have the names of the event and of the velocity.
    let mut after: BTreeMap<SymbolId, String> = BTreeMap::new();
    for event in &part.model.events {
        let symbols = event.impact.iter().flat_map(|impact| &impact.velocities);
        for (symbol, (velocity, _)) in symbols.zip(part.model.all_velocities()) {
            let name = after_impact(&part.renamed(&event.name), &part.renamed(velocity));
            after.insert(*symbol, name);
        }
    }
    for (_, e) in expressions(&part.model) {
        for symbol in part.model.graph.free_symbols(e) {
            if replaced.contains_key(&symbol) {
                continue;
            }
            let name = part.model.graph.name(symbol);
            let whole = after.get(&symbol).cloned().unwrap_or_else(|| part.renamed(name));
            let Some(found) = symbols.get(&whole) else { return Err(format!("`{name}` is not there")) };
            replaced.insert(symbol, graph.sym(*found));
        }
    }
    Ok(replaced)
}

/// The velocities of a part have the brackets of the part in the whole; brackets with others vanish.
fn check_algebra(model: &Model, part: &Part) -> Result<(), String> {
    let place = |name: &str| {
        let whole = part.renamed(name);
        model.velocities.iter().position(|v| v.name == whole).ok_or_else(|| format!("`{name}` is not there"))
    };
    let own: Vec<usize> =
        part.model.velocities.iter().map(|v| place(&v.name)).collect::<Result<_, String>>()?;
    for (a, &at) in own.iter().enumerate() {
        for b in 0..model.velocities.len() {
            let mut known: Vec<_> = model.algebra.bracket(at, b);
            let inside = own.iter().position(|place| *place == b);
            let of_part = inside.map_or_else(Vec::new, |b| part.model.algebra.bracket(a, b));
            let mut expected: Vec<_> = of_part.into_iter().map(|(c, q)| (own[c], q)).collect();
            known.sort_by_key(|(c, _)| *c);
            expected.sort_by_key(|(c, _)| *c);
            if known != expected {
                return Err(format!("the bracket of `{}`", part.model.velocities[a].name));
            }
        }
    }
    Ok(())
}

/// The whole has the events of a part by their names, and they do the same.
fn check_events(model: &Model, part: &Part) -> Result<(), String> {
    let mode = |of: &Model, event: &Event| event.mode.map(|k| of.modes[k].name.clone());
    let sets = |of: &Model, event: &Event, renamed: &dyn Fn(&str) -> String| -> Vec<String> {
        event.sets.iter().map(|symbol| renamed(of.graph.name(*symbol))).collect()
    };
    let renamed = |name: &str| part.renamed(name);
    for own in &part.model.events {
        let name = part.renamed(&own.name);
        let missing = || format!("the event `{}` is not there", own.name);
        let found = model.events.iter().find(|event| event.name == name).ok_or_else(missing)?;
        // An impact moves the velocities of other parts as well.
        let of_part = sets(&part.model, own, &renamed);
        let of_whole = sets(model, found, &str::to_owned);
        let has_sets = match own.impact {
            Some(_) => of_part.iter().all(|set| of_whole.contains(set)),
            None => of_part == of_whole,
        };
        let is_same = own.direction == found.direction
            && own.stops == found.stops
            && mode(&part.model, own).map(|name| part.renamed(&name)) == mode(model, found)
            && own.impact.is_some() == found.impact.is_some()
            && has_sets;
        if !is_same {
            return Err(missing());
        }
    }
    Ok(())
}
