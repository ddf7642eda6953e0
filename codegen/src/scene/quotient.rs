//! The map of a model that says to be the quotient of another, as functions of the other's state and parameters.
//!
//! Does not know: how the map is proved, how it is lowered or emitted.

use std::collections::BTreeMap;

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Func, Graph, Style, SymbolId, inlined};
use hamel_lang::spec::{Diagnostic, Diagnostics, Model, NamedVector, OutputPart, Total, Wanted};
use hamel_mechanics::mechanics::{Equations, StateEquation};
use hamel_mechanics::reduction::{Circle, Formulation};
use hamel_program::lower::Request;
use hamel_program::program::{Program, Role, Symbols};

use super::build::build_planned;
use super::plan::{DEFAULT, Outputs, Plan};
use super::{BuiltScene, Scenes};
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

/// The system that a model is the quotient of: its rates, and as an output the images of variables and parameters of
/// the quotient, by their names.
#[derive(Clone, Debug)]
pub(crate) struct TotalSystem {
    /// The file that the quotient names.
    pub(super) file: String,
    /// The scene, held to its own model.
    pub(super) scene: BuiltScene,
}

impl TotalSystem {
    /// The only model that `model` is the quotient of, after the proof that it is.
    ///
    /// # Errors
    /// A text that nobody has read or that is wrong, conditions that do not hold, everything that a scene can find.
    pub(super) fn of(model: &Model) -> Result<TotalSystem, Diagnostics> {
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
        let images = images(model, total, &mut other).map_err(|missing| {
            let message = format!("the map gives no `{missing}`");
            fail(Some(total), message, "give all parameters, or leave out those that stand nowhere")
        })?;
        let part = OutputPart::Own;
        other.outputs =
            vec![NamedVector { name: STATE.to_owned(), components: images, doc: String::new(), part }];
        other.scenes.clear();
        let outputs = Outputs::Named(vec![Wanted::Own(STATE.to_owned())]);
        let plan = Plan { outputs, ..Plan::bare(DEFAULT.to_owned(), Formulation::of(&other)) };
        let scene = build_planned(&Scenes::new(&other).derivations, plan)?;
        Ok(TotalSystem { file: total.file.clone(), scene })
    }

    /// Names of the components of the total state, and of the total parameters.
    pub(super) fn variables(&self) -> [&[String]; 2] {
        [&self.scene.program.state, &self.scene.program.params]
    }
}

/// Variables and parameters of the quotient by the total system; those without a function are the ones of the same
/// name there. The error is the name of a parameter without an image.
fn images(model: &Model, total: &Total, other: &mut Model) -> Result<Vec<(String, ExprId)>, String> {
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
    let missing = model.params.iter().find(|param| !is_given(&images, &param.name));
    missing.map_or(Ok(images), |param| Err(param.name.clone()))
}

/// Parameters and variables of a model that functions of it may name.
fn symbols(model: &Model) -> Vec<(String, SymbolId)> {
    let mut all: Vec<(String, SymbolId)> =
        model.params.iter().map(|p| (p.name.clone(), p.symbol)).collect();
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
    let images = imported(g, program, (system.time, &of_state, &of_params))?;
    for (name, fixed) in &system.formulation.fixed {
        let Some(image) = images.get(name) else { continue };
        let (image, fixed) = (*image, g.rational(fixed.clone()));
        let apart = g.sub(image, fixed);
        if !g.is_zero(apart) {
            let image = g.display(image, Style::Plain);
            let reason = format!("the scene fixes {name}, and the map gives it as {image}");
            return Err(Error::NoQuotient { reason });
        }
    }
    let values = state.iter().map(|s| Ok((s.name.clone(), image_of(g, equations, s, &images)?)));
    let values = values.collect::<Result<Vec<_>, Error>>()?;
    let params = system.params.iter().filter_map(|p| Some((p.name.clone(), *images.get(&p.name)?)));
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

/// The image of a component of the state.
fn image_of(
    g: &mut Graph,
    equations: &Equations,
    component: &StateEquation,
    images: &BTreeMap<String, ExprId>,
) -> Result<ExprId, Error> {
    let system = &equations.system;
    let missing = |name: &str| Error::NoQuotient { reason: format!("the map gives no {name}") };
    if let Some(image) = images.get(&component.name) {
        return Ok(*image);
    }
    if let Some(point) = on_circle(g, &system.circles, component.symbol, images) {
        return point.ok_or_else(|| missing(&component.name));
    }
    let legendre = &equations.legendre;
    let momentum = legendre.momenta.iter().find(|(name, _)| *name == component.name);
    let (_, value) = momentum.ok_or_else(|| missing(&component.name))?;
    let definitions = inlined(g, equations.sections.iter().flat_map(|s| &s.definitions));
    let value = g.subs(*value, &definitions).map_err(|_| missing(&component.name))?;
    let velocities = legendre.velocities.iter().map(|(name, symbol)| (name.clone(), *symbol));
    let others = system.params.iter().map(|p| (p.name.clone(), p.symbol));
    let base = equations.state.iter().map(|s| (s.name.clone(), s.symbol));
    let known: Vec<(String, SymbolId)> = velocities.chain(others).chain(base).collect();
    let mut replaced = BTreeMap::new();
    for symbol in g.free_symbols(value) {
        let Some((name, _)) = known.iter().find(|(_, own)| *own == symbol) else { continue };
        let image = match on_circle(g, &system.circles, symbol, images) {
            Some(point) => point,
            None => images.get(name).copied(),
        };
        let image = image.ok_or_else(|| missing(name))?;
        replaced.insert(symbol, image);
    }
    g.subs(value, &replaced).map_err(|_| missing(&component.name))
}

/// The image of a coordinate of a point of a circle, where the angle has one; none for other symbols.
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
