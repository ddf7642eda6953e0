//! Constraints that give a velocity without inertia, such as the entropy of what friction heats: the coordinate becomes
//! a state of first order.
//!
//! A constraint `a(x, y) s' + b(x, y) = 0` on a base velocity `s'` that the Lagrangian does not contain is a rate of
//! the coordinate `s`. Nothing accelerates along `s`: its equation of motion is the balance of `dL/ds`, of the force on
//! it and of the reaction, which acts along the displacements that the constraint allows,
//! `delta s = w_alpha delta^alpha`. What is left of it is a force on the other velocities,
//!
//! ```text
//! s' = -b/a,    F_alpha + w_alpha (dL/ds + F_s)
//! ```
//!
//! Does not know: other constraints, the algebroid.
//!
//! # Source
//! Gay-Balmaz, Yoshimura 2017, A Lagrangian variational formulation for nonequilibrium thermodynamics I, section 3.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SymbolId, Vanishing};
use hamel_lang::spec::{Constraint, ConstraintKind, Diagnostics, FirstOrderState, Model, VirtualConstraint};

use super::formulation::Formulation;

/// The model with states of first order in the place of coordinates whose velocities have no inertia and are given by a
/// nonlinear constraint; the model itself where there are none, or where something else says what the velocities are.
///
/// # Errors
/// [`Error::DivisionByZero`] where something divides by such a velocity, which vanishes.
pub(super) fn without_inertialess(model: Model, formulation: &Formulation) -> Result<Model, Diagnostics> {
    let is_plain = model.algebroid.is_none()
        && model.frame.is_none()
        && model.given.is_none()
        && model.hamiltonian.is_none()
        && model.connection.is_none()
        && model.accelerations.is_empty()
        && model.quasi_velocities.is_empty()
        && model.independent.is_none()
        && model.momenta.is_empty()
        && model.carries.is_empty()
        && formulation.momenta.is_empty();
    let mut model = model;
    while let Some(found) = is_plain.then(|| found(&mut model)).flatten() {
        model = rewritten(model, found)?;
    }
    // Powers that are linear say what the constraints do.
    let is_linear = |v: &VirtualConstraint| {
        let own = |c: &&Constraint| v.power_of.as_ref() == Some(&c.name);
        model.constraints.iter().find(own).is_some_and(|c| c.kind == ConstraintKind::Linear)
    };
    if model.virtual_constraints.iter().all(is_linear) {
        model.virtual_constraints.clear();
    }
    Ok(model)
}

/// A constraint, and the coordinate whose velocity it gives.
struct Found {
    constraint: usize,
    coordinate: usize,
    /// The rate of the coordinate.
    rate: ExprId,
    /// `w`, one for each velocity: what a displacement along it moves the coordinate by; zero for its own.
    displaced: Vec<ExprId>,
    /// The condition on virtual displacements that says so, where the model has some.
    condition: Option<usize>,
}

fn found(model: &mut Model) -> Option<Found> {
    for constraint in 0..model.constraints.len() {
        for coordinate in 0..model.base.len() {
            if gives_rates(model, constraint, coordinate) && has_no_inertia(model, coordinate, constraint) {
                let found = solved(model, constraint, coordinate);
                if found.is_some() {
                    return found;
                }
            }
        }
    }
    None
}

/// Whether a constraint is one that gives a velocity: it is not linear, or it says how a power heats, and what moves
/// does not heat.
fn gives_rates(model: &Model, constraint: usize, coordinate: usize) -> bool {
    let Constraint { kind, name, .. } = &model.constraints[constraint];
    let heats = |v: &VirtualConstraint| {
        let along = (0..v.one_form.len()).filter(|k| v.one_form[*k] != model.graph.zero());
        v.power_of.as_ref() == Some(name) && along.eq([coordinate])
    };
    match kind {
        ConstraintKind::Nonlinear => true,
        ConstraintKind::Linear => model.virtual_constraints.iter().any(heats),
        ConstraintKind::SecondOrder { .. } | ConstraintKind::ThirdOrder { .. } => false,
    }
}

/// Whether the velocity of a coordinate is in one constraint alone, and neither in the Lagrangian nor set by an event.
fn has_no_inertia(model: &mut Model, coordinate: usize, own: usize) -> bool {
    let (symbol, velocity) = (model.base[coordinate].symbol, model.base[coordinate].velocity);
    let slope = model.graph.diff(model.lagrangian, velocity);
    let is_in = |g: &Graph, e: ExprId, s: SymbolId| g.free_symbols(e).contains(&s);
    let elsewhere = model.constraints.iter().enumerate().any(|(k, constraint)| {
        let accelerates = match &constraint.kind {
            ConstraintKind::SecondOrder { acceleration } => acceleration[coordinate] != model.graph.zero(),
            ConstraintKind::ThirdOrder { .. } => true,
            ConstraintKind::Linear | ConstraintKind::Nonlinear => false,
        };
        let keeps = constraint.position.is_some_and(|p| is_in(&model.graph, p.residual, symbol));
        keeps || accelerates || (k != own && is_in(&model.graph, constraint.residual, velocity))
    });
    let is_set = model.events.iter().any(|event| event.sets.contains(&velocity));
    !elsewhere && !is_set && model.graph.is_zero(slope)
}

