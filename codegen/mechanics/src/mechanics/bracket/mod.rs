//! The nonholonomic bracket: an antisymmetric matrix `Pi` of functions on the state and a vector `R` with
//! `z' = Pi dE + R` along the motion.
//!
//! With sections `W_a` that span the allowed velocities, and momenta `pi_a = <p, W_a>` at `p = L_y`,
//!
//! ```text
//! {x^i, x^j} = 0,   {x^i, pi_b} = rho(W_b)^i,   {pi_a, pi_b} = -<p, [W_a, W_b]>
//! ```
//!
//! The motion stays on momenta of allowed velocities, which annihilate what is orthogonal to these in the metric
//! `L_yy`: `<p, [W_a, W_b]>` asks for no complement. Where velocities are eliminated, `W = Psi`; where multipliers keep
//! the constraint, `W_a` is the frame projected along the metric, and the bracket is that of `p o P` with the
//! projection `P` of momenta. Momenta and velocities `u` are related by `d pi = A du + ..`, which takes the bracket to
//! the coordinates of the state.
//!
//! A nonlinear constraint `psi(x, y) = 0` has the allowed displacements of Chetaev, `<d psi/dy, w> = 0`, and its states
//! are no vector space. Pointwise the same formulas hold with the forms `a_A = d psi_A/dy`: `Pi dE` has the velocity
//! `y - z`, where `z = n_A S^AB a_B y` vanishes for homogeneous constraints, by Euler, and `R` is the section of the
//! symplectic complement of the allowed vectors whose velocity is `z`.
//!
//! Does not know: which coordinates a scene leaves out, what is found out about a bracket.
//!
//! # Source
//! van der Schaft, Maschke 1994; de Leon, Marrero, Martin de Diego 2010; nonlinear constraints: Cortes, de Leon,
//! Marrero, Martinez 2009, section 7.

mod builder;
mod coordinates;
mod projected;
mod solved;

use std::collections::BTreeSet;

use crate::reduction::KinematicConstraint;
use hamel_expr::differentiate::Linearisation;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Section, SectionWriter, SymbolId, Vanishing, needed_sections};

use super::chart::Chart;
use super::equations::Equations;
use builder::Builder;
use coordinates::{OnState, dense};

/// The bracket of the state variables of [`Equations`], in their order.
#[derive(Clone, Debug)]
pub struct Bracket {
    /// `{z_i, z_j}` for `i < j`, without those that vanish identically; row by row.
    pub entries: Vec<(usize, usize, ExprId)>,
    /// `R`, one number for each state variable: zero unless a constraint is not homogeneous in the velocities,
    /// something depends on time, or a force acts.
    pub remainder: Vec<ExprId>,
    /// Definitions that the entries use, to come after those of the equations.
    pub sections: Vec<Section>,
}

impl Bracket {
    /// The bracket of a system, with `z' = Pi dE + R` proved: where multipliers keep a constraint, on it.
    ///
    /// # Errors
    /// [`Error::NoBracket`] for a system that has none of this kind, [`Error::Unverified`] where the identity is not
    /// proved.
    pub fn new(g: &mut Graph, equations: &Equations) -> Result<Bracket, Error> {
        let mut b = Builder::new(g, equations)?;
        let chart = Chart::new(b.g, equations)?;
        let momentum_form = match &equations.system.constraint {
            KinematicConstraint::Solved(solved) => b.of_solved(solved)?,
            KinematicConstraint::Multipliers { rows, .. } => b.of_projection(rows, &chart)?,
        };
        let OnState { entries, remainder, sections } = b.on_state(&momentum_form)?;
        let bracket = Bracket { entries, remainder, sections };
        bracket.prove(g, equations, &chart)?;
        Ok(bracket)
    }

    /// Whether `R` vanishes.
    pub fn has_remainder(&self, g: &Graph) -> bool {
        self.remainder.iter().any(|e| *e != g.zero())
    }

    /// `{z_i, z_j}` for all pairs.
    pub fn matrix(&self, g: &mut Graph) -> Vec<Vec<ExprId>> {
        dense(g, self.remainder.len(), &self.entries)
    }

    /// `z' = Pi dE + R` by values of both sides.
    fn prove(&self, g: &mut Graph, equations: &Equations, chart: &Chart) -> Result<(), Error> {
        let (slopes, scratch) = gradient(g, equations, &self.sections, equations.energy);
        let own = [self.sections.as_slice(), scratch.as_slice()].concat();
        let matrix = self.matrix(g);
        for (i, state) in equations.state.iter().enumerate() {
            let mut terms = vec![state.derivative];
            for (j, slope) in slopes.iter().enumerate() {
                let product = g.mul(matrix[i][j], *slope);
                terms.push(g.neg(product));
            }
            terms.push(g.neg(self.remainder[i]));
            let difference = g.sum(&terms);
            let difference = chart.restricted(g, &own, difference)?;
            if g.vanishing(difference) != Vanishing::Zero {
                return Err(Error::Unverified {
                    claim: format!("{}' = Pi dE + R of the nonholonomic bracket", state.name),
                    residual: "the difference of both sides".into(),
                    component: None,
                });
            }
        }
        Ok(())
    }
}

/// Derivatives of a value by the state variables, and definitions that they use.
fn gradient(g: &mut Graph, equations: &Equations, own: &[Section], e: ExprId) -> (Vec<ExprId>, Vec<Section>) {
    let by: Vec<SymbolId> = equations.state.iter().map(|s| s.symbol).collect();
    let all: Vec<Section> = equations.sections.iter().chain(own).cloned().collect();
    let sections = needed_sections(g, &all, &[e]);
    let linear = Linearisation::new(g, &sections, &[e], &by);
    let mut writer = SectionWriter::new(g, BTreeSet::new(), &[]);
    let slopes = linear.jacobian(g, &mut writer, |v, x| format!("d_{v}_d_{x}"), str::to_owned).remove(0);
    (slopes, writer.finish().0)
}
