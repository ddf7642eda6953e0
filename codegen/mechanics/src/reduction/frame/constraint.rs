//! Kinematic constraints in another frame.
//!
//! Does not know: the algebroid beyond derivatives along it, the Lagrangian.

use std::collections::{BTreeMap, BTreeSet};

use crate::reduction::change::{Frame, contract, tidied};
use crate::reduction::constraint::{
    AccelerationRow, AccelerationSource, Choice, ConstraintRow, HigherOrder, KinematicConstraint, Reactions,
    Said, Setting as Rows, SolvedConstraint, Solver, Unknown, prolonged, solve_rows,
};
use crate::reduction::system::ReducedSystem;
use hamel_expr::error::Error;
use hamel_expr::{DivisionByZero, ExprId, Graph, Sign, SymbolId};
use hamel_lang::algebra::Algebroid;
use hamel_lang::spec::Param;

/// What constraints are solved beside.
pub(super) struct Setting<'a> {
    pub(super) time: SymbolId,
    pub(super) params: &'a [Param],
    pub(super) signs: &'a BTreeMap<ExprId, Sign>,
    /// In the new frame.
    pub(super) algebroid: &'a Algebroid,
}

impl Setting<'_> {
    fn params(&self) -> BTreeSet<SymbolId> {
        self.params.iter().map(|p| p.symbol).collect()
    }
}

/// The constraint with the unknowns that it was solved for, `eta = T^-1 Psi u + T^-1 psi0`: every velocity of the new
/// frame beside the base velocities depends on them.
///
/// `values`: the velocities of the model that change, by those of the new frame, `n` base velocities before them.
///
/// Without a constraint the virtual displacements are the new frame itself, so that the equations are its components;
/// not where the state has momenta, which are those along the displacements.
///
/// # Errors
/// Reactions that no choice of components of the new frame determines on the whole domain.
pub(super) fn with_old_unknowns(
    g: &mut Graph,
    setting: &Setting<'_>,
    (frame, n): (&Frame, usize),
    (names, has_momenta): (&[String], bool),
    constraint: KinematicConstraint,
    values: &BTreeMap<SymbolId, ExprId>,
) -> Result<KinematicConstraint, Error> {
    let KinematicConstraint::Solved(solved) = constraint else { return Ok(constraint) };
    let SolvedConstraint {
        unknowns,
        dependent,
        psi,
        psi0,
        virtual_displacements,
        reactions,
        rows,
        pivots,
        response: _,
    } = solved;
    let m = frame.matrix.len();
    let is_free = dependent.is_empty() && reactions.names.is_empty() && !has_momenta;
    let image = |g: &mut Graph, columns: &[Vec<ExprId>]| -> Vec<Vec<ExprId>> {
        let k = columns.first().map_or(0, Vec::len);
        let entry = |g: &mut Graph, row: &[ExprId], a: usize| {
            let column: Vec<ExprId> = columns.iter().map(|row| row[a]).collect();
            tidied(g, |g| contract(g, row, &column))
        };
        frame.inverse.iter().map(|row| (0..k).map(|a| entry(g, row, a)).collect()).collect()
    };
    let new_psi = image(g, &psi);
    let virtual_displacements = substituted(g, &virtual_displacements, values)?;
    let new_displacements = if is_free { psi } else { image(g, &virtual_displacements) };
    let new_psi0 = frame.inverse.iter().map(|row| tidied(g, |g| contract(g, row, &psi0))).collect();
    let one_forms = substituted(g, &reactions.one_forms, values)?;
    let one_forms: Vec<Vec<ExprId>> = one_forms.iter().map(|form| frame.one_form(g, form)).collect();
    let on = determining(g, setting, names, &reactions.names, &one_forms)?;
    let unknowns = unknowns.into_iter().map(|u| Unknown { frame_idx: u.frame_idx.filter(|k| *k < n), ..u });
    Ok(KinematicConstraint::Solved(SolvedConstraint {
        unknowns: unknowns.collect(),
        dependent: dependent.into_iter().filter(|k| *k < n).chain(n..m).collect(),
        psi: new_psi,
        psi0: new_psi0,
        virtual_displacements: new_displacements,
        reactions: Reactions { names: reactions.names, one_forms, on },
        rows: rows.into_iter().map(|row| row_in(g, frame, row)).collect(),
        pivots,
        // The rows are solved for other velocities.
        response: None,
    }))
}

/// Components on which one-forms can be inverted.
fn determining(
    g: &mut Graph,
    setting: &Setting<'_>,
    names: &[String],
    texts: &[String],
    one_forms: &[Vec<ExprId>],
) -> Result<Vec<usize>, Error> {
    let offset = g.zero();
    let rows: Vec<ConstraintRow> = (texts.iter().zip(one_forms))
        .map(|(name, form)| ConstraintRow {
            name: name.clone(),
            text: name.clone(),
            one_form: form.clone(),
            offset,
            written: None,
        })
        .collect();
    let params = setting.params();
    let mut solver =
        Solver { graph: g, names, quasi: &[], params: &params, facts: setting.signs, is_by_rows: false };
    let found = solver.solve(&rows, None, Said::default())?;
    found.map(|f| f.dependent).ok_or_else(|| Error::Unsupported {
        what: "a choice of components along the stages that determines the multipliers on the whole domain"
            .into(),
        possible: "the frame of the model, or `carry stages;`".into(),
    })
}

