//! Sections of the constraint distribution.

use std::collections::BTreeSet;

use crate::reduction::{AccelerationSource, KinematicConstraint, ReducedSystem};
use hamel_expr::{ExprId, Graph, SymbolId, Vanishing, independent_rows};
use hamel_lang::algebra::Algebroid;
use hamel_lang::algebra::tableau::solve_symbolic;

/// Velocities `y = Psi u + psi0` where `u` are velocities of the frame.
struct Distribution {
    /// The columns of `Psi`.
    columns: Vec<Vec<ExprId>>,
    psi0: Vec<ExprId>,
    /// Places of `u` in the frame.
    independent: Vec<usize>,
    dependent: Vec<usize>,
}

/// Whether the constraint is holonomic: in the frame with time, `[Psi_a, Psi_b]` and `[d/dt + psi0, Psi_a]` lie in the
/// span of the columns of `Psi`, with
///
/// ```text
/// [x, y]^c = x^a y^b C^c_ab + rho(x) y^c - rho(y) x^c,   [d/dt, x]^c = dx^c/dt + N^c_a x^a
/// ```
///
/// For a linear constraint the allowed velocities form a subalgebroid, the same one at all times: one that moves with
/// time may keep no function of place and time although it does at each moment. `None` where there is no constraint on
/// velocities alone that is affine in them, where quasi-velocities parametrise the distribution, where it depends on
/// states of first order, and where it could not be found out.
///
/// # Source
/// Frobenius 1877; Cortes, de Leon, Marrero, Martinez 2009, Remark 3.3.
pub(super) fn is_holonomic(g: &mut Graph, system: &ReducedSystem) -> Option<bool> {
    let allowed = Distribution::new(g, system)?;
    let states: BTreeSet<SymbolId> = system.own_rates.iter().map(|own| own.symbol).collect();
    let all = allowed.columns.iter().flatten().chain(&allowed.psi0);
    if all.clone().any(|e| g.depends_on(*e, &states)) {
        return None;
    }
    let algebroid = &system.algebroid;
    let mut is_known = true;
    for (a, column) in allowed.columns.iter().enumerate() {
        let with_time = rate_of_section(g, algebroid, system.time, column);
        let with_psi0 = bracket_of_sections(g, algebroid, &allowed.psi0, column);
        let with_drift: Vec<ExprId> = with_time.iter().zip(with_psi0).map(|(x, y)| g.add(*x, y)).collect();
        let mut brackets = vec![with_drift];
        for other in &allowed.columns[a + 1..] {
            brackets.push(bracket_of_sections(g, algebroid, column, other));
        }
        for bracket in brackets {
            match allowed.has(g, &bracket) {
                Vanishing::Zero => {}
                Vanishing::NonZero => return Some(false),
                Vanishing::Unknown => is_known = false,
            }
        }
    }
    is_known.then_some(true)
}

