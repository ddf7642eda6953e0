//! Inputs: what moves a system from outside, and where a model may mention it.
//!
//! Nothing that the derivation differentiates along the motion may contain an input, for the rate of an input is not
//! known: forces, given rates, outputs, events and rates of reconstructed coordinates may.
//!
//! Deliberately does not know: when an input has which value.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::Zero;

use super::draft::{DeclaredAs, ModelBuilder, SceneDraft};
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::expressions::ExpressionRole;
use crate::spec::layout::{Layout, component_help};
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::value::Value;
use hamel_expr::{ExprId, Rational, SymbolId};

impl ModelBuilder {
    /// A number that moves the system from outside, with the value that it is held at where none is given.
    ///
    /// ```
    /// use hamel_lang::spec::{Layout, ModelBuilder, Rational};
    ///
    /// let mut b = ModelBuilder::new("m");
    /// let push = b.input("push", Rational::from_integer(0.into()), "force [N]");
    /// let pull = b.input_array("pull", Layout::Vector(2), &[Rational::from_integer(1.into())], "");
    /// assert_eq!((push.entries().len(), pull.entries().len()), (1, 2));
    /// let problems = b.build().unwrap_err().to_string();
    /// assert!(problems.contains("`pull` has 2 components, its default 1"));
    /// ```
    pub fn input(&mut self, name: &str, default: Rational, doc: &str) -> Value {
        self.check_range(name, &default);
        let (symbol, expr) = self.new_symbol(name, DeclaredAs::Input);
        self.input_blocks.insert(name.to_owned(), vec![self.inputs.len()]);
        self.inputs.push(Param { name: name.to_owned(), symbol, default, doc: doc.to_owned() });
        Value::Scalar(expr)
    }

    /// Inputs that form a vector or a matrix; the defaults are in the order of the components.
    pub fn input_array(&mut self, name: &str, layout: Layout, defaults: &[Rational], doc: &str) -> Value {
        self.declare(name, DeclaredAs::Input);
        let names = layout.names(name);
        if names.len() != defaults.len() {
            let message = format!("`{name}` has {} components, its default {}", names.len(), defaults.len());
            self.problem(self.here, message, component_help(&names));
        }
        let (mut components, mut positions) = (Vec::with_capacity(names.len()), Vec::new());
        let mut symbols = Vec::with_capacity(names.len());
        for (k, component) in names.iter().enumerate() {
            let (symbol, expr) = self.new_symbol(component, DeclaredAs::InputComponent);
            positions.push(self.inputs.len());
            self.input_blocks.insert(component.clone(), vec![self.inputs.len()]);
            let default = defaults.get(k).cloned().unwrap_or_else(Rational::zero);
            self.check_range(component, &default);
            self.inputs.push(Param { name: component.clone(), symbol, default, doc: doc.to_owned() });
            components.push(expr);
            symbols.push(symbol);
        }
        self.input_blocks.insert(name.to_owned(), positions);
        self.input_arrays.push(ParamArray { name: name.to_owned(), layout, symbols });
        let value = layout.assemble(&mut self.graph, &components);
        self.bind(name, &value);
        value
    }

    /// A value for an input (a vector or a component) in every scene: a function of time, coordinates, velocities,
    /// advected parameters and parameters. The model has that input no longer.
    pub fn drive(&mut self, name: &str, value: &Value) -> &mut Self {
        let here = self.here;
        self.located_drive(name, (value, here))
    }

    pub(in crate::spec) fn located_drive(
        &mut self,
        name: &str,
        (value, span): (&Value, Option<Span>),
    ) -> &mut Self {
        self.drives.push(((name.to_owned(), self.here), value.clone(), span));
        self
    }

    /// The value of each input that has one, and where that stands.
    pub(super) fn check_drives(&mut self) -> BTreeMap<SymbolId, (ExprId, Option<Span>)> {
        let inputs: BTreeSet<SymbolId> = self.inputs.iter().map(|input| input.symbol).collect();
        let mut driven = BTreeMap::new();
        for ((name, place), value, span) in std::mem::take(&mut self.drives) {
            let Some(positions) = self.input_blocks.get(&name).cloned() else {
                let help = names::suggest(&name, self.input_blocks.keys().map(String::as_str));
                self.problem(place, format!("`{name}` is driven, which is not an input"), help);
                continue;
            };
            if self.is_noise(&name) {
                let message = format!("`{name}` is driven, which is a noise");
                self.problem(place, message, "declare it with `input` to drive it");
                continue;
            }
            let declared = self.values.get(&name).map(Value::shape);
            if declared.is_some_and(|shape| shape != value.shape()) {
                let message = format!(
                    "`{name}` is {}, its value {}",
                    declared.map(|shape| shape.to_string()).unwrap_or_default(),
                    value.shape()
                );
                self.problem(
                    span,
                    message,
                    "drive it with a value of its shape, or its components one by one",
                );
                continue;
            }
            // Components are entries of the value at the places that they have in the declared one.
            let own = self.values.get(&name).map(|own| own.entries().to_vec()).unwrap_or_default();
            for k in positions {
                let Param { name: component, symbol, .. } = self.inputs[k].clone();
                let e = self.graph.sym(symbol);
                let Some(entry) =
                    own.iter().position(|x| *x == e).and_then(|at| value.entries().get(at)).copied()
                else {
                    continue;
                };
                let what = format!("the value of `{component}`");
                if let Some(other) = self.graph.free_symbols(entry).iter().find(|s| inputs.contains(s)) {
                    let message = format!("{what} contains the input `{}`", self.graph.name(*other));
                    self.problem(span, message, "an input is driven by time and state: write it out");
                } else if !self.reports_stray(entry, span, &what, &[])
                    && driven.insert(symbol, (entry, span)).is_some()
                {
                    self.problem(place, format!("`{component}` is driven twice"), "keep one of them");
                }
            }
        }
        driven
    }

