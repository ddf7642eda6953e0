//! Residuals of the equations between coordinates of a scene, with their gradients: what initial values have to satisfy
//! and projection keeps.
//!
//! Coordinates that are points of circles stay on their circles when they are moved to satisfy an equation, matrices in
//! their groups, and advected vectors keep their lengths where the motion keeps these, which their rates prove: these
//! functions follow the residuals, and are kept at their values.
//!
//! Deliberately does not know: how anything is differentiated, lowered or emitted, who solves the equations.

use std::collections::BTreeSet;

use super::dependence::{left_out, needs};
use super::gradients::{WithGradients, Words, with_gradients};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{Equations, StateEquation, rates};
use hamel_mechanics::reduction::{BlockKind, PositionResidual};

/// Name of the matrix of the gradients, a row for each residual.
pub(super) const GRADIENTS: &str = "position_gradients";

/// How the equations between coordinates of a scene are solved.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PositionLayout {
    /// The first so many functions have to vanish; the others keep their values.
    pub n_equations: usize,
    /// The components of the state that are moved: those that the equations give, where these are enough, and otherwise
    /// all that the equations contain.
    pub moved: Vec<usize>,
}

/// The residuals, and how they are solved.
///
/// # Errors
/// [`Error::NoPositions`].
pub(super) fn find(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
) -> Result<(WithGradients, PositionLayout), Error> {
    let Some(first) = equations.system.positions.first() else {
        return Err(Error::NoPositions { reason: "the model has none".into() });
    };
    let positions = match between(g, equations, state) {
        Ok(positions) if !positions.is_empty() => positions,
        found => {
            let name = &found.err().unwrap_or(first).name;
            let reason = format!("{name} depends on a coordinate that the scene leaves out");
            return Err(Error::NoPositions { reason });
        }
    };
    let mut touched: BTreeSet<SymbolId> = BTreeSet::new();
    for s in state {
        let own = BTreeSet::from([s.symbol]);
        if positions.iter().any(|p| needs(g, equations, p.residual, &own)) {
            touched.insert(s.symbol);
        }
    }
    let mut functions: Vec<(String, ExprId)> =
        positions.iter().map(|p| (p.name.clone(), p.residual)).collect();
    let (of_groups, in_groups) = of_groups(g, equations, &touched);
    touched.extend(&in_groups);
    functions.extend(of_groups);
    let circles = equations.system.circles.iter();
    let circles = circles.map(|c| (format!("{}_circle", c.angle), vec![c.cosine, c.sine]));
    let advected = equations.system.blocks.iter().filter(|b| b.kind == BlockKind::Advected);
    let advected = advected.map(|b| (format!("{0}_dot_{0}", b.name), b.components.clone()));
    for (name, vector) in circles.chain(advected) {
        let is_in_group = vector.iter().any(|symbol| in_groups.contains(symbol));
        if is_in_group || !vector.iter().any(|symbol| touched.contains(symbol)) {
            continue;
        }
        // Not every group that moves an advected parameter turns it: a height that a velocity raises keeps nothing.
        let square = sum_of_squares(g, &vector);
        let rate = rates(g, equations, state, &[square]);
        if rate.iter().all(|rate| g.is_zero(*rate)) {
            touched.extend(&vector);
            functions.push((name, square));
        }
    }
    let places = |symbols: &BTreeSet<SymbolId>| -> Vec<usize> {
        (0..state.len()).filter(|k| symbols.contains(&state[*k].symbol)).collect()
    };
    let touched = places(&touched);
    let is_determined = positions.iter().all(|p| !p.determines.is_empty());
    let determined: BTreeSet<SymbolId> =
        positions.iter().flat_map(|p| p.determines.iter().copied()).filter(|_| is_determined).collect();
    let moved = if is_determined { places(&determined) } else { touched.clone() };
    let words = Words {
        want: Want::Positions,
        values: "residuals of the equations between coordinates, and what these coordinates keep",
        gradients: GRADIENTS,
        doc: "matrix of the derivatives of the functions `positions` by the components of the state, a row for each",
    };
    let all = |_: &mut Graph, rows: &[Vec<ExprId>]| (0..rows.len()).collect();
    let found = with_gradients(g, equations, state, (&functions, &touched), &words, all);
    Ok((found, PositionLayout { n_equations: positions.len(), moved }))
}

/// Functions that keep a matrix in its group where `touched` has a component of it, and all components of these
/// matrices.
fn of_groups(
    g: &Graph,
    equations: &Equations,
    touched: &BTreeSet<SymbolId>,
) -> (Vec<(String, ExprId)>, BTreeSet<SymbolId>) {
    let all = &equations.system.group_equations;
    // A determinant follows from the form of its matrix, up to its sign.
    let follows = |name: &str| {
        let form = name.strip_suffix("_det").map(|matrix| format!("{matrix}_form_"));
        form.is_some_and(|form| all.iter().any(|(other, _)| other.starts_with(&form)))
    };
    let mut found = Vec::new();
    let mut components = BTreeSet::new();
    let mut open: Vec<&(String, ExprId)> = all.iter().filter(|(name, _)| !follows(name)).collect();
    // Entries of one row lead to the other rows.
    loop {
        let is_linked = |e: ExprId| g.depends_on(e, touched) || g.depends_on(e, &components);
        let (linked, others): (Vec<_>, Vec<_>) = open.into_iter().partition(|(_, e)| is_linked(*e));
        if linked.is_empty() {
            return (found, components);
        }
        components.extend(linked.iter().flat_map(|(_, e)| g.free_symbols(*e)));
        found.extend(linked.into_iter().cloned());
        open = others;
    }
}

/// The equations between what a state carries; none of them where there is one that contains a coordinate which is left
/// out. But an equation with such a coordinate that is in no other one says nothing about the rest: it gives that.
fn between<'a>(
    g: &Graph,
    equations: &'a Equations,
    state: &[StateEquation],
) -> Result<Vec<&'a PositionResidual>, &'a PositionResidual> {
    let mut positions: Vec<&PositionResidual> = equations.system.positions.iter().collect();
    let left_out = left_out(equations, state);
    let has = |p: &PositionResidual, symbols: &BTreeSet<SymbolId>| needs(g, equations, p.residual, symbols);
    loop {
        let gives_other = |p: &PositionResidual| {
            left_out.iter().map(|symbol| BTreeSet::from([*symbol])).any(|symbol| {
                has(p, &symbol) && positions.iter().filter(|other| has(other, &symbol)).count() == 1
            })
        };
        match positions.iter().position(|p| gives_other(p)) {
            Some(k) => _ = positions.remove(k),
            None => break,
        }
    }
    match positions.iter().find(|p| has(p, &left_out)) {
        None => Ok(positions),
        Some(position) => Err(position),
    }
}

/// Whether a state of a scene can violate equations between coordinates.
pub(super) fn restrict(equations: &Equations, state: &[StateEquation]) -> bool {
    between(&equations.system.graph, equations, state).map_or(true, |positions| !positions.is_empty())
}

fn sum_of_squares(g: &mut Graph, symbols: &[SymbolId]) -> ExprId {
    let squares: Vec<ExprId> = symbols
        .iter()
        .map(|symbol| {
            let e = g.sym(*symbol);
            g.powi(e, 2)
        })
        .collect();
    g.sum(&squares)
}
