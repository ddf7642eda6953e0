//! The Dirac structure of a system, reduced by its symmetry, for those who read.
//!
//! On `T^E E*`, with coordinates `(x, p)` of `E*`, vectors `(eta, pdot)` over `xdot = rho eta` and covectors
//! `(alpha, beta, w)`, where `beta` pairs with `eta`, `alpha` with `xdot` and `w` with `pdot`:
//!
//! ```text
//! D/G = { a(eta) = 0,   w = eta,
//!         pdot_b + beta_b + rho^i_b alpha_i + C^c_bd eta^d p_c - N^c_b p_c = lambda_A a^A_b }
//! ```
//!
//! The bracket `C` has curvature and structure constants in it, the anchor `rho` the action on advected parameters.
//! Right actions have the opposite sign in `C`, as everywhere. The equations of motion are `(y, pdot; dE - F) in D/G`
//! with `E = p.y - L`: `alpha = -dL/dx`, `beta = -F`, `w = y`, `p = dL/dy`. Affine constraints, and nonlinear ones that
//! are not homogeneous, have virtual displacements for `eta` in the structure, and the velocity is none: the momenta
//! have the rates of the last line with `eta = y` all the same.
//!
//! Does not know: how anything is written for people.
//!
//! # Source
//! Gay-Balmaz, Yoshimura 2015 (Dirac reduction for nonholonomic mechanical systems and semidirect products), equations
//! (2.11), (5.4), (6.9), (6.16).

use crate::reduction::{AccelerationRow, AccelerationSource, KinematicConstraint, ReducedSystem};
use hamel_expr::{ExprId, Graph, Rational, SymbolId};

/// The reduced Dirac structure in the frame of a system.
#[derive(Clone, Debug)]
pub struct DiracStructure {
    /// Owner of all expressions.
    pub graph: Graph,
    /// Symbols of `eta`, in frame order.
    pub eta: Vec<SymbolId>,
    /// Symbols of the momenta `p`, in frame order.
    pub momenta: Vec<SymbolId>,
    /// Symbols of `alpha`, by base coordinate.
    pub alpha: Vec<SymbolId>,
    /// Symbols of `beta`, in frame order.
    pub beta: Vec<SymbolId>,
    /// Symbols of `lambda`.
    pub lambda: Vec<SymbolId>,
    /// `xdot = rho eta`, by base coordinate; of states of first order the rates that they have.
    pub rates: Vec<ExprId>,
    /// `a(eta)`, which vanishes, for each constraint.
    pub annihilator: Vec<ExprId>,
    /// `pdot` by the rest, in frame order.
    pub momentum_rates: Vec<ExprId>,
    /// Whether every velocity that the constraint allows is a virtual displacement.
    pub has_own_velocities: bool,
}

/// Degrees that are tried of a homogeneous constraint, numerators and denominators.
const DEGREES: [(i64, i64); 8] = [(1, 1), (2, 1), (3, 1), (4, 1), (1, 2), (3, 2), (-1, 1), (-2, 1)];

/// Whether the velocities that satisfy a constraint are displacements along it: `y.dphi/dy` vanishes with `phi`, or
/// everywhere, as it is a multiple of `phi` where that is homogeneous. A velocity is no acceleration, so that one that
/// is prescribed says nothing about it.
fn is_homogeneous(g: &mut Graph, row: &AccelerationRow, velocities: &[SymbolId]) -> bool {
    let AccelerationSource::Differentiated(residual) = row.source else { return false };
    let y: Vec<ExprId> = velocities.iter().map(|s| g.sym(*s)).collect();
    let along = g.dot(&row.one_form, &y);
    if g.is_zero(along) {
        return true;
    }
    DEGREES.iter().any(|(p, q)| {
        let terms =
            [(along, Rational::from_integer(1.into())), (residual, -Rational::new((*p).into(), (*q).into()))];
        let rest = g.linear_combination(&terms);
        g.is_zero(rest)
    })
}

