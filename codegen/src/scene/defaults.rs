//! Warnings about what a model is at its own defaults: expressions without a value, inertias that vanish, rates that
//! are not finite where its `initial` state is.
//!
//! Such a model may be meant: parameters are given where it is used. Whoever only changes one of them finds it useless.
//!
//! Deliberately does not know: how anything is derived or lowered, who shows warnings.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Node, Style, SymbolId, inlined, rational_to_f64};
use hamel_lang::spec::{ConstraintKind, Diagnostic, Diagnostics, ExpressionRole, Model, Span};

use super::built::BuiltScene;
use super::interpreter::Interpreter;
use super::start::start;

/// Symbols and values that are told in a message, and characters of an expression.
const MAX_NAMED: usize = 4;
const MAX_SHOWN: usize = 60;

/// What the defaults of the parameters, and the initial state where the model gives one, make of scenes: one warning
/// for each expression without a finite value; where there is none, one for the first pivot that vanishes or is not
/// finite, and for a rate that is not finite.
///
/// [`Model::warnings`] has what shows without any scene.
pub fn warnings(model: &Model, scenes: &[BuiltScene]) -> Diagnostics {
    let mut list: Vec<Diagnostic> = Vec::new();
    for scene in scenes {
        let own = model.scenes.iter().find(|own| own.name == scene.name && !own.fixed.is_empty());
        for warning in Defaults::new(model, scene).warnings() {
            if !list.iter().any(|known| known.span == warning.span && known.message == warning.message) {
                list.push(warning.with_place(own.and_then(|own| own.span), "in this scene"));
            }
        }
    }
    model.diagnostics(list)
}

/// The initial state of a scene, as [`start`] finds it.
///
/// # Errors
/// As [`start`].
pub fn initial_state(model: &Model, scene: &BuiltScene) -> Result<Option<Vec<f64>>, Error> {
    Ok(start(model, scene)?.map(|found| found.state))
}

struct Defaults<'a> {
    model: &'a Model,
    scene: &'a BuiltScene,
    /// Values of parameters.
    params: BTreeMap<SymbolId, f64>,
    /// The same with those of what the model gives initial values of, and time zero.
    start: BTreeMap<SymbolId, f64>,
}

/// Something written in the model: what it is called, where it stands, its expressions.
struct Item {
    what: String,
    span: Option<Span>,
    roots: Vec<ExprId>,
}

