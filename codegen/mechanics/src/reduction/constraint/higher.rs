//! Constraints of third order, and virtual displacements that depend on accelerations: both become a system of second
//! order.
//!
//! A constraint `w(x, y, t) . yddot + w0(x, y, ydot, t) = 0` says of the acceleration along it, `s = w . ydot`, how it
//! changes. With `s` in the state the constraint is a condition on accelerations and an equation for the rate of `s`:
//!
//! ```text
//! w . ydot - s = 0,    s' = dw/dt . ydot - w0(x, y, ydot, t)
//! ```
//!
//! The first is what a second-order constraint is, so that multipliers and accelerations follow from the equations of
//! motion along the virtual displacements as for one. The states are those points of `T^(2)Q` that satisfy these
//! equations; one number for each constraint says which.
//!
//! Does not know: how conditions on accelerations are solved for multipliers.
//!
//! # Source
//! Cendra, Grillo 2007 (Lagrangian systems with higher order constraints); Grillo, Zuccalli 2012, section 4.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{DivisionByZero, ExprId, Graph, SymbolId};
use hamel_lang::algebra::Algebroid;
use hamel_lang::algebra::tableau::{Judge, Tableau, Tie};
use hamel_lang::spec::{ConstraintKind, Model};

/// The acceleration `s` along a constraint of third order, a component of the state.
#[derive(Clone, Debug)]
pub struct CarriedAcceleration {
    /// Its symbol, a base coordinate that no velocity moves.
    pub symbol: SymbolId,
    /// Its documentation.
    pub doc: String,
    /// `s'`, a function of coordinates, velocities, time, and the accelerations of [`HigherOrder::accelerations`].
    pub rate: ExprId,
}

/// What constraints of third order bring into a system.
#[derive(Clone, Debug, Default)]
pub struct HigherOrder {
    /// What the state carries, in the order of the constraints.
    pub carried: Vec<CarriedAcceleration>,
    /// What stands for `ydot` in rates, in the order of the frame; empty where nothing is carried.
    pub accelerations: Vec<SymbolId>,
}

/// What stands in the place of symbols.
type Values = BTreeMap<SymbolId, ExprId>;
/// What was divided by, with what to call it.
type Divisors = Vec<(String, ExprId)>;

/// What constraints of third order bring into a system on `algebroid`, and what was divided by on the way, with what to
/// call it. Conditions on virtual displacements of the model contain no accelerations afterwards.
///
/// `algebroid`: in the frame of the velocities before quasi-velocities of the model.
///
/// # Errors
/// [`Error::UndeterminedAcceleration`] for displacements that depend on an acceleration which no constraint gives,
/// [`Error::DivisionByZero`].
pub(in crate::reduction) fn settled(
    model: &mut Model,
    algebroid: &Algebroid,
) -> Result<(HigherOrder, Divisors), Error> {
    let mut found = HigherOrder::default();
    if model.accelerations.is_empty() {
        return Ok((found, Vec::new()));
    }
    let motion = rates_of_state(model, algebroid);
    let pivots = settle_displacements(model, &motion)?;
    let accelerations: Vec<ExprId> = model.accelerations.iter().map(|s| model.graph.sym(*s)).collect();
    for constraint in &model.constraints {
        let ConstraintKind::ThirdOrder { jerk, carried } = &constraint.kind else { continue };
        let g = &mut model.graph;
        let mut terms = vec![g.neg(constraint.residual), g.derivative_along(carried.offset, &motion)];
        for (w, acceleration) in jerk.iter().zip(&accelerations) {
            let turning = g.derivative_along(*w, &motion);
            terms.push(g.mul(turning, *acceleration));
        }
        let sum = g.sum(&terms);
        let (symbol, doc) = (carried.symbol, carried.doc.clone());
        found.carried.push(CarriedAcceleration { symbol, doc, rate: g.cancel_zero(sum) });
    }
    if !found.carried.is_empty() {
        found.accelerations.clone_from(&model.accelerations);
    }
    Ok((found, pivots))
}

