//! Parameters, inputs, velocities, coordinates and advected parameters.
//!
//! Deliberately does not know: definitions, what the variables are used for.

use num_traits::Zero;

use super::reconstruction::matrices_of;
use super::values::Elaboration;
use crate::algebra::LieAlgebra;
use crate::spec::ast::{
    self, AlgebraExpr, AlgebraNode, DomainExpr, Expr, Item, ItemKind, MovedBy, Name, Node,
};
use crate::spec::diagnostic::Span;
use crate::spec::layout::{Layout, component_help};
use crate::spec::model::{Domain, Side};
use crate::spec::names;
use hamel_expr::{Number, Rational};

/// Velocities that an item declares.
struct OfItem<'a> {
    item: &'a Item,
    names: &'a [Name],
    labels: &'a [Name],
    algebra: LieAlgebra<Number>,
}

impl OfItem<'_> {
    /// The documentation of the velocities; that of a configuration is about its coordinates.
    fn doc(&self) -> String {
        match self.item.kind {
            ItemKind::Configuration { .. } => String::new(),
            _ => self.item.doc.join("\n"),
        }
    }
}

/// Whether a model has parts, each with velocities of its own.
fn has_parts(items: &[Item]) -> bool {
    items.iter().any(|item| matches!(item.kind, ItemKind::Part { .. }))
}

