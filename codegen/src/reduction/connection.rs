//! The same system written with another connection: other coordinates, the same motion.

use std::collections::BTreeMap;

use crate::algebra::solve_symbolic;
use crate::error::Error;
use crate::expr::{ExprId, Graph, SymbolId};
use crate::spec::{ConnectionKind, ConstraintKind, Diagnostics, Model, ReconstructionKind};

use super::constraint::{KinematicConstraint, SolvedConstraint};
use super::front_end::reduce;
use super::reconstruction;

/// Rewrites a model so that its velocity is `v = xi + A(x) xdot` for the connection asked for.
///
/// * trivial: `A = 0`;
/// * mechanical: the horizontal space is orthogonal to the group orbits in the kinetic energy, so that the Hessian of `L`
///   has no block between `v` and `xdot`;
/// * nonholonomic: the horizontal space lies in the constraint distribution `D` and is orthogonal to `S = D` intersected
///   with the orbits.
///
/// # Errors
/// A degenerate kinetic energy along the orbits; for the nonholonomic connection also constraints that are not linear, or
/// that restrict base velocities.
///
/// # Source
/// Marsden, Montgomery, Ratiu 1990 (mechanical); Bloch, Krishnaprasad, Marsden, Murray 1996 (nonholonomic).
pub fn with_connection(model: &Model, kind: ConnectionKind) -> Result<Model, Diagnostics> {
    if model.base.is_empty() || model.algebra.dim() == 0 {
        return Ok(model.clone());
    }
    let mut rewritten = model.clone();
    let (n, dim) = (model.base.len(), model.algebra.dim());
    let zero = model.graph.zero();
    let given = model.connection.clone().unwrap_or_else(|| vec![vec![zero; n]; dim]);
    let g = &mut rewritten.graph;
    let shift = match kind {
        ConnectionKind::Trivial => given.iter().map(|row| row.iter().map(|e| g.neg(*e)).collect()).collect(),
        ConnectionKind::Mechanical => mechanical_shift(g, model)
            .map_err(|e| refused(model, &g.within_budget().err().map_or(e, Error::from)))?,
        ConnectionKind::Nonholonomic => nonholonomic_shift(g, model)?,
    };
    shift_velocities(&mut rewritten, &shift).map_err(|e| refused(model, &e))?;
    let total: Vec<Vec<ExprId>> = given
        .iter()
        .zip(&shift)
        .map(|(old, new)| {
            old.iter()
                .zip(new)
                .map(|(a, b)| {
                    let sum = rewritten.graph.add(*a, *b);
                    rewritten.graph.cancel_zero(sum)
                })
                .collect()
        })
        .collect();
    let flat = total.iter().flatten().all(|e| *e == zero);
    rewritten.graph.within_budget().map_err(|e| refused(model, &e.into()))?;
    rewritten.connection = (!flat).then_some(total);
    rewritten.derived_connection = None;
    Ok(rewritten)
}

fn refused(model: &Model, error: &Error) -> Diagnostics {
    let mut problem = model.diagnose(error);
    problem.span = model.places.connection.or(problem.span);
    model.diagnostics(vec![problem])
}

/// Hessian of `L` between two lists of velocities.
fn hessian(g: &mut Graph, lagrangian: ExprId, rows: &[SymbolId], columns: &[SymbolId]) -> Vec<Vec<ExprId>> {
    rows.iter()
        .map(|a| {
            let p = g.diff(lagrangian, *a);
            columns
                .iter()
                .map(|b| {
                    let second = g.diff(p, *b);
                    g.cancel_zero(second)
                })
                .collect()
        })
        .collect()
}

/// `K^-1 L_{v xdot}`: with `v = w - K^-1 L_{v xdot} xdot` the mixed block vanishes.
fn mechanical_shift(g: &mut Graph, model: &Model) -> Result<Vec<Vec<ExprId>>, Error> {
    let fibre: Vec<SymbolId> = model.velocities.iter().map(|v| v.symbol).collect();
    let base: Vec<SymbolId> = model.base.iter().map(|c| c.velocity).collect();
    let inertia = hessian(g, model.lagrangian, &fibre, &fibre);
    let mixed = hessian(g, model.lagrangian, &fibre, &base);
    solve_symbolic(g, &inertia, &mixed)
        .map_err(|k| Error::SingularMassMatrix { direction: model.velocities[k].name.clone() })
}