/// Rates of time, coordinates, advected parameters and velocities along a motion, by velocities and accelerations.
fn rates_of_state(model: &mut Model, algebroid: &Algebroid) -> BTreeMap<SymbolId, ExprId> {
    let own: Vec<SymbolId> = model.all_velocities().into_iter().map(|(_, s)| s).collect();
    let g = &mut model.graph;
    let symbols: Vec<ExprId> = own.iter().map(|s| g.sym(*s)).collect();
    // The algebroid is in the frame before quasi-velocities.
    let y: Vec<ExprId> = match &model.frame {
        Some(frame) => frame.matrix.iter().map(|row| g.dot(row, &symbols)).collect(),
        None => symbols,
    };
    let mut rates = BTreeMap::from([(model.time, g.one())]);
    for (i, x) in algebroid.base().iter().enumerate() {
        let anchor: Vec<ExprId> = (0..y.len()).map(|alpha| algebroid.anchor(i, alpha)).collect();
        rates.insert(*x, g.dot(&anchor, &y));
    }
    for state in &model.first_order {
        rates.extend(state.components.iter().map(|(_, symbol)| *symbol).zip(state.rates.iter().copied()));
    }
    for (velocity, acceleration) in own.into_iter().zip(&model.accelerations) {
        rates.insert(velocity, g.sym(*acceleration));
    }
    rates
}

/// Puts accelerations that the constraints determine in the place of their symbols in the conditions on displacements;
/// what was divided by.
fn settle_displacements(model: &mut Model, motion: &BTreeMap<SymbolId, ExprId>) -> Result<Divisors, Error> {
    let all: BTreeSet<SymbolId> = model.accelerations.iter().copied().collect();
    let used: BTreeSet<SymbolId> = (model.virtual_constraints.iter().flat_map(|c| &c.one_form))
        .flat_map(|e| model.graph.free_symbols(*e))
        .filter(|s| all.contains(s))
        .collect();
    if used.is_empty() {
        return Ok(Vec::new());
    }
    let used: Vec<usize> =
        (0..model.accelerations.len()).filter(|k| used.contains(&model.accelerations[*k])).collect();
    let rows = conditions_on_accelerations(model, motion);
    let (values, pivots) = determined(&mut model.graph, &model.accelerations, &used, rows)?;
    let g = &mut model.graph;
    for condition in &mut model.virtual_constraints {
        for e in &mut condition.one_form {
            *e = g.subs(*e, &values).map_err(divided)?;
            for k in &used {
                *e = without(g, *e, model.accelerations[*k]).ok_or_else(|| {
                    Error::UndeterminedAcceleration {
                        condition: condition.text.clone(),
                        acceleration: g.name(model.accelerations[*k]).to_owned(),
                    }
                })?;
            }
        }
    }
    Ok(pivots)
}

/// The same value without a symbol that it does not depend on; none where it does.
fn without(g: &mut Graph, e: ExprId, symbol: SymbolId) -> Option<ExprId> {
    let e = g.without_idle_symbols(e, Some(&[symbol]));
    (!g.free_symbols(e).contains(&symbol)).then_some(e)
}

/// Every constraint as a row `w . ydot + w0 = 0`, on the velocities of the model; none of those with quasi-velocities
/// that only parametrise constraints.
fn conditions_on_accelerations(
    model: &mut Model,
    motion: &BTreeMap<SymbolId, ExprId>,
) -> Vec<(Vec<ExprId>, ExprId)> {
    let quasi: BTreeSet<SymbolId> = model.quasi_velocities.iter().map(|v| v.symbol).collect();
    let mut rows = Vec::new();
    for constraint in &model.constraints {
        let g = &mut model.graph;
        if g.depends_on(constraint.residual, &quasi) {
            continue;
        }
        rows.extend(match &constraint.kind {
            ConstraintKind::Linear | ConstraintKind::Nonlinear => {
                let rate = g.derivative_along(constraint.residual, motion);
                g.affine_parts(rate, &model.accelerations)
            }
            ConstraintKind::SecondOrder { acceleration } => Some((acceleration.clone(), constraint.residual)),
            ConstraintKind::ThirdOrder { jerk, carried } => {
                let own = g.sym(carried.symbol);
                Some((jerk.clone(), g.sub(carried.offset, own)))
            }
        });
    }
    rows
}

