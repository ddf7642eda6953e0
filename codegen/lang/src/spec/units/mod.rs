//! Units of a model that declares them, checked: warnings where two dimensions meet that differ.
//!
//! A model is checked where the doc comments of all its parameters and state variables have units, `[kg m^2]`. What has
//! none, or one that is no product of powers of units, has the dimension that its equations give it, so that only
//! contradictions are found; where there are none, these are the units that [`Units`] infers. Numbers of the text have
//! none. Deliberately does not know: text but doc comments, equations of motion.

mod solve;

use std::collections::{BTreeMap, BTreeSet};

use self::solve::{Dimensions, Form, Mismatch};
use super::diagnostic::{Diagnostic, Span};
use super::event::{Event, OutputPart};
use super::model::*;
use super::unit::{Dimension, Exponent, Unit, Units};
use hamel_expr::{ExprId, Style, SymbolId};

/// Longest term that is shown in a message.
const MAX_TERM: usize = 60;

/// Most brackets of an algebra that are looked at: velocities of larger ones are coefficients of one function.
const MAX_BRACKETS: usize = 4096;

/// A definition of the text, which the model holds no longer.
#[derive(Clone, Debug)]
pub(super) struct DefinitionUnits {
    /// Its name.
    pub(super) name: String,
    /// Where the name stands.
    pub(super) span: Span,
    /// Its documentation.
    pub(super) doc: String,
    /// Its components.
    pub(super) entries: Vec<ExprId>,
}

/// The units in a doc comment, each what stands between brackets.
fn units(doc: &str) -> Vec<&str> {
    let mut units = Vec::new();
    let mut rest = doc;
    while let Some((_, after)) = rest.split_once('[')
        && let Some((unit, after)) = after.split_once(']')
    {
        units.push(unit.trim());
        rest = after;
    }
    units
}

/// The unit of what a doc comment describes at a position, the last one where it has fewer.
fn unit_at(doc: &str, position: usize) -> Option<Unit> {
    let units = units(doc);
    Unit::declared(units.get(position).or(units.last())?)
}

/// Whether all parameters and state variables of a model have units; angles have theirs without saying so.
fn declares_units(model: &Model) -> bool {
    let has_unit = |doc: &str| !units(doc).is_empty();
    let params = model.params.iter().all(|p| has_unit(&p.doc));
    let base = model.base.iter().all(|c| c.domain == Domain::Angle || has_unit(&c.doc));
    let n = model.n_shape();
    let velocities = model.velocities.iter().enumerate().all(|(k, v)| {
        let by_momentum = |m: &Momentum| m.components.iter().any(|(.., of)| *of == n + k) && has_unit(&m.doc);
        has_unit(&v.doc) || model.momenta.iter().any(by_momentum)
    });
    let advected = model.advected.iter().all(|a| has_unit(&a.doc));
    let first_order = model.first_order.iter().all(|s| s.domain == Domain::Angle || has_unit(&s.doc));
    let is_any = !(model.params.is_empty() && model.base.is_empty() && model.velocities.is_empty());
    is_any && params && base && velocities && advected && first_order
}

/// Whether a unit of a model has a time in it; the others may count the time by anything.
fn has_seconds(model: &Model) -> bool {
    let params = model.params.iter().map(|p| &p.doc);
    let state = model.base.iter().map(|c| &c.doc).chain(model.velocities.iter().map(|v| &v.doc));
    let others = model.advected.iter().map(|a| &a.doc).chain(model.momenta.iter().map(|m| &m.doc));
    let docs = params.chain(state).chain(others).chain(model.first_order.iter().map(|s| &s.doc));
    docs.flat_map(|doc| units(doc)).filter_map(Dimension::parse).any(|unit| unit.has_time())
}

