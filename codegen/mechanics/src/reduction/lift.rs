//! A mechanical connection by the system that it solves, `K A = L_vx`: the state has `w = v + A(x, t) xdot`, and the
//! equations stay in the frame that the model is written in.
//!
//! Nothing is multiplied out: neither the inverse of the locked inertia nor its derivatives enter the Lagrangian.
//! Deliberately does not know: how the system is solved in equations of motion.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{DivisionByZero, ExprId, Graph, SymbolId};
use hamel_lang::algebra::solve_over_determinant;
use hamel_lang::spec::{ConnectionKind, Model};

use super::change::{Frame, tidied};
use super::connection::hessian;
use super::constraint::{KinematicConstraint, Reactions, SolvedConstraint, Unknown};
use super::formulation::Formulation;
use super::system::ReducedSystem;

/// The mechanical connection `A = K^-1 L_vx` with the locked inertia `K_ab = d^2L/dv^a dv^b` and the coupling
/// `d^2L/dv^a dxdot^i`.
///
/// # Shapes
/// `inertia`: `[dim][dim]`; `coupling`, `connection`: `[dim][n]`.
#[derive(Clone, Debug)]
pub struct Lift {
    /// `K`.
    pub inertia: Vec<Vec<ExprId>>,
    /// `L_vx`.
    pub coupling: Vec<Vec<ExprId>>,
    /// `A`, over the determinant of `K` as the one denominator where `K` has few rows.
    pub connection: Vec<Vec<ExprId>>,
}

impl Lift {
    /// Every coefficient.
    pub(super) fn expressions_mut(&mut self) -> impl Iterator<Item = &mut ExprId> {
        let Lift { inertia, coupling, connection } = self;
        inertia.iter_mut().chain(coupling).chain(connection).flatten()
    }

    /// The mechanical connection of a model whose state has all of its velocities, where no constraint restricts them
    /// and `K` and `L_vx` are functions of shape and time; none for others, and for one that vanishes.
    pub(super) fn of(model: &mut Model, formulation: &Formulation) -> Option<Lift> {
        let (n, dim) = (model.n_shape(), model.algebra.dim());
        let is_free = model.constraints.is_empty()
            && model.virtual_constraints.is_empty()
            && model.quasi_velocities.is_empty()
            && formulation.momenta.is_empty();
        let is_plain = model.algebroid.is_none()
            && model.frame.is_none()
            && model.given.is_none()
            && model.hamiltonian.is_none()
            && model.stages.is_none();
        let is_wanted = formulation.connection == Some(ConnectionKind::Mechanical) && n > 0 && dim > 0;
        if !(is_wanted && is_free && is_plain && n == model.base.len()) {
            return None;
        }
        let hessian = hessian(model);
        let inertia: Vec<Vec<ExprId>> = hessian[n..].iter().map(|row| row[n..].to_vec()).collect();
        let coupling: Vec<Vec<ExprId>> = hessian[n..].iter().map(|row| row[..n].to_vec()).collect();
        let moving = moving(model);
        let g = &mut model.graph;
        let zero = g.zero();
        let mut entries = inertia.iter().chain(&coupling).flatten();
        if coupling.iter().flatten().all(|e| *e == zero) || entries.any(|e| g.depends_on(*e, &moving)) {
            return None;
        }
        let connection = solve_over_determinant(g, &inertia, &coupling).ok()?;
        Some(Lift { inertia, coupling, connection })
    }
}

/// Velocities, advected parameters and states of first order, on which no connection may depend.
fn moving(model: &Model) -> BTreeSet<SymbolId> {
    let velocities = model.all_velocities().into_iter().map(|(_, s)| s);
    let advected = model.advected.iter().flat_map(|a| a.components.iter().map(|(_, s)| *s));
    let first_order = model.first_order.iter().flat_map(|s| s.components.iter().map(|(_, s)| *s));
    velocities.chain(advected).chain(first_order).collect()
}

/// The system in the frame of its model, with the velocities `w = v + A xdot` in its state in the place of `v`.
///
/// # Errors
/// [`Error::DivisionByZero`].
pub(super) fn lifted(mut system: ReducedSystem, lift: Lift) -> Result<ReducedSystem, Error> {
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