fn solved(model: &mut Model, constraint: usize, coordinate: usize) -> Option<Found> {
    let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
    let own = velocities[coordinate];
    let residual = model.constraints[constraint].residual;
    let on: Vec<usize> =
        (0..model.virtual_constraints.len()).filter(|k| restricts(model, *k, coordinate)).collect();
    let condition = match (&on[..], model.virtual_constraints.is_empty()) {
        ([], true) => None,
        ([only], false) => Some(*only),
        _ => return None,
    };
    let g = &mut model.graph;
    let (slopes, offset) = g.affine_parts(residual, &[own])?;
    let is_divisor = |g: &mut Graph, e: ExprId| g.vanishing(e) == Vanishing::NonZero;
    if !is_divisor(g, slopes[0]) {
        return None;
    }
    let minus = g.neg(offset);
    let rate = g.div(minus, slopes[0]).ok()?;
    let value = BTreeMap::from([(own, rate)]);
    let form: Vec<ExprId> = match condition {
        Some(k) => model.virtual_constraints[k].one_form.clone(),
        // Chetaev's displacements.
        None => velocities.iter().map(|y| g.diff(residual, *y)).collect(),
    };
    let form = g.subs_all(&form, &value).ok()?;
    if !is_divisor(g, form[coordinate]) {
        return None;
    }
    let mut displaced = Vec::new();
    for (k, e) in form.iter().enumerate() {
        let along = g.div(*e, form[coordinate]).ok()?;
        displaced.push(if k == coordinate { g.zero() } else { g.neg(along) });
    }
    Some(Found { constraint, coordinate, rate, displaced, condition })
}

fn restricts(model: &Model, condition: usize, velocity: usize) -> bool {
    model.virtual_constraints[condition].one_form[velocity] != model.graph.zero()
}

fn rewritten(mut model: Model, found: Found) -> Result<Model, Diagnostics> {
    let Found { constraint, coordinate: at, rate, displaced, condition } = found;
    let coordinate = model.base.remove(at);
    let constraint = model.constraints.remove(constraint);
    let condition = condition.map(|k| model.virtual_constraints.remove(k));
    let is_entropy = condition.is_some_and(|condition| condition.power_of.is_some());
    let own = model.forces.remove(at);
    let slope = model.graph.diff(model.lagrangian, coordinate.symbol);
    let net = model.graph.add(slope, own);
    let others = displaced.iter().enumerate().filter(|(k, _)| *k != at).map(|(_, w)| *w);
    for (force, w) in model.forces.iter_mut().zip(others) {
        let along = model.graph.mul(w, net);
        *force = model.graph.add(*force, along);
    }
    for condition in &mut model.virtual_constraints {
        condition.one_form.remove(at);
    }
    for constraint in &mut model.constraints {
        if let ConstraintKind::SecondOrder { acceleration } = &mut constraint.kind {
            acceleration.remove(at);
        }
        // Positions behind the one that is gone.
        let moved = |k: usize| if k > at { k - 1 } else { k };
        constraint.gives = constraint.gives.map(moved);
        if let Some(position) = &mut constraint.position {
            position.determines = position.determines.map(moved);
        }
    }
    model.first_order.push(FirstOrderState {
        name: coordinate.name.clone(),
        components: vec![(coordinate.name.clone(), coordinate.symbol)],
        domain: coordinate.domain,
        rates: vec![rate],
        is_entropy,
        is_mode: false,
        doc: coordinate.doc,
        span: model.places.declared.get(&coordinate.name).copied(),
        of_rate: constraint.span,
    });
    let values = BTreeMap::from([(coordinate.velocity, rate)]);
    let mentioned = BTreeSet::from([coordinate.velocity]);
    let (graph, expressions) = model.expressions_mut();
    let mut is_fine = true;
    for (_, e) in expressions {
        if graph.depends_on(*e, &mentioned) {
            match graph.subs(*e, &values) {
                Ok(value) => *e = graph.cancel_zero(value),
                Err(_) => is_fine = false,
            }
        }
    }
    if is_fine {
        return Ok(model);
    }
    let place = format!("the velocity that constraint `{}` gives", constraint.text);
    Err(model.diagnostics(vec![model.diagnose(&Error::DivisionByZero { place })]))
}
