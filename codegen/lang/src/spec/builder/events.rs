//! Events: functions whose changes of sign are watched for, and what happens there.
//!
//! Deliberately does not know: which formulation carries what an event sets, how events are located.

use std::collections::BTreeSet;

use super::draft::{DeclaredAs, ModelBuilder};
use super::event_drafts::{EventDraft, EventSet, ModeAct};
use super::symbols::Special;
use crate::spec::diagnostic::Span;
use crate::spec::event::{Event, EventDirection, OutputPart};
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::value::Value;
use crate::spec::want::Want;
use hamel_expr::{ExprId, SymbolId};

/// What functions of events, and what they set, may mention besides state, time and parameters.
const ALLOWED: &[Special] =
    &[Special::QuasiVelocity, Special::Momentum, Special::Multiplier, Special::Feedback];

impl ModelBuilder {
    /// An event: a change of sign of `function` in a direction, where everything in `sets`, named as it is declared,
    /// takes its value all at once, and the motion ends if `stops`.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, EventDirection, ModelBuilder, Rational, Value};
    ///
    /// let mut b = ModelBuilder::new("ball");
    /// let (z, v) = b.coordinate("z", Domain::Real, "");
    /// let g = b.graph();
    /// let (square, two) = (v.mul(g, &v).unwrap(), Value::number(g, Rational::from_integer(2.into())));
    /// let energy = square.div(g, &two).unwrap();
    /// let potential = z.neg(g);
    /// let lagrangian = energy.add(g, &potential).unwrap();
    /// let back = v.neg(g);
    /// b.lagrangian(&lagrangian);
    /// b.event("impact", &z, EventDirection::Falling, &[("z_dot", back)], false, "");
    /// let model = b.build().unwrap();
    /// assert_eq!(model.events[0].sets.len(), 1);
    /// ```
    pub fn event(
        &mut self,
        name: &str,
        function: &Value,
        direction: EventDirection,
        sets: &[(&str, Value)],
        stops: bool,
        doc: &str,
    ) -> &mut Self {
        let here = self.here;
        let set = |(target, value): &(&str, Value)| EventSet {
            target: ((*target).to_owned(), here),
            value: value.clone(),
            span: here,
        };
        let sets = sets.iter().map(set).collect();
        self.located_event(name, (function.clone(), here), direction, (sets, Vec::new(), stops), doc)
    }

    pub(in crate::spec) fn located_event(
        &mut self,
        name: &str,
        (value, of_value): (Value, Option<Span>),
        direction: EventDirection,
        (sets, acts, stops): (Vec<EventSet>, Vec<ModeAct>, bool),
        doc: &str,
    ) -> &mut Self {
        self.output_name(name);
        if !(sets.is_empty() && acts.is_empty()) {
            self.output_name(&Event::after(name));
        }
        let (name, doc, span) = (name.to_owned(), doc.to_owned(), self.here);
        let mode = self.current_mode;
        self.events.push(EventDraft { name, value, of_value, direction, sets, acts, stops, mode, doc, span });
        self
    }

    /// Checks the events; their functions and what they set become outputs.
    pub(super) fn check_events(&mut self) -> Vec<Event> {
        let declares = ["velocity", "coordinate", "advected", "state", "frame", "algebroid", "momentum"];
        if declares.iter().any(|item| self.broken.contains(item)) {
            return Vec::new();
        }
        let state = self.settable();
        let (mut events, mut functions, mut after) = (Vec::new(), Vec::new(), Vec::new());
        for draft in self.events.clone() {
            let EventDraft { name, value, of_value, direction, sets, acts, stops, mode, doc, span } = draft;
            let place = format!("event `{name}`");
            let Some(function) = self.event_function(&place, &value, of_value, &state) else { continue };
            let function = self.watched(mode, &acts, function);
            let (mut symbols, mut components) = (Vec::new(), Vec::new());
            let (of_modes, impact) = self.check_acts(&name, &acts);
            if let (Some(_), Some(set)) =
                (&impact, sets.iter().find(|set| !self.is_first_order(&set.target.0)))
            {
                let message = format!("{place} sets `{}` beside an impact", set.target.0);
                let help = "the impact gives all velocities where the coordinates are; use another event";
                self.problem(set.target.1, message, help);
                continue;
            }
            for EventSet { target, value, span } in sets {
                let Some(targets) = self.event_targets(&place, &target, &state) else { continue };
                let found = value.shape();
                let shape = self.values[&target.0].shape();
                if found != shape {
                    let message = format!("{place} sets `{}`, which is {shape}, to {found}", target.0);
                    self.problem(span, message, "give every component its value");
                    continue;
                }
                if value.entries().iter().any(|e| self.reports_stray(*e, span, &place, ALLOWED)) {
                    continue;
                }
                for (symbol, e) in targets.into_iter().zip(value.entries()) {
                    let own = self.graph.name(symbol).to_owned();
                    if symbols.contains(&symbol) {
                        self.problem(target.1, format!("{place} sets `{own}` twice"), "keep one of them");
                        break;
                    }
                    symbols.push(symbol);
                    components.push((format!("{}_{own}", Event::after(&name)), *e));
                }
            }
            for (symbol, e) in of_modes {
                let own = self.graph.name(symbol).to_owned();
                components.push((format!("{}_{own}", Event::after(&name)), e));
                symbols.push(symbol);
            }
            if !components.is_empty() {
                let doc = format!("what event `{name}` sets, in its order");
                after.push(NamedVector {
                    name: Event::after(&name),
                    components,
                    doc,
                    part: OutputPart::After,
                });
            }
            functions.push((name.clone(), function));
            events.push(Event { name, direction, mode, sets: symbols, impact, stops, doc, span });
        }
        if !functions.is_empty() {
            let name = Want::Events.name().to_owned();
            let doc = "functions whose changes of sign are the events".to_owned();
            self.outputs.push(NamedVector { name, components: functions, doc, part: OutputPart::Events });
            self.outputs.extend(after);
        }
        events
    }

