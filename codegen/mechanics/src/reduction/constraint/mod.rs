//! Kinematic constraints `a_A(x) . y + b_A(x, t) = 0`: solved for dependent velocities, or kept with multipliers.
//!
//! `choice` decides which form the constraints of a model take, `solver` solves linear rows; `higher` has what the
//! state carries for constraints of third order, and puts accelerations that constraints determine into the conditions
//! on displacements. Does not know: the bracket of the algebroid, the Lagrangian.

mod choice;
mod higher;
mod solver;

use hamel_expr::{ExprId, Graph, SymbolId};

use super::part::Part;

pub(super) use choice::{
    Choice, Setting, annihilator, constrain, frame_unknowns, refused, solve_rows, solved_with,
};
pub use higher::{CarriedAcceleration, HigherOrder};
pub(super) use higher::{Prolonged, prolonged, settled};
pub(super) use solver::{Said, Solver};

/// One scalar constraint as an affine form in the velocities.
#[derive(Clone, Debug)]
pub struct ConstraintRow {
    /// Name of the constraint.
    pub name: String,
    /// The constraint as written.
    pub text: String,
    /// `a_A`, one coefficient per velocity.
    pub one_form: Vec<ExprId>,
    /// `b_A`.
    pub offset: ExprId,
    /// What vanishes, as written in the model; none where the velocities are others than those of the model.
    pub written: Option<ExprId>,
}

/// Constraint in the solved form `y = Psi u + psi0`, with virtual displacements spanned by the columns of `W`.
#[derive(Clone, Debug)]
pub struct SolvedConstraint {
    /// The unknowns `u`: velocities that stay in the state, then quasi-velocities.
    pub unknowns: Vec<Unknown>,
    /// Velocities that the constraint determines, ascending.
    pub dependent: Vec<usize>,
    /// `Psi`, `[m][k]`.
    pub psi: Vec<Vec<ExprId>>,
    /// `psi0`, `[m]`; not zero for an affine constraint.
    pub psi0: Vec<ExprId>,
    /// `W`, `[m][k]`; equal to `Psi` when the displacements are those the constraint allows.
    pub virtual_displacements: Vec<Vec<ExprId>>,
    /// The one-forms that vanish on virtual displacements and carry the multipliers, with velocities on which they can
    /// be inverted.
    pub reactions: Reactions,
    /// The forms that were solved.
    pub rows: Vec<ConstraintRow>,
    /// Expressions that were divided by and are not known to be non-zero, with what to call them.
    pub pivots: Vec<(String, ExprId)>,
    /// How dependent velocities answer to the rows, where these contain derivatives of equations between positions.
    pub response: Option<Box<Response>>,
}

/// How dependent velocities answer to the rows: with `b_A` added to row `A`, `y = Psi u + psi0 + R b`.
///
/// Their accelerations at `udot = 0` are the answer to the rates of the rows at fixed velocities, which is shorter than
/// the rates of `Psi` where this has denominators.
#[derive(Clone, Debug)]
pub struct Response {
    /// Each row with the velocity that it was solved for.
    pub pairs: Vec<(usize, usize)>,
    /// Those of them that the model gives, one after the other.
    pub given: Vec<(usize, usize)>,
    /// `R`, `[m][n_rows]`.
    pub by_row: Vec<Vec<ExprId>>,
}

impl SolvedConstraint {
    /// `y^alpha = Psi^alpha_a u^a + psi0^alpha` of a dependent velocity.
    pub fn velocity(&self, g: &mut Graph, alpha: usize) -> ExprId {
        let mut terms = vec![self.psi0[alpha]];
        for (a, unknown) in self.unknowns.iter().enumerate() {
            let u = g.sym(unknown.symbol);
            terms.push(g.mul(self.psi[alpha][a], u));
        }
        g.sum(&terms)
    }

    /// Velocities of the frame that stay in the state, ascending.
    pub fn independent(&self) -> Vec<usize> {
        self.unknowns.iter().filter_map(|u| u.frame_idx).collect()
    }
}

/// An independent velocity.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unknown {
    /// Its name.
    pub name: String,
    /// Its symbol.
    pub symbol: SymbolId,
    /// The velocity of the frame that it is; `None` for a quasi-velocity.
    pub frame_idx: Option<usize>,
}

