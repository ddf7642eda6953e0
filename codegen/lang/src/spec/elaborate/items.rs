//! Items that use values: everything between the declarations and reconstruction.
//!
//! Deliberately does not know: in which order names become known.

use super::values::Elaboration;
use crate::spec::ast::{Act, Carry, Comparison, EventItem, Expr, Item, ItemKind, Name, ReducesItem};
use crate::spec::builder::{CarryDraft, EventSet, FIELD, ModeAct, Placement};
use crate::spec::discrete::Retraction;
use crate::spec::eval::is_poisoned;
use crate::spec::model::{ConnectionKind, FormulationSearch};
use crate::spec::names;
use crate::spec::total::{Image, Total};
use crate::spec::value::Value;

impl Elaboration<'_> {
    pub(super) fn use_values(&mut self, item: &Item) {
        let span = Some(item.span);
        self.builder.within(item.mode.as_ref().map(|mode| mode.text.as_str()));
        match &item.kind {
            ItemKind::Param { name, conditions, .. } => {
                if !self.poisoned.contains(&name.text) {
                    conditions.iter().for_each(|c| self.condition(c));
                }
            }
            ItemKind::Require(conditions) => conditions.iter().for_each(|c| self.condition(c)),
            ItemKind::Stage { name, ideal, connections } => {
                match ideal {
                    None => _ = self.builder.at(Some(name.span)).stage(&name.text),
                    Some(ideal) => {
                        let values: Vec<Option<Value>> = ideal.iter().map(|e| self.eval(e)).collect();
                        match values.into_iter().collect::<Option<Vec<Value>>>() {
                            Some(values) => _ = self.builder.at(span).stage_ideal(&name.text, &values),
                            None => _ = self.builder.broken.insert("stage"),
                        }
                    }
                }
                for (velocity, value) in connections {
                    if let Some(value) = self.eval(value) {
                        let builder = self.builder.at(Some(velocity.span));
                        builder.stage_connection(&name.text, &velocity.text, &value);
                    }
                }
            }
            ItemKind::LagrangianInnerProduct => {
                self.builder.at(span).inner_product_of_lagrangian();
            }
            ItemKind::InnerProduct(expr) => {
                if let Some(value) = self.eval(expr) {
                    self.builder.at(Some(expr.span)).inner_product(&value);
                }
            }
            ItemKind::Advected { name, action, .. } => match self.action_on(name, action) {
                Some(value) => _ = self.builder.at(Some(action.span)).advected_action(&name.text, &value),
                None => _ = self.builder.broken.insert("advected"),
            },
            ItemKind::State { name, .. } if self.poisoned.contains(&name.text) => {}
            ItemKind::State { name, rate: (rate, value), .. } => {
                match self.builder.value(&rate.text).cloned().filter(|_| !self.poisoned.contains(&rate.text))
                {
                    Some(of_rate) => _ = self.builder.at(Some(value.span)).state_rate(&name.text, &of_rate),
                    None => _ = self.builder.broken.insert("state"),
                }
            }
            ItemKind::Lagrangian(expr) => match self.eval(expr) {
                Some(value) => _ = self.builder.at(Some(expr.span)).lagrangian(&value),
                None => _ = self.builder.broken.insert("lagrangian"),
            },
            ItemKind::Hamiltonian(expr) => match self.eval(expr) {
                Some(value) => _ = self.builder.at(Some(expr.span)).hamiltonian(&value),
                None => _ = self.builder.broken.insert("hamiltonian"),
            },
            ItemKind::Constraint { name, gives, left, right } => match self.equation(&["ddt"], left, right) {
                Some((l, r)) => {
                    let place = left.span.to(right.span);
                    let text = self.equation_text(left, right);
                    let name = name.as_ref().map(|n| n.text.as_str());
                    let gives = gives.iter().map(|n| (n.text.clone(), Some(n.span))).collect();
                    let builder = self.builder.at(Some(place));
                    builder.constraint(name, &text, &l, &r).located_solved_for(gives);
                }
                None => _ = self.builder.broken.insert("constraint"),
            },
            ItemKind::Coordinate { names, by: Some((left, right)), .. } => {
                match self.equation(&[], left, right) {
                    Some((l, r)) => {
                        let place = left.span.to(right.span);
                        let text = self.one_line(place);
                        let names: Vec<&str> = names.iter().map(|n| n.text.as_str()).collect();
                        self.builder.at(Some(place)).determined(&names, &text, &l, &r);
                    }
                    None => _ = self.builder.broken.insert("constraint"),
                }
            }
            ItemKind::VirtualThermo => _ = self.builder.at(span).virtual_thermo(),
            ItemKind::Virtual { name, left, right } => match self.equation(&["delta", "ddt"], left, right) {
                Some((l, r)) => {
                    let place = left.span.to(right.span);
                    let text = self.equation_text(left, right);
                    let name = name.as_ref().map(|n| n.text.as_str());
                    self.builder.at(Some(place)).virtual_constraint(name, &text, &l, &r);
                }
                None => _ = self.builder.broken.insert("virtual"),
            },
            ItemKind::Connection { name, value } => match self.eval(value) {
                Some(value) => _ = self.builder.at(Some(name.span)).connection(&name.text, &value),
                None => _ = self.builder.broken.insert("connection"),
            },
            ItemKind::DerivedConnection(name) => {
                if let Some(kind) = ConnectionKind::from_name(&name.text) {
                    self.builder.at(Some(name.span)).derived_connection(kind);
                }
            }
            ItemKind::Independent(names) => {
                let located = names.iter().map(|n| (n.text.clone(), Some(n.span))).collect();
                self.builder.at(span).located_independent(located);
            }
            ItemKind::Multipliers => _ = self.builder.at(span).multipliers(),
            ItemKind::Force { name, value } => {
                if let Some(value) = self.eval(value) {
                    self.builder.at(Some(name.span)).force(&name.text, &value);
                }
            }
            ItemKind::AppliedForce { is_place, on, value } => {
                let (place, force) = (self.eval(on), self.eval(value));
                if let (Some(place), Some(force)) = (place, force) {
                    let builder = self.builder.at(Some(on.span.to(value.span)));
                    _ = if *is_place {
                        builder.force_at(&place, &force)
                    } else {
                        builder.force_along(&place, &force)
                    };
                }
            }
            ItemKind::Actuate { name, along } => match self.eval(along) {
                Some(value) => _ = self.builder.actuated_along(&name.text, &value),
                None => _ = self.builder.broken.insert("actuate"),
            },
            ItemKind::Lyapunov { name, rate, .. } => self.lyapunov(item, name, rate.as_ref()),
            ItemKind::Casimir { name, value } => match self.eval(value) {
                Some(Value::Scalar(e)) => {
                    self.builder.at(Some(name.span)).casimir(
                        &name.text,
                        &Value::Scalar(e),
                        &item.doc.join("\n"),
                    );
                }
                Some(other) => {
                    let message =
                        format!("casimir `{}` must be a number, found {}", name.text, other.shape());
                    self.problem(value.span, message, "use `dot(a, b)` for the pairing of vectors");
                    self.builder.broken.insert("casimir");
                }
                None => _ = self.builder.broken.insert("casimir"),
            },
            ItemKind::Output { name, value } => match self.eval(value) {
                Some(value) => {
                    _ = self.builder.at(Some(name.span)).output(&name.text, &value, &item.doc.join("\n"))
                }
                None => _ = self.builder.broken.insert("output"),
            },
            ItemKind::Section { name, algebra, value } => {
                let along = match algebra {
                    Some(algebra) => self.algebra(algebra).map(Some),
                    None => Some(None),
                };
                let (along, value) = (along, self.located(value));
                match (along, value) {
                    (Some(algebra), Some((value, span))) => {
                        let builder = self.builder.at(Some(name.span));
                        builder.located_section(&name.text, algebra, (&value, span), &item.doc.join("\n"));
                    }
                    _ => _ = self.builder.broken.insert("section"),
                }
            }
            ItemKind::Acceleration { name, value } => match self.eval(value) {
                Some(value) => _ = self.builder.at(Some(name.span)).acceleration(&name.text, &value),
                None => _ = self.builder.broken.insert("acceleration"),
            },
            ItemKind::Field { name, value } => match self.eval(value) {
                Some(value) => _ = self.builder.at(Some(name.span)).field(&name.text, &value),
                None => _ = self.builder.broken.insert("field"),
            },
            ItemKind::Noise { name, value: Some(value) } => {
                if let Some(h) = self.eval(value) {
                    self.builder.at(Some(value.span)).noise_hamiltonian(&name.text, &h);
                }
            }
            ItemKind::Noise { value: None, .. } => {}
            ItemKind::Drive { name, value } => {
                if let Some((value, span)) = self.located(value) {
                    self.builder.at(Some(name.span)).located_drive(&name.text, (&value, span));
                }
            }
            ItemKind::Algebroid(block) => self.brackets_of_algebroid(block),
            ItemKind::Carry(list) => {
                let list = self.carries(list);
                self.builder.at(span).located_carries(list);
            }
            ItemKind::Want(list) => {
                for name in list {
                    self.builder.at(Some(name.span)).want_of_all_scenes(&name.text);
                }
            }
            ItemKind::Scene {
                name,
                fixed,
                inputs,
                wants,
                drops,
                circles,
                carries,
                formulation,
                discrete,
                retraction,
            } => {
                self.scene(item, name, fixed, [wants, drops, circles, inputs], carries);
                self.formulation(&name.text, formulation);
                self.discrete(&name.text, discrete, retraction);
            }
            ItemKind::Reduces(item) => self.reduces(item),
            ItemKind::Use(_)
            | ItemKind::Part { .. }
            | ItemKind::Source(_)
            | ItemKind::Topic(_)
            | ItemKind::Size { .. }
            | ItemKind::Input { .. }
            | ItemKind::Let { .. }
            | ItemKind::Body(_)
            | ItemKind::AlgebraName { .. }
            | ItemKind::AlgebraBrackets { .. }
            | ItemKind::Representation { .. }
            | ItemKind::Velocity { .. }
            | ItemKind::QuasiVelocity(_)
            | ItemKind::Frame(_)
            | ItemKind::NamedFrame { .. }
            | ItemKind::Momentum { .. }
            | ItemKind::MomentumIn { .. }
            | ItemKind::Action(_)
            | ItemKind::Configuration { .. }
            | ItemKind::Reconstruct { .. }
            | ItemKind::Initial { .. }
            | ItemKind::View { .. }
            | ItemKind::Mode(_)
            | ItemKind::Event(_)
            | ItemKind::Coordinate { by: None, .. } => {}
        }
    }

    /// A function whose value is a definition, and its rate.
    fn lyapunov(&mut self, item: &Item, name: &Name, rate: Option<&Expr>) {
        let known = self.builder.value(&name.text).cloned();
        let value = known.filter(|_| !self.poisoned.contains(&name.text));
        let rate = rate.map(|rate| self.eval(rate));
        match (value, rate) {
            (Some(value), None) => {
                let builder = self.builder.at(Some(name.span));
                builder.lyapunov(&name.text, &value, None, &item.doc.join("\n"));
            }
            (Some(value), Some(Some(rate))) => {
                let builder = self.builder.at(Some(name.span));
                builder.lyapunov(&name.text, &value, Some(&rate), &item.doc.join("\n"));
            }
            _ => _ = self.builder.broken.insert("lyapunov"),
        }
    }

    /// The functions are of another model: their texts are read there.
    fn reduces(&mut self, item: &ReducesItem) {
        let images = item.images.iter().map(|(name, value)| Image {
            name: name.text.clone(),
            components: Vec::new(),
            text: self.slice(value.span).to_owned(),
            places: Some((name.span, value.span)),
        });
        let images = images.collect();
        let total = Total { file: item.file.text.clone(), place: Some(item.file.span), origin: None, images };
        self.builder.located_reduces(total);
    }

    /// Events, which may mention multipliers of all constraints.
    pub(super) fn events(&mut self, items: &[Item]) {
        let events = || {
            items.iter().filter_map(|item| match &item.kind {
                ItemKind::Event(event) => Some((item, event)),
                _ => None,
            })
        };
        if events().next().is_some() {
            self.builder.declare_multipliers();
        }
        for (item, event) in events() {
            self.builder.within(item.mode.as_ref().map(|mode| mode.text.as_str()));
            self.event(event, &item.doc.join("\n"));
        }
        self.builder.within(None);
    }

    fn event(&mut self, event: &EventItem, doc: &str) {
        let EventItem { name, value, direction, sets, acts, stop } = event;
        let value = self.located(value);
        let sets: Vec<Option<_>> = sets
            .iter()
            .map(|(target, value)| {
                let (value, span) = self.located(value)?;
                Some(EventSet { target: (target.text.clone(), Some(target.span)), value, span })
            })
            .collect();
        let place = |name: &Name| (name.text.clone(), Some(name.span));
        let acts: Vec<Option<_>> = acts
            .iter()
            .map(|act| {
                Some(match act {
                    Act::Enter(mode) => ModeAct::Enter(place(mode)),
                    Act::Leave(mode) => ModeAct::Leave(place(mode)),
                    Act::Impact(mode, None) => ModeAct::Impact(place(mode), None),
                    Act::Impact(mode, Some(e)) => ModeAct::Impact(place(mode), Some(self.located(e)?)),
                })
            })
            .collect();
        let sets: Option<Vec<EventSet>> = sets.into_iter().collect();
        let acts: Option<Vec<ModeAct>> = acts.into_iter().collect();
        match (value, sets, acts) {
            (Some(value), Some(sets), Some(acts)) => {
                let builder = self.builder.at(Some(name.span));
                builder.located_event(&name.text, value, *direction, (sets, acts, stop.is_some()), doc);
            }
            _ => _ = self.builder.broken.insert("event"),
        }
    }

    fn condition(&mut self, comparison: &Comparison) {
        let sides: Vec<&Expr> =
            std::iter::once(&comparison.first).chain(comparison.rest.iter().map(|(_, e)| e)).collect();
        let values: Vec<Option<Value>> = sides.iter().map(|e| self.eval(e)).collect();
        let Some(values) = values.into_iter().collect::<Option<Vec<Value>>>() else { return };
        // A default that is already reported must not be compared.
        if sides.iter().any(|e| e.names().into_iter().any(|n| is_poisoned(n, &self.poisoned))) {
            return;
        }
        for (k, (compare, _)) in comparison.rest.iter().enumerate() {
            let span = sides[k].span.to(sides[k + 1].span);
            let text = match self.is_read_otherwise(span) {
                true => format!("{} {} {}", sides[k], compare, sides[k + 1]),
                false => self.one_line(span),
            };
            self.builder.at(Some(span)).condition(&text, &values[k], *compare, &values[k + 1]);
        }
    }

    /// Everything of the model is known where a view is evaluated.
    pub(super) fn view(&mut self, item: &Item) {
        let ItemKind::View { name, shape, arguments, around, at, attitude } = &item.kind else { return };
        let doc = item.doc.join("\n");
        if shape.text == FIELD {
            for part in [around, at, attitude].into_iter().flatten() {
                let help = "it is drawn on the torus: leave the place out";
                self.problem(part.span, "a field has no place in space".to_owned(), help);
            }
            if let Some((algebra, f)) = self.evaluator(&[], None).field_of(arguments, shape.span) {
                self.builder.at(Some(name.span)).field_view(&name.text, &algebra, &f, &doc);
            }
            return;
        }
        let arguments: Vec<Option<_>> = arguments.iter().map(|e| self.located(e)).collect();
        let mut is_complete = true;
        let [around, at, attitude] = [around, at, attitude].map(|part| {
            let value = self.located(part.as_ref()?);
            is_complete &= value.is_some();
            value
        });
        let Some(arguments) = arguments.into_iter().collect::<Option<Vec<_>>>().filter(|_| is_complete)
        else {
            return;
        };
        let shape = (shape.text.as_str(), Some(shape.span));
        let placement = Placement { around, at, attitude };
        self.builder.at(Some(name.span)).located_view(&name.text, shape, &arguments, placement, &doc);
    }

    /// Which formulation a scene asks for: said once, in the words there are.
    fn formulation(&mut self, scene: &str, said: &[(Name, Option<Name>)]) {
        if let [_, (again, _), ..] = said {
            let message = format!("scene `{scene}` says `formulation` twice");
            self.problem(again.span, message, "keep one of them");
        }
        let Some((word, inside)) = said.first() else { return };
        if word.text != "auto" {
            let help = names::suggest(&word.text, ["auto"]);
            self.problem(word.span, format!("unknown formulation `{}`", word.text), help);
            return;
        }
        let search = match inside {
            None => FormulationSearch::KeepingState,
            Some(inside) if inside.text == "state" => FormulationSearch::AnyState,
            Some(inside) => {
                let message = format!("a formulation cannot be searched with another `{}`", inside.text);
                self.problem(
                    inside.span,
                    message,
                    "`auto(state)` may change what the state is, `auto` may not",
                );
                return;
            }
        };
        self.builder.at(Some(word.span)).scene_formulation(scene, search);
    }

    /// The discrete principle of a scene and its retraction: each said once, in the words there are.
    fn discrete(&mut self, scene: &str, quadratures: &[Name], retractions: &[Name]) {
        for (word, said) in [("discrete", quadratures), ("retraction", retractions)] {
            if let [_, again, ..] = said {
                let message = format!("scene `{scene}` says `{word}` twice");
                self.problem(again.span, message, "keep one of them");
            }
        }
        let Some(quadrature) = quadratures.first() else {
            if let Some(name) = retractions.first() {
                let message = format!("scene `{scene}` has a retraction without discrete equations");
                self.problem(name.span, message, "add `discrete midpoint;`, or leave the retraction out");
            }
            return;
        };
        if quadrature.text != "midpoint" {
            let help = names::suggest(&quadrature.text, ["midpoint"]);
            self.problem(quadrature.span, format!("unknown quadrature `{}`", quadrature.text), help);
            return;
        }
        let retraction = match retractions.first() {
            None => None,
            Some(name) => match Retraction::from_name(&name.text) {
                Some(retraction) => Some(retraction),
                None => {
                    let help = names::suggest(&name.text, Retraction::ALL.map(Retraction::name));
                    self.problem(name.span, format!("unknown retraction `{}`", name.text), help);
                    return;
                }
            },
        };
        let place = retractions.first().unwrap_or(quadrature).span;
        self.builder.at(Some(place)).scene_discrete(scene, retraction);
    }

    /// `lists`: outputs wanted, coordinates left out, angles carried as points of the circle, inputs.
    fn scene(
        &mut self,
        item: &Item,
        name: &Name,
        fixed: &[(Name, Expr)],
        lists: [&[Name]; 4],
        carries: &[Carry],
    ) {
        let mut numbers = Vec::new();
        for (name, expr) in fixed {
            if let Some(values) = self.constant(expr, "parameters are fixed to numbers")
                && !is_poisoned(&name.text, &self.poisoned)
            {
                numbers.push((name.text.clone(), values, Some(name.span)));
            }
        }
        let located = |names: &[Name]| names.iter().map(|w| (w.text.clone(), Some(w.span))).collect();
        let lists = lists.map(located);
        let doc = item.doc.join("\n");
        let carries = self.carries(carries);
        let builder = self.builder.at(Some(name.span));
        builder.located_scene(&name.text, numbers, lists, carries, (&doc, Some(item.extent)));
    }

    fn carries(&mut self, list: &[Carry]) -> Vec<CarryDraft> {
        let located = |name: &Name| (name.text.clone(), Some(name.span));
        let mut drafts = Vec::new();
        for carry in list {
            drafts.push(match carry {
                Carry::Named(name) => CarryDraft::Named(located(name)),
                Carry::Level { cyclic, parameter, up_to } => {
                    let function = up_to.as_ref().map(|e| self.located(e));
                    // A function without a value is reported where it stands.
                    let Some(up_to) = function.map_or(Some(None), |value| value.map(Some)) else { continue };
                    CarryDraft::Level { cyclic: located(cyclic), parameter: located(parameter), up_to }
                }
                Carry::Momenta { velocity, momentum } => {
                    CarryDraft::Momenta { velocity: located(velocity), momentum: located(momentum) }
                }
            });
        }
        drafts
    }
}
