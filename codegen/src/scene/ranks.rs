//! The rows that a motion keeps independent: gradients of constraints by the velocities of a scene, or of its equations
//! between coordinates. Where they become dependent, the motion may go on in more than one way.
//!
//! Deliberately does not know: how a loss of rank is noticed, who asks.

use std::collections::{BTreeMap, BTreeSet};

use super::dependence::{left_out, needs_by};
use super::gradients::{WithGradients, Words, with_gradients};
use super::positions;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SymbolId, needed_sections};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{Equations, OutputKind, StateEquation, rates};

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

/// The rows that a motion may lose.
pub(super) struct Found {
    pub(super) layout: RankLayout,
    /// The gradients with them, unless they belong to the equations between coordinates.
    pub(super) constraints: Option<WithGradients>,
}

/// The gradients of residuals by velocities, `d(residual_i)/dv_j`, or where the state violates no constraint, by the
/// equations between coordinates. None where the equations of motion divide by nothing that may vanish, or the rows
/// are proved to stay independent.
///
/// # Errors
/// What the budget of the graph says.
pub(super) fn find(
    graph: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
) -> Result<Option<Found>, Error> {
    if equations.pivots.is_empty() {
        return Ok(None);
    }
    // Rows that are not used leave nothing behind, and code as it is.
    let mut g = graph.clone();
    let of_constraints = of_constraints(&mut g, equations, state);
    g.within_budget()?;
    if let Some((found, layout)) = of_constraints {
        *graph = g;
        return Ok(Some(Found { layout, constraints: Some(found) }));
    }
    let of_positions = positions::find(&mut g, equations, state);
    g.within_budget()?;
    let Ok((found, how)) = of_positions else { return Ok(None) };
    let layout = layout_of(&mut g, equations, state, &found, (0..how.n_equations).collect());
    Ok(layout.map(|layout| Found { layout, constraints: None }))
}

/// The gradients by velocities, and the rows of constraints that are affine in these: of others a row turns with the
/// velocities.
fn of_constraints(
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

/// The layout of rows that may become dependent.
fn layout_of(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    found: &WithGradients,
    rows: Vec<usize>,
) -> Option<RankLayout> {
    let mut entries: BTreeMap<usize, BTreeMap<usize, ExprId>> =
        rows.into_iter().map(|k| (k, BTreeMap::new())).collect();
    for ((i, j), (_, e)) in found.gradients.pattern.iter().zip(&found.outputs[1].components) {
        if let Some(row) = entries.get_mut(i) {
            row.insert(*j, *e);
        }
    }
    leave_out_independent(g, &mut entries);
    let columns: BTreeSet<usize> = entries.values().flat_map(BTreeMap::keys).copied().collect();
    // More rows than columns depend on each other everywhere.
    if entries.is_empty()
        || entries.len() > columns.len()
        || keep_volume(g, equations, state, found, &entries)
    {
        return None;
    }
    let sections = [equations.sections.as_slice(), &found.sections].concat();
    let depends = |k: &usize| {
        let symbol = BTreeSet::from([state[*k].symbol]);
        entries.values().flat_map(BTreeMap::values).any(|e| needs_by(g, &sections, *e, &symbol))
    };
    let moving: Vec<usize> = (0..state.len()).filter(depends).collect();
    let rows = entries.keys().copied().collect();
    (!moving.is_empty()).then_some(RankLayout { matrix: found.gradients.name, rows, moving })
}

/// Leaves out each row that has a number in a column where all others that are left are zero: it is independent of
/// them, and they of each other or not without it.
fn leave_out_independent(g: &Graph, rows: &mut BTreeMap<usize, BTreeMap<usize, ExprId>>) {
    let has_own_column = |rows: &BTreeMap<usize, BTreeMap<usize, ExprId>>, row: &BTreeMap<usize, ExprId>| {
        let is_own = |j: &usize| rows.values().filter(|other| other.contains_key(j)).count() == 1;
        row.iter().any(|(j, e)| g.as_rational(*e).is_some() && is_own(j))
    };
    while let Some(k) = rows.iter().find_map(|(k, row)| has_own_column(rows, row).then_some(*k)) {
        rows.remove(&k);
    }
}

/// Whether the motion keeps the volume of rows, whose square is their Gram determinant, such as the length of an
/// advected vector: proved for few rows.
fn keep_volume(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    found: &WithGradients,
    rows: &BTreeMap<usize, BTreeMap<usize, ExprId>>,
) -> bool {
    let entries: Vec<ExprId> = rows.values().flat_map(BTreeMap::values).copied().collect();
    if rows.len() > 2 || !needed_sections(g, &found.sections, &entries).is_empty() {
        return false;
    }
    let rows: Vec<&BTreeMap<usize, ExprId>> = rows.values().collect();
    let mut product = |a: &BTreeMap<usize, ExprId>, b: &BTreeMap<usize, ExprId>| {
        let both = a.iter().filter_map(|(j, e)| Some((*e, *b.get(j)?)));
        let (a, b): (Vec<ExprId>, Vec<ExprId>) = both.unzip();
        g.dot(&a, &b)
    };
    let square = match rows.as_slice() {
        [a] => product(a, a),
        [a, b] => {
            let [aa, bb, ab] = [product(a, a), product(b, b), product(a, b)];
            let (diagonal, others) = (g.mul(aa, bb), g.mul(ab, ab));
            g.sub(diagonal, others)
        }
        _ => return false,
    };
    rates(g, equations, state, &[square]).iter().all(|rate| g.is_zero(*rate))
}
