//! Coefficients of connections: the Levi-Civita connection of the kinetic energy in the frame of the velocities, and
//! the constrained connection of a nonholonomic system.
//!
//! Does not know: equations of motion, which follow from the same data by themselves.

use std::collections::BTreeSet;

use crate::reduction::{KinematicConstraint, ReducedSystem, SolvedConstraint};
use hamel_expr::error::Error;
use hamel_expr::{Budget, ExprId, Graph, SymbolId};
use hamel_lang::algebra::solve_symmetric;

/// Coefficients of connections of a system with a kinetic energy `G_ab(x) y^a y^b / 2`.
#[derive(Clone, Debug)]
pub struct Coefficients {
    /// Owner of the expressions.
    pub graph: Graph,
    /// Names of the velocities, whose sections `e_a` are the frame.
    pub frame: Vec<String>,
    /// `Gamma^c_ab` of the Levi-Civita connection, `nabla_a e_b = Gamma^c_ab e_c`, indexed `[c][a][b]`.
    pub levi_civita: Vec<Vec<Vec<ExprId>>>,
    /// Of the constrained connection, where a linear constraint has been solved.
    pub constrained: Option<ConstrainedCoefficients>,
}

/// Coefficients of the constrained connection in the frame of the independent velocities.
#[derive(Clone, Debug)]
pub struct ConstrainedCoefficients {
    /// Names of the independent velocities, whose sections are the columns `w_a` of `Psi`.
    pub velocities: Vec<String>,
    /// `Gamma^c_ab` of `P nabla_a w_b = Gamma^c_ab w_c` with the orthogonal projection `P`, indexed `[c][a][b]`.
    pub values: Vec<Vec<Vec<ExprId>>>,
}

/// The coefficients of the connections of a system.
///
/// `2 <nabla_a e_b, e_d> = rho_a G_bd + rho_b G_ad - rho_d G_ab + <[e_a, e_b], e_d> - <[e_a, e_d], e_b> - <[e_b, e_d], e_a>`.
///
/// # Errors
/// [`Error::Unsupported`] for a system without a Lagrangian, a Hessian that depends on velocities or is singular.
///
/// # Source
/// Cortes, de Leon, Marrero, Martinez 2009, example 3.6 and section 3.4, with the sign of the last derivative that
/// Koszul's formula has.
pub fn connection_coefficients(system: &ReducedSystem) -> Result<Coefficients, Error> {
    let unsupported = |what: &str| Error::Unsupported {
        what: format!("a Levi-Civita connection {what}"),
        possible: "a kinetic energy that is quadratic in the velocities and not degenerate".into(),
    };
    if system.hamiltonian.is_some() || system.accelerations.is_some() {
        return Err(unsupported("of a motion that follows from no lagrangian"));
    }
    let mut graph = system.graph.clone();
    graph.set_budget(Budget::UNLIMITED);
    let g = &mut graph;
    let metric = hessian(g, system);
    let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
    if metric.iter().flatten().any(|e| g.depends_on(*e, &velocities)) {
        return Err(unsupported("of a kinetic energy that is not quadratic"));
    }
    let lowered = koszul(g, system, &metric);
    let m = metric.len();
    // Columns (a, b), rows d.
    let pairs: Vec<(usize, usize)> = (0..m).flat_map(|a| (0..m).map(move |b| (a, b))).collect();
    let right: Vec<Vec<ExprId>> =
        (0..m).map(|d| pairs.iter().map(|(a, b)| lowered[d][*a][*b]).collect()).collect();
    let solved =
        solve_symmetric(g, &metric, &right).map_err(|_| unsupported("of a singular kinetic energy"))?;
    let levi_civita = squares(g, &solved, m);
    let constrained = match &system.constraint {
        KinematicConstraint::Solved(solved) if !solved.rows.is_empty() => {
            let values = constrained(g, system, solved, &metric, &levi_civita);
            let values =
                values.ok_or_else(|| unsupported("of a singular kinetic energy on the constraint"))?;
            let velocities = solved.unknowns.iter().map(|u| u.name.clone()).collect();
            Some(ConstrainedCoefficients { velocities, values })
        }
        _ => None,
    };
    Ok(Coefficients { frame: system.algebroid.frame().to_vec(), graph, levi_civita, constrained })
}

fn hessian(g: &mut Graph, system: &ReducedSystem) -> Vec<Vec<ExprId>> {
    let mut rows = Vec::new();
    for y in &system.velocities {
        let p = g.diff(system.lagrangian, *y);
        let row: Vec<ExprId> = system.velocities.iter().map(|z| g.diff(p, *z)).collect();
        rows.push(row.into_iter().map(|e| g.cancel_zero(e)).collect());
    }
    rows
}