/// One-forms that vanish on the displacements and on nothing else: the reactions' own ones, without the velocities that
/// only parametrise constraints.
///
/// A displacement has `a_A eta + q_A s = 0` for some `s`, that is, `q_B a_A eta = q_A a_B eta` for all pairs; one pair
/// with each `A` is enough where `q_B` is a number. Where all `q` of a pair vanish its form does, too. Of a solved
/// constraint `q_A` is `-a_A W_s`, with the column of `s`.
pub(super) fn annihilator(g: &mut Graph, system: &ReducedSystem) -> Vec<Vec<ExprId>> {
    let solved = match &system.constraint {
        KinematicConstraint::Multipliers { reactions, .. } => return reactions.clone(),
        KinematicConstraint::Solved(solved) => solved,
    };
    let n = system.velocities.len();
    let mut forms: Vec<Vec<ExprId>> =
        solved.reactions.one_forms.iter().map(|form| form[..n].to_vec()).collect();
    for k in (0..solved.unknowns.len()).filter(|k| solved.unknowns[*k].frame_idx.is_none()) {
        let column: Vec<ExprId> = solved.virtual_displacements.iter().map(|row| row[k]).collect();
        let (mut free, mut bound) = (Vec::new(), Vec::new());
        for form in forms {
            let along = g.dot(&form, &column);
            match g.is_zero(along) {
                true => free.push(form),
                false => bound.push((form, along)),
            }
        }
        let pivot = bound.iter().position(|(_, q)| g.as_number(*q).is_some());
        for i in 0..bound.len() {
            for j in (i + 1..bound.len()).filter(|j| pivot.is_none_or(|pivot| pivot == i || pivot == *j)) {
                let [(a, p), (b, q)] = [&bound[i], &bound[j]];
                let crossed = a.iter().zip(b).map(|(a, b)| {
                    let [first, second] = [g.mul(*a, *q), g.mul(*b, *p)];
                    g.sub(first, second)
                });
                free.push(crossed.collect());
            }
        }
        forms = free;
    }
    forms
}

impl DiracStructure {
    /// The structure of a system.
    pub fn new(system: &ReducedSystem) -> DiracStructure {
        let mut g = system.graph.clone();
        let frame = system.algebroid.frame();
        let named = |g: &mut Graph, stem: &str, names: &[String]| -> Vec<SymbolId> {
            names.iter().map(|name| g.symbol(&format!("{stem}_{name}"))).collect()
        };
        let base: Vec<String> = system.algebroid.base().iter().map(|x| g.name(*x).to_owned()).collect();
        let forms = annihilator(&mut g, system);
        let has_own_velocities = match &system.constraint {
            KinematicConstraint::Solved(solved) => {
                let n_rows = solved.reactions.names.len();
                let rows = solved.rows.get(..n_rows).unwrap_or_default();
                let is_linear = rows.iter().all(|row| row.offset == g.zero());
                // Rows may have coefficients of velocities that only parametrise constraints behind the others.
                let n = system.velocities.len();
                let along_frame = rows.iter().map(|row| &row.one_form[..n]);
                is_linear && along_frame.eq(solved.reactions.one_forms.iter().map(|form| &form[..n]))
            }
            KinematicConstraint::Multipliers { rows, reactions } => {
                let is_own = rows.iter().map(|row| &row.one_form).eq(reactions);
                let is_homogeneous = |row: &AccelerationRow| is_homogeneous(&mut g, row, &system.velocities);
                is_own && rows.iter().all(is_homogeneous)
            }
        };
        let eta = named(&mut g, "eta", frame);
        let momenta = named(&mut g, "p", frame);
        let beta = named(&mut g, "beta", frame);
        let alpha = named(&mut g, "alpha", &base);
        let lambda: Vec<SymbolId> = (1..=forms.len()).map(|k| g.symbol(&format!("lambda{k}"))).collect();
        let symbols =
            |g: &mut Graph, list: &[SymbolId]| -> Vec<ExprId> { list.iter().map(|s| g.sym(*s)).collect() };
        let [y, p, b, a, l] = [&eta, &momenta, &beta, &alpha, &lambda].map(|list| symbols(&mut g, list));
        let mut rates = Vec::new();
        let along_eta = system.velocities.iter().copied().zip(y.iter().copied()).collect();
        for (i, own) in system.own_rates_of_base().into_iter().enumerate() {
            let row: Vec<ExprId> = (0..frame.len()).map(|k| system.algebroid.anchor(i, k)).collect();
            let along = g.dot(&row, &y);
            // Names in the place of names divide by nothing.
            let own = g.subs(own, &along_eta).unwrap_or(own);
            rates.push(g.add(along, own));
        }
        let annihilator = forms.iter().map(|form| g.dot(form, &y)).collect();
        // The slopes -alpha and the force -beta of the structure itself.
        let slopes: Vec<ExprId> = a.iter().map(|e| g.neg(*e)).collect();
        let mut momentum_rates = Vec::new();
        for (k, beta) in b.iter().enumerate() {
            let force = g.neg(*beta);
            let net = system.algebroid.net_force(&mut g, (k, force), &y, &p, &slopes);
            let column: Vec<ExprId> = forms.iter().map(|form| form[k]).collect();
            let reaction = g.dot(&column, &l);
            momentum_rates.push(g.add(net, reaction));
        }
        DiracStructure {
            graph: g,
            eta,
            momenta,
            alpha,
            beta,
            lambda,
            rates,
            annihilator,
            momentum_rates,
            has_own_velocities,
        }
    }
}