/// `E = sum_A lambda_A form_A`, invertible on the components `on`.
#[derive(Clone, Debug)]
pub struct Reactions {
    /// Names of the constraints.
    pub names: Vec<String>,
    /// `[n_constraints][m]`.
    pub one_forms: Vec<Vec<ExprId>>,
    /// Components of the frame that determine the multipliers.
    pub on: Vec<usize>,
}

/// A condition on accelerations, `w . ydot + w0 = 0`.
#[derive(Clone, Debug)]
pub struct AccelerationRow {
    /// Name of the constraint.
    pub name: String,
    /// The constraint as written.
    pub text: String,
    /// `w`; of a constraint of a mode `s w`.
    pub one_form: Vec<ExprId>,
    /// What `w0` comes from.
    pub source: AccelerationSource,
    /// `s`, for a constraint that holds while a mode is on: `(1 - s) lambda = 0`.
    pub mode: Option<SymbolId>,
}

/// Where a condition on accelerations comes from.
#[derive(Clone, Copy, Debug)]
pub enum AccelerationSource {
    /// The time derivative of a constraint `phi(x, y, t) = 0`.
    Differentiated(ExprId),
    /// A second-order constraint, given with its part `w0` without accelerations; for one of third order the
    /// acceleration `w . ydot` along it, which the state carries.
    Servo(ExprId),
}

/// How the kinematic constraint is carried.
#[derive(Clone, Debug)]
pub enum KinematicConstraint {
    /// Dependent velocities are eliminated. Without constraints `Psi` is the identity.
    Solved(SolvedConstraint),
    /// All velocities stay in the state; multipliers act along `reactions` and keep `rows`: second-order and nonlinear
    /// constraints, and linear ones for which no single choice of independent velocities is good on the whole domain.
    Multipliers {
        /// The conditions on accelerations.
        rows: Vec<AccelerationRow>,
        /// One-forms that vanish on virtual displacements, `[n_constraints][m]`.
        reactions: Vec<Vec<ExprId>>,
    },
}

impl KinematicConstraint {
    /// Every expression of the constraint and what it is.
    pub(super) fn expressions_mut(&mut self) -> Vec<(Part, &mut ExprId)> {
        let mut list: Vec<(Part, &mut ExprId)> = Vec::new();
        match self {
            KinematicConstraint::Solved(solved) => {
                let SolvedConstraint {
                    unknowns: _,
                    dependent: _,
                    psi,
                    psi0,
                    virtual_displacements,
                    reactions: Reactions { names: _, one_forms, on: _ },
                    rows,
                    pivots,
                    response,
                } = solved;
                for (k, row) in rows.iter_mut().enumerate() {
                    let ConstraintRow { name: _, text: _, one_form, offset, written } = row;
                    list.extend(
                        one_form.iter_mut().chain([offset]).chain(written).map(|e| (Part::Constraint(k), e)),
                    );
                }
                let by_row = response.iter_mut().flat_map(|r| r.by_row.iter_mut().flatten());
                let parts = psi.iter_mut().flatten().chain(psi0).chain(pivots.iter_mut().map(|(_, e)| e));
                let parts = parts.chain(by_row);
                list.extend(parts.map(|e| (Part::SolvedConstraint, e)));
                let parts = virtual_displacements.iter_mut().flatten().chain(one_forms.iter_mut().flatten());
                list.extend(parts.map(|e| (Part::VirtualDisplacement, e)));
            }
            KinematicConstraint::Multipliers { rows, reactions } => {
                for (k, row) in rows.iter_mut().enumerate() {
                    let AccelerationRow { name: _, text: _, one_form, source, mode: _ } = row;
                    let (AccelerationSource::Differentiated(e) | AccelerationSource::Servo(e)) = source;
                    list.extend(one_form.iter_mut().chain([e]).map(|e| (Part::Constraint(k), e)));
                }
                list.extend(reactions.iter_mut().flatten().map(|e| (Part::VirtualDisplacement, e)));
            }
        }
        list
    }

    /// The constraints, as written.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        let (rows, general) = match self {
            KinematicConstraint::Solved(solved) => (solved.rows.as_slice(), [].as_slice()),
            KinematicConstraint::Multipliers { rows, .. } => ([].as_slice(), rows.as_slice()),
        };
        rows.iter().map(|row| row.text.as_str()).chain(general.iter().map(|row| row.text.as_str()))
    }
}