impl Distribution {
    fn new(g: &mut Graph, system: &ReducedSystem) -> Option<Distribution> {
        let m = system.algebroid.rank();
        match &system.constraint {
            KinematicConstraint::Solved(solved) => {
                let independent = solved.unknowns.iter().map(|u| u.frame_idx).collect::<Option<Vec<_>>>()?;
                let column = |a: usize| solved.psi.iter().map(|row| row[a]).collect();
                let columns = (0..independent.len()).map(column).collect();
                let (psi0, dependent) = (solved.psi0.clone(), solved.dependent.clone());
                (!solved.rows.is_empty()).then_some(Distribution { columns, psi0, independent, dependent })
            }
            KinematicConstraint::Multipliers { rows, .. } => {
                let (mut forms, mut offsets) = (Vec::new(), Vec::new());
                for row in rows {
                    let AccelerationSource::Differentiated(residual) = row.source else { return None };
                    if row.mode.is_some() {
                        return None;
                    }
                    let (form, offset) = g.affine_parts(residual, &system.velocities)?;
                    forms.push(form);
                    offsets.push(offset);
                }
                // Which velocities are independent does not matter at a general place.
                let of_frame = |alpha: usize| forms.iter().map(|form| form[alpha]).collect();
                let dependent = independent_rows(g, &(0..m).map(of_frame).collect::<Vec<Vec<ExprId>>>());
                if dependent.len() != forms.len() {
                    return None;
                }
                let independent: Vec<usize> = (0..m).filter(|alpha| !dependent.contains(alpha)).collect();
                let pick = |form: &Vec<ExprId>, places: &[usize]| places.iter().map(|k| form[*k]).collect();
                let matrix: Vec<Vec<ExprId>> = forms.iter().map(|form| pick(form, &dependent)).collect();
                let right = forms.iter().zip(&offsets).map(|(form, offset)| {
                    let mut row: Vec<ExprId> = pick(form, &independent);
                    row.push(*offset);
                    row.iter().map(|e| g.neg(*e)).collect()
                });
                let right: Vec<Vec<ExprId>> = right.collect();
                let solution = solve_symbolic(g, &matrix, &right).ok()?;
                let mut columns = vec![vec![g.zero(); m]; independent.len() + 1];
                for (row, alpha) in solution.iter().zip(&dependent) {
                    for (column, e) in columns.iter_mut().zip(row) {
                        column[*alpha] = *e;
                    }
                }
                for (column, alpha) in columns.iter_mut().zip(&independent) {
                    column[*alpha] = g.one();
                }
                let psi0 = columns.pop()?;
                Some(Distribution { columns, psi0, independent, dependent })
            }
        }
    }

    /// Whether the part of a section beside the span vanishes; a vector of the span is determined by its independent
    /// components.
    fn has(&self, g: &mut Graph, section: &[ExprId]) -> Vanishing {
        let mut verdict = Vanishing::Zero;
        for &alpha in &self.dependent {
            let mut terms = vec![g.neg(section[alpha])];
            for (column, &place) in self.columns.iter().zip(&self.independent) {
                terms.push(g.mul(column[alpha], section[place]));
            }
            let residual = g.sum(&terms);
            match g.vanishing(residual) {
                Vanishing::Zero => {}
                Vanishing::NonZero => return Vanishing::NonZero,
                Vanishing::Unknown => verdict = Vanishing::Unknown,
            }
        }
        verdict
    }
}

/// `[d/dt, x]`.
fn rate_of_section(g: &mut Graph, algebroid: &Algebroid, time: SymbolId, x: &[ExprId]) -> Vec<ExprId> {
    let mut rate: Vec<ExprId> = x.iter().map(|e| g.diff(*e, time)).collect();
    for (alpha, e) in x.iter().enumerate() {
        for (gamma, n) in algebroid.drift(alpha) {
            let turned = g.mul(*n, *e);
            rate[*gamma] = g.add(rate[*gamma], turned);
        }
    }
    rate
}

/// `[x, y]`.
pub(super) fn bracket_of_sections(
    g: &mut Graph,
    algebroid: &Algebroid,
    x: &[ExprId],
    y: &[ExprId],
) -> Vec<ExprId> {
    let m = algebroid.rank();
    let mut terms: Vec<Vec<ExprId>> = vec![Vec::new(); m];
    for alpha in 0..m {
        for beta in 0..m {
            if x[alpha] == g.zero() || y[beta] == g.zero() {
                continue;
            }
            for (gamma, c) in algebroid.bracket(g, alpha, beta) {
                terms[gamma].push(g.product(&[c, x[alpha], y[beta]]));
            }
        }
        for gamma in 0..m {
            let forward = algebroid.derivative_along(g, alpha, y[gamma]);
            let backward = algebroid.derivative_along(g, alpha, x[gamma]);
            terms[gamma].push(g.mul(x[alpha], forward));
            let backward = g.mul(y[alpha], backward);
            terms[gamma].push(g.neg(backward));
        }
    }
    terms.iter().map(|list| g.sum(list)).collect()
}
