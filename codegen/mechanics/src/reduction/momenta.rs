//! Which momenta stand for velocities in the state, and what momenta in outputs are.
//!
//! Does not know: how velocities follow from momenta, how momenta move.

use std::collections::BTreeMap;

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::spec::{self, Carried, CarriedBy, Model};

use super::constraint::{KinematicConstraint, Unknown};
use super::formulation::Formulation;
use super::reconstruction::ReconstructedCoordinate;

/// The momentum `pi_b = W^a_b dL/dy^a` of an unknown, which the state carries, or which is a parameter.
#[derive(Clone, Debug)]
pub struct CarriedMomentum {
    /// The unknown, by its place in `ReducedSystem::unknowns`.
    pub unknown: usize,
    /// Its name: of the state variable, or of the parameter.
    pub name: String,
    /// Its symbol, or the number that the parameter is fixed to, and the function that it is constant up to.
    pub value: ExprId,
    /// Its symbol where it is a state variable; none where it is a parameter.
    pub symbol: Option<SymbolId>,
    /// What it is.
    pub doc: String,
    /// The base coordinate whose velocity the unknown is, where the momentum is a parameter: only its motion needs it.
    pub cyclic: Option<SymbolId>,
}

/// A function on the dual of the algebroid: `xdot = rho dh/dp`,
/// `pdot_a = -C^c_ab (dh/dp_b) p_c - rho^i_a dh/dx^i + F_a`.
#[derive(Clone, Debug)]
pub struct Hamiltonian {
    /// `h(x, p, t)`.
    pub h: ExprId,
    /// Symbols of the momenta `p_alpha`, in frame order.
    pub momenta: Vec<SymbolId>,
}

/// The momenta that a formulation carries, with `unknowns` in its state otherwise.
///
/// # Errors
/// A momentum along a velocity that the constraints determine.
pub(super) fn carried(
    model: &mut Model,
    formulation: &Formulation,
    unknowns: &[Unknown],
) -> Result<Vec<CarriedMomentum>, Box<spec::Diagnostic>> {
    let mut momenta = Vec::new();
    for Carried { velocity, by } in &formulation.momenta {
        let place = place_of(model, unknowns, *velocity);
        let own = model.momenta.iter().flat_map(|m| m.components.iter().map(move |c| (m, c)));
        let mut own =
            own.filter(|(_, (.., k))| k == velocity).map(|(m, (_, symbol, _))| (m.doc.clone(), *symbol));
        let declared = own.next();
        let (name, value, symbol) = match by {
            CarriedBy::Velocity | CarriedBy::Levels(_) => continue,
            CarriedBy::Momentum(name) => {
                let symbol =
                    declared.as_ref().map_or_else(|| model.graph.symbol(name), |(_, symbol)| *symbol);
                (name, model.graph.sym(symbol), Some(symbol))
            }
            CarriedBy::Parameter(name) => {
                let param = model.params.iter().find(|p| p.name == *name).map(|p| p.symbol);
                let fixed = formulation.fixed.iter().find(|(fixed, _)| fixed == name);
                let value = match (param, fixed) {
                    (Some(symbol), _) => model.graph.sym(symbol),
                    (None, Some((_, number))) => model.graph.rational(number.clone()),
                    (None, None) => {
                        let known = model.params.iter().map(|p| p.name.clone()).collect();
                        let error = Error::UnknownName { name: name.clone(), kind: "parameter", known };
                        return Err(Box::new(model.diagnose(&error)));
                    }
                };
                let up_to = model.quasi_invariances.iter();
                let up_to = up_to.filter(|q| q.velocity == *velocity && q.parameter == *name);
                let functions: Vec<ExprId> = up_to.map(|q| q.function).chain([value]).collect();
                (name, model.graph.sum(&functions), None)
            }
        };
        let Some(unknown) = place else {
            // Of a vector, those that stay in the state have momenta; a number has been asked for by itself.
            let whole = model.momenta.iter().find(|m| m.components.iter().any(|(.., k)| k == velocity));
            let has_others = whole
                .is_some_and(|m| m.components.iter().any(|(.., k)| place_of(model, unknowns, *k).is_some()));
            if symbol.is_some() && has_others {
                continue;
            }
            let velocity = name_of(model, *velocity);
            let message = format!("`{name}` is no state variable: the constraints determine `{velocity}`");
            let free: Vec<&str> = unknowns.iter().map(|u| u.name.as_str()).collect();
            let help = format!("velocities in the state: {}", free.join(", "));
            let span = model.places.carries.get(name).copied();
            return Err(Box::new(spec::diagnose(model, span, message, help)));
        };
        let doc = match declared {
            Some((doc, _)) if !doc.is_empty() => doc,
            _ => format!("momentum along {}", unknowns[unknown].name),
        };
        let coordinate = model.base[..model.n_shape()].get(*velocity).map(|c| c.symbol);
        let cyclic = coordinate.filter(|_| symbol.is_none());
        momenta.push(CarriedMomentum { unknown, name: name.clone(), value, symbol, doc, cyclic });
    }
    momenta.sort_by_key(|m| m.unknown);
    Ok(momenta)
}