    /// What the state of some formulation can carry.
    fn settable(&self) -> BTreeSet<SymbolId> {
        let velocities = self.velocity_symbols().into_iter();
        let quasi = self.quasi_velocities.iter().map(|v| v.symbol);
        let advected = self.advected.iter().flat_map(|a| a.components.iter().map(|(_, symbol)| *symbol));
        let momenta = self.momenta.iter().flat_map(|m| m.components.iter().map(|(_, symbol, _)| *symbol));
        let base = self.base.iter().map(|c| c.symbol);
        let first_order = self.first_order_symbols();
        velocities.chain(quasi).chain(advected).chain(momenta).chain(base).chain(first_order).collect()
    }

    /// The function of an event: a number that can change its sign.
    fn event_function(
        &mut self,
        place: &str,
        value: &Value,
        span: Option<Span>,
        state: &BTreeSet<SymbolId>,
    ) -> Option<ExprId> {
        let Value::Scalar(e) = *value else {
            let message = format!("{place} must watch a number, found {}", value.shape());
            self.problem(span, message, "write an event for each component");
            return None;
        };
        if self.reports_stray(e, span, place, ALLOWED) {
            return None;
        }
        if self.graph.is_zero(e) {
            let message = format!("{place} watches a function that vanishes identically");
            self.problem(span, message, "it never changes its sign");
            return None;
        }
        let mut moving = state.clone();
        moving.insert(self.time);
        moving.extend(self.multiplier_symbols.iter().map(|(_, symbol)| *symbol));
        if !self.graph.depends_on(e, &moving) {
            let message = format!("{place} watches a function without state and time");
            self.problem(span, message, "it never changes its sign");
            return None;
        }
        Some(e)
    }

    /// The components of what an event sets.
    fn event_targets(
        &mut self,
        place: &str,
        (name, span): &(String, Option<Span>),
        state: &BTreeSet<SymbolId>,
    ) -> Option<Vec<SymbolId>> {
        let help = "an event sets velocities, coordinates, advected parameters and states of first order";
        let Some(declared) = self.names.get(name).map(|declared| declared.what) else {
            let known = self.names.iter().filter(|(_, d)| is_of_state(d.what)).map(|(name, _)| name.as_str());
            let near = names::suggest(name, known);
            let help = if near.is_empty() { help.into() } else { near };
            self.problem(*span, format!("{place} sets `{name}`, which is not declared"), help);
            return None;
        };
        if !is_of_state(declared) {
            self.problem(*span, format!("{place} sets `{name}`, which is {}", declared.words()), help);
            return None;
        }
        let value = self.values.get(name)?.clone();
        let component = |e: &ExprId| {
            let symbols: Vec<SymbolId> = self.graph.free_symbols(*e).into_iter().collect();
            let [symbol] = symbols[..] else { return None };
            (state.contains(&symbol) && self.graph.sym(symbol) == *e).then_some(symbol)
        };
        let targets: Option<Vec<SymbolId>> = value.entries().iter().map(component).collect();
        if targets.is_none() {
            let message = format!("{place} sets `{name}`, which the model writes in other velocities");
            self.problem(*span, message, "set the velocities that the frame or the algebroid declares");
        }
        targets
    }
}

/// Whether what is declared so may be a part of a state.
fn is_of_state(what: DeclaredAs) -> bool {
    !matches!(
        what,
        DeclaredAs::Parameter
            | DeclaredAs::ParameterComponent
            | DeclaredAs::Input
            | DeclaredAs::InputComponent
            | DeclaredAs::Definition
            | DeclaredAs::Section
            | DeclaredAs::Reconstructed
            | DeclaredAs::CarriedAcceleration
            | DeclaredAs::Levels
            | DeclaredAs::Mode
            | DeclaredAs::Multiplier
            | DeclaredAs::Actuator
            | DeclaredAs::Response
    )
}