/// The units of a model, and one warning for each item in which dimensions contradict each other.
pub(super) fn examine(model: &Model, definitions: &[DefinitionUnits]) -> (Units, Vec<Diagnostic>) {
    let all = model.all_velocities().into_iter().map(|(_, symbol)| symbol);
    let velocities = all.chain(model.quasi_velocities.iter().map(|v| v.symbol)).collect();
    let mut dimensions = Dimensions::default();
    let second = if has_seconds(model) { Form::of(Dimension::second()) } else { dimensions.unknown() };
    let (declared, energy) = (BTreeMap::new(), Form::one());
    let mut check = Check { model, velocities, second, dimensions, declared, energy, found: Vec::new() };
    check.symbols();
    if !declares_units(model) {
        check.reconstruction();
        return (check.units(false), Vec::new());
    }
    check.structure();
    check.action();
    check.forces_and_constraints();
    check.definitions(definitions);
    check.outputs();
    check.reconstruction();
    check.conditions();
    // Of grams and metres follows no joule.
    let is_coherent = check.declared.values().all(|unit| unit.factor() == 1.0);
    (check.units(is_coherent && check.found.is_empty()), check.found)
}

struct Check<'m> {
    model: &'m Model,
    velocities: Vec<SymbolId>,
    /// Of the time: a second, or nothing that is known where no unit of the model has one.
    second: Form,
    dimensions: Dimensions,
    /// What doc comments say.
    declared: BTreeMap<SymbolId, Unit>,
    energy: Form,
    found: Vec<Diagnostic>,
}