impl<'a> Defaults<'a> {
    fn new(model: &'a Model, scene: &'a BuiltScene) -> Defaults<'a> {
        let own = model.scenes.iter().find(|own| own.name == scene.name);
        let fixed: BTreeMap<&str, f64> = own.map_or_else(BTreeMap::new, |own| {
            own.fixed.iter().map(|(name, value)| (name.as_str(), rational_to_f64(value))).collect()
        });
        let default = |name: &str, value| fixed.get(name).copied().unwrap_or(value);
        let params: BTreeMap<SymbolId, f64> =
            model.params.iter().map(|p| (p.symbol, default(&p.name, rational_to_f64(&p.default)))).collect();
        let quasi = model.quasi_velocities.iter().map(|v| (v.name.as_str(), v.symbol));
        let base = model.base.iter().map(|c| (c.name.as_str(), c.symbol));
        let advected = model.advected.iter().flat_map(|a| &a.components).map(|(n, s)| (n.as_str(), *s));
        let momenta = model.momenta.iter().flat_map(|m| &m.components).map(|(n, s, _)| (n.as_str(), *s));
        let velocities = model.all_velocities().into_iter().chain(quasi);
        let carried = model.constraints.iter().filter_map(|constraint| match &constraint.kind {
            ConstraintKind::ThirdOrder { carried, .. } => Some((carried.name.as_str(), carried.symbol)),
            ConstraintKind::Linear | ConstraintKind::Nonlinear | ConstraintKind::SecondOrder { .. } => None,
        });
        let first_order = model.first_order.iter().flat_map(|s| &s.components).map(|(n, x)| (n.as_str(), *x));
        let symbols: BTreeMap<&str, SymbolId> =
            velocities.chain(momenta).chain(base).chain(advected).chain(first_order).chain(carried).collect();
        let mut start = params.clone();
        for (name, value) in &model.initial {
            let value = model.graph.eval_f64(*value, &params);
            start.extend(symbols.get(name.as_str()).copied().zip(value));
        }
        start.insert(model.time, 0.0);
        start.extend(model.inputs.iter().map(|i| (i.symbol, default(&i.name, rational_to_f64(&i.default)))));
        Defaults { model, scene, params, start }
    }

    fn warnings(&self) -> Vec<Diagnostic> {
        let undefined = self.undefined();
        if !undefined.is_empty() {
            return undefined;
        }
        self.at_defaults().or_else(|| self.at_start()).into_iter().collect()
    }

    /// Expressions of the model whose parts have values and that have none.
    fn undefined(&self) -> Vec<Diagnostic> {
        let mut g = self.model.graph.clone();
        let (mut told, mut list) = (BTreeSet::new(), Vec::new());
        for Item { what, span, roots } in items(self.model) {
            let known = g.eval_known(&roots, &self.start);
            for e in g.reachable(&roots) {
                for (e, value) in self.without_value(&mut g, e, &known) {
                    if !told.insert(e) {
                        continue;
                    }
                    let text = shortened(g.display(e, Style::Plain));
                    let value = if value.is_nan() { "not a number" } else { "not finite" };
                    let message = format!("`{text}` in {what} is {value} {}", self.place(&g, e));
                    list.push(self.warning(span, message, &g, e));
                }
            }
        }
        list
    }

    /// What has no finite value in a node whose operands have: powers of its factors, or itself.
    fn without_value(&self, g: &mut Graph, e: ExprId, known: &BTreeMap<ExprId, f64>) -> Vec<(ExprId, f64)> {
        let is_finite = |e: &ExprId| known.get(e).is_some_and(|value| value.is_finite());
        let mut found = Vec::new();
        if let Node::Product { factors, .. } = g.node(e).clone() {
            // A factor is a power of an operand, and has a value where the product has none yet.
            for (base, exponent) in factors.iter().filter(|(base, _)| is_finite(base)) {
                let Ok(power) = g.pow(*base, exponent) else { continue };
                let value = g.eval_f64(power, &self.start);
                found.extend(value.filter(|value| !value.is_finite()).map(|value| (power, value)));
            }
        }
        let mut all_finite = found.is_empty();
        g.node(e).for_each_operand(|part| all_finite &= is_finite(&part));
        let own = known.get(&e).filter(|value| all_finite && !value.is_finite());
        found.extend(own.map(|value| (e, *value)));
        found
    }

    /// Of the part that is computed once.
    fn at_defaults(&self) -> Option<Diagnostic> {
        let lagrangian = self.model.places.lagrangian;
        let values: Vec<f64> = self.scene.params().iter().map(|p| self.params[&p.symbol]).collect();
        match self.scene.program.prepare(&values) {
            Err(bad) => match self.scene.equations.pivots.iter().find(|p| bad.condition == not_zero(&p.name))
            {
                Some(pivot) => Some(self.pivot(&pivot.name, pivot.expr)),
                None => {
                    let message = format!("{} does not hold at the defaults", bad.condition);
                    Some(Diagnostic::warning(lagrangian, message).with_help(HELP))
                }
            },
            Ok(prepared) => {
                let k = prepared.iter().position(|value| !value.is_finite())?;
                let named = self.scene.program.prepare.slots[k].name.as_ref();
                let what = named.map_or_else(String::new, |name| format!(" `{name}`"));
                let message =
                    format!("a number{what} made of parameters alone is not finite at the defaults");
                Some(Diagnostic::warning(lagrangian, message).with_help(HELP))
            }
        }
    }

    /// At the initial state, if the model has one for all variables of the scene.
    fn at_start(&self) -> Option<Diagnostic> {
        let values: Vec<f64> = self.scene.params().iter().map(|p| self.params[&p.symbol]).collect();
        let interpreter = self.scene.prepare(&values).ok()?;
        let state = self.with_momenta(&interpreter, self.state()?)?;
        if let Err(name) = interpreter.check(0.0, &state) {
            let pivot = self.scene.equations.pivots.iter().find(|p| p.name == name);
            return Some(pivot.map_or_else(
                || self.divisor(&name, &interpreter, &state),
                |pivot| self.pivot(&pivot.name, pivot.expr),
            ));
        }
        let mut rates = vec![0.0; state.len()];
        interpreter.rhs(0.0, &state, &mut rates);
        let k = rates.iter().position(|rate| !rate.is_finite())?;
        let name = &self.scene.state[k].name;
        let message = format!("the rate of `{name}` is not finite at the initial state");
        let span = of_component(&self.model.places.initial, name).or(self.model.places.lagrangian);
        Some(Diagnostic::warning(span, message).with_help(HELP_AT_START))
    }

    /// The initial state of the model, with zero for momenta that it does not give.
    fn state(&self) -> Option<Vec<f64>> {
        let legendre = self.scene.legendre();
        let is_momentum = |name: &str| legendre.momenta.iter().any(|(own, _)| own == name);
        let state = self.scene.state.iter();
        let given = |s: &SymbolId| self.start.get(s).copied();
        state.map(|s| given(&s.symbol).or_else(|| is_momentum(&s.name).then_some(0.0))).collect()
    }

    /// The state with momenta by the velocities of the model, where it does not give the momenta.
    fn with_momenta(&self, interpreter: &Interpreter<'_>, mut state: Vec<f64>) -> Option<Vec<f64>> {
        let legendre = self.scene.legendre();
        let given = |s: &SymbolId| self.start.get(s).copied();
        if self.scene.state.iter().all(|s| given(&s.symbol).is_some()) {
            return Some(state);
        }
        let velocities: Option<Vec<f64>> = legendre.velocities.iter().map(|(_, s)| given(s)).collect();
        let momenta = interpreter.legendre(0.0, &state, &velocities?)?;
        for ((name, _), value) in legendre.momenta.iter().zip(momenta) {
            let at = self.scene.state.iter().position(|s| s.name == *name)?;
            state[at] = value;
        }
        Some(state)
    }

    /// Something else that rates are divided by and that is not there at the initial state.
    fn divisor(&self, name: &str, interpreter: &Interpreter<'_>, state: &[f64]) -> Diagnostic {
        let value = interpreter.pivots(0.0, state).into_iter().find(|(own, ..)| *own == name);
        let is_finite = value.is_some_and(|(_, value, _)| value.is_finite());
        let what = if is_finite { "vanishes" } else { "is not finite" };
        let message = format!("`{name}`, which rates are divided by, {what} at the initial state");
        let places = &self.model.places;
        let span = places.initial.values().min().copied().or(places.lagrangian);
        Diagnostic::warning(span, message).with_help(HELP_AT_START)
    }

    /// A pivot that is not there.
    fn pivot(&self, name: &str, e: ExprId) -> Diagnostic {
        let equations = &self.scene.equations;
        let mut g = equations.system.graph.clone();
        let values = inlined(&mut g, equations.sections.iter().flat_map(|s| &s.definitions));
        let e = g.subs(e, &values).unwrap_or(e);
        let value = match g.eval_f64(e, &self.start) {
            Some(value) if value.is_finite() => format!("is {value}"),
            _ => "is not finite".to_owned(),
        };
        let own = g.free_symbols(e);
        // Where one parameter alone is the reason, that is the place.
        let reason = match own.iter().collect::<Vec<_>>()[..] {
            [symbol] => self.declared(&g, *symbol),
            _ => None,
        };
        let constraint = self.model.constraints.iter().find(|c| name.ends_with(&c.text));
        let span = reason.or(constraint.and_then(|c| c.span)).or(self.model.places.lagrangian);
        let message = format!("{name} {value} {}", self.place(&g, e));
        self.warning(span, message, &g, e)
    }

    /// A warning with the places of the parameters and initial values in an expression.
    fn warning(&self, span: Option<Span>, message: String, g: &Graph, e: ExprId) -> Diagnostic {
        let symbols = g.free_symbols(e);
        let is_of_params = symbols.iter().all(|s| self.params.contains_key(s));
        let help = match (symbols.is_empty(), is_of_params) {
            (true, _) => "write something that has a finite value",
            (_, true) => HELP,
            (_, false) => HELP_AT_START,
        };
        let mut warning = Diagnostic::warning(span, message).with_help(help);
        let mut told: BTreeSet<Span> = span.into_iter().collect();
        for symbol in symbols.into_iter().take(MAX_NAMED) {
            let place = self.declared(g, symbol).filter(|place| told.insert(*place));
            let is_param = self.params.contains_key(&symbol);
            warning = warning.with_place(place, if is_param { "declared here" } else { "given here" });
        }
        warning
    }

    /// Where the value of a symbol is given.
    fn declared(&self, g: &Graph, symbol: SymbolId) -> Option<Span> {
        let places = &self.model.places;
        let list = if self.params.contains_key(&symbol) { &places.declared } else { &places.initial };
        of_component(list, g.name(symbol))
    }

    /// `at the defaults: a = -1`.
    fn place(&self, g: &Graph, e: ExprId) -> String {
        let symbols = g.free_symbols(e);
        let at = match symbols.iter().all(|s| self.params.contains_key(s)) {
            true => "at the defaults",
            false => "at the initial state",
        };
        let given: Vec<String> =
            symbols.iter().filter_map(|s| Some(format!("{} = {}", g.name(*s), self.start.get(s)?))).collect();
        let more = if given.len() > MAX_NAMED { ", .." } else { "" };
        let given = given[..given.len().min(MAX_NAMED)].join(", ");
        if given.is_empty() { "whatever the parameters".to_owned() } else { format!("{at}: {given}{more}") }
    }
}