/// The Hamiltonian with the symbols of all momenta, where the model has one.
///
/// # Errors
/// A velocity that the state carries itself.
pub(super) fn hamiltonian(
    model: &Model,
    carried: &[CarriedMomentum],
) -> Result<Option<Hamiltonian>, Box<spec::Diagnostic>> {
    let Some(h) = model.hamiltonian else { return Ok(None) };
    let mut momenta = Vec::new();
    for (k, (name, _)) in model.all_velocities().into_iter().enumerate() {
        let components = model.momenta.iter().flat_map(|m| &m.components);
        let own = components.into_iter().find(|(.., velocity)| *velocity == k);
        match own {
            Some((_, symbol, _)) if carried.iter().any(|m| m.unknown == k) => momenta.push(*symbol),
            _ => {
                let message = format!("the state cannot carry `{name}`: a hamiltonian has momenta");
                let help = "the output `velocities` has it; a lagrangian can be carried either way";
                return Err(Box::new(spec::diagnose(model, model.places.lagrangian, message, help)));
            }
        }
    }
    Ok(Some(Hamiltonian { h, momenta }))
}

/// The coordinates that only a reconstruction needs, with their rates.
pub(super) fn cyclic_coordinates<'a>(
    model: &'a mut Model,
    momenta: &'a [CarriedMomentum],
) -> impl Iterator<Item = ReconstructedCoordinate> + 'a {
    let (base, graph) = (&model.base, &mut model.graph);
    let is_cyclic = |symbol: SymbolId| momenta.iter().any(|m| m.cyclic == Some(symbol));
    base.iter().filter(move |c| is_cyclic(c.symbol)).map(|c| ReconstructedCoordinate {
        name: c.name.clone(),
        symbol: c.symbol,
        rate: graph.sym(c.velocity),
        is_abelian: true,
        doc: c.doc.clone(),
    })
}

/// Puts `W^T dL/dy` for every momentum that outputs and casimirs mention and the state does not carry.
///
/// # Errors
/// A momentum along a velocity that the constraints determine.
pub(super) fn spell_out(
    model: &mut Model,
    constraint: &KinematicConstraint,
    unknowns: &[Unknown],
    carried: &[CarriedMomentum],
) -> Result<(), Vec<spec::Diagnostic>> {
    let velocities: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
    let mut values: BTreeMap<SymbolId, ExprId> = BTreeMap::new();
    let mut missing: Vec<(SymbolId, String, String)> = Vec::new();
    for momentum in model.momenta.clone() {
        for (name, symbol, velocity) in momentum.components {
            let Some(unknown) = place_of(model, unknowns, velocity) else {
                missing.push((symbol, name, name_of(model, velocity)));
                continue;
            };
            match carried.iter().find(|m| m.unknown == unknown) {
                Some(m) if m.symbol == Some(symbol) => {}
                Some(m) => _ = values.insert(symbol, m.value),
                None => {
                    let g = &mut model.graph;
                    let value = momentum_of(g, model.lagrangian, &velocities, constraint, unknown);
                    values.insert(symbol, value);
                }
            }
        }
    }
    let mut problems = Vec::new();
    let (mut casimirs, mut outputs) =
        (std::mem::take(&mut model.casimirs), std::mem::take(&mut model.outputs));
    let of_casimirs = casimirs.iter_mut().map(|c| (c.name.clone(), &mut c.expr));
    let of_outputs = outputs.iter_mut();
    let of_outputs = of_outputs.flat_map(|o| o.components.iter_mut().map(|(_, e)| (o.name.clone(), e)));
    for (output, e) in of_casimirs.chain(of_outputs) {
        let span = model.places.outputs.get(&output).copied();
        let free = model.graph.free_symbols(*e);
        if let Some((_, name, velocity)) = missing.iter().find(|(symbol, ..)| free.contains(symbol)) {
            let message = format!(
                "`{output}` contains the momentum `{name}`, but the constraints determine `{velocity}`"
            );
            let help = "write it in velocities, or choose others with `independent`";
            problems.push(spec::diagnose(model, span, message, help));
            continue;
        }
        match model.graph.subs(*e, &values) {
            Ok(value) => *e = value,
            Err(_) => {
                let message = format!("`{output}` divides by zero where its momenta are spelled out");
                let help = "divide by something that does not vanish";
                problems.push(spec::diagnose(model, span, message, help));
            }
        }
    }
    (model.casimirs, model.outputs) = (casimirs, outputs);
    if problems.is_empty() { Ok(()) } else { Err(problems) }
}

/// `W^a_b dL/dy^a`, in the velocities of the frame.
pub fn momentum_of(
    g: &mut Graph,
    lagrangian: ExprId,
    velocities: &[SymbolId],
    constraint: &KinematicConstraint,
    unknown: usize,
) -> ExprId {
    match constraint {
        KinematicConstraint::Multipliers { .. } => g.diff(lagrangian, velocities[unknown]),
        KinematicConstraint::Solved(solved) => {
            let mut terms = Vec::new();
            for (velocity, row) in velocities.iter().zip(&solved.virtual_displacements) {
                let slope = g.diff(lagrangian, *velocity);
                terms.push(g.mul(row[unknown], slope));
            }
            g.sum(&terms)
        }
    }
}

/// The unknown that a velocity is, by index as in [`Carried`].
pub(super) fn place_of(model: &Model, unknowns: &[Unknown], velocity: usize) -> Option<usize> {
    let n_frame = model.n_shape() + model.velocities.len();
    unknowns.iter().position(|u| match u.frame_idx {
        Some(k) => k == velocity,
        None => velocity >= n_frame && model.quasi_velocities[velocity - n_frame].symbol == u.symbol,
    })
}

fn name_of(model: &Model, velocity: usize) -> String {
    let quasi = model.quasi_velocities.iter().map(|v| v.name.as_str());
    let names: Vec<&str> = model.all_velocities().into_iter().map(|(name, _)| name).chain(quasi).collect();
    names[velocity].to_owned()
}
