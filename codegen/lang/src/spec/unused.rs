//! Declarations without any effect: warnings.
//!
//! A parameter that nothing mentions is most often a term that was forgotten. Declarations are followed from what makes
//! or shows a motion: what only an unused definition mentions is unused as well. Conditions on parameters, scenes that
//! fix them and initial values of a name are no use of it, because they change neither equations nor outputs.
//!
//! Deliberately does not know: values, shapes, mechanics. It reads the syntax tree alone.

use std::collections::{BTreeMap, BTreeSet};

use super::ast::{
    Act, AlgebraExpr, AlgebraNode, AlgebroidBlock, Carry, DomainExpr, Expr, Item, ItemKind, MovedBy, Name,
    Node, ReconstructWay, Shape, Size,
};
use super::diagnostic::Diagnostic;
use super::layout::Layout;

/// Something with a name, the names that stand for it or a part of it, and what it mentions.
struct Declaration<'a> {
    what: &'static str,
    name: &'a Name,
    spellings: Vec<String>,
    mentions: Vec<String>,
}

/// One warning for each parameter, definition, coordinate, advected parameter, quasi-velocity, algebra and
/// representation that has no effect.
pub(super) fn warnings(items: &[Item]) -> Vec<Diagnostic> {
    let mut declarations = Vec::new();
    // What is mentioned where it counts.
    let mut pending: Vec<String> = Vec::new();
    for item in items {
        declare(item, &mut declarations);
        pending.extend(effective(item));
    }
    let owners: BTreeMap<&str, usize> = declarations
        .iter()
        .enumerate()
        .flat_map(|(k, d)| d.spellings.iter().map(move |name| (name.as_str(), k)))
        .collect();
    let mut is_used = vec![false; declarations.len()];
    while let Some(name) = pending.pop() {
        if let Some(&k) = owners.get(name.as_str())
            && !std::mem::replace(&mut is_used[k], true)
        {
            pending.extend(declarations[k].mentions.iter().cloned());
        }
    }
    // A loop declares several names at one place; one that has an effect is enough.
    let places: BTreeSet<usize> = declarations
        .iter()
        .zip(&is_used)
        .filter(|(_, used)| **used)
        .map(|(d, _)| d.name.span.start)
        .collect();
    let unused = |k: &usize| !places.contains(&declarations[*k].name.span.start);
    (0..declarations.len()).filter(unused).map(|k| warning(k, &declarations, &owners)).collect()
}

fn warning(k: usize, declarations: &[Declaration<'_>], owners: &BTreeMap<&str, usize>) -> Diagnostic {
    let Declaration { what, name, .. } = &declarations[k];
    let mentioned_by = declarations.iter().enumerate().find(|(other, d)| {
        *other != k && d.mentions.iter().any(|mention| owners.get(mention.as_str()) == Some(&k))
    });
    let warning = Diagnostic::warning(Some(name.span), format!("{what} `{}` has no effect", name.text));
    let warning = match mentioned_by {
        Some((_, other)) => {
            warning.with_place(Some(other.name.span), "only this mentions it, without effect")
        }
        None => warning.with_label("nothing mentions it"),
    };
    warning.with_help(match *what {
        "algebra" | "representation" => "remove it, or declare a velocity in it",
        _ => "remove it, or use it in the Lagrangian, a constraint, a force or an output",
    })
}

fn spellings(name: &str, shape: &Shape) -> Vec<String> {
    let layout = match shape {
        Shape::Scalar => return vec![name.to_owned()],
        Shape::Vector(n) => Layout::Vector(n.value),
        Shape::Diagonal(n) => Layout::Diagonal(n.value),
        Shape::Symmetric(n) => Layout::Symmetric(n.value),
        Shape::Matrix(n, m) => Layout::Matrix(n.value, m.value),
    };
    layout.names(name).into_iter().chain([name.to_owned()]).collect()
}

/// Algebras and representations have a space of names of their own, which no other spelling can enter.
fn of_algebras(name: &str) -> String {
    format!("algebra {name}")
}

fn algebras(expr: &AlgebraExpr) -> Vec<String> {
    expr.names().iter().map(|name| of_algebras(name)).collect()
}

fn owned<'a>(names: impl IntoIterator<Item = &'a str>) -> Vec<String> {
    names.into_iter().map(str::to_owned).collect()
}