    /// Inputs that a scene takes as such, by name; it holds the others at their defaults.
    pub fn scene_inputs(&mut self, scene: &str, names: &[&str]) -> &mut Self {
        let here = self.here;
        match self.scenes.iter_mut().find(|s| s.scene.name == scene) {
            Some(draft) => draft.inputs.extend(names.iter().map(|n| ((*n).to_owned(), here))),
            None => self.problem(here, format!("`{scene}` is not a scene"), "declare it first"),
        }
        self
    }

    /// The components of the inputs that a scene takes, in the order of the model.
    pub(super) fn check_scene_inputs(&mut self, draft: &SceneDraft) -> Vec<String> {
        let scene = &draft.scene.name;
        let mut taken = BTreeSet::new();
        for (name, span) in &draft.inputs {
            let Some(positions) = self.input_blocks.get(name).cloned() else {
                let help = names::suggest(name, self.input_blocks.keys().map(String::as_str));
                let message = format!("scene `{scene}` takes `{name}`, which is not an input");
                self.problem(*span, message, help);
                continue;
            };
            for k in positions {
                if !taken.insert(k) {
                    let message = format!("scene `{scene}` takes `{}` twice", self.inputs[k].name);
                    self.problem(*span, message, "keep one of them");
                }
            }
        }
        taken.into_iter().map(|k| self.inputs[k].name.clone()).collect()
    }
}

/// Puts the values of driven inputs in their place; what is wrong with them otherwise.
pub(super) fn close(
    model: &mut Model,
    driven: &BTreeMap<SymbolId, (ExprId, Option<Span>)>,
) -> Option<Diagnostic> {
    if driven.is_empty() {
        return None;
    }
    let values: BTreeMap<SymbolId, ExprId> = driven.iter().map(|(s, (e, _))| (*s, *e)).collect();
    let (graph, expressions) = model.expressions_mut();
    for (_, e) in expressions {
        let Ok(value) = graph.subs(*e, &values) else {
            let span = driven.values().find_map(|(_, span)| *span);
            let problem = Diagnostic::new(span, "a driven input makes the model divide by zero");
            return Some(problem.with_help("drive it with another value"));
        };
        *e = value;
    }
    let is_driven = |name: &String| {
        model.inputs.iter().any(|input| input.name == *name && driven.contains_key(&input.symbol))
    };
    for scene in &mut model.scenes {
        scene.inputs.retain(|name| !is_driven(name));
        scene.fixed.retain(|(name, _)| !is_driven(name));
    }
    model.inputs.retain(|input| !driven.contains_key(&input.symbol));
    None
}

/// One problem for each item that contains an input and would have to be differentiated.
pub(super) fn misplaced_inputs(model: &Model) -> Vec<Diagnostic> {
    let inputs: BTreeSet<SymbolId> = model.inputs.iter().map(|input| input.symbol).collect();
    if inputs.is_empty() {
        return Vec::new();
    }
    let mut problems: Vec<Diagnostic> = Vec::new();
    for (role, e) in model.expressions() {
        let found = model.graph.free_symbols(e).into_iter().find(|s| inputs.contains(s));
        let (Some(input), Some((what, span, help))) = (found, refused(model, role)) else { continue };
        let message = format!("{what} contains the input `{}`", model.graph.name(input));
        let problem = Diagnostic::new(span, message).with_help(help);
        if !problems.iter().any(|p| p.span == problem.span && p.message == problem.message) {
            problems.push(problem);
        }
    }
    for view in &model.views.list {
        let free = view.numbers().into_iter().flat_map(|e| model.views.graph.free_symbols(e));
        // Symbols that were there before the views are those of the model.
        if let Some(input) = free.into_iter().find(|s| inputs.contains(s)) {
            let message = format!("view `{}` contains the input `{}`", view.name, model.graph.name(input));
            problems.push(Diagnostic::new(view.span, message).with_help("a view shows a state"));
        }
    }
    problems
}

