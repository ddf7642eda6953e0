//! The rows that a motion keeps independent: gradients of constraints by the velocities of a scene, or of its equations
//! between coordinates. Where they become dependent, the motion may go on in more than one way.
//!
//! Deliberately does not know: how a loss of rank is noticed, who asks.

use std::collections::BTreeSet;

use super::dependence::{left_out, needs_by};
use super::gradients::{WithGradients, Words, with_gradients};
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{Equations, OutputKind, StateEquation};

/// Name of the matrix of the derivatives of the residuals of constraints by the velocities.
pub(super) const ROWS: &str = "constraint_gradients";

/// The rows whose rank a motion keeps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct RankLayout {
    /// The matrix that has them.
    pub(super) matrix: &'static str,
    /// Which of its rows they are.
    pub(super) rows: Vec<usize>,
    /// Components of the state that they depend on.
    pub(super) moving: Vec<usize>,
}

/// The rows of the first `n_equations` gradients that were found, of equations between coordinates. None where the
/// equations of motion divide by nothing that may vanish, or no row changes.
pub(super) fn of_positions(
    g: &Graph,
    equations: &Equations,
    state: &[StateEquation],
    found: &WithGradients,
    n_equations: usize,
) -> Option<RankLayout> {
    layout_of(g, equations, state, found, (0..n_equations).collect())
}

/// The gradients of residuals by velocities, `d(residual_i)/dv_j`, and the rows of constraints that are affine in
/// these: of others a row turns with the velocities. None as for [`of_positions`], and where the state violates no
/// constraint.
pub(super) fn of_constraints(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
) -> Option<(WithGradients, RankLayout)> {
    let residuals = equations.outputs.iter().find(|o| o.kind == OutputKind::Group(Want::Constraint))?;
    let velocities = velocities(equations);
    let by: Vec<usize> = (0..state.len()).filter(|k| velocities.contains(&state[*k].symbol)).collect();
    let words = Words {
        want: Want::Constraint,
        values: "residuals of the constraints that the state can violate",
        gradients: ROWS,
        doc: "matrix of the derivatives of the residuals `constraint` by the velocities, a row for each residual",
    };
    let all = |_: &mut Graph, rows: &[Vec<ExprId>]| (0..rows.len()).collect();
    let found = with_gradients(g, equations, state, (&residuals.components, &by), &words, all);
    let excluded: BTreeSet<SymbolId> = left_out(equations, state).union(&velocities).copied().collect();
    let sections = [equations.sections.as_slice(), &found.sections].concat();
    let entries = &found.outputs[1].components;
    let is_watched = |k: &usize| {
        let own: Vec<ExprId> = (found.gradients.pattern.iter().zip(entries))
            .filter_map(|((i, _), (_, e))| (i == k).then_some(*e))
            .collect();
        !own.is_empty() && own.iter().all(|e| !needs_by(g, &sections, *e, &excluded))
    };
    let rows: Vec<usize> = (0..found.gradients.shape.0).filter(is_watched).collect();
    let layout = layout_of(g, equations, state, &found, rows)?;
    Some((found, layout))
}

/// Velocities, and momenta in their place.
fn velocities(equations: &Equations) -> BTreeSet<SymbolId> {
    let system = &equations.system;
    let momenta = system.momenta.iter().filter_map(|momentum| momentum.symbol);
    system.unknowns.iter().map(|unknown| unknown.symbol).chain(momenta).collect()
}

/// The layout of rows that are not all constant, where something that is divided by may vanish.
fn layout_of(
    g: &Graph,
    equations: &Equations,
    state: &[StateEquation],
    found: &WithGradients,
    rows: Vec<usize>,
) -> Option<RankLayout> {
    if equations.pivots.is_empty() {
        return None;
    }
    let sections = [equations.sections.as_slice(), &found.sections].concat();
    let entries = found.gradients.pattern.iter().zip(&found.outputs[1].components);
    let entries: Vec<ExprId> = entries.filter(|((i, _), _)| rows.contains(i)).map(|(_, (_, e))| *e).collect();
    let depends = |k: &usize| {
        let symbol = BTreeSet::from([state[*k].symbol]);
        entries.iter().any(|e| needs_by(g, &sections, *e, &symbol))
    };
    let moving: Vec<usize> = (0..state.len()).filter(depends).collect();
    (!moving.is_empty()).then_some(RankLayout { matrix: found.gradients.name, rows, moving })
}
