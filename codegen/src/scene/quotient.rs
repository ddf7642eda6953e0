//! The map of a model that says to be the quotient of another, as functions of the other's state and parameters.
//!
//! Does not know: how the map is proved, how it is lowered or emitted.

use std::collections::BTreeMap;

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Func, Graph, Node, Sign, Style, SymbolId, inlined, sign_of};
use hamel_lang::algebra::{determinant_of, solve_over_determinant};
use hamel_lang::spec::{Diagnostic, Diagnostics, Model, NamedVector, OutputPart, Total, Wanted};
use hamel_mechanics::mechanics::{Equations, StateEquation};
use hamel_mechanics::reduction::{Circle, KinematicConstraint, momentum_of};
use hamel_program::lower::Request;
use hamel_program::program::{Program, Role, Symbols};

use super::built::TotalSystem;
use crate::quotient::related;

/// Name of the function of the state, and of the output of the total system with all images.
const STATE: &str = "quotient";
/// Name of the function of the parameters.
const PARAMS: &str = "quotient_parameters";

/// The role of the function of the state.
pub(super) fn state_role() -> Role {
    Role::OfVariables(STATE.to_owned())
}

/// The role of the function of the parameters.
pub(super) fn params_role() -> Role {
    Role::OfVariables(PARAMS.to_owned())
}

/// The output of the total system with all images.
pub(super) fn images_role() -> Role {
    Role::Output(STATE.to_owned())
}

/// The only model that `model` is the quotient of, after the proof that it is, with the images of variables and
/// parameters as its only output.
///
/// # Errors
/// A text that nobody has read or that is wrong, conditions that do not hold.
pub(super) fn total_model(model: &Model) -> Result<Model, Diagnostics> {
    let fail = |total: Option<&Total>, message: String, help: &str| {
        let place = total.and_then(|total| total.place);
        Diagnostics::new(model.origin.clone(), vec![Diagnostic::new(place, message).with_help(help)])
    };
    let [total] = model.totals.as_slice() else {
        return Err(fail(None, "`quotient` takes one `reduces`".to_owned(), "say of which model"));
    };
    let Some(origin) = &total.origin else {
        let message = format!("the text of `{}` is not known, and a scene wants `quotient`", total.file);
        return Err(fail(Some(total), message, "read the model with `quotient::read_totals`"));
    };
    let (mut other, _) = related(model, total, origin).map_err(|why| {
        let first = why.diagnostics(model, total).into_iter().next();
        first.unwrap_or_else(|| fail(Some(total), "the map is not proved".to_owned(), ""))
    })?;
    let images = images(model, total, &mut other);
    let part = OutputPart::Own;
    other.outputs =
        vec![NamedVector { name: STATE.to_owned(), components: images, doc: String::new(), part }];
    other.scenes.clear();
    Ok(other)
}

/// The name of that output.
pub(super) fn wanted() -> Wanted {
    Wanted::Own(STATE.to_owned())
}

/// Variables and parameters of the quotient by the total system; those without a function are the ones of the same
/// name there.
fn images(model: &Model, total: &Total, other: &mut Model) -> Vec<(String, ExprId)> {
    let n_own = other.outputs.len() - total.images.len();
    let names = total.images.iter().flat_map(|image| image.components.iter().cloned());
    let values = other.outputs[n_own..].iter().flat_map(|o| o.components.iter().map(|(_, e)| *e));
    let mut images: Vec<(String, ExprId)> = names.zip(values).collect();
    let symbols = symbols(other);
    let is_given = |images: &[(String, ExprId)], name: &str| images.iter().any(|(own, _)| own == name);
    for (name, _) in self::symbols(model) {
        if is_given(&images, &name) {
            continue;
        }
        if let Some((_, symbol)) = symbols.iter().find(|(own, _)| *own == name) {
            images.push((name, other.graph.sym(*symbol)));
        }
    }
    images
}

/// Parameters and variables of a model that functions of it may name.
fn symbols(model: &Model) -> Vec<(String, SymbolId)> {
    let mut all: Vec<(String, SymbolId)> = model.params.iter().map(|p| (p.name.clone(), p.symbol)).collect();
    all.extend(model.base.iter().map(|c| (c.name.clone(), c.symbol)));
    all.extend(model.first_order.iter().flat_map(|state| state.components.iter().cloned()));
    all.extend(model.advected.iter().flat_map(|a| a.components.iter().cloned()));
    all.extend(model.all_velocities().into_iter().map(|(name, symbol)| (name.to_owned(), symbol)));
    all
}

/// The functions of the map, to be lowered.
pub(super) struct Found {
    pub(super) requests: Vec<Request>,
    pub(super) arguments: BTreeMap<Role, Vec<SymbolId>>,
}