impl Check<'_> {
    fn declared(&mut self, symbol: SymbolId, doc: &str, position: usize) {
        match unit_at(doc, position) {
            Some(unit) => self.known(symbol, unit),
            None => {
                let form = self.dimensions.unknown();
                self.dimensions.set(symbol, form);
            }
        }
    }

    fn known(&mut self, symbol: SymbolId, unit: Unit) {
        self.dimensions.set(symbol, Form::of(unit.dimension()));
        self.declared.insert(symbol, unit);
    }

    /// Angles have radians without saying so.
    fn angle(&mut self, symbol: SymbolId) {
        if let Some(unit) = Unit::declared("rad") {
            self.known(symbol, unit);
        }
    }

    /// What doc comments say of symbols, and what rates are by their coordinates.
    fn symbols(&mut self) {
        let model = self.model;
        let second = self.second.clone();
        self.dimensions.set(model.time, second.clone());
        for param in &model.params {
            self.declared(param.symbol, &param.doc, 0);
        }
        let mut lines: Vec<&str> = Vec::new();
        for input in &model.inputs {
            let position = lines.iter().filter(|doc| **doc == input.doc).count();
            lines.push(&input.doc);
            self.declared(input.symbol, &input.doc, position);
        }
        for (k, coordinate) in model.base.iter().enumerate() {
            match coordinate.domain {
                Domain::Angle if units(&coordinate.doc).is_empty() => self.angle(coordinate.symbol),
                _ => self.declared(coordinate.symbol, &coordinate.doc, 0),
            }
            let own = model.frame.as_ref().and_then(|frame| frame.docs.get(k)?.as_ref());
            match own {
                Some(doc) => self.declared(coordinate.velocity, doc, 0),
                None => {
                    let rate = self.dimensions.of_symbol(coordinate.symbol).divided(&second);
                    self.dimensions.set(coordinate.velocity, rate);
                    let unit = self.declared.get(&coordinate.symbol).filter(|_| has_seconds(model));
                    if let Some(rate) = unit.and_then(Unit::rate) {
                        self.declared.insert(coordinate.velocity, rate);
                    }
                }
            }
        }
        // A line of documentation may have a unit for each vector.
        let mut blocks: Vec<(&str, &str)> = Vec::new();
        for velocity in model.velocities.iter().chain(&model.quasi_velocities) {
            let block = (velocity.doc.as_str(), velocity.block.as_str());
            if !blocks.contains(&block) {
                blocks.push(block);
            }
            let same_line = blocks.iter().filter(|(doc, _)| *doc == velocity.doc);
            let position = same_line.take_while(|other| **other != block).count();
            self.declared(velocity.symbol, &velocity.doc, position);
        }
        for advected in &model.advected {
            for (_, symbol) in &advected.components {
                self.declared(*symbol, &advected.doc, 0);
            }
        }
        for state in &model.first_order {
            for (_, symbol) in &state.components {
                match state.domain {
                    Domain::Angle if units(&state.doc).is_empty() => self.angle(*symbol),
                    _ => self.declared(*symbol, &state.doc, 0),
                }
            }
        }
        let mut lines: Vec<&str> = Vec::new();
        for momentum in &model.momenta {
            let position = lines.iter().filter(|doc| **doc == momentum.doc).count();
            lines.push(&momentum.doc);
            for (_, symbol, _) in &momentum.components {
                self.declared(*symbol, &momentum.doc, position);
            }
        }
        for (velocity, symbol) in model.all_velocities().into_iter().zip(&model.accelerations) {
            let rate = self.dimensions.of_symbol(velocity.1).divided(&second);
            self.dimensions.set(*symbol, rate);
        }
        for constraint in &model.constraints {
            if let ConstraintKind::ThirdOrder { carried, .. } = &constraint.kind {
                let form = self.dimensions.unknown();
                self.dimensions.set(carried.symbol, form);
            }
        }
    }

    /// Of the base velocities, those in the algebra and the quasi-velocities, in this order.
    fn velocity(&mut self, k: usize) -> Form {
        match self.velocities.get(k) {
            Some(symbol) => self.dimensions.of_symbol(*symbol),
            None => self.dimensions.unknown(),
        }
    }

    fn shown(&self, e: ExprId) -> String {
        let text = self.model.graph.display(e, Style::Plain);
        match text.char_indices().nth(MAX_TERM) {
            Some((at, _)) => format!("{} ..", &text[..at]),
            None => text,
        }
    }

    fn warn(&mut self, span: Option<Span>, message: String, help: &str) {
        let span = span.filter(|_| self.model.origin.is_some());
        // What follows at the same place is most often the same.
        if span.is_some() && self.found.iter().any(|other| other.span == span) {
            return;
        }
        self.found.push(Diagnostic::warning(span, message).with_help(help));
    }

    /// The dimension of an expression, and warnings about what is wrong in it.
    fn inside(&mut self, what: &str, span: Option<Span>, e: ExprId) -> Option<Form> {
        let mut wrong = Vec::new();
        let form = self.dimensions.of(&self.model.graph, e, &mut wrong);
        // What follows from one contradiction is most often another.
        if let Some(mismatch) = wrong.into_iter().next() {
            let quoted = |(e, dimension): &(ExprId, Dimension)| format!("`{}` [{dimension}]", self.shown(*e));
            let (message, help) = match &mismatch {
                Mismatch::Terms { first, other } => (
                    format!("{what} adds {} and {}", quoted(first), quoted(other)),
                    "correct a unit in a doc comment, or the term",
                ),
                Mismatch::Number { number, other } => (
                    format!("{what} adds the number {number} and {}", quoted(other)),
                    "a number has no unit: name it with `param` and a unit",
                ),
                Mismatch::Argument { function, argument } => (
                    format!("{what} has `{}` of {}", function.name(), quoted(argument)),
                    "functions take numbers without unit: divide by a parameter with the same unit",
                ),
                Mismatch::Angle { y, x } => (
                    format!("{what} has the angle of {} and {}", quoted(y), quoted(x)),
                    "correct a unit in a doc comment, or the expression",
                ),
            };
            self.warn(span, message, help);
        }
        form
    }

    /// Takes an expression and a dimension for one; `is` says in a message what the dimension is.
    fn equal(&mut self, what: &str, span: Option<Span>, e: ExprId, expected: &Form, is: &str) {
        let n = self.found.len();
        let Some(form) = self.inside(what, span, e) else { return };
        self.same(what, span, &form, expected, is, n);
    }

    fn same(
        &mut self,
        what: &str,
        span: Option<Span>,
        form: &Form,
        expected: &Form,
        is: &str,
        n_before: usize,
    ) {
        let known = (self.dimensions.known(form), self.dimensions.known(expected));
        if self.dimensions.equate(form, expected) || self.found.len() > n_before {
            return;
        }
        let message = match known {
            (Some(found), Some(expected)) => format!("{what} is [{found}], {is} [{expected}]"),
            // Both depend on what is unknown in the same way.
            _ => format!("{what} has another unit than {is}"),
        };
        self.warn(span, message, "correct a unit in a doc comment, or the expression");
    }

    /// Brackets, anchors, frames and connections.
    fn structure(&mut self) {
        let model = self.model;
        let second = self.second.clone();
        let place = |name: &str| model.places.declared.get(name).copied();
        let n = model.n_shape();
        if let Some(own) = &model.algebroid {
            for (i, row) in own.anchor.iter().enumerate() {
                for (a, rho) in row.iter().enumerate() {
                    let expected = self
                        .dimensions
                        .of_symbol(model.base[i].symbol)
                        .divided(&second)
                        .divided(&self.velocity(a));
                    let what = format!(
                        "the anchor of `{}` along `{}`",
                        model.base[i].name, model.velocities[a].name
                    );
                    self.equal(&what, own.span, *rho, &expected, "the rate by the velocity");
                }
            }
            for bracket in &own.brackets {
                let [a, b] = bracket.pair;
                let pair = self.velocity(a).multiplied(&self.velocity(b)).multiplied(&second);
                for (c, value) in &bracket.value {
                    let expected = self.velocity(*c).divided(&pair);
                    let what = format!("[{}, {}] along {}", own.basis[a], own.basis[b], own.basis[*c]);
                    self.equal(&what, bracket.span, *value, &expected, "the velocities give");
                }
            }
        } else if model.frame.is_none() {
            // `xi = xi^a e_a`: a bracket of velocities is a velocity by a time.
            let mut reported: BTreeSet<[&str; 3]> = BTreeSet::new();
            for (a, b, value) in model.algebra.brackets().take(MAX_BRACKETS) {
                for (c, _) in value {
                    let pair = self.velocity(n + a).multiplied(&self.velocity(n + b)).multiplied(&second);
                    let own = self.velocity(n + c);
                    let names = [a, b, *c].map(|k| model.velocities[k].name.as_str());
                    let blocks = [a, b, *c].map(|k| model.velocities[k].block.as_str());
                    if !self.dimensions.equate(&own, &pair) && reported.insert(blocks) {
                        let shown = |check: &Self, form: &Form| match check.dimensions.known(form) {
                            Some(dimension) => format!("[{dimension}]"),
                            None => "another unit".to_owned(),
                        };
                        let message = format!(
                            "`{}` is {}, but the bracket of `{}` and `{}` makes it {}",
                            names[2],
                            shown(self, &own),
                            names[0],
                            names[1],
                            shown(self, &pair)
                        );
                        self.warn(place(blocks[2]), message, "correct a unit in a doc comment");
                    }
                }
            }
        }
        if let Some(frame) = &model.frame {
            for (i, (name, symbol)) in frame.original.iter().enumerate() {
                // A rate of a coordinate has its unit, whatever the frame has in its place.
                let rate = model.base.get(i).filter(|_| i < n);
                if let Some(coordinate) = rate {
                    let form = self.dimensions.of_symbol(coordinate.symbol).divided(&second);
                    if coordinate.velocity != *symbol {
                        self.dimensions.set(*symbol, form);
                    }
                }
                let original = self.dimensions.of_symbol(*symbol);
                for (j, entry) in frame.matrix.get(i).into_iter().flatten().enumerate() {
                    let expected = original.divided(&self.velocity(j));
                    let what = format!("`{name}` by the quasi-velocities of the frame");
                    self.equal(&what, frame.span, *entry, &expected, "their units give");
                }
            }
        }
        if let Some(connection) = &model.connection {
            for (a, row) in connection.iter().enumerate() {
                for (i, entry) in row.iter().enumerate() {
                    let rate = self.dimensions.of_symbol(model.base[i].symbol).divided(&second);
                    let expected = self.velocity(n + a).divided(&rate);
                    let what = format!("the connection on `{}`", model.velocities[a].name);
                    self.equal(&what, model.places.connection, *entry, &expected, "the velocities give");
                }
            }
        }
        for state in &model.first_order {
            for ((name, symbol), e) in state.components.iter().zip(&state.rates) {
                let expected = self.dimensions.of_symbol(*symbol).divided(&second);
                let what = format!("the rate of `{name}`");
                self.equal(&what, state.of_rate, *e, &expected, "its unit by the time gives");
            }
        }
        for advected in &model.advected {
            for ((name, symbol), e) in advected.components.iter().zip(&advected.action) {
                let expected = self.dimensions.of_symbol(*symbol).divided(&second);
                let what = format!("the action on `{name}`");
                self.equal(&what, advected.span, *e, &expected, "its rate");
            }
        }
    }

    /// The Lagrangian or the Hamiltonian, and momenta.
    fn action(&mut self) {
        let model = self.model;
        let place = model.places.lagrangian;
        let energy = self.dimensions.unknown();
        self.energy = energy.clone();
        for momentum in &model.momenta {
            for (name, symbol, of) in &momentum.components {
                let expected = energy.divided(&self.velocity(*of));
                let form = self.dimensions.of_symbol(*symbol);
                let n = self.found.len();
                let what = format!("the momentum `{name}`");
                self.same(&what, momentum.span, &form, &expected, "an energy by its velocity", n);
            }
        }
        match model.hamiltonian {
            Some(h) => self.equal("the hamiltonian", place, h, &energy, "the momenta give"),
            None => self.equal("the lagrangian", place, model.lagrangian, &energy, "the momenta give"),
        }
        for own in &model.quasi_invariances {
            let expected = energy.divided(&self.velocity(own.velocity));
            let what = format!("the function that the momentum `{}` is up to", own.parameter);
            self.equal(&what, own.span, own.function, &expected, "an energy by the velocity");
        }
        let names = model.all_velocities();
        let spans = |map: &std::collections::BTreeMap<String, Span>, k: usize| {
            let name = names[k].0;
            let block = k.checked_sub(model.n_shape()).map(|a| model.velocities[a].block.as_str());
            map.get(name).or_else(|| map.get(block?)).copied().or_else(|| {
                let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
                map.get(stem).copied()
            })
        };
        for (k, force) in model.forces.iter().enumerate() {
            let expected = energy.divided(&self.velocity(k)).divided(&self.second.clone());
            let what = format!("the force on `{}`", names[k].0);
            self.equal(&what, spans(&model.places.forces, k), *force, &expected, "the power by its velocity");
        }
        self.feedback();
        for (k, given) in model.given.iter().flatten().enumerate() {
            let velocity = self.velocity(k);
            let span = spans(&model.places.given, k);
            match given {
                Given::Constrained => {}
                Given::Velocity(e) => {
                    self.equal(
                        &format!("the field of `{}`", names[k].0),
                        span,
                        *e,
                        &velocity,
                        "the velocity",
                    );
                }
                Given::Acceleration(e) => {
                    let what = format!("the acceleration of `{}`", names[k].0);
                    self.equal(
                        &what,
                        span,
                        *e,
                        &velocity.divided(&self.second.clone()),
                        "the rate of the velocity",
                    );
                }
            }
        }
    }

    /// The force of an actuator by its power, and what a function has from it.
    fn feedback(&mut self) {
        let model = self.model;
        let (Some(lyapunov), Some(condition)) = (&model.lyapunov, model.virtual_constraints.first()) else {
            return;
        };
        let own = model.multipliers.iter().find(|(name, _)| *name == lyapunov.name);
        let Some(force) = own.map(|(_, symbol)| self.dimensions.of_symbol(*symbol)) else { return };
        let second = self.second.clone();
        let power = self.energy.divided(&second);
        for (k, f) in condition.one_form.iter().enumerate() {
            let expected = power.divided(&self.velocity(k)).divided(&force);
            let what = format!("the velocity of `{}`", condition.name);
            self.equal(&what, condition.span, *f, &expected, "a power by its force");
        }
        let what = format!("the function `{}`", lyapunov.name);
        if let Some(value) = self.inside(&what, lyapunov.span, lyapunov.value) {
            self.dimensions.set(lyapunov.response, value.divided(&second).divided(&force));
        }
    }

    fn forces_and_constraints(&mut self) {
        let model = self.model;
        for constraint in &model.constraints {
            let what = format!("constraint `{}`", constraint.text);
            let residual = self.inside(&what, constraint.span, constraint.residual);
            let residual = residual.unwrap_or_else(|| self.dimensions.unknown());
            let (rows, order) = match &constraint.kind {
                ConstraintKind::Linear | ConstraintKind::Nonlinear => continue,
                ConstraintKind::SecondOrder { acceleration } => (acceleration, 1),
                ConstraintKind::ThirdOrder { jerk, carried: _ } => (jerk, 2),
            };
            for (k, w) in rows.iter().enumerate() {
                let rate = self.velocity(k).times(&self.second.clone(), &Exponent::from_integer(-order));
                let expected = residual.divided(&rate);
                self.equal(&what, constraint.span, *w, &expected, "the rest by the rate");
            }
        }
        for condition in &model.virtual_constraints {
            let row = self.dimensions.unknown();
            let what = format!("the condition `{}`", condition.text);
            for (k, f) in condition.one_form.iter().enumerate() {
                let expected = row.divided(&self.velocity(k));
                self.equal(&what, condition.span, *f, &expected, "its other terms by the displacement");
            }
        }
    }

    fn definitions(&mut self, definitions: &[DefinitionUnits]) {
        for DefinitionUnits { name, span, doc, entries } in definitions {
            self.documented(&format!("`{name}`"), Some(*span), doc, entries);
        }
    }

    /// Components whose documentation may say their unit.
    fn documented(&mut self, what: &str, span: Option<Span>, doc: &str, entries: &[ExprId]) {
        for (k, e) in entries.iter().enumerate() {
            let n = self.found.len();
            match unit_at(doc, k) {
                Some(unit) => {
                    self.equal(what, span, *e, &Form::of(unit.dimension()), "its documentation says");
                }
                None => _ = self.inside(what, span, *e),
            }
            if self.found.len() > n {
                return;
            }
        }
    }

    fn outputs(&mut self) {
        let model = self.model;
        for casimir in &model.casimirs {
            let span = model.places.outputs.get(&casimir.name).copied();
            self.documented(&format!("casimir `{}`", casimir.name), span, &casimir.doc, &[casimir.expr]);
        }
        for output in &model.outputs {
            let span = model.places.outputs.get(&output.name).copied();
            let entries: Vec<ExprId> = output.components.iter().map(|(_, e)| *e).collect();
            match output.part {
                OutputPart::Own => {
                    self.documented(&format!("output `{}`", output.name), span, &output.doc, &entries);
                }
                OutputPart::Poses
                | OutputPart::Twists
                | OutputPart::Bodies
                | OutputPart::CenterOfMass
                | OutputPart::CentroidalMomentum => {}
                OutputPart::Events => {
                    for (event, e) in model.events.iter().zip(entries) {
                        let _ = self.inside(&format!("event `{}`", event.name), event.span, e);
                    }
                }
                OutputPart::After => {
                    let of = |event: &&Event| Event::after(&event.name) == output.name;
                    let Some(event) = model.events.iter().find(of) else { continue };
                    for (symbol, e) in event.sets.iter().zip(entries) {
                        let expected = self.dimensions.of_symbol(*symbol);
                        let what =
                            format!("what event `{}` sets `{}` to", event.name, model.graph.name(*symbol));
                        self.equal(&what, event.span, e, &expected, "it is");
                    }
                }
            }
        }
    }

    /// Rates of reconstructed coordinates.
    fn reconstruction(&mut self) {
        for item in &self.model.reconstruction {
            let rates: Vec<ExprId> = match &item.kind {
                ReconstructionKind::Angle { omega } => vec![*omega],
                ReconstructionKind::PlanarPose { omega, v } => std::iter::once(*omega).chain(*v).collect(),
                ReconstructionKind::Translation { v } => v.clone(),
                ReconstructionKind::Rate { rate } => rate.clone(),
                // Of the four numbers of a quaternion none is an integral of one velocity.
                ReconstructionKind::Pose { omega: _, v } => v.to_vec(),
                ReconstructionKind::Quaternion { .. } | ReconstructionKind::Matrix { .. } => continue,
            };
            let n_skipped = item.symbols.len().saturating_sub(rates.len());
            let documented = units(&item.doc).len();
            for (k, (symbol, rate)) in item.symbols.iter().skip(n_skipped).zip(rates).enumerate() {
                let name = self.model.graph.name(*symbol).to_owned();
                let position = match (&item.kind, documented) {
                    // An angle first, and then places.
                    (ReconstructionKind::PlanarPose { .. }, 2..) => usize::from(k > 0),
                    (ReconstructionKind::PlanarPose { .. }, 1) if k == 0 => {
                        self.angle(*symbol);
                        continue;
                    }
                    (ReconstructionKind::Pose { .. }, _) => documented.saturating_sub(1),
                    _ => documented.saturating_sub(1).min(k),
                };
                self.declared(*symbol, &item.doc, position);
                let expected = self.dimensions.of_symbol(*symbol).divided(&self.second.clone());
                self.equal(&format!("the rate of `{name}`"), item.span, rate, &expected, "its unit gives");
            }
        }
    }

    /// Conditions that compare two quantities; a number may stand for a bound in the unit of the other side.
    fn conditions(&mut self) {
        let g = &self.model.graph;
        for condition in &self.model.conditions {
            let is_number = |e: ExprId| g.as_rational(e).is_some();
            let what = format!("`{}`", condition.text);
            if is_number(condition.greater) || is_number(condition.less) {
                continue;
            }
            let Some(less) = self.inside(&what, condition.span, condition.less) else { continue };
            self.equal(&what, condition.span, condition.greater, &less, "the other side");
        }
    }
    /// What is known of units; those that no doc comment says where they are to be inferred.
    fn units(&mut self, is_inferred: bool) -> Units {
        let model = self.model;
        let inferred = |check: &mut Self, form: &Form| {
            check.dimensions.known(form).filter(|_| is_inferred).map(Unit::inferred)
        };
        let mut units = Units::default();
        if has_seconds(model) {
            units.time = Unit::declared("s");
        }
        let energy = self.energy.clone();
        units.energy = inferred(self, &energy);
        let params = model.params.iter().chain(&model.inputs).map(|p| p.symbol);
        let base = model.base.iter().flat_map(|c| [c.symbol, c.velocity]);
        let velocities = model.velocities.iter().chain(&model.quasi_velocities).map(|v| v.symbol);
        let advected = model.advected.iter().flat_map(|a| a.components.iter().map(|(_, symbol)| *symbol));
        let momenta = model.momenta.iter().flat_map(|m| m.components.iter().map(|(_, symbol, _)| *symbol));
        let group = model.reconstruction.iter().flat_map(|item| item.symbols.iter().copied());
        let first_order =
            model.first_order.iter().flat_map(|s| s.components.iter().map(|(_, symbol)| *symbol));
        let state = base.chain(velocities).chain(advected).chain(first_order);
        for symbol in params.chain(state).chain(momenta).chain(group) {
            let form = self.dimensions.of_symbol(symbol);
            if let Some(unit) = self.declared.get(&symbol).cloned().or_else(|| inferred(self, &form)) {
                units.of_name.insert(model.graph.name(symbol).to_owned(), unit);
            }
        }
        let casimirs = model.casimirs.iter().map(|c| (&c.name, &c.doc, vec![c.expr]));
        let own = model.outputs.iter().filter(|o| o.part == OutputPart::Own);
        let outputs = own.map(|o| (&o.name, &o.doc, o.components.iter().map(|(_, e)| *e).collect()));
        for (name, doc, entries) in casimirs.chain(outputs) {
            let unit = |(k, e): (usize, &ExprId)| {
                unit_at(doc, k).or_else(|| {
                    let form = self.dimensions.of(&model.graph, *e, &mut Vec::new())?;
                    inferred(self, &form)
                })
            };
            let of_components = entries.iter().enumerate().map(unit).collect();
            units.of_output.insert(name.clone(), of_components);
        }
        units
    }
}