/// The constraint for velocities of the new frame, solved for those that are best to divide by.
///
/// `values`: the velocities of the model that change, by those of the new frame.
///
/// # Errors
/// As where the constraints of a model are solved.
pub(super) fn solved_again(
    g: &mut Graph,
    setting: &Setting<'_>,
    frame: &Frame,
    eta: &[Unknown],
    constraint: KinematicConstraint,
    values: &BTreeMap<SymbolId, ExprId>,
) -> Result<KinematicConstraint, Error> {
    match constraint {
        KinematicConstraint::Solved(solved) => {
            let SolvedConstraint { unknowns, rows, reactions, .. } = solved;
            let is_quasi = |u: &Unknown| u.frame_idx.is_none();
            let quasi: Vec<Unknown> = unknowns.into_iter().filter(is_quasi).collect();
            let m = frame.matrix.len();
            // Displacements of their own are those that are not the motion's.
            let is_own = rows.len() != reactions.one_forms.len()
                || rows.iter().zip(&reactions.one_forms).any(|(row, form)| row.one_form[..m] != **form);
            let rows: Vec<ConstraintRow> = rows.into_iter().map(|row| row_in(g, frame, row)).collect();
            let offset = g.zero();
            let one_forms = substituted(g, &reactions.one_forms, values)?;
            let displacements = reactions.names.iter().zip(&one_forms).filter(|_| is_own);
            let displacements: Vec<ConstraintRow> = displacements
                .map(|(name, form)| {
                    let one_form = frame.one_form(g, form);
                    let (name, text) = (name.clone(), name.clone());
                    ConstraintRow { name, text, one_form, offset, written: None }
                })
                .collect();
            let general = rows.iter().map(|row| acceleration_row(g, row, eta)).collect();
            let params = setting.params();
            let beside = Rows { frame: eta, quasi: &quasi, params: &params, signs: setting.signs };
            solve_rows(g, &beside, (rows, general), displacements, Choice::default())
        }
        KinematicConstraint::Multipliers { rows, reactions } => {
            let mut carried = Vec::new();
            for row in rows {
                carried.push(acceleration_in(g, setting, frame, eta, row, values)?);
            }
            let reactions = substituted(g, &reactions, values)?;
            let reactions = reactions.iter().map(|form| frame.one_form(g, form)).collect();
            Ok(KinematicConstraint::Multipliers { rows: carried, reactions })
        }
    }
}

/// Momenta that the state carries beside velocities along the levels, for the unknowns of the new frame.
///
/// `before`: the constraint in the old frame, and its unknowns.
///
/// # Errors
/// [`Error::Unsupported`] for a momentum that is another one in the new frame.
pub(super) fn keeps_momenta(
    g: &mut Graph,
    system: &mut ReducedSystem,
    frame: &Frame,
    (before, unknowns): (&KinematicConstraint, &[Unknown]),
) -> Result<(), Error> {
    for momentum in &mut system.momenta {
        let old = momentum.unknown;
        let same = system.unknowns.iter().position(|u| u.symbol == unknowns[old].symbol);
        let displacement = |g: &mut Graph, constraint: &KinematicConstraint, k: usize| match constraint {
            KinematicConstraint::Solved(solved) => {
                solved.virtual_displacements.iter().map(|row| row[k]).collect::<Vec<_>>()
            }
            KinematicConstraint::Multipliers { .. } => {
                (0..frame.matrix.len()).map(|a| if a == k { g.one() } else { g.zero() }).collect()
            }
        };
        let is_same = same.is_some_and(|new| {
            let along = displacement(g, before, old);
            let expected: Vec<ExprId> = frame.inverse.iter().map(|row| contract(g, row, &along)).collect();
            let found = displacement(g, &system.constraint, new);
            expected.into_iter().zip(found).all(|(e, f)| g.is_equal(e, f))
        });
        let Some(new) = same.filter(|_| is_same) else {
            return Err(Error::Unsupported {
                what: format!("the momentum {} beside velocities along the levels of stages", momentum.name),
                possible: "one of them: `carry stages;` or the momentum".into(),
            });
        };
        momentum.unknown = new;
    }
    Ok(())
}

/// A row on the velocities of the new frame and the quasi-velocities.
fn row_in(g: &mut Graph, frame: &Frame, row: ConstraintRow) -> ConstraintRow {
    let (on_frame, on_quasi) = row.one_form.split_at(frame.matrix.len());
    let one_form = [frame.one_form(g, on_frame).as_slice(), on_quasi].concat();
    ConstraintRow { one_form, written: None, ..row }
}

