//! Sections of the constraint distribution.

use std::collections::BTreeSet;

use crate::reduction::SolvedConstraint;
use hamel_expr::{ExprId, Graph, SymbolId, Vanishing};
use hamel_lang::algebra::Algebroid;

/// Whether the span of the columns of `Psi` is closed under the bracket, so that the constraint is holonomic:
/// `[Psi_a, Psi_b]^gamma = Psi_a^alpha Psi_b^beta C^gamma_{alpha beta} + rho(Psi_a) Psi_b^gamma - rho(Psi_b) Psi_a^gamma`
/// lies in the span, and so does `[d/dt, Psi_a]^gamma = dPsi_a^gamma/dt + N^gamma_alpha Psi_a^alpha`: a constraint that
/// moves with time may keep no function of place and time although it does at each moment. `None` for affine
/// constraints, where quasi-velocities parametrise the distribution, where the distribution depends on states of first
/// order (`states`), and where that could not be found out.
pub(super) fn is_subalgebroid(
    g: &mut Graph,
    algebroid: &Algebroid,
    (time, states): (SymbolId, &BTreeSet<SymbolId>),
    solved: &SolvedConstraint,
) -> Option<bool> {
    if solved.psi.iter().flatten().any(|e| g.depends_on(*e, states)) {
        return None;
    }
    let frame: Vec<usize> = solved.unknowns.iter().map(|u| u.frame_idx).collect::<Option<_>>()?;
    if solved.psi0.iter().any(|e| *e != g.zero()) {
        return None;
    }
    let column = |a: usize| -> Vec<ExprId> { solved.psi.iter().map(|row| row[a]).collect() };
    let mut is_known = true;
    for a in 0..frame.len() {
        let turning = rate_of_section(g, algebroid, time, &column(a));
        match in_span(g, solved, &frame, &turning) {
            Vanishing::Zero => {}
            Vanishing::NonZero => return Some(false),
            Vanishing::Unknown => is_known = false,
        }
        for b in a + 1..frame.len() {
            let bracket = bracket_of_sections(g, algebroid, &column(a), &column(b));
            match in_span(g, solved, &frame, &bracket) {
                Vanishing::Zero => {}
                Vanishing::NonZero => return Some(false),
                Vanishing::Unknown => is_known = false,
            }
        }
    }
    is_known.then_some(true)
}

/// Whether the part of a section beside the span vanishes; a vector of the span is determined by its independent
/// components.
fn in_span(g: &mut Graph, solved: &SolvedConstraint, frame: &[usize], section: &[ExprId]) -> Vanishing {
    let mut verdict = Vanishing::Zero;
    for &alpha in &solved.dependent {
        let mut terms = vec![g.neg(section[alpha])];
        for (k, &independent) in frame.iter().enumerate() {
            terms.push(g.mul(solved.psi[alpha][k], section[independent]));
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
