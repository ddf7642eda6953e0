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
//! with `E = p.y - L`: `alpha = -dL/dx`, `beta = -F`, `w = y`, `p = dL/dy`. Affine and nonlinear constraints have
//! virtual displacements for `eta` in the structure, which the velocity need not be.
//!
//! Does not know: how anything is written for people.
//!
//! # Source
//! Gay-Balmaz, Yoshimura 2015 (Dirac reduction for nonholonomic mechanical systems and semidirect products), equations
//! (2.11), (5.4), (6.9), (6.16).

use crate::expr::{ExprId, Graph, SymbolId};
use crate::reduction::{KinematicConstraint, ReducedSystem};

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
    /// `xdot = rho eta`, by base coordinate.
    pub rates: Vec<ExprId>,
    /// `a(eta)`, which vanishes, for each constraint.
    pub annihilator: Vec<ExprId>,
    /// `pdot` by the rest, in frame order.
    pub momentum_rates: Vec<ExprId>,
    /// Whether every velocity that the constraint allows is a virtual displacement.
    pub has_own_velocities: bool,
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
        let (forms, has_own_velocities): (&[Vec<ExprId>], bool) = match &system.constraint {
            KinematicConstraint::Solved(solved) => {
                let n_rows = solved.reactions.names.len();
                let rows = solved.rows.get(..n_rows).unwrap_or_default();
                let is_linear = rows.iter().all(|row| row.offset == g.zero());
                let is_own = rows.iter().map(|row| &row.one_form).eq(&solved.reactions.one_forms);
                (&solved.reactions.one_forms, is_linear && is_own)
            }
            KinematicConstraint::Multipliers { rows, reactions } => {
                let is_own = rows.iter().map(|row| &row.one_form).eq(reactions);
                (reactions, is_own)
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
        for i in 0..base.len() {
            let row: Vec<ExprId> = (0..frame.len()).map(|k| system.algebroid.anchor(i, k)).collect();
            rates.push(g.dot(&row, &y));
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

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::DiracStructure;
    use crate::mechanics::derive;
    use crate::reduction::{Formulation, KinematicConstraint, reduce};
    use crate::spec;

    /// With the differential of `E = p.y - L` less the force for a covector, the structure gives the momenta the rates
    /// that they have along the motion, up to the annihilator: on every virtual displacement.
    fn assert_gives_the_motion(text: &str) {
        let model = spec::parse("m", text).unwrap();
        let system = reduce(&model, &Formulation::of(&model)).unwrap();
        let equations = derive(&system).unwrap();
        let found = DiracStructure::new(&equations.system);
        let mut g = found.graph.clone();
        let system = &equations.system;
        let momenta: Vec<_> = system.velocities.iter().map(|s| g.diff(system.lagrangian, *s)).collect();
        let slopes: Vec<_> = system.algebroid.base().iter().map(|x| g.diff(system.lagrangian, *x)).collect();
        let mut values = BTreeMap::new();
        values.extend(found.eta.iter().copied().zip(system.velocities.iter().map(|s| g.sym(*s))));
        values.extend(found.momenta.iter().copied().zip(momenta.iter().copied()));
        values.extend(found.alpha.iter().copied().zip(slopes.iter().map(|e| g.neg(*e))));
        values.extend(found.beta.iter().copied().zip(system.forces.iter().map(|e| g.neg(*e))));
        values.extend(found.lambda.iter().map(|l| (*l, g.zero())));
        let velocities: BTreeMap<_, _> =
            system.velocities.iter().copied().zip(equations.velocities.iter().copied()).collect();
        let by_state: Vec<_> = momenta.iter().map(|p| g.subs(*p, &velocities).unwrap()).collect();
        let rates = crate::mechanics::rates::rates(&mut g, &equations, &equations.state, &by_state);
        let residuals: Vec<_> = (found.momentum_rates.iter().zip(rates))
            .map(|(e, rate)| {
                let given = g.subs(*e, &values).and_then(|e| g.subs(e, &velocities)).unwrap();
                g.sub(rate, given)
            })
            .collect();
        let KinematicConstraint::Solved(solved) = &system.constraint else { panic!("solved") };
        for b in 0..solved.unknowns.len() {
            let terms: Vec<_> = (solved.virtual_displacements.iter().zip(&residuals))
                .map(|(row, e)| {
                    let w = g.subs(row[b], &velocities).unwrap();
                    g.mul(w, *e)
                })
                .collect();
            let sum = g.sum(&terms);
            assert!(g.is_zero(sum), "{text}");
        }
        for (form, e) in solved.reactions.one_forms.iter().zip(&found.annihilator) {
            assert_eq!(form.iter().all(|c| *c == g.zero()), *e == g.zero(), "{text}");
        }
    }

    #[test]
    fn it_gives_the_motion_of_every_kind_of_system() {
        for text in [
            // Advected parameter, left and right.
            "model m { param I: diagonal(3) = [1, 2, 3]; velocity w in so(3); advected a in R^3 by cross(w, a);
                lagrangian = dot(w, I*w)/2 - a1 - a2^2; }",
            "model m { param I: diagonal(3) = [1, 2, 3]; velocity w in so(3); action right;
                lagrangian = dot(w, I*w)/2; }",
            // Constraint on se(2), with a force.
            "model m { param J = 2; velocity w, v in se(2); lagrangian = (J*w^2 + v1^2 + v2^2 + w*v2)/2;
                force w = -w; constraint v2 = 0; }",
            // A base, and a moving constraint.
            "model m { coordinate x, y, z in real; lagrangian = (x_dot^2 + y_dot^2 + z_dot^2)/2 - x*z;
                constraint z_dot = y*x_dot + cos(t); }",
        ] {
            assert_gives_the_motion(text);
        }
    }
}