impl Elaboration<'_> {
    pub(super) fn declare_sources_and_params(&mut self, items: &[Item]) {
        for item in items {
            match &item.kind {
                ItemKind::Source(text) => {
                    self.builder.source(text);
                }
                ItemKind::Topic(text) => {
                    self.builder.at(Some(item.span)).topic(text);
                }
                ItemKind::Size { name, value, .. } => {
                    self.builder.at(Some(name.span)).size(&name.text, *value, &item.doc.join("\n"));
                }
                ItemKind::Param { name, shape, default, .. } => {
                    self.declare_numbers(item, "parameter", (name, shape), default.as_ref())
                }
                ItemKind::Input { name, shape, default } => {
                    self.declare_numbers(item, "input", (name, shape), default.as_ref())
                }
                ItemKind::Noise { name, .. } => {
                    _ = self.builder.at(Some(name.span)).noise(&name.text, &item.doc.join("\n"));
                }
                _ => {}
            }
        }
    }

    /// A parameter or an input, which is `what`, with its default.
    fn declare_numbers(
        &mut self,
        item: &Item,
        what: &str,
        (name, shape): (&Name, &ast::Shape),
        default: Option<&Expr>,
    ) {
        let is_input = matches!(item.kind, ItemKind::Input { .. });
        let layout = match shape {
            ast::Shape::Scalar => None,
            ast::Shape::Vector(n) => Some(Layout::Vector(n.value)),
            ast::Shape::Diagonal(n) => Some(Layout::Diagonal(n.value)),
            ast::Shape::Symmetric(n) => Some(Layout::Symmetric(n.value)),
            ast::Shape::Matrix(n, m) => Some(Layout::Matrix(n.value, m.value)),
        };
        let component_names = layout.map_or_else(|| vec![name.text.clone()], |l| l.names(&name.text));
        let n = component_names.len();
        let numbers = match default {
            Some(expr) => self.constant(expr, "defaults are numbers").and_then(|numbers| {
                if numbers.len() == n && (layout.is_none() == !matches!(expr.node, Node::List(_))) {
                    return Some(numbers);
                }
                let message = match layout {
                    None => format!("{what} `{}` is a number, its default is a list", name.text),
                    Some(_) => format!("`{}` has {n} components, its default {}", name.text, numbers.len()),
                };
                let help = match layout {
                    None => format!(
                        "declare it as a vector: `{} {}: vector({}) = ..`",
                        if is_input { "input" } else { "param" },
                        name.text,
                        numbers.len()
                    ),
                    Some(_) => component_help(&component_names),
                };
                self.problem(expr.span, message, help);
                None
            }),
            None => {
                let help =
                    if n == 1 { "write `= 1.0`" } else { "write `= [..]` with the components in order" };
                self.problem(name.span, format!("{what} `{}` has no default", name.text), help);
                None
            }
        };
        // Conditions would be checked against a wrong default.
        if numbers.is_none() {
            self.poisoned.insert(name.text.clone());
        }
        let numbers = numbers.unwrap_or_else(|| vec![Rational::zero(); n]);
        let doc = item.doc.join("\n");
        self.builder.at(Some(name.span));
        let first = || numbers.first().cloned().unwrap_or_else(Rational::zero);
        match (layout, is_input) {
            (None, false) => self.builder.param(&name.text, first(), &doc),
            (Some(layout), false) => self.builder.param_array(&name.text, layout, &numbers, &doc),
            (None, true) => self.builder.input(&name.text, first(), &doc),
            (Some(layout), true) => self.builder.input_array(&name.text, layout, &numbers, &doc),
        };
    }

    pub(super) fn declare_variables(&mut self, items: &[Item]) {
        self.declare_velocities_and_coordinates(items);
        for item in items {
            if let ItemKind::MomentumIn { names, algebra, labels } = &item.kind {
                self.declare_momenta_in(item, names, algebra, labels);
            }
        }
        self.declare_configurations(items);
        self.declare_feedback(items);
    }

    /// Forces of actuators, and `dV_du` for a function and an actuator.
    fn declare_feedback(&mut self, items: &[Item]) {
        for item in items {
            if let ItemKind::Actuate { name, .. } = &item.kind {
                self.builder.at(Some(name.span)).actuator(&name.text, &item.doc.join("\n"));
            }
        }
        // Several of them are refused once all is known.
        let Some(actuator) = self.builder.actuators().into_iter().next() else { return };
        for item in items {
            if let ItemKind::Lyapunov { name, .. } = &item.kind {
                self.builder.at(Some(name.span)).response(&name.text, &actuator);
            }
        }
    }

    /// Momenta of velocities, once it is known what the velocities are.
    pub(super) fn declare_momenta(&mut self, items: &[Item]) {
        for item in items {
            if let ItemKind::Momentum { name, velocity } = &item.kind {
                if self.builder.is_levels(&velocity.text) {
                    self.builder.at(Some(name.span)).stage_momentum(&name.text);
                    continue;
                }
                let velocity = (velocity.text.as_str(), Some(velocity.span));
                let builder = self.builder.at(Some(name.span));
                if builder.located_momentum(&name.text, velocity, &item.doc.join("\n")).is_none() {
                    self.poisoned.insert(name.text.clone());
                }
            }
        }
        // `routh Omega -> Pi;` declares its momentum, unless an item of its own has.
        for item in items {
            let ItemKind::Carry(list) = &item.kind else { continue };
            for carry in list {
                let ast::Carry::Momenta { velocity, momentum } = carry else { continue };
                if !self.builder.is_momentum(&momentum.text) && !self.poisoned.contains(&momentum.text) {
                    let velocity = (velocity.text.as_str(), Some(velocity.span));
                    let builder = self.builder.at(Some(momentum.span));
                    if builder.located_momentum(&momentum.text, velocity, &item.doc.join("\n")).is_none() {
                        self.poisoned.insert(momentum.text.clone());
                    }
                }
            }
        }
    }

    /// `momentum Pi in so(3);`: velocities `dh_dPi` in the algebra, and their momenta.
    fn declare_momenta_in(&mut self, item: &Item, names: &[Name], algebra: &AlgebraExpr, labels: &[Name]) {
        let velocities: Vec<Name> =
            names.iter().map(|name| Name { text: format!("dh_d{}", name.text), span: name.span }).collect();
        let of_velocities: Vec<Name> =
            labels.iter().map(|l| Name { text: format!("dh_d{}", l.text), span: l.span }).collect();
        match self.algebra(algebra) {
            Some(algebra) => {
                let (names, labels) = (velocities.as_slice(), of_velocities.as_slice());
                self.declare_velocities(&OfItem { item, names, labels, algebra });
            }
            None => self.without_velocities(&velocities),
        }
        for (k, (name, velocity)) in names.iter().zip(&velocities).enumerate() {
            if self.poisoned.contains(&velocity.text) {
                self.poisoned.insert(name.text.clone());
                continue;
            }
            let builder = self.builder.at(Some(name.span));
            let components = labels
                .get(k)
                .map(|prefix| builder.labelled(&velocity.text, &of_velocities[k].text, &prefix.text));
            let velocity = (velocity.text.as_str(), Some(velocity.span));
            if builder.labelled_momentum(&name.text, velocity, components, &item.doc.join("\n")).is_none() {
                self.poisoned.insert(name.text.clone());
            }
        }
    }

    fn declare_velocities_and_coordinates(&mut self, items: &[Item]) {
        let is_own = |item: &Item| matches!(item.kind, ItemKind::Configuration { by: MovedBy::Own(_), .. });
        // Beside configurations and parts all velocities are in one algebra, from the first item on.
        let are_joint = items.iter().any(is_own) || has_parts(items);
        let mut are_declared = false;
        for item in items {
            match &item.kind {
                ItemKind::Velocity { .. } if !are_joint => {
                    self.declare_all_velocities(std::slice::from_ref(item));
                }
                ItemKind::Velocity { .. } | ItemKind::Configuration { by: MovedBy::Own(_), .. }
                    if !std::mem::replace(&mut are_declared, true) =>
                {
                    self.declare_all_velocities(items);
                }
                ItemKind::Algebroid(block) => self.declare_algebroid(item, block),
                ItemKind::QuasiVelocity(names) => {
                    for name in names {
                        self.builder.at(Some(name.span)).quasi_velocity(&name.text, &item.doc.join("\n"));
                    }
                }
                ItemKind::Coordinate { names, shape, domain, by: _ } => {
                    self.declare_coordinates(item, names, shape, domain)
                }
                ItemKind::State { name, shape, domain, rate: _ } => {
                    self.declare_first_order(item, name, shape, domain);
                }
                ItemKind::Mode(name) => {
                    self.builder.at(Some(name.span)).mode(&name.text, &item.doc.join("\n"));
                }
                ItemKind::Advected { name, space, labels, .. } => {
                    self.declare_advected(item, name, space, labels.first());
                }
                ItemKind::Action(side) => self.declare_side(side),
                _ => {}
            }
        }
    }

    fn declare_side(&mut self, side: &Name) {
        match side.text.as_str() {
            "left" => _ = self.builder.at(Some(side.span)).action(Side::Left),
            "right" => _ = self.builder.at(Some(side.span)).action(Side::Right),
            other => {
                let help = names::suggest(other, ["left", "right"]);
                self.problem(side.span, format!("unknown side `{other}`"), help);
            }
        }
    }

    /// Velocities of items `velocity`, then velocities that configurations declare: one algebra, the product of theirs.
    fn declare_all_velocities(&mut self, items: &[Item]) {
        let mut all: Vec<OfItem<'_>> = Vec::new();
        for item in items {
            let ItemKind::Velocity { names, algebra, labels } = &item.kind else { continue };
            match self.algebra(algebra) {
                Some(algebra) => all.push(OfItem { item, names, labels, algebra }),
                None => self.without_velocities(names),
            }
        }
        for item in items {
            let ItemKind::Configuration { group, by: MovedBy::Own(names), .. } = &item.kind else { continue };
            match self.group_of_configuration(group) {
                Some(group) => {
                    let algebra = group.algebra().clone().into();
                    all.push(OfItem { item, names, labels: &[], algebra });
                }
                None => self.without_velocities(names),
            }
        }
        let is_configuration = |of: &OfItem<'_>| matches!(of.item.kind, ItemKind::Configuration { .. });
        if all.len() < 2 || !(all.iter().any(is_configuration) || has_parts(items)) {
            // A second item `velocity` is a problem that the builder tells.
            all.iter().for_each(|of| self.declare_velocities(of));
            return;
        }
        // Each item names its own: blocks or elements of its factor.
        let before = self.builder.problems.len();
        let mut sizes = Vec::new();
        for OfItem { item, names, algebra, .. } in &all {
            sizes.extend(self.builder.at(Some(item.span)).velocity_sizes(algebra, names.len()));
        }
        let located: Vec<(&str, Option<Span>)> =
            all.iter().flat_map(|of| of.names.iter().map(|n| (n.text.as_str(), Some(n.span)))).collect();
        if self.builder.problems.len() == before {
            let factors: Vec<LieAlgebra<Number>> = all.iter().map(|of| of.algebra.clone()).collect();
            let labels: Vec<&str> =
                all.iter().flat_map(|of| of.labels.iter().map(|l| l.text.as_str())).collect();
            let span = all[0].item.span;
            let product = LieAlgebra::product(&factors);
            self.builder.at(Some(span)).sized_velocities(product, &located, &sizes, &labels, "");
            for of @ OfItem { names, .. } in &all {
                let doc = of.doc();
                names.iter().for_each(|name| self.builder.document_velocity(&name.text, &doc));
            }
        }
        if self.builder.problems.len() > before {
            all.iter().for_each(|of| self.without_velocities(of.names));
        }
    }

    fn without_velocities(&mut self, names: &[Name]) {
        self.builder.broken.insert("velocity");
        for name in names {
            self.builder.values.remove(&name.text);
            self.poisoned.insert(name.text.clone());
        }
    }

    fn declare_velocities(&mut self, of: &OfItem<'_>) {
        let OfItem { item, names, labels, algebra } = of;
        let located: Vec<(&str, Option<Span>)> =
            names.iter().map(|n| (n.text.as_str(), Some(n.span))).collect();
        let span = names.first().map_or(item.span, |n| n.span).to(names.last().map_or(item.span, |n| n.span));
        let before = self.builder.problems.len();
        let labels: Vec<&str> = labels.iter().map(|l| l.text.as_str()).collect();
        let doc = of.doc();
        self.builder.at(Some(span)).located_velocities(algebra.clone(), &located, &labels, &doc);
        if self.builder.problems.len() > before {
            // The wrong number of names: their components are unknown.
            self.without_velocities(names);
        }
    }

    /// Coordinates in groups, when the velocities that move them are declared.
    fn declare_configurations(&mut self, items: &[Item]) {
        for item in items {
            let ItemKind::Configuration { names, group, by, relative } = &item.kind else { continue };
            let (by, is_own) = match by {
                MovedBy::Own(list) => (list, true),
                MovedBy::Declared(list) => (list, false),
            };
            let before = self.builder.problems.len();
            // What its own velocities are in has been looked at.
            let group = if is_own { matrices_of(group) } else { self.group_of_configuration(group) };
            let is_known = by.iter().chain(relative).all(|name| !self.poisoned.contains(&name.text));
            if let Some(group) = group.filter(|_| is_known) {
                let located: Vec<(&str, Option<Span>)> =
                    names.iter().map(|n| (n.text.as_str(), Some(n.span))).collect();
                let [by, relative] =
                    [by, relative].map(|list| list.iter().map(|n| (n.text.clone(), Some(n.span))).collect());
                let span = names
                    .first()
                    .map_or(item.span, |n| n.span)
                    .to(names.last().map_or(item.span, |n| n.span));
                let doc = item.doc.join("\n");
                let values =
                    self.builder.at(Some(span)).located_configuration(&located, &group, (by, relative), &doc);
                if !values.is_empty() && self.builder.problems.len() == before {
                    continue;
                }
            }
            self.builder.broken.insert("configuration");
            self.poisoned.extend(names.iter().map(|n| n.text.clone()));
        }
    }

    fn declare_advected(&mut self, item: &Item, name: &Name, space: &AlgebraExpr, label: Option<&Name>) {
        let algebra = match &space.node {
            AlgebraNode::Call(call, arguments) if call.text == "dual" => match arguments.as_slice() {
                [inner] => self.algebra(inner).map(Some),
                _ => {
                    self.problem(space.span, "`dual` takes one algebra", "for example `dual(so(3))`");
                    None
                }
            },
            AlgebraNode::Power(_) => Some(None),
            AlgebraNode::Name(name) if name == "R" => Some(None),
            _ => self.algebra(space).map(Some),
        };
        let doc = item.doc.join("\n");
        let Some(algebra) = algebra else {
            self.poisoned.insert(name.text.clone());
            self.builder.broken.insert("advected");
            return;
        };
        self.builder.at(Some(name.span));
        match (&space.node, algebra) {
            (_, Some(algebra)) => {
                let components = match label {
                    Some(prefix) => algebra.labels().iter().map(|l| format!("{}{l}", prefix.text)).collect(),
                    None => Layout::Vector(algebra.dim()).names(&name.text),
                };
                self.builder.advected_vector(&name.text, &components, &doc);
            }
            (node, None) => {
                if let Some(label) = label {
                    let message = format!("the components of `{}` have no names in their space", name.text);
                    self.problem(label.span, message, "only bases of algebras have names");
                }
                let dim = if let AlgebraNode::Power(n) = node { Some(*n) } else { None };
                self.builder.at(Some(name.span)).advected(&name.text, dim, &doc);
            }
        }
    }

    fn domain(&mut self, domain: &DomainExpr) -> Domain {
        match domain {
            DomainExpr::Angle => Domain::Angle,
            DomainExpr::Real => Domain::Real,
            DomainExpr::Interval(low, high) => {
                self.builder.at(Some(low.span.to(high.span)));
                let ends = (self.interval_end(low), self.interval_end(high));
                match ends {
                    (Some(low), Some(high)) => Domain::Interval(low, high),
                    _ => Domain::Real,
                }
            }
        }
    }

    fn declare_first_order(&mut self, item: &Item, name: &Name, shape: &ast::Shape, domain: &DomainExpr) {
        let domain = self.domain(domain);
        let doc = item.doc.join("\n");
        self.builder.at(Some(name.span));
        match shape {
            ast::Shape::Scalar => _ = self.builder.state(&name.text, domain, &doc),
            ast::Shape::Vector(n) => _ = self.builder.state_vector(&name.text, n.value, domain, &doc),
            _ => {
                let message = format!("state `{}` must be a number or a vector", name.text);
                self.problem(name.span, message, "write `state z: vector(2) in real by z_dot = ..;`");
                self.poisoned.insert(name.text.clone());
                self.builder.broken.insert("state");
            }
        }
    }

    fn declare_coordinates(&mut self, item: &Item, names: &[Name], shape: &ast::Shape, domain: &DomainExpr) {
        let domain = self.domain(domain);
        let doc = item.doc.join("\n");
        for name in names {
            self.builder.at(Some(name.span));
            match shape {
                ast::Shape::Scalar => {
                    self.builder.coordinate(&name.text, domain, &doc);
                }
                ast::Shape::Vector(n) => {
                    self.builder.coordinate_vector(&name.text, n.value, domain, &doc);
                }
                _ => {
                    let message = format!("coordinate `{}` must be a number or a vector", name.text);
                    self.problem(name.span, message, "write `coordinate x: vector(3) in real;`");
                    self.poisoned.insert(name.text.clone());
                }
            }
        }
    }
}