fn mentions<'a>(expressions: impl IntoIterator<Item = &'a Expr>) -> Vec<String> {
    let of_one = |e: &Expr| {
        owned(e.names()).into_iter().chain(e.algebra_names().into_iter().map(of_algebras)).collect()
    };
    expressions.into_iter().flat_map(|e| -> Vec<String> { of_one(e) }).collect()
}

fn declare<'a>(item: &'a Item, declarations: &mut Vec<Declaration<'a>>) {
    let mut add = |what, name: &'a Name, spellings, mentions| {
        declarations.push(Declaration { what, name, spellings, mentions });
    };
    let alone = |name: &Name| vec![name.text.clone()];
    match &item.kind {
        ItemKind::Param { name, shape, .. } => {
            add("parameter", name, spellings(&name.text, shape), Vec::new());
        }
        ItemKind::Input { name, shape, .. } => {
            add("input", name, spellings(&name.text, shape), Vec::new());
        }
        ItemKind::Noise { name, value: None } => add("noise", name, alone(name), Vec::new()),
        ItemKind::Let { name, value } => {
            add("definition", name, alone(name), mentions([value]));
        }
        ItemKind::AlgebraName { name, value } => {
            add("algebra", name, vec![of_algebras(&name.text)], algebras(value));
        }
        ItemKind::AlgebraBrackets { name, .. } => {
            add("algebra", name, vec![of_algebras(&name.text)], Vec::new());
        }
        ItemKind::Representation { name, algebra, .. } => {
            add("representation", name, vec![of_algebras(&name.text)], algebras(algebra));
        }
        ItemKind::Body(body) if body.on.is_none() => {
            let parts = body.parts.iter().map(|(_, name)| name.text.clone()).collect();
            add("body", &body.name, parts, mentions(body.expressions()));
        }
        ItemKind::QuasiVelocity(names) => {
            names.iter().for_each(|name| add("quasi-velocity", name, alone(name), Vec::new()));
        }
        ItemKind::Coordinate { names, shape, domain, by: _ } => {
            let ends = match domain {
                DomainExpr::Interval(low, high) => mentions([low, high]),
                DomainExpr::Angle | DomainExpr::Real => Vec::new(),
            };
            for name in names {
                let mut all = spellings(&name.text, shape);
                all.extend(all.clone().iter().map(|q| format!("{q}_dot")));
                add("coordinate", name, all, ends.clone());
            }
        }
        ItemKind::State { name, shape, domain, rate: (_, rate) } => {
            let mut all = spellings(&name.text, shape);
            all.push(format!("{}_dot", name.text));
            let ends = match domain {
                DomainExpr::Interval(low, high) => mentions([low, high]),
                DomainExpr::Angle | DomainExpr::Real => Vec::new(),
            };
            add("state", name, all, mentions([rate]).into_iter().chain(ends).collect());
        }
        ItemKind::Advected { name, space, labels, action } => {
            let shape = match space.node {
                AlgebraNode::Power(value) => Shape::Vector(Size { value, span: space.span }),
                _ => Shape::Scalar,
            };
            let own = if labels.is_empty() { spellings(&name.text, &shape) } else { alone(name) };
            let mut all = mentions([action]);
            all.extend(algebras(space));
            // An action by the name of a representation, or of the one it is dual to.
            let inner = match &action.node {
                Node::Call(dual, arguments) if dual.text == "dual" => arguments.first().unwrap_or(action),
                _ => action,
            };
            if let Node::Name(representation) = &inner.node {
                all.push(of_algebras(representation));
            }
            add("advected parameter", name, own, all);
        }
        _ => {}
    }
}