/// Accelerations that rows determine, among those at `used`, by what else is in the rows, and what was divided by.
///
/// Others are eliminated without a division, and rows of which that is not known are left out.
fn determined(
    g: &mut Graph,
    accelerations: &[SymbolId],
    used: &[usize],
    rows: Vec<(Vec<ExprId>, ExprId)>,
) -> Result<(Values, Divisors), Error> {
    let rows = rows.into_iter().map(|(form, rest)| form.into_iter().chain([rest]).collect());
    let mut table = Tableau::new(rows.collect());
    // A number, otherwise an entry that is proved not to vanish identically.
    let best = |g: &mut Graph, table: &Tableau, rows: &[usize], column: usize| {
        let cells = rows.iter().map(|row| (*row, column));
        table.best(g, &Judge::BLIND, Tie::First, cells).filter(|cell| cell.grade.is_proved())
    };
    for column in (0..accelerations.len()).filter(|k| !used.contains(k)) {
        let all: Vec<usize> = (0..table.rows().len()).collect();
        if let Some(cell) = best(g, &table, &all, column) {
            table.cross_out(g, (cell.row, column));
            table.remove_row(cell.row);
        }
        table.retain_without(g, column);
    }
    let mut open: Vec<usize> = (0..table.rows().len()).collect();
    let mut solved: Vec<(usize, usize)> = Vec::new();
    for &column in used {
        let Some(cell) = best(g, &table, &open, column) else { continue };
        table.cross_out(g, (cell.row, column));
        open.retain(|row| *row != cell.row);
        solved.push((column, cell.row));
    }
    let (mut values, mut pivots) = (BTreeMap::new(), Vec::new());
    for (column, row) in solved {
        let row = &table.rows()[row];
        let mut terms = vec![row[accelerations.len()]];
        for &other in used.iter().filter(|k| **k != column) {
            let acceleration = g.sym(accelerations[other]);
            terms.push(g.mul(row[other], acceleration));
        }
        let sum = g.sum(&terms);
        let value = g.div(sum, row[column]).map_err(divided)?;
        values.insert(accelerations[column], g.neg(value));
        if g.as_rational(row[column]).is_none() {
            let name = format!("coefficient of {} in the constraints", g.name(accelerations[column]));
            pivots.push((name, row[column]));
        }
    }
    Ok((values, pivots))
}

fn divided(_: DivisionByZero) -> Error {
    Error::DivisionByZero { place: "accelerations in the conditions on virtual displacements".into() }
}

/// Other velocities in the place of those of a model, differentiated: `y = values(x, t, eta)`.
pub(in crate::reduction) struct Prolonged {
    /// `ydot`, by the symbols of the old accelerations.
    pub(in crate::reduction) accelerations: BTreeMap<SymbolId, ExprId>,
    /// `ydot` at `etadot = 0`.
    pub(in crate::reduction) turning: BTreeMap<SymbolId, ExprId>,
    /// `yddot` at `etaddot = 0`.
    pub(in crate::reduction) lag: BTreeMap<SymbolId, ExprId>,
}

/// The first and second derivative of `y = values(x, t, eta)`, by the symbols of `ydot`.
///
/// `rates`: of time, coordinates and advected parameters, by `eta`; `eta`: velocities with symbols of their
/// accelerations.
pub(in crate::reduction) fn prolonged(
    g: &mut Graph,
    values: &[(SymbolId, ExprId)],
    rates: &BTreeMap<SymbolId, ExprId>,
    eta: &[(SymbolId, SymbolId)],
) -> Prolonged {
    let mut motion = rates.clone();
    motion.extend(eta.iter().map(|(y, a)| (*y, g.sym(*a))));
    let none = BTreeMap::new();
    let mut result = Prolonged { accelerations: none.clone(), turning: none.clone(), lag: none };
    for (acceleration, value) in values {
        let first = g.derivative_along(*value, &motion);
        result.accelerations.insert(*acceleration, first);
        result.turning.insert(*acceleration, g.derivative_along(*value, rates));
        result.lag.insert(*acceleration, g.derivative_along(first, &motion));
    }
    result
}