/// What an expression is, where it stands, and what to write instead; none where inputs are allowed.
fn refused(model: &Model, role: ExpressionRole) -> Option<(String, Option<Span>, &'static str)> {
    const FORCE: &str = "an input acts by `force`: the equations of a Lagrangian would need the input's rate";
    const CONSTRAINT: &str = "the reaction would need the input's rate: let the input be the acceleration, \
                              `ddt(v) = u`, or give the whole motion by `field`; what has inertia in nothing is \
                              a `state`, as in `state i in real by i_dot = (u - R*i)/L;`";
    const PLACE: &str =
        "inputs are for `force`, `acceleration`, `field`, `state`, `output`, `event` and `reconstruct .. by`";
    let places = &model.places;
    let of_constraint = |k: usize| {
        let constraint = &model.constraints[k];
        (format!("constraint `{}`", constraint.text), constraint.span, CONSTRAINT)
    };
    Some(match role {
        ExpressionRole::Force(_)
        | ExpressionRole::FirstOrderRate(_)
        | ExpressionRole::Given(_)
        | ExpressionRole::Output(_)
        | ExpressionRole::Lyapunov
        | ExpressionRole::Impact(_)
        | ExpressionRole::Reconstruction(_) => return None,
        ExpressionRole::ConstraintResidual(k) => match model.constraints[k].kind {
            ConstraintKind::SecondOrder { .. } => return None,
            // Beside fields it gives a velocity, and nothing reacts.
            ConstraintKind::Linear if model.given.is_some() && model.constraints[k].position.is_none() => {
                return None;
            }
            ConstraintKind::Linear | ConstraintKind::Nonlinear | ConstraintKind::ThirdOrder { .. } => {
                of_constraint(k)
            }
        },
        ExpressionRole::ConstraintAcceleration(k) | ExpressionRole::ConstraintPosition(k) => of_constraint(k),
        ExpressionRole::Implied(k) => {
            let implied = &model.implied[k];
            (format!("constraint `{}`", implied.text), implied.span, PLACE)
        }
        ExpressionRole::Lagrangian => ("the Lagrangian".to_owned(), places.lagrangian, FORCE),
        ExpressionRole::Hamiltonian => ("the Hamiltonian".to_owned(), places.lagrangian, FORCE),
        ExpressionRole::Noise(k) => {
            let noise = &model.noises[k];
            let span = noise.hamiltonian.and_then(|(_, span)| span);
            (noise.function(), span, "it is a function of the state, the time and parameters")
        }
        ExpressionRole::DomainEnd(k) => {
            let name = model.name_of_domain(k);
            (format!("the interval of `{name}`"), places.declared.get(name).copied(), PLACE)
        }
        ExpressionRole::Condition(k) => {
            let condition = &model.conditions[k];
            (format!("condition `{}`", condition.text), condition.span, PLACE)
        }
        ExpressionRole::AdvectedAction(k) => {
            let advected = &model.advected[k];
            (format!("the action on `{}`", advected.name), advected.span, PLACE)
        }
        ExpressionRole::Connection => ("the connection".to_owned(), places.connection, PLACE),
        ExpressionRole::Algebroid => {
            ("the algebroid".to_owned(), model.algebroid.as_ref().and_then(|a| a.span), PLACE)
        }
        ExpressionRole::Frame => ("the frame".to_owned(), model.frame.as_ref().and_then(|f| f.span), PLACE),
        ExpressionRole::VirtualConstraint(k) => {
            let condition = &model.virtual_constraints[k];
            (format!("condition `{}`", condition.text), condition.span, PLACE)
        }
        ExpressionRole::Casimir(k) => {
            let name = &model.casimirs[k].name;
            (format!("casimir `{name}`"), places.outputs.get(name).copied(), PLACE)
        }
        ExpressionRole::QuasiInvariance(k) => {
            let own = &model.quasi_invariances[k];
            let what = format!("the function that the momentum `{}` is up to", own.parameter);
            (what, own.span, "its rate would need the input's: take another part of the force into it")
        }
        ExpressionRole::Section(k) => {
            let section = &model.sections[k];
            (format!("section `{}`", section.name), section.span, PLACE)
        }
        ExpressionRole::Ideal | ExpressionRole::StageConnection => {
            let span = model.stages.as_ref().and_then(|chain| chain.spans.iter().flatten().next().copied());
            ("a stage".to_owned(), span, PLACE)
        }
        ExpressionRole::InnerProduct => ("the inner product".to_owned(), places.inner_product, PLACE),
        ExpressionRole::Initial(k) => {
            let name = &model.initial[k].0;
            (format!("the initial value of `{name}`"), places.initial.get(name).copied(), PLACE)
        }
    })
}
