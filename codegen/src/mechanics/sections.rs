//! Sections of the constraint distribution.

use crate::algebra::Algebroid;
use crate::expr::{ExprId, Graph, Vanishing};
use crate::reduction::SolvedConstraint;

/// Whether the span of the columns of `Psi` is closed under the bracket, so that the constraint is holonomic:
/// `[Psi_a, Psi_b]^gamma = Psi_a^alpha Psi_b^beta C^gamma_{alpha beta} + rho(Psi_a) Psi_b^gamma - rho(Psi_b) Psi_a^gamma`
/// lies in the span. `None` for affine constraints, where quasi-velocities parametrise the distribution, and where that could not
/// be found out.
pub(super) fn is_subalgebroid(
    g: &mut Graph,
    algebroid: &Algebroid,
    solved: &SolvedConstraint,
) -> Option<bool> {
    let frame: Vec<usize> = solved.unknowns.iter().map(|u| u.frame_idx).collect::<Option<_>>()?;
    if solved.psi0.iter().any(|e| *e != g.zero()) {
        return None;
    }
    let column = |a: usize| -> Vec<ExprId> { solved.psi.iter().map(|row| row[a]).collect() };
    let mut is_known = true;
    for a in 0..frame.len() {
        for b in a + 1..frame.len() {
            let bracket = bracket_of_sections(g, algebroid, &column(a), &column(b));
            // A vector of the span is determined by its independent components.
            for &alpha in &solved.dependent {
                let mut terms = vec![g.neg(bracket[alpha])];
                for (k, &independent) in frame.iter().enumerate() {
                    terms.push(g.mul(solved.psi[alpha][k], bracket[independent]));
                }
                let residual = g.sum(&terms);
                match g.vanishing(residual) {
                    Vanishing::Zero => {}
                    Vanishing::NonZero => return Some(false),
                    Vanishing::Unknown => is_known = false,
                }
            }
        }
    }
    is_known.then_some(true)
}

fn bracket_of_sections(g: &mut Graph, algebroid: &Algebroid, x: &[ExprId], y: &[ExprId]) -> Vec<ExprId> {
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
