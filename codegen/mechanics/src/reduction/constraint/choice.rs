//! Which form the constraints of a model take: solved for dependent velocities, or kept with multipliers.
//!
//! Does not know: how rows are solved, the Lagrangian.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Sign, SymbolId, Vanishing};
use hamel_lang::spec::{self, Constraint, ConstraintKind, Model};

use super::solver::{Said, Solver};
use super::{
    AccelerationRow, AccelerationSource, ConstraintRow, KinematicConstraint, Reactions, SolvedConstraint,
    Unknown,
};

/// The constraint of a model in the form that its equations take.
///
/// Rows that are linear in the velocities are solved for the velocities that are best to divide by, which also detects
/// those that are dependent or inconsistent; multipliers stay where the model asks for them, where a row is not linear,
/// and where no choice of dependent velocities is good on the whole domain.
///
/// # Errors
/// Dependent, inconsistent or unsolvable constraints, and virtual displacements that do not fit them.
pub(in crate::reduction) fn constrain(
    model: &mut Model,
    signs: &BTreeMap<ExprId, Sign>,
) -> Result<KinematicConstraint, Error> {
    let frame = frame_unknowns(model);
    let quasi = quasi_unknowns(model);
    let params: BTreeSet<SymbolId> = model.params.iter().map(|p| p.symbol).collect();
    let (linear, general) = constraint_rows(model);
    let displacements = displacement_rows(model);
    let (determined, given) = (determined(model, &linear), given(model, &linear));
    let choice = Choice {
        independent: model.independent.as_deref(),
        multipliers: model.force_multipliers,
        said: Said { together: &determined, in_order: &given },
        is_by_rows: model.constraints.iter().any(|c| c.position.is_some() || c.gives.is_some()),
    };
    let setting = Setting { frame: &frame, quasi: &quasi, params: &params, signs };
    let solved = solve_rows(&mut model.graph, &setting, (linear, general), displacements, choice);
    solved.map_err(|error| match error {
        Error::DependentConstraint { constraint }
            if model.constraints.iter().any(|c| c.position.is_some() && c.text == constraint) =>
        {
            Error::DependentPositions { constraint }
        }
        other => other,
    })
}

/// The linear constraints of a model together with rows of somebody else, which leave no velocity open: solved one row
/// after the other.
///
/// # Errors
/// Dependent and inconsistent rows.
pub(in crate::reduction) fn solved_with(
    model: &mut Model,
    rows: Vec<ConstraintRow>,
    signs: &BTreeMap<ExprId, Sign>,
) -> Result<SolvedConstraint, Error> {
    let frame = frame_unknowns(model);
    let params: BTreeSet<SymbolId> = model.params.iter().map(|p| p.symbol).collect();
    let (linear, mut general) = constraint_rows(model);
    let linear: Vec<ConstraintRow> = linear.into_iter().chain(rows).collect();
    general.extend(linear[general.len()..].iter().map(|row| AccelerationRow {
        name: row.name.clone(),
        text: row.text.clone(),
        one_form: row.one_form.clone(),
        source: AccelerationSource::Differentiated(row.offset),
        mode: None,
    }));
    let (determined, given) = (determined(model, &linear), given(model, &linear));
    let said = Said { together: &determined, in_order: &given };
    let choice = Choice { said, is_by_rows: true, ..Choice::default() };
    let setting = Setting { frame: &frame, quasi: &[], params: &params, signs };
    match solve_rows(&mut model.graph, &setting, (linear, general), Vec::new(), choice)? {
        KinematicConstraint::Solved(solved) => Ok(solved),
        KinematicConstraint::Multipliers { .. } => Err(Error::Unsupported {
            what: "constraints that do not determine every velocity beside fields".into(),
            possible: "one linear equation for each velocity without a field".into(),
        }),
    }
}

/// The velocities that constraints restrict, and what is known beside.
pub(in crate::reduction) struct Setting<'a> {
    pub(in crate::reduction) frame: &'a [Unknown],
    pub(in crate::reduction) quasi: &'a [Unknown],
    pub(in crate::reduction) params: &'a BTreeSet<SymbolId>,
    pub(in crate::reduction) signs: &'a BTreeMap<ExprId, Sign>,
}

