//! Geometric and dynamic phases: the rate of a coordinate that an abelian group moves, split by a connection.
//!
//! `thetadot = v - A(x) xdot`: the integral of `-A(x) xdot` depends on the path in the base alone, not on the time that
//! it takes, and is the geometric phase; that of the rest is the dynamic one. Where the momentum of a cyclic coordinate
//! is a parameter, the connection is the mechanical one, `A = K^-1 L_vx`, with `K = L_vv` along all velocities for
//! which the state carries momenta.
//!
//! Does not know: where a connection came from, which scene wants phases.
//!
//! # Source
//! Marsden, Montgomery, Ratiu 1990, Reduction, symmetry, and phases in mechanics.

use std::collections::BTreeMap;

use crate::reduction::{KinematicConstraint, ReconstructedCoordinate};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::algebra::solve_symmetric;

use super::equations::Equations;

/// The rate of a coordinate in two parts.
#[derive(Clone, Debug)]
pub struct Phase {
    /// Name of the coordinate.
    pub name: String,
    /// `-A(x) xdot`, in terms of the state and the definitions of the equations.
    pub geometric: ExprId,
    /// The rest of the rate.
    pub dynamic: ExprId,
}

/// The phases of all coordinates that have them: those of abelian groups where the model has a connection, and cyclic
/// ones whose momentum is a parameter. None beside quasi-velocities, and in frames adapted to stages.
///
/// # Errors
/// [`Error::DivisionByZero`] of a rate that has no value on the constraint.
pub fn phases(g: &mut Graph, equations: &Equations) -> Result<Vec<Phase>, Error> {
    let system = &equations.system;
    let is_lift = system.lift.is_some();
    if system.frame.is_some() && !is_lift || system.quasi_frame.is_some() {
        return Ok(Vec::new());
    }
    let values: BTreeMap<SymbolId, ExprId> =
        system.velocities.iter().copied().zip(equations.velocities.iter().copied()).collect();
    let place = |_| Error::DivisionByZero { place: "the phases on the constraint".into() };
    let mut found = Vec::new();
    for coordinate in system.reconstruction.iter().filter(|c| c.is_abelian) {
        let raw = match cyclic_part(g, equations, coordinate) {
            Some(part) => Some(part),
            None => connection_part(g, equations, coordinate),
        };
        let Some(raw) = raw else { continue };
        let rest = g.sub(coordinate.rate, raw);
        let parts = g.subs_all(&[raw, rest], &values).map_err(place)?;
        let [geometric, dynamic] = [parts[0], parts[1]].map(|e| g.cancel_zero(e));
        found.push(Phase { name: coordinate.name.clone(), geometric, dynamic });
    }
    Ok(found)
}

/// The part of a rate along the base velocities, where the model has a connection.
fn connection_part(
    g: &mut Graph,
    equations: &Equations,
    coordinate: &ReconstructedCoordinate,
) -> Option<ExprId> {
    let system = &equations.system;
    let n_shape = system.velocities.len() - system.connection.as_ref()?.len();
    let mut terms = Vec::new();
    // What the horizontal lift of a base velocity is along the frame.
    let inverse = system.lift.as_ref().and(system.frame.as_ref()).map(|frame| &frame.inverse);
    for (i, base) in system.velocities[..n_shape].iter().enumerate() {
        let velocity = g.sym(*base);
        for (alpha, y) in system.velocities.iter().enumerate() {
            let own = if alpha == i { g.one() } else { g.zero() };
            let along = inverse.map_or(own, |inverse| inverse[alpha][i]);
            let slope = g.diff(coordinate.rate, *y);
            terms.push(g.product(&[slope, along, velocity]));
        }
    }
    Some(g.sum(&terms))
}

/// `-(K^-1 L_vx xdot)` along a cyclic coordinate; none for others, and beside constraints.
fn cyclic_part(g: &mut Graph, equations: &Equations, coordinate: &ReconstructedCoordinate) -> Option<ExprId> {
    let system = &equations.system;
    let KinematicConstraint::Solved(solved) = &system.constraint else { return None };
    if !solved.dependent.is_empty() || system.hamiltonian.is_some() {
        return None;
    }
    let cyclic = system.momenta.iter().find(|m| m.cyclic == Some(coordinate.symbol))?;
    // In an internal frame the momenta of the model are not along velocities of the frame.
    let frame = |unknown: usize| {
        let symbol = system.unknowns[unknown].symbol;
        system.velocities.iter().position(|y| *y == symbol)
    };
    let along: Vec<usize> = system.momenta.iter().map(|m| frame(m.unknown)).collect::<Option<_>>()?;
    let own = along.iter().position(|a| Some(*a) == frame(cyclic.unknown))?;
    let mut second = |a: usize, b: usize| {
        let p = g.diff(system.lagrangian, system.velocities[a]);
        let entry = g.diff(p, system.velocities[b]);
        g.cancel_zero(entry)
    };
    let rest: Vec<usize> = (0..system.velocities.len()).filter(|k| !along.contains(k)).collect();
    let metric: Vec<Vec<ExprId>> =
        along.iter().map(|a| along.iter().map(|b| second(*a, *b)).collect()).collect();
    let coupling: Vec<Vec<ExprId>> =
        along.iter().map(|a| rest.iter().map(|i| second(*a, *i)).collect()).collect();
    let mut right = Vec::new();
    for row in coupling {
        let mut terms = Vec::new();
        for (entry, i) in row.into_iter().zip(&rest) {
            let velocity = g.sym(system.velocities[*i]);
            terms.push(g.mul(entry, velocity));
        }
        right.push(vec![g.sum(&terms)]);
    }
    let solution = solve_symmetric(g, &metric, &right).ok()?;
    Some(g.neg(solution[own][0]))
}
