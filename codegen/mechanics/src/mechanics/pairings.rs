//! The parts of vertical and horizontal equations by stages, each with a name: `ad*`, the forms `a` and `b` of a level,
//! the curvature and the bracket with the connection, paired with the momentum.
//!
//! Does not know: equations of motion, how anything is printed.

use crate::reduction::VerticalKind;
use crate::reduction::{Stages, VerticalPart};
use hamel_expr::{Definition, ExprId, Graph};

/// A part of an equation, by velocities `eta` and momenta `beta` along the adapted basis `f`.
#[derive(Clone, Debug)]
pub struct Pairing {
    /// What it is.
    pub kind: PairingKind,
    /// Its name and its value; the name is for those who read to replace.
    pub definition: Definition,
}

/// What a [`Pairing`] is; levels by their place in the chain, elements by theirs in the adapted basis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PairingKind {
    /// A part of the vertical equation along the adapted element `f_k`.
    Level {
        /// Which one.
        kind: VerticalKind,
        /// `k`.
        element: usize,
    },
    /// `<beta, df_k/dt>`.
    Turning {
        /// `k`.
        element: usize,
    },
    /// `<beta, B(d_i, xdot)>` with the curvature of the connection.
    ShapeCurvature {
        /// `i`.
        coordinate: usize,
    },
    /// `<beta, [A_i, v]>`.
    ShapeBracket {
        /// `i`.
        coordinate: usize,
    },
    /// `<beta, [d/dt, D_i]>`.
    ShapeDrift {
        /// `i`.
        coordinate: usize,
    },
}

/// Names parts and keeps the list of them.
#[derive(Default)]
pub(super) struct Pairings {
    pub(super) list: Vec<Pairing>,
}

impl Pairings {
    /// A part by its name; zero has none.
    pub(super) fn named(&mut self, g: &mut Graph, kind: PairingKind, terms: &[ExprId]) -> ExprId {
        // A part that vanishes for one metric alone stands there all the same.
        let expr = g.sum(terms);
        if expr == g.zero() {
            return expr;
        }
        let symbol = g.define("pairing", expr);
        self.list.push(Pairing { kind, definition: Definition { symbol, expr } });
        g.sym(symbol)
    }

    /// The right sides of the vertical equations by stages, without what turns and what acts from outside:
    /// [`Stages::vertical_equations`] by names.
    pub(super) fn of_levels(
        &mut self,
        g: &mut Graph,
        stages: &Stages,
        (eta, beta): (&[ExprId], &[ExprId]),
    ) -> Vec<ExprId> {
        let mut right = vec![g.zero(); eta.len()];
        for VerticalPart { element, kind, value } in stages.vertical_parts(g, eta, beta) {
            let named = self.named(g, PairingKind::Level { kind, element }, &[value]);
            let term = if kind.is_negative() { g.neg(named) } else { named };
            right[element] = g.add(right[element], term);
        }
        right
    }
}