/// What somebody else decided about the form of constraints.
#[derive(Clone, Copy, Default)]
pub(in crate::reduction) struct Choice<'a> {
    /// Velocities that are to be independent.
    pub(in crate::reduction) independent: Option<&'a [usize]>,
    /// Whether multipliers are kept.
    pub(in crate::reduction) multipliers: bool,
    /// Linear rows and the velocities that they are solved for: together those of coordinates that equations give.
    pub(in crate::reduction) said: Said<'a>,
    /// See [`Solver::is_by_rows`].
    pub(in crate::reduction) is_by_rows: bool,
}

fn row_of(rows: &[ConstraintRow], constraint: &Constraint) -> Option<usize> {
    rows.iter().position(|row| row.name == constraint.name)
}

/// Linear constraints and the base velocities of coordinates that they give.
fn determined(model: &Model, rows: &[ConstraintRow]) -> Vec<(usize, usize)> {
    let found = model.constraints.iter().filter_map(|c| Some((row_of(rows, c)?, c.position?.determines?)));
    found.filter(|(_, coordinate)| *coordinate < model.n_shape()).collect()
}

/// Linear constraints and the velocities that the model says they give.
fn given(model: &Model, rows: &[ConstraintRow]) -> Vec<(usize, usize)> {
    model.constraints.iter().filter_map(|c| Some((row_of(rows, c)?, c.gives?))).collect()
}

/// Constraints in the form that their equations take: those that are linear, and all as conditions on accelerations;
/// `displacements` are conditions on virtual displacements of their own, if there are any.
///
/// # Errors
/// As [`constrain`].
pub(in crate::reduction) fn solve_rows(
    g: &mut Graph,
    setting: &Setting<'_>,
    (linear, general): (Vec<ConstraintRow>, Vec<AccelerationRow>),
    displacements: Vec<ConstraintRow>,
    choice: Choice<'_>,
) -> Result<KinematicConstraint, Error> {
    let Setting { frame, quasi, params, signs } = *setting;
    let names: Vec<String> = frame.iter().map(|u| u.name.clone()).collect();
    let all_linear = linear.len() == general.len();
    let keep_all = (choice.multipliers && !general.is_empty()) || !all_linear;
    let wanted = choice.independent.filter(|_| !keep_all);
    let is_by_rows = choice.is_by_rows;
    let mut solver = Solver { graph: g, names: &names, quasi, params, facts: signs, is_by_rows };
    // Solving also detects dependent and inconsistent rows, so it runs even when multipliers are asked for.
    let solved = solver.solve(&linear, wanted, choice.said)?;
    let is_determined = linear.len() == names.len() && quasi.is_empty();
    let solved = match solved {
        // Multipliers would stand beside accelerations of velocities that the constraints determine, and need inertia
        // along each. Determinants are watched where they are not known to have a sign.
        None if is_determined && !keep_all => Some(solver.solve_somewhere(&linear)?),
        other => other.filter(|_| !keep_all),
    };
    (solver.quasi, solver.is_by_rows) = (&[], false);
    // Conditions of modes that are never on together may be the same.
    let has_modes = general.iter().any(|row| row.mode.is_some());
    let allowed = match has_modes {
        true => None,
        false => solver.solve(&displacements, None, Said::default())?,
    };
    if !displacements.is_empty() {
        // As many as the motion has constraints; quasi-velocities may be more than those leave.
        let n_unknowns = solved.as_ref().map(|s| s.psi.first().map_or(0, Vec::len));
        let expected = n_unknowns.map_or(general.len(), |n| names.len().saturating_sub(n));
        if displacements.len() != expected {
            let found = displacements.len();
            return Err(Error::WrongNumberOfDisplacements { found, expected, velocities: names.len() });
        }
    }
    let (Some(solved), Some(allowed)) = (solved, allowed) else {
        return multiplier_form(general, &displacements, !quasi.is_empty());
    };
    let unknowns: Vec<Unknown> = frame
        .iter()
        .enumerate()
        .filter(|(k, _)| !solved.dependent.contains(k))
        .map(|(_, u)| u)
        .chain(quasi)
        .cloned()
        .collect();
    let mut pivots = solved.pivots;
    let (virtual_displacements, reactions) = if displacements.is_empty() {
        let reactions = Reactions {
            names: linear.iter().map(|r| r.name.clone()).collect(),
            one_forms: linear.iter().map(|r| r.one_form[..names.len()].to_vec()).collect(),
            on: solved.dependent.clone(),
        };
        (solved.psi.clone(), reactions)
    } else {
        pivots.extend(allowed.pivots);
        let reactions = Reactions {
            names: displacements.iter().map(|r| r.name.clone()).collect(),
            one_forms: displacements.into_iter().map(|r| r.one_form).collect(),
            on: allowed.dependent,
        };
        (allowed.psi, reactions)
    };
    Ok(KinematicConstraint::Solved(SolvedConstraint {
        unknowns,
        dependent: solved.dependent,
        psi: solved.psi,
        psi0: solved.psi0,
        virtual_displacements,
        reactions,
        rows: linear,
        pivots,
        response: solved.response,
    }))
}