const HELP: &str = "change the defaults; a `where` condition says which values are allowed";

const HELP_AT_START: &str = "no motion begins there: give another initial state, or other defaults";

/// The condition of a program that a pivot is there.
pub(super) fn not_zero(pivot: &str) -> String {
    format!("{pivot} != 0")
}

/// Everything of a model that has values: expressions that belong together, what they are and where they stand.
fn items(model: &Model) -> Vec<Item> {
    let mut list: Vec<(ExpressionRole, Item)> = Vec::new();
    for (role, e) in model.expressions() {
        // The parts of a constraint are told as one.
        let role = match role {
            ExpressionRole::ConstraintAcceleration(k) | ExpressionRole::ConstraintPosition(k) => {
                ExpressionRole::ConstraintResidual(k)
            }
            _ => role,
        };
        match list.last_mut() {
            Some((last, item)) if *last == role => item.roots.push(e),
            _ => {
                list.extend(item(model, role).map(|(what, span)| (role, Item { what, span, roots: vec![e] })))
            }
        }
    }
    list.into_iter().map(|(_, item)| item).collect()
}

/// What an expression of a model is called, and where it stands; none for what is told elsewhere.
fn item(model: &Model, role: ExpressionRole) -> Option<(String, Option<Span>)> {
    let places = &model.places;
    let output_span = |name: &str| places.outputs.get(name).copied();
    Some(match role {
        ExpressionRole::Lagrangian => ("the lagrangian".into(), places.lagrangian),
        ExpressionRole::Hamiltonian => ("the hamiltonian".into(), places.lagrangian),
        ExpressionRole::Noise(k) => {
            let noise = &model.noises[k];
            let span = noise.hamiltonian.and_then(|(_, span)| span);
            (noise.function(), span)
        }
        ExpressionRole::ConstraintResidual(k)
        | ExpressionRole::ConstraintPosition(k)
        | ExpressionRole::ConstraintAcceleration(k) => {
            let constraint = &model.constraints[k];
            (format!("constraint `{}`", constraint.text), constraint.span)
        }
        // It has values where the others hold.
        ExpressionRole::Implied(_) => return None,
        ExpressionRole::VirtualConstraint(k) => {
            let condition = &model.virtual_constraints[k];
            (format!("condition `{}`", condition.text), condition.span)
        }
        ExpressionRole::Force(k) => {
            let (name, _) = model.all_velocities()[k];
            (format!("the force on `{name}`"), of_component(&places.forces, name))
        }
        ExpressionRole::Algebroid => ("the algebroid".into(), model.algebroid.as_ref().and_then(|a| a.span)),
        ExpressionRole::Frame => ("the frame".into(), model.frame.as_ref().and_then(|f| f.span)),
        ExpressionRole::Given(k) => {
            let (name, _) = model.all_velocities()[k];
            (format!("the motion of `{name}`"), of_component(&places.given, name))
        }
        ExpressionRole::Connection => ("the connection".into(), places.connection),
        ExpressionRole::AdvectedAction(k) => {
            let advected = &model.advected[k];
            (format!("the action on `{}`", advected.name), advected.span)
        }
        ExpressionRole::DomainEnd(k) => {
            let name = model.name_of_domain(k);
            (format!("the domain of `{name}`"), places.declared.get(name).copied())
        }
        ExpressionRole::FirstOrderRate(k) => {
            let state = &model.first_order[k];
            (format!("the rate of `{}`", state.name), state.of_rate)
        }
        ExpressionRole::Ideal => (
            "an ideal of a stage".into(),
            model.stages.as_ref().and_then(|s| s.spans.get(1).copied().flatten()),
        ),
        ExpressionRole::StageConnection => ("the connection of a stage".into(), places.connection),
        ExpressionRole::InnerProduct => ("the inner product".into(), places.inner_product),
        ExpressionRole::Casimir(k) => {
            let name = &model.casimirs[k].name;
            (format!("casimir `{name}`"), output_span(name))
        }
        ExpressionRole::QuasiInvariance(k) => {
            let own = &model.quasi_invariances[k];
            (format!("the function that the momentum `{}` is up to", own.parameter), own.span)
        }
        ExpressionRole::Output(k) => {
            let name = &model.outputs[k].name;
            (format!("output `{name}`"), output_span(name))
        }
        ExpressionRole::Lyapunov => {
            let own = model.lyapunov.as_ref()?;
            (format!("the Lyapunov function `{}`", own.name), own.span)
        }
        ExpressionRole::Impact(k) => {
            let event = &model.events[k];
            (format!("the impact of event `{}`", event.name), event.span)
        }
        ExpressionRole::Section(k) => {
            let name = &model.sections[k].name;
            (format!("section `{name}`"), output_span(name))
        }
        ExpressionRole::Reconstruction(k) => {
            let item = &model.reconstruction[k];
            (format!("the rate of `{}`", item.names.join("`, `")), item.span)
        }
        ExpressionRole::Condition(_) | ExpressionRole::Initial(_) => return None,
    })
}

/// The place of a name, or of the vector that it is a component of.
fn of_component(places: &BTreeMap<String, Span>, name: &str) -> Option<Span> {
    let vector = name.trim_end_matches(|c: char| c.is_ascii_digit());
    places.get(name).or_else(|| places.get(vector)).copied()
}

fn shortened(text: String) -> String {
    match text.char_indices().nth(MAX_SHOWN) {
        Some((at, _)) => format!("{} ..", &text[..at]),
        None => text,
    }
}