/// State and parameters of a scene by state and parameters of the total system.
///
/// # Errors
/// [`Error::NoQuotient`] for components of the state without an image, and fixed parameters that the map does not give
/// as these numbers.
pub(super) fn find(
    g: &mut Graph,
    total: &TotalSystem,
    equations: &Equations,
    state: &[StateEquation],
) -> Result<Found, Error> {
    let system = &equations.system;
    let program = &total.scene.program;
    let fresh = |g: &mut Graph, names: &[String]| -> Vec<SymbolId> {
        names.iter().map(|name| g.symbol(name)).collect()
    };
    let (of_state, of_params) = (fresh(g, &program.state), fresh(g, &program.params));
    let mut images = imported(g, program, (system.time, &of_state, &of_params))?;
    add_cyclic(g, equations, &mut images)?;
    for (name, fixed) in &system.formulation.fixed {
        let Some(image) = images.get(name).copied() else { continue };
        let fixed = g.rational(fixed.clone());
        let apart = g.sub(image, fixed);
        if !g.is_zero(apart) {
            let image = g.display(image, Style::Plain);
            let reason = format!("the scene fixes {name}, and the map gives it as {image}");
            return Err(Error::NoQuotient { reason });
        }
    }
    let values = state.iter().map(|s| Ok((s.name.clone(), image_of(g, equations, s, &images)?)));
    let values = values.collect::<Result<Vec<_>, Error>>()?;
    // A parameter without an image stands nowhere: the proof of the map would have missed it.
    let params = system.params.iter().map(|p| {
        let image = images.get(&p.name).copied();
        (p.name.clone(), image.unwrap_or_else(|| g.rational(p.default.clone())))
    });
    let params: Vec<(String, ExprId)> = params.collect();
    let variables = [of_state, of_params].concat();
    let mut requests = vec![Request { role: state_role(), results: values }];
    if !params.is_empty() {
        requests.push(Request { role: params_role(), results: params });
    }
    let arguments = requests.iter().map(|request| (request.role.clone(), variables.clone())).collect();
    Ok(Found { requests, arguments })
}

/// The images that the total system computes, in symbols of their own.
fn imported(
    g: &mut Graph,
    program: &Program,
    (time, state, params): (SymbolId, &[SymbolId], &[SymbolId]),
) -> Result<BTreeMap<String, ExprId>, Error> {
    let function = program.function(&images_role()).cloned().into_iter().collect();
    let alone = Program { functions: function, ..program.clone() };
    let arguments = BTreeMap::new();
    let symbols = Symbols { params, time, inputs: &[], state, arguments: &arguments };
    let values = alone.to_expressions(g, symbols)?;
    let names = alone.functions.iter().flat_map(|f| f.results.iter().map(|(name, _)| name.clone()));
    Ok(names.zip(values.into_iter().flatten()).collect())
}

fn missing(name: &str) -> Error {
    Error::NoQuotient { reason: format!("the map gives no {name}") }
}

/// Adds the images of parameters that are momenta of cyclic coordinates: `W^a_b dL/dy^a` at the images.
///
/// # Errors
/// [`Error::NoQuotient`] where a velocity has no image.
fn add_cyclic(
    g: &mut Graph,
    equations: &Equations,
    images: &mut BTreeMap<String, ExprId>,
) -> Result<(), Error> {
    let system = &equations.system;
    for momentum in system.momenta.iter().filter(|m| m.symbol.is_none()) {
        let (l, y) = (system.lagrangian, &system.velocities);
        let value = momentum_of(g, l, y, &system.constraint, momentum.unknown);
        let image = at_images(g, equations, value, images).ok_or_else(|| missing(&momentum.name))?;
        images.insert(momentum.name.clone(), image);
    }
    Ok(())
}

/// A function of variables and parameters of the scene at their images, where all have one.
fn at_images(
    g: &mut Graph,
    equations: &Equations,
    value: ExprId,
    images: &BTreeMap<String, ExprId>,
) -> Option<ExprId> {
    let system = &equations.system;
    let definitions = inlined(g, equations.sections.iter().flat_map(|s| &s.definitions));
    let value = g.subs(value, &definitions).ok()?;
    let mut replaced = BTreeMap::from([(system.time, g.sym(system.time))]);
    for symbol in g.free_symbols(value).into_iter().filter(|symbol| *symbol != system.time) {
        let image = match on_circle(g, &system.circles, symbol, images) {
            Some(point) => point,
            None => images.get(g.name(symbol)).copied(),
        };
        replaced.insert(symbol, image?);
    }
    g.subs(value, &replaced).ok()
}