fn multiplier_form(
    rows: Vec<AccelerationRow>,
    displacements: &[ConstraintRow],
    has_quasi_velocities: bool,
) -> Result<KinematicConstraint, Error> {
    if has_quasi_velocities {
        return Err(Error::Unsupported {
            what: "a quasi-velocity beside constraints that need multipliers".into(),
            possible: "constraints linear in the velocities that can be solved for the others".into(),
        });
    }
    // Chetaev's rule: without a space of displacements of their own, they are the kernel of the one-forms.
    let reactions = if displacements.is_empty() {
        rows.iter().map(|r| r.one_form.clone()).collect()
    } else {
        displacements.iter().map(|r| r.one_form.clone()).collect()
    };
    Ok(KinematicConstraint::Multipliers { rows, reactions })
}

/// A problem of the constraints, at the first of them where it has no place of its own.
pub(in crate::reduction) fn refused(model: &Model, error: &Error) -> spec::Diagnostic {
    let first = model.constraints.first().and_then(|c| c.span);
    let mut problem = model.diagnose(error);
    problem.span = problem.span.or(first);
    problem
}

/// The constraints as affine forms on frame velocities and quasi-velocities, where they are, and all of them as
/// conditions on accelerations.
fn constraint_rows(model: &mut Model) -> (Vec<ConstraintRow>, Vec<AccelerationRow>) {
    let (mut linear, mut general) = all_rows(model);
    if linear.len() == general.len() {
        let kept = kept(model, &linear);
        linear.retain(|row| !kept.contains(&row.name));
        general.retain(|row| !kept.contains(&row.name));
    }
    (linear, general)
}

/// Names of the equations between positions whose rates follow from the constraints on velocities, such as that of a
/// wheel which rolls: it stays on the ground. They hold where they once do, and have no rows of their own.
fn kept(model: &Model, rows: &[ConstraintRow]) -> BTreeSet<String> {
    let is = |name: &str, test: fn(&Constraint) -> bool| {
        model.constraints.iter().any(|c| c.name == name && test(c))
    };
    let is_open =
        |row: &&ConstraintRow| is(&row.name, |c| c.position.is_some_and(|p| p.determines.is_none()));
    let on_velocities: Vec<ConstraintRow> =
        rows.iter().filter(|row| is(&row.name, |c| c.position.is_none())).cloned().collect();
    let candidates: Vec<&ConstraintRow> = rows.iter().filter(is_open).collect();
    if candidates.is_empty() || on_velocities.is_empty() {
        return BTreeSet::new();
    }
    let mut g = model.graph.clone();
    let (quasi, params) = (quasi_unknowns(model), model.params.iter().map(|p| p.symbol).collect());
    let names: Vec<String> = frame_unknowns(model).into_iter().map(|u| u.name).collect();
    let facts = BTreeMap::new();
    let mut solver = Solver {
        graph: &mut g,
        names: &names,
        quasi: &quasi,
        params: &params,
        facts: &facts,
        is_by_rows: false,
    };
    let given = given(model, &on_velocities);
    // What is wrong with them is found again, and told, where they are solved for good.
    let solved = match model.independent.as_deref() {
        Some(wanted) => solver
            .solve(&on_velocities, Some(wanted), Said { in_order: &given, ..Said::default() })
            .ok()
            .flatten(),
        None => solver.solve_somewhere(&on_velocities).ok(),
    };
    let Some(solved) = solved else { return BTreeSet::new() };
    let free = (0..names.len() + quasi.len()).filter(|k| !solved.dependent.contains(k));
    let free: Vec<usize> = free.collect();
    let mut vanishes = |row: &ConstraintRow, own: ExprId, along: &dyn Fn(usize) -> ExprId| {
        let terms = solved.dependent.iter().map(|k| g.mul(row.one_form[*k], along(*k)));
        let terms: Vec<ExprId> = terms.chain([own]).collect();
        let sum = g.sum(&terms);
        g.vanishing(sum) == Vanishing::Zero
    };
    let mut follows = |row: &&ConstraintRow| {
        vanishes(row, row.offset, &|k| solved.psi0[k])
            && (free.iter().enumerate())
                .all(|(a, column)| vanishes(row, row.one_form[*column], &|k| solved.psi[k][a]))
    };
    candidates.into_iter().filter(|row| follows(row)).map(|row| row.name.clone()).collect()
}

