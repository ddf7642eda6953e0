//! A mechanical connection by the system that it solves, `K A = L_vx`: the state has `w = v + A(x, t) xdot`, and the
//! equations stay in the frame that the model is written in.
//!
//! Nothing is multiplied out: neither the inverse of the locked inertia nor its derivatives enter the Lagrangian.
//! Deliberately does not know: how the system is solved in equations of motion.

use std::collections::BTreeSet;

use hamel_expr::{ExprId, SymbolId};
use hamel_lang::algebra::solve_over_determinant;
use hamel_lang::spec::{ConnectionKind, ExpressionRole, Model};

use super::connection::hessian;
use super::formulation::Formulation;
use super::noise;

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

    /// The mechanical connection of a model whose state has all of its velocities, where no constraint restricts them,
    /// `K` and `L_vx` are functions of shape and time, and nothing mentions momenta, which are those along the frame of
    /// the connection; unless it vanishes.
    pub(super) fn of(model: &mut Model, formulation: &Formulation) -> Option<Lift> {
        let (n, dim) = (model.n_shape(), model.algebra.dim());
        let is_free = model.constraints.is_empty()
            && model.virtual_constraints.is_empty()
            && model.quasi_velocities.is_empty()
            && formulation.momenta.is_empty()
            && !mentions_momenta(model);
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

/// Whether an expression of the model contains a momentum that it names; noises that are held do not count.
fn mentions_momenta(model: &Model) -> bool {
    let named = model.momenta.iter().flat_map(|momentum| &momentum.components);
    let named: BTreeSet<SymbolId> = named.map(|(_, symbol, _)| *symbol).collect();
    let is_taken = |k: usize| noise::taken(model).any(|noise| noise.symbol == model.noises[k].symbol);
    let mut expressions = model.expressions().into_iter();
    expressions.any(|(role, e)| match role {
        ExpressionRole::Noise(k) if !is_taken(k) => false,
        _ => model.graph.depends_on(e, &named),
    })
}

/// Velocities, advected parameters and states of first order, on which no connection may depend.
fn moving(model: &Model) -> BTreeSet<SymbolId> {
    let velocities = model.all_velocities().into_iter().map(|(_, s)| s);
    let advected = model.advected.iter().flat_map(|a| a.components.iter().map(|(_, s)| *s));
    let first_order = model.first_order.iter().flat_map(|s| s.components.iter().map(|(_, s)| *s));
    velocities.chain(advected).chain(first_order).collect()
}
