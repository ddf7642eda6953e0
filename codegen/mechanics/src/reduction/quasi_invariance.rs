//! A Lagrangian that a translation of a coordinate changes by the rate of a function, as one that it does not change.
//!
//! `dL/du = df/dt` makes `L - dF/dt` with `F = int f du` independent of `u`; it has the equations of motion of `L`,
//! and its momentum along `u` is `dL/du_dot - f`. At the start `u_0` of the integral `F` and its slopes by everything
//! but `u` vanish, so that no integral is needed: `L - dF/dt = L - f u_dot` at `u = u_0`, and everywhere.
//!
//! Does not know: which momenta the state carries, how velocities follow from momenta.
//!
//! # Source
//! Langerock, Cantrijn, Vankerschaver 2010, Routhian reduction for quasi-invariant Lagrangians, J. Math. Phys. 51,
//! 022902, section 3.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Graph, Rational, Style, SymbolId, primitive};
use hamel_lang::spec::{self, CarriedBy, Diagnostic, Diagnostics, ExpressionRole, Model, QuasiInvariance};

use super::formulation::Formulation;

/// Longest functions that help shows.
const MAX_SHOWN: usize = 80;

/// The slope of the rate of a function by a velocity.
type Gauge = Vec<(SymbolId, ExprId)>;

/// The model with an invariant Lagrangian, without the functions whose rates it does not have any more, and what these
/// add to momenta. The other functions are left: a force or an advected parameter changes those momenta.
///
/// # Errors
/// Lagrangians that change by something else than the rate of the function, and momenta of other velocities that the
/// function would change where the state has them.
pub(super) fn with_invariant_lagrangian(
    mut model: Model,
    formulation: &Formulation,
) -> Result<(Model, Gauge), Diagnostics> {
    let (mut left, mut gauge) = (Vec::new(), Gauge::new());
    for own in model.quasi_invariances.clone() {
        let by = CarriedBy::Parameter(own.parameter.clone());
        if !formulation.momenta.iter().any(|c| c.velocity == own.velocity && c.by == by) {
            continue;
        }
        if model.hamiltonian.is_some() {
            let message = format!("`{}` is up to a function beside a hamiltonian", own.parameter);
            let help = "write the lagrangian, or the hamiltonian in momenta of which one is constant";
            return Err(model.diagnostics(vec![spec::diagnose(&model, own.span, message, help)]));
        }
        let absent = formulation.cyclic_coordinates(&model).into_iter().filter(|k| *k != own.velocity);
        let free = model.graph.free_symbols(own.function);
        if let Some(other) = absent.map(|k| &model.base[k]).find(|c| free.contains(&c.symbol)) {
            let message = format!(
                "`{}` is up to a function of `{}`, which the state does not have",
                own.parameter, other.name
            );
            let help = "translations that do not commute have no momenta that are parameters at once: keep one of them";
            return Err(model.diagnostics(vec![spec::diagnose(&model, own.span, message, help)]));
        }
        let coordinate = model.base[..model.n_shape()].get(own.velocity).map(|c| (c.symbol, c.velocity));
        let slope = coordinate.map(|(u, _)| model.graph.diff(model.lagrangian, u));
        match (coordinate, slope) {
            (Some(coordinate), Some(slope)) if !model.graph.is_zero(slope) => {
                let changed = changed(&mut model, formulation, &own, coordinate, slope);
                gauge.extend(changed.map_err(|problem| model.diagnostics(vec![*problem]))?);
            }
            _ => left.push(own),
        }
    }
    model.quasi_invariances = left;
    Ok((model, gauge))
}

/// Puts the Lagrangian that does not depend on `u`.
fn changed(
    model: &mut Model,
    formulation: &Formulation,
    own: &QuasiInvariance,
    (u, u_dot): (SymbolId, SymbolId),
    slope: ExprId,
) -> Result<Gauge, Box<Diagnostic>> {
    let refused = |model: &Model, message: String, help: String| {
        Err(Box::new(spec::diagnose(model, own.span, message, help)))
    };
    let name = model.graph.name(u).to_owned();
    if let Some(what) = contained(model, own.function) {
        let message = format!("the momentum of `{name}` is up to a function that contains {what}");
        return refused(model, message, "it is made of coordinates and parameters".to_owned());
    }
    if model.frame.is_some() || model.algebroid.is_some() {
        let message = format!("the lagrangian depends on `{name}`, whose momentum is a parameter");
        let help = "beside a frame or an algebroid, subtract the rate of a function from the lagrangian";
        return refused(model, message, help.to_owned());
    }
    let rates = model.base[..model.n_shape()].iter().map(|c| (c.symbol, model.graph.sym(c.velocity)));
    let moving: BTreeMap<SymbolId, ExprId> = rates.collect();
    let along = model.graph.derivative_along(own.function, &moving);
    if !model.graph.is_equal(slope, along) {
        let found = primitive(&mut model.graph, slope, &moving);
        let [slope, function] = [slope, own.function].map(|e| model.graph.display(e, Style::Plain));
        let message = format!(
            "the lagrangian changes along `{name}` by `{slope}`, which is not the rate of `{function}`"
        );
        let help = match found.map(|f| model.graph.display(f, Style::Plain)) {
            Some(f) if f.len() <= MAX_SHOWN => format!("write `routh {name} = {} up to {f};`", own.parameter),
            _ => "its change along the coordinate is the rate of the function".to_owned(),
        };
        return refused(model, message, help);
    }
    let Some(invariant) = at_a_start(&mut model.graph, model.lagrangian, own.function, (u, u_dot)) else {
        let message = format!("the lagrangian has no value at `{name} = 0`, nor at 1, 1/2 and -1");
        let help = format!("subtract the rate of a function from it, so that it does not contain `{name}`");
        return refused(model, message, help);
    };
    let difference = model.graph.sub(model.lagrangian, invariant);
    let mut gauge = Gauge::new();
    for y in model.base[..model.n_shape()].iter().map(|c| c.velocity) {
        let more = model.graph.diff(difference, y);
        if !model.graph.is_zero(more) {
            gauge.push((y, more));
        }
    }
    with_momenta(model, formulation, own, &gauge)?;
    model.lagrangian = invariant;
    Ok(gauge)
}