fn all_rows(model: &mut Model) -> (Vec<ConstraintRow>, Vec<AccelerationRow>) {
    let frame = frame_unknowns(model);
    let columns: Vec<SymbolId> = frame.iter().chain(&quasi_unknowns(model)).map(|u| u.symbol).collect();
    let mut linear = Vec::new();
    let mut general = Vec::new();
    for c in &model.constraints {
        let g = &mut model.graph;
        let parts = match c.kind {
            ConstraintKind::Linear if c.mode.is_none() => g.affine_parts(c.residual, &columns),
            ConstraintKind::Linear
            | ConstraintKind::Nonlinear
            | ConstraintKind::SecondOrder { .. }
            | ConstraintKind::ThirdOrder { .. } => None,
        };
        let (name, text) = (c.name.clone(), c.text.clone());
        let (one_form, source) = match (&c.kind, parts) {
            (_, Some((one_form, offset))) => {
                let written = Some(c.residual);
                let (name, text) = (name.clone(), text.clone());
                let row = ConstraintRow { name, text, one_form, offset, written };
                let on_frame = row.one_form[..frame.len()].to_vec();
                linear.push(row);
                (on_frame, AccelerationSource::Differentiated(c.residual))
            }
            (ConstraintKind::SecondOrder { acceleration }, _) => {
                (acceleration.clone(), AccelerationSource::Servo(c.residual))
            }
            (ConstraintKind::ThirdOrder { jerk, carried }, _) => {
                let own = g.sym(carried.symbol);
                (jerk.clone(), AccelerationSource::Servo(g.sub(carried.offset, own)))
            }
            _ => {
                let slopes = frame.iter().map(|u| g.diff(c.residual, u.symbol)).collect();
                (slopes, AccelerationSource::Differentiated(c.residual))
            }
        };
        let mode = c.mode.map(|mode| model.modes[mode].symbol);
        general.push(AccelerationRow { name, text, one_form, source, mode });
    }
    (linear, general)
}

/// The conditions on virtual displacements that the model gives, as forms on frame velocities.
fn displacement_rows(model: &Model) -> Vec<ConstraintRow> {
    let offset = model.graph.zero();
    let conditions = model.virtual_constraints.iter();
    conditions
        .map(|v| ConstraintRow {
            name: v.name.clone(),
            text: v.text.clone(),
            one_form: v.one_form.clone(),
            offset,
            written: None,
        })
        .collect()
}

/// Forms on frame velocities and quasi-velocities that vanish on virtual displacements: the conditions on these where
/// the model gives any, else the constraints by Chetaev's rule.
pub(in crate::reduction) fn annihilator(model: &mut Model) -> Vec<ConstraintRow> {
    let mut rows = displacement_rows(model);
    if rows.is_empty() {
        let (linear, general) = constraint_rows(model);
        let offset = model.graph.zero();
        rows = match linear.len() == general.len() {
            true => linear.into_iter().map(|row| ConstraintRow { offset, written: None, ..row }).collect(),
            false => general
                .into_iter()
                .map(|AccelerationRow { name, text, one_form, .. }| ConstraintRow {
                    name,
                    text,
                    one_form,
                    offset,
                    written: None,
                })
                .collect(),
        };
    }
    let width = model.all_velocities().len() + model.quasi_velocities.len();
    let zero = model.graph.zero();
    rows.iter_mut().for_each(|row| row.one_form.resize(width, zero));
    rows
}

fn quasi_unknowns(model: &Model) -> Vec<Unknown> {
    let quasi = model.quasi_velocities.iter();
    quasi.map(|v| Unknown { name: v.name.clone(), symbol: v.symbol, frame_idx: None }).collect()
}

pub(in crate::reduction) fn frame_unknowns(model: &Model) -> Vec<Unknown> {
    let velocities = model.all_velocities().into_iter().enumerate();
    velocities
        .map(|(k, (name, symbol))| Unknown { name: name.to_owned(), symbol, frame_idx: Some(k) })
        .collect()
}