/// The names in an item that changes equations, outputs or figures.
fn effective(item: &Item) -> Vec<String> {
    match &item.kind {
        ItemKind::Velocity { algebra, .. } | ItemKind::MomentumIn { algebra, .. } => algebras(algebra),
        ItemKind::Stage { ideal, connections, .. } => {
            mentions(ideal.iter().flatten().chain(connections.iter().map(|(_, value)| value)))
        }
        ItemKind::Constraint { left, right, .. } | ItemKind::Virtual { left, right, .. } => {
            mentions([left, right])
        }
        ItemKind::AppliedForce { on, value, .. } => mentions([on, value]),
        ItemKind::Actuate { along, .. } => mentions([along]),
        ItemKind::Lyapunov { function, rate, .. } => mentions(std::iter::once(function).chain(rate)),
        ItemKind::Frame(velocities) => mentions(velocities.iter().map(|v| &v.value)),
        ItemKind::Algebroid(AlgebroidBlock { anchors, rules, .. }) => {
            mentions(anchors.iter().map(|(_, value)| value).chain(rules.iter().map(|rule| &rule.value)))
        }
        ItemKind::Acceleration { name, value }
        | ItemKind::Field { name, value }
        | ItemKind::Drive { name, value } => {
            mentions([value]).into_iter().chain([name.text.clone()]).collect()
        }
        ItemKind::Noise { value: Some(value), .. }
        | ItemKind::InnerProduct(value)
        | ItemKind::Lagrangian(value)
        | ItemKind::Hamiltonian(value)
        | ItemKind::Connection { value, .. }
        | ItemKind::Force { value, .. }
        | ItemKind::Casimir { value, .. }
        | ItemKind::Output { value, .. }
        | ItemKind::Initial { value, .. }
        | ItemKind::Reconstruct { way: ReconstructWay::Rate(value), .. } => mentions([value]),
        ItemKind::Section { algebra, value, .. } => {
            mentions([value]).into_iter().chain(algebra.iter().flat_map(algebras)).collect()
        }
        ItemKind::Event(event) => {
            let returned = event.acts.iter().filter_map(|act| match act {
                Act::Impact(_, e) => e.as_ref(),
                Act::Enter(_) | Act::Leave(_) => None,
            });
            let values = event.sets.iter().map(|(_, value)| value);
            mentions(std::iter::once(&event.value).chain(values).chain(returned))
        }
        // The coordinate moves, whoever else mentions it.
        ItemKind::Coordinate { by: Some((left, right)), .. } => mentions([left, right]),
        ItemKind::Momentum { velocity, .. } => vec![velocity.text.clone()],
        ItemKind::Carry(list) | ItemKind::Scene { carries: list, .. } => levels(list),
        ItemKind::Configuration { by, relative, .. } => {
            let from: &[Name] = match by {
                MovedBy::Declared(from) => from,
                MovedBy::Own(_) => &[],
            };
            owned(from.iter().chain(relative).map(|name| name.text.as_str()))
        }
        ItemKind::Reconstruct { way: ReconstructWay::Group { from, .. }, .. } => {
            owned(from.iter().map(|name| name.text.as_str()))
        }
        ItemKind::View { arguments, around, at, attitude, .. } => {
            mentions(arguments.iter().chain([around, at, attitude].into_iter().flatten()))
        }
        ItemKind::Use(used) => mentions(used.given.iter().map(|(_, value)| value)),
        ItemKind::Body(body) if body.on.is_some() => mentions(body.expressions()),
        ItemKind::NamedFrame { at, attitude, .. } => mentions([at, attitude].into_iter().flatten()),
        ItemKind::Source(_)
        | ItemKind::Topic(_)
        | ItemKind::Want(_)
        | ItemKind::Reduces(_)
        | ItemKind::Part { .. }
        | ItemKind::Size { .. }
        | ItemKind::Param { .. }
        | ItemKind::Input { .. }
        | ItemKind::Noise { value: None, .. }
        | ItemKind::Require(_)
        | ItemKind::Let { .. }
        | ItemKind::AlgebraName { .. }
        | ItemKind::AlgebraBrackets { .. }
        | ItemKind::Representation { .. }
        | ItemKind::Body(_)
        | ItemKind::QuasiVelocity(_)
        | ItemKind::DerivedConnection(_)
        | ItemKind::LagrangianInnerProduct
        | ItemKind::Action(_)
        | ItemKind::Coordinate { by: None, .. }
        | ItemKind::Advected { .. }
        | ItemKind::State { .. }
        | ItemKind::Independent(_)
        | ItemKind::Multipliers
        | ItemKind::Mode(_)
        | ItemKind::VirtualThermo => Vec::new(),
    }
}

/// Cyclic coordinates, the parameters that are their momenta, and what these are up to.
fn levels(carries: &[Carry]) -> Vec<String> {
    let level = |carry: &Carry| match carry {
        Carry::Level { cyclic, parameter, up_to } => {
            let function = mentions(up_to);
            function.into_iter().chain([cyclic.text.clone(), parameter.text.clone()]).collect()
        }
        Carry::Named(_) | Carry::Momenta { .. } => Vec::new(),
    };
    carries.iter().flat_map(level).collect()
}
