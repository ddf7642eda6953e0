//! The rows of a constraint by names, in the order in which they are answered.
//!
//! Deliberately does not know: what is written on the way, what velocities are used for.

use crate::reduction::Response;
use hamel_expr::{ExprId, Graph};

/// The rows of a constraint by names, and how they are answered.
pub(super) struct Rows {
    /// Coefficients of the rows.
    pub(super) forms: Vec<Vec<ExprId>>,
    /// Names in them with their values.
    pub(super) coefficients: Vec<(ExprId, ExprId)>,
    pub(super) order: Order,
    /// Rows that are solved one after the other, where no others are solved together.
    pub(super) chain: Option<Chain>,
    /// How dependent velocities answer to the rows that are solved together.
    pub(super) response: Response,
}

/// Velocities answered row by row.
pub(super) struct Answered {
    pub(super) rows: Rows,
    /// `Psi` by names.
    pub(super) partial: Vec<Vec<ExprId>>,
}

/// Which rows give their velocity by others, in an order in which these are known, and which are solved together.
pub(super) struct Order {
    pub(super) direct: Vec<(usize, usize)>,
    pub(super) together: Vec<(usize, usize)>,
}

impl Rows {
    /// `-(form x + right)` without the own component, divided by its coefficient.
    pub(super) fn direct_answer(
        &self,
        g: &mut Graph,
        (row, own): (usize, usize),
        right: &[ExprId],
        x: &[ExprId],
    ) -> ExprId {
        let form = &self.forms[row];
        let mut terms = vec![right[row]];
        for (alpha, value) in x.iter().enumerate().filter(|(alpha, _)| *alpha != own) {
            terms.push(g.mul(form[alpha], *value));
        }
        let sum = g.sum(&terms);
        let inverse = g.powi(form[own], -1);
        let value = g.mul(sum, inverse);
        g.neg(value)
    }

    /// The unit vector of a component, with what the direct rows answer to it.
    pub(super) fn along(&self, g: &mut Graph, column: usize, width: usize) -> Vec<ExprId> {
        let right = vec![g.zero(); self.forms.len()];
        let mut x = vec![g.zero(); width];
        x[column] = g.one();
        for pair in &self.order.direct {
            x[pair.1] = self.direct_answer(g, *pair, &right, &x);
        }
        x
    }
}

impl Order {
    /// The order of the rows. As few as possible are solved together: those that the model says give a velocity, those
    /// whose own velocity has no number before it, and as many others as are needed where rows wait for each other.
    pub(super) fn new(g: &Graph, forms: &[Vec<ExprId>], response: &Response) -> Order {
        let is_number = |pair: &(usize, usize)| {
            let (row, own) = *pair;
            forms[row][own] != g.zero()
                && g.as_rational(forms[row][own]).is_some()
                && !response.given.contains(pair)
        };
        let (mut numbers, mut together): (Vec<_>, Vec<_>) =
            response.pairs.iter().copied().partition(is_number);
        loop {
            let (mut direct, mut waiting) = (Vec::new(), numbers.clone());
            loop {
                let is_ready = |(row, own): &(usize, usize)| {
                    let mut others = waiting.iter().filter(|(_, other)| other != own);
                    others.all(|(_, other)| forms[*row][*other] == g.zero())
                };
                let Some(place) = waiting.iter().position(is_ready) else { break };
                direct.push(waiting.remove(place));
            }
            match waiting.last() {
                None => return Order { direct, together },
                Some(last) => {
                    let last = *last;
                    numbers.retain(|pair| *pair != last);
                    together.push(last);
                }
            }
        }
    }
}

/// Rows that give their velocities one after the other, brought to a triangle by elimination without a choice of
/// pivots: `y_own = -(form y + right)` by velocities of later rows and independent ones.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    /// In the order in which rows are eliminated.
    pub(super) links: Vec<Link>,
}

/// A row of a chain.
#[derive(Clone, Debug)]
pub(super) struct Link {
    pub(super) row: usize,
    pub(super) own: usize,
    /// What the velocities of rows before are multiplied by, in their order.
    pub(super) before: Vec<ExprId>,
    /// The reciprocal of what is left of the coefficient of the own velocity.
    pub(super) scale: ExprId,
    /// Coefficients divided by that, zero at velocities that rows before or direct rows give.
    pub(super) form: Vec<ExprId>,
}