/// Minus the vertical part of the lift of `d/dx^i` that lies in `D` and is orthogonal to `S`.
fn nonholonomic_shift(g: &mut Graph, model: &Model) -> Result<Vec<Vec<ExprId>>, Diagnostics> {
    let system = reduce(model, &[])?;
    let n = model.base.len();
    let m = system.velocities.len();
    let unsupported = || {
        refused(
            model,
            &Error::Unsupported {
                what: "a nonholonomic connection".into(),
                possible: "linear constraints that leave all base velocities independent".into(),
            },
        )
    };
    let KinematicConstraint::Solved(solved) = &system.constraint else { return Err(unsupported()) };
    let lifts = base_columns(solved, n).ok_or_else(unsupported)?;
    if solved.psi0.iter().any(|e| *e != g.zero()) {
        return Err(unsupported());
    }
    // The expressions of the reduced system live in its own copy of the graph, which extends the model's.
    *g = system.graph.clone();
    let column = |a: usize| -> Vec<ExprId> { (0..m).map(|alpha| solved.psi[alpha][a]).collect() };
    let vertical: Vec<usize> = (0..solved.unknowns.len()).filter(|a| !lifts.contains(a)).collect();
    let metric = hessian(g, system.lagrangian, &system.velocities, &system.velocities);
    let pairing = |g: &mut Graph, x: &[ExprId], y: &[ExprId]| {
        let mut terms = Vec::new();
        for (alpha, row) in metric.iter().enumerate() {
            for (beta, h) in row.iter().enumerate() {
                terms.push(g.product(&[x[alpha], *h, y[beta]]));
            }
        }
        let sum = g.sum(&terms);
        g.cancel_zero(sum)
    };
    let mut gram = Vec::new();
    let mut right = Vec::new();
    for &a in &vertical {
        let s = column(a);
        gram.push(vertical.iter().map(|b| pairing(g, &s, &column(*b))).collect::<Vec<_>>());
        right.push(lifts.iter().map(|i| pairing(g, &s, &column(*i))).collect::<Vec<_>>());
    }
    let correction = solve_symbolic(g, &gram, &right)
        .map_err(|_| g.within_budget().map_or_else(|e| refused(model, &e.into()), |()| unsupported()))?;
    let mut shift = vec![vec![g.zero(); n]; m - n];
    for (i, lift) in lifts.iter().enumerate() {
        let horizontal = column(*lift);
        for a in 0..m - n {
            let mut terms = vec![g.neg(horizontal[n + a])];
            for (row, v) in correction.iter().zip(&vertical) {
                terms.push(g.mul(row[i], solved.psi[n + a][*v]));
            }
            shift[a][i] = g.sum(&terms);
        }
    }
    Ok(shift)
}

/// The unknowns that are the base velocities, when all of them are.
fn base_columns(solved: &SolvedConstraint, n: usize) -> Option<Vec<usize>> {
    (0..n).map(|i| solved.unknowns.iter().position(|u| u.frame_idx == Some(i))).collect()
}

/// Replaces every velocity `v` of the algebra by `w - shift xdot`, in one-forms and forces contragrediently.
fn shift_velocities(model: &mut Model, shift: &[Vec<ExprId>]) -> Result<(), Error> {
    let g = &mut model.graph;
    let n = model.base.len();
    let mut replacement = BTreeMap::new();
    for (velocity, row) in model.velocities.iter().zip(shift) {
        let mut terms = vec![g.sym(velocity.symbol)];
        for (coordinate, a) in model.base.iter().zip(row) {
            let rate = g.sym(coordinate.velocity);
            let product = g.mul(*a, rate);
            terms.push(g.neg(product));
        }
        let value = g.sum(&terms);
        replacement.insert(velocity.symbol, value);
    }
    let failed = |_| Error::DivisionByZero { place: "the change of connection".into() };
    let mut places: Vec<&mut ExprId> = vec![&mut model.lagrangian];
    places.extend(model.forces.iter_mut());
    places.extend(model.constraints.iter_mut().map(|c| &mut c.residual));
    places.extend(model.virtual_constraints.iter_mut().flat_map(|v| v.one_form.iter_mut()));
    places.extend(model.casimirs.iter_mut().map(|c| &mut c.expr));
    places.extend(model.outputs.iter_mut().flat_map(|o| o.components.iter_mut().map(|(_, e)| e)));
    places.extend(model.reconstruction.iter_mut().flat_map(|r: &mut crate::spec::Reconstruction| {
        let kind: &mut ReconstructionKind = &mut r.kind;
        reconstruction::expressions_mut(kind)
    }));
    for place in places {
        *place = g.subs(*place, &replacement).map_err(failed)?;
    }
    // Forces and one-forms on (xdot, v): the component along xdot_i loses shift^a_i times that along v^a.
    let lower = |g: &mut Graph, form: &mut [ExprId]| {
        for i in 0..n {
            let mut terms = vec![form[i]];
            for (a, row) in shift.iter().enumerate() {
                let product = g.mul(form[n + a], row[i]);
                terms.push(g.neg(product));
            }
            form[i] = g.sum(&terms);
        }
    };
    lower(g, &mut model.forces);
    for condition in &mut model.virtual_constraints {
        lower(g, &mut condition.one_form);
    }
    for constraint in &mut model.constraints {
        let ConstraintKind::SecondOrder { acceleration } = &mut constraint.kind else { continue };
        for coefficient in acceleration.iter_mut() {
            *coefficient = g.subs(*coefficient, &replacement).map_err(failed)?;
        }
        // vdot = wdot - shift xddot - (d shift/dx^j xdot^j) xdot
        let mut turning = vec![constraint.residual];
        for (a, row) in shift.iter().enumerate() {
            for (i, e) in row.iter().enumerate() {
                for x in &model.base {
                    let slope = g.diff(*e, x.symbol);
                    let (along, rate) = (g.sym(x.velocity), g.sym(model.base[i].velocity));
                    let product = g.product(&[acceleration[n + a], slope, along, rate]);
                    turning.push(g.neg(product));
                }
            }
        }
        constraint.residual = g.sum(&turning);
        lower(g, acceleration);
    }
    Ok(())
}