/// What a function contains beside coordinates of the shape and parameters.
fn contained(model: &Model, function: ExprId) -> Option<String> {
    let free = model.graph.free_symbols(function);
    if free.contains(&model.time) {
        return Some("the time".to_owned());
    }
    let of_groups = model.base[model.n_shape()..].iter().map(|c| c.symbol);
    let advected = model.advected.iter().flat_map(|a| a.components.iter().map(|(_, s)| *s));
    let states = model.first_order.iter().flat_map(|s| s.components.iter().map(|(_, s)| *s));
    let found = of_groups.chain(advected).chain(states).find(|symbol| free.contains(symbol));
    found.map(|symbol| format!("`{}`", model.graph.name(symbol)))
}

/// `L - f u_dot` at a value of `u` where both have one.
fn at_a_start(
    g: &mut Graph,
    lagrangian: ExprId,
    function: ExprId,
    (u, u_dot): (SymbolId, SymbolId),
) -> Option<ExprId> {
    let velocity = g.sym(u_dot);
    let along = g.mul(function, velocity);
    let whole = g.sub(lagrangian, along);
    [(0, 1), (1, 1), (1, 2), (-1, 1)].into_iter().find_map(|(n, d): (i64, i64)| {
        let start = g.rational(Rational::new(n.into(), d.into()));
        let value = g.subs(whole, &BTreeMap::from([(u, start)])).ok()?;
        g.without_value(&[value]).is_none().then_some(value)
    })
}

/// Outputs and casimirs keep the momenta of the model: the function adds to the momenta of the Lagrangian that is
/// invariant.
///
/// # Errors
/// Such momenta in the state, of a noise, and beside constraints.
fn with_momenta(
    model: &mut Model,
    formulation: &Formulation,
    own: &QuasiInvariance,
    gauge: &Gauge,
) -> Result<(), Box<Diagnostic>> {
    let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
    let mut values = BTreeMap::new();
    let mut added = Vec::new();
    for (name, symbol, velocity) in model.momenta.iter().flat_map(|m| m.components.clone()) {
        let Some((_, more)) = gauge.iter().find(|(y, _)| velocities.get(velocity) == Some(y)) else {
            continue;
        };
        let momentum = model.graph.sym(symbol);
        values.insert(symbol, model.graph.add(momentum, *more));
        added.push((name, symbol));
    }
    let by_name = |name: &str| CarriedBy::Momentum(name.to_owned());
    let expressions = model.expressions();
    for (name, symbol) in added {
        let is_state = formulation.momenta.iter().any(|c| c.by == by_name(&name));
        let is_used = |(role, e): &(ExpressionRole, ExprId)| {
            let is_value = matches!(role, ExpressionRole::Output(_) | ExpressionRole::Casimir(_));
            (!is_value || !model.constraints.is_empty()) && model.graph.free_symbols(*e).contains(&symbol)
        };
        if is_state || expressions.iter().any(is_used) {
            let message =
                format!("the momentum `{name}` depends on a coordinate that the state does not have");
            let help = format!(
                "`{}` is up to a function that a part of the lagrangian adds to `{name}`: write velocities in its place",
                own.parameter
            );
            return Err(Box::new(spec::diagnose(model, own.span, message, help)));
        }
    }
    let (graph, expressions) = model.expressions_mut();
    for (role, e) in expressions {
        if matches!(role, ExpressionRole::Output(_) | ExpressionRole::Casimir(_)) {
            // Sums of symbols: nothing is divided by more than before.
            *e = graph.subs(*e, &values).unwrap_or(*e);
        }
    }
    Ok(())
}