/// `<nabla_a e_b, e_d>`, indexed `[d][a][b]`.
fn koszul(g: &mut Graph, system: &ReducedSystem, metric: &[Vec<ExprId>]) -> Vec<Vec<Vec<ExprId>>> {
    let (algebroid, m) = (&system.algebroid, metric.len());
    let along = |g: &mut Graph, a: usize, b: usize, d: usize| -> ExprId {
        let bracket = algebroid.bracket(g, a, b);
        let terms: Vec<ExprId> = bracket.into_iter().map(|(c, e)| g.mul(e, metric[c][d])).collect();
        g.sum(&terms)
    };
    let half = hamel_expr::Rational::new(1.into(), 2.into());
    let mut lowered = vec![vec![vec![g.zero(); m]; m]; m];
    for (d, of_d) in lowered.iter_mut().enumerate() {
        for (a, row) in of_d.iter_mut().enumerate() {
            for (b, entry) in row.iter_mut().enumerate() {
                let minus =
                    [algebroid.derivative_along(g, d, metric[a][b]), along(g, a, d, b), along(g, b, d, a)]
                        .map(|e| g.neg(e));
                let plus = [
                    algebroid.derivative_along(g, a, metric[b][d]),
                    algebroid.derivative_along(g, b, metric[a][d]),
                    along(g, a, b, d),
                ];
                let sum = g.sum(&[plus, minus].concat());
                let value = g.scale(sum, &half);
                *entry = g.cancel_zero(value);
            }
        }
    }
    lowered
}

/// `nabla_{w_a} w_b` projected orthogonally on the span of the columns `w` of `Psi`, indexed `[c][a][b]`.
fn constrained(
    g: &mut Graph,
    system: &ReducedSystem,
    solved: &SolvedConstraint,
    metric: &[Vec<ExprId>],
    levi_civita: &[Vec<Vec<ExprId>>],
) -> Option<Vec<Vec<Vec<ExprId>>>> {
    let (m, k) = (metric.len(), solved.unknowns.len());
    let psi = &solved.psi;
    // w_d lowered with the metric.
    let mut lowered = vec![vec![g.zero(); m]; k];
    for (d, row) in lowered.iter_mut().enumerate() {
        for (gamma, entry) in row.iter_mut().enumerate() {
            let terms: Vec<ExprId> = (0..m).map(|beta| g.mul(metric[gamma][beta], psi[beta][d])).collect();
            *entry = g.sum(&terms);
        }
    }
    let contract = |g: &mut Graph, form: &[ExprId], vector: &[ExprId]| {
        let sum = g.dot(form, vector);
        g.cancel_zero(sum)
    };
    let column = |b: usize| -> Vec<ExprId> { psi.iter().map(|row| row[b]).collect() };
    let mut gram = Vec::new();
    for form in &lowered {
        gram.push((0..k).map(|b| contract(g, form, &column(b))).collect::<Vec<_>>());
    }
    let mut right = vec![Vec::new(); k];
    for a in 0..k {
        for b in 0..k {
            let mut derivative = Vec::new();
            for (gamma, of_gamma) in levi_civita.iter().enumerate() {
                let mut terms = Vec::new();
                for alpha in 0..m {
                    if psi[alpha][a] == g.zero() {
                        continue;
                    }
                    let moved = system.algebroid.derivative_along(g, alpha, psi[gamma][b]);
                    terms.push(g.mul(psi[alpha][a], moved));
                    for beta in 0..m {
                        terms.push(g.product(&[psi[alpha][a], of_gamma[alpha][beta], psi[beta][b]]));
                    }
                }
                derivative.push(g.sum(&terms));
            }
            for (row, form) in right.iter_mut().zip(&lowered) {
                row.push(contract(g, form, &derivative));
            }
        }
    }
    let solved = solve_symmetric(g, &gram, &right).ok()?;
    Some(squares(g, &solved, k))
}

/// Rows of pairs `(a, b)` as squares `[a][b]`.
fn squares(g: &mut Graph, rows: &[Vec<ExprId>], n: usize) -> Vec<Vec<Vec<ExprId>>> {
    let entries = |row: &Vec<ExprId>| -> Vec<Vec<ExprId>> {
        let tidied: Vec<ExprId> = row.iter().map(|e| g.cancel_zero(*e)).collect();
        tidied.chunks(n).map(<[ExprId]>::to_vec).collect()
    };
    rows.iter().map(entries).collect()
}
