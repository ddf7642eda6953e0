//! Which results need which coordinates, also by the definitions that they use.
//!
//! Does not know: what a scene leaves out.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::{ExprId, Graph, Section, SymbolId, needed_sections};
use hamel_mechanics::mechanics::{Equations, OutputKind, StateEquation};

/// Base coordinates on which neither another state variable's rate, nor a wanted result, nor a pivot depends.
pub(super) fn ignorable(equations: &Equations, results: &[ExprId]) -> Vec<String> {
    let graph = &equations.system.graph;
    let mut inputs: BTreeMap<SymbolId, BTreeSet<SymbolId>> = BTreeMap::new();
    let needs = |e: ExprId, inputs: &BTreeMap<SymbolId, BTreeSet<SymbolId>>| -> BTreeSet<SymbolId> {
        graph
            .free_symbols(e)
            .into_iter()
            .flat_map(|s| inputs.get(&s).cloned().unwrap_or_else(|| BTreeSet::from([s])))
            .collect()
    };
    for definition in equations.sections.iter().flat_map(|s| &s.definitions) {
        let needed = needs(definition.expr, &inputs);
        inputs.insert(definition.symbol, needed);
    }
    let base = equations.system.algebroid.base();
    let mut needed: BTreeSet<SymbolId> = results
        .iter()
        .chain(equations.pivots.iter().map(|p| &p.expr))
        .flat_map(|e| needs(*e, &inputs))
        .collect();
    let mut open: Vec<(SymbolId, BTreeSet<SymbolId>)> = Vec::new();
    for s in &equations.state {
        let rate = needs(s.derivative, &inputs);
        if base.contains(&s.symbol) {
            open.push((s.symbol, rate));
        } else {
            needed.extend(rate);
        }
    }
    // A coordinate that is needed needs what its own rate depends on.
    while let Some(k) = open.iter().position(|(symbol, _)| needed.contains(symbol)) {
        needed.extend(open.swap_remove(k).1);
    }
    let dropped: BTreeSet<SymbolId> = open.into_iter().map(|(symbol, _)| symbol).collect();
    equations.state.iter().filter(|s| dropped.contains(&s.symbol)).map(|s| s.name.clone()).collect()
}

/// Coordinates of the base and the group that are no part of a scene's state.
pub(super) fn left_out(equations: &Equations, state: &[StateEquation]) -> BTreeSet<SymbolId> {
    let carried: BTreeSet<SymbolId> = state.iter().map(|s| s.symbol).collect();
    let base = equations.system.algebroid.base().iter().copied();
    let all = base.chain(equations.reconstruction.iter().map(|s| s.symbol));
    all.filter(|symbol| !carried.contains(symbol)).collect()
}

/// Whether a value depends on one of `symbols`, also by the sections that it uses.
pub(super) fn needs(g: &Graph, equations: &Equations, e: ExprId, symbols: &BTreeSet<SymbolId>) -> bool {
    needs_by(g, &equations.sections, e, symbols)
}

/// The same by other sections.
pub(super) fn needs_by(g: &Graph, sections: &[Section], e: ExprId, symbols: &BTreeSet<SymbolId>) -> bool {
    let sections = needed_sections(g, sections, &[e]);
    let definitions = sections.iter().flat_map(|s| &s.definitions).map(|d| d.expr);
    definitions.chain([e]).any(|e| g.depends_on(e, symbols))
}

/// The components of the outputs of the model that a state is enough for: what a linearization observes.
pub(super) fn outputs_of_model(equations: &Equations, state: &[StateEquation]) -> Vec<(String, ExprId)> {
    let (graph, left_out) = (&equations.system.graph, left_out(equations, state));
    let own = equations.outputs.iter().filter(|o| o.kind == OutputKind::OfModel);
    let components = own.flat_map(|o| o.components.iter().cloned());
    components.filter(|(_, e)| !needs(graph, equations, *e, &left_out)).collect()
}