/// The image of a component of the state.
fn image_of(
    g: &mut Graph,
    equations: &Equations,
    component: &StateEquation,
    images: &BTreeMap<String, ExprId>,
) -> Result<ExprId, Error> {
    let system = &equations.system;
    if let Some(image) = images.get(&component.name) {
        return Ok(*image);
    }
    if let Some(point) = on_circle(g, &system.circles, component.symbol, images) {
        return point.ok_or_else(|| missing(&component.name));
    }
    if system.unknowns.iter().any(|u| u.frame_idx.is_none() && u.symbol == component.symbol) {
        return quasi_velocity(g, equations, component, images);
    }
    let legendre = &equations.legendre;
    let momentum = legendre.momenta.iter().find(|(name, _)| *name == component.name);
    let (_, value) = momentum.ok_or_else(|| missing(&component.name))?;
    at_images(g, equations, *value, images).ok_or_else(|| missing(&component.name))
}

/// A quasi-velocity by the images of velocities: `y = Psi u + psi0` solved for it,
/// `s = (B^T B)^-1 B^T (y - psi0 - Psi v)` with the columns `B` of `Psi` for quasi-velocities and `v` for velocities
/// among `u`.
fn quasi_velocity(
    g: &mut Graph,
    equations: &Equations,
    component: &StateEquation,
    images: &BTreeMap<String, ExprId>,
) -> Result<ExprId, Error> {
    let system = &equations.system;
    let KinematicConstraint::Solved(solved) = &system.constraint else {
        return Err(missing(&component.name));
    };
    let (mut columns, mut at, mut rests) = (Vec::new(), None, Vec::new());
    for (k, unknown) in solved.unknowns.iter().enumerate().filter(|(_, u)| u.frame_idx.is_none()) {
        at = at.or((unknown.symbol == component.symbol).then_some(columns.len()));
        columns.push(solved.dependent.iter().map(|&y| solved.psi[y][k]).collect::<Vec<_>>());
    }
    for &y in &solved.dependent {
        let mut rest = vec![g.sym(system.velocities[y])];
        let known = solved.unknowns.iter().enumerate().filter(|(_, u)| u.frame_idx.is_some());
        for (k, unknown) in known {
            let velocity = g.sym(unknown.symbol);
            let part = g.mul(solved.psi[y][k], velocity);
            rest.push(g.neg(part));
        }
        rest.push(g.neg(solved.psi0[y]));
        rests.push(g.sum(&rest));
    }
    let matrix: Vec<Vec<ExprId>> =
        columns.iter().map(|a| columns.iter().map(|b| g.dot(a, b)).collect()).collect();
    let right: Vec<Vec<ExprId>> = columns.iter().map(|a| vec![g.dot(a, &rests)]).collect();
    let determinant = determinant_of(g, &matrix);
    if !cannot_vanish(g, determinant, &system.signs) {
        let divisor = g.display(determinant, Style::Plain);
        let reason = format!("{} does not follow from velocities where {divisor} vanishes", component.name);
        return Err(Error::NoQuotient { reason });
    }
    let solution = solve_over_determinant(g, &matrix, &right).ok();
    let value = at.zip(solution).and_then(|(at, solution)| solution.get(at)?.first().copied());
    let value = value.ok_or_else(|| missing(&component.name))?;
    at_images(g, equations, value, images).ok_or_else(|| missing(&component.name))
}

/// Whether an expression is seen to vanish nowhere: by its sign, or as a sum of terms that are not negative with
/// squares of sine and cosine of one angle among them.
fn cannot_vanish(g: &mut Graph, e: ExprId, facts: &BTreeMap<ExprId, Sign>) -> bool {
    if sign_of(g, e, facts).is_definite() {
        return true;
    }
    let Node::Sum { constant, terms } = g.node(e).clone() else { return false };
    let mut parts: Vec<ExprId> = terms.iter().map(|(term, q)| g.scale(*term, q)).collect();
    parts.push(g.rational(constant));
    let is_none_negative = |e: &ExprId| matches!(sign_of(g, *e, facts), Sign::Positive | Sign::NonNegative);
    if !parts.iter().all(is_none_negative) {
        return false;
    }
    let angles: Vec<ExprId> = g
        .reachable(&[e])
        .into_iter()
        .filter_map(|e| match g.node(e) {
            Node::Function(Func::Sin, angle) => Some(*angle),
            _ => None,
        })
        .collect();
    angles.into_iter().any(|angle| {
        [Func::Sin, Func::Cos].into_iter().all(|f| {
            let value = g.func(f, angle);
            let inverse = g.powi(value, -2);
            parts.iter().any(|part| {
                let factor = g.mul(*part, inverse);
                sign_of(g, factor, facts) == Sign::Positive
            })
        })
    })
}

/// The image of a coordinate of a point of a circle, where the angle has one.
fn on_circle(
    g: &mut Graph,
    circles: &[Circle],
    symbol: SymbolId,
    images: &BTreeMap<String, ExprId>,
) -> Option<Option<ExprId>> {
    let circle = circles.iter().find(|c| c.cosine == symbol || c.sine == symbol)?;
    let of = if circle.cosine == symbol { Func::Cos } else { Func::Sin };
    Some(images.get(&circle.angle).map(|angle| g.func(of, *angle)))
}
