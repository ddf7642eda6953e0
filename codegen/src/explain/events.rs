//! The section about events: when they happen and what they do.
//!
//! Does not know: how events are located, how impacts are solved.

use std::collections::BTreeMap;

use super::{MAX_FORMULA, Page, SectionKind};
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::spec::{Event, EventDirection, Mode, Model, Want};
use hamel_mechanics::mechanics::{Equations, OutputKind};

impl Page {
    /// The modes and the events of the model, in its order.
    pub(super) fn events(&mut self, model: &Model, equations: &Equations) {
        if model.events.is_empty() {
            return;
        }
        self.begin(SectionKind::Events);
        let mut g = equations.labelled();
        for mode in &model.modes {
            let name = self.inline(&self.name(&mode.name));
            let doc = self.prose(mode.doc.trim().trim_end_matches('.'));
            let doc = if doc.is_empty() { String::new() } else { format!(": {doc}") };
            self.line(&format!("Mode {name}, 1 while it is on and 0 otherwise{doc}."));
        }
        for event in &model.events {
            let outputs = |kind: OutputKind| equations.outputs.iter().filter(move |o| o.kind == kind);
            let mut functions = outputs(OutputKind::Group(Want::Events)).flat_map(|o| &o.components);
            let function = functions.find(|(name, _)| *name == event.name).map(|(_, e)| *e);
            let after = outputs(OutputKind::After).filter(|o| o.name == Event::after(&event.name));
            let after: Vec<ExprId> = after.flat_map(|o| &o.components).map(|(_, e)| *e).collect();
            if let Some(function) = function {
                let (function, modes) = watched(&mut g, model, function);
                self.event(model, event, &g, (function, &modes), &after);
            }
        }
    }

    /// One event: its function, the modes with which it is watched for, what it sets.
    fn event(
        &mut self,
        model: &Model,
        event: &Event,
        g: &Graph,
        (function, modes): (ExprId, &[(&Mode, bool)]),
        after: &[ExprId],
    ) {
        let name = self.inline(&self.name(&event.name));
        let function = self.short(g, function);
        let when = match event.direction {
            EventDirection::Rising => format!("{function} rises through zero"),
            EventDirection::Falling => format!("{function} falls through zero"),
            EventDirection::Either => format!("{function} changes its sign"),
            EventDirection::Below => {
                format!("{function} becomes negative, by the motion or by another event")
            }
        };
        let modes = modes
            .iter()
            .map(|(mode, is_on)| format!("{} is {}", self.inline(&self.name(&mode.name)), u8::from(*is_on)));
        let modes: Vec<String> = modes.collect();
        let modes = if modes.is_empty() { String::new() } else { format!(", while {}", modes.join(" and ")) };
        let mut effects = Vec::new();
        for (symbol, value) in event.sets.iter().zip(after) {
            let set = self.inline(&self.name(model.graph.name(*symbol)));
            let is_by_impact =
                event.impact.is_some() && model.all_velocities().iter().any(|(_, v)| v == symbol);
            if !is_by_impact {
                effects.push(format!("{set} becomes {}", self.short(g, *value)));
            }
        }
        if let Some(impact) = &event.impact {
            let named = |symbols: Vec<SymbolId>| -> Vec<String> {
                let is_among = |m: &&Mode| symbols.contains(&m.symbol);
                model.modes.iter().filter(is_among).map(|m| self.inline(&self.name(&m.name))).collect()
            };
            let struck = named(impact.restitution.iter().map(|(s, _)| *s).collect());
            let there = named(impact.modes.iter().map(|(s, _)| *s).collect());
            let mut by = "velocities change by impulses in the kinetic metric".to_owned();
            if !there.is_empty() {
                by += &format!(" with {} as it sets them", there.join(", "));
            }
            if !struck.is_empty() {
                by += &format!(", and with restitution along the constraints of {}", struck.join(", "));
            }
            effects.push(by);
        }
        if event.stops {
            effects.push("the motion ends".to_owned());
        }
        if effects.is_empty() {
            effects.push("nothing changes".to_owned());
        }
        self.line(&format!("Event {name}, where {when}{modes}: {}.", effects.join("; ")));
    }

    /// A formula that somebody reads, or how long it is.
    pub(super) fn short(&self, g: &Graph, e: ExprId) -> String {
        let text = g.display(e, self.style);
        match text.len() <= MAX_FORMULA {
            true => self.inline(&text),
            false => format!("a formula of more than {MAX_FORMULA} characters"),
        }
    }
}

/// The function of an event without the modes that it is one with, and those modes: it is watched for while they are on
/// or off.
fn watched<'m>(g: &mut Graph, model: &'m Model, function: ExprId) -> (ExprId, Vec<(&'m Mode, bool)>) {
    let (mut function, mut modes) = (function, Vec::new());
    for mode in &model.modes {
        for is_on in [true, false] {
            let (here, there) = if is_on { (g.one(), g.zero()) } else { (g.zero(), g.one()) };
            let at =
                |g: &mut Graph, value: ExprId| g.subs(function, &BTreeMap::from([(mode.symbol, value)])).ok();
            if at(g, there) == Some(g.one())
                && let Some(rest) = at(g, here)
                && rest != function
            {
                function = g.cancel_zero(rest);
                modes.push((mode, is_on));
                break;
            }
        }
    }
    (function, modes)
}
