//! A system with the velocities of a mechanical connection in its state, in the frame that its model is written in.
//!
//! Does not know: how the connection came about, equations of motion.

use std::collections::BTreeMap;

use hamel_expr::error::Error;
use hamel_expr::{DivisionByZero, ExprId, Graph, SymbolId};

use super::change::{Frame, tidied};
use super::constraint::{KinematicConstraint, Reactions, SolvedConstraint, Unknown};
use super::lift::Lift;
use super::system::ReducedSystem;

/// The system in the frame of its model, with the velocities `w = v + A xdot` in its state in the place of `v`.
///
/// # Errors
/// [`Error::DivisionByZero`].
pub(super) fn over_lift(mut system: ReducedSystem, lift: Lift) -> Result<ReducedSystem, Error> {
    let (m, n) = (system.velocities.len(), system.velocities.len() - lift.inertia.len());
    let own = system.unknowns.clone();
    let is_connected = system.connection.is_some();
    let g = &mut system.graph;
    let mut names: Vec<String> = own.iter().map(|u| u.name.clone()).collect();
    let stem = if is_connected { "v" } else { "xi" };
    names[n..].iter_mut().for_each(|name| *name = format!("{stem}_{name}"));
    let behind: Vec<SymbolId> = names[n..].iter().map(|name| g.symbol(name)).collect();
    let renamed: BTreeMap<SymbolId, ExprId> =
        own[n..].iter().zip(&behind).map(|(u, s)| (u.symbol, g.sym(*s))).collect();
    let replace = |g: &mut Graph, e: &mut ExprId| -> Result<(), Error> {
        let divided = |_: DivisionByZero| Error::DivisionByZero { place: "the change of connection".into() };
        *e = g.subs(*e, &renamed).map_err(divided)?;
        Ok(())
    };
    let of_outputs = system.outputs.iter_mut().flat_map(|o| &mut o.components).map(|(_, e)| e);
    let of_rates = system.reconstruction.iter_mut().map(|c| &mut c.rate);
    let of_rates = of_rates.chain(system.own_rates.iter_mut().map(|own| &mut own.rate));
    let of_rates = of_rates.chain(system.noise_rates.iter_mut().map(|(_, rate)| rate));
    let all = system.casimirs.iter_mut().map(|c| &mut c.expr).chain(of_outputs).chain(of_rates);
    for e in all.chain(system.forces.iter_mut()).chain([&mut system.lagrangian]) {
        replace(g, e)?;
    }
    let (zero, one) = (g.zero(), g.one());
    let unit = |i: usize, j: usize| if i == j { one } else { zero };
    let mut matrix: Vec<Vec<ExprId>> = (0..m).map(|i| (0..m).map(|j| unit(i, j)).collect()).collect();
    let mut inverse = matrix.clone();
    for (a, row) in lift.connection.iter().enumerate() {
        for (i, e) in row.iter().enumerate() {
            matrix[n + a][i] = *e;
            inverse[n + a][i] = g.neg(*e);
        }
    }
    let unknowns = own.iter().enumerate();
    let unknowns = unknowns.map(|(k, u)| Unknown { frame_idx: Some(k).filter(|k| *k < n), ..u.clone() });
    system.unknowns = unknowns.collect();
    system.constraint = KinematicConstraint::Solved(SolvedConstraint {
        unknowns: system.unknowns.clone(),
        dependent: (n..m).collect(),
        psi: inverse.clone(),
        psi0: vec![zero; m],
        virtual_displacements: inverse.clone(),
        reactions: Reactions { names: Vec::new(), one_forms: Vec::new(), on: Vec::new() },
        rows: Vec::new(),
        pivots: Vec::new(),
        response: None,
    });
    let given = system.connection.take().unwrap_or_else(|| vec![vec![zero; n]; m - n]);
    let sum = |g: &mut Graph, (a, b): (&ExprId, &ExprId)| tidied(g, |g| g.add(*a, *b));
    let total = given.iter().zip(&lift.connection);
    let total = total.map(|(a, b)| a.iter().zip(b).map(|pair| sum(g, pair)).collect()).collect();
    system.connection = Some(total);
    system.velocities.splice(n.., behind);
    system.algebroid.rename_frame(names);
    system.frame = Some(Frame { original: own, matrix, inverse });
    system.lift = Some(lift);
    Ok(system)
}