/// A linear row as the time derivative of a constraint.
fn acceleration_row(g: &mut Graph, row: &ConstraintRow, eta: &[Unknown]) -> AccelerationRow {
    let one_form = row.one_form[..eta.len()].to_vec();
    let symbols: Vec<ExprId> = eta.iter().map(|u| g.sym(u.symbol)).collect();
    let product = contract(g, &one_form, &symbols);
    let residual = g.add(product, row.offset);
    let (name, text) = (row.name.clone(), row.text.clone());
    let source = AccelerationSource::Differentiated(residual);
    AccelerationRow { name, text, one_form, source, mode: None }
}

fn substituted(
    g: &mut Graph,
    forms: &[Vec<ExprId>],
    values: &BTreeMap<SymbolId, ExprId>,
) -> Result<Vec<Vec<ExprId>>, Error> {
    let divided = |_: DivisionByZero| Error::DivisionByZero { place: "the change of frame".into() };
    forms.iter().map(|form| g.subs_all(form, values).map_err(divided)).collect()
}

/// Rates of accelerations along constraints of third order, by the accelerations of the new velocities, which get
/// symbols of their own.
///
/// `velocities`: those of the model; `values`: those that change, by those of the new frame.
///
/// # Errors
/// [`Error::DivisionByZero`].
pub(super) fn rates_in(
    g: &mut Graph,
    setting: &Setting<'_>,
    eta: &[Unknown],
    (velocities, values): (&[SymbolId], &BTreeMap<SymbolId, ExprId>),
    higher: HigherOrder,
) -> Result<HigherOrder, Error> {
    if higher.carried.is_empty() {
        return Ok(higher);
    }
    let accelerations: Vec<SymbolId> = eta.iter().map(|u| g.symbol(&format!("ddt({})", u.name))).collect();
    let symbols: Vec<ExprId> = eta.iter().map(|u| g.sym(u.symbol)).collect();
    let mut rates = BTreeMap::from([(setting.time, g.one())]);
    for (i, x) in setting.algebroid.base().iter().enumerate() {
        let anchor: Vec<ExprId> = (0..eta.len()).map(|a| setting.algebroid.anchor(i, a)).collect();
        rates.insert(*x, g.dot(&anchor, &symbols));
    }
    let pairs = eta.iter().map(|u| u.symbol).zip(accelerations.iter().copied()).collect::<Vec<_>>();
    let mut old = Vec::new();
    for (y, acceleration) in velocities.iter().zip(&higher.accelerations) {
        let own = g.sym(*y);
        old.push((*acceleration, values.get(y).copied().unwrap_or(own)));
    }
    let mut replaced = values.clone();
    replaced.extend(prolonged(g, &old, &rates, &pairs).accelerations);
    let mut carried = higher.carried;
    for acceleration in &mut carried {
        let divided = |_: DivisionByZero| Error::DivisionByZero { place: "the change of frame".into() };
        acceleration.rate = g.subs(acceleration.rate, &replaced).map_err(divided)?;
    }
    Ok(HigherOrder { carried, accelerations })
}

/// A condition on accelerations, `ydot = T etadot + Tdot eta`.
fn acceleration_in(
    g: &mut Graph,
    setting: &Setting<'_>,
    frame: &Frame,
    eta: &[Unknown],
    row: AccelerationRow,
    values: &BTreeMap<SymbolId, ExprId>,
) -> Result<AccelerationRow, Error> {
    let old = substituted(g, &[row.one_form], values)?.remove(0);
    let replace = |g: &mut Graph, e: ExprId| {
        let divided = |_: DivisionByZero| Error::DivisionByZero { place: "the change of frame".into() };
        g.subs(e, values).map_err(divided)
    };
    let source = match row.source {
        AccelerationSource::Differentiated(residual) => {
            AccelerationSource::Differentiated(replace(g, residual)?)
        }
        AccelerationSource::Servo(remainder) => {
            let mut terms = vec![replace(g, remainder)?];
            let symbols: Vec<ExprId> = eta.iter().map(|u| g.sym(u.symbol)).collect();
            for (w, entries) in old.iter().zip(&frame.matrix) {
                for (entry, x) in entries.iter().zip(&symbols) {
                    let mut rate = vec![g.diff(*entry, setting.time)];
                    for (b, y) in symbols.iter().enumerate() {
                        let along = setting.algebroid.derivative_along(g, b, *entry);
                        rate.push(g.mul(along, *y));
                    }
                    let rate = g.sum(&rate);
                    terms.push(g.product(&[*w, rate, *x]));
                }
            }
            AccelerationSource::Servo(g.sum(&terms))
        }
    };
    let one_form = frame.one_form(g, &old);
    Ok(AccelerationRow { one_form, source, ..row })
}
