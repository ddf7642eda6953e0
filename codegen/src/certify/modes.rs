//! Which modes may be on together: every state of the modes that events lead to from the start, whatever their
//! functions.
//!
//! Does not know: states, constraints.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::SymbolId;
use hamel_lang::spec::{Event, Model};

/// Whether each mode is on.
pub(super) type On = BTreeMap<SymbolId, bool>;

/// Most of them that are looked at: six modes that are independent of each other.
const MAX_STATES: usize = 64;

/// The modes at the start, which `is_on` tells, and all that events make of them, each only where it is watched for.
pub(super) fn reachable(model: &Model, is_on: impl Fn(SymbolId) -> bool) -> Vec<On> {
    let start: On = model.modes.iter().map(|mode| (mode.symbol, is_on(mode.symbol))).collect();
    let mut known = BTreeSet::from([start.clone()]);
    let mut list = vec![start];
    let mut k = 0;
    while let Some(modes) = list.get(k).cloned() {
        for event in model.events.iter().filter(|event| is_watched(model, event, &modes)) {
            let next = after(model, event, &modes);
            if list.len() < MAX_STATES && known.insert(next.clone()) {
                list.push(next);
            }
        }
        k += 1;
    }
    list
}

/// An event is watched for while its mode is on, and those are off that it enters or strikes.
fn is_watched(model: &Model, event: &Event, modes: &On) -> bool {
    let strikes = event.impact.iter().flat_map(|impact| &impact.modes);
    let mut struck = strikes.filter(|(_, e)| *e != model.graph.zero());
    event.mode.is_none_or(|mode| modes[&model.modes[mode].symbol]) && struck.all(|(symbol, _)| !modes[symbol])
}

fn after(model: &Model, event: &Event, modes: &On) -> On {
    let mut modes = modes.clone();
    let output = model.outputs.iter().find(|output| output.name == Event::after(&event.name));
    let components = output.iter().flat_map(|output| &output.components);
    for (symbol, (_, e)) in event.sets.iter().zip(components) {
        if let Some(on) = modes.get_mut(symbol) {
            *on = *e != model.graph.zero();
        }
    }
    modes
}
